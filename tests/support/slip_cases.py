"""Right studies of three robots and slips in them: what the verdict has to name. The list of the
first 25 is that of the issue; 15 are our own.

A Case holds what a user gives: the text of a robot file, positions and torques of a log, sides and
rate. A slip changes one thing. `told` says what became of it: equivalent (no fit can tell it:
computed), named (a finding names the cause, in a list of at most six), wrong (findings, none of
them the cause), silent.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import runtime
import symgen
from runtime.compose import problem
from runtime.core.drives import Drives
from runtime.ground.errors import InputError
from runtime.ground.limits import limits
from runtime.plausible.causes import unchanged_study
from runtime.plausible.samples import samples_of
from runtime.plausible.trials import Baseline, baseline_of, regressor
from runtime.study import study_from_mapping
from symgen.description.yaml import parse_robot
from symgen.errors import SymgenError

LIMIT = limits("runtime.plausible")

Array = np.ndarray
Plain = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Case:
    """A study before anything is read: q in rad on `side`, tau in N m on `torque_side`, known
    torques of the joints.
    """

    robot: str
    t: Array
    q: Array
    tau: Array
    side: str = "joint"
    torque_side: str = "motor"
    known: Array | None = None
    study: Plain | None = None
    rate: float = 1.0
    values: bool = False

    def text(self, old: str, new: str) -> Case:
        assert old in self.robot, old
        return replace(self, robot=self.robot.replace(old, new, 1))

    def parts(self) -> tuple[Any, runtime.Record, Any, Any]:
        """Model, record, study, and the model with its table free."""
        robot = parse_robot(self.robot.encode(), "robot.yaml")
        model = symgen.model(robot)
        drives = None if model.DRIVES is None else Drives.from_mapping(model.DRIVES)
        q, tau = self.q, self.tau
        if self.side == "motor":
            q = drives.joint_position(q)
        if self.torque_side == "motor":
            tau = drives.joint_torque(tau)
        record = runtime.Record(
            self.t / self.rate, q, tau, **({} if self.known is None else {"tau_known": self.known})
        )
        settings = {
            "record": {"files": ["log.npz"], "side": self.side, "torque_side": self.torque_side},
            **(self.study or {}),
        }
        return model, record, study_from_mapping(settings), symgen.variants(robot)

    def judged(self) -> Any:
        """The Plausibility, or the error that stops the study, as a text."""
        try:
            model, record, study, variants = self.parts()
            return runtime.plausibility(model, record, study, variants=variants)
        except (InputError, SymgenError) as e:
            return str(e)

    def baseline(self) -> Baseline | None:
        """What is fitted; None where an error stops the study."""
        try:
            model, record, study, _ = self.parts()
            whole = problem(model, record, study)
            samples = samples_of(whole.prepared, whole.settings)
            D = regressor(model, (samples.q, samples.qd, samples.qdd))
            return baseline_of(model, samples, D, torque_side=self.torque_side)
        except (InputError, SymgenError):
            return None


GRAVITY = r"gravity (has the wrong sign: it )?points along -z0|it is \([^)]*-(1\.00|0\.9\d)\)"


@dataclass(frozen=True)
class Slip:
    """cause : pattern that a finding which names it matches."""

    number: int
    name: str
    cause: str
    change: Callable[[Case], Case]


def told(right: Case, case: Case, slip: Slip, usual: set[str]) -> tuple[str, str]:
    """equivalent, named, wrong or silent, and the findings. usual : questions that the right study
    is told as well.
    """
    result = case.judged()
    findings = (
        [result]
        if isinstance(result, str)
        else [
            f"{c.finding}. {c.remedy}"
            for c in result.checks()
            if _bad(c) and c.question not in usual
        ]
    )
    text = " | ".join(findings)
    if equivalent(right.baseline(), case.baseline()):
        return "equivalent", text
    if any(re.search(slip.cause, finding, re.IGNORECASE) for finding in findings):
        return "named", text
    return ("wrong" if findings else "silent"), text


def _bad(check: Any) -> bool:
    return check.state in ("no", "doubtful")


def equivalent(right: Baseline | None, slipped: Baseline | None) -> bool:
    """Whether no fit can tell a slip: its W spans every torque of the right study, as the slip maps
    them, and physics asks the same of both.
    """
    if right is None or slipped is None or len(right.samples) != len(slipped.samples):
        return False
    T = np.linalg.lstsq(right.tau, slipped.tau, rcond=None)[0].T
    if np.linalg.norm(slipped.tau - right.tau @ T.T) > 1e-9 * np.linalg.norm(slipped.tau):
        return False
    D, Y, _ = right.rows(unchanged_study(right.samples.n))
    V = np.einsum("ij,kjp->kip", T, D / np.abs(D).max(axis=(0, 1)))
    known = slipped.rows(unchanged_study(right.samples.n))[1] - Y @ T.T
    known[np.abs(known) < 1e-9 * np.abs(slipped.tau).max()] = 0.0
    within = slipped.beyond(np.concatenate([V, known[:, :, None]], axis=2)) < LIMIT.WITHIN_SPAN
    return (
        within
        and np.allclose(right.given.errors, slipped.given.errors, atol=0.05)
        and abs(right.given.penalty - slipped.given.penalty) < LIMIT.SAME_SCORE
    )


def columns(*order: int) -> Callable[[Array], Array]:
    return lambda x: x[:, list(order)]


def factor(j: int, f: float, n: int) -> Array:
    return np.where(np.arange(n) == j, f, 1.0)


# --- KUKA KR300
# ---------------------------------------------------------------------------------------------------------------------------------------

CAREFUL: Plain = {
    "signals": {"median": 1, "lowpass": {"cutoff": 10}},
    "rows": {"window": [1.8, 8.2], "low_speed": 0.02},
}


def kr300(
    folder: Path,
    letter: str = "A",
    *,
    values: bool = False,
    counterbalance: bool = True,
    careful: bool = True,
) -> Case:
    from scipy.io import loadmat

    raw = loadmat(folder / f"{letter}.mat", squeeze_me=True, struct_as_record=False)["rec"]
    text = (folder / "kr300.yaml").read_text()
    q = np.deg2rad(raw.act_pos_mot_deg.T)
    known = np.zeros_like(q)
    known[:, 1] = counterbalance_torque(q[:, 1])
    settings = CAREFUL if letter == "A" else {**CAREFUL, "rows": {"low_speed": 0.02}}
    return Case(
        robot=text
        + (
            f"values: {{{', '.join(f'{k}: {v:.9g}' for k, v in kr300_values().items())}}}\n"
            if values
            else ""
        ),
        t=raw.time_cont,
        q=q,
        tau=raw.act_torque_abs_nm.T,
        known=known if counterbalance else None,
        study=settings if careful else {},
        values=values,
    )


def counterbalance_torque(q2: Array) -> Array:
    """Hydraulic counterbalance of axis 2, N m, by the README of the record."""
    delta = q2 + np.deg2rad(95)
    length = np.sqrt(0.8**2 + 0.2**2 - 2 * 0.8 * 0.2 * np.cos(delta))
    area = np.pi * (0.055**2 - 0.030**2) / 4
    pressure = 1.01 * 296.8 * 328 * 0.159 / (0.00096 - (length - 0.6) * area)
    return 0.8 * 0.2 * np.sin(delta) / length * pressure * area


# mass, centre of mass and inertia about it in the distal frame, d and alpha from there to Khalil's
# frame, rotor inertia and ratio:
# facts of robot_model/model_KUKA_Quantec_Ultra_KR300.m of the source of the record, with its load
# of 200 kg
LINKS = (
    (
        395.40,
        (-0.353, 0.174, -0.004),
        (16.733765, 29.799119, 32.814954, -1.703664, 0.129384, 4.404062),
        0.35,
        np.pi / 2,
        0.00923,
        1798 / 7,
    ),
    (
        339.12,
        (-0.709, -0.001, 0.023),
        (7.507819, 88.886691, 88.673761, 0.430046, 0.173157, -4.396607),
        1.15,
        0.0,
        0.0118,
        1872 / 7,
    ),
    (
        105.21,
        (-0.018, -0.018, -0.076),
        (10.783798, 10.186135, 1.943179, 0.118474, -0.606384, -0.10195),
        0.041,
        -np.pi / 2,
        0.0118,
        757 / 3,
    ),
    (
        35.80,
        (0.0, 0.236, 0.001),
        (0.425035, 0.217993, 0.428465, -4e-6, -0.011353, -2.7e-5),
        0.0,
        np.pi / 2,
        0.00173,
        221.0,
    ),
    (
        31.46,
        (0.0, -0.080, -0.009),
        (0.283826, 0.229562, 0.258266, -4e-6, -0.019521, -0.00012),
        0.0,
        -np.pi / 2,
        0.00173,
        5032 / 21,
    ),
    (217.78, (0.0, 0.0, 19.111 / 217.78), (0.0,) * 6, 0.0, np.pi, 0.00173, 206793 / 1340),
)
BESIDE = {2: -0.189, 6: -0.24}  # r that the robot file leaves out, m


def kr300_values() -> dict[str, float]:
    """Standard parameters in Khalil's frames, about their origins."""
    values = {}
    for j, (m, r, (xx, yy, zz, xy, yz, xz), d, alpha, rotor, ratio) in enumerate(LINKS, start=1):
        c, s = np.cos(alpha), np.sin(alpha)
        R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        P = R @ r + [d, 0, BESIDE.get(j, 0.0)]
        J = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T + m * (
            P @ P * np.eye(3) - np.outer(P, P)
        )
        values |= {
            f"{name}{j}": J[i, k]
            for name, i, k in (
                ("XX", 0, 0),
                ("XY", 0, 1),
                ("XZ", 0, 2),
                ("YY", 1, 1),
                ("YZ", 1, 2),
                ("ZZ", 2, 2),
            )
        }
        values |= {f"M{axis}{j}": m * x for axis, x in zip("XYZ", P, strict=True)} | {
            f"M{j}": m,
            f"Ia{j}": rotor * ratio**2,
        }
    return {name: float(value) for name, value in values.items()}


