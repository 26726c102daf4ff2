"""Essential parameters: the few that explain the torques nearly as well as all (chapter, 4.1.1).

The parameter with the largest %sigma, eq. (11), is removed and the rest is fitted again, as long as
sigma_rho, eq. (9), stays below threshold times its first value. To remove a parameter, its column
is deleted from the triangular factor of W, and the trailing block is made triangular again; W is
not used. The same sequence of removals, continued to its end, gives the number of parameters for
every other threshold. With weights, the weights of the first fit stay.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import System, assemble, standard_deviations
from runtime.core.model import GeneratedModel
from runtime.core.study import EssentialSettings
from runtime.ground.documents import Result
from runtime.ground.limits import LIMIT
from runtime.ground.table import aligned, percentage

THRESHOLDS = (1.02, 1.03, 1.04, 1.05, 1.06, 1.07, 1.08, 1.09, 1.10)
"""Thresholds whose counts are reported beside the one used."""


@dataclass(frozen=True)
class Removal:
    """One elimination step: the parameter with the largest %sigma, and whether it was removed.

    Attributes
    ----------
    name : str
        Parameter with the largest %sigma.
    relative_sigma : float, %
        Its %sigma.
    ratio : float
        sigma_rho without this parameter over the first sigma_rho.
    removed : bool
        Whether the parameter was removed.
    """

    name: str
    relative_sigma: float
    ratio: float
    removed: bool


@dataclass(frozen=True, eq=False)
class Essential(Result):
    """The essential parameters, and the elimination that found them.

    Attributes
    ----------
    names : tuple of str
        Parameters that were not removed, in column order.
    estimate : Estimate
        Fit with the essential parameters alone.
    all_parameters : Estimate
        Fit with all parameters.
    trail : tuple of Removal
        Steps of the elimination. The last one is the first refused step, if a step was refused.
    threshold : float
        Largest ratio of sigma_rho to its first value.
    counts : mapping of float to int
        Number of parameters left, by threshold.
    further : tuple of Removal
        The next steps, up to the largest threshold.
    """

    names: tuple[str, ...]
    estimate: Estimate
    all_parameters: Estimate
    trail: tuple[Removal, ...]
    threshold: float
    counts: Mapping[float, int]
    further: tuple[Removal, ...] = ()

    @property
    def removed(self) -> tuple[str, ...]:
        """Names of the removed parameters, in the order of their removal."""
        return tuple(step.name for step in self.trail if step.removed)

    def to_table(self) -> str:
        """Write a table of the removed parameters, then the number left at each threshold value."""
        first = len(self.all_parameters.names)
        lines: list[Sequence[str]] = [("removed", "left", "%sigma", "sigma_rho ratio")]
        for k, step in enumerate(self.trail):
            name = step.name if step.removed else f"{step.name} (kept)"
            lines.append(
                (
                    name,
                    str(first - k - step.removed),
                    percentage(step.relative_sigma, step.relative_sigma, ".3f"),
                    f"{step.ratio:.5f}",
                )
            )
        counts = ", ".join(f"{threshold:.2f}: {count}" for threshold, count in self.counts.items())
        return (
            f"{len(self.names)} of {first} parameters at threshold "
            f"{self.threshold}\n\n{aligned(lines)}\n\nparameters kept by threshold  {counts}"
        )

    def summary(self) -> dict[str, Any]:
        """Return names, threshold and steps of the elimination as a mapping, for JSON."""
        return {
            "schema": 1,
            "names": self.names,
            "threshold": self.threshold,
            "trail": self.trail,
            "further": self.further,
            "counts": {f"{k:g}": v for k, v in self.counts.items()},
        }


def essential_of(
    system: System,
    settings: EssentialSettings | None = None,
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Essential:
    """Find the essential parameters of a system Y = W X + rho (chapter, section 4.1.1).

    Parameters
    ----------
    system : System
        Y = W X + rho, as least squares weighs its rows.
    settings : EssentialSettings, optional
        Threshold on sigma_rho.
    model : GeneratedModel, optional
        Model that gives units, joint numbers and the hash of the robot file.
    provenance : mapping, optional
        Further entries for Estimate.provenance.
    """
    settings = settings or EssentialSettings()
    wanted = sorted({*THRESHOLDS, settings.threshold})
    steps = _trail(system, wanted[-1])
    removed = {threshold: _removals(steps, threshold) for threshold in wanted}
    accepted = removed[settings.threshold]
    trail = tuple(replace(step, removed=k < accepted) for k, step in enumerate(steps))
    gone = {step.name for step in trail if step.removed}
    kept = tuple(name for name in system.names if name not in gone)
    reduced = system.select(kept)
    return Essential(
        names=kept,
        estimate=assemble(reduced, reduced.solve(), model=model, provenance=provenance),
        all_parameters=assemble(system, system.solve(), model=model, provenance=provenance),
        trail=trail[: accepted + 1],
        threshold=settings.threshold,
        counts={threshold: len(system.names) - count for threshold, count in removed.items()},
        further=trail[accepted + 1 :],
    )


def _removals(steps: Sequence[Removal], threshold: float) -> int:
    """Count the removals for which sigma_rho stays below `threshold` times its first value."""
    return next((k for k, step in enumerate(steps) if not step.ratio < threshold), len(steps))


def _trail(system: System, threshold: float) -> list[Removal]:
    """Remove the parameter with the largest %sigma, fit again, and repeat; return these removals.

    The removals end when the ratio of sigma_rho to its first value reaches `threshold`, or with one
    parameter left. A Removal has %sigma before the removal and the ratio after the removal.
    """
    steps: list[Removal] = []
    fit = system.solve()
    first, C = standard_deviations(system, fit)
    while len(system.names) > 1 and np.isfinite(first):
        relative = _relative(C, fit.X)
        worst = system.names[int(np.argmax(relative))]
        system = system.drop(worst)
        fit = system.solve()
        sigma_rho, C = standard_deviations(system, fit)
        ratio = sigma_rho / first if first > 0 else (1.0 if sigma_rho == 0 else np.inf)
        steps.append(Removal(worst, float(relative.max()), float(ratio), False))
        if ratio >= threshold:
            break
    return steps


def _relative(C: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Compute the relative standard deviations %sigma, shape (b,), from covariance C and values X.

    %sigma is inf if the record does not determine the parameter, which is therefore removed first.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = 100 * np.sqrt(np.diag(C)) / np.abs(X)
    return np.where(np.isnan(relative), np.inf, relative)


def lost_joints(estimate: Estimate, fit: Estimate) -> str:
    """Name the joints whose torques fit badly because parameters were removed, and give a remedy.

    Return "" if there are none.

    Such joints occur because the threshold of the essential parameters uses ||Y - W X|| of all
    joints. Without weights this norm mostly depends on the joint with the largest forces, such as a
    lift in N next to a wrist in N m.
    """
    if len(fit.names) == len(estimate.names):
        return ""
    whole = {joint.joint: joint.relative_error for joint in estimate.per_joint}
    lost = [
        joint
        for joint in fit.per_joint
        if joint.relative_error > max(LIMIT.LOST_JOINT, 2 * whole.get(joint.joint, np.inf))
    ]
    if not lost:
        return ""
    weighted = any(joint.scale != 1.0 for joint in estimate.per_joint)
    remedy = (
        "lower essential.threshold"
        if weighted
        else "weigh the joints by their noise (estimate: {method: wls})"
    )
    by_all = " and ".join(f"{whole[joint.joint]:.1f} % of joint {joint.joint}" for joint in lost)
    by_essential = " and ".join(f"{joint.relative_error:.1f} %" for joint in lost)
    return (
        f"all parameters leave {by_all} unexplained, the essential ones {by_essential}: "
        f"parameters with small torques were removed because other joints have large forces; {remedy}"
    )
