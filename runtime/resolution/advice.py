"""What the resolution advisor answers: steps, curves, sampled confirmation, and the verdict in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.special import stdtrit

from runtime.estimators.estimate import Estimate, json_text
from runtime.resolution.result import CONFIDENCE, DECIDING, Level, deciding_names
from runtime.table import aligned

Array = np.ndarray

AGREED = 0.3
"""Relative difference of predicted and sampled %e that passes as agreement: 15 % in Delta, as %e grows with its square."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """CESTAC at one step: change of the mean of `runs` estimates in %, signed, and half width of its Student interval; shape (b,) each."""

    delta: float
    runs: int
    change: Array
    half_width: Array


def sampled(delta: float, X: Array, reference: Array) -> Sampled:
    """Eqs. (18), (21) of the estimates X, shape (runs, b)."""
    N = len(X)
    half = float(stdtrit(N - 1, (1 + CONFIDENCE) / 2)) / np.sqrt(N)
    with np.errstate(divide="ignore", invalid="ignore"):
        return Sampled(delta, N, 100 * (X.mean(axis=0) / reference - 1), 100 * half * X.std(axis=0, ddof=1) / np.abs(reference))


@dataclass(frozen=True, eq=False)
class Limit:
    """Where %e reaches `percent`: the step, rad or m, and the parameter that gets there first; inf and "" where none does.

    sampled : CESTAC at that step; None without runs.   error, half_width : %e it found for the parameter, and of its Student interval.
    """

    percent: float
    delta: float
    parameter: str
    sampled: Sampled | None = None
    error: float = float("nan")
    half_width: float = float("nan")

    @property
    def agrees(self) -> bool:
        """Sampled and predicted %e differ by no more than the interval and 30 %, which is 15 % in Delta; True without runs."""
        return self.sampled is None or abs(self.error - self.percent) <= self.half_width + AGREED * self.percent


@dataclass(frozen=True, eq=False)
class EncoderAdvice:
    """One choice of coarse encoders, the others exact.

    label : "all" or the joint.   limits : the coarsest steps.   delta : ndarray, shape (m,), steps of the curve.
    change : ndarray, shape (m, b), predicted change of the estimate in %, signed.   sampled : CESTAC at some steps of the curve.
    """

    label: str
    limits: tuple[Limit, ...]
    delta: Array
    change: Array
    sampled: tuple[Sampled, ...] = ()

    def reached(self, percent: float) -> Array:
        """Step at which the |change| of every parameter first reaches `percent`, shape (b,); nan where it does not within the curve."""
        return np.array([crossing(self.delta, np.abs(e), percent) for e in self.change.T])


@dataclass(frozen=True, eq=False)
class Advice:
    """Advice on the encoders of one robot, and on its torque sensors.

    encoders : all together first, then one at a time.   steps : %e predicted at the steps that were asked for, all encoders, shape (len(asked), b).
    torque_sigma : ndarray, shape (b,), deviation of the parameters per N m (N) of deviation of the motor torques.
    """

    names: tuple[str, ...]
    reference: Estimate
    encoders: tuple[EncoderAdvice, ...]
    asked: tuple[float, ...]
    steps: Array
    torque_sigma: Array
    assumptions: tuple[str, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def deciding(self) -> tuple[str, ...]:
        """Parameters that matter: %sigma (11) at most 10."""
        return deciding_names(self.reference)

    @property
    def unit(self) -> str:
        """m where the robot's parameters are those of prismatic joints, else rad."""
        return "m" if {self.reference.units.get(name, "") for name in self.names} & {"N*s/m", "kg"} else "rad"

    @property
    def place(self) -> str:
        """Where the encoders stand."""
        return {"joint": "at the joints", "motor": "at the motors"}[self.settings.get("cestac", {}).get("side", "joint")]

    def worst(self, step: int) -> tuple[str, float]:
        """The parameter that matters most at the step asked for, and its %e."""
        decisive = [self.names.index(name) for name in self.deciding]
        e = np.abs(self.steps[step])[decisive]
        k = int(np.argmax(e)) if len(e) else 0
        return (self.names[decisive[k]], float(e[k])) if len(e) else ("", 0.0)

    @property
    def verdict(self) -> str:
        """The answer in words."""
        first = self.encoders[0]
        parts = [self._sentence(limit, "With every encoder alike") for limit in first.limits]
        single = self.encoders[1:]
        if len(single) > 1:
            hardest = min(single, key=lambda advice: advice.limits[0].delta)
            parts.append(
                f"Of single encoders, that of joint {hardest.label} asks most: {step_text(hardest.limits[0].delta, self.unit)} for "
                f"{hardest.limits[0].percent:g} % ({hardest.limits[0].parameter or 'no parameter'})."
            )
        doubted = [f"{advice.label} at {limit.percent:g} %" for advice in self.encoders for limit in advice.limits if not limit.agrees]
        if doubted:
            parts.append(f"Sampling does not confirm the prediction for: {', '.join(doubted)}; trust the runs.")
        parts.append("Noise of the torques does not bias the estimate; it adds to sigma.")
        return " ".join(parts)

    def _sentence(self, limit: Limit, who: str) -> str:
        if not np.isfinite(limit.delta):
            return f"{who}, no step makes a parameter that matters change by {limit.percent:g} %."
        text = f"{who}, least squares changes by less than {limit.percent:g} % up to Delta = {step_text(limit.delta, self.unit)} {self.place} ({limit.parameter} first"
        if limit.sampled is not None:
            text += f"; {limit.sampled.runs} runs there gave {limit.error:.2f} +- {limit.half_width:.2f} %"
        return text + ")."

    def __str__(self) -> str:
        return self.to_table()

    def to_table(self) -> str:
        """Steps by encoder, then by parameter, then what was assumed."""
        lines: list[Sequence[str]] = [
            (
                "encoder",
                *(
                    h
                    for limit in self.encoders[0].limits
                    for h in (f"{limit.percent:g} %: Delta, {self.unit}", "", "parameter", "sampled %e")
                ),
            )
        ]
        for advice in self.encoders:
            cells = [advice.label]
            for limit in advice.limits:
                sampled = "-" if limit.sampled is None else f"{limit.error:.2f} +- {limit.half_width:.2f}"
                cells += [f"{limit.delta:.3g}", counts(limit.delta) if self.unit == "rad" else "", limit.parameter or "-", sampled]
            lines.append(tuple(cells))
        return "\n\n".join(
            [aligned(lines), aligned(self.parameter_lines()), *self.asked_lines(), "\n".join(f"- {text}" for text in self.assumptions)]
        )

    def parameter_lines(self) -> list[Sequence[str]]:
        """Header and one line per parameter: %sigma, steps of all encoders at the limits, deviation per N m of torque noise in %."""
        first = self.encoders[0]
        reached = [first.reached(limit.percent) for limit in first.limits]
        lines: list[Sequence[str]] = [
            ("parameter", "%sigma", *(f"Delta at {limit.percent:g} %" for limit in first.limits), "% per unit torque deviation")
        ]
        with np.errstate(divide="ignore", invalid="ignore"):
            added = 100 * self.torque_sigma / np.abs(self.reference.X)
        for i, name in enumerate(self.names):
            mark = "" if name in self.deciding else " *"
            steps = (f"{step[i]:.3g}" if np.isfinite(step[i]) else "-" for step in reached)
            lines.append((name + mark, f"{self.reference.relative_sigma[i]:.2f}", *steps, f"{added[i]:.3g}"))
        return lines

    def asked_lines(self) -> list[str]:
        """One line per step asked for."""
        lines = []
        for k, delta in enumerate(self.asked):
            name, e = self.worst(k)
            lines.append(f"Delta = {Level(delta).label}: largest predicted change {e:.2f} % ({name})")
        return ["\n".join(lines)] if lines else []

    def to_json(self) -> str:
        """JSON text of everything."""
        return json_text(
            {
                "schema": 1,
                "names": self.names,
                "X_LS": self.reference.X,
                "relative_sigma_LS": self.reference.relative_sigma,
                "deciding": self.deciding,
                "deciding_relative_sigma": DECIDING,
                "verdict": self.verdict,
                "encoders": [
                    {
                        "encoder": advice.label,
                        "limits": advice.limits,
                        "delta": advice.delta,
                        "change": advice.change,
                        "sampled": advice.sampled,
                        "reached": {f"{limit.percent:g}": advice.reached(limit.percent) for limit in advice.limits},
                    }
                    for advice in self.encoders
                ],
                "asked": [
                    {"delta": delta, "change": change, "worst": self.worst(k)}
                    for k, (delta, change) in enumerate(zip(self.asked, self.steps, strict=True))
                ],
                "torque_sigma": self.torque_sigma,
                "assumptions": self.assumptions,
                "settings": self.settings,
                "provenance": self.provenance,
            }
        )


def crossing(delta: Array, e: Array, percent: float) -> float:
    """First step at which e reaches `percent`, straight lines between the points of logarithmic axes; nan where it does not."""
    above = np.flatnonzero(e >= percent)
    if not len(above) or (above[0] == 0 and e[0] > percent):
        return float("nan")
    k = int(above[0])
    if k == 0:
        return float(delta[0])
    low, high = max(float(e[k - 1]), 1e-12), float(e[k])
    share = np.log(percent / low) / np.log(high / low)
    return float(delta[k - 1] * (delta[k] / delta[k - 1]) ** share)


def counts(delta: float) -> str:
    """A step as a share of a turn, such as 2*pi/5236."""
    return f"2*pi/{2 * np.pi / delta:.0f}" if 0 < delta < np.pi else ""


def step_text(delta: float, unit: str) -> str:
    """A step with its unit and, of a turn, its share, such as 9.16e-05 rad (2*pi/68626)."""
    text = counts(delta) if unit == "rad" else ""
    return f"{delta:.3g} {unit}" + (f" ({text})" if text else "")
