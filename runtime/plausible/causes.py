"""Two tables of possible errors (causes) of a study, robot file or record, each tried alone.

Each row gives the kind of a cause, for which items it is tried (joints, pairs of joints, frames,
...), the sentences of the finding and of the remedy, and the change of the samples or of the table
of frames that corrects the error:

    q' = P q + p,  qd' = f P qd,  qdd' = f^2 P qdd
    tau' = T tau - s known - rho,    free_... = another value

    CAUSES     a sign, an order, a unit: one change each, about 10 n^2 for n joints
    NUMBERS    a factor, a zero, a length: one unknown number xi each, zero in the study as given

A new cause is a row (docs/contributing.md). `runtime.plausible.trials` tries them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np

from runtime.core.model import (
    GeneratedModel,
    drives_of,
    joint_labels,
    joint_torque_units,
    joint_units,
)
from runtime.ground.limits import limits
from runtime.plausible.samples import Samples

LIMIT = limits(__package__)

Array = np.ndarray
Item = Mapping[str, Any]
"""One candidate for a cause: the words of its sentence, and the values that its maps read."""
Maps = dict[str, Any]
"""Fields of a Cause: what it does."""

DEGREE = np.pi / 180
TURNS = {"90 degrees": np.pi / 2, "-90 degrees": -np.pi / 2, "180 degrees": np.pi}
LENGTHS = {"1000": 1e3, "1/1000": 1e-3}
TORQUE_UNITS = {
    "kN*m": 1e3,
    "N*mm": 1e-3,
    "N*cm": 1e-2,
    "kgf*cm": 0.0980665,
    "lbf*inch": 0.1129848290276167,
    "ozf*inch": 0.0070615518142260435,
}
"""Units of torque that are read as N m, in N m."""
GUESSES = {
    2**0.5: "1.41: effective for peak values",
    3**0.5: "1.73: phase for line values",
    2.0: "2: half of a pair of motors",
    9.81: "9.81: kp m for N m",
}
"""Mistakes that multiply a torque by a known factor."""
SCALE = "record.scale."
"""Start of the settings that multiply columns of the record, such as record.scale.tau."""
GRAVITY = ("free_gx", "free_gy", "free_gz")
ENTRY = re.compile(r"free_(alpha|[drb])(\d+)")


@dataclass(frozen=True, eq=False)
class Cause:
    """One possible error of a study, a robot file or a record, and the change that corrects it.

    Attributes
    ----------
    kind : str
        Family: sign, exchange, order, unit, side, rate, angle, zero, gravity, length, table,
        coupling, ...
    says, remedy : str
        Sentences on what would be wrong, and what to change.
    subject : str
        Name of the changed number, if other amounts of it are causes, too; otherwise the text of
        `says`.
    P, p : ndarray, shape (n, n) and (n,)
        Change of the positions: q' = P q + p.
    T : ndarray, shape (n, n)
        Matrix that multiplies the torques.
    rate : float
        Factor f that multiplies the sampling rate.
    known_factor : float or ndarray, shape (n,)
        Factor s that multiplies the known torques.
    unmodelled : ndarray, shape (n, 2), or 0
        Factors of `unmodelled_torques` for each joint, N m or N: rho.
    constants : mapping of str to float
        Changed entries of the table of frames, SI.
    change : mapping of str to value
        The remedy as settings of the study, for instance {"record.units.q": "deg"}; {} if there are
        none.
    """

    kind: str
    says: str
    remedy: str
    subject: str
    P: Array
    p: Array
    T: Array
    rate: float = 1.0
    known_factor: Array | float = 1.0
    unmodelled: Array | float = 0.0
    constants: Mapping[str, float] = field(default_factory=dict)
    change: Mapping[str, Any] = field(default_factory=dict)

    @property
    def on_torques(self) -> bool:
        """Whether the correction changes only torques, and not the observation matrix W."""
        still = np.array_equal(self.P, np.eye(len(self.p))) and not self.p.any()
        return still and self.rate == 1 and not self.constants

    def states(self, samples: Samples) -> tuple[Array, Array, Array]:
        """Compute q, qd and qdd of the samples after the correction of the error, shape (K, n)
        each.
        """
        q = samples.q @ self.P.T + self.p
        qd = self.rate * samples.qd @ self.P.T
        qdd = self.rate**2 * samples.qdd @ self.P.T
        return q, qd, qdd

    def torque(self, samples: Samples) -> Array:
        """Compute the torques to which the model is fitted after the correction, shape (K, n)."""
        return np.asarray(samples.tau @ self.T.T - self.subtracted(samples))

    def subtracted(self, samples: Samples) -> Array:
        """Compute the torques that the model lacks, s known + rho, shape (K, n), which are
        subtracted from the measured torques.
        """
        known = np.asarray(self.known_factor * samples.tau_known)
        if np.ndim(self.unmodelled) == 0:
            return known
        return np.asarray(known + (self.unmodelled * unmodelled_torques(samples)).sum(axis=2))


def unmodelled_torques(samples: Samples) -> Array:
    """Compute two torques that a model may lack: a constant, and friction at low speed.

    Both have unit size; the shape is (K, n, 2). The constant is 1, the friction

    sign(qd) exp(-(qd/v)^2), with v a small share (SLOW in limits.toml) of the largest speed.
    """
    qd = samples.qd
    v = np.maximum(LIMIT.SLOW * np.abs(qd).max(axis=0), 1e-12)
    slow = np.sign(qd) * np.exp(-((qd / v) ** 2))
    return np.stack([np.ones_like(qd), slow], axis=2)


def unchanged_study(n: int, **changed: Any) -> Cause:
    """Make a `Cause` for n joints that corrects nothing, except by the given fields."""
    plain = {"kind": "", "says": "", "remedy": "", "subject": ""}
    return Cause(**plain | {"P": np.eye(n), "p": np.zeros(n), "T": np.eye(n)} | changed)


class Robot:
    """Joints, drives and table of frames of a robot, to list the errors that its file may have.

    Parameters
    ----------
    model : GeneratedModel
    variants : GeneratedModel, optional
        The module of `symgen.variants`, in which entries of the table of frames can be changed.
        Without it, no cause changes the table.
    sides : (str, str)
        Sides of positions and torques in the files: motor or joint.
    samples : Samples, optional
        Samples that show which joints have known torques, and how large the torques are.
    column_units : mapping of str to tuple of str, optional
        Units of the columns q and tau in the files, one for each joint; default: not known.
    friction : ndarray, shape (n,), N m or N, optional
        Friction at low speed that the model lacks, to first order; None if it is certain for no
        joint.
    """

    def __init__(
        self,
        model: GeneratedModel,
        variants: GeneratedModel | None = None,
        sides: Sequence[str] = ("joint", "joint"),
        samples: Samples | None = None,
        friction: Array | None = None,
        column_units: Mapping[str, tuple[str, ...]] | None = None,
    ) -> None:
        self.n = n = len(model.JOINTS)
        self.labels, self.units = joint_labels(model), joint_units(model)
        self.turning = np.array([unit == "rad" for unit in self.units])
        self.torque_units = joint_torque_units(model)
        self.links = getattr(model, "LINKS", ())
        self.free = {} if variants is None else dict(variants.CONSTANTS)
        self.sides, self.samples, self.friction = sides, samples, friction
        self.column_units = column_units or {}
        drives = drives_of(model)
        self.drives = drives
        self.R = np.eye(n) if drives is None else drives.ratio
        self.offset = np.zeros(n) if drives is None else drives.offset
        self.constant = np.eye(n) if drives is None else np.diag(drives.torque_constant)

    def one(self, j: int, value: float, others: float = 1.0) -> Array:
        """Make an array with `value` at joint j and `others` at all other joints, shape (n,)."""
        return np.where(np.arange(self.n) == j, value, others)

    def positions(self, E: Array) -> Maps:
        """Compute the correction of joint positions from the correction E of the positions in the
        files.

        Return P of q' = P q + p, and p for files on the side of the motors. For these files,
        with R the gear ratio,

        q' = R^-1 E R (q - offset) + offset.
        """
        if self.sides[0] == "motor":
            E = np.linalg.inv(self.R) @ E @ self.R
            return {"P": E, "p": self.offset - E @ self.offset}
        return {"P": E}

    def torques(self, E: Array) -> Maps:
        """Compute the correction of joint torques from the correction E of the torques in the
        files.

        Return T of the correction tau' = T tau. For files on the side of the motors, with R the
        gear ratio,

        T = R' E R'^-1.
        """
        if self.sides[1] == "motor":
            E = self.R.T @ E @ np.linalg.inv(self.R.T)
        return {"T": E}

    @property
    def gravity(self) -> Array:
        """Gravity vector of the robot file in frame 0, shape (3,), m/s^2.

        The vector is zero if the Robot was made without `variants`.
        """
        return np.array([self.free.get(key, 0.0) for key in GRAVITY])

    @property
    def frames(self) -> list[int]:
        """Numbers of the frames whose geometry may be altered to test the robot file for errors.

        Frames of constrained joints are left out.
        """
        entries = (ENTRY.fullmatch(key) for key in self.free)
        return sorted(int(entry[2]) for entry in entries if entry and entry[1] == "alpha")

    @property
    def whole_table(self) -> bool:
        """Whether the table entries of every frame that has a link can be changed."""
        return {*self.links} <= {*self.frames} and bool(self.frames)


@dataclass(frozen=True)
class Row:
    """One kind of possible error (a row of the table `CAUSES` or `NUMBERS`), and how to correct it.

    Attributes
    ----------
    kind : str
    of : function of the Robot
        Yields the items for which the cause is tried, for instance joints.
    says, remedy, subject : str
        Sentences with the words of an item in braces; the default of `subject` is `says`.
    maps : function of the Robot, the item and, in the table `NUMBERS`, xi
        Returns the fields of the Cause that change the samples or the table of frames.
    span : float
        In the table `NUMBERS`, the largest |xi| to which the search extends.
    words : function of the Robot, the item and xi
        In the table `NUMBERS`: returns the words of the sentences that depend on xi.
    change : function of the Robot and the item
        Returns the remedy as settings of the study.
    """

    kind: str
    of: Callable[[Robot], Iterator[Item]]
    says: str
    remedy: str
    maps: Callable[..., Maps]
    subject: str = ""
    span: float = 0.0
    words: Callable[..., Item] = lambda robot, item, xi: {}
    change: Callable[[Robot, Item], Mapping[str, Any]] = lambda robot, item: {}

    def cause(self, robot: Robot, item: Item, *xi: float) -> Cause:
        """Make the `Cause` of this kind of error for one item, for instance for one joint.

        Rows of the table `NUMBERS` also need xi, the unknown number.
        """
        words = {**item, **(self.words(robot, item, *xi) if xi else {})}
        says, change = self.says.format(**words), self.change(robot, item)
        scale = ", ".join(
            f"{key.removeprefix(SCALE)}: {signs}"
            for key, signs in change.items()
            if key.startswith(SCALE)
        )
        return unchanged_study(
            robot.n,
            kind=self.kind,
            says=says,
            remedy=self.remedy.format(**words)
            + f" (record.scale: {{{scale}}}; multiply factors that the study gives there)"
            * bool(scale),
            subject=self.subject.format(**words) or says,
            change=change,
            **self.maps(robot, item, *xi),
        )


# What causes are tried of


def study(robot: Robot) -> Iterator[Item]:
    """Yield one empty mapping, for a mistake that concerns the whole study and not one joint."""
    yield {}


def several_joints(robot: Robot) -> Iterator[Item]:
    """Yield one empty mapping, for a mistake in all joints together; nothing for a single joint."""
    yield from [{}] if robot.n > 1 else []


def joints(robot: Robot) -> Iterator[Item]:
    """Yield, for each joint, a mapping (item) with its number from 0 and its label."""
    for j, label in enumerate(robot.labels):
        yield {"j": j, "joint": label}


def senses(robot: Robot) -> Iterator[Item]:
    """Yield each joint, with the matrix E that reverses the sign of its signals in the record."""
    for item in joints(robot):
        yield {**item, "E": np.diag(robot.one(item["j"], -1.0))}


def joints_of_several(robot: Robot) -> Iterator[Item]:
    """Yield the number and the label of each joint; nothing if the robot has only one joint."""
    yield from joints(robot) if robot.n > 1 else ()


def turning_joints(robot: Robot) -> Iterator[Item]:
    """Yield the number and the label of each revolute joint."""
    yield from (item for item in joints(robot) if robot.turning[item["j"]])


def turns(robot: Robot) -> Iterator[Item]:
    """Yield each revolute joint with an error of its zero position: 90, -90 and 180 degrees."""
    for item in turning_joints(robot):
        for text, angle in TURNS.items():
            yield {**item, "turn": text, "angle": angle}


def pairs(robot: Robot) -> Iterator[Item]:
    """Yield each pair of joints, with the matrix E that exchanges their columns in the record."""
    for i, k in combinations(range(robot.n), 2):
        E = np.eye(robot.n)
        E[[i, k]] = E[[k, i]]
        yield {"i": i, "k": k, "E": E, "one": robot.labels[i], "other": robot.labels[k]}


def orders(robot: Robot) -> Iterator[Item]:
    """Yield matrices E that reorder the joint columns of a record: reversed, or moved by one joint.

    Nothing is yielded for fewer than three joints.
    """
    E = np.eye(robot.n)
    if robot.n > 2:
        yield {"E": E[::-1], "moved": "come in reverse order"}
        yield {"E": np.roll(E, 1, axis=0), "moved": "are moved by one joint back"}
        yield {"E": np.roll(E, -1, axis=0), "moved": "are moved by one joint on"}


def torque_units(robot: Robot) -> Iterator[Item]:
    """Yield each unit in which all torques may have been recorded, with its value in N m.

    Nothing is yielded unless all torques are in N m, or if the law of a controller gives them.
    """
    measured = robot.sides[1] != "law" and {*robot.torque_units} == {"N m"}
    for unit, factor in TORQUE_UNITS.items() if measured else ():
        yield {"unit": unit, "factor": factor, "read": ("N*m", "Nm"), "chosen": robot.turning}


def torque_unit_of_joints(robot: Robot) -> Iterator[Item]:
    """Yield each unit in which the torque of one joint may have been recorded."""
    yield from of_each_joint(robot, torque_units(robot))


def position_units(robot: Robot) -> Iterator[Item]:
    """Yield each possible mistake in the unit of all positions, such as degrees read as rad.

    The mistake concerns all revolute joints or all prismatic joints.
    """
    for unit, factor, turning, read, mistake in (
        ("deg", DEGREE, True, ("rad",), "degrees are read as rad"),
        ("rad", 1 / DEGREE, True, ("deg", "°"), "rad are read as degrees"),
        ("rev", 2 * np.pi, True, ("rad",), "turns are read as rad"),
        ("mm", 1e-3, False, ("m",), "mm are read as m"),
        ("m", 1e3, False, ("mm",), "m are read as mm"),
    ):
        chosen = robot.turning == turning
        if chosen.any():
            item = {"unit": unit, "factor": factor, "read": read, "mistake": mistake}
            yield {**item, "chosen": chosen}


def position_unit_of_joints(robot: Robot) -> Iterator[Item]:
    """Yield each possible mistake in the unit of one joint position, such as degrees read as rad."""
    yield from of_each_joint(robot, position_units(robot))


def of_each_joint(robot: Robot, items: Iterator[Item]) -> Iterator[Item]:
    """Yield a mistake in the data of several joints, such as a wrong unit, for each joint alone.

    `items` are the mistakes of several joints.
    """
    for item in items:
        for j in np.flatnonzero(item["chosen"]) if item["chosen"].sum() > 1 else ():
            yield {**item, "chosen": np.arange(robot.n) == j, "joint": robot.labels[j]}


def rates(robot: Robot) -> Iterator[Item]:
    """Yield each factor by which the sampling rate may be wrong (RATE_FACTORS in limits.toml)."""
    for factor in LIMIT.RATE_FACTORS:
        yield {"factor": factor, "times": times(factor)}


def times(factor: float) -> str:
    """Write a factor in words, for instance "2 times", "1/4 of" or "0.752 of"."""
    if factor > 1:
        return f"{factor:.3g} times"
    return f"1/{1 / factor:g} of" if np.isclose(2 / factor % 1, 0) else f"{factor:.3g} of"


def neighbours(robot: Robot) -> Iterator[Item]:
    """Yield neighbouring joints, both revolute or both prismatic, whose drives may be coupled.

    Each pair is tried with both senses in which the motor of the second joint may turn with the
    first joint.
    """
    for k in range(1, robot.n):
        if robot.units[k - 1] == robot.units[k]:
            for share, sense, back in ((1.0, "plus", "minus"), (-1.0, "minus", "plus")):
                pair = {"i": k - 1, "k": k, "one": robot.labels[k - 1], "other": robot.labels[k]}
                yield {**pair, "share": share, "sense": sense, "back": back}


def known_torques(robot: Robot) -> Iterator[Item]:
    """Yield each joint for which the record contains a known torque (tau_known)."""
    if robot.samples is not None:
        for j in np.flatnonzero(robot.samples.tau_known.any(axis=0)):
            yield {"j": j, "joint": robot.labels[j]}


def geared(robot: Robot) -> Iterator[Item]:
    """Yield one empty mapping, for a mistake in the gear ratios; nothing if there are no gears.

    A ratio may be missing or applied twice.
    """
    yield from [{}] if not np.allclose(robot.R, np.eye(robot.n)) else []


def with_constants(robot: Robot) -> Iterator[Item]:
    """Yield one empty mapping, for a mistake in the torque constants of the motors.

    Nothing is yielded for a robot without torque constants. The torque constants may be missing, or applied to signals that are torques already.
    """
    yield from [{}] if not np.allclose(robot.constant, np.eye(robot.n)) else []


def with_offsets(robot: Robot) -> Iterator[Item]:
    """Yield one empty mapping, for an error of the position offsets; nothing for a robot without
    offsets.

    The offsets may be missing or wrong.
    """
    yield from [{}] if robot.offset.any() else []


def other_ratios(robot: Robot) -> Iterator[Item]:
    """Yield each pair of joints with different gear ratios: they may have been exchanged.

    Nothing is yielded unless positions or torques of the files are on the side of the motors.
    """
    ratio = np.diag(robot.R)
    for item in pairs(robot) if "motor" in robot.sides else ():
        i, k = item["i"], item["k"]
        if not np.isclose(abs(ratio[i]), abs(ratio[k])):
            times_i, times_k = float(ratio[k] / ratio[i]), float(ratio[i] / ratio[k])
            yield {**item, "factors": robot.one(i, times_i) * robot.one(k, times_k)}


def other_gravity(robot: Robot) -> Iterator[Item]:
    """Yield the gravity vector scaled to 9.81 m/s^2 if the robot file gives another magnitude."""
    size = float(np.linalg.norm(robot.gravity))
    if size and abs(size / 9.81 - 1) > LIMIT.GRAVITY_VARIES:
        yield {"size": f"{size:.4g}", "g": 9.81 / size * robot.gravity}


def axes(robot: Robot) -> Iterator[Item]:
    """Yield gravity vectors along +-x, +-y and +-z of frame 0, except that of the robot file."""
    size = float(np.linalg.norm(robot.gravity))
    for k, axis in enumerate("xyz"):
        for sign in (1.0, -1.0):
            g = np.where(np.arange(3) == k, sign * size, 0.0)
            if size and not np.allclose(g, robot.gravity):
                reversed_sense = np.allclose(g, -robot.gravity)
                yield {
                    "g": g,
                    "points": "has the wrong sign: it points" if reversed_sense else "points",
                    "axis": f"{'+' if sign > 0 else '-'}{axis}0",
                    "entry": ", ".join(f"{x:.4g}" for x in g),
                }


def alphas(robot: Robot) -> Iterator[Item]:
    """Yield each frame with its angle alpha changed by 90, -90 and 180 degrees."""
    for frame in robot.frames:
        for text, turn in TURNS.items():
            before = robot.free[f"free_alpha{frame}"]
            value = before + turn
            sign = " (its sign)" if np.isclose(np.cos(value), np.cos(before)) else ""
            item = {"frame": frame, "turn": text, "sign": sign, "value": value}
            yield {**item, "fits": _angle(value)}


def _angle(x: float) -> str:
    """Write an angle as a multiple of pi/2 if it is one, otherwise in rad."""
    quarter = x / (np.pi / 2)
    if not np.isclose(quarter, round(quarter)):
        return f"{x:.4g} rad"
    turn = (round(quarter) + 1) % 4 - 1
    return {0: "0", 1: "pi/2", -1: "-pi/2", 2: "pi"}[turn]


def lengths(robot: Robot) -> Iterator[Item]:
    """Yield each length d, r or b of the table of frames that is not zero."""
    for frame in robot.frames:
        for name in ("d", "r", "b"):
            length = robot.free.get(f"free_{name}{frame}", 0.0)
            if length:
                yield {"frame": frame, "entry": name, "length": length, "negative": f"{-length:g}"}


def odd_lengths(robot: Robot) -> Iterator[Item]:
    """Yield each very long or very short d, r or b of the frames, with the factors 1000, 1/1000."""
    for item in lengths(robot):
        if not LIMIT.MM_BELOW < abs(item["length"]) < LIMIT.MM_ABOVE:
            for text, factor in LENGTHS.items():
                yield {**item, "times": text, "factor": factor}


def exchanged_lengths(robot: Robot) -> Iterator[Item]:
    """Yield each frame of the table with different d and r, which may have been exchanged."""
    for frame in robot.frames:
        d, r = robot.free[f"free_d{frame}"], robot.free[f"free_r{frame}"]
        if d != r:
            yield {"frame": frame, "d": d, "r": r}


def odd_tables(robot: Robot) -> Iterator[Item]:
    """Yield all lengths of the table of frames times 1000, then times 1/1000 (mm for m, m for mm).

    Nothing is yielded unless the longest length is too long or too short for an arm.
    """
    given = {
        key: x for key, x in robot.free.items() if key[:6] in ("free_d", "free_r", "free_b") and x
    }
    longest = max(map(abs, given.values()), default=1.0)
    if robot.whole_table and not 10 * LIMIT.MM_BELOW < longest < LIMIT.MM_ABOVE:
        for text, factor in LENGTHS.items():
            yield {"times": text, "constants": {key: factor * x for key, x in given.items()}}


def conventions(robot: Robot) -> Iterator[Item]:
    """Yield the table of frames converted from the distal convention to Khalil's, and the reverse.

    To convert the table, alpha and d of each frame are copied from the frame before or after. The
    conversion corrects a table that is read in the wrong convention.
    """
    for step, mistake, remedy in (
        (
            -1,
            "of the classic (distal) convention and is read as Khalil's",
            "set convention: distal",
        ),
        (
            1,
            "Khalil's and is read as of the classic (distal) convention",
            "leave convention: distal out",
        ),
    ):
        moved = {
            f"free_{name}{frame}": robot.free.get(f"free_{name}{frame + step}", 0.0)
            for frame in robot.frames
            for name in ("alpha", "d")
        }
        if len(robot.frames) > 1 and robot.whole_table:
            yield {"mistake": mistake, "set": remedy, "constants": moved}


def entries(robot: Robot, names: str) -> Iterator[Item]:
    """Yield each entry of the table of frames that has one of the given names, such as alpha.

    Lengths are yielded only if they are not zero.
    """
    for key, value in robot.free.items():
        entry = ENTRY.fullmatch(key)
        if entry and entry[1] in names.split() and (value or entry[1] == "alpha"):
            yield {"key": key, "entry": entry[1], "frame": entry[2], "value": value}


def slow_joints(robot: Robot) -> Iterator[Item]:
    """Yield one possible error: the model lacks friction at low speed in some joints.

    Nothing is yielded if such friction is certain for no joint.
    """
    if robot.friction is not None:
        names = ", ".join(robot.labels[j] for j in np.flatnonzero(robot.friction))
        yield {"joints": names, "friction": robot.friction}


# Maps


def in_positions(robot: Robot, item: Item) -> Maps:
    """Make the correction of positions from a matrix E that reorders columns or changes signs."""
    return robot.positions(item["E"])


def in_torques(robot: Robot, item: Item) -> Maps:
    """Make the correction of torques from a matrix E that reorders columns or changes signs."""
    return robot.torques(item["E"])


def in_both(robot: Robot, item: Item) -> Maps:
    """Make the correction of positions and torques from a matrix E (other order or signs)."""
    return robot.positions(item["E"]) | robot.torques(item["E"])


def turned(*quantities: str) -> Callable[[Robot, Item], Mapping[str, Any]]:
    """Make a function that gives the setting `record.scale` that reverses the signs of columns.

    The sign is that of the joint of the item, or of all joints if the item has none.

    quantities : columns whose sign is reversed: q, tau.
    """

    def change(robot: Robot, item: Item) -> Mapping[str, Any]:
        signs = robot.one(item["j"], -1) if "j" in item else -np.ones(robot.n)
        return {f"{SCALE}{key}": [int(sign) for sign in signs] for key in quantities}

    return change


def in_unit(key: str) -> Callable[[Robot, Item], Mapping[str, Any]]:
    """Make a function that writes another unit of some columns as a setting of the study.

    key : q or tau.
    """

    def change(robot: Robot, item: Item) -> Mapping[str, Any]:
        units = robot.column_units.get(key, ())
        return changed_unit(key, units, item["chosen"], item["read"], item["unit"])

    return change


def changed_unit(
    key: str, units: Sequence[str], chosen: Array, read: Sequence[str], unit: str
) -> Mapping[str, Any]:
    """Write the unit of some columns as a setting of the study: one unit, or one for each joint.

    Parameters
    ----------
    key : str
        Key in record.units: q or tau.
    units : sequence of str
        Present unit of each joint; empty if it is not known.
    chosen : ndarray of bool, shape (n,)
        The joints whose unit changes.
    read : sequence of str
        Names of the unit in which their columns are read by mistake. If the study gives these
        columns another unit, the setting is left out.
    unit : str
        Unit to set.
    """
    given = {own for own, changes in zip(units, chosen, strict=False) if changes}
    if not given or not given <= {*read}:
        return {}
    new = [unit if changes else own for own, changes in zip(units, chosen, strict=True)]
    return {f"record.units.{key}": new if len({*new}) > 1 else unit}


def transmitted(robot: Robot, *, positions: bool, torques: bool, to_joints: bool) -> Maps:
    """Make the correction that converts positions, torques or both from motor to joint, or back."""
    inverse = np.linalg.inv(robot.R)
    P, p, T = (
        (inverse, robot.offset, robot.R.T)
        if to_joints
        else (robot.R, -robot.R @ robot.offset, inverse.T)
    )
    return ({"P": P, "p": p} if positions else {}) | ({"T": T} if torques else {})


def coupled(robot: Robot, item: Item, *, positions: bool, torques: bool) -> Maps:
    """Make the correction for a missing coupling of the drives of two joints i and k.

    The corrected signals are q_k' = q_k + share q_i and tau_i' = tau_i - share tau_k, with share 1
    or -1.
    """
    P, T = np.eye(robot.n), np.eye(robot.n)
    P[item["k"], item["i"]] = item["share"]
    T[item["i"], item["k"]] = -item["share"]
    return ({"P": P} if positions else {}) | ({"T": T} if torques else {})


def constants_as_currents(robot: Robot) -> Array:
    """Compute the matrix that removes torque constants which were applied by mistake, shape (n, n).

    The matrix multiplies the torques of the joints.
    """
    return np.asarray(robot.R.T @ np.linalg.inv(robot.constant) @ np.linalg.inv(robot.R).T)


def exchanged_ratios(robot: Robot, item: Item) -> Maps:
    """Make the correction of motor positions and torques for exchanged gear ratios of two joints.

    Only torques or positions on the side of the motors change.
    """
    factors = item["factors"]
    maps = {"T": np.diag(factors)} if robot.sides[1] == "motor" else {}
    return maps | ({"P": np.diag(1 / factors)} if robot.sides[0] == "motor" else {})


def gravity(item: Item) -> Maps:
    """Make the correction that sets gravity in frame 0 to the vector item["g"], m/s^2."""
    return {"constants": dict(zip(GRAVITY, map(float, item["g"]), strict=True))}


def chosen(item: Item) -> Array:
    """Make the diagonal matrix that multiplies some joint signals by the factor of another unit.

    Its elements are the unit-conversion factor for these joints, and 1 for the others.
    """
    return np.diag(np.where(item["chosen"], item["factor"], 1.0))


Q, TAU, Q_AND_TAU = (
    f"name the columns in the order of the joints (record.columns.{name})"
    for name in ("q", "tau", "q and tau")
)
COUPLING = (
    "give the coupling of joints {one} and {other} as an off-diagonal element of drives.ratio"
)
MISSING = "the coupling of joints {one} and {other} is missing in the"

CAUSES = (
    Row(
        "sign",
        senses,
        "the torque of joint {joint} has the wrong sign",
        "change the sign of the torque of joint {joint}: of its ratio, torque constant or column",
        in_torques,
        change=turned("tau"),
    ),
    Row(
        "sign",
        senses,
        "the position of joint {joint} has the wrong sign",
        "change the sign of the position of joint {joint}, or turn its axis in the robot file",
        in_positions,
        change=turned("q"),
    ),
    Row(
        "sign",
        senses,
        "joint {joint} counts in the other sense, position and torque",
        "change the sign of the ratio of joint {joint}, or alpha and theta of its frame",
        in_both,
        change=turned("q", "tau"),
    ),
    Row(
        "sign",
        several_joints,
        "all torques have the wrong sign",
        "change the sign of all torques",
        lambda robot, item: {"T": -np.eye(robot.n)},
        change=turned("tau"),
    ),
    Row(
        "sign",
        several_joints,
        "all positions have the wrong sign",
        "change the sign of all positions",
        lambda robot, item: {"P": -np.eye(robot.n)},
        change=turned("q"),
    ),
    Row(
        "exchange",
        pairs,
        "the position columns of joints {one} and {other} are exchanged",
        Q,
        in_positions,
    ),
    Row(
        "exchange",
        pairs,
        "the torque columns of joints {one} and {other} are exchanged",
        TAU,
        in_torques,
    ),
    Row(
        "exchange",
        pairs,
        "the columns of positions and torques of joints {one} and {other} are exchanged",
        Q_AND_TAU,
        in_both,
    ),
    Row("order", orders, "the position columns {moved}", Q, in_positions),
    Row("order", orders, "the torque columns {moved}", TAU, in_torques),
    Row("order", orders, "the columns of positions and torques {moved}", Q_AND_TAU, in_both),
    Row(
        "unit",
        torque_units,
        "torques: {unit} are read as N*m",
        "set record.units.tau: {unit}",
        lambda robot, item: {"T": chosen(item)},
        "a common factor of all torques",
        change=in_unit("tau"),
    ),
    Row(
        "unit",
        torque_unit_of_joints,
        "torque of joint {joint}: {unit} are read as N*m",
        "set the unit of joint {joint} in record.units.tau: {unit}",
        lambda robot, item: robot.torques(chosen(item)),
        "a factor of the torque of joint {joint}",
        change=in_unit("tau"),
    ),
    Row(
        "unit",
        position_units,
        "positions: {mistake}",
        "set record.units.q: {unit}",
        lambda robot, item: robot.positions(chosen(item)),
        change=in_unit("q"),
    ),
    Row(
        "unit",
        position_unit_of_joints,
        "position of joint {joint}: {mistake}",
        "set the unit of joint {joint} in record.units.q: {unit}",
        lambda robot, item: robot.positions(chosen(item)),
        change=in_unit("q"),
    ),
    Row(
        "rate",
        rates,
        "the sampling rate is {times} the stated one",
        "correct record.rate, or the unit of the time column (record.units.t)",
        lambda robot, item: {"rate": item["factor"]},
        "the sampling rate",
    ),
    Row(
        "coupling",
        neighbours,
        f"{MISSING} positions and torques: position {{other}} must be replaced by position "
        "{other} {sense} position {one}",
        COUPLING,
        lambda robot, item: coupled(robot, item, positions=True, torques=True),
    ),
    Row(
        "coupling",
        neighbours,
        f"{MISSING} positions: position {{other}} must be replaced by position {{other}} "
        "{sense} position {one}",
        COUPLING,
        lambda robot, item: coupled(robot, item, positions=True, torques=False),
    ),
    Row(
        "coupling",
        neighbours,
        f"{MISSING} torques: torque {{one}} must be replaced by torque {{one}} "
        "{back} torque {other}",
        COUPLING,
        lambda robot, item: coupled(robot, item, positions=False, torques=True),
    ),
    Row(
        "zero",
        turns,
        "theta of joint {joint} is wrong by {turn}",
        "check theta of the frame of joint {joint} and its zero (drives.offset): "
        "{turn} are missing",
        lambda robot, item: {"p": robot.one(item["j"], item["angle"], 0.0)},
        "the zero of joint {joint}",
    ),
    Row(
        "known",
        known_torques,
        "the known torque of joint {joint} has the wrong sign",
        "change the sign of the known torque of joint {joint} (record.columns.tau_known)",
        lambda robot, item: {"known_factor": robot.one(item["j"], -1)},
    ),
    Row(
        "known",
        known_torques,
        "the known torque of joint {joint} is not part of the measured torque",
        "do not subtract the known torque of joint {joint} (record.columns.tau_known)",
        lambda robot, item: {"known_factor": robot.one(item["j"], 0)},
    ),
    Row(
        "side",
        geared,
        "torques of the motors are taken as torques of the joints: the gear ratio is missing",
        "set record.torque_side: motor",
        lambda robot, item: transmitted(robot, positions=False, torques=True, to_joints=True),
        change=lambda robot, item: {"record.torque_side": "motor"},
    ),
    Row(
        "side",
        geared,
        "torques of the joints are taken as torques of the motors: the gear ratio is applied twice",
        "set record.torque_side: joint",
        lambda robot, item: transmitted(robot, positions=False, torques=True, to_joints=False),
        change=lambda robot, item: {"record.torque_side": "joint"},
    ),
    Row(
        "side",
        geared,
        "positions of the motors are taken as positions of the joints",
        "set record.side: motor",
        lambda robot, item: transmitted(robot, positions=True, torques=False, to_joints=True),
        change=lambda robot, item: {"record.side": "motor", "record.torque_side": "joint"},
    ),
    Row(
        "side",
        geared,
        "positions of the joints are taken as positions of the motors",
        "set record.side: joint, torque_side: motor",
        lambda robot, item: transmitted(robot, positions=True, torques=False, to_joints=False),
        change=lambda robot, item: {"record.side": "joint", "record.torque_side": "motor"},
    ),
    Row(
        "side",
        geared,
        "positions and torques of the motors are taken as those of the joints",
        "set record.side: motor",
        lambda robot, item: transmitted(robot, positions=True, torques=True, to_joints=True),
        change=lambda robot, item: {"record.side": "motor", "record.torque_side": None},
    ),
    Row(
        "side",
        geared,
        "positions and torques of the joints are taken as those of the motors",
        "set record.side: joint",
        lambda robot, item: transmitted(robot, positions=True, torques=True, to_joints=False),
        change=lambda robot, item: {"record.side": "joint", "record.torque_side": None},
    ),
    Row(
        "unit",
        with_constants,
        "torques are taken as currents: torque constants are applied to them",
        "look at record.units.tau: A of currents, N*m of torques",
        lambda robot, item: {"T": constants_as_currents(robot)},
    ),
    Row(
        "unit",
        with_constants,
        "currents are taken as torques: torque constants are missing",
        "look at record.units.tau: A of currents, N*m of torques",
        lambda robot, item: {"T": np.linalg.inv(constants_as_currents(robot))},
    ),
    Row(
        "zero",
        with_offsets,
        "the offsets of the drives are used twice or with the wrong sign",
        "check the sign of drives.offset",
        lambda robot, item: {"p": -2 * robot.offset},
    ),
    Row(
        "zero",
        with_offsets,
        "the offsets of the drives are missing",
        "set record.side: motor, or add drives.offset to the positions",
        lambda robot, item: {"p": robot.offset},
        change=lambda robot, item: {"record.side": "motor", "record.torque_side": robot.sides[1]},
    ),
    Row(
        "zero",
        with_offsets,
        "the offsets of the drives are added to positions that already contain them",
        "remove drives.offset from the robot file",
        lambda robot, item: {"p": -robot.offset},
    ),
    Row(
        "exchange",
        other_ratios,
        "the ratios of joints {one} and {other} are exchanged",
        "exchange drives.ratio of joints {one} and {other}",
        exchanged_ratios,
    ),
    Row(
        "gravity",
        other_gravity,
        "gravity is {size} m/s^2 rather than 9.81",
        "give gravity in m/s^2",
        lambda robot, item: gravity(item),
    ),
    Row(
        "gravity",
        axes,
        "gravity {points} along {axis}",
        "set gravity: [{entry}], or turn frame 0",
        lambda robot, item: gravity(item),
    ),
    Row(
        "angle",
        alphas,
        "alpha of frame {frame} is wrong by {turn}{sign}",
        "look at alpha of frame {frame}: {fits} fits",
        lambda robot, item: {"constants": {f"free_alpha{item['frame']}": item["value"]}},
        "alpha of frame {frame}",
    ),
    Row(
        "length",
        lengths,
        "{entry} of frame {frame} has the wrong sign",
        "look at {entry} of frame {frame}: {negative} fits",
        lambda robot, item: {
            "constants": {f"free_{item['entry']}{item['frame']}": -item["length"]}
        },
        "{entry} of frame {frame}",
    ),
    Row(
        "length",
        odd_lengths,
        "{entry} of frame {frame} must be multiplied by {times}: mm and m are confused",
        "give {entry} of frame {frame} in m",
        lambda robot, item: {
            "constants": {f"free_{item['entry']}{item['frame']}": item["factor"] * item["length"]}
        },
        "{entry} of frame {frame}",
    ),
    Row(
        "length",
        exchanged_lengths,
        "d and r of frame {frame} are exchanged",
        "exchange d and r of frame {frame}",
        lambda robot, item: {
            "constants": {f"free_d{item['frame']}": item["r"], f"free_r{item['frame']}": item["d"]}
        },
    ),
    Row(
        "length",
        odd_tables,
        "all lengths must be multiplied by {times}: mm and m are confused",
        "give lengths in m",
        lambda robot, item: {"constants": item["constants"]},
    ),
    Row(
        "table",
        conventions,
        "the table is {mistake}",
        "{set}",
        lambda robot, item: {"constants": item["constants"]},
    ),
)


def factor_words(robot: Robot, item: Item, xi: float) -> Item:
    """Write a fitted factor exp(xi) of a signal in words, and a mistake that may explain it."""
    near = [text for value, text in GUESSES.items() if abs(abs(xi) - np.log(value)) < 0.05]
    guess = near[0] if near else "all three are right if this factor is 1"
    return {"factor": f"{np.exp(xi):.3g}", "times": times(float(np.exp(xi))), "guess": guess}


def size_of_torque(robot: Robot, j: int) -> float:
    """Compute the root mean square torque of joint j, N m or N."""
    assert robot.samples is not None
    return float(np.sqrt((robot.samples.tau[:, j] ** 2).mean()))


def offset_words(robot: Robot, item: Item, xi: float) -> Item:
    """Write the fitted constant torque of a joint: xi times its root mean square torque."""
    j = item["j"]
    return {"offset": f"{xi * size_of_torque(robot, j):.3g} {robot.torque_units[j]}"}


def angle_words(robot: Robot, item: Item, xi: float) -> Item:
    """Write a fitted angle error xi in degrees, and the corrected angle in rad."""
    return {"degrees": f"{np.degrees(xi):.3g}", "fits": f"{item.get('value', 0.0) + xi:.3f}"}


def length_words(robot: Robot, item: Item, xi: float) -> Item:
    """Write the corrected length, exp(xi) times the given length, and the given length."""
    return {"fits": f"{item['value'] * np.exp(xi):.4g}", "given": f"{item['value']:.4g}"}


NUMBERS = (
    Row(
        "rate",
        study,
        "the sampling rate is {times} the stated one",
        "correct record.rate, or the unit of the time column (record.units.t)",
        lambda robot, item, xi: {"rate": float(np.exp(xi))},
        "the sampling rate",
        1.0,
        factor_words,
    ),
    Row(
        "factor",
        study,
        "all torques must be multiplied by {factor}",
        "look at unit, torque constants and side of the torques ({guess})",
        lambda robot, item, xi: {"T": np.exp(xi) * np.eye(robot.n)},
        "a common factor of all torques",
        2.6,
        factor_words,
    ),
    Row(
        "scale",
        joints,
        "the position of joint {joint} must be multiplied by {factor}",
        "check the counts per turn of the encoder of joint {joint}, its ratio (drives.ratio) and "
        "its unit (record.units.q)",
        lambda robot, item, xi: robot.positions(np.diag(robot.one(item["j"], np.exp(xi)))),
        "the scale of the position of joint {joint}",
        1.2,
        factor_words,
    ),
    Row(
        "ratio",
        joints,
        "the gear ratio of joint {joint} is not the stated one: its position must be multiplied "
        "by {factor}, its torque divided by it",
        "check the gear ratio of joint {joint} (drives.ratio)",
        lambda robot, item, xi: (
            robot.positions(np.diag(robot.one(item["j"], np.exp(xi))))
            | robot.torques(np.diag(robot.one(item["j"], np.exp(-xi))))
        ),
        "the gear ratio of joint {joint}",
        1.2,
        factor_words,
    ),
    Row(
        "offset",
        joints,
        "the torque of joint {joint} has a constant error of {offset}",
        "check the zero of the torque of joint {joint}, or give this constant as a "
        "known torque (record.columns.tau_known)",
        lambda robot, item, xi: {
            "unmodelled": np.outer(
                robot.one(item["j"], xi * size_of_torque(robot, item["j"]), 0.0), (1.0, 0.0)
            )
        },
        "a constant torque of joint {joint}",
        2.0,
        offset_words,
    ),
    Row(
        "factor",
        joints_of_several,
        "the torque of joint {joint} must be multiplied by {factor}",
        "look at ratio, torque constant and unit of joint {joint} ({guess})",
        lambda robot, item, xi: robot.torques(np.diag(robot.one(item["j"], np.exp(xi)))),
        "a factor of the torque of joint {joint}",
        2.6,
        factor_words,
    ),
    Row(
        "zero",
        turning_joints,
        "the zero of joint {joint} is off by {degrees} degrees",
        "check theta of the frame of joint {joint}, drives.offset and the calibration "
        "of its encoder",
        lambda robot, item, xi: {"p": robot.one(item["j"], xi, 0.0)},
        "the zero of joint {joint}",
        1.2,
        angle_words,
    ),
    Row(
        "friction",
        slow_joints,
        "the friction of joint {joints} at low speed is not that of the model; elements of kind "
        "stribeck describe such friction",
        "add such columns",
        lambda robot, item, xi: {"unmodelled": xi * np.outer(item["friction"], (0.0, 1.0))},
        "the friction of joint {joints} at low speed",
        2.0,
    ),
    Row(
        "angle",
        lambda robot: entries(robot, "alpha"),
        "alpha of frame {frame} is off by {degrees} degrees",
        "look at alpha of frame {frame}: {fits} rad fits",
        lambda robot, item, xi: {"constants": {item["key"]: item["value"] + xi}},
        "alpha of frame {frame}",
        1.2,
        angle_words,
    ),
    Row(
        "length",
        lambda robot: entries(robot, "d r b"),
        "{entry} of frame {frame} is {fits} m rather than {given} m",
        "measure {entry} of frame {frame}: {fits} m fits",
        lambda robot, item, xi: {"constants": {item["key"]: item["value"] * float(np.exp(xi))}},
        "{entry} of frame {frame}",
        1.0,
        length_words,
    ),
)


def causes(robot: Robot) -> list[Cause]:
    """List the possible errors (causes) of the study and of the table of frames for a given robot.

    The list has the errors of the table `CAUSES`, which have no unknown number.
    """
    return [row.cause(robot, item) for row in CAUSES for item in row.of(robot)]
