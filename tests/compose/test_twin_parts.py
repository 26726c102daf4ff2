"""Parts under another name, made by copies of their code, give the numbers, texts, verdict and page of the originals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import pytest
from campaign import sampled
from copies import TWIN, renamed
from features import FEATURES, Case
from test_method_twins import case_of

from runtime import compose
from runtime.ground.errors import InputError


def identified(case: Case) -> Any:
    return compose.identify(
        case.model, case.records, case.study, further=case.unseen, physical=True, friction=True
    )


def checked(case: Case) -> Any:
    return compose.identify(
        case.model, case.records, case.study, further=case.unseen, plausible=True
    )


def assessed(case: Case) -> Any:
    return compose.assess(case.model, case.records, case.study)


ENTRIES: Mapping[str, Callable[[Case], Any]] = {
    "identify": identified,
    "identify, plausible": checked,
    "assess": assessed,
}


def answer(result: Any) -> list[str]:
    """All that an identification says, without the names of the twins."""
    said = [
        result.to_json(),
        result.to_text(),
        str(result),
        result.verdict,
        str(result.checklist.to_text()),
        *(
            str((figure.caption, figure.alt, figure.name))
            for part in result.parts
            for figure in part.figures()
        ),
        *(table.to_text() for part in result.parts for table in part.tables()),
        *result.missing,
    ]
    return [text.replace(TWIN, "") for text in said]


CASES = [(feature, entry) for feature in FEATURES for entry in ENTRIES]


@pytest.mark.parametrize(
    "cell",
    sampled(
        CASES,
        1,
        always=[
            ("nothing", "identify"),
            ("nothing", "identify, plausible"),
            ("fitted scalars", "identify"),
            ("counts", "identify"),
            ("missing samples", "assess"),
        ],
        more=20,
    ),
)
def test_parts_under_another_name_are_the_parts(cell, monkeypatch):
    feature, entry = cell
    case = case_of(feature)
    try:
        expected = ENTRIES[entry](case)
    except InputError as refusal:
        pytest.skip(str(refusal))
    monkeypatch.setattr(compose, "EXTRAS", [renamed(extra) for extra in compose.EXTRAS])
    found = ENTRIES[entry](case)
    names = [part.name for part in expected.parts]
    assert [part.name for part in found.parts] == [TWIN + name for name in names]
    assert answer(found) == answer(expected)
