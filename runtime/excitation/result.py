"""Result of a search for an exciting motion: the motion, its precision, its use of the limits.

Every figure is computed from the rows that the identification will use, with the exact sign(qd).
This module does not use CasADi: pages read results without it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from runtime.core.model import GeneratedModel, joint_labels
from runtime.core.rows.predicted import Weights
from runtime.excitation.criteria import MotionLimits, usage
from runtime.excitation.joint_trajectory import joint_names, joint_trajectory
from runtime.excitation.settings import ExcitationSettings
from runtime.ground.documents import Result
from runtime.ground.limits import limits
from runtime.ground.settings import to_mapping
from runtime.ground.table import Table, percentage
from runtime.loop.result import csv_text
from runtime.loop.trajectories import Motion

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Start:
    """The motion that the optimiser reached from one random start.

    Attributes
    ----------
    number : int
        Number of the start.
    motion : dict
        The motion as a mapping.
    criterion : float
        Value of the criterion in the optimiser.
    message : str
        Message of the optimiser at its end.
    violation : float
        Largest violation of a constraint at the points of the grid, relative to its scale.
    """

    number: int
    motion: dict[str, Any]
    criterion: float
    message: str
    violation: float


@dataclass(frozen=True, eq=False)
class Known:
    """Parameter values assumed in the search, and their precision from the recorded motion.

    Attributes
    ----------
    X : ndarray, shape (b,)
        All base parameters.
    source : str
        Text that says where the values come from.
    weights : Weights
    condition : float or None
        Condition number of W_w of the records; None without records.
    relative_sigma : dict
        Predicted %sigma by name on the motion of the records; empty without records.
    without_values : tuple of str
        Parameters that the search left out, because the robot file has no value of their unit.
    """

    X: Array
    source: str
    weights: Weights
    condition: float | None = None
    relative_sigma: dict[str, float] = field(default_factory=dict)
    without_values: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Excitation(Result):
    """The best motion of a search, with its predicted precision.

    Attributes
    ----------
    model : GeneratedModel
    motion : Motion
    condition : float
        Condition number of W_w on the rows of the identification.
    relative_sigma : dict
        Predicted %sigma by name.
    starts : tuple of Start
        All starts, by number.
    margin : float
        Share of the limits left free at the points of the grid. The margin was enlarged if the
        motion exceeded a limit between these points.
    settings : ExcitationSettings
    limits : MotionLimits
    known : Known
        Parameter values that the search uses, and the precision of the recorded motion.
    """

    model: GeneratedModel
    motion: Motion
    condition: float
    relative_sigma: dict[str, float]
    starts: tuple[Start, ...]
    margin: float
    settings: ExcitationSettings
    limits: MotionLimits
    known: Known

    def sampled(self) -> tuple[Array, Array, Array, Array, Array]:
        """Sample the motion and its torque at the controller rate.

        Returns t, shape (N,), and q, qd, qdd, tau, shape (N, n); tau is the torque of the model.
        """
        t, q, qd, qdd = self.motion.sampled(self.settings.rate)
        return t, q, qd, qdd, self.model.inverse_dynamics(q, qd, qdd, self.known.X)

    def to_csv(self) -> str:
        """Write the motion as CSV text, a reference file for `simulate`.

        The columns are t, q1 ..., qd1 ..., qdd1 ... at the controller rate, in SI units.
        """
        t, q, qd, qdd, _ = self.sampled()
        return csv_text(t, q=q, qd=qd, qdd=qdd)

    def to_joint_trajectory(self) -> str:
        """Write the motion as a message trajectory_msgs/JointTrajectory of ROS, YAML text.

        Points are rows of the table of `to_csv`, at most 100 in a second.
        """
        t, q, qd, qdd, _ = self.sampled()
        return joint_trajectory(joint_names(self.model), t, q, qd, qdd, self.settings.rate)

    @property
    def usage(self) -> dict[str, list[float]]:
        """Share of each limit (of q, qd, qdd, torque) that the motion uses, by joint."""
        return usage(self.model, self.motion, self.limits, self.settings.rate, self.known.X)

    @property
    def worse(self) -> dict[str, float]:
        """Parameters that the recorded motion determines better than this motion.

        For each name: ratio of the %sigma of this motion to the %sigma of the recorded motion,
        largest first.
        """
        before = self.known.relative_sigma
        ratios = {
            name: sigma / before[name]
            for name, sigma in self.relative_sigma.items()
            if before.get(name, 0.0) > 0
        }
        return dict(
            sorted(
                ((name, ratio) for name, ratio in ratios.items() if ratio > 1),
                key=lambda item: -item[1],
            )
        )

    @property
    def comparison(self) -> str:
        """Sentence that compares this motion with the motion of the record; "" without a record."""
        before, worse = self.known.relative_sigma, self.worse
        if not before:
            return ""
        if not worse:
            return (
                f" This motion determines each of these {len(before)} parameters better than the "
                "motion of the record."
            )
        named = ", ".join(
            f"{name} {_percent(self.relative_sigma[name])} (record {_percent(before[name])})"
            for name in list(worse)[: LIMIT.SIGMAS_NAMED]
        )
        more = (
            f" and {len(worse) - LIMIT.SIGMAS_NAMED} more"
            if len(worse) > LIMIT.SIGMAS_NAMED
            else ""
        )
        return (
            f" This motion determines {len(before) - len(worse)} of {len(before)} parameters "
            f"better than the motion of the record. It determines these WORSE: {named}{more}."
        )

    @property
    def torques(self) -> str:
        """Sentence that names the joints without a torque limit; "" if there are none."""
        free = [
            j
            for j, limit in zip(joint_labels(self.model), self.limits.tau, strict=True)
            if not np.isfinite(limit)
        ]
        if not free:
            return ""
        largest = np.abs(self.sampled()[-1]).max(axis=0)
        values = ", ".join(f"{x:.3g}" for x in largest)
        return (
            f" Torque limits of joint {', '.join(free)} are unknown, so the search ignored these "
            f"limits: the motion needs up to {values}; compare with the data sheet "
            "(limits: {tau: [...]})."
        )

    @property
    def verdict(self) -> str:
        """Text with cond(W), the least certain parameter, and the joints without torque limit.

        The text also names the parameters that the motion of the record determines better.
        """
        of_record = (
            ""
            if self.known.condition is None
            else f" (motion of the record: {self.known.condition:.1f})"
        )
        kept = (
            "all limits"
            if np.isfinite(self.limits.tau).all()
            else "the limits of position, velocity and acceleration"
        )
        return (
            f"The motion takes {self.motion.duration:.1f} s, keeps {kept}, and has weighted cond(W) "
            f"{self.condition:.1f}{of_record}; "
            f"{self._least_certain}.{self.comparison}{self._bare}{self.torques} {self.not_judged}"
        )

    @property
    def _bare(self) -> str:
        """Sentence on the parameters without value; "" if there are none."""
        bare = self.known.without_values
        if not bare:
            return ""
        named = ", ".join(bare[: LIMIT.SIGMAS_NAMED])
        more = f" and {len(bare) - LIMIT.SIGMAS_NAMED} more" * (len(bare) > LIMIT.SIGMAS_NAMED)
        return (
            f" The robot file has no values of {named}{more}: the search left them out; a record "
            "gives their sizes."
        )

    @property
    def not_judged(self) -> str:
        """Sentence on what the search does not know: collisions and cables."""
        beyond = " other than of the stated spheres" if self.settings.pairs else ""
        return (
            f"Collisions{beyond} and cables were not judged: try the motion in a simulation, then "
            "slowly on the robot."
        )

    @property
    def _least_certain(self) -> str:
        """Words on the parameter with the largest %sigma among the parameters that can be
        distinguished from zero.
        """
        told = {name: x for name, x in self.relative_sigma.items() if 1.96 * x < 100}
        if not told:
            return "the 95 % interval of every parameter contains zero"
        worst = max(told, key=told.__getitem__)
        more = len(self.relative_sigma) - len(told)
        zero = f"; the 95 % intervals of {more} others contain zero" if more else ""
        return f"least certain is {worst} with a predicted %sigma of {told[worst]:.2g}{zero}"

    def summary(self) -> dict[str, Any]:
        """Return all numbers of the result as JSON values, for the file excitation.json."""
        return {
            "robot": self.model.NAME,
            "parameters_from": self.known.source,
            "duration": self.motion.duration,
            "cond": self.condition,
            "cond_of_record": self.known.condition,
            "relative_sigma": self.relative_sigma,
            "relative_sigma_of_record": self.known.relative_sigma,
            "worse_than_record": self.worse,
            "torque_sigma": self.known.weights.s.tolist(),
            "limits": {
                "q": np.column_stack([self.limits.lower, self.limits.upper]).tolist(),
                "qd": self.limits.qd.tolist(),
                "qdd": self.limits.qdd.tolist(),
            },
            "assumed": self.limits.assumed,
            "limits_used": self.usage,
            "margin": self.margin,
            "starts": [
                {
                    "number": s.number,
                    "criterion": s.criterion,
                    "violation": s.violation,
                    "message": s.message,
                }
                for s in self.starts
            ],
            "settings": to_mapping(self.settings),
        }

    def sigma_table(self, most: int | None = None) -> Table:
        """Make a table of the predicted %sigma of the least certain parameters. The table has at
        most `most` parameters.

        If there is a record, a second column gives the %sigma of the recorded motion.
        """
        before = self.known.relative_sigma
        worst = sorted(self.relative_sigma.items(), key=lambda item: -item[1])[:most]
        rows = [
            (name, *(percentage(x, x, ".3g") for x in (value, *([before[name]] if before else ()))))
            for name, value in worst
        ]
        note = (
            f"Parameters and torque deviations: {self.known.source}. Torque noise is taken as "
            "white at the sampling rate; model error is not."
        )
        return Table(
            "Predicted %sigma",
            ("parameter", "this motion", *(("motion of the record",) if before else ())),
            rows,
            note,
        )

    def usage_table(self) -> Table:
        """Make a table of the largest share of each limit that the motion uses, %, by joint."""
        rows = [(what, *(f"{100 * x:.1f}" for x in shares)) for what, shares in self.usage.items()]
        note = "At the controller rate. 100 is the limit; the optimiser keeps a margin."
        return Table(
            "Share of the limits used, %",
            ("", *(f"joint {j}" for j in joint_labels(self.model))),
            rows,
            note,
        )

    def starts_table(self) -> Table:
        """Make a table of all starts: criterion, constraint violation, message of the optimiser."""
        rows = [
            (str(s.number), f"{s.criterion:.4g}", f"{s.violation:.1e}", s.message)
            for s in self.starts
        ]
        return Table("Starts", ("start", "criterion", "violation", "end"), rows)

    def to_table(self) -> str:
        """Write the verdict, the least certain parameters and the use of the limits as text."""
        return "\n\n".join(
            [
                self.verdict,
                *filter(None, [self.limits.assumed]),
                *(
                    f"{table.caption}\n{table.to_text()}"
                    for table in (self.sigma_table(LIMIT.SIGMAS_LISTED), self.usage_table())
                ),
            ]
        )


def _percent(relative: float) -> str:
    """Write a %sigma for a sentence; words if the 95 % interval contains zero."""
    return f"{relative:.2g} %" if 1.96 * relative < 100 else "not told from zero"
