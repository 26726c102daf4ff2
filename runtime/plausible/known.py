"""Compare the torques computed from the robot file's values with the record, joint by joint.

    Y_j = a_j (gravity torque by the values)_j + b_j (the rest of their torque)_j + friction and
    offset,

by least squares for each joint: a_j = b_j = 1 if values, gear and sign are right. Viscous and dry
friction are fitted whether the robot file has them or not, unless sensors behind the gears measure
the torques. A part is left out if it is small or cannot be separated. For a slide whose gravity
force is constant, the offset of friction is left out instead, so that a_j is the ratio of the
weights. No record shows a factor of this force: the mass hides it.

A second question: are the measured torques really torques? Motor currents change in time as the
computed torques do, but have another size.

    slope_j = y_j'w_j / ||w_j||^2,    alike_j = y_j'w_j / (||y_j|| ||w_j||),
            w_j = W_j X_0 and y_j = Y_j without their parts that friction and offset explain,
            X_0 the base parameters of the file's values

Values of a maker's file are right to tens of per cent. If the measured torque of a joint is similar
to the computed one (alike_j above TORQUE_ALIKE in limits.toml), but is smaller or larger by more
than a factor (TORQUE_FACTOR in limits.toml), it was measured in another unit or on the other side
of the gear. Drivers of some arms publish motor currents as effort.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from runtime.core.model import GeneratedModel, elements_of, is_axis, joint_labels, joint_units
from runtime.core.result import Identification
from runtime.core.rows.observation import Observation
from runtime.ground.documents import Result
from runtime.ground.limits import limits
from runtime.ground.part import Doubt
from runtime.ground.table import Table, number
from runtime.physical.inertia import INERTIAL

if TYPE_CHECKING:
    from runtime.plausible.trials import Baseline

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class KnownValues(Result):
    """Comparison of the torques computed from the robot file's values with the measured torques.

    Attributes
    ----------
    joints : tuple of str
    gravity, inertia : ndarray, shape (n,)
        Ratio of measured to computed torque, for the gravity part and for the rest; nan if this
        part is too small.
    error : ndarray, shape (n,), %
        Relative error of the computed torque, with friction fitted and both ratios 1.
    complete : bool
        Whether every link has its ten values.
    weight : ndarray, shape (n,)
        Ratio of measured to computed weight of slides with a constant gravity force, else nan.
    """

    joints: tuple[str, ...]
    gravity: Array
    inertia: Array
    error: Array
    complete: bool
    weight: Array

    def without_inertia(self) -> KnownValues:
        """Leave out the results that need accelerations: the ratios of inertia torques, and the
        errors.
        """
        unknown = np.full(len(self.joints), np.nan)
        return replace(self, inertia=unknown, error=unknown)

    def table(self) -> Table:
        """Tabulate, by joint, the ratios of measured to computed torque, and the relative error.

        The error is that of the computed torque, in % of the measured torque.
        """
        rows = zip(self.joints, self.gravity, self.inertia, self.error, strict=True)
        return Table(
            "Values of the robot file against the record, friction fitted",
            (
                "joint",
                "gravity torque, measured over computed",
                "inertia torque, measured over computed",
                "error of the values, %",
            ),
            [(j, number(g, ".2f"), number(a, ".2f"), number(e, ".1f")) for j, g, a, e in rows],
        )

    @property
    def other_weights(self) -> Array:
        """Whether the weight on each slide is far from the weight in the robot file, bool (n,)."""
        low, high = LIMIT.WEIGHT_RATIOS
        return np.asarray(
            np.isfinite(self.weight) & ~((low <= self.weight) & (self.weight <= high))
        )

    @property
    def heavy(self) -> bool:
        """Whether the measured gravity torques of all joints are far above, or all far below, the
        computed torques.

        All ratios are then on the same side of a range (CAD_RATIOS in limits.toml). Wrong time
        stamps cannot cause such ratios.
        """
        ratios, (low, high) = self.gravity[np.isfinite(self.gravity)], LIMIT.CAD_RATIOS
        return len(ratios) > 0 and bool((ratios < low).all() or (ratios > high).all())

    @property
    def factors(self) -> dict[str, float]:
        """Factors of the measured torques by joint, which another unit or side of the gears may cause.

        They are the ratios of measured to computed torques, if all are far below 1: each joint may
        have its own gear, which multiplies its gravity and its inertia torque alike (within
        CAD_RATIOS in limits.toml). The mapping is empty otherwise.
        """
        low, high = LIMIT.CAD_RATIOS
        found: dict[str, float] = {}
        both = np.column_stack([self.gravity, self.inertia])
        if np.isfinite(both).sum() < 3:
            return {}
        for joint, ratios in zip(self.joints, both, strict=True):
            known = ratios[np.isfinite(ratios)]
            if not len(known):
                continue
            mean = float(np.exp(np.log(known).mean())) if (known > 0).all() else np.nan
            if not (mean < LIMIT.OTHER_UNIT and known.max() <= high / low * known.min()):
                return {}
            found[joint] = mean
        return found

    @property
    def off(self) -> tuple[str, ...]:
        """Sentences that name the joints whose measured torques differ too much from the computed
        torques.

        The sentences name joints with ratios outside CAD_RATIOS, or with errors above CAD_ERROR
        (limits.toml).
        """
        texts = []
        doubtful = set()
        for name, ratios in (("gravity", self.gravity), ("inertia", self.inertia)):
            for joint, ratio in zip(self.joints, ratios, strict=True):
                if np.isfinite(ratio) and not LIMIT.CAD_RATIOS[0] <= ratio <= LIMIT.CAD_RATIOS[1]:
                    doubtful.add(joint)
                    texts.append(
                        f"the measured {name} torque of joint {joint} is {ratio:.2f} times that "
                        "computed from the values"
                    )
        for joint, error in zip(self.joints, self.error, strict=True):
            if self.complete and error > LIMIT.CAD_ERROR and joint not in doubtful:
                texts.append(
                    f"the values leave {error:.0f} % of the torque of joint {joint} unexplained "
                    "(with fitted friction)"
                )
        return tuple(texts)


def known_values(baseline: Baseline, *, rotors: bool = True) -> KnownValues | None:
    """Compare torques computed from the inertial values of the robot file with measured torques.

    Return None if there is no link for which the file gives all ten values.

    rotors : whether the measured torques include friction and rotors of the drives; false for
        sensors behind the gears.
    """
    physical, s = baseline.physical, baseline.samples
    given = [all(f"{family}{j}" in physical.values for family in INERTIAL) for j in physical.links]
    if not any(given):
        return None
    inertial = [
        k for j, known in zip(physical.links, given, strict=True) if known for k in physical.link(j)
    ]
    chi = np.zeros(len(physical.standard))
    chi[inertial] = [physical.values[physical.standard[k]] for k in inertial]
    for k, name in enumerate(physical.standard):
        if rotors and name.startswith("Ia"):
            chi[k] = physical.values.get(name) or baseline.given.X[k]  # a URDF has no place for it
    X = physical.K @ chi
    at_rest = np.zeros_like(s.q)
    gravity = baseline.model.regressor(s.q, at_rest, at_rest) @ X
    whole = baseline.D @ X
    Y, mask = s.tau - s.tau_known, s.moving()
    columns = baseline.D @ physical.K
    beside = [
        k
        for k, name in enumerate(physical.standard)
        if elements_of(baseline.model).get(name, ("inertia",))[0] != "inertia"
    ]
    ratios, errors, weight = np.full((s.n, 2), np.nan), np.full(s.n, np.nan), np.full(s.n, np.nan)
    slides = np.array(joint_units(baseline.model)) != "rad"
    for j in range(s.n):
        rows = mask[:, j] if mask[:, j].sum() >= 20 else np.ones(len(Y), dtype=bool)
        y = Y[rows, j]
        if len(y) < 20:
            continue
        friction = columns[rows][:, j, beside]
        if rotors:
            v = s.qd[rows, j]
            friction = np.column_stack([friction, v, np.sign(v)])
        parts = np.column_stack([gravity[rows, j], (whole - gravity)[rows, j]])
        force = parts[:, 0].mean()
        if slides[j] and abs(force) > max(1e6 * np.ptp(parts[:, 0]), abs(y.mean()) / 10, 1e-9):
            moving = np.column_stack([parts, s.qd[rows, j], np.sign(s.qd[rows, j])])
            weight[j] = np.linalg.lstsq(moving, y, rcond=None)[0][0]
        left = parts - friction @ np.linalg.lstsq(friction, parts, rcond=None)[0]
        rest = y - friction @ np.linalg.lstsq(friction, y, rcond=None)[0]
        size = np.linalg.norm(left, axis=0)
        errors[j] = (
            100 * np.linalg.norm(rest - left.sum(axis=1)) / max(float(np.linalg.norm(y)), 1e-300)
        )
        shown = size > LIMIT.SMALL_PART * np.linalg.norm(y)
        if shown.any() and (shown.sum() == 1 or abs(left[:, 0] @ left[:, 1]) < 0.9 * size.prod()):
            ratios[j, shown] = np.linalg.lstsq(left[:, shown], rest, rcond=None)[0]
    joints = joint_labels(baseline.model)
    return KnownValues(joints, ratios[:, 0], ratios[:, 1], errors, all(given), weight)


def torque_unit(result: Identification) -> Doubt | None:
    """Make a warning if the unit of the measured torques is doubtful; None if there is no doubt."""
    by_law = any(record.origin.by_law for record in result.records)
    doubt = torque_unit_doubt(result.model, result.observation, by_law)
    return Doubt("torque_unit", "Unit of the torques", f"{doubt}.") if doubt else None


def torque_unit_doubt(model: GeneratedModel, observation: Observation, by_law: bool) -> str:
    """Write a question about the unit of the torques, if their size contradicts the robot file's
    values.

    The text is empty if nothing contradicts the unit, or if the file lacks values.
    """
    values, standard = dict(getattr(model, "VALUES", {})), getattr(model, "STANDARD_PARAMETERS", ())
    inertial = [name for name in standard if name.rstrip("0123456789") in INERTIAL]
    if (
        not inertial
        or not all(name in values for name in inertial)
        or observation.names != tuple(model.BASE_PARAMETERS)
    ):
        return ""
    X0 = np.asarray(
        cast(Any, model).base_parameters(
            dict.fromkeys(standard, 0.0) | {name: values[name] for name in inertial}
        )
    )
    slopes: dict[str, float] = {}
    losses = [
        k
        for k, name in enumerate(observation.names)
        if elements_of(model).get(name, ("inertia",))[0] != "inertia"
    ]
    for j, label, joint in zip(
        model.JOINTS, joint_labels(model), observation.factor.joints, strict=True
    ):
        R, measured = joint.R[:, :-1], joint.R[:, -1]
        friction = R[:, np.isin(joint.columns, losses)]
        parts = np.column_stack([R @ X0[joint.columns], measured])
        left = parts - friction @ np.linalg.lstsq(friction, parts, rcond=None)[0]
        size, both = float(left[:, 0] @ left[:, 0]), float(left[:, 0] @ left[:, 1])
        if (
            size > 0
            and not is_axis(j)
            and both > LIMIT.TORQUE_ALIKE * np.sqrt(size) * np.linalg.norm(left[:, 1])
            and not 1 / LIMIT.TORQUE_FACTOR < both / size < LIMIT.TORQUE_FACTOR
        ):
            slopes[label] = both / size
    if not slopes:
        return ""
    cause = (
        "are the gains of controller.law in N m/deg (gain: 180/pi), or those of the motor side?"
        if by_law
        else "are they currents, or of the motor side? Set record.units.tau: A with "
        "record.torque_constant, or record.torque_side: motor"
    )
    return (
        f"the torques of joint {', '.join(slopes)} run like those of the values in the robot file "
        f"at {', '.join(f'{x:.2g}' for x in slopes.values())} of their size: {cause}"
    )
