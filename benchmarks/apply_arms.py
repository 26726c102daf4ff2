"""Links, centres and inertias that `symgen apply` writes, against the truth of 20 simulated arms.

    python benchmarks/apply_arms.py --table            # writes benchmarks/apply_arms.md
    PYTHONPATH=/other/version python benchmarks/apply_arms.py --json other.json

Every arm is made here: 3 to 6 joints about axes in any direction, with rotors, friction and noise
in the torques; the file states the links as CAD does, without rotors and friction. Pinocchio
computes the record and, from the written file, the torques; MuJoCo computes the latter from the
same arm as MJCF. This script shares no code with what it judges.

Columns: deviation from the truth, in % of it, median and largest over the links of an arm, in the
file and as written: mass, centre (of the link's radius of gyration), inertia (largest moment about
the origin of the link frame), rotor; and the largest difference of the torques of the written file
with what has no place in it from those of the estimate, of the largest torque.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import warnings
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin

import runtime
import symgen
from runtime.core.model import load_model
from runtime.study import study_from_mapping

ARMS, SEED = 20, 56
RATE, SECONDS = 200.0, 20.0
STUDY = {
    "signals": {"lowpass": {"cutoff": 10}, "decimate": {"factor": 8}},
    "estimate": {"method": "feasible"},
}
Array = np.ndarray
Link = tuple[float, Array, Array]  # mass, centre, tensor about it


class Arm:
    """A serial arm: its geometry, true links, links of the file, rotors and friction."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([SEED, seed])
        self.n = n = int(rng.integers(3, 7))
        size = np.linspace(1.0, 0.35, n)
        self.axes = [rng.standard_normal(3) for _ in range(n)]
        self.axes = [a / np.linalg.norm(a) for a in self.axes]
        if seed % 2:  # axes as of most arms
            self.axes = [np.eye(3)[int(rng.integers(0, 3))] for _ in range(n)]
        self.origins = [0.4 * s * rng.uniform(-0.7, 1.0, 3) for s in size]
        self.turns = [rng.uniform(-1, 1, 3) * (seed % 2 == 0) for _ in range(n)]
        self.truth = [self._body(rng, s) for s in size]
        self.file = [self._cad(rng, link) for link in self.truth]
        mass = np.array([link[0] for link in self.truth])
        self.rotors = rng.uniform(0.05, 0.4, n) * np.cumsum(mass[::-1])[::-1] * 0.05
        self.FV, self.FS = rng.uniform(0.5, 2.0, n) * size, rng.uniform(0.5, 2.0, n) * size

    @staticmethod
    def _body(rng: np.random.Generator, size: float) -> Link:
        """A link of a few points, hence with a possible inertia."""
        points = size * 0.4 * rng.uniform(-0.4, 1.0, (6, 3)) * rng.uniform(0.2, 1.0, 3)
        m = size**2 * rng.uniform(0.3, 1.5, 6)
        c = m @ points / m.sum()
        d = points - c
        I = sum(x * (y @ y * np.eye(3) - np.outer(y, y)) for x, y in zip(m, d, strict=True))
        return float(m.sum()), c, I + 1e-3 * m.sum() * size**2 * np.eye(3)

    @staticmethod
    def _cad(rng: np.random.Generator, link: Link) -> Link:
        m, c, I = link
        radius = np.sqrt(np.trace(I) / m)
        moments = np.diag(I) * rng.uniform(0.8, 1.2)
        return (
            m * rng.uniform(0.75, 1.3),
            c + 0.15 * radius * rng.standard_normal(3),
            np.diag(moments),
        )

    def urdf(self) -> str:
        def words(x: Any) -> str:
            return " ".join(repr(float(v)) for v in np.atleast_1d(x))

        lines = ['<robot name="arm">', '<link name="base"/>']
        for j, (m, c, I) in enumerate(self.file, 1):
            parts = zip(
                ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), I[np.triu_indices(3)], strict=True
            )
            inertia = " ".join(f'{key}="{float(x)!r}"' for key, x in parts)
            lines += [
                f'<link name="l{j}"><inertial><origin xyz="{words(c)}"/><mass value="{m!r}"/>'
                f"<inertia {inertia}/></inertial></link>",
                f'<joint name="j{j}" type="continuous"><parent link="{f"l{j - 1}" if j > 1 else "base"}"/>'
                f'<child link="l{j}"/><origin xyz="{words(self.origins[j - 1])}" rpy="{words(self.turns[j - 1])}"/>'
                f'<axis xyz="{words(self.axes[j - 1])}"/></joint>',
            ]
        return "\n".join([*lines, "</robot>"]) + "\n"

    def mjcf(self) -> str:
        """The same arm by MuJoCo's own reader of URDF, with the file's links."""
        model = mujoco.MjSpec.from_string(
            self.urdf().replace(
                '<robot name="arm">',
                '<robot name="arm"><mujoco><compiler fusestatic="false" balanceinertia="false" '
                'boundmass="0" boundinertia="0"/></mujoco>',
            )
        )
        model.compile()
        return str(model.to_xml())

    def states(self, seed: int, seconds: float) -> tuple[Array, Array, Array, Array]:
        rng, t = np.random.default_rng([SEED, seed, 1]), np.arange(0, seconds, 1 / RATE)
        w = 2 * np.pi * rng.uniform(0.05, 0.9, (self.n, 5, 1))
        a, phase = 0.9 / w.clip(2) * rng.uniform(0.5, 1.5, w.shape), rng.uniform(0, 6.3, w.shape)
        s, c = np.sin(w * t + phase), np.cos(w * t + phase)
        return t, (a * s).sum(1).T, (a * w * c).sum(1).T, -(a * w**2 * s).sum(1).T

    def torques(self, states: tuple[Array, ...]) -> Array:
        """Torques of the true arm, (N, n)."""
        model = pin.buildModelFromXML(self.urdf())
        for j, (m, c, I) in enumerate(self.truth, 1):
            model.inertias[j] = pin.Inertia(m, c, I)
        q, qd, qdd = states
        return rnea(model, q, qd, qdd) + qdd * self.rotors + qd * self.FV + np.sign(qd) * self.FS


