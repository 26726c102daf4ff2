"""Write the page of a robot as one HTML file that any browser can open.

One script and one style sheet are inside; the page requests nothing from other files or servers.
The script computes the geometry of the drawing itself, from the data of `figure`.

Names, titles and expressions are escaped by the template or by `symbols.printers`; numbers for the
script are JSON in which <, > and & are written as escapes. The content security policy allows only
this script and this style sheet, by their hashes.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from functools import lru_cache
from hashlib import sha256
from importlib.resources import files
from math import pi, prod
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from symgen.derive.closure import Closure
from symgen.derive.loops import close
from symgen.derive.regressor import unit
from symgen.description.expression import ONE, Expression
from symgen.description.files import not_read_text
from symgen.description.parts import GEOMETRY
from symgen.description.robot import PRISMATIC, Element, Robot
from symgen.emit.header import informative_columns
from symgen.emit.spec import ModuleSpec, module_spec
from symgen.pages.boxes import boxes
from symgen.pages.effects import Effect, effects, rows_of
from symgen.regroup.reasons import Absorption, absorptions
from symgen.regroup.regrouping import Regrouping
from symgen.symbols import expressions
from symgen.symbols.documents import shown_models
from symgen.symbols.printers import MathML, math, math_terms
from symgen.version import VERSION

SCRIPTS = ("kinematics.js", "drawing.js", "page.js")
HEADINGS = {"ant": "a", "mu": "μ", "sigma": "σ", "gamma": "γ", "alpha": "α", "theta": "θ"}
KINDS_OF_JOINT = ("revolute", "prismatic", "fixed")


def robot_page(regrouping: Regrouping) -> str:
    """Write the HTML text of the page of a robot.

    The same robot file and version give the same bytes.

    Raises
    ------
    SymgenError
        A length has no value.
    """
    robot, spec, closure = regrouping.robot, module_spec(regrouping), close(regrouping.robot)
    drawing, parameters = figure(robot, closure), effects(spec)
    absorbed = absorptions(regrouping)
    models, notes = shown_models(regrouping)
    style, script = _resource("page.css"), "\n".join(map(_resource, SCRIPTS))
    sources = passive_text(robot, closure)
    return _template().render(
        robot=robot,
        title=robot.title or robot.name,
        style=Markup(style),
        script=Markup(script),
        policy=(
            f"default-src 'none'; style-src '{_hash(style)}'; script-src '{_hash(script)}'; "
            "base-uri 'none'; form-action 'none'"
        ),
        data=embedded(drawing | {"parameters": _pointed_at(spec, parameters, absorbed)}),
        verdict=_verdict(regrouping),
        joints=[j | {"name": _symbol(f"q{j['j']}")} for j in drawing["joints"]],
        passive=[(_symbol(f"q{j}"), j, text) for j, text in sources.items()],
        frames=_frame_rows(robot),
        constants=[(_symbol(name), f"{value:.10g}") for name, value in robot.constants.items()],
        relations=[(_relation(closure, j), text) for j, text in sources.items()],
        elements=[_element_row(e) for e in robot.elements],
        gravity=[math(expressions.expression(e)) for e in robot.gravity],
        formulas=_formulas(spec),
        absorbed=[(_parameter(a.name), list(map(_parameter, a.base)), a) for a in absorbed],
        models=models,
        model_notes=notes,
        places=_places(parameters),
        without=_without_effect(parameters),
        costs=[(name.replace("_", " "), function) for name, function in spec.functions.items()],
        version=VERSION,
    )


def _symbol(name: str) -> MathML:
    return math(expressions.symbol(name))


def _parameter(name: str) -> MathML:
    return math(expressions.parameter(name))


def embedded(value: Any) -> Markup:
    """Write a value as JSON that can be placed inside a script element.

    The characters <, > and & are escaped, so that no text can end the element or open a comment.
    """
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


def _hash(text: str) -> str:
    return "sha256-" + b64encode(sha256(text.encode("utf-8")).digest()).decode("ascii")


def _resource(name: str) -> str:
    return files("symgen.pages").joinpath(name).read_text(encoding="utf-8")


def _verdict(regrouping: Regrouping) -> str:
    robot = regrouping.robot
    counts = (
        f"{len(regrouping)} base parameters of {len(robot.parameters)} standard parameters, "
        f"{len(regrouping.no_effect)} without effect"
    )
    missing = not_read_text(robot)
    return f"{counts}; {regrouping.method}.{f' {missing}.' if missing else ''}"


def _frame_rows(robot: Robot) -> dict[str, Any]:
    columns = informative_columns(robot)

    def cell(value: Any) -> str:
        is_formula = isinstance(value, Expression)
        return math(expressions.expression(value)) if is_formula else str(value)

    rows = [
        {
            "j": f.j,
            "cells": [cell(getattr(f, column)) for column in columns[1:]],
            "kind": ", ".join(filter(None, (KINDS_OF_JOINT[f.sigma], robot.labels.get(f.j)))),
        }
        for f in robot.frames
    ]
    return {"header": [HEADINGS.get(column, column) for column in columns], "rows": rows}


def _relation(closure: Closure, j: int) -> MathML:
    """Write the formula of a passive joint position, or its symbol if no formula exists.

    Without a formula, Newton's method computes the position.
    """
    shown = expressions.symbol(f"q{j}")
    if j not in closure.tied:
        shown = expressions.equation(shown, expressions.expression(closure.formula(j)))
    return math(shown)


def _element_row(e: Element) -> dict[str, Any]:
    """Describe a family of joint elements, such as FV, for its row on the page.

    Each parameter has its coordinate s = G q, or the form in the joint positions on which it acts.
    """

    def coordinate(j: int) -> Expression:
        weights = {(i,): g for i, g in e.along[j].items()} if j in e.along else e.form[j]
        terms = (
            prod((Expression.symbol(f"q{i}") for i in joints), start=g)
            for joints, g in weights.items()
        )
        return sum(terms, Expression())

    acts = [
        (_parameter(f"{e.family}{j}"), math(expressions.expression(coordinate(j)))) for j in e.keys
    ]
    return {"family": e.family, "kind": e.kind, "when": e.when, "acts": acts}


def _formulas(spec: ModuleSpec) -> list[dict[str, Any]]:
    robot = spec.robot
    return [
        {
            "name": b.name,
            "symbol": _parameter(b.name),
            "terms": math_terms(expressions.formula(b.formula)) if b.name != b.own else [],
            "text": str(b.formula),
            "unit": printed(unit(robot, b.own)),
            "joints": [
                (j, entered) for j, entered in zip(rows_of(robot), spec.structure[k], strict=True)
            ],
        }
        for k, b in enumerate(spec.regrouping.base)
    ]


def printed(text: str) -> str:
    """Write a unit for the page: kg*m**2 as kg m²."""
    return text.replace("**2", "²").replace("*", " ")


def _places(parameters: Sequence[Effect]) -> dict[str, list[dict[str, Any]]]:
    """Group the standard parameters by link or joint, and mark each parameter as alone, regrouped
    or none.

    The mark none means that the parameter has no effect.
    """
    places: dict[str, list[dict[str, Any]]] = {}
    for e in parameters:
        fate = "none" if not e.base else "alone" if e.base == (e.name,) else "regrouped"
        places.setdefault(e.place, []).append(
            {"name": e.name, "symbol": _parameter(e.name), "fate": fate}
        )
    return places


def _without_effect(parameters: Sequence[Effect]) -> list[tuple[list[MathML], str]]:
    """Group the standard parameters that have no effect on the torques by the reason for this.

    Return pairs of the parameters and the reason that they share.
    """
    reasons: dict[str, list[MathML]] = {}
    for e in parameters:
        if e.why:
            reasons.setdefault(e.why, []).append(_parameter(e.name))
    return [(names, why) for why, names in reasons.items()]


def _pointed_at(
    spec: ModuleSpec, parameters: Sequence[Effect], absorbed: Sequence[Absorption]
) -> Mapping[str, Any]:
    """Collect, for each parameter, the text that the page shows when the pointer is on this
    parameter.
    """
    robot = spec.robot
    by_name = {e.name: e for e in parameters}
    entries = {e.name: _entry(e, e.meaning, e.base, e.joints, e.why) for e in parameters}
    for a in absorbed:
        entries[a.name]["rule"] = f"{a.columns}: {a.rule}"
    for k, b in enumerate(spec.regrouping.base):
        own = by_name[b.own]
        others = [name for name in b.combination if name != b.own or b.combination[name] != ONE]
        text = own.meaning + (f"; takes in {', '.join(others)}" if others else "")
        acts = zip(rows_of(robot), spec.structure[k], strict=True)
        joints = [j for j, entered in acts if entered]
        entries[b.name] = _entry(own, text, [b.name], joints, "")
    return entries


def _entry(
    e: Effect, text: str, base: Sequence[str], joints: Sequence[int | str], why: str
) -> dict[str, Any]:
    return {
        "text": text,
        "unit": printed(e.unit),
        "place": e.place,
        "link": e.link,
        "base": base,
        "joints": joints,
        "why": why,
    }


@lru_cache(maxsize=1)
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("symgen.pages", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("robot.html.jinja")


def figure(robot: Robot, closure: Closure) -> dict[str, Any]:
    """Collect the data of the robot drawing as plain values for JSON, in SI units and rad.

    `theta` and `r` do not contain the joint position. `follows` gives each passive joint as q_j =
    offset + sum_i of_i q_i.
    """
    follows = {
        j: {
            "of": {i: g.value(robot.constants) for i, g in closure.row[j].items()},
            "offset": closure.offset[j].value(robot.constants),
        }
        for j in robot.passive
        if j not in closure.tied
    }
    frames = [
        {"j": f.j, "ant": f.ant, "sigma": f.sigma}
        | {name: e.value(robot.constants) for name, e in zip(GEOMETRY, f.at_zero, strict=True)}
        for f in robot.frames
    ]
    return {
        "frames": frames,
        "gravity": [e.value(robot.constants) for e in robot.gravity],
        "joints": joint_ranges(
            robot, closure, sum(abs(f[name]) for f in frames for name in ("b", "d", "r"))
        ),
        "follows": follows,
        "tied": {j: closure.start[j] for j in closure.tied},
        "loops": [{"cut": loop.cut, "twin": loop.twin} for loop in robot.loops],
        "boxes": boxes(robot),
    }


def joint_ranges(robot: Robot, closure: Closure, size: float) -> list[dict[str, Any]]:
    """Choose the range and the initial position of the slider of every actuated joint.

    The range is that of the joint limits. Without limits it is half a turn to either side, or half
    of `size`, the size of the robot, for a prismatic joint. The start is 0 if 0 is in the range.
    """
    ranges = []
    for row, j in enumerate(robot.joints):
        slides = robot.frame(j).sigma == PRISMATIC
        half = (size / 2 or 0.5) if slides else pi
        low, high = robot.limits["q"][row] if "q" in robot.limits else (-half, half)  # type: ignore[misc]
        start = closure.start[j] if closure.tied else 0.0 if low <= 0 <= high else (low + high) / 2
        ranges.append(
            {
                "j": j,
                "slides": slides,
                "low": min(low, start),
                "high": max(high, start),
                "start": start,
            }
        )
    return ranges


def passive_text(robot: Robot, closure: Closure) -> dict[int, str]:
    """Describe how each passive joint position is found: declared, or from the kinematic loop."""
    words = {True: "declared", False: "found from the loop"}
    return {
        j: "solved from the loop" if j in closure.tied else words[j in robot.constraints]
        for j in robot.passive
    }
