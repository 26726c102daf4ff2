"""A planar arm of two joints whose MY1 and MY2 are zero, and records of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import runtime
import symgen
from runtime.study import Study, study_from_mapping
from symgen.description.yaml import parse_robot

Array = np.ndarray
RATE = 200.0  # Hz
FRICTION = """
  FV: {kind: viscous, along: all}
  FS: {kind: coulomb, along: all}"""
FRICTION_VALUES = ", FV1: 0.5, FS1: 0.8, FV2: 0.3, FS2: 0.4"


def text_of(friction: str = FRICTION, values: str = FRICTION_VALUES) -> str:
    """Robot file of the arm. friction : lines of its elements. values : those of these elements."""
    return f"""
symgen: 1
name: arm
gravity: [0, -g, 0]
constants: {{D2: 0.5, g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}}
elements:
  Ia: {{kind: inertia, along: all}}{friction}
limits: {{q: [pi, pi], qd: [3, 5], qdd: [20, 40]}}
values: {{XX1: 0.0012, XY1: 0, XZ1: 0, YY1: 0.1673, YZ1: 0, ZZ1: 0.1673, MX1: 0.5, MY1: 0, MZ1: 0,
  M1: 2, Ia1: 0.05, XX2: 0.0012, XY2: 0, XZ2: 0, YY2: 0.1673, YZ2: 0, ZZ2: 0.1673, MX2: 0.5, MY2: 0,
  MZ2: 0, M2: 2, Ia2: 0.02{values}}}
"""


def arm(text: str = "", options: tuple[str, ...] = ()) -> Any:
    return symgen.model(parse_robot((text or text_of()).encode(), "arm.yaml"), options=options)


def motion(seed: int, seconds: float = 8.0) -> tuple[Array, Array, Array, Array]:
    """t, q, qd, qdd of five sines of each joint."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    a, phase = rng.uniform(0.1, 0.4, (5, 2)), rng.uniform(0, 6, (5, 2))
    w = 2 * np.pi * 0.2 * np.arange(1, 6)[:, None]
    angle = w * t[:, None, None] + phase
    return (
        t,
        (a * np.sin(angle)).sum(axis=1),
        (a * w * np.cos(angle)).sum(axis=1),
        -(a * w**2 * np.sin(angle)).sum(axis=1),
    )


def parameters(model: Any, *, link: bool = False) -> Array:
    """X of the values of the robot file. link : without the elements of the drives."""
    values = {name: model.VALUES[name] for name in model.STANDARD_PARAMETERS}
    if link:
        values |= {name: 0.0 for name in values if name in model.ELEMENTS}
    return np.asarray(model.base_parameters(values))


def record(model: Any, seed: int, X: Array | None = None, **more: Any) -> runtime.Record:
    """A record with torque noise. X : default, the values of the robot file."""
    t, q, qd, qdd = motion(seed)
    tau = model.inverse_dynamics(q, qd, qdd, parameters(model) if X is None else X)
    tau = tau + 0.03 * np.random.default_rng(seed + 100).standard_normal(q.shape)
    return runtime.Record(t, q, tau, rate=RATE, name=f"run {seed}", **more)


def written(path: Path, record: runtime.Record, names: str = "", *more: Array) -> str:
    """Write a record to a CSV file, with further columns; return its name."""
    table = np.column_stack([record.t, record.q, record.tau, *more])
    header = f"t,q1,q2,tau1,tau2{names}"
    np.savetxt(path, table, "%.12g", ",", header=header, comments="")
    return str(path)


def study(**sections: Any) -> Study:
    signals = {"median": 1, "torque_median": 1, "lowpass": {"cutoff": 20}}
    return study_from_mapping({"signals": signals, **sections})