def _kr300_classic(case: Case) -> Case:
    """The classic table, in the columns of Khalil's."""
    rows = {
        1: ("pi/2", "A1"),
        2: ("0", "A2"),
        3: ("-pi/2", "A3"),
        4: ("pi/2", "0"),
        5: ("-pi/2", "0"),
        6: ("0", "0"),
    }
    old = {
        1: ("pi", "0"),
        2: ("pi/2", "A1"),
        3: ("0", "A2"),
        4: ("-pi/2", "A3"),
        5: ("pi/2", "0"),
        6: ("-pi/2", "0"),
    }
    lines = case.robot.split("\n")
    for i, line in enumerate(lines):
        if m := re.match(r"  ([1-6]): {ant", line):
            j = int(m[1])
            lines[i] = re.sub(
                r"alpha: *[^,]+, *d: *[^,]+,", f"alpha: {rows[j][0]}, d: {rows[j][1]},", line
            )
            assert lines[i] != line or rows[j] == old[j]
    return replace(
        case, robot="\n".join(lines).replace("[0, 0, -g]", "[0, 0, g]")
    )  # its z0 points down


def _constants(case: Case, torque_constant: str) -> Case:
    """Torques of the motors as they are, torque constants of the robot file applied to them."""
    robot = parse_robot(case.robot.encode(), "robot.yaml")
    constants = np.array([float(x) for x in torque_constant.split(",")])
    text = case.robot.replace("drives:\n", f"drives:\n  torque_constant: [{torque_constant}]\n", 1)
    assert len(constants) == len(robot.joints)
    return replace(case, robot=text)


