"""Steps that are copies of the code under another name give the numbers and the texts of the originals at every entry point."""

from __future__ import annotations

import pytest
from campaign import sampled
from copies import copied
from features import FEATURES
from test_method_twins import ENTRIES, answer, case_of

from runtime import compose

ENTRY_POINTS = ENTRIES | {
    "delay": lambda case: answer(
        lambda *given: compose.delay(given[0], given[1][0], given[2]), case
    ),
    "assess": lambda case: answer(compose.assess, case),
}
CASES = [(feature, entry) for feature in FEATURES for entry in ENTRY_POINTS]


@pytest.mark.parametrize(
    "cell",
    sampled(
        CASES,
        2,
        always=[
            *((feature, "estimate") for feature in FEATURES),
            ("force sensors", "identify"),
            ("drive commands", "identify"),
            ("drive commands", "cestac"),
            ("fitted scalars", "essential"),
            ("torque median", "identify"),
            ("law, kd: fit", "identify"),
            ("recorded speeds", "advise"),
            ("link side", "plausibility"),
        ],
        more=40,
    ),
)
def test_steps_under_another_name_are_the_steps(cell, monkeypatch):
    feature, entry = cell
    case = case_of(feature)
    expected = ENTRY_POINTS[entry](case)
    monkeypatch.setattr(compose, "STEPS", [copied(step) for step in compose.STEPS])
    assert ENTRY_POINTS[entry](case) == expected
