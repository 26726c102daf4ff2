"""Checks before any fit: are positions, speeds, torques and lengths plausible for this robot?

Values are compared with `limits` of the robot file if it has them, otherwise with usual sizes.
Usual sizes are conventions: an industrial joint turns at a few rad/s, and by less than a turn or
two.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from runtime.core.model import joint_torque_units
from runtime.core.record import Record
from runtime.ground.check import Answer, Question, State
from runtime.ground.limits import limits
from runtime.physical.inertia import INERTIAL, PhysicalModel, frame_origins
from runtime.plausible.case import Case
from runtime.plausible.causes import changed_unit
from runtime.plausible.trials import reach

LIMIT = limits(__package__)

Array = np.ndarray


@Question(
    "Is the sampling rate plausible?",
    f"{LIMIT.LOG_RATES[0]:g} Hz to {LIMIT.LOG_RATES[1] / 1e3:g} kHz",
    "check the unit of the time column (record.units.t: ms, us) and record.rate",
)
def times(records: Sequence[Record]) -> Answer:
    """Check whether the sampling rate of every record is plausible."""
    record = min(records, key=lambda one: one.rate)
    text = f"{record.rate:.4g} Hz over {len(record) / record.rate:.4g} s"
    wrong = any(not LIMIT.LOG_RATES[0] <= one.rate <= LIMIT.LOG_RATES[1] for one in records)
    return Answer("no" if wrong else "good", text)


@Question(
    "Do the joints move?",
    "every joint, in some part of the record",
    ahead=True,
)
def standing(case: Case) -> Answer | None:
    """Find the joints that rest in every record; None if all joints move."""
    still = case.samples.still
    if not still.any():
        return None
    q = np.concatenate([record.q for record in case.records])
    rms = q.std(axis=0)[still].max()
    one = still.sum() == 1
    digits = max(0, -int(np.floor(np.log10(max(rms, 1e-6)))))  # the noise is no angle
    where = np.round(q.mean(axis=0), digits) + 0.0
    held = " ".join(f"--lock {name}={where[j]:g}" for j, name in _joint_names(case, still))
    them, it, move = ("it", "it", "does") if one else ("them", "they", "do")
    moving = [case.model.JOINTS[j] for j in np.flatnonzero(~still)]
    columns = ", ".join(
        f"{key}: [{', '.join(f'{key}{j}' for j in moving)}]" for key in ("q", "tau")
    )
    return Answer(
        "doubtful",
        f"Joint{'s' * (not one)} {case.joint_labels(still)} {move} not move ({rms:.1g} "
        f"{case.units[int(np.argmax(still))]} rms): hold {them} with --lock",
        f"symgen convert ROBOT held.yaml {held}, with a study that reads the columns of the others "
        f"(record.columns: {{{columns}}}); if {it} {move} move, check record.columns.q",
    )


def _joint_names(case: Case, still: Array) -> list[tuple[int, str]]:
    """List the number (from 0) and the name of each selected joint, as the option --lock needs."""
    names = getattr(case.model, "LABELS", {})
    joints = case.model.JOINTS
    return [(int(j), names.get(joints[j], f"q{joints[j]}")) for j in np.flatnonzero(still)]


@Question(
    "Are the positions those of this robot?",
    remedy="check zero and sign of these joints (theta, drives.offset, ratio), the order of the "
    "columns, and the unit and the side of the positions (joint or motor)",
)
def positions(case: Case) -> Answer:
    """Compare the positions of each joint with limits.q of the robot file, or with usual ranges."""
    q, turning = case.samples.q, case.turning
    low, high = q.min(axis=0), q.max(axis=0)
    largest = np.maximum(-low, high)
    limits = case.limits("q", 2)
    if limits is not None:
        room = limits[:, 1] - limits[:, 0]
        below, above = limits[:, 0] - low, high - limits[:, 1]
        out = np.maximum(below, above) > (LIMIT.LIMIT_EXCESS - 1) * room
        far = high - low > 2 * room
        end, bound = (np.where(below > above, *pair) for pair in ((low, high), limits.T))
        limit = "limits.q of the robot file"
    else:
        angle, travel = LIMIT.LARGEST_ANGLE, LIMIT.LARGEST_TRAVEL
        out, far = (largest > np.where(turning, *pair) for pair in zip(angle, travel, strict=True))
        end, bound = largest, None
        limit = f"{angle[0]:.3g} rad, {travel[0]:g} m (no limits.q in the robot file)"
    if not out.any():
        return Answer("good", case.reaching(largest, case.units, out), "", limit)
    text = case.reaching(end, case.units, out, bound)
    turns, units = largest[turning], case.column_units.get("q", ())
    if (
        (out & turning).any()
        and (not units or "rad" in units)
        and float(np.median(turns)) * np.pi / 180 < 2 * np.pi
        and float(turns.max()) > 2 * LIMIT.LARGEST_ANGLE[0]
    ):
        which = "" if turning.all() else " of revolute joints"
        remedy = (
            f"degrees read as rad? set record.units.q: deg{which}; or motor side read as joint side "
            "(record.side)"
        )
        change = changed_unit("q", units, turning, ("rad",), "deg")
        return Answer("no", text, remedy, limit, change)
    return Answer("no" if far.any() else "doubtful", text, limit=limit)


def _against(case: Case, key: str, values: Array, sane: dict[str, tuple[float, float]]) -> Answer:
    """Compare the largest speeds or accelerations with limits of the robot file or usual limits."""
    unit = {"qd": "s", "qdd": "s^2"}[key]
    limits = case.limits(key)
    if limits is not None:
        out, far = values > 1.5 * limits, values > 4 * limits
        limit = f"limits.{key} of the robot file"
    else:
        out, far = values > np.array([sane[one] for one in case.units]).T
        limit = f"{sane['rad'][0]:g} rad/{unit}, {sane['m'][0]:g} m/{unit}"
    state: State = "no" if far.any() else "doubtful" if out.any() else "good"
    units = [f"{one}/{unit}" for one in case.units]
    return Answer(state, case.reaching(values, units, out, limits), limit=limit)


@Question(
    "Are the speeds those of this robot?",
    remedy="check the sampling rate and the unit of time (record.rate, units.t), then the unit "
    "and the side of the positions (joint or motor)",
)
def speeds(case: Case) -> Answer:
    """Check whether the largest speed of every joint is plausible for this robot.

    If all speeds are very small, the answer is that nothing moves.
    """
    largest = np.abs(case.samples.qd).max(axis=0)
    answer = _against(case, "qd", largest, LIMIT.LARGEST_SPEED)
    if float(largest.max()) < LIMIT.NOTHING_MOVES:
        return answer._replace(state="no", finding=f"{answer.finding}: nothing moves")
    return answer


@Question(
    "Are the accelerations those of this robot?",
    remedy="check the sampling rate and the unit of time; if the positions are "
    "noisy, lower signals.lowpass.cutoff",
)
def accelerations(case: Case) -> Answer:
    """Check whether the largest acceleration of every joint is plausible for this robot."""
    largest = np.abs(case.samples.qdd).max(axis=0)
    answer = _against(case, "qdd", largest, LIMIT.LARGEST_ACCELERATION)
    mild = answer.state == "no" and case.limits("qdd") is not None
    return answer._replace(state="doubtful") if mild else answer


@Question(
    "Are the torques those of this robot?",
    "limits.tau of the robot file",
    "check the unit, the side and the columns of the torques "
    "(record.units.tau, torque_side, columns.tau)",
)
def torques(case: Case) -> Answer:
    """Check that every torque changes, and compare the largest torques with limits.tau.

    Torques below 1 % of these limits of the robot file are doubtful, too.
    """
    limits = case.limits("tau")
    if (flat := case.samples.constant()).any():
        text = f"The torque of joint {case.joint_labels(flat)} is constant"
        return Answer("no", text, limit="torques that change")
    if limits is None:
        return Answer(
            "good", "The torque of every joint changes; the robot file gives no limits.tau", ""
        )
    limits = np.where(limits > 0, limits, np.inf)  # a joint without a motor reaches none
    largest = np.abs(case.samples.tau).max(axis=0)
    if (out := largest > 1.5 * limits).any():
        times = float((largest / limits).max())
        text = (
            f"{case.reaching(largest, joint_torque_units(case.model), out)}, up to "
            f"{times:.3g} times the limits"
        )
        return Answer("no", text, explains=1 - 1 / times)  # the rest is within the limits
    share = 100 * float((largest / limits).max())
    if share < 1:
        return Answer("doubtful", f"The torques reach {share:.2g} % of limits.tau at most")
    return Answer("good", f"The torques reach {share:.0f} % of limits.tau", "")


@Question(
    "Are the lengths plausible for an arm?",
    f"links up to {LIMIT.LONGEST_LINK:g} m, none longer than {LIMIT.LOPSIDED:g} times "
    "all others together",
    "give d and r of the robot file in m",
)
def lengths(case: Case) -> Answer | None:
    """Check whether the links of the robot file are as long as those of an arm.

    Lengths are distances between frames, computed in the positions of the record. The result is
    None if these positions are not known.
    """
    P = frame_origins(case.model, case.samples.q[:: max(1, len(case.samples) // 32)])
    if P is None or not P.shape[1]:
        return None
    P = np.concatenate([np.zeros_like(P[:, :1]), P], axis=1)
    spans = np.linalg.norm(np.diff(P, axis=1), axis=-1).max(axis=0)
    spans = np.where(np.isfinite(spans), spans, 0.0)
    worst, longest, whole = int(np.argmax(spans)), float(spans.max()), float(spans.sum())
    text = f"The longest link ends at frame {worst + 1}: {longest:.4g} m of {whole:.4g} m in all"
    if longest > LIMIT.LONGEST_LINK or 0 < whole < LIMIT.SHORTEST_REACH:
        return Answer("no", text)
    lopsided = longest > LIMIT.LOPSIDED * max(whole - longest, 1e-9)
    if lopsided and np.count_nonzero(spans > 1e-9) > 1:
        return Answer("doubtful", text)
    return Answer("good", text, "")


@Question(
    "Can real links have the inertial values of the robot file?",
    "pseudo-inertia of every link not negative; inertia about the origin of the link frame",
    "give inertias about the origin of the link frame, not about the centre of mass; XY = "
    "-integral x y dm; kg m^2",
)
def inertias(case: Case) -> Answer | None:
    """Check whether real bodies can have the masses and inertias of the robot file.

    The pseudo-inertia of every link must be positive semidefinite. The result is None if the file
    gives no values.
    """
    if case.physical is None or not case.physical.values:
        return None
    if far := list(_far_bodies(case.physical, reach(case.model, case.samples.q))):
        return Answer("doubtful", "; ".join(far), "give values in kg, kg m, kg m^2, not g and mm")
    wrong = list(_wrong_links(case.physical))
    if not wrong:
        return Answer("good", "A real link can have the values of every link that has all ten", "")
    return Answer("doubtful", f"No real link has the values of link {', '.join(wrong)}")


def _far_bodies(physical: PhysicalModel, length: float) -> Iterator[str]:
    """Yield a sentence for each link whose values put its mass too far from its frame.

    The limit is a multiple (LINK_EXTENT in limits.toml) of the reach of the robot (`length`, m).
    Values of the link that the file does not give count as zero.
    """
    for j in physical.links:
        given = {family: physical.values.get(f"{family}{j}", 0.0) for family in INERTIAL}
        mass = abs(given["M"])
        if not mass:
            continue
        centre = max(abs(given[family]) for family in ("MX", "MY", "MZ")) / mass
        gyration = np.sqrt(max(abs(given[family]) for family in ("XX", "YY", "ZZ")) / mass)
        if (distance := max(centre, gyration)) > LIMIT.LINK_EXTENT * max(
            length, LIMIT.LEAST_EXTENT
        ):
            yield (
                f"The values of link {j} put its mass {distance:.3g} m from its frame, but the "
                f"robot reaches {length:.2g} m"
            )


def _wrong_links(physical: PhysicalModel) -> Iterator[str]:
    for condition in physical.conditions:
        names = [physical.standard[k] for k in condition.numbers]
        if condition.name.startswith("link ") and all(name in physical.values for name in names):
            chi = np.array([physical.values.get(name, 0.0) for name in physical.standard])
            P = condition.matrix(chi)
            if np.linalg.eigvalsh(P)[0] < -1e-3 * max(abs(np.trace(P)), 1e-12):
                yield condition.name.removeprefix("link ")