ANY_ROBOT = (
    Slip(
        5,
        "joints in reverse order",
        r"columns of positions and torques come in reverse order",
        lambda c: replace(c, q=c.q[:, ::-1], tau=c.tau[:, ::-1]),
    ),
    Slip(6, "gravity with the wrong sign", GRAVITY, lambda c: c.text("[0, 0, -g]", "[0, 0, g]")),
    Slip(7, "gravity along y", GRAVITY, lambda c: c.text("[0, 0, -g]", "[0, -g, 0]")),
)
"""Slips of every robot whose gravity is along -z."""

KR300 = (
    Slip(
        1,
        "ratio of joint 3 negative",
        r"torque of joint 3 has the wrong sign|joint 3 counts",
        lambda c: c.text("757/3", "-757/3"),
    ),
    Slip(2, "degrees taken for rad", r"degrees", lambda c: replace(c, q=np.rad2deg(c.q))),
    Slip(
        3,
        "position columns 2 and 3 exchanged",
        r"position columns of joints 2 and 3",
        lambda c: replace(c, q=columns(0, 2, 1, 3, 4, 5)(c.q)),
    ),
    Slip(
        4,
        "torque columns 4 and 5 exchanged",
        r"torque columns of joints 4 and 5",
        lambda c: replace(c, tau=columns(0, 1, 2, 4, 3, 5)(c.tau)),
    ),
    *ANY_ROBOT,
    Slip(
        8,
        "alpha of frame 4 with the wrong sign",
        r"alpha of frame 4",
        lambda c: c.text("ant: 3, sigma: 0, alpha: -pi/2", "ant: 3, sigma: 0, alpha: pi/2"),
    ),
    Slip(
        9,
        "alpha of frame 2 with the wrong sign",
        r"alpha of frame 2",
        lambda c: c.text("ant: 1, sigma: 0, alpha: pi/2", "ant: 1, sigma: 0, alpha: -pi/2"),
    ),
    Slip(10, "theta of frame 3 without pi", r"theta of joint 3", lambda c: c.text("q3 + pi", "q3")),
    Slip(11, "time stamps in ms", r"units\.t|record\.rate", lambda c: replace(c, t=1e3 * c.t)),
    Slip(
        12,
        "rate 1000 for 250",
        r"sampling rate is [^;]*\b1/4\b",
        lambda c: replace(
            c,
            rate=4.0,
            study={
                **c.study,
                "rows": {"window": [0.45, 2.05], "low_speed": 0.08},
                "signals": {"median": 1, "lowpass": {"cutoff": 40}},
            },
        ),
    ),
    Slip(
        13,
        "ratio forgotten",
        r"gear ratio is missing|record\.torque_side",
        lambda c: replace(c, torque_side="joint"),
    ),
    Slip(
        14,
        "torque said to be current",
        r"torques are taken as currents|units\.tau",
        lambda c: _constants(c, "1.2, 1.4, 1.4, 0.6, 0.6, 0.6"),
    ),
    Slip(
        15,
        "torque of joint 2 times 1.41",
        r"torque of joint 2 must be multiplied by 0\.[67]",
        lambda c: replace(c, tau=c.tau * factor(1, 1.41, 6)),
    ),
    Slip(
        16,
        "sense of joint 4 turned",
        r"joint 4 counts",
        lambda c: replace(c, q=c.q * factor(3, -1, 6), tau=c.tau * factor(3, -1, 6)),
    ),
    Slip(
        17,
        "secondary encoders: axes 4 to 6 zero",
        r"4, 5, 6 do not move",
        lambda c: replace(c, q=c.q * [1, 1, 1, 0, 0, 0]),
    ),
    Slip(
        18,
        "torque 20 ms late",
        r"Torques are late",
        lambda c: replace(c, tau=np.vstack([np.repeat(c.tau[:1], 5, axis=0), c.tau[:-5]])),
    ),
    Slip(19, "classic table without convention", r"convention", _kr300_classic),
    Slip(
        20,
        "alpha in degrees",
        r"alpha|degrees",
        lambda c: c.text("ant: 3, sigma: 0, alpha: -pi/2", "ant: 3, sigma: 0, alpha: -90"),
    ),
    Slip(21, "A2 = 1.5 for 1.15", r"d of frame 3 is", lambda c: c.text("A2: 1.15", "A2: 1.5")),
    Slip(
        22,
        "D1 in mm",
        r"r of frame 1|link ends at frame 1",
        lambda c: c.text("D1: 0.675", "D1: 675.0"),
    ),
    Slip(
        23,
        "D4 in mm",
        r"r of frame 4|longest link ends at frame 4",
        lambda c: c.text("D4: 1.0", "D4: 1000.0"),
    ),
    Slip(
        24,
        "theta of frame 3 wrong by 90 degrees",
        r"theta of joint 3|zero of joint 3",
        lambda c: c.text("q3 + pi", "q3 + pi/2"),
    ),
    Slip(
        25,
        "ratios of joints 4 and 5 exchanged",
        r"ratios of joints 4 and 5",
        lambda c: replace(c, tau=c.tau * [1, 1, 1, 5032 / 21 / 221, 221 / (5032 / 21), 1]),
    ),
    Slip(
        26,
        "zero of joint 3 off by 20 degrees",
        r"zero of joint 3",
        lambda c: replace(c, q=c.q + np.deg2rad(20) * (np.arange(6) == 2)),
    ),
    Slip(
        27,
        "torque of joint 5 in kp m",
        r"torque of joint 5 (must be multiplied|is 0\.)",
        lambda c: replace(c, tau=c.tau * factor(4, 1 / 9.81, 6)),
    ),
    Slip(
        28,
        "position columns moved by one",
        r"position columns are moved by one",
        lambda c: replace(c, q=np.roll(c.q, 1, axis=1)),
    ),
    Slip(
        29,
        "torque columns moved by one",
        r"torque columns are moved by one",
        lambda c: replace(c, tau=np.roll(c.tau, -1, axis=1)),
    ),
    Slip(
        30,
        "joint positions taken for those of motors",
        r"positions of the joints|record\.side",
        lambda c: replace(c, side="motor"),
    ),
    Slip(
        31, "all torques negative", r"torques have the wrong sign", lambda c: replace(c, tau=-c.tau)
    ),
    Slip(32, "mounted on a wall in the file", GRAVITY, lambda c: c.text("[0, 0, -g]", "[g, 0, 0]")),
    Slip(
        33,
        "alpha of frame 5 zero",
        r"alpha of frame 5",
        lambda c: c.text("ant: 4, sigma: 0, alpha: pi/2", "ant: 4, sigma: 0, alpha: 0"),
    ),
    Slip(
        34,
        "torque 12 ms early",
        r"Torques are early",
        lambda c: replace(c, tau=np.vstack([c.tau[3:], np.repeat(c.tau[-1:], 3, axis=0)])),
    ),
    Slip(
        35,
        "position of joint 2 with the wrong sign",
        r"position of joint 2 has the wrong sign",
        lambda c: replace(c, q=c.q * factor(1, -1, 6)),
    ),
    Slip(
        36,
        "rate 100 for 250",
        r"sampling rate is [^;]*\b2\.5\b",
        lambda c: replace(
            c,
            rate=0.4,
            study={
                **c.study,
                "rows": {"window": [4.5, 20.5], "low_speed": 0.008},
                "signals": {"median": 1, "lowpass": {"cutoff": 4}},
            },
        ),
    ),
    Slip(
        37,
        "A3 and D4 exchanged",
        r"[dr] of frame 4",
        lambda c: c.text("A3: 0.041", "A3: 1.0").text("D4: 1.0", "D4: 0.041"),
    ),
    Slip(
        38,
        "joint 4 in degrees, the others in rad",
        r"joint 4.*degrees",
        lambda c: replace(c, q=c.q * factor(3, 180 / np.pi, 6)),
    ),
    Slip(
        39,
        "theta of frame 2 with the wrong sign of pi/2",
        r"theta of joint 2",
        lambda c: c.text("q2 - pi/2", "q2 + pi/2"),
    ),
    Slip(
        40,
        "another robot's values: masses of a third",
        r"values are those of another robot",
        lambda c: _masses(c, 1 / 3) if c.values else c,
    ),
)


