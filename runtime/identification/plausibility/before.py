"""Before any fit: are positions, speeds, accelerations, times, rest and lengths those of this robot?

Against `limits` of the robot file where it has them, against sane sizes otherwise. Sane sizes are conventions: an industrial joint turns a few
rad/s and less than a turn or two, a link is shorter than LONGEST.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from runtime.identification.checklist import Check, State
from runtime.identification.plausibility.samples import Samples
from runtime.model.generated import GeneratedModel, joint_units
from runtime.model.inertia import PhysicalModel
from runtime.records.record import Record
from runtime.records.stream import Stream

Array = np.ndarray

BEYOND = 1.1
"""Over a limit: filters and calibration may exceed it a little."""
TURNS = (4 * np.pi, 30.0)
"""Largest |q| of a joint that turns, rad: good up to the first, no position of a robot above the second."""
METRES = (5.0, 50.0)
SPEEDS = {"rad": (15.0, 60.0), "m": (5.0, 50.0)}
"""Largest speed, rad/s and m/s."""
ACCELERATIONS = {"rad": (300.0, 3000.0), "m": (100.0, 1000.0)}
RATES = (5.0, 1e5)
"""Sampling rates of logs, Hz."""
SLOW = 0.005
"""Largest speed of the fastest joint, rad/s or m/s, below which nothing moves."""
STILL = 1e-3
"""Range of a joint, rad or m, below which it does not move."""
REST = 0.1
"""Share of the instants at which a joint stands, above which these rows are looked at."""
LONGEST = 10.0
"""Length of a link, m, that no arm has."""
SHORTEST = 0.02
"""Reach, m, below which a robot file is not believed."""
LOPSIDED = 50.0
"""A link over the sum of the others."""


def before_checks(model: GeneratedModel, samples: Samples, physical: PhysicalModel | None) -> list[Check]:
    """Checks of the record and of the robot file."""
    return [
        positions(model, samples),
        speeds(model, samples),
        accelerations(model, samples),
        torques(model, samples),
        *([] if (length := lengths(model, samples)) is None else [length]),
        *([inertias(physical)] if physical is not None and physical.values else []),
    ]


def limits_of(model: GeneratedModel, key: str) -> Array | None:
    """Largest |.| of each joint by the robot file, (n,); of q, (n, 2)."""
    given = dict(getattr(model, "LIMITS", {}) or {}).get(key)
    if given is None:
        return None
    return np.asarray(given, dtype=float)


def still(samples: Samples) -> Array:
    """Whether each joint stands still in the whole record, (n,)."""
    return np.asarray(np.ptp(samples.q, axis=0) < STILL)


def _per_joint(names: Sequence[int], values: Array, unit: Sequence[str], chosen: Array) -> str:
    return ", ".join(f"{values[j]:.3g} {unit[j]} (joint {names[j]})" for j in np.flatnonzero(chosen)[:4])


def times(records: Sequence[Record | Stream]) -> Check:
    """Sampling rate and duration of the records."""
    question, limit = "Are the times those of a log?", f"{RATES[0]:g} Hz to {RATES[1] / 1e3:g} kHz"
    record = min(records, key=lambda one: one.rate)
    duration = len(record) / record.rate
    text = f"{record.rate:.4g} Hz over {duration:.4g} s"
    wrong = any(not RATES[0] <= one.rate <= RATES[1] for one in records)
    remedy = "look at the unit of the time column (record.units.t: ms, us) and at record.rate"
    return Check(question, "no" if wrong else "good", text, limit, remedy)


def positions(model: GeneratedModel, samples: Samples) -> Check:
    """Largest |q| against limits.q, else against a turn or two."""
    question = "Are the positions those of this robot?"
    units = joint_units(model)
    low, high = samples.q.min(axis=0), samples.q.max(axis=0)
    largest = np.maximum(-low, high)
    span = high - low
    limits = limits_of(model, "q")
    turning = np.array([unit == "rad" for unit in units])
    if limits is not None and limits.shape == (samples.n, 2):
        room = limits[:, 1] - limits[:, 0]
        excess = np.maximum(limits[:, 0] - low, high - limits[:, 1])
        out = excess > (BEYOND - 1) * room
        far = span > 2 * room
        limit = "limits.q of the robot file"
    else:
        bounds = np.where(turning, TURNS[0], METRES[0])
        out, far = largest > bounds, largest > np.where(turning, TURNS[1], METRES[1])
        limit = f"{TURNS[0]:.3g} rad, {METRES[0]:g} m (no limits.q in the robot file)"
    if not out.any():
        rests = np.flatnonzero(still(samples))
        if len(rests) and samples.n > 1:
            text = f"{'Joint' if len(rests) == 1 else 'Joints'} {', '.join(str(model.JOINTS[j]) for j in rests)} "
            text += f"{'stands' if len(rests) == 1 else 'stand'} still in the whole record"
            return Check(question, "doubtful", text, limit, "look at the columns of these positions; their parameters cannot be identified")
        return Check(
            question, "good", f"They reach {_per_joint(model.JOINTS, largest, units, np.arange(samples.n) == np.argmax(largest))}", limit
        )
    text = "They reach " + _per_joint(model.JOINTS, largest, units, out)
    degrees = (
        bool((out & turning).any())
        and float(np.median(largest[turning])) * np.pi / 180 < 2 * np.pi
        and float(largest[turning].max()) > 2 * TURNS[0]
    )
    if degrees:
        remedy = "degrees read as rad? set record.units.q: deg; or motor side read as joint side (record.side)"
    else:
        remedy = "look at zero and sign of these joints (theta, drives.offset, ratio), the order of the columns, the unit and the side of the positions"
    return Check(question, "no" if far.any() or degrees else "doubtful", text, limit, remedy)


def _against(
    model: GeneratedModel, samples: Samples, key: str, values: Array, sane: dict[str, tuple[float, float]], unit: str
) -> tuple[State, str, str]:
    units = [f"{one}/{unit}" for one in joint_units(model)]
    limits = limits_of(model, key)
    if limits is not None and limits.shape == (samples.n,):
        out, far, limit = values > 1.5 * limits, values > 4 * limits, f"limits.{key} of the robot file"
    else:
        bounds = np.array([sane[one] for one in joint_units(model)])
        out, far = values > bounds[:, 0], values > bounds[:, 1]
        limit = f"{sane['rad'][0]:g} rad/{unit}, {sane['m'][0]:g} m/{unit}"
    shown = out if out.any() else np.arange(samples.n) == int(np.argmax(values))
    return "no" if far.any() else "doubtful" if out.any() else "good", _per_joint(model.JOINTS, values, units, shown), limit


def speed_bounds(units: Sequence[str]) -> Array:
    """SPEEDS of joints in `units`, shape (n, 2)."""
    return np.array([SPEEDS[unit] for unit in units])


def speeds(model: GeneratedModel, samples: Samples) -> Check:
    """Largest speed of every joint; one that is far too slow too."""
    largest = np.abs(samples.qd).max(axis=0)
    state, text, limit = _against(model, samples, "qd", largest, SPEEDS, "s")
    remedy = "look at the sampling rate and the unit of time (record.rate, units.t), then at the unit and the side of the positions"
    if float(largest.max()) < SLOW:
        state, text = "no", f"{text}: nothing moves"
    return Check("Are the speeds those of this robot?", state, f"They reach {text}", limit, remedy)


def accelerations(model: GeneratedModel, samples: Samples) -> Check:
    """Largest acceleration of every joint."""
    state, text, limit = _against(model, samples, "qdd", np.abs(samples.qdd).max(axis=0), ACCELERATIONS, "s^2")
    remedy = "look at the sampling rate and the unit of time; noise of the positions asks for a lower signals.lowpass.cutoff"
    return Check(
        "Are the accelerations those of this robot?",
        "doubtful" if state == "no" and limit.startswith("limits") else state,
        f"They reach {text}",
        limit,
        remedy,
    )


def constant_torques(samples: Samples) -> Array:
    """Whether the torque of each joint never changes, (n,)."""
    return np.asarray(np.ptp(samples.tau, axis=0) <= 1e-9 * np.maximum(np.abs(samples.tau).max(axis=0), 1e-12))


def torques(model: GeneratedModel, samples: Samples) -> Check:
    """Largest torque against limits.tau, where the robot file gives them; torques that never change."""
    question, remedy = (
        "Are the torques those of this robot?",
        "look at the unit, the side and the columns of the torques (record.units.tau, torque_side, columns.tau)",
    )
    largest = np.abs(samples.tau).max(axis=0)
    if (flat := constant_torques(samples)).any():
        text = f"The torque of joint {', '.join(str(model.JOINTS[j]) for j in np.flatnonzero(flat))} is constant"
        return Check(question, "no", text, "torques that change", remedy)
    limits = limits_of(model, "tau")
    limit = "limits.tau of the robot file"
    if limits is None or limits.shape != (samples.n,):
        return Check(question, "good", "They change on every joint; the robot file gives no limits.tau", limit)
    out = largest > 1.5 * limits
    units = ["N m" if one == "rad" else "N" for one in joint_units(model)]
    if out.any():
        return Check(question, "no", f"They reach {_per_joint(model.JOINTS, largest, units, out)}", limit, remedy)
    share = 100 * float((largest / limits).max())
    if share < 1:
        return Check(question, "doubtful", f"They reach {share:.2g} % of limits.tau at most", limit, remedy)
    return Check(question, "good", f"They reach {share:.0f} % of limits.tau", limit)


def lengths(model: GeneratedModel, samples: Samples) -> Check | None:
    """Reach and the longest link of the robot file, in the positions of the record."""
    question, limit = "Are the lengths those of an arm?", f"links up to {LONGEST:g} m, none {LOPSIDED:g} times the others"
    remedy = "give d and r of the robot file in m"
    spans = link_lengths(model, samples.q[:: max(1, len(samples) // 32)])
    if spans is None or not len(spans):
        return None
    worst, longest, whole = int(np.argmax(spans)), float(spans.max()), float(spans.sum())
    text = f"The longest link ends at frame {worst + 1}: {longest:.4g} m of {whole:.4g} m in all"
    if longest > LONGEST or (whole > 0 and whole < SHORTEST):
        return Check(question, "no", text, limit, remedy)
    if longest > LOPSIDED * max(whole - longest, 1e-9) and np.count_nonzero(spans > 1e-9) > 1:
        return Check(question, "doubtful", text, limit, remedy)
    return Check(question, "good", text, limit)


def link_lengths(model: GeneratedModel, q: Array) -> Array | None:
    """Largest distance of each frame from the one before it, m, shape (frames,); None without poses."""
    poses = getattr(model, "frame_poses", None)
    if poses is None:
        return None
    try:
        with np.errstate(all="ignore"):
            P = np.asarray(poses(q))[:, :, :3, 3]
    except ValueError:
        return None
    P = np.concatenate([np.zeros_like(P[:, :1]), P], axis=1)
    steps = np.linalg.norm(np.diff(P, axis=1), axis=-1).max(axis=0)
    return np.where(np.isfinite(steps), steps, 0.0)


def inertias(physical: PhysicalModel) -> Check:
    """Whether the values of the robot file are those of bodies: every pseudo-inertia positive semidefinite."""
    question = "Can bodies have the values of the robot file?"
    limit = "pseudo-inertia of every link not negative; inertia about the origin of the link frame"
    wrong = list(_wrong_links(physical))
    if not wrong:
        return Check(question, "good", "Every link with ten values can exist", limit)
    remedy = "give inertias about the origin of the link frame, not about the centre of mass; XY = -integral x y dm; kg m^2"
    return Check(question, "doubtful", f"No body has those of link {', '.join(wrong)}", limit, remedy)


def _wrong_links(physical: PhysicalModel) -> Iterator[str]:
    for condition in physical.conditions:
        names = [physical.standard[k] for k in condition.numbers]
        if condition.name.startswith("link ") and all(name in physical.values for name in names):
            chi = np.array([physical.values.get(name, 0.0) for name in physical.standard])
            P = condition.matrix(chi)
            if np.linalg.eigvalsh(P)[0] < -1e-3 * max(abs(np.trace(P)), 1e-12):
                yield condition.name.removeprefix("link ")
