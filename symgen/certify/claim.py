"""The statements of a certificate as numbers and texts, which other programs can verify.

`docs/examples/check_certificate.py` verifies them from the frame table, without the code of symgen.
"""

from __future__ import annotations

from typing import Any

from symgen.certify.certificate import Certificate, degree
from symgen.derive.loops import close
from symgen.description.robot import Element, Robot
from symgen.regroup.regrouping import Regrouping
from symgen.version import VERSION

ENTRIES_OF_FRAMES = ("gamma", "b", "alpha", "d", "theta", "r")


def claim(regrouping: Regrouping, certificate: Certificate) -> dict[str, Any]:
    """Return the statements of a certificate as numbers and texts, which other programs can verify.

    The statements are about the robot, the relations of its joints, rank, primes, formulas, and for
    each emitted file its hash and its check.

    Expressions are texts in the grammar of robot files. The identities are those of the columns of
    all standard parameters, D_chi = sum_k coefficient_k,chi D_own,k, at random points over F_p.
    """
    robot, closure = regrouping.robot, close(regrouping.robot)
    return {
        "symgen": VERSION,
        "robot": robot.name,
        "source_sha256": robot.sha256,
        "frames": [
            {"j": f.j, "ant": f.ant, "sigma": f.sigma, "link": f.j in robot.links}
            | {key: str(getattr(f, key)) for key in ENTRIES_OF_FRAMES}
            for f in robot.frames
        ],
        **({"base": robot.base} if robot.base_moves else {}),
        "gravity": [str(e) for e in robot.gravity],
        "constants": dict(robot.constants),
        "joints": robot.joints,
        "passive": {
            str(j): str(closure.formula(j)) for j in robot.passive if j not in closure.tied
        },
        "tied": closure.tied,
        "loops": [(loop.cut, loop.twin) for loop in robot.loops],
        "elements": [_element(robot, e) for e in robot.elements],
        "standard_parameters": robot.parameters,
        "base_parameters": [
            {
                "name": b.name,
                "own": b.own,
                "coefficients": {name: str(c) for name, c in b.combination.items()},
            }
            for b in regrouping.base
        ],
        "no_effect": regrouping.no_effect,
        "degree": degree(regrouping),
        **certificate.mapping(),
    }


def _element(robot: Robot, e: Element) -> dict[str, Any]:
    """Describe a family of elements, such as friction or springs, by numbers and texts.

    For each row the sign of its first coefficient of an actuated joint is included, at the
    constants of the robot file. This sign defines which direction of motion is positive.
    """
    closure = close(robot)
    active = {j: closure.in_independent(row) for j, row in e.along.items()}
    return {
        "family": e.family,
        "kind": e.kind,
        "when": e.when,
        **({"laws": [str(e.law(j)) for j in e.along]} if e.is_own else {}),
        **({"energies": [str(e.potential(j)) for j in e.along]} if _has_energy(e) else {}),
        "along": {str(j): {str(i): str(c) for i, c in row.items()} for j, row in e.along.items()},
        "form": {
            str(j): {f"{i},{k}": str(c) for (i, k), c in form.items()} for j, form in e.form.items()
        },
        "signs": {
            str(j): -1 if row and row[0][1].value(robot.constants) < 0 else 1
            for j, row in active.items()
        },
    }


def _has_energy(e: Element) -> bool:
    """Whether the robot file defines an element, for instance a spring, by its energy."""
    return e.is_own and any(str(e.potential(j)) != "0" for j in e.along)
