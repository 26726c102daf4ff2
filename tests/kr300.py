"""The KUKA KR300 record (shared data): its study, the CAD values of its source and the torque of
its counterbalance.

Values: Weigand, Ulmen, Janot and Ruskowski, Robot_Identification 9e403c07,
model_KUKA_Quantec_Ultra_KR300.m: mass, centre and central inertia in classic
(distal) frames, motor inertia and friction on the motor side. Pose of distal frame j in frame j of
kr300.yaml: Tz(shift) Tx(a) Rx(alpha).
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

DATA = (
    Path(os.environ.get("SYMGEN_DATA") or Path(__file__).resolve().parents[2] / "shared" / "data")
    / "kr300"
)
LOAD = 200.0  # kg, of the source

# a      alpha      shift   centre, m                 mass    central inertia xx yy zz xy yz xz, kg
# m^2
LINKS = (
    (
        0.350,
        np.pi / 2,
        0.0,
        (-0.353, 0.174, -0.004),
        395.40,
        (16.733765, 29.799119, 32.814954, -1.703664, 0.129384, 4.404062),
    ),
    (
        1.150,
        0.0,
        -0.189,
        (-0.709, -0.001, 0.023),
        339.12,
        (7.507819, 88.886691, 88.673761, 0.430046, 0.173157, -4.396607),
    ),
    (
        0.041,
        -np.pi / 2,
        0.0,
        (-0.018, -0.018, -0.076),
        105.21,
        (10.783798, 10.186135, 1.943179, 0.118474, -0.606384, -0.101950),
    ),
    (
        0.0,
        np.pi / 2,
        0.0,
        (0.0, 0.236, 0.001),
        35.80,
        (0.425035, 0.217993, 0.428465, -4e-6, -0.011353, -27e-6),
    ),
    (
        0.0,
        -np.pi / 2,
        0.0,
        (0.0, -0.080, -0.009),
        31.46,
        (0.283826, 0.229562, 0.258266, -4e-6, -0.019521, -120e-6),
    ),
)
RATIO = (1798 / 7, 1872 / 7, 757 / 3, 221.0, 5032 / 21, 206793 / 1340)
ROTOR = (0.00923, 0.0118, 0.0118, 0.00173, 0.00173, 0.00173)  # kg m^2
VISCOUS = (0.001476346, 0.010681832, 0.08398663, 0.001916077, 0.001629877, 0.002205322)  # N m s/rad
COULOMB = (0.73192436, 1.832264957, 1.862615588, 0.447963801, 0.413155803, 0.372594817)  # N m


def values(load: float = LOAD) -> dict[str, float]:
    """Standard parameters of kr300.yaml with a load at the flange, kg."""
    mass = load + 17.78
    centre = (load * 0.1 - 17.78 * 0.05) / mass
    links = (*LINKS, (0.0, np.pi, -0.24, (0.0, 0.0, centre), mass, (0.0,) * 6))
    found: dict[str, float] = {}
    for j, (a, alpha, shift, c, m, (xx, yy, zz, xy, yz, xz)) in enumerate(links, start=1):
        R = np.array(
            [[1, 0, 0], [0, np.cos(alpha), -np.sin(alpha)], [0, np.sin(alpha), np.cos(alpha)]]
        )
        p = R @ np.array(c) + (a, 0, shift)
        I = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T + m * (
            p @ p * np.eye(3) - np.outer(p, p)
        )
        found |= {
            f"{name}{j}": I[k]
            for name, k in zip(
                ("XX", "XY", "XZ", "YY", "YZ", "ZZ"),
                ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)),
                strict=True,
            )
        }
        found |= {f"M{axis}{j}": m * p[k] for k, axis in enumerate("XYZ")} | {f"M{j}": m}
        G = RATIO[j - 1]
        found |= {
            f"Ia{j}": ROTOR[j - 1] * G**2,
            f"FV{j}": VISCOUS[j - 1] * G**2,
            f"FS{j}": COULOMB[j - 1] * G,
            f"OFFSET{j}": 0.0,
        }
    return {name: float(x) for name, x in found.items()}


def robot_text(load: float | None = LOAD) -> str:
    """kr300.yaml; with the values of the source where a load, kg, is given."""
    text = (DATA / "kr300.yaml").read_text()
    if load is None:
        return text
    return (
        text
        + "values:\n  {"
        + ",\n   ".join(f"{name}: {x!r}" for name, x in values(load).items())
        + "}\n"
    )


def study(
    record: str = "A", *, careful: bool = True, validate: str = "", **sections: object
) -> dict:
    """Mapping of a study of one record; `careful`: filters and rows of the README of the record."""

    def settings(name: str) -> dict:
        return {
            "files": [str(DATA / f"{name}.mat")],
            "columns": {
                "t": "rec.time_cont",
                "q": "rec.act_pos_mot_deg",
                "tau": "rec.act_torque_abs_nm",
            },
            "units": {"q": "deg"},
            "side": "joint",
            "torque_side": "motor",
            "name": name,
        }

    treated = (
        {
            "signals": {"median": 1, "lowpass": {"cutoff": 10}},
            "rows": {"window": [1.8, 8.2], "low_speed": 0.02},
        }
        if careful
        else {}
    )
    own: dict = {"record": settings(record), **treated, **sections}
    return own | ({"validate": {"record": settings(validate)}} if validate else {})


def counterbalance(q: np.ndarray) -> np.ndarray:
    """Torque of the hydraulic counterbalance, README of the record, shape (N, 6), N m."""
    delta = q[:, 1] + np.radians(
        95 - 90
    )  # the axis of the controller stands at -90 deg where the record has zero
    length = np.sqrt(0.8**2 + 0.2**2 - 2 * 0.8 * 0.2 * np.cos(delta))
    lever = 0.8 * 0.2 * np.sin(delta) / length
    area = np.pi * (0.055**2 - 0.030**2) / 4
    pressure = 1.01 * 296.8 * 328 * 0.159 / (0.00096 - (length - 0.6) * area)
    torque = np.zeros_like(q)
    torque[:, 1] = lever * pressure * area
    return torque
