"""The page of a robot as one HTML file that opens anywhere: one script and one style sheet inside, no request to anyone. jinja2 only here.

Names, titles and expressions are escaped by the template or by `mathml.element`; numbers for the script are JSON in which <, > and & are
written as escapes; the content security policy allows this script and this style sheet by their hashes, hence nothing else.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from functools import lru_cache
from hashlib import sha256
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from symgen.derive.loops import close
from symgen.description.expression import ONE, Expression
from symgen.description.robot import Element, Robot
from symgen.emit.certified import certify
from symgen.emit.header import informative_columns
from symgen.emit.spec import ModuleSpec, module_spec, unit
from symgen.regroup import mathml
from symgen.regroup.certificate import Certificate
from symgen.regroup.mathml import MathML
from symgen.regroup.regrouping import Regrouping
from symgen.report.effects import Effect, effects
from symgen.report.figure import figure, passive_text
from symgen.symbols.markup import shown_models
from symgen.version import VERSION

SCRIPTS = ("kinematics.js", "drawing.js", "page.js")
HEADINGS = {"ant": "a", "mu": "μ", "sigma": "σ", "gamma": "γ", "alpha": "α", "theta": "θ"}
KINDS_OF_JOINT = ("revolute", "prismatic", "fixed")
MODELS = ("regressor", "inverse_dynamics", "inertia_matrix", "bias", "gravity", "frame_poses", "closure", "curvature")


class Verbatim(str):
    """Text of this package that the template inserts as it is."""

    __slots__ = ()

    def __html__(self) -> str:
        return self


def robot_page(regrouping: Regrouping, certificate: Certificate | None = None) -> str:
    """HTML text of the page of a robot. Same robot file, same version: same bytes.

    Parameters
    ----------
    regrouping : Regrouping
        Base parameters with their formulas.
    certificate : Certificate, optional
        Their certificate; made where left out.

    Raises
    ------
    SymgenError
        A length has no value.
    """
    robot, spec = regrouping.robot, module_spec(regrouping)
    drawing, parameters = figure(robot), effects(spec)
    certificate = certificate or certify(regrouping)
    models, notes = shown_models(regrouping)
    style, script = _resource("page.css"), "\n".join(map(_resource, SCRIPTS))
    return _template().render(
        robot=robot,
        title=robot.title or robot.name,
        style=Verbatim(style),
        script=Verbatim(script),
        policy=f"default-src 'none'; style-src '{_hash(style)}'; script-src '{_hash(script)}'; base-uri 'none'; form-action 'none'",
        data=embedded(drawing | {"parameters": _pointed_at(spec, parameters)}),
        verdict=_verdict(regrouping, certificate),
        joints=[j | {"name": mathml.math(mathml.name(f"q{j['j']}"))} for j in drawing["joints"]],
        passive=[(mathml.math(mathml.name(f"q{j}")), j, text) for j, text in passive_text(robot).items()],
        frames=_frame_rows(robot),
        constants=[(mathml.math(mathml.name(name)), f"{value:.10g}") for name, value in robot.constants.items()],
        relations=_relations(robot),
        elements=[_element_row(e) for e in robot.elements],
        gravity=[mathml.math(mathml.expression(e)) for e in robot.gravity],
        formulas=_formulas(spec),
        models=models,
        model_notes=notes,
        places=_places(parameters),
        without=_without_effect(parameters),
        costs=[(name.replace("_", " "), function) for name, function in spec.functions.items()],
        certificate=certificate,
        version=VERSION,
    )


def embedded(value: Any) -> Verbatim:
    """JSON that neither ends a script element nor opens a comment in one."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return Verbatim(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


def _hash(text: str) -> str:
    return "sha256-" + b64encode(sha256(text.encode("utf-8")).digest()).decode("ascii")


def _resource(name: str) -> str:
    return files("symgen.report").joinpath(name).read_text(encoding="utf-8")


def _verdict(regrouping: Regrouping, certificate: Certificate) -> str:
    robot = regrouping.robot
    counts = f"{len(regrouping)} base parameters of {len(robot.parameters)} standard parameters, {len(regrouping.no_effect)} without effect"
    proof = "the certificate holds" if certificate.valid else "the certificate does NOT hold"
    return f"{counts}; {regrouping.method}; {proof}."


