"""Write the correction of an error (a Cause) as lines of a study.

    q' = P q + p,  tau' = T tau        record.columns, scale, units, side, rate; robot.drives
    free_alpha3 ...                    robot.frames;  free_gx ...  robot.gravity
    the zero of joint j                robot.frames: {j: {theta: qj + theta_j + p}}

For files on the motor side, P and T become E_q = R P R^-1 and E_tau = R'^-1 T R', with R the gear
ratio. A matrix E with one element in each row means an order of the columns, with a factor for
each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.core.drives import Drives
from runtime.core.model import GeneratedModel
from runtime.ground.settings import structure
from runtime.plausible.causes import ENTRY, GRAVITY, Cause
from runtime.reading.records import columns_read
from runtime.reading.settings import RecordSettings
from runtime.reading.units import position_unit, torque_unit

Array = np.ndarray
Lines = dict[str, Any]
"""A study, or a section of it, as plain values."""
Columns = Callable[[Lines], tuple[Sequence[str], Sequence[str]]]
"""Names of the columns q and tau of a record, from its settings."""

BEFORE_S = {1e3: "ms", 1e6: "us", 1e9: "ns"}
"""Units of time that are read as s, by the factor on the sampling rate that corrects them."""
OF_POSITIONS, OF_TORQUES = ("q", "q_ref", "qd", "qd_ref"), ("tau", "tau_ff")
DIGITS = 4
"""Decimals of angles and lengths, rad and m, and of gravity."""


@dataclass(frozen=True, eq=False)
class Place:
    """Data on robot and records that decide how a correction is written into a study.

    Attributes
    ----------
    joints : tuple of int
        Numbers of the frames of the n joints.
    turning : ndarray of bool, shape (n,)
    drives : Drives or None
        Drives of the robot file.
    rate : float, Hz
        Sampling rate of the records as they were read.
    timed : bool
        Whether time stamps give this rate.
    columns : Columns
    """

    joints: tuple[int, ...]
    turning: Array
    drives: Drives | None
    rate: float
    timed: bool
    columns: Columns

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)


def columns_in(model: GeneratedModel, folder: str | Path | None) -> Columns:
    """Make the function that names the columns of a record: as stated, as in its files, or q1 ...

    folder : folder of the files of the study.
    """

    def columns(record: Lines) -> tuple[Sequence[str], Sequence[str]]:
        own = structure(RecordSettings, record)
        if own.files and not (own.columns.q and own.columns.tau):
            named = columns_read(own, model, folder)
            return named.q, named.tau
        numbers = range(1, len(model.JOINTS) + 1)
        q, tau = ([f"{key}{j}" for j in numbers] for key in ("q", "tau"))
        return own.columns.q or q, own.columns.tau or tau

    return columns


def records_in(study: Lines) -> Iterator[Lines]:
    """Yield the settings of all records of a study: fitted, for validation, and with a load."""
    yield from study["record"]
    yield from study["validate"].get("record", ())
    yield from (study.get("payload") or {}).get("record", ())


def edited(
    study: Lines, cause: Cause, place: Place, constants: Mapping[str, float]
) -> Lines | None:
    """Write a study in which one error is corrected; None if no line of a study corrects it.

    constants : entries of the table of frames and gravity with which the study is read, including
      those of the cause.
    """
    study = deepcopy(study)
    if cause.constants:
        return study if _in_table(study, cause.constants, place, constants) else None
    if cause.kind == "coupling":
        return study if _coupled(study, cause, place) else None
    edit = _EDITS.get(cause.kind, _in_columns)
    return study if all(edit(record, cause, place) for record in records_in(study)) else None


def _in_table(
    study: Lines, changed: Mapping[str, float], place: Place, constants: Mapping[str, float]
) -> bool:
    """Write entries of the table of frames, or gravity, in the section `robot`."""
    robot = study["robot"] = study.get("robot") or {}
    if {*changed} & {*GRAVITY}:
        robot["gravity"] = [constants.get(key, 0.0) for key in GRAVITY]
    for key, value in changed.items():
        if key in GRAVITY:
            continue
        name, frame = _entry(key)
        row = robot.setdefault("frames", {}).setdefault(str(frame), {})
        row[name] = with_variable(name, frame, value, place)
    return True


def _entry(key: str) -> tuple[str, int]:
    """Return the name of an entry of the table, and the number of its frame: free_theta3."""
    found = ENTRY.fullmatch(key)
    if found:
        return found[1], int(found[2])
    name = "theta" if key.startswith("free_theta") else "gamma"
    return name, int(key.removeprefix(f"free_{name}"))


def with_variable(name: str, frame: int, value: float, place: Place) -> float | str:
    """Write the entry of a frame; theta of a revolute joint and r of a prismatic joint contain q."""
    text = angle_text(value) if name in ("alpha", "theta", "gamma") else f"{value:g}"
    own = place.joints.index(frame) if frame in place.joints else None
    if own is None or name != ("theta" if place.turning[own] else "r"):
        return text if "pi" in text else value
    if value == 0:
        return f"q{frame}"
    return f"q{frame} {'-' if value < 0 else '+'} {text.removeprefix('-')}"


def angle_text(x: float) -> str:
    """Write an angle as a multiple of pi/2 if it is one, otherwise in rad."""
    quarter = x / (np.pi / 2)
    if abs(quarter - round(quarter)) > 1e-9 or abs(quarter) > 4.5:
        return f"{x:.10g}"
    return {0: "0", 1: "pi/2", 2: "pi", 3: "3*pi/2", 4: "2*pi"}[abs(round(quarter))].join(
        ("-" if quarter < -0.5 else "", "")
    )


def rounded(x: float) -> float:
    """Round an angle, a length or a component of gravity; multiples of pi/2 stay exact."""
    quarter = x / (np.pi / 2)
    if abs(quarter - round(quarter)) < 1e-6:
        return float(round(quarter) * np.pi / 2)
    return float(round(x, DIGITS))


def monomial(E: Array) -> tuple[list[int], Array] | None:
    """Write a matrix as an order of columns and factors: row i is factors[i] at order[i].

    Return None if a row does not have exactly one element.
    """
    large = np.abs(E) > 1e-9 * np.abs(E).max()
    if not ((large.sum(axis=0) == 1).all() and (large.sum(axis=1) == 1).all()):
        return None
    order = [int(k) for k in large.argmax(axis=1)]
    return order, E[np.arange(len(E)), order]


def of_files(cause: Cause, sides: tuple[str, str], drives: Drives | None) -> tuple[Array, Array]:
    """Compute the changes E_q and E_tau of the columns of the files, shape (n, n) each."""
    R = np.eye(len(cause.p)) if drives is None else drives.ratio
    E_q, E_tau = cause.P, cause.T
    if sides[0] == "motor":
        E_q = R @ E_q @ np.linalg.inv(R)
    if sides[1] == "motor":
        E_tau = np.linalg.inv(R.T) @ E_tau @ R.T
    return E_q, E_tau


def sides_of(record: Lines) -> tuple[str, str]:
    """Return the sides of positions and torques in the settings of a record."""
    return record["side"], record["torque_side"] or record["side"]


def _in_columns(record: Lines, cause: Cause, place: Place) -> bool:
    """Write another order, other units, or factors of the columns of a record."""
    for key, E in zip(("q", "tau"), of_files(cause, sides_of(record), place.drives), strict=True):
        unit = cause.change.get(f"record.units.{key}")
        if unit is not None and _converts(key, record["units"][key], unit, E):
            record["units"][key] = unit
            continue
        found = monomial(E)
        if found is None:
            return False
        order, factors = found
        if order != [*range(place.n)] and not _ordered(record, key, order, place):
            return False
        if not np.allclose(factors, 1.0, atol=1e-12) and not _scaled(record, key, factors, place.n):
            return False
    return True


def _converts(key: str, old: Any, new: Any, E: Array) -> bool:
    """Whether other units of the columns are the factors on the diagonal of E."""
    factor = position_unit if key == "q" else torque_unit
    n = len(E)
    before, after = ([x] * n if isinstance(x, str) else list(x) for x in (old, new))
    factors = [factor(b)[1] / factor(a)[1] for a, b in zip(before, after, strict=True)]
    # rad of a joint that slides are m
    return bool(np.allclose(np.diag(factors), E, rtol=1e-6, atol=0))


def _ordered(record: Lines, key: str, order: list[int], place: Place) -> bool:
    """Write the columns of positions or torques in another order, with their units and factors."""
    names = dict(zip(("q", "tau"), place.columns(record), strict=True))[key]
    if len(names) != place.n:
        return False
    columns = record["columns"]
    columns[key] = [names[k] for k in order]
    for other in (OF_POSITIONS if key == "q" else OF_TORQUES)[1:]:
        if columns.get(other):
            columns[other] = [columns[other][k] for k in order]
    settings = [(record["units"], key), (record["scale"], key)]
    whole = ("counts_per_revolution",) if key == "q" else ("torque_constant", "delay")
    settings += [(record, name) for name in whole]
    for section, name in settings:
        if isinstance(given := section[name], list) and len(given) == place.n:
            section[name] = [given[k] for k in order]
    return True


def _scaled(record: Lines, key: str, factors: Array, n: int) -> bool:
    """Multiply the factors of the columns of a record; return False if a name in the file gives
    these factors.
    """
    given = record["scale"][key]
    if isinstance(given, str):
        return False
    scale = [float(f"{x:.10g}") for x in np.broadcast_to(np.asarray(given, float), (n,)) * factors]
    record["scale"][key] = scale[0] if len({*scale}) == 1 else scale
    return True


def _at_side(record: Lines, cause: Cause, place: Place) -> bool:
    """Write another side of positions or torques; return False if the cause changes something else."""
    before, still = sides_of(record), np.eye(place.n)
    for key, side in cause.change.items():
        record[key.removeprefix("record.")] = side
    moved = [a != b for a, b in zip(before, sides_of(record), strict=True)]
    changed = [not np.array_equal(x, still) for x in (cause.P, cause.T)]
    return bool(cause.change) and place.drives is not None and moved == changed


def _at_rate(record: Lines, cause: Cause, place: Place) -> bool:
    """Write a corrected unit of time, or a sampling rate in place of the time column.

    A delay is a number of samples: its time becomes shorter as the rate becomes higher.
    """
    unit = next((u for f, u in BEFORE_S.items() if np.isclose(f, cause.rate)), "")
    if place.timed and unit and record["units"]["t"] == "s":
        record["units"]["t"] = unit
    elif record["resample"] is not None:
        return False
    else:
        record["rate"] = float(f"{cause.rate * (record['rate'] or place.rate):.10g}")
        record["columns"]["t"] = None
    record["delay"] = _short(np.asarray(record["delay"], dtype=float) / cause.rate)
    return True


def _coupled(study: Lines, cause: Cause, place: Place) -> bool:
    """Write the coupling of two drives as an element of the matrix of gear ratios.

    With q = R^-1 qm + offset, q' = P q needs R' = R P^-1 and offset' = P offset.
    """
    robot = study["robot"] = study.get("robot") or {}
    drives, still = place.drives, np.eye(place.n)
    given = robot.get("drives") or {}
    both = [not np.array_equal(x, still) for x in (cause.P, cause.T)]
    P = cause.P if both[0] else np.linalg.inv(cause.T).T
    sides = {sides_of(record) for record in records_in(study)}
    if sides == {("joint", "joint")} and drives is None and not given:
        R, offset = still, np.zeros(place.n)
    elif sides == {("motor", "motor")} and drives is not None and not given:
        R, offset = drives.ratio, drives.offset
    else:
        return False
    ratio = R @ np.linalg.inv(P)
    robot["drives"] = {"ratio": [[float(f"{x:.10g}") for x in row] for row in ratio]}
    if offset.any() and both[0]:
        robot["drives"]["offset"] = [float(x) for x in P @ offset]
    for record in records_in(study):
        record["side"], record["torque_side"] = "motor", None
        record["coupling"] = "both" if all(both) else "position" if both[0] else "torque"
    return True


_EDITS: dict[str, Callable[[Lines, Cause, Place], bool]] = {"side": _at_side, "rate": _at_rate}


def delayed(study: Lines, by: Array) -> Lines:
    """Add to the delay of the torques of each joint, s, in all records of a study."""
    study = deepcopy(study)
    for record in records_in(study):
        record["delay"] = _short(np.asarray(record["delay"], dtype=float) + by)
    return study


def _short(seconds: Array) -> float | list[float]:
    """Write delays, s, without the last digits of a sum: one number if all joints have the same."""
    values = [float(x) for x in np.atleast_1d(np.round(seconds, 12) + 0.0)]
    return values[0] if len({*values}) == 1 else values


def differences(before: Any, after: Any, path: tuple[str | int, ...] = ()) -> Iterator[Lines]:
    """Yield the lines that differ between two studies: path, value before, value after."""
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        for key in after:
            yield from differences(before.get(key), after[key], (*path, key))
    elif isinstance(after, Mapping) and before is None:
        for key in after:
            yield from differences(None, after[key], (*path, key))
    elif isinstance(before, list | tuple) and isinstance(after, list) and _tables(after):
        for k, (a, b) in enumerate(zip(before, after, strict=True)):
            yield from differences(a, b, (*path, k))
    elif before != after and not (before is None and after in ({}, [])):
        yield {"path": path, "before": before, "after": after}


def _tables(values: list[Any]) -> bool:
    return bool(values) and all(isinstance(x, Mapping) for x in values)