def _masses(case: Case, f: float) -> Case:
    """The values of all links scaled."""
    head, values = case.robot.split("values: {")
    scaled = re.sub(r": ([-+.e0-9]+)", lambda m: f": {f * float(m[1]):.9g}", values)
    return replace(case, robot=f"{head}values: {{{scaled}")


# --- a four-axis palletiser, simulated
# ------------------------------------------------------------------------------------------------------------

PALLETISER = """\
symgen: 1
name: palletiser
gravity: [0, 0, -g]
constants: {D2: 0.3, D3: 1.0, D4: 1.2, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0,     d: 0,  theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: -pi/2, d: D2, theta: q2, r: 0}
  3: {ant: 2, sigma: 0, alpha: 0,     d: D3, theta: q3, r: 0}
  4: {ant: 3, sigma: 0, alpha: pi/2,  d: D4, theta: q4, r: 0}
elements:
  Ia:     {kind: inertia, along: all}
  FV:     {kind: viscous, along: all}
  FS:     {kind: coulomb, along: all}
  OFFSET: {kind: offset,  along: all}
drives:                            # the motor of joint 3 stands at the base: its angle is that of the forearm, q2 + q3
  ratio: [[150, 0, 0, 0], [0, 180, 0, 0], [0, 160, 160, 0], [0, 0, 0, 80]]
limits: {q: [[-3, 3], [-2, 2], [-2.5, 2.5], [-6, 6]], qd: [3, 3, 3, 6]}
"""
BODIES = {
    1: (180, 0.1, 0.0, -0.1),
    2: (90, 0.45, 0.02, 0.1),
    3: (110, 0.35, 0.05, 0.0),
    4: (60, 0.05, 0.02, -0.2),
}  # kg, m


