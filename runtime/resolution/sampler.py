"""Runs of CESTAC in which only some encoders are coarse, and what they confirm of an advice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.estimators import linear_system
from runtime.estimators.estimate import Estimate
from runtime.model.generated import GeneratedModel
from runtime.observation.filters import filtered_states
from runtime.observation.observation import Observation, observation_from_states, stack
from runtime.observation.position_errors import Perturbation
from runtime.records.record import Record
from runtime.resolution.advice import EncoderAdvice, Sampled, sampled
from runtime.resolution.rounding import rounded, stream
from runtime.settings.study import CestacSettings, EstimateSettings

Array = np.ndarray

ALL = "all"
"""Label of the advice on all encoders alike."""


@dataclass(frozen=True, eq=False)
class Sampler:
    """CESTAC runs in which only some encoders are coarse."""

    model: GeneratedModel
    records: tuple[Record, ...]
    parts: tuple[Perturbation, ...]
    settings: CestacSettings
    estimate: EstimateSettings
    constants: Mapping[str, float]
    reference: Estimate

    def confirmed(self, found: EncoderAdvice, encoders: Sequence[int]) -> EncoderAdvice:
        """The advice with runs at the steps of its limits; of all encoders, also between and above them."""
        made = {limit.delta: self.level(limit.delta, encoders) for limit in found.limits if np.isfinite(limit.delta)}
        limits = []
        for limit in found.limits:
            if limit.delta not in made:
                limits.append(limit)
                continue
            here, i = made[limit.delta], self.reference.names.index(limit.parameter)
            limits.append(replace(limit, sampled=here, error=abs(float(here.change[i])), half_width=float(here.half_width[i])))
        if found.label == ALL and made:
            low, high = min(made), max(made)
            for delta in (np.sqrt(low * high), 2 * high, 5 * high):
                made[float(delta)] = self.level(float(delta), encoders)
        return replace(found, limits=tuple(limits), sampled=tuple(made[delta] for delta in sorted(made)))

    def level(self, delta: float, encoders: Sequence[int], runs: int | None = None) -> Sampled:
        """`runs` estimates at one step; default: as many as the settings say."""
        runs = runs or self.settings.runs
        return sampled(delta, np.array([self._estimate(delta, encoders, run) for run in range(runs)]), self.reference.X)

    def _estimate(self, delta: float, encoders: Sequence[int], run: int) -> Array:
        """X_CESTAC, eq. (17)."""
        observations = [self._observed(k, delta, encoders, run) for k in range(len(self.records))]
        return linear_system(observations[0] if len(observations) == 1 else stack(observations), self.estimate).solve().X

    def _observed(self, k: int, delta: float, encoders: Sequence[int], run: int) -> Observation:
        """Record k with the chosen encoders rounded."""
        record, part = self.records[k], self.parts[k]
        own = np.linalg.solve(part.root, record.q.T).T  # positions as the encoders see them, up to their offsets
        error = np.zeros_like(own)
        for i in encoders:
            error[:, i] = rounded(own[:, i], delta, self.settings.rounding, stream(self.settings.seed, k, run, i)) - own[:, i]
        states = filtered_states(record.q + error @ part.root.T, record.rate, part.selection.signals)
        return observation_from_states(
            self.model, states, part.torque, part.selection, columns=self.reference.names, constants=self.constants
        )