def rnea(model: Any, q: Array, qd: Array, qdd: Array) -> Array:
    data = model.createData()
    turns = [np.column_stack([np.cos(x), np.sin(x)]).ravel() for x in q]
    return np.array([pin.rnea(model, data, *x) for x in zip(turns, qd, qdd, strict=True)])


def of_urdf(text: bytes, states: tuple[Array, ...], rest: dict[str, float]) -> Array:
    """Torques of a written URDF by pinocchio, with its <dynamics> and what has no place in it."""
    root = ElementTree.fromstring(text)
    q, qd, qdd = states
    tau = rnea(pin.buildModelFromXML(text.decode()), q, qd, qdd)
    for k, joint in enumerate(root.iter("joint")):
        e = joint.find("dynamics")
        if e is not None:
            tau[:, k] += float(e.get("damping", 0)) * qd[:, k]
            tau[:, k] += float(e.get("friction", 0)) * np.sign(qd[:, k])
        tau[:, k] += rest.get(f"Ia{k + 1}", 0.0) * qdd[:, k] + rest.get(f"OFFSET{k + 1}", 0.0)
    return tau


def of_mjcf(text: bytes, states: tuple[Array, ...], rest: dict[str, float]) -> Array:
    """Torques of a written MJCF by MuJoCo; its soft law of dry friction is left out of the program
    and added as FS sign(qd).
    """
    model = mujoco.MjModel.from_xml_string(text.decode())
    FS = model.dof_frictionloss.copy()
    model.dof_frictionloss[:] = 0
    data, rows = mujoco.MjData(model), []
    for x, v, a in zip(*states, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = x, v, a
        mujoco.mj_inverse(model, data)
        rows.append(data.qfrc_inverse.copy())
    offset = [rest.get(f"OFFSET{k + 1}", 0.0) for k in range(model.nv)]
    return np.array(rows) + np.sign(states[1]) * FS + offset


def links_of(text: bytes) -> list[Link]:
    """Links of a URDF, by pinocchio."""
    model = pin.buildModelFromXML(text.decode())
    return [(i.mass, np.array(i.lever), np.array(i.inertia)) for i in list(model.inertias)[1:]]


def deviations(links: list[Link], truth: list[Link]) -> dict[str, list[float]]:
    """Deviations from the truth in %, of each link."""
    rows: dict[str, list[float]] = {"mass": [], "centre": [], "inertia": []}
    for (m, c, I), (m0, c0, I0) in zip(links, truth, strict=True):
        J, J0 = (
            M * (x @ x * np.eye(3) - np.outer(x, x)) + T for M, x, T in ((m, c, I), (m0, c0, I0))
        )
        rows["mass"].append(100 * abs(m / m0 - 1))
        rows["centre"].append(100 * float(np.linalg.norm(c - c0) / np.sqrt(np.trace(I0) / m0)))
        rows["inertia"].append(100 * float(np.abs(J - J0).max() / np.abs(J0).max()))
    return rows


def result(seed: int, folder: Path) -> dict[str, Any]:
    arm = Arm(seed)
    (folder / "arm.urdf").write_text(arm.urdf())
    model = load_model(symgen.model(folder / "arm.urdf"))
    t, *states = arm.states(seed, SECONDS)
    tau = arm.torques(tuple(states))
    rng = np.random.default_rng([SEED, seed, 2])
    noise = 0.01 * np.sqrt((tau**2).mean(axis=0)) * rng.standard_normal(tau.shape)
    record = runtime.Record(t, states[0], tau + noise, rate=RATE)
    fit = runtime.estimate(model, record, study_from_mapping(STUDY))
    applied = symgen.apply(fit, folder / "arm.urdf")
    _, *check = arm.states(seed + 100, 1.0)
    wanted = model.inverse_dynamics(*check, fit.X)
    theirs = of_urdf(applied.content, tuple(check), dict(applied.placeless))
    row: dict[str, Any] = {
        "arm": seed,
        "joints": arm.n,
        "file": deviations(arm.file, arm.truth),
        "written": deviations(links_of(applied.content), arm.truth),
        "pinocchio": float(np.abs(theirs - wanted).max() / np.abs(wanted).max()),
    }
    rotors = [applied.placeless.get(f"Ia{j}", 0.0) for j in range(1, arm.n + 1)]
    row["written"]["rotor"] = (100 * np.abs(rotors / arm.rotors - 1)).tolist()
    row["file"]["rotor"] = [100.0] * arm.n
    (folder / "arm.xml").write_text(arm.mjcf())
    bent = load_model(symgen.model(folder / "arm.xml"))
    again = runtime.estimate(bent, record, study_from_mapping(STUDY))
    applied = symgen.apply(again, folder / "arm.xml")
    wanted = bent.inverse_dynamics(*check, again.X)
    theirs = of_mjcf(applied.content, tuple(check), dict(applied.placeless))
    row["mujoco"] = float(np.abs(theirs - wanted).max() / np.abs(wanted).max())
    return row


KINDS = ("mass", "centre", "inertia", "rotor")


def table(rows: list[dict[str, Any]], before: list[dict[str, Any]]) -> str:
    """One line per arm: median / largest deviation in % in the file, as written before and now."""

    def cell(row: dict[str, Any] | None, where: str, kind: str) -> str:
        if row is None or "error" in row:
            return "-"
        x = row[where][kind]
        return f"{np.median(x):.0f} / {np.max(x):.0f}"

    head = ["arm", "joints", *(f"{k}, {w}" for k in KINDS for w in ("file", "before", "now"))]
    head += ["pinocchio", "MuJoCo"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    earlier = {row["arm"]: row for row in before}
    for row in rows:
        cells = [str(row["arm"]), str(row["joints"])]
        for kind in KINDS:
            cells += [cell(row, "file", kind), cell(earlier.get(row["arm"]), "written", kind)]
            cells.append(cell(row, "written", kind))
        cells += [f"{row['pinocchio']:.0e}", f"{row['mujoco']:.0e}"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--arms", type=int, default=ARMS)
    options = parser.parse_args()
    rows = []
    for seed in range(options.arms):
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                rows.append(result(seed, Path(folder)))
            except Exception as error:  # a version that refuses an arm
                rows.append({"arm": seed, "error": f"{type(error).__name__}: {error}"})
        print(json.dumps(rows[-1])[:300], flush=True)
        options.json.write_text(json.dumps(rows, indent=1))
    if options.table:
        before = json.loads(options.before.read_text()) if options.before else []
        options.table.write_text(table(rows, before))


if __name__ == "__main__":
    main()
