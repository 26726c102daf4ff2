"""Fit torques measured behind the gears, without friction and inertia of the drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from runtime.core.model import elements_of
from runtime.core.problem import Problem
from runtime.core.record import Record
from runtime.ground.settings import require

OF_DRIVES = ("inertia", "viscous", "coulomb")
"""Kinds of elements in which sensors behind the gears have no part."""


def stated_sides(problem: Problem) -> Problem:
    """Note in each record the sides of the gears at which it was measured, as the study states them.

    This is a step of the preparation of a problem. Records that state their own sides
    (`Origin.sides`) are not changed.
    """
    settings: Any = problem.settings
    loaded = () if settings.payload is None else settings.payload.record
    fitted, unseen = settings.record, (*settings.validate.record, *loaded)
    records = _with_sides(problem.records, fitted)
    others = _with_sides(problem.unseen, unseen or fitted)
    if records == problem.records and others == problem.unseen:
        return problem
    return problem.changed(records=records, unseen=others)


def _with_sides(records: Sequence[Record], stated: Sequence[Any]) -> tuple[Record, ...]:
    """Give each record without stated sides the sides of its settings, which are one entry per
    record.

    If the numbers of records and settings differ, all settings must have the same side of torques.
    """
    if not stated or all(record.origin.sides is not None for record in records):
        return tuple(records)
    if len(stated) != len(records):
        _require_one_side([(", ".join(own.files) or "the study", own.sides[1]) for own in stated])
        stated = [stated[0]] * len(records)
    return tuple(
        record
        if record.origin.sides is not None
        else replace(record, origin=replace(record.origin, sides=own.sides))
        for record, own in zip(records, stated, strict=True)
    )


def torques_of_links(problem: Problem) -> Problem:
    """Leave friction and inertia of drives out of the fit if torques are measured behind gears.

    This is a step of the preparation of a problem. The step acts only if estimate.columns is all.

    Raises
    ------
    SettingsError
        Torques are measured behind the gears in one record and not in another, or the study states
        this for a file whose record states otherwise.
    """
    settings: Any = problem.settings
    sides = [(record.file, record.sides[1]) for record in (*problem.records, *problem.unseen)]
    for own in (*settings.record, *settings.validate.record):
        if own.sides[1] == "link" or not sides:
            sides.append((", ".join(own.files) or "the study", own.sides[1]))
    links = _require_one_side(sides)
    if settings.estimate.columns != "all" or not links:
        return problem
    kinds = {name: element[0] for name, element in elements_of(problem.model).items()}
    columns = tuple(
        name for name in problem.model.BASE_PARAMETERS if kinds.get(name) not in OF_DRIVES
    )
    estimate = replace(settings.estimate, columns=columns)
    return problem.changed(settings=replace(settings, estimate=estimate))


def _require_one_side(sides: Sequence[tuple[str, str]]) -> bool:
    """Whether torques are measured behind the gears; raise SettingsError if this holds for one file
    and not for another.

    sides : name of each file, and side of its torques.
    """
    behind = sorted({name for name, tau in sides if tau == "link"})
    others = sorted({name for name, tau in sides if tau != "link"})
    message = (
        f"torques are measured behind the gears (side: link) in {', '.join(behind)} and not in "
        f"{', '.join(others)}; use records of one side, or fit them in studies of their own"
    )
    require(not (behind and others), message, "record")
    return bool(behind)