def palletiser(seed: int = 0, noise: float = 0.02) -> Case:
    """Motor angles and torques: sums of sinusoids, dry friction that falls with speed (which the
    model lacks), noise, encoder steps.
    """
    rng = np.random.default_rng([41, seed])
    robot = parse_robot(PALLETISER.encode(), "palletiser.yaml")
    model = symgen.model(robot)
    rate, T = 500.0, 12.0
    t = np.arange(int(rate * T)) / rate
    size = np.array([1.2, 0.6, 0.7, 2.0])
    q, qd, qdd = np.zeros((3, len(t), 4))
    for j in range(4):
        for k in rng.choice(np.arange(1, 11), 5, replace=False):
            a, phase, w = (
                size[j] * rng.uniform(0.2, 0.6) / np.sqrt(k),
                rng.uniform(0, 6.28),
                2 * np.pi * k / T,
            )
            q[:, j] += a * np.sin(w * t + phase)
            qd[:, j] += a * w * np.cos(w * t + phase)
            qdd[:, j] -= a * w**2 * np.sin(w * t + phase)
    q += [0.0, -0.6, 0.8, 0.0]
    chi = dict.fromkeys(robot.parameters, 0.0)
    for j, (m, x, y, z) in BODIES.items():
        P = np.array([x, y, z])
        J = m * (P @ P * np.eye(3) - np.outer(P, P)) + m * 0.04 * np.diag([1.0, 1.3, 1.1])
        chi |= {
            f"{name}{j}": J[i, k]
            for name, i, k in (
                ("XX", 0, 0),
                ("XY", 0, 1),
                ("XZ", 0, 2),
                ("YY", 1, 1),
                ("YZ", 1, 2),
                ("ZZ", 2, 2),
            )
        }
        chi |= {f"M{axis}{j}": m * v for axis, v in zip("XYZ", P, strict=True)} | {
            f"M{j}": float(m)
        }
        chi |= {f"Ia{j}": 40.0 / j, f"FV{j}": 60.0 / j, f"FS{j}": 80.0 / j, f"OFFSET{j}": 2.0}
    tau = model.inverse_dynamics(q, qd, qdd, model.base_parameters(chi))
    tau += 15 * np.sign(qd) * np.exp(-np.abs(qd) / 0.1) + noise * tau.std(
        axis=0
    ) * rng.standard_normal(tau.shape)
    drives = Drives.from_mapping(model.DRIVES)
    motor = drives.motor_position(q)
    return Case(
        PALLETISER,
        t,
        np.round(motor / 1e-4) * 1e-4,
        drives.motor_command(tau),
        "motor",
        "motor",
        study={"signals": {"lowpass": {"cutoff": 20}}},
    )


