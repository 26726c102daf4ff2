"""What may be wrong with a study, a robot file or a log, one thing at a time, as maps of the
samples and entries of the table of frames.

    q' = P q + p,  qd' = f P qd,  qdd' = f^2 P qdd,
    tau' = T tau - s known - (a q + b sin q + c cos q + d),
    free_... = another value

What is wrong since an instant, or grows with time, is the share w(t) of the change:
P(t) = I + w(t) (P - I), and so on.

A robot of n joints has some 10 n^2 of them. Each is tried at the cost of the regressor
(`runtime.plausible.trials`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np

from runtime.limits import LIMIT
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, drives_of, joint_labels, joint_units
from runtime.plausible.samples import Samples
from runtime.settings.units import torque_unit

Array = np.ndarray

TURNS = {"90 degrees": np.pi / 2, "-90 degrees": -np.pi / 2, "180 degrees": np.pi}
FACTORS = {"1000": 1e3, "1/1000": 1e-3}
DEGREE = np.pi / 180
TORQUE_UNITS = ("kN*m", "N*mm", "N*cm", "kgf*cm", "lbf*inch", "ozf*inch")


@dataclass(frozen=True, eq=False)
class Alternative:
    """One thing changed.

    Attributes
    ----------
    cause : str
        What would be wrong, as an engineer says it.
    remedy : str
        What to change.
    kind : str
        Family: sign, exchange, order, unit, side, rate, angle, zero, gravity, length, table,
        coupling.
    P, p : ndarray, shape (n, n) and (n,)
        Map of the positions.
    T : ndarray, shape (n, n)
        Map of the torques.
    rate : float
        Factor on the sampling rate.
    known_factor : float or ndarray, shape (n,)
        Factor s on the known torques.
    unmodelled : ndarray, shape (n, 5), or 0
        Factors of `unmodelled_torques` for each joint, N m or N.
    share : ndarray, shape (K,), or 1
        w at every sample.
    constants : mapping of str to float
        Entries of the table of frames, SI.
    of : str
        The number that is changed, where other amounts of it are alternatives too.
    """

    cause: str
    remedy: str
    kind: str
    P: Array
    p: Array
    T: Array
    rate: float = 1.0
    known_factor: Array | float = 1.0
    unmodelled: Array | float = 0.0
    share: Array | float = 1.0
    constants: Mapping[str, float] = field(default_factory=dict)
    of: str = ""

    @property
    def subject(self) -> str:
        """What it changes, whatever the amount; the cause where it has no amount."""
        return self.of or self.cause

    def states(self, samples: Samples) -> tuple[Array, Array, Array]:
        """q, qd, qdd, shape (K, n) each."""
        w = np.reshape(self.share, (-1, 1))
        q, qd, qdd = samples.q, samples.qd, samples.qdd
        return (
            q + w * (q @ self.P.T + self.p - q),
            qd + w * (self.rate * qd @ self.P.T - qd),
            qdd + w * (self.rate**2 * qdd @ self.P.T - qdd),
        )

    def back(self, F: Array) -> Array:
        """F T^-1, shape (n, n), or (K, n, n) where T changes with time."""
        if np.ndim(self.share) == 0:
            return np.asarray(F @ np.linalg.inv(self.T))
        one, w = np.eye(len(F)), np.reshape(self.share, (-1, 1, 1))
        return np.asarray(F @ np.linalg.inv(one + w * (self.T - one)))

    def torque(self, samples: Samples) -> Array:
        """Torques left for the model, shape (K, n)."""
        return np.asarray(samples.tau @ self.T.T - self.subtracted(samples))

    def subtracted(self, samples: Samples) -> Array:
        """Torques known beside the model, shape (K, n)."""
        known = np.asarray(self.known_factor * samples.tau_known)
        if np.ndim(self.unmodelled) == 0:  # of most alternatives
            return known
        more = (self.unmodelled * unmodelled_torques(samples)).sum(axis=2)
        return np.asarray(known + more * np.reshape(self.share, (-1, 1)))

    @property
    def on_data(self) -> bool:
        """Whether the table of frames stays."""
        return not self.constants


def unmodelled_torques(samples: Samples) -> Array:
    """What the model may lack, shape (K, n, 5): q, sin q and cos q of every joint, as springs and
    counterbalances, 1, and sign(qd) exp(-(qd/v)^2), dry friction at low speed, v the share
    LIMIT.SLOW of the largest speed.
    """
    q, qd = samples.q, samples.qd
    slow = np.exp(-((qd / np.maximum(LIMIT.SLOW * np.abs(qd).max(axis=0), 1e-12)) ** 2))
    return np.stack([q, np.sin(q), np.cos(q), np.ones_like(q), np.sign(qd) * slow], axis=2)


def unchanged(n: int, **changed: Any) -> Alternative:
    """The study of n joints as it is, but for what is given."""
    return Alternative(
        **{"cause": "", "remedy": "", "kind": "", "P": np.eye(n), "p": np.zeros(n), "T": np.eye(n)}
        | changed
    )


def alternatives(
    model: GeneratedModel,
    variants: GeneratedModel | None = None,
    sides: Sequence[str] = ("joint", "joint"),
    known: Sequence[int] = (),
) -> list[Alternative]:
    """All that can be tried on a robot.

    Parameters
    ----------
    model : GeneratedModel
    variants : GeneratedModel, optional
        The module of `symgen.variants`, whose table of frames is free; without it, the table stays,
        constants of the model aside.
    sides : (str, str)
        Sides of positions and torques in the files: motor or joint.
    known : sequence of int
        Joints with known torques.
    """
    make = Maker(model, sides)
    every = [
        *signs(make),
        *exchanges(make),
        *units(make),
        *rates(make),
        *couplings(make),
        *zeros(make),
        *known_torques(make, known),
    ]
    if (drives := drives_of(model)) is not None:
        every += transmissions(make, drives, sides)
    if variants is not None:
        every += [*gravity(make, variants.CONSTANTS), *table(make, variants.CONSTANTS)]
    return every


class Maker:
    """Alternatives of a robot of n joints: what is not given stays as it is. Maps of columns act on
    the side that the files have.
    """

    def __init__(self, model: GeneratedModel, sides: Sequence[str]) -> None:
        self.n = n = len(model.JOINTS)
        self.joints, self.one = joint_labels(model), np.eye(n)
        self.units, self.links = joint_units(model), getattr(model, "LINKS", ())
        drives = drives_of(model)
        self.R, self.tau_of_motors, self.offset = self.one, self.one, np.zeros(n)
        if drives is not None and sides[0] == "motor":
            self.R, self.offset = drives.ratio, drives.offset
        if drives is not None and sides[1] == "motor":
            self.tau_of_motors = drives.ratio.T

    def __call__(self, kind: str, cause: str, remedy: str, **changed: Any) -> Alternative:
        return unchanged(self.n, kind=kind, cause=cause, remedy=remedy, **changed)

    def positions(self, E: Array) -> dict[str, Array]:
        """The map E of the columns of positions: q' = R^-1 E R (q - offset) + offset on the side of
        motors.
        """
        P = np.linalg.inv(self.R) @ E @ self.R
        return {"P": P, "p": self.offset - P @ self.offset}

    def torques(self, E: Array) -> dict[str, Array]:
        """The map E of the columns of torques."""
        return {"T": self.tau_of_motors @ E @ np.linalg.inv(self.tau_of_motors)}


def signs(make: Maker) -> Iterator[Alternative]:
    """Positions, torques, or both of one joint with the other sign; of all joints."""
    for j, joint in enumerate(make.joints):
        S = np.diag(np.where(np.arange(make.n) == j, -1.0, 1.0))
        torque, position = make.torques(S), make.positions(S)
        yield make(
            "sign",
            f"the torque of joint {joint} has the wrong sign",
            f"turn the sign of the torque of joint {joint}: ratio, torque constant or column",
            **torque,
        )
        yield make(
            "sign",
            f"the position of joint {joint} has the wrong sign",
            f"turn the sign of the position of joint {joint}, or its axis in the robot file",
            **position,
        )
        yield make(
            "sign",
            f"joint {joint} counts in the other sense, position and torque",
            f"turn the sign of the ratio of joint {joint}, or alpha and theta of its frame",
            **torque,
            **position,
        )
    if make.n > 1:
        yield make(
            "sign", "all torques have the wrong sign", "turn the sign of the torques", T=-make.one
        )
        yield make(
            "sign",
            "all positions have the wrong sign",
            "turn the sign of the positions",
            P=-make.one,
        )


def exchanges(make: Maker) -> Iterator[Alternative]:
    """Columns of two joints exchanged, and all of them reversed or moved on by one."""
    orders = []
    for i, k in combinations(range(make.n), 2):
        order = list(range(make.n))
        order[i], order[k] = k, i
        orders.append(
            (order, "exchange", f"of joints {make.joints[i]} and {make.joints[k]} are exchanged")
        )
    if make.n > 2:
        orders.append((list(range(make.n))[::-1], "order", "come in reverse order"))
        orders += [
            (list(np.roll(np.arange(make.n), by)), "order", f"are moved by one joint {way}")
            for by, way in ((1, "back"), (-1, "on"))
        ]
    for order, kind, text in orders:
        torque, position = make.torques(make.one[order]), make.positions(make.one[order])
        remedy = "name the columns in the order of the joints (record.columns.{})"
        yield make(kind, f"the position columns {text}", remedy.format("q"), **position)
        yield make(kind, f"the torque columns {text}", remedy.format("tau"), **torque)
        yield make(
            kind,
            f"the columns of positions and torques {text}",
            remedy.format("q and tau"),
            **position,
            **torque,
        )


def units(make: Maker) -> Iterator[Alternative]:
    """Degrees for rad and rad for degrees, mm for m; turns for rad; other torques for N m."""
    turning = np.array([unit == "rad" for unit in make.units])
    yield from (
        make(
            "unit",
            f"torques: {unit} are read as N*m",
            f"set record.units.tau: {unit}",
            T=torque_unit(unit)[1] * make.one,
            of="a common factor of all torques",
        )
        for unit in (TORQUE_UNITS if turning.all() else ())
    )
    for unit, factor, which, of in (
        ("deg", DEGREE, turning, "degrees are read as rad"),
        ("rad", 1 / DEGREE, turning, "rad are read as degrees"),
        ("rev", 2 * np.pi, turning, "turns are read as rad"),
        ("mm", 1e-3, ~turning, "mm are read as m"),
        ("m", 1e3, ~turning, "m are read as mm"),
    ):
        if which.any():
            yield make(
                "unit",
                f"positions: {of}",
                f"set record.units.q: {unit}",
                P=np.diag(np.where(which, factor, 1.0)),
            )
            if which.sum() > 1:
                for j in np.flatnonzero(which):
                    P = np.diag(np.where(np.arange(make.n) == j, factor, 1.0))
                    yield make(
                        "unit",
                        f"position of joint {make.joints[j]}: {of}",
                        f"set the unit of joint {make.joints[j]} in record.units.q: {unit}",
                        P=P,
                    )


def rates(make: Maker) -> Iterator[Alternative]:
    """Another sampling rate, by the factors of LIMIT.RATE_FACTORS."""
    yield from (
        make(
            "rate",
            f"the sampling rate is {times(factor)} the stated one",
            "correct record.rate, or the unit of the time column (record.units.t)",
            rate=factor,
            of="the sampling rate",
        )
        for factor in LIMIT.RATE_FACTORS
    )


def times(factor: float) -> str:
    """A factor in words: 2 times, 1/4 of, 0.752 of."""
    if factor > 1:
        return f"{factor:.3g} times"
    plain = np.isclose(2 / factor % 1, 0)
    return f"1/{1 / factor:g} of" if plain else f"{factor:.3g} of"


def couplings(make: Maker) -> Iterator[Alternative]:
    """The motor of a joint also turns with the one before, in either sense: positions and torques,
    or one of them.
    """
    yield from (
        make("coupling", **coupled(make.joints, i, k, columns, share))
        for i, k in neighbours(make.units)
        for columns in (("positions and torques", "positions", "torques") if i < k else ())
        for share in (1.0, -1.0)
    )


def neighbours(units: Sequence[str]) -> list[tuple[int, int]]:
    """Joints next to each other, of one unit, in both orders."""
    pairs = [pair for k in range(1, len(units)) for pair in ((k - 1, k), (k, k - 1))]
    return [(i, k) for i, k in pairs if units[i] == units[k]]


def coupled(joints: Sequence[str], i: int, k: int, columns: str, share: float) -> dict[str, Any]:
    """Cause, remedy and maps of q_k' = q_k + share q_i and tau_i' = tau_i - share tau_k, in some
    columns.
    """
    P, T = np.eye(len(joints)), np.eye(len(joints))
    P[k, i], T[i, k] = share, -share
    of = f"the coupling of joints {joints[min(i, k)]} and {joints[max(i, k)]}"
    signal, a, b, x = ("position", k, i, share) if "pos" in columns else ("torque", i, k, -share)
    size = "" if abs(x) == 1 else f"{abs(x):.3g} times "
    where = f"{signal} {joints[a]} is to be taken {'plus' if x > 0 else 'minus'} {size}"
    return {
        "cause": f"{of} is missing in the {columns}: {where}{signal} {joints[b]}",
        "remedy": f"give {of} as an off-diagonal element of drives.ratio",
        **({"P": P} if "positions" in columns else {}),
        **({"T": T} if "torques" in columns else {}),
    }


def zeros(make: Maker) -> Iterator[Alternative]:
    """The zero of a revolute joint turned by 90 or 180 degrees: its theta, or the offset of its
    drive.
    """
    yield from (
        make(
            "zero",
            f"theta of joint {joint} is wrong by {text}",
            f"look at theta of the frame of joint {joint} and at its zero (drives.offset): {text} "
            "are missing",
            p=np.where(np.arange(make.n) == j, angle, 0.0),
            of=f"the zero of joint {joint}",
        )
        for j, joint in enumerate(make.joints)
        if make.units[j] == "rad"
        for text, angle in TURNS.items()
    )


def known_torques(make: Maker, joints: Sequence[int]) -> Iterator[Alternative]:
    """Known torques of one joint with the other sign, or in the measured ones no more."""
    yield from (
        make(
            "known",
            f"the known torque of joint {make.joints[j]} {text}",
            f"{remedy} the known torque of joint {make.joints[j]} (record.columns.tau_known)",
            known_factor=np.where(np.arange(make.n) == j, factor, 1.0),
        )
        for j in joints
        for factor, text, remedy in (
            (-1.0, "has the wrong sign", "turn the sign of"),
            (0.0, "is not in the measured one", "do not subtract"),
        )
    )


def transmissions(make: Maker, drives: Drives, sides: Sequence[str]) -> Iterator[Alternative]:
    """Gears and torque constants forgotten, used twice, or exchanged between joints."""
    R, shift, constant, n = drives.ratio, drives.offset, np.diag(drives.torque_constant), make.n
    inverse = np.linalg.inv(R)
    both = {"P": inverse, "p": shift, "T": R.T}, {"P": R, "p": -R @ shift, "T": inverse.T}
    motors, joints = "set record.side: motor", "set record.side: joint"
    if not np.allclose(R, np.eye(n)):
        yield from (
            make("side", cause, remedy, **maps)
            for cause, remedy, maps in (
                (
                    (
                        "torques of the motors are taken as torques of the joints: the gear ratio "
                        "is missing"
                    ),
                    "set record.torque_side: motor",
                    {"T": R.T},
                ),
                (
                    (
                        "torques of the joints are taken as torques of the motors: the gear ratio "
                        "is applied twice"
                    ),
                    "set record.torque_side: joint",
                    {"T": inverse.T},
                ),
                (
                    "positions of the motors are taken as positions of the joints",
                    motors,
                    {"P": inverse, "p": shift},
                ),
                (
                    "positions of the joints are taken as positions of the motors",
                    f"{joints}, torque_side: motor",
                    {"P": R, "p": -R @ shift},
                ),
                (
                    "positions and torques of the motors are taken as those of the joints",
                    motors,
                    both[0],
                ),
                (
                    "positions and torques of the joints are taken as those of the motors",
                    joints,
                    both[1],
                ),
            )
        )
    if not np.allclose(constant, np.eye(n)):
        remedy = "look at record.units.tau: A of currents, N*m of torques"
        T = R.T @ np.linalg.inv(constant) @ inverse.T
        yield make(
            "unit",
            "torques are taken as currents: torque constants are applied to them",
            remedy,
            T=T,
        )
        yield make(
            "unit",
            "currents are taken as torques: torque constants are missing",
            remedy,
            T=np.linalg.inv(T),
        )
    if shift.any():
        yield from (
            make("zero", cause, remedy, p=p)
            for cause, remedy, p in (
                (
                    "the offsets of the drives are used twice or with the wrong sign",
                    "look at the sign of drives.offset",
                    -2 * shift,
                ),
                (
                    "the offsets of the drives are missing",
                    "set record.side: motor, or add drives.offset to the positions",
                    shift,
                ),
                (
                    "the offsets of the drives are added to positions that have them",
                    "leave drives.offset out",
                    -shift,
                ),
            )
        )
    own = np.diag(R).copy()
    for i, k in combinations(range(n), 2):
        if "motor" not in sides or np.isclose(abs(own[i]), abs(own[k])):
            continue
        f = np.ones(n)
        f[i], f[k] = own[k] / own[i], own[i] / own[k]
        maps = {"T": np.diag(f)} if sides[1] == "motor" else {}
        maps |= {"P": np.diag(1 / f)} if sides[0] == "motor" else {}
        yield make(
            "exchange",
            f"the ratios of joints {make.joints[i]} and {make.joints[k]} are exchanged",
            f"exchange drives.ratio of joints {make.joints[i]} and {make.joints[k]}",
            **maps,
        )


def gravity(make: Maker, free: Mapping[str, float]) -> Iterator[Alternative]:
    """Gravity along the other axes of frame 0, in either sense; of its size on earth."""
    free_g = ("free_gx", "free_gy", "free_gz")
    given = np.array([free[key] for key in free_g])
    size = float(np.linalg.norm(given))
    if size and abs(size / 9.81 - 1) > LIMIT.GRAVITY_VARIES:
        yield make(
            "gravity",
            f"gravity is {size:.4g} m/s^2 rather than 9.81",
            "give gravity in m/s^2",
            constants=dict(zip(free_g, (9.81 / size * given).tolist(), strict=True)),
        )
    for k, axis in enumerate("xyz"):
        for sign in (1.0, -1.0):
            g = np.where(np.arange(3) == k, sign * size, 0.0)
            if size and not np.allclose(g, given):
                text = (
                    "gravity has the wrong sign: it points along "
                    if np.allclose(g, -given)
                    else "gravity points along "
                )
                yield make(
                    "gravity",
                    f"{text}{'+' if sign > 0 else '-'}{axis}0",
                    f"set gravity: [{', '.join(f'{x:.4g}' for x in g)}], or turn frame 0",
                    constants=dict(zip(free_g, map(float, g), strict=True)),
                )


def table(make: Maker, free: Mapping[str, float]) -> Iterator[Alternative]:
    """alpha turned, lengths with the other sign, in mm, exchanged; the other convention of the
    table.
    """
    entry = {key: value for key, value in free.items() if key.startswith("free_")}
    frames = sorted(
        int(key.removeprefix("free_alpha")) for key in entry if key.startswith("free_alpha")
    )
    for j in frames:
        for text, angle in TURNS.items():
            value = entry[f"free_alpha{j}"] + angle
            sign = (
                " (its sign)" if np.isclose(np.cos(value), np.cos(entry[f"free_alpha{j}"])) else ""
            )
            yield make(
                "angle",
                f"alpha of frame {j} is wrong by {text}{sign}",
                f"look at alpha of frame {j}: {_angle(value)} fits",
                constants={f"free_alpha{j}": value},
                of=f"alpha of frame {j}",
            )
        for key in ("d", "r", "b"):
            length = entry.get(f"free_{key}{j}", 0.0)
            if length:
                yield make(
                    "length",
                    f"{key} of frame {j} has the wrong sign",
                    f"look at {key} of frame {j}: {-length:g} fits",
                    constants={f"free_{key}{j}": -length},
                    of=f"{key} of frame {j}",
                )
                for text, factor in (
                    FACTORS.items() if not LIMIT.MM_BELOW < abs(length) < LIMIT.MM_ABOVE else ()
                ):
                    yield make(
                        "length",
                        f"{key} of frame {j} is to be taken {text} times: mm and m",
                        f"give {key} of frame {j} in m",
                        constants={f"free_{key}{j}": factor * length},
                        of=f"{key} of frame {j}",
                    )
        d, r = entry[f"free_d{j}"], entry[f"free_r{j}"]
        if d != r:
            yield make(
                "length",
                f"d and r of frame {j} are exchanged",
                f"exchange d and r of frame {j}",
                constants={f"free_d{j}": r, f"free_r{j}": d},
            )
    whole = {*make.links} <= {*frames}  # frames that constraints tie keep their entries
    lengths = [key for key in entry if key[5] in "drb" and entry[key]]
    for text, factor in FACTORS.items():
        longest = max((abs(entry[key]) for key in lengths), default=1.0)
        if whole and not 10 * LIMIT.MM_BELOW < longest < LIMIT.MM_ABOVE:
            yield make(
                "length",
                f"all lengths are to be taken {text} times: mm and m",
                "give lengths in m",
                constants={key: factor * entry[key] for key in lengths},
            )
    for step, cause, remedy in (
        (
            -1,
            "the table is of the classic (distal) convention and is read as Khalil's",
            "set convention: distal",
        ),
        (
            1,
            "the table is Khalil's and is read as of the classic (distal) convention",
            "leave convention: distal out",
        ),
    ):  # alpha and d of every frame taken from the frame before or after
        moved = {
            f"free_{key}{j}": entry.get(f"free_{key}{j + step}", 0.0)
            for j in frames
            for key in ("alpha", "d")
        }
        if len(frames) > 1 and whole:
            yield make("table", cause, remedy, constants=moved)


def _angle(x: float) -> str:
    """An angle in multiples of pi/2 where it is one."""
    quarter = x / (np.pi / 2)
    if not np.isclose(quarter, round(quarter)):
        return f"{x:.4g} rad"
    turn = (round(quarter) + 1) % 4 - 1
    return {0: "0", 1: "pi/2", -1: "-pi/2", 2: "pi"}[turn]
