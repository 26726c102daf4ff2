"""Of several findings, the one that explains most is named first."""

from __future__ import annotations

from runtime.ground.check import Check, worst_of


def check(question, state, explains=0.0, outcome=False):
    return Check(question, state, "", explains=explains, outcome=outcome)


def test_the_first_of_the_worst_state_is_named_unless_another_explains_more() -> None:
    weak, strong = check("weak", "doubtful"), check("strong", "doubtful", 0.4)
    assert worst_of([weak, strong]) is strong
    assert worst_of([strong, check("later", "doubtful", 0.3)]) is strong
    assert worst_of([weak, check("good", "good", 0.9)]) is weak
    assert worst_of([check("good", "good")]) is None


def test_a_doubt_that_explains_comes_before_a_bad_result_but_not_before_a_bad_cause() -> None:
    delay = check("delay", "doubtful", 0.3)
    result, cause = check("result", "no", outcome=True), check("cause", "no")
    assert worst_of([delay, result]) is delay
    assert worst_of([delay, cause]) is cause
    assert worst_of([delay, cause, result]) is cause