def _coupled(case: Case) -> Case:
    return case.text("[0, 160, 160, 0]", "[0, 0, 160, 0]")


SIMULATED = (
    Slip(1, "ratio of joint 2 negative", r"joint 2 counts", lambda c: c.text("180", "-180")),
    Slip(2, "motor angles in degrees", r"units\.q: deg", lambda c: replace(c, q=np.rad2deg(c.q))),
    Slip(
        3,
        "position columns 1 and 4 exchanged",
        r"position columns of joints 1 and 4",
        lambda c: replace(c, q=columns(3, 1, 2, 0)(c.q)),
    ),
    Slip(
        4,
        "torque columns 2 and 3 exchanged",
        r"torque columns of joints 2 and 3",
        lambda c: replace(c, tau=columns(0, 2, 1, 3)(c.tau)),
    ),
    *ANY_ROBOT,
    Slip(
        8,
        "alpha of frame 2 with the wrong sign",
        r"alpha of frame 2",
        lambda c: c.text("alpha: -pi/2", "alpha: pi/2"),
    ),
    Slip(9, "coupling of joints 2 and 3 forgotten", r"coupling of joints 2 and 3", _coupled),
    Slip(12, "rate 2000 for 500", r"sampling rate is [^;]*\b1/4\b", lambda c: replace(c, rate=4.0)),
    Slip(
        13,
        "motor torques taken for joint torques",
        r"gear ratio is missing|record\.torque_side",
        lambda c: replace(c, torque_side="joint"),
    ),
    Slip(
        15,
        "torque of joint 2 times 1.41",
        r"torque of joint 2 must be multiplied by 0\.[67]",
        lambda c: replace(c, tau=c.tau * [1, 1.41, 1, 1]),
    ),
    Slip(
        18,
        "torque 20 ms late",
        r"Torques are late",
        lambda c: replace(c, tau=np.vstack([np.repeat(c.tau[:1], 10, axis=0), c.tau[:-10]])),
    ),
    Slip(21, "D3 = 1.4 for 1.0", r"d of frame 3 is", lambda c: c.text("D3: 1.0", "D3: 1.4")),
    Slip(
        24,
        "theta of frame 3 wrong by 90 degrees",
        r"theta of joint 3|zero of joint 3",
        lambda c: c.text("theta: q3", "theta: q3 + pi/2"),
    ),
    Slip(
        26,
        "zero of joint 2 off by 15 degrees",
        r"zero of joint 2",
        lambda c: c.text("theta: q2", "theta: q2 + pi/12"),
    ),
    Slip(
        31, "all torques negative", r"torques have the wrong sign", lambda c: replace(c, tau=-c.tau)
    ),
    Slip(
        34,
        "torque 8 ms early",
        r"Torques are early",
        lambda c: replace(c, tau=np.vstack([c.tau[4:], np.repeat(c.tau[-1:], 4, axis=0)])),
    ),
    Slip(
        41,
        "D4 in mm",
        r"[dr] of frame 4|link ends at frame 4",
        lambda c: c.text("D4: 1.2", "D4: 1200.0"),
    ),
    Slip(
        42,
        "motor angles taken for joint angles",
        r"positions of the motors|record\.side|side of the positions",
        lambda c: replace(c, side="joint"),
    ),
)


