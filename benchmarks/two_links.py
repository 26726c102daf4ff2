"""An arm of two links in a vertical plane, by Lagrange's equations, for benchmarks of records.

    tau = M(q) qdd + n(q, qd) + g + FV qd + FS sign(qd)          h = L MX2
    M11 = ZZ1 + ZZ2 + 2 h cos q2      M12 = ZZ2 + h cos q2       M22 = ZZ2 + Ia2
    n1 = -h sin q2 (2 qd1 qd2 + qd2**2)                          n2 = h sin q2 qd1**2
    g1 = G (MX1 cos q1 + MX2 cos(q1 + q2))                       g2 = G MX2 cos(q1 + q2)

MX1, ZZ1 contain the mass of link 2 at the end of link 1 (MX1R, ZZ1R of the base parameters). No
code is shared with what is judged. Arrays have the joints last, shape (..., 2), rad, N m.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import symgen
from symgen.description.yaml import parse_robot

Array = np.ndarray
G = 9.81  # m/s^2
ARM = """\
symgen: 1
name: arm
gravity: [0, -g, 0]
constants: {{D2: {L!r}, g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}}
elements:
  Ia: {{kind: inertia, along: all}}
  FV: {{kind: viscous, along: all}}
  FS: {{kind: coulomb, along: all}}
"""


def model_of(p: dict[str, Any]) -> Any:
    """Model of symgen of the arm with parameters p."""
    return symgen.model(parse_robot(ARM.format(L=float(p["L"])).encode(), "arm.yaml"))


def rigid(p: dict[str, Any], q: Array, qd: Array) -> tuple[Array, Array, Array, Array]:
    """Return M11, M12, M22, and the torque without acceleration and friction, shape (..., 2)."""
    q1, q12, v1, v2 = q[..., 0], q.sum(axis=-1), qd[..., 0], qd[..., 1]
    c2, s2, h = np.cos(q[..., 1]), np.sin(q[..., 1]), p["L"] * p["MX2"]
    g2 = G * p["MX2"] * np.cos(q12)
    n1 = -h * s2 * (2 * v1 * v2 + v2**2) + G * p["MX1R"] * np.cos(q1) + g2
    n = np.stack([n1, h * s2 * v1**2 + g2], axis=-1)
    M22 = p["ZZ2"] + p["Ia2"] + 0 * c2
    return p["ZZ1R"] + p["ZZ2"] + 2 * h * c2, p["ZZ2"] + h * c2, M22, n


def torque(p: dict[str, Any], q: Array, qd: Array, qdd: Array) -> Array:
    """Torque of a motion, shape (..., 2)."""
    M11, M12, M22, n = rigid(p, q, qd)
    a1, a2 = qdd[..., 0], qdd[..., 1]
    inertia = np.stack([M11 * a1 + M12 * a2, M12 * a1 + M22 * a2], axis=-1)
    return inertia + n + p["FV"] * qd + p["FS"] * np.sign(qd)


def acceleration(p: dict[str, Any], q: Array, qd: Array, tau: Array) -> Array:
    """Acceleration under a torque; dry friction is FS tanh(qd / 2 mrad/s)."""
    M11, M12, M22, n = rigid(p, q, qd)
    r = tau - n - p["FV"] * qd - p["FS"] * np.tanh(qd / 2e-3)
    r1, r2 = r[..., 0], r[..., 1]
    return (
        np.stack([M22 * r1 - M12 * r2, M11 * r2 - M12 * r1], -1) / (M11 * M22 - M12**2)[..., None]
    )


def error_of(model: Any, p: dict[str, Any], fit: Any, q: Array, rate: float) -> float:
    """Error of the torque of an estimate over a motion q, shape (N, 2), %: |W (X - true)| / |W true|."""
    true = {"MY1": 0.0, "MY2": 0.0} | {
        k: float(p[k]) for k in ("ZZ1R", "MX1R", "ZZ2", "MX2", "Ia2")
    }
    true |= {f"{f}{j + 1}": float(p[f][j]) for f in ("FV", "FS") for j in range(2)}
    qd = np.gradient(q, 1 / rate, axis=0)
    inner = slice(20, -20)
    W = model.observation_matrix(q[inner], qd[inner], np.gradient(qd, 1 / rate, axis=0)[inner])
    X = np.array([fit[name] if name in fit.names else 0.0 for name in model.BASE_PARAMETERS])
    x = np.array([true[name] for name in model.BASE_PARAMETERS])
    return float(100 * np.linalg.norm(W @ (X - x)) / np.linalg.norm(W @ x))
