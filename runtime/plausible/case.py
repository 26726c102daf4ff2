"""What the checks of one study read, each part made once, when a check first asks for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from runtime.core.errors import InputError
from runtime.core.limits import LIMIT
from runtime.core.model import GeneratedModel, joint_labels, joint_units
from runtime.core.record import Record
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import Prepared, stacked
from runtime.core.signals.cutoff import noise_share
from runtime.core.study import Study
from runtime.physical.inertia import PhysicalModel, physical_model
from runtime.plausible.bodies import Grams
from runtime.plausible.delay import Delay, delay_of
from runtime.plausible.known import KnownValues, known_values
from runtime.plausible.samples import Filtered, Samples, excerpts, samples_of
from runtime.plausible.trials import Baseline, baseline_of, regressor

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Case:
    """Records, study and robot file.

    Attributes
    ----------
    model : GeneratedModel
    given : sequence of Prepared
        Records, or excerpts of long ones, as they were read.
    straight : sequence of Prepared
        The same, counts that start anew unwrapped.
    study : Study
    through : sequence of Filtered
        The records through a low-pass of their motion.
    samples : Samples
        Of all records.
    D : ndarray, shape (K, n, b)
        Regressor at the samples.
    variants : GeneratedModel or None
        The module of `symgen.variants`.
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
        """The records themselves, positions unwrapped."""
        return [one.record for one in self.straight]

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Labels of the joints in results."""
        return joint_labels(self.model)

    @cached_property
    def units(self) -> list[str]:
        """Units of the positions, by joint."""
        return list(joint_units(self.model))

    def grams(self, mask: Array) -> Grams:
        """Normal equations of the samples of a mask, bool (K, n)."""
        tau = self.samples.tau
        return Grams.of(self.D, tau - self.samples.tau_known, mask, tau)

    @property
    def turning(self) -> Array:
        """Whether each joint turns, (n,)."""
        return np.array([unit == "rad" for unit in self.units])

    def limits(self, key: str, *shape: int) -> Array | None:
        """Limits of each joint by the robot file, shape (n, *shape); None if it has none."""
        given = np.asarray(dict(getattr(self.model, "LIMITS", {}) or {}).get(key, ()), dtype=float)
        return given if given.shape == (self.samples.n, *shape) else None

    def joints(self, chosen: Array) -> str:
        """Labels of the joints of a mask."""
        return ", ".join(self.labels[j] for j in np.flatnonzero(chosen))

    def reaching(self, values: Array, units: Sequence[str], chosen: Array) -> str:
        """They reach these values, with their units: the joints of a mask, or else the largest."""
        shown = np.flatnonzero(chosen)[:4] if chosen.any() else [int(np.argmax(values))]
        each = (f"{values[j]:.3g} {units[j]} (joint {self.labels[j]})" for j in shown)
        return f"They reach {', '.join(each)}"

    @cached_property
    def observation(self) -> Observation | None:
        """Rows of the study; None if none is used, or counts cannot be read."""
        try:
            return stacked(self.model, self.given)
        except (InputError, np.linalg.LinAlgError):
            return None

    @cached_property
    def physical(self) -> PhysicalModel | None:
        """Conditions of a physical robot; None if the model has no standard parameters."""
        try:
            return physical_model(self.model)
        except InputError:
            return None

    @property
    def silent(self) -> str:
        """Why no cause is tried; "" if the samples allow it."""
        return self.unfit or self.few

    @cached_property
    def few(self) -> str:
        """Why the samples are too few to try causes; gravity of the values needs no motion."""
        rows = self.samples.moving().sum(axis=0)
        least = LIMIT.ROWS_PER_PARAMETER * len(self.model.BASE_PARAMETERS)
        few = int(rows.sum()) <= least or int(rows.min()) <= LIMIT.FEWEST_ROWS
        return "too few samples at which every joint moves" if few else ""

    @cached_property
    def unfit(self) -> str:
        """Why nothing can be fitted, however many samples there are."""
        if self.physical is None:
            return "the model has no standard parameters"
        if self.samples.constant().any():
            return "a torque never changes"
        if (passive := self.samples.without_motor()).any():
            return f"joint {self.joints(passive)} has no motor: its torque is zero throughout"
        return ""

    @cached_property
    def sides(self) -> tuple[str, str]:
        """Sides of positions and torques in the files; law for torques that a controller's law gives."""
        settings: Any = self.study
        q, tau = settings.record[0].sides if settings.record else ("joint", "joint")
        return q, "law" if any(record.origin.by_law for record in self.records) else tau

    @cached_property
    def baseline(self) -> Baseline | None:
        """The study as it is, fitted; None if nothing is fitted."""
        return None if self.silent else self._baseline(values=True)

    @cached_property
    def validation(self) -> Baseline | None:
        """The rows of the validation records, for the fits of `baseline`; None if there are none."""
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
        """The same without the values of the robot file."""
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
        """Torque of the values of the robot file, if it has them."""
        if self.unfit:
            return None
        baseline = self.baseline or self._baseline(values=True)
        return known_values(baseline) if baseline and baseline.bodies.near_values else None

    @cached_property
    def noise_floor(self) -> float:
        """Error of a joint, %, that noise of the positions may make: NOISE_MADE sqrt(a), a the largest share of an acceleration that is noise.
        As much of a torque may be lost in the columns, and a cause may find it again.
        """
        median = self.study.signals.median
        shares = [noise_share(x.record.q, x.record.rate, x.low, median) for x in self.through]
        return float(100 * LIMIT.NOISE_MADE * np.sqrt(np.max(shares)))

    @cached_property
    def late(self) -> Delay | None:
        """Delay of the torques of the longest record; None if it is too short."""
        through = max(self.through, key=lambda one: len(one.record))
        t = through.record.t
        try:
            return delay_of(self.model, through, min(LIMIT.LONGEST_DELAY, float(t[-1] - t[0]) / 20))
        except (InputError, ValueError):
            return None
