"""Torque columns of the elements on the joints: inertia, viscous and Coulomb friction, offset,
stiffness.

along G, s = G q:   Gamma += c G' x,   x = sdd | sd | sign(sd) | 1 | s
form B:             Gamma += c B x,    x = qdd | qd | q
"""

from __future__ import annotations

from symgen.derive.newton_euler import Motion
from symgen.derive.scalar import Scalar, add, linear, mul
from symgen.description.robot import Element, Form, parameter


def element_column(motion: Motion, e: Element, j: int) -> dict[int, Scalar]:
    """{i: D_ik} of the parameter of element `e` with key j, i over the moving joints it acts on."""
    if j in e.form:
        return _form(motion, e.kind, e.form[j])
    row = e.along[j]
    x = _along(motion, e, j)
    if type(x) is int and x == 0:
        return dict.fromkeys(row, 0)
    return {i: mul(motion.algebra.constant(g), x) for i, g in row.items()}


def _coordinate(motion: Motion, kind: str, j: int) -> Scalar:
    rates = {"inertia": motion.qdd, "viscous": motion.qd, "coulomb": motion.qd}
    return rates.get(kind, motion.q)(j)


def _along(motion: Motion, e: Element, j: int) -> Scalar:
    """x of the element with key j; the velocity along several joints is named after the element,
    since other rows may have these joints.
    """
    if e.kind == "offset":
        return 1
    row = e.along[j]
    rate = linear(motion.algebra, row, {i: _coordinate(motion, e.kind, i) for i in row})
    if e.kind in ("viscous", "coulomb"):
        if len(row) > 1:
            rate = motion.algebra.name(rate, f"{motion.named('QP')}{parameter(e.family, j)}")
        if type(rate) is int:
            return 0  # at rest
        key = motion.geometry.closure.in_independent(row)
        if not key:
            return 0  # the closure holds s still
        if e.when is not None:
            direction, speed = motion.algebra.one_sided(rate, key, e.when)
            return direction if e.kind == "coulomb" else speed
        return motion.algebra.sign(rate, key) if e.kind == "coulomb" else rate
    return rate


def _form(motion: Motion, kind: str, form: Form) -> dict[int, Scalar]:
    column: dict[int, Scalar] = {}
    for (i, m), b in form.items():
        column[i] = add(
            column.get(i, 0), mul(motion.algebra.constant(b), _coordinate(motion, kind, m))
        )
    return column
