"""Tables of a module, compared with the robot file, the regrouping and the witness."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from types import ModuleType
from typing import Any

import numpy as np
from certify.printed import definitions, evaluated

from symgen.certify.texts import same_elements
from symgen.certify.witness import Witness
from symgen.derive.exact import Array
from symgen.derive.loops import close
from symgen.derive.regressor import unit
from symgen.emit.header import channels, scalars

EVALUATED_TWICE = 1e-9  # of the largest: formulas and rows evaluated twice
ZERO_ENTRY = 1e-13  # of the largest: an entry that is zero, evaluated once


def table_errors(module: ModuleType, witness: Witness) -> dict[str, float]:
    """Zero for every table of a module that is right, infinity for one that is not.

    HEADER stands for the formulas of its header, DEFAULTS for the constants of its functions.
    """
    names = [n for n in vars(module) if n.isupper() and not n.startswith("_")]
    errors = {}
    for name in [*names, "HEADER", "DEFAULTS"]:
        try:
            right = _right(module, name, witness)
        except Exception:  # a table may hold anything
            right = False
        errors[name] = 0.0 if right else float("inf")
    return errors


def _right(module: ModuleType, name: str, witness: Witness) -> bool:
    constants, value = witness.robot.constants, getattr(module, name, None)
    match name:
        case "FORMULAS":
            own = {*value} <= {*witness.regrouping.names}  # type: ignore[misc]
            return own and formulas_hold(value.items(), witness)  # type: ignore[union-attr]
        case "BASE_VALUES":  # by the printed formulas, at the values of the file
            known = {**dict.fromkeys(witness.robot.parameters, 0.0), **witness.robot.values}
            own = {**known, **evaluated(module.FORMULAS.items(), {**known, **constants})}
            right = [own[name] for name in witness.regrouping.names]
            return bool(np.allclose(value, right, rtol=EVALUATED_TWICE, atol=0))
        case "HEADER":
            lines = (module.__doc__ or "").partition("Base parameters")[2].splitlines()
            names = witness.regrouping.names
            return formulas_hold([d for d in definitions(lines) if d[0] in names], witness)
        case "DEFAULTS":
            defaults = [d for f in vars(module).values() for d in _defaults(f)]
            return all(constants[c] == x for c, x in defaults if c in constants)
        case "ELEMENTS":
            drawn = module.elements(**witness.keywords)
            return same_elements(value, constants, witness) and same_elements(
                drawn, witness.constants, witness
            )
        case "STRUCTURE":
            marked = np.asarray(value)
            closed, free = (
                (np.abs(D).max(axis=0) > rounding * np.abs(D).max()).T
                for D, rounding in (
                    (witness.own, EVALUATED_TWICE),
                    (_free_columns(witness), ZERO_ENTRY),
                )
            )
            return marked.shape == closed.shape and np.array_equal(
                marked | closed,
                marked & free,  # closed <= marked <= free
            )
    right = _expected(witness)[name]
    return bool(value == right and (not isinstance(right, Mapping) or [*value] == [*right]))


def _free_columns(witness: Witness) -> Array:
    """The columns (N, n, b) where passive joints of general loops move as they like: a text marks
    what is zero on the closed mechanism alone, since it solves for their rates.
    """
    robot = witness.robot
    if not close(robot).tied:
        return witness.own
    rng, passive = np.random.default_rng(9), np.isin(robot.moving, robot.passive)
    G = witness.G + passive[:, None] * rng.standard_normal(witness.G.shape)
    D = np.swapaxes(G, 1, 2) @ witness.model.regressor(*rng.standard_normal((3, *witness.x.shape)))
    return np.asarray(D[:, :, [robot.parameters.index(name) for name in witness.regrouping.own]])


def _defaults(function: Any) -> list[tuple[str, float]]:
    """(name, value) of the arguments of a function that have one."""
    return [*(getattr(function, "__kwdefaults__", None) or {}).items()]


def _expected(witness: Witness) -> dict[str, Any]:
    robot, regrouping = witness.robot, witness.regrouping
    return {
        **robot.constants,  # values of a module that takes no others
        "SCHEMA": 1,
        "NAME": robot.name,
        "SOURCE_SHA256": robot.sha256,
        "JOINTS": robot.joints,
        "PASSIVE": robot.passive,
        "LINKS": robot.links,
        "ANTECEDENTS": {frame.j: frame.ant for frame in robot.frames},
        "LABELS": robot.labels,
        "CONSTANTS": regrouping.constants,
        "BASE_PARAMETERS": regrouping.names,
        "STANDARD_PARAMETERS": robot.parameters,
        "UNITS": {b.name: unit(robot, b.own) for b in regrouping.base},
        "NO_EFFECT": regrouping.no_effect,
        "DRIVES": robot.drives and asdict(robot.drives),
        "LIMITS": robot.limits,
        "VALUES": robot.values,
        **({"FIT": fit} if (fit := scalars(robot)) else {}),
        **({"CHANNELS": read} if (read := channels(regrouping)) else {}),
    }


def formulas_hold(formulas: Any, witness: Witness) -> bool:
    """Whether texts give what the base parameters are that they are called after."""
    chi = dict(zip(witness.robot.parameters, witness.chi, strict=True))
    X = dict(zip(witness.regrouping.names, witness.X, strict=True))
    size = EVALUATED_TWICE * np.abs(witness.X).max(initial=1e-300)
    found = evaluated(formulas, {**chi, **witness.constants})
    return all(abs(found[name] - X[name]) < size for name in found if name in X)
