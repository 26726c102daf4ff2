"""Print the base parameters of a robot with their regrouping formulas, as `symgen show` does.

The forms are text, LaTeX, link by link, and plain values for JSON.
"""

from __future__ import annotations

import difflib
import json
from typing import Any

from symgen.derive.derivation import derive
from symgen.description.expression import ONE, Expression
from symgen.emit.header import loop_lines, wrap_text
from symgen.emit.spec import function, is_inertial, is_inertial_or_actuator
from symgen.errors import SymgenError
from symgen.regroup.regrouping import BaseParameter, Formula, Regrouping

SIGNS = "XY = -sum m x y, XZ and YZ likewise, about the origin of the link frame, as ixy of a URDF; MX = sum m x"


def printed(regrouping: Regrouping, form: str, only: str | None = None) -> str:
    """Print the formulas of the base parameters as text, latex, json or recursive (link by link).

    only : name of one base parameter, to print its formula alone. Raises SymgenError if no base
        parameter has this name.
    """
    if form == "json":
        return json.dumps(mapping(regrouping, only), indent=2, ensure_ascii=False)
    if form == "recursive":
        return "\n".join(f"{name} = {text}" for name, text in recursive_formulas(regrouping))
    base = selected(regrouping, only)
    absorbing = [b for b in base if only or b.name != b.own]
    if form == "latex":
        from symgen.symbols import documents

        return documents.formulas({b.name: b.formula for b in absorbing})
    width = max(len(b.name) for b in base)
    lines = [
        line
        for b in absorbing
        for line in wrap_text(f"{b.name:<{width}} = {b.formula}", "", " " * (width + 3))
    ]
    return "\n".join(lines if only else _page(regrouping, lines))


def _page(regrouping: Regrouping, formulas: list[str]) -> list[str]:
    """Compose the text of `symgen show`: the regrouping formulas and two lists of parameters.

    The formulas are aligned as in eq. (27). The first list has the base parameters that are single
    standard parameters, the second the standard parameters that do not act on any torque. The
    number of base parameters is in the first line. Joint names and relations of passive joints are included if
    there are any.
    """
    robot = regrouping.robot
    alone = " ".join(b.name for b in regrouping.base if b.name == b.own)
    frames = ", ".join(f"{j} {label}" for j, label in robot.labels.items())
    passive = loop_lines(robot, derive(robot).closure)[len(robot.loops) :] if robot.passive else []
    relations = [
        *(wrap_text(f"frames: {frames}", "") if frames else []),
        *(f"passive: {line}" for line in passive),
    ]
    return [
        f"{robot.title or robot.name}: {len(regrouping)} base parameters of "
        f"{len(robot.parameters)}, {regrouping.method}",
        "",
        *relations,
        *([""] if relations else []),
        *formulas,
        "",
        *wrap_text("identified singly: " + alone, ""),
        "",
        *wrap_text("no effect: " + (" ".join(regrouping.no_effect) or "none"), ""),
        "",
        *wrap_text(f"signs: {SIGNS}", ""),
    ]


def mapping(regrouping: Regrouping, only: str | None = None) -> dict[str, Any]:
    """Return the formulas of base parameters and the operation counts as values for JSON."""
    return {
        "name": regrouping.robot.name,
        "count": len(regrouping),
        "standard_count": len(regrouping.robot.parameters),
        "method": regrouping.method,
        "base_parameters": [
            {"name": b.name, **b.formula.mapping()} for b in selected(regrouping, only)
        ],
        "no_effect": list(regrouping.no_effect),
        "not_read": list(regrouping.robot.not_read),
        "operations": operations(regrouping),
    }


def selected(regrouping: Regrouping, only: str | None) -> list[BaseParameter]:
    """Return all base parameters, or only the base parameter with the name `only`.

    Raises SymgenError, which suggests similar names, if no base parameter has this name.
    """
    base = [b for b in regrouping.base if only is None or b.name == only]
    if only is not None and not base:
        same = [name for name in regrouping.names if name.lower() == only.lower()]
        close = (
            ", ".join(same or difflib.get_close_matches(only, regrouping.names, n=5, cutoff=0.4))
            or "none"
        )
        raise SymgenError(
            f"{only!r} is no base parameter of {regrouping.robot.name}; similar names: {close} "
            "(to list all, leave out --only)"
        )
    return base


def recursive_formulas(regrouping: Regrouping) -> list[tuple[str, Formula]]:
    """Return name and formula of each regrouped parameter, link by link: XX2R = XX2 + YY3R + ...

    Each formula uses parameters that have themselves been regrouped, not their full formulas.
    """
    received: dict[str, dict[str, Expression]] = {}
    for source, target, coefficient in regrouping.steps:
        if target not in regrouping.no_effect:
            received.setdefault(target, {})[source] = coefficient

    def name(p: str) -> str:
        return p + "R" if p in received else p

    def terms(p: str) -> dict[str, Expression]:
        return {p: ONE} | {name(source): c for source, c in received[p].items() if c}

    parameters = (p for p in reversed(regrouping.robot.parameters) if p in received)
    return [(name(p), Formula(terms(p))) for p in parameters]


def operations(regrouping: Regrouping) -> dict[str, dict[str, int]]:
    """Count multiplications and additions per sample of the emitted regressor and inverse dynamics.

    The counts are for all base parameters, and for the inertial parameters (and Ia) alone.
    """
    robot = regrouping.robot
    counted = {
        "regressor": function(regrouping, "regressor"),
        "regressor_inertial": function(regrouping, "regressor", is_inertial_or_actuator(robot)),
        "inverse_dynamics": function(regrouping, "inverse_dynamics"),
        "inverse_dynamics_inertial": function(regrouping, "inverse_dynamics", is_inertial(robot)),
    }
    return {
        name: dict(zip(("mul", "add"), f.operations, strict=True)) for name, f in counted.items()
    }
