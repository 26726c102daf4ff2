"""Conversion of the units of measured columns to SI; all other modules use SI only.

    position_unit("deg")     ("angle", 0.017453292519943295)
    torque_unit("mA")        ("current", 0.001): the torque constant of the drive does the rest
    speed("30 rpm")          3.141592653589793

The units of most records are in a table. Other units are converted by pint, which is loaded only
then, and which finds the kind of a unit by its dimension. A grammar checks a unit before pint
parses it: names, products, quotients and small powers, no numbers and no calls. Factors are
computed as fractions and rounded once.
"""

from __future__ import annotations

import re
from fractions import Fraction
from functools import cache
from math import pi
from typing import Any

import numpy as np

from runtime.ground.errors import InputError

Array = np.ndarray
Unit = tuple[str, float]  # kind and factor to the SI unit of its kind

TABLE: dict[str, Unit] = {
    "rad": ("angle", 1.0),
    "deg": ("angle", pi / 180),
    "°": ("angle", pi / 180),
    "rev": ("angle", 2 * pi),
    "counts": ("counts", 2 * pi),  # to be divided by the counts per revolution
    "count": ("counts", 2 * pi),
    "m": ("length", 1.0),
    "mm": ("length", 1e-3),
    "N*m": ("torque", 1.0),
    "Nm": ("torque", 1.0),  # pint reads a number metre
    "mNm": ("torque", 1e-3),
    "kN*m": ("torque", 1e3),
    "N*mm": ("torque", 1e-3),
    "N*cm": ("torque", 1e-2),
    "kgf*cm": ("torque", 0.0980665),
    "lbf*inch": ("torque", 0.1129848290276167),
    "ozf*inch": ("torque", 0.0070615518142260435),
    "N": ("force", 1.0),
    "A": ("current", 1.0),
    "V": ("voltage", 1.0),
    "mA": ("current", 1e-3),
    "s": ("time", 1.0),
    "ms": ("time", 1e-3),
    "us": ("time", 1e-6),
    "ns": ("time", 1e-9),
    "rad/s": ("angular speed", 1.0),
    "m/s": ("speed", 1.0),
}
SI = {
    "angle": "radian",
    "length": "meter",
    "torque": "kilogram*meter**2/second**2",
    "force": "kilogram*meter/second**2",
    "current": "ampere",
    "voltage": "kilogram*meter**2/ampere/second**3",
    "time": "second",
    "angular speed": "radian/second",
    "speed": "meter/second",
}
POSITIONS, TORQUES, TIMES, SPEEDS = (
    ("angle", "counts", "length"),
    ("torque", "force", "current", "voltage"),
    ("time",),
    ("angular speed", "speed"),
)
COMMANDS = ("current", "voltage")  # a torque constant turns these into torque or force
EXAMPLES = {
    POSITIONS: "rad, deg, rev, mrad, arcmin, counts, m, mm, inch",
    TORQUES: "N*m, mN*m, lbf*ft, ozf*inch, N, kgf, A, mA, V",
    TIMES: "s, ms, us, ns",
    SPEEDS: "rad/s, deg/s, rpm, rev/s, m/s, mm/s",
}
LARGEST = (
    1e5  # SI; units above are slips of the shift key: MA for mA, Grad (which is 1e9 rad) for deg
)
SLOWEST = 0.2  # s; a longer sampling period is read as one of a smaller unit
LONGEST = 40  # characters
FACTOR = r"[^\W\d]{1,24}(?:(?:\*\*|\^)-?[1-4])?"
GRAMMAR = re.compile(rf"{FACTOR}(?:\s?[*/·]\s?{FACTOR}| {FACTOR}){{0,3}}")
QUANTITY = re.compile(r"\s*([-+]?[0-9.]{1,30}(?:[eE][-+]?[0-9]{1,3})?)\s*([^\W\d].{0,40})")