def _frame_rows(robot: Robot) -> dict[str, Any]:
    kept = informative_columns(robot)
    rows = []
    for f in robot.frames:
        cells = [mathml.math(mathml.expression(x)) if isinstance(x := getattr(f, c), Expression) else str(x) for c in kept[1:]]
        rows.append(
            {"j": f.j, "cells": cells, "kind": ", ".join([KINDS_OF_JOINT[f.sigma], *([robot.labels[f.j]] if f.j in robot.labels else [])])}
        )
    return {"header": [HEADINGS.get(c, c) for c in kept], "rows": rows}


def _relations(robot: Robot) -> list[tuple[MathML, str]]:
    """Loops and passive joints: what holds, and where it comes from."""
    closure, texts = close(robot), passive_text(robot)
    rows = []
    for j in robot.passive:
        left = mathml.name(f"q{j}")
        if j in closure.tied:
            rows.append((mathml.math(left), texts[j]))
            continue
        equation = mathml.element("mrow", left, mathml.element("mo", "="), mathml.expression(closure.formula(j)))
        rows.append((mathml.math(equation), texts[j]))
    return rows


def _element_row(e: Element) -> dict[str, Any]:
    """Each parameter of a family with the coordinate s = G q or the form it acts along."""
    acts = []
    for j in e.keys:
        if j in e.along:
            total = sum((g * Expression.symbol(f"q{i}") for i, g in e.along[j].items()), Expression())
        else:
            total = sum((b * Expression.symbol(f"q{i}") * Expression.symbol(f"q{m}") for (i, m), b in e.form[j].items()), Expression())
        acts.append((mathml.math(mathml.parameter(f"{e.family}{j}")), mathml.math(mathml.expression(total))))
    return {"family": e.family, "kind": e.kind, "when": e.when, "acts": acts}


def _formulas(spec: ModuleSpec) -> list[dict[str, Any]]:
    robot = spec.robot
    return [
        {
            "name": b.name,
            "symbol": mathml.math(mathml.parameter(b.name)),
            "terms": mathml.formula(b.formula) if b.name != b.own else [],
            "text": str(b.formula),
            "unit": printed(unit(robot, b.own)),
            "joints": [(j, entered) for j, entered in zip(robot.joints, spec.structure[k], strict=True)],
        }
        for k, b in enumerate(spec.regrouping.base)
    ]


def printed(text: str) -> str:
    """kg*m**2 as kg m²."""
    return text.replace("**2", "²").replace("*", " ")


def _places(parameters: Sequence[Effect]) -> dict[str, list[dict[str, Any]]]:
    """Standard parameters by link or joint, with what becomes of each."""
    places: dict[str, list[dict[str, Any]]] = {}
    for e in parameters:
        fate = "none" if not e.base else "alone" if e.base == (e.name,) else "regrouped"
        places.setdefault(e.place, []).append({"name": e.name, "symbol": mathml.math(mathml.parameter(e.name)), "fate": fate})
    return places


def _without_effect(parameters: Sequence[Effect]) -> list[tuple[list[MathML], str]]:
    """(parameters, the reason they share)."""
    reasons: dict[str, list[MathML]] = {}
    for e in parameters:
        if e.why:
            reasons.setdefault(e.why, []).append(mathml.math(mathml.parameter(e.name)))
    return [(names, why) for why, names in reasons.items()]


def _pointed_at(spec: ModuleSpec, parameters: Sequence[Effect]) -> Mapping[str, Any]:
    """What the page says of a parameter under the pointer."""
    robot = spec.robot
    by_name = {e.name: e for e in parameters}
    entries = {e.name: _entry(e, e.meaning, e.base, e.joints, e.why) for e in parameters}
    for k, b in enumerate(spec.regrouping.base):
        own = by_name[b.own]
        absorbed = [name for name in b.combination if name != b.own or b.combination[name] != ONE]
        text = own.meaning + (f"; takes in {', '.join(absorbed)}" if absorbed else "")
        joints = [j for j, entered in zip(robot.joints, spec.structure[k], strict=True) if entered]
        entries[b.name] = _entry(own, text, [b.name], joints, "")
    return entries


def _entry(e: Effect, text: str, base: Sequence[str], joints: Sequence[int], why: str) -> dict[str, Any]:
    return {"text": text, "unit": printed(e.unit), "place": e.place, "link": e.link, "base": base, "joints": joints, "why": why}


@lru_cache(maxsize=1)
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("symgen.report", ""), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("robot.html.jinja")
