"""The regrouping of a robot as `symgen show` prints it: text, LaTeX, link by link, and plain values for JSON."""

from __future__ import annotations

import difflib
import json
from typing import Any

from symgen.description.expression import ONE, Expression
from symgen.emit.header import loop_lines, wrapped
from symgen.emit.printers import Text
from symgen.emit.spec import inverse_dynamics, is_inertial, is_inertial_or_actuator, regressor_program
from symgen.errors import SymgenError
from symgen.regroup.certificate import Certificate
from symgen.regroup.formula import Formula
from symgen.regroup.latex import aligned
from symgen.regroup.regrouping import BaseParameter, Regrouping


def printed(regrouping: Regrouping, certificate: Certificate, form: str, only: str | None = None) -> str:
    """The formulas as text, latex, json, or recursive (link by link).

    only : name of one base parameter; its formula alone. Raises SymgenError where there is none of that name.
    """
    if form == "json":
        return json.dumps(mapping(regrouping, certificate, only), indent=2, ensure_ascii=False)
    if form == "recursive":
        return recursive_text(regrouping)
    return {"text": flat_text, "latex": latex_text}[form](regrouping, only)


def flat_text(regrouping: Regrouping, only: str | None = None) -> str:
    """Aligned formulas as eq. (27), parameters that absorb nothing in one list, those without effect, counts and costs.

    only : name of one base parameter; its formula alone.
    """
    base = selected(regrouping, only)
    width = max(len(b.name) for b in base)
    lines = []
    for b in base:
        if only or b.name != b.own:
            lines += wrapped(f"{b.name:<{width}} = {b.formula}", "", " " * (width + 3))
    if only:
        return "\n".join(lines)
    alone = " ".join(b.name for b in base if b.name == b.own)
    none = " ".join(regrouping.no_effect) or "none"
    lists = [*wrapped("as they are: " + alone, ""), "", *wrapped("no effect: " + none, "")]
    costs = ["operations per sample", *operation_lines(regrouping)]
    return "\n".join([title(regrouping), "", *relation_lines(regrouping), *lines, "", *lists, "", *costs])


def recursive_text(regrouping: Regrouping) -> str:
    """A line per parameter that receives others, link by link."""
    return "\n".join(f"{name} = {text}" for name, text in recursive_formulas(regrouping))


def latex_text(regrouping: Regrouping, only: str | None = None) -> str:
    r"""The formulas in an `aligned` environment with subscripts, ZZ_{1R} &= ZZ_{1} + I_{a1} + ..."""
    return aligned((b.name, b.formula) for b in selected(regrouping, only) if only or b.name != b.own)


def mapping(regrouping: Regrouping, certificate: Certificate, only: str | None = None) -> dict[str, Any]:
    """Plain values of the formulas, the operations of the models and the certificate."""
    return {
        "name": regrouping.robot.name,
        "count": len(regrouping),
        "standard_count": len(regrouping.robot.parameters),
        "method": regrouping.method,
        "base_parameters": [{"name": b.name, **b.formula.mapping()} for b in selected(regrouping, only)],
        "no_effect": list(regrouping.no_effect),
        "operations": operations(regrouping),
        "certificate": certificate.mapping(),
    }


def selected(regrouping: Regrouping, only: str | None) -> list[BaseParameter]:
    """All base parameters, or the one that is called `only`. Raises SymgenError, with names like it, where there is none."""
    base = [b for b in regrouping.base if only is None or b.name == only]
    if only is not None and not base:
        same = [name for name in regrouping.names if name.lower() == only.lower()]
        close = ", ".join(same or difflib.get_close_matches(only, regrouping.names, n=5, cutoff=0.4)) or "none"
        raise SymgenError(f"{only!r} is no base parameter of {regrouping.robot.name}; close: {close} (all of them: leave out --only)")
    return base


def title(regrouping: Regrouping) -> str:
    """What the robot is and how many of its parameters are base ones."""
    robot = regrouping.robot
    return f"{robot.title or robot.name}: {len(regrouping)} base parameters of {len(robot.parameters)}, {regrouping.method}"


def relation_lines(regrouping: Regrouping) -> list[str]:
    """Names of the joints, the passive joints as functions of others, and an empty line; nothing where there are none."""
    robot = regrouping.robot
    names = wrapped("frames: " + ", ".join(f"{j} {label}" for j, label in robot.labels.items()), "") if robot.labels else []
    passive = [f"passive: {line}" for line in loop_lines(robot)[len(robot.loops) :]] if robot.passive else []
    return [*names, *passive, *([""] if names or passive else [])]


def operation_lines(regrouping: Regrouping) -> list[str]:
    """A line per model."""
    return [f"  {name:<26} {cost['mul']:>5} multiplications {cost['add']:>5} additions" for name, cost in operations(regrouping).items()]


def recursive_formulas(regrouping: Regrouping) -> list[tuple[str, Formula]]:
    """(name, formula) per parameter that receives others, in terms of what those had already received: XXR_i = XX_i + YYR_j + ..."""
    received: dict[str, dict[str, Expression]] = {}
    for source, target, coefficient in regrouping.steps:
        if target not in regrouping.no_effect:
            received.setdefault(target, {})[source] = coefficient

    def name(p: str) -> str:
        return p + "R" if p in received else p

    lines = []
    for p in reversed(regrouping.robot.parameters):
        if p in received:
            terms = {p: ONE} | {name(source): c for source, c in received[p].items() if c}
            lines.append((name(p), Formula(terms)))
    return lines


def operations(regrouping: Regrouping) -> dict[str, dict[str, int]]:
    """Multiplications and additions of the emitted text per sample, of all base columns and of the inertial (and Ia) ones alone."""
    robot = regrouping.robot
    inertial = tuple(own for own in regrouping.own if is_inertial_or_actuator(robot)(own))
    result = {}
    for name, own in (("regressor", regrouping.own), ("regressor_inertial", inertial)):
        _, program = regressor_program(regrouping, own)
        result[name] = dict(zip(("mul", "add"), Text(program.outputs, program.sections, ()).operations, strict=True))
    for name, model in (
        ("inverse_dynamics", inverse_dynamics(regrouping)),
        ("inverse_dynamics_inertial", inverse_dynamics(regrouping, is_inertial(robot))),
    ):
        result[name] = {"mul": model.mul, "add": model.add}
    return result
