"""The numbers that `runtime.plausible.continuous` fits beside the model: a factor of the torque or the
position of a joint, its zero, a length, an angle, a constant torque, a spring, friction.

A spring or counterbalance of a joint is a q + b sin q + c cos q, of a slide a q + b with a > 0,
friction at low speed that of several joints, each in the ratio of the best factors of the first
step.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from runtime.limits import LIMIT
from runtime.model.generated import joint_labels, joint_units
from runtime.plausible.alternatives import (
    Alternative,
    Maker,
    coupled,
    neighbours,
    times,
    unchanged,
    unmodelled_torques,
)
from runtime.plausible.gravity import gauss_newton_step
from runtime.plausible.trials import Problem

Array = np.ndarray

ENTRY = re.compile(r"free_(alpha|[drb])(\d+)")
TERMS = {"rad": (True, True, True, False, False), "m": (True, False, False, True, False)}
SLOW = (False, False, False, False, True)  # of `unmodelled_torques`; TERMS by the unit of q
FORCES = {"rad": "N m", "m": "N"}
SPRING, STRIBECK = (
    (
        " is missing, a torque that depends on its position",
        "give {} as a known torque (record.columns.tau_known), or in the robot file (an element of "
        "kind stiffness, or a column of your own)",
    ),
    (" is not that of the model; columns of kind stribeck have it", "add such columns"),
)  # cause and remedy
GUESSES = {
    2**0.5: "1.41: effective for peak values",
    3**0.5: "1.73: phase for line values",
    2.0: "2: half of a pair of motors",
    9.81: "9.81: kp m for N m",
}


@dataclass(frozen=True, eq=False)
class Quantity:
    """A number xi that is zero in the study as given.

    Attributes
    ----------
    kind : str
        factor, scale, zero, offset, rate, coupling, length, angle, spring, friction.
    of : str
        What it is, in words.
    span : float
        Largest |xi| that is searched.
    fields : function
        xi to what it changes of an Alternative.
    plain : Alternative
        The study as it is.
    since : str
        When it is wrong, in words; "" for always.
    share : ndarray, shape (K,), or 1
        w at every sample.
    """

    kind: str
    of: str
    span: float
    fields: Callable[[float], dict[str, Any]]
    plain: Alternative
    since: str = ""
    share: Array | float = 1.0

    def change(self, xi: float) -> Alternative:
        """The study with this xi."""
        fields = self.fields(xi)
        if self.since:
            fields["cause"] += self.since
            fields["remedy"] = (
                f"look for what changes {self.of} within the record, or use a part of it "
                "(rows.window)"
            )
        return replace(self.plain, kind=self.kind, of=self.of, share=self.share, **fields)


def quantities(problem: Problem, sides: Sequence[str] = ("joint", "joint")) -> list[Quantity]:
    """Factors of torques and positions and springs of all joints, zeros of those that turn, the
    sampling rate, couplings of neighbours; lengths and angles of the table where it is free.
    sides : those of positions and torques in the files.
    """
    plain = unchanged(problem.samples.n)
    joints, units = list(joint_labels(problem.model)), joint_units(problem.model)
    number, make = np.arange(len(joints)), Maker(problem.model, sides)
    ratios_of = partial(_ratios, problem, *explained_rows(problem, plain))
    which: list[tuple[str, str, float, Callable[[float], dict[str, Any]]]] = [
        ("rate", "the sampling rate", 1.0, _rate),
        (
            "factor",
            "a common factor of all torques",
            2.6,
            partial(_factor, problem, number >= 0, ""),
        ),
    ]
    for j, joint in enumerate(joints):
        size = float(np.sqrt((problem.samples.tau[:, j] ** 2).mean()))
        offset = partial(_offset, joint, FORCES[units[j]], number == j, size)
        which += [
            ("scale", f"the scale of the position of joint {joint}", 1.2, partial(_scale, make, j)),
            ("offset", f"a constant torque of joint {joint}", 2.0, offset),
        ]
        if len(joints) > 1:
            fields = partial(_factor, problem, number == j, joint)
            which.append(("factor", f"a factor of the torque of joint {joint}", 2.6, fields))
        if units[j] == "rad":
            fields = partial(_zero, number == j, joint)
            which.append(("zero", f"the zero of joint {joint}", 1.2, fields))
        ratios = ratios_of(np.outer(number == j, TERMS[units[j]]))
        if ratios is not None and (units[j] == "rad" or ratios[j, 0] > 0):
            of = f"a spring or counterbalance of joint {joint}"
            which.append(("spring", of, 2.0, partial(_unmodelled, of, *SPRING, ratios)))
    slow = ratios_of(np.outer(number >= 0, SLOW), LIMIT.CERTAIN_FRICTION)
    if slow is not None:
        of = (
            "the friction of joint "
            f"{', '.join(joints[j] for j in np.flatnonzero(slow.any(axis=1)))} at low speed"
        )
        which.append(("friction", of, 2.0, partial(_unmodelled, of, *STRIBECK, slow)))
    for i, k in neighbours(units):
        of = f"the coupling of joints {joints[min(i, k)]} and {joints[max(i, k)]}"
        for columns in ("positions and torques", "torques"):
            which.append(("coupling", of, 1.2, partial(coupled, joints, i, k, columns)))
    for key, x in ({} if problem.variants is None else problem.variants.CONSTANTS).items():
        if (match := ENTRY.fullmatch(key)) and (x or match[1] == "alpha"):
            kind, span, entry = (
                ("angle", 1.2, _angle) if match[1] == "alpha" else ("length", 1.0, _length)
            )
            fields = partial(entry, key, match[1], match[2], x)
            which.append((kind, f"{match[1]} of frame {match[2]}", span, fields))
    return [Quantity(*one, plain) for one in which]


def _factor(problem: Problem, chosen: Array, joint: str, xi: float) -> dict[str, Any]:
    """exp(xi) = the torque that the joint would need, over that of the record."""
    factor = float(np.exp(xi))
    what = f"the torque of joint {joint} is" if joint else "all torques are"
    look = (
        f"ratio, torque constant and unit of joint {joint}"
        if joint
        else "unit, torque constants and side of the torques"
    )
    scale = np.diag(np.where(chosen, factor, 1.0))
    return {
        "cause": f"{what} to be multiplied by {factor:.3g}",
        "remedy": f"look at {look} ({_guess(factor)})",
        "T": np.linalg.inv(problem.F) @ scale @ problem.F,
    }


def _scale(make: Maker, j: int, xi: float) -> dict[str, Any]:
    joint, factor = make.joints[j], float(np.exp(xi))
    return {
        "cause": f"the position of joint {joint} is to be multiplied by {factor:.3g}",
        "remedy": f"look at the counts per turn of the encoder of joint {joint}, at its ratio "
        "(drives.ratio) and at its unit (record.units.q)",
        **make.positions(np.diag(np.where(np.arange(make.n) == j, factor, 1.0))),
    }


def _zero(chosen: Array, joint: str, xi: float) -> dict[str, Any]:
    return {
        "cause": f"the zero of joint {joint} is off by {np.degrees(xi):.3g} degrees",
        "remedy": f"look at theta of the frame of joint {joint}, at drives.offset and at the "
        "calibration of its encoder",
        "p": np.where(chosen, xi, 0.0),
    }


def _rate(xi: float) -> dict[str, Any]:
    factor = float(np.exp(xi))
    return {
        "cause": f"the sampling rate is {times(factor)} the stated one",
        "remedy": "correct record.rate, or the unit of the time column (record.units.t)",
        "rate": factor,
    }


def _unmodelled(of: str, cause: str, remedy: str, ratios: Array, xi: float) -> dict[str, Any]:
    return {"cause": of + cause, "remedy": remedy.format(of), "unmodelled": xi * ratios}


def _offset(joint: str, unit: str, chosen: Array, size: float, xi: float) -> dict[str, Any]:
    return {
        "cause": f"the torque of joint {joint} is off by {xi * size:.3g} {unit}",
        "remedy": f"look at the zero of the torque of joint {joint}, or give it as a known torque "
        "(record.columns.tau_known)",
        "unmodelled": xi * np.outer(chosen, (0.0, 0.0, 0.0, size, 0.0)),
    }


def _ratios(
    problem: Problem, D: Array, now: Array, mask: Array, terms: Array, certain: float = 0.0
) -> Array | None:
    """Factors of these `unmodelled_torques`, bool (n, 5), beside the model to first order, without
    those below so many deviations; None where the samples do not tell any from it. D, now, mask :
    `explained_rows` of the study.
    """
    joint, term = np.nonzero(terms)
    size = np.sqrt((problem.samples.tau**2).mean(axis=0))[joint]  # the factors in this unit
    effect = size * unmodelled_torques(problem.samples)[:, joint, term]
    J = np.einsum("ka,ia->aki", effect, problem.F[:, joint])
    found = gauss_newton_step(
        problem, D, J, problem.given, problem.tau - now + D @ problem.given.X, mask
    )
    if found is None:
        return None
    ratios = np.zeros(terms.shape)
    ratios[terms] = size * found[0] * (np.abs(found[0]) >= certain * np.sqrt(np.diag(found[1])))
    return ratios if ratios.any() else None


def _angle(key: str, name: str, frame: str, value: float, xi: float) -> dict[str, Any]:
    return {
        "cause": f"{name} of frame {frame} is off by {np.degrees(xi):.3g} degrees",
        "remedy": f"look at {name} of frame {frame}: {value + xi:.3f} rad fits",
        "constants": {key: value + xi},
    }


def _length(key: str, name: str, frame: str, value: float, xi: float) -> dict[str, Any]:
    length = value * float(np.exp(xi))
    return {
        "cause": f"{name} of frame {frame} is {length:.4g} m rather than {value:.4g} m",
        "remedy": f"measure {name} of frame {frame}: {length:.4g} m fits",
        "constants": {key: length},
    }


def _guess(factor: float) -> str:
    """What a factor on a torque may be."""
    return next(
        (
            text
            for value, text in GUESSES.items()
            if abs(abs(np.log(factor)) - np.log(value)) < 0.05
        ),
        "they are right when this factor is 1",
    )


def explained_rows(problem: Problem, alternative: Alternative) -> tuple[Array, Array, Array]:
    """Rows over the standard parameters, shape (K, n, p), torques that those of the study explain,
    and the rows used.
    """
    rows = problem.rows(alternative)
    if rows is None:  # a loop that does not close
        return explained_rows(problem, unchanged(problem.samples.n))
    D, Y, mask = rows
    D = D @ problem.physical.K if alternative.on_data else D
    return D, D @ problem.given.X + problem.tau - Y, mask