# --- Staubli TX40, measured
# -----------------------------------------------------------------------------------------------------------------------


def tx40(folder: Path, *, values: bool = False) -> Case:
    import gzip

    def column(file: str) -> Array:
        with gzip.open(folder / f"{file}.csv.gz", "rt") as stream:
            return np.loadtxt(stream, delimiter=",", skiprows=1)

    text = (Path(symgen.__file__).parent / "description" / "robots" / "tx40.yaml").read_text()
    head, _, tail = text.partition("values:")
    q, tau = column("pos_read_data"), column("curr_data")
    return Case(
        robot=head + ("values:" + tail if values else ""),
        t=np.arange(len(q)) / 5000,
        q=q,
        tau=tau,
        side="motor",
        torque_side="motor",
        study={"rows": {"window": [0, 7.5]}},
        values=values,
    )


TX40 = (
    Slip(
        1,
        "ratio of joint 3 negative",
        r"joint 3 counts",
        lambda c: c.text("[0, 0, 45, 0", "[0, 0, -45, 0"),
    ),
    Slip(
        3,
        "position columns 2 and 3 exchanged",
        r"position columns of joints 2 and 3",
        lambda c: replace(c, q=columns(0, 2, 1, 3, 4, 5)(c.q)),
    ),
    Slip(
        4,
        "torque columns 4 and 5 exchanged",
        r"torque columns of joints 4 and 5",
        lambda c: replace(c, tau=columns(0, 1, 2, 4, 3, 5)(c.tau)),
    ),
    Slip(6, "gravity with the wrong sign", GRAVITY, lambda c: c.text("[0, 0, -g]", "[0, 0, g]")),
    Slip(
        8,
        "alpha of frame 4 with the wrong sign",
        r"alpha of frame 4",
        lambda c: c.text("ant: 3, sigma: 0, alpha: pi/2", "ant: 3, sigma: 0, alpha: -pi/2"),
    ),
    Slip(
        9,
        "alpha of frame 2 with the wrong sign",
        r"alpha of frame 2",
        lambda c: c.text("ant: 1, sigma: 0, alpha: -pi/2", "ant: 1, sigma: 0, alpha: pi/2"),
    ),
    Slip(
        15,
        "torque of joint 2 times 1.41",
        r"torque of joint 2 must be multiplied by 0\.[67]",
        lambda c: replace(c, tau=c.tau * factor(1, 1.41, 6)),
    ),
    Slip(16, "ratio of joint 4 positive", r"joint 4 counts", lambda c: c.text("-48", "48")),
    Slip(
        18,
        "torque 20 ms late",
        r"Torques are late",
        lambda c: replace(c, tau=np.vstack([np.repeat(c.tau[:1], 110, axis=0), c.tau[:-110]])),
    ),
    Slip(
        23,
        "RL4 in mm",
        r"[dr] of frame 4|link ends at frame 4",
        lambda c: c.text("RL4: 0.225", "RL4: 225.0"),
    ),
    Slip(
        24,
        "offset of joint 3 forgotten",
        r"(theta|zero) of joint 3|\(joint 3\)[^|]*drives\.offset",
        lambda c: c.text("offset: [0, -pi/2, pi/2", "offset: [0, -pi/2, 0"),
    ),
    Slip(
        43,
        "coupling of the wrist forgotten",
        r"coupling of joints 5 and 6",
        lambda c: c.text("[0, 0, 0, 0, 32, 32]", "[0, 0, 0, 0, 0, 32]"),
    ),
    Slip(
        44,
        "offsets of the drives with the wrong sign",
        r"offsets of the drives|joint 2\).*joint 3\)[^|]*drives\.offset",
        lambda c: c.text("offset: [0, -pi/2, pi/2", "offset: [0, pi/2, -pi/2"),
    ),
)


def campaigns(folder: Path) -> list[tuple[str, Case, tuple[Slip, ...]]]:
    """Name, right study and slips."""
    return [
        ("kr300 values", kr300(folder / "kr300", values=True), KR300),
        ("kr300 plain", kr300(folder / "kr300"), KR300),
        ("palletiser", palletiser(), SIMULATED),
        ("tx40 plain", tx40(folder / "tx40"), TX40),
        ("tx40 values", tx40(folder / "tx40", values=True), TX40),
    ]
