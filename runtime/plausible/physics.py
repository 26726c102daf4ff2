"""Checks after the fit: can a physical robot explain the record, or do other settings fit better?

Other checks are the mass and the values of the robot, noise and friction in the torques, and the
delay between positions and torques.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from runtime.core.model import elements_of, joint_torque_units
from runtime.ground.check import Answer, Question, State
from runtime.ground.limits import limits
from runtime.plausible.case import Case
from runtime.plausible.delay import Delay
from runtime.plausible.trials import Trial, reach

LIMIT = limits(__package__)

Array = np.ndarray


@Question(
    "Can symgen check signs, units and columns?",
    "",
    "record a longer motion, or give a higher signals.lowpass.cutoff",
)
def not_asked(case: Case) -> Answer | None:
    """Report why a search for possible errors of the study is not made; None if it is made.

    With too few samples, the answer is "doubtful", because a wrong sign or unit would not be
    detected.
    """
    if not case.silent:
        return None
    state: State = "open" if case.unfit else "doubtful"
    text = "" if case.unfit else ", so wrong signs, units and columns are not looked for"
    return Answer(state, f"Not checked: {case.silent}{text}")


@Question(
    "Can a physical robot explain the record?",
    "about the same error",
    "a sign, an axis, a length or the order of the columns is wrong: check them in the robot file "
    "and in record.columns",
)
def physics(case: Case) -> Answer | None:
    """Compare, for each joint, the torque error of a physical robot with that of free parameters.

    The result is None if nothing is fitted.
    """
    if case.alone is None:
        return None
    free, given = case.alone.free, case.alone.given
    gap = (given.score - given.penalty - free.score) / case.alone.N
    ratio = given.errors / np.maximum(free.errors, 0.3)
    j = int(np.argmax(given.errors - free.errors))
    worse = (
        gap > LIMIT.PHYSICS_GAP
        and ratio[j] > 1.5
        and given.errors[j] - free.errors[j] > LIMIT.PHYSICS_ERROR
    )
    return Answer(
        "doubtful" if worse else "good",
        f"The best physical robot leaves {given.errors[j]:.1f} % of the torque of joint "
        f"{case.labels[j]} unexplained, parameters without physical limits {free.errors[j]:.1f} %",
    )


@Question(
    "Were the torques measured?",
    f"{100 * LIMIT.LEAST_FRICTION:g} % of friction in a joint, and visible noise",
    "log torques or currents as they were measured: torques that a controller computes "
    "from its model describe that model, not the robot",
)
def measured(case: Case) -> Answer | None:
    """Check that the torques were measured, not computed: measured torques show friction and noise.

    Friction is measured as a share of the torque of a joint, noise by fifth differences of the
    samples. Sensors behind the gears measure noise only. The result is None if the law of a
    controller gives the torques, or if nothing is fitted.
    """
    if case.alone is None or any(record.origin.by_law for record in case.records):
        return None
    behind = case.sides[1] == "link"
    elements = elements_of(case.model)
    kinds = [elements.get(name, ("",))[0] for name in case.model.BASE_PARAMETERS]
    chosen = np.isin(kinds, ("viscous", "coulomb"))
    friction = np.linalg.norm(case.D[:, :, chosen] @ case.alone.free.X[chosen], axis=0)
    share = float((friction / np.linalg.norm(case.samples.tau, axis=0)).max())
    if chosen.any() and share < LIMIT.LEAST_FRICTION and not behind:
        return Answer(
            "doubtful",
            f"No joint shows friction (at most {100 * share:.1f} % of its torque), as if a "
            "controller or a simulation computed the torques, or sensors measured them "
            "behind the gears",
            "log torques or currents as they were measured: torques that a controller computes "
            "from its model describe that model, not the robot; torques of sensors behind the "
            "gears need record.torque_side: link",
        )
    fifth = [np.quantile(np.abs(np.diff(one.tau, 5, axis=0)), 0.8, axis=0) for one in case.records]
    size = [np.sqrt((one.tau**2).mean(axis=0)).clip(1e-300) for one in case.records]
    noise = float(np.max(np.array(fifth) / size)) / (1.28 * 252**0.5)  # 1 of white noise of size 1
    if 0 < noise < LIMIT.LEAST_NOISE:  # 0 of a drive that knows few levels
        return Answer(
            "doubtful",
            f"The torques have almost no noise ({noise:.0e} of their size), as if a controller, a "
            "simulation or a filter computed them",
        )
    if behind:
        return Answer("good", "Sensors behind the gears measure no friction of the drives")
    if not chosen.any():
        return Answer("good", "The robot file has no friction, so noise alone is judged")
    return Answer("good", f"Friction is up to {100 * share:.0f} % of the torque of a joint")


@Question(
    "Do the torques agree with the size of the robot?",
    f"{LIMIT.DENSITY[0]:g} to {LIMIT.DENSITY[1]:g} kg per cubic metre (mass over the reach cubed)",
    "check side (joint or motor), unit and gear ratio of the torques (record.torque_side, "
    "units.tau, drives.ratio, torque_constant)",
)
def size(case: Case) -> Answer | None:
    """Check whether the fitted total mass of the links suits the reach of the robot.

    The result is None if mass or reach is unknown, or if a torque is not in N m.
    """
    in_newton = {*joint_torque_units(case.model)} == {"N m"}
    if case.alone is None or not case.alone.physical.links or not in_newton:
        return None
    length, physical = reach(case.model, case.samples.q), case.alone.physical
    if length > LIMIT.FARTHEST_REACH or length <= 0.1:
        return None
    masses = sum(case.alone.given.X[physical.link(j)[-1]] for j in physical.links)
    low, high = LIMIT.DENSITY
    return Answer(
        "good" if low <= masses / length**3 <= high else "doubtful",
        f"The torques belong to a robot of about {masses:.2g} kg with a reach of {length:.2g} m",
    )


@Question(
    "Do the values of the robot file agree with the record?",
    "gravity and inertia torques between a third and three times those computed from the values",
    "check ratio, torque constant, unit and sign of this joint, and its load; give the torque of "
    "a counterbalance or cable as record.columns.tau_known; or the values are those "
    "of another robot",
)
def values(case: Case) -> Answer | None:
    """Compare the torques computed from the robot file's values with the measured torques, by
    joint.

    The result is None if the robot file has no values.
    """
    if case.robot_values is None:
        return None
    if factors := case.robot_values.factors:
        return Answer(
            "no",
            f"The measured torques of joint {', '.join(factors)} are "
            f"{', '.join(f'{x:.2g}' for x in factors.values())} times those computed from the values",
            "check the unit and the side of the torques: a torque constant must include the gear ratio "
            "(record.torque_constant), currents need one, and torques of the motor side need the ratio "
            "(drives.ratio with record.torque_side: motor, or record.scale: {tau: ratio})",
            explains=1 - max(factors.values()),  # the rest has the size of the values
        )
    if off := case.robot_values.off:
        return Answer("doubtful", f"No: {'; '.join(off[:4])}")
    if (other := case.robot_values.other_weights).any():
        ratio = case.robot_values.weight[other][0]
        return Answer(
            "doubtful",
            f"The weight on the slide of joint {case.joint_labels(other)} is {ratio:.2g} times that of the "
            "values; no record shows a factor of this force, because the mass hides it",
            "check torque constant, ratio and unit of this joint, and the number of its motors; or "
            "correct the masses of the robot file",
        )
    ratios = [x for x in (*case.robot_values.gravity, *case.robot_values.inertia) if np.isfinite(x)]
    if not ratios and case.coarse:
        return Answer("open", "The positions are too coarse to judge inertia torques", "")
    if not ratios:
        return Answer(
            "good", "Gravity and inertia torques are too small compared with friction to judge"
        )
    return Answer(
        "good",
        "Measured over computed torques of gravity and inertia: "
        f"{min(ratios):.2f} to {max(ratios):.2f}",
    )


@Question(
    "Do positions and torques belong to the same instants?",
    f"shift below {1e3 * LIMIT.LATE:g} ms, or less than the record can show",
)
def delayed(case: Case, named: Sequence[Trial] = ()) -> Answer | None:
    """Check for a time shift between positions and torques.

    The result is None if the record does not determine the shift. If another change of the study
    explains the record better, the question stays open.
    """
    late = None if case.baseline is None else case.late
    if late is None or not np.isfinite(late.sigma).any():
        return None
    own, gain = certain_joints(case), late.before - late.after
    which, shift, sigma = "Torques are", np.array([late.common]), late.sigma_common
    if own.any() and not own.all():
        which = f"Torques of joint {case.joint_labels(own)} are"
        shift, sigma = late.shift[own], float(late.sigma[own].max())
    first = not named or late_gain(case) >= gain_of_alternative(case, named[0])
    state: State = "good" if not own.any() else "doubtful" if first else "open"
    j = int(np.nanargmax(np.where(own | ~own.any(), gain, -np.inf)))
    sense, each = (
        "late" if shift[0] > 0 else "early",
        ", ".join(f"{1e3 * abs(x):.1f}" for x in shift),
    )
    beyond = (
        ""
        if own.any() or np.abs(shift).max() <= LIMIT.LATE
        else ", but the record does not show this for certain"
    )
    return Answer(
        state,
        f"{which} {sense} by {each} ms, deviation {1e3 * sigma:.1f} ms{beyond}"
        + _instead(
            "with these delays corrected, free parameters leave",
            late.joints[j],
            late.before[j],
            late.after[j],
        ),
        "set controller.law.delay: fit, which identifies the delay between the log and the torque"
        if case.sides[1] == "law"
        else f"shift the torques by {', '.join(f'{-1e3 * x:+.1f}' for x in shift)} ms against the "
        "positions before reading the record, or repair the logger",
        explains=explained(late.before[j], late.after[j]),
    )


def explained(before: float, after: float) -> float:
    """Compute the share of an error, %, that a correction takes away: 1 - after/before, or 0."""
    return max(0.0, 1.0 - float(after) / float(before)) if before > 0 else 0.0


def _instead(leaves: str, joint: str, before: float, after: float) -> str:
    """Write how an error changes: "; with ... leaves 2.0 instead of 8.1 % of the torque ... unexplained".

    The result is an empty string if both errors are equal as printed.
    """
    a, b = f"{before:.1f}", f"{after:.1f}"
    return (
        ""
        if a == b
        else f"; {leaves} {b} instead of {a} % of the torque of joint {joint} unexplained"
    )


def late_joints(late: Delay) -> Array:
    """Whether the torque delay of each joint is far above its standard deviation, bool (n,).

    If one delay suits all joints, all are marked; otherwise only joints whose delays have the same
    sign.
    """
    visible = late.before > LIMIT.DELAY_VISIBLE * late.after
    certain = np.fmax(LIMIT.CERTAIN_JOINT_DELAY * late.sigma, LIMIT.LATE_JOINT)
    apart = visible & (np.abs(late.shift - late.common) > certain)
    gain = late.before - late.after
    common = max(LIMIT.CERTAIN_JOINT_DELAY * late.sigma_common, LIMIT.LATE)
    if visible[int(np.nanargmax(gain))] and abs(late.common) > common and not apart.any():
        return np.ones(len(gain), dtype=bool)
    own = visible & (np.abs(late.shift) > certain)
    strongest = late.shift[int(np.argmax(np.where(own, gain, -np.inf)))]
    return np.asarray(own & (late.shift * strongest > 0))


def gain_of_delays(case: Case, late: Delay) -> float:
    """Compute the log-likelihood gained by correcting the given delays of the torques, in nats."""
    N = 0.0 if case.baseline is None else case.baseline.N
    return N * float(np.log(late.before / np.maximum(late.after, 0.1)).sum())


def gain_of_alternative(case: Case, trial: Trial) -> float:
    """Compute the log-likelihood gained by correcting one possible error of the study, in nats.

    The number of rows that count is the same as in `gain_of_delays`, so that both gains can be
    compared.
    """
    assert case.baseline is not None and trial.fit is not None
    return case.baseline.given.score - trial.fit.score


def late_gain(case: Case) -> float:
    """Compute the log-likelihood gained by correcting torque delays, nats; 0 if no delay is
    certain.
    """
    if case.baseline is None or case.late is None:
        return 0.0
    return gain_of_delays(case, case.late) if certain_joints(case).any() else 0.0


def certain_joints(case: Case) -> Array:
    """Whether the torque of each joint is late beyond doubt, bool (n,).

    All are false if correcting the delays gains too little (less than LATE_GAIN in limits.toml).
    """
    assert case.late is not None
    return np.asarray(late_joints(case.late) & (gain_of_delays(case, case.late) >= LIMIT.LATE_GAIN))


@Question(
    "Is the study the best explanation of the record?",
    f"no single change explains it decisively better (log-likelihood gain of {LIMIT.DECISIVE:g})",
)
def better(case: Case, named: Sequence[Trial]) -> Answer:
    """Report the corrections that explain the record decisively better than the study as given.

    If the best of them is friction that the model lacks, the study is not wrong and the answer is
    good.
    """
    if not named:
        return Answer(
            "good",
            "No single change of a sign, column, unit, angle or length explains the record better",
        )
    assert case.baseline is not None and named[0].fit is not None
    before, after = case.baseline.given.errors, named[0].fit.errors
    j = int(np.argmax(before / np.maximum(after, 0.3)))
    cause, *others = (t.cause.says for t in named)
    friction = named[0].cause.kind == "friction"
    text = f"{'Friction alone' if friction else 'No'}: {cause}" + (
        f" (or: {'; '.join(others)})" if others else ""
    )
    band = f"{case.labels[j]} (below {case.samples.cutoff:.2g} Hz)"
    text += _instead("with this change, a physical robot leaves", band, before[j], after[j]) or (
        "; the errors do not change, but the parameters are nearer to the values of the robot file"
    )
    first = named[0].cause
    state: State = "good" if friction else "no"
    gain = explained(before[j], after[j])
    return Answer(state, text, first.remedy, change=first.change, explains=gain)