def position_unit(text: str) -> Unit:
    """Return the kind of a position unit (angle, length, counts) and its factor to rad or m.

    The factor of counts must still be divided by the counts per revolution.
    """
    return _unit(text, POSITIONS)


def torque_unit(text: str) -> Unit:
    """Return the kind of a torque unit (torque, current ...) and its factor to N m, N, A or V.

    The kind is "torque", "force", "current" or "voltage".
    """
    return _unit(text, TORQUES)


def time_unit(text: str) -> float:
    """Return the factor that converts a unit of time to s."""
    return _unit(text, TIMES)[1]


def speed_unit(text: str) -> float:
    """Return the factor that converts a unit of speed to rad/s or m/s."""
    return _unit(text, SPEEDS)[1]


def likely_time_unit(t: Array) -> str:
    """Find the unit of time stamps by their size: s, ms, us or ns.

    The sampling period of a record of a robot is between 0.2 ms and 0.2 s; the median step of the
    stamps lies in this range in one of the four units.

    t : ndarray, shape (N,), or an array of one column.
    """
    t = np.asarray(t, dtype=float).reshape(-1)
    step = np.diff(t[np.isfinite(t)])
    step = step[step > 0]
    if not len(step):
        return "s"
    median = float(np.median(step))
    return next((x for x in ("s", "ms", "us", "ns") if median * TABLE[x][1] <= SLOWEST), "s")


def speed(value: Any) -> Any:
    """Convert a speed with a unit, such as "30 rpm", or a list of speeds, to rad/s or m/s.

    A value without unit is returned as it is.
    """
    if isinstance(value, list | tuple):
        return [speed(x) for x in value]
    if isinstance(value, str) and (quantity := QUANTITY.fullmatch(value)):
        try:
            return float(quantity[1]) * _unit(quantity[2].strip(), SPEEDS)[1]
        except ValueError as e:
            raise (
                e
                if isinstance(e, InputError)
                else InputError(f"{value!r}; expected a number and a unit such as 30 rpm")
            ) from None
    return value


def _unit(text: str, kinds: tuple[str, ...]) -> Unit:
    if text == "grad":
        raise InputError("'grad' can mean 1/400 of a turn or a degree; write gon or deg instead")
    if kinds == TORQUES and text.strip() in ("%", "percent", "per cent"):
        raise InputError(
            f"{text!r} is a share of a rated value that is not given; write the unit of the rated "
            "value (such as A or N*m) in record.units.tau, and a hundredth of the rated value of "
            "each joint in record.scale.tau"
        )
    kind, factor = TABLE[text] if text in TABLE else _of_pint(text)
    if kind not in kinds:
        known = f"is a unit of {kind}" if kind else "is not a unit known here"
        raise InputError(
            f"{text[:LONGEST]!r} {known}; expected one of {', '.join(kinds)}, such as "
            f"{EXAMPLES[kinds]}"
        )
    if factor > LARGEST:
        raise InputError(
            f"one {text!r} is {factor:g} {SI[kind]}, which is too large a unit for a robot; "
            f"expected units such as {EXAMPLES[kinds]}"
        )
    return kind, factor


@cache
def _of_pint(text: str) -> Unit:
    """Find the kind and the SI factor of a unit that is not in the table, by the library pint.

    Return ("", nan) if pint does not have the unit, or if the unit is of another kind.
    """
    nothing = ("", float("nan"))
    if len(text) > LONGEST or not GRAMMAR.fullmatch(text):
        return nothing
    import pint

    registry = _registry()
    try:
        factor, base = registry.get_base_units(registry.parse_units(text.replace("·", "*")))
    except (
        pint.PintError,
        ValueError,
        TypeError,
        ArithmeticError,
        AttributeError,
        KeyError,
        SyntaxError,
    ):
        return nothing
    kind = next((kind for kind, si in SI.items() if registry.Unit(si) == base), "")
    return (kind, float(factor)) if kind else nothing


@cache
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry(non_int_type=Fraction)
    registry.define("rev = turn")
    return registry
