"""A method under another name: every entry point gives the numbers and the texts of the method.

A name of a method that the code asks for, outside METHODS, shows here.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from campaign import sampled
from features import FEATURES, Case

from runtime import compose
from runtime.ground.errors import InputError

FOLDER = TemporaryDirectory()
METHODS = {
    "ols": {},
    "wls": {"weights": "joint"},
    "irls": {},
    "feasible": {},
}
"""Methods that need no closed loop, with settings of estimate."""


def twin(method: str) -> str:
    """Another name, as long as that of the method: columns of tables keep their width."""
    return "q" * len(method)


def same(text: str, method: str) -> str:
    """The text with the name of the method in place of that of its twin."""
    name = twin(method)
    return text.replace(name.upper(), method.upper()).replace(name, method)


def answer(call: Callable[..., Any], case: Case, **options: Any) -> str:
    """JSON and text of an answer, or the sentence of the error."""
    try:
        found = call(case.model, case.records, case.study, **options)
        return found.to_json() + str(found)
    except InputError as error:
        return str(error)


ENTRIES: Mapping[str, Callable[[Case], str]] = {
    "identify": lambda case: answer(compose.identify, case, further=case.unseen, physical=True),
    "essential": partial(answer, compose.essential),
    "estimate": partial(answer, compose.estimate),
    "cestac": partial(answer, compose.cestac),
    "advise": partial(answer, compose.advise, asked=(2e-3,), confirm=False),
    "plausibility": partial(answer, compose.plausibility),
}


@cache
def case_of(feature: str) -> Case:
    """The case of a feature, made once."""
    folder = Path(FOLDER.name) / "".join(filter(str.isalnum, feature))
    folder.mkdir()
    return FEATURES[feature](folder)


CASES = [
    (feature, method, entry) for feature in FEATURES for method in METHODS for entry in ENTRIES
]


@pytest.mark.parametrize(
    "cell",
    sampled(
        CASES,
        2,
        always=[
            *(("nothing", "ols", entry) for entry in ENTRIES),
            ("nothing", "wls", "identify"),
            ("nothing", "irls", "cestac"),
            ("nothing", "feasible", "identify"),
            ("force sensors", "ols", "identify"),
        ],
        more=30,
    ),
)
def test_a_method_under_another_name_is_the_method(cell, monkeypatch):
    feature, method, entry = cell
    case = case_of(feature)

    def by(name):
        estimate = replace(case.study.estimate, method=name, **METHODS[method])
        return ENTRIES[entry](replace(case, study=replace(case.study, estimate=estimate)))

    expected = by(method)
    monkeypatch.setitem(compose.METHODS, twin(method), compose.METHODS[method])
    assert same(by(twin(method)), method) == expected


def test_the_physical_set_is_fitted_by_the_physical_method_of_the_list(monkeypatch):
    """The set keeps its name; without such a method there is no physical set."""
    case = case_of("nothing")

    def identified():
        return compose.identify(case.model, case.records, case.study, further=case.unseen)

    expected = identified()
    others = dict(compose.METHODS)  # another list: the order of this one is that of messages
    physical = others.pop("feasible")
    monkeypatch.setattr(compose, "METHODS", others)
    assert list(identified().sets) == ["essential", "all"]
    monkeypatch.setattr(compose, "METHODS", {**others, twin("feasible"): physical})
    found = identified()
    assert found.sets["feasible"].method == twin("feasible")
    assert same(found.to_json(), "feasible") == expected.to_json()
