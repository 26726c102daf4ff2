"""Fit torques measured behind the gears, without friction and inertia of the drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from runtime.core.model import elements_of
from runtime.core.problem import Problem
from runtime.core.record import Record
from runtime.core.settings import require

OF_DRIVES = ("inertia", "viscous", "coulomb")
"""Kinds of elements in which sensors behind the gears have no part."""


def torques_of_links(problem: Problem) -> Problem:
    """Leave friction and inertia of drives out of the fit if torques are measured behind gears.

    This is a step of the preparation of a problem. It acts only if estimate.columns is all. Records
    that do not tell their sides (`Origin.sides`) have those of the study.
    """
    settings: Any = problem.settings
    stated = [
        (", ".join(record.files) or "the study", record.sides)
        for record in (*settings.record, *settings.validate.record)
    ]
    links = _behind_gears((*problem.records, *problem.unseen), stated)
    if settings.estimate.columns != "all" or not links:
        return problem
    kinds = {name: element[0] for name, element in elements_of(problem.model).items()}
    columns = tuple(
        name for name in problem.model.BASE_PARAMETERS if kinds.get(name) not in OF_DRIVES
    )
    estimate = replace(settings.estimate, columns=columns)
    return problem.changed(settings=replace(settings, estimate=estimate))


def _behind_gears(records: Sequence[Record], stated: Sequence[tuple[str, tuple[str, str]]]) -> bool:
    """Whether the torques of the records are measured behind the gears.

    SettingsError if this is true for one record and false for another.

    stated : files, and sides of positions and torques, by the settings of the study. They count if
    a record does not tell its own, and wherever they say that torques are measured behind the
    gears.
    """
    told = [(record.file, record.origin.sides) for record in records]
    silent = not told or any(own is None for _, own in told)
    sides = {(name, own[1]) for name, own in told if own is not None}
    sides |= {(name, tau) for name, (_, tau) in stated if silent or tau == "link"}
    behind = sorted({name for name, tau in sides if tau == "link"})
    others = sorted({name for name, tau in sides if tau != "link"})
    message = (
        f"torques are measured behind the gears (side: link) in {', '.join(behind)} and not in "
        f"{', '.join(others)}; use records of one side, or fit them in studies of their own"
    )
    require(not (behind and others), message, "record")
    return bool(behind)
