"""Data for the plausibility checks of one study.

Most of these data are computed only when a check first needs them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from runtime.core.model import GeneratedModel, joint_labels, joint_units
from runtime.core.record import Record
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import Prepared, stacked
from runtime.core.signals.cutoff import noise_share
from runtime.core.study import Study
from runtime.ground.errors import InputError, MemoryTooSmallError
from runtime.ground.limits import limits
from runtime.physical.inertia import PhysicalModel, physical_model
from runtime.plausible.bodies import Grams
from runtime.plausible.delay import Delay, delay_of
from runtime.plausible.known import KnownValues, known_values
from runtime.plausible.samples import Filtered, Samples, excerpts, samples_of
from runtime.plausible.trials import Baseline, baseline_of, regressor

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Case:
    """Records, settings (study) and robot model of one identification, prepared for the checks.

    Attributes
    ----------
    model : GeneratedModel
    given : sequence of Prepared
        Records as they were read; of a long record, some excerpts.
    straight : sequence of Prepared
        The same records; with reader counts, a counter that wraps around is made continuous.
    study : Study
    through : sequence of Filtered
        The same records, filtered by a low-pass that is chosen by their motion.
    samples : Samples
        Selected instants of all records.
    D : ndarray, shape (K, n, b)
        Regressor at the samples.
    variants : GeneratedModel or None
        The module that `symgen.variants` makes: entries of the table of frames are arguments.
    unseen : sequence of Prepared
        Validation records of the study.
    """

    model: GeneratedModel
    given: Sequence[Prepared]
    straight: Sequence[Prepared]
    study: Study
    through: Sequence[Filtered]
    samples: Samples
    D: Array
    variants: GeneratedModel | None
    unseen: Sequence[Prepared] = ()

    @property
    def records(self) -> list[Record]:
        """Records of the study, in which encoder counters that wrap around are made continuous."""
        return [one.record for one in self.straight]

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Labels of the joints, as the results show them."""
        return joint_labels(self.model)

    @cached_property
    def units(self) -> list[str]:
        """Units of the joint positions: rad or m, one for each joint."""
        return list(joint_units(self.model))

    def grams(self, mask: Array) -> Grams:
        """Form the least-squares normal equations of the samples in `mask`, bool (K, n)."""
        tau = self.samples.tau
        return Grams.of(self.D, tau - self.samples.tau_known, mask, tau)

    @property
    def turning(self) -> Array:
        """Whether each joint is revolute, bool (n,)."""
        return np.array([unit == "rad" for unit in self.units])

    def limits(self, key: str, *shape: int) -> Array | None:
        """Read the limits of q, qd, qdd or tau (`key`) of each joint from the robot file.

        Return an array of shape (n, *shape), or None if the file does not give limits of this
        shape.
        """
        given = np.asarray(dict(getattr(self.model, "LIMITS", {}) or {}).get(key, ()), dtype=float)
        return given if given.shape == (self.samples.n, *shape) else None

    def joint_labels(self, chosen: Array) -> str:
        """List the labels of the joints that the mask `chosen` selects, separated by commas."""
        return ", ".join(self.labels[j] for j in np.flatnonzero(chosen))

    def reaching(
        self, values: Array, units: Sequence[str], chosen: Array, limits: Array | None = None
    ) -> str:
        """Write the values that the selected joints reach, such as "Largest values: 3 rad (joint 2)".

        At most four joints are named, with their limits: "(joint 2, limit 1)". If the mask selects
        none, the joint with the largest value is named, without its limit.
        """
        shown = np.flatnonzero(chosen)[:4] if chosen.any() else [int(np.argmax(values))]
        limit = [""] * len(values)
        if limits is not None and chosen.any():
            limit = [f", limit {x:.3g}" for x in limits]
        each = (f"{values[j]:.3g} {units[j]} (joint {self.labels[j]}{limit[j]})" for j in shown)
        return f"Largest values: {', '.join(each)}"

    @cached_property
    def observation(self) -> Observation | None:
        """Observation matrix W and torques Y of all records, with the study as given.

        The result is None if they cannot be computed, for instance if no row is left. Raises
        MemoryTooSmallError if they do not fit into the memory.
        """
        try:
            return stacked(self.model, self.given)
        except MemoryTooSmallError:
            raise
        except (InputError, np.linalg.LinAlgError):
            return None

    @cached_property
    def physical(self) -> PhysicalModel | None:
        """Conditions that the parameters of a physical robot satisfy, such as positive masses.

        The value is None if the model has no standard parameters.
        """
        try:
            return physical_model(self.model)
        except InputError:
            return None

    @property
    def silent(self) -> str:
        """Reason why no search for errors of the study is possible; an empty string if it is
        possible.
        """
        return self.unfit or self.few

    @cached_property
    def few(self) -> str:
        """Remark that too few samples remain to search for errors of the study; "" if there are
        enough.

        Too few samples do not prevent the check of the robot file's values, because gravity needs
        no motion.
        """
        rows = self.samples.moving().sum(axis=0)
        least = LIMIT.ROWS_PER_PARAMETER * len(self.model.BASE_PARAMETERS)
        few = int(rows.sum()) <= least or int(rows.min()) <= LIMIT.FEWEST_ROWS
        return "too few samples at which every joint moves" if few else ""

    @cached_property
    def unfit(self) -> str:
        """Reason why no model can be fitted, for instance a torque that never changes.

        The text is empty if a model can be fitted.
        """
        if self.physical is None:
            return "the model has no standard parameters"
        if self.samples.constant().any():
            return "a torque never changes"
        if (passive := self.samples.without_motor()).any():
            return f"joint {self.joint_labels(passive)} has no motor: its torque is zero throughout"
        return ""

    @cached_property
    def sides(self) -> tuple[str, str]:
        """Sides at which the files give positions and torques: "joint", "motor" or "link" for each.

        The side of the torques is "law" if the control law of a controller computed them.
        """
        q, tau = self.records[0].sides
        return q, "law" if any(record.origin.by_law for record in self.records) else tau

    @cached_property
    def column_units(self) -> dict[str, tuple[str, ...]]:
        """Units of the columns q and tau in the files, one for each joint; {} if records differ."""
        settings: Any = self.study
        given = {(one.units.q, one.units.tau) for one in settings.record} or {("rad", "N*m")}
        if len(given) > 1:
            return {}
        q, tau = (
            (unit,) * self.samples.n if isinstance(unit, str) else unit for unit in given.pop()
        )
        # the default rad of a prismatic joint is read as m
        q = tuple(axis if unit == "rad" else unit for axis, unit in zip(self.units, q, strict=True))
        return {"q": q, "tau": tau}

    @cached_property
    def baseline(self) -> Baseline | None:
        """Reference fit: the records are fitted with unchanged settings of the study.

        The value is None if nothing can be fitted.
        """
        return None if self.silent else self._baseline(values=True)

    @cached_property
    def validation(self) -> Baseline | None:
        """Reference fit `baseline`, prepared to predict the torques of the validation records.

        The value is None if there are no validation records, or if they cannot be used.
        """
        if self.baseline is None or not self.unseen:
            return None
        try:
            samples = samples_of(
                [part for one in self.unseen for part in excerpts(one)], self.study
            )
            D = regressor(self.model, (samples.q, samples.qd, samples.qdd))
        except (InputError, ValueError):  # too short, or a loop that does not close
            return None
        return replace(self.baseline, samples=samples, D=D)

    @cached_property
    def alone(self) -> Baseline | None:
        """Reference fit without a penalty on the distance from the robot file's inertial values.

        If the file has no values, this is the fit `baseline`.
        """
        if self.baseline is None or self.robot_values is None:
            return self.baseline
        return self._baseline(values=False)

    def _baseline(self, *, values: bool) -> Baseline:
        return baseline_of(
            self.model,
            self.samples,
            self.D,
            self.variants,
            torque_side=self.sides[1],
            values=values,
        )

    @cached_property
    def robot_values(self) -> KnownValues | None:
        """Comparison of torques computed from the robot file's values with measured torques.

        The value is None if the file has no values, or if nothing can be fitted.
        """
        if self.unfit:
            return None
        baseline = self.baseline or self._baseline(values=True)
        if not baseline.bodies.near_values:
            return None
        known = known_values(baseline, rotors=self.sides[1] != "link")
        return known.without_inertia() if known and self.coarse else known

    @property
    def coarse(self) -> bool:
        """Whether noise of the positions hides the accelerations, as steps of coarse encoders do."""
        return bool(self.noise_floor > LIMIT.COARSE)

    @cached_property
    def noise_floor(self) -> float:
        """Relative torque error that noise of the positions alone may cause, %.

        The floor is 100 NOISE_MADE sqrt(a), with a the largest share of noise in the power of an
        acceleration. Errors below this floor are no evidence for a cause.
        """
        median = self.study.signals.median
        shares = [noise_share(x.record.q, x.record.rate, x.low, median) for x in self.through]
        return float(100 * LIMIT.NOISE_MADE * np.sqrt(np.max(shares)))

    @cached_property
    def late(self) -> Delay | None:
        """Estimated delay of the torques relative to the positions, in the longest record.

        The value is None if the delay cannot be estimated, for instance because the record is too
        short.
        """
        through = max(self.through, key=lambda one: len(one.record))
        t = through.record.t
        try:
            return delay_of(self.model, through, min(LIMIT.LONGEST_DELAY, float(t[-1] - t[0]) / 20))
        except (InputError, ValueError):
            return None
