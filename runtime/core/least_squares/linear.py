"""Linear least-squares estimates from the QR factor of Y = W X + rho: X, rank and statistics.

All numbers, eqs. (7)-(11) of the chapter, are computed from triangular factors. A System is the
rows as a method weighs them. Ordinary least squares leaves them as they are; weighted least squares
divides the rows of joint j by s_j. Removing columns from a System costs little, on which
`runtime.core.essential` relies; weights do not change when columns are removed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from runtime.core.least_squares.block_covariance import corrected_deviations
from runtime.core.least_squares.estimate import Estimate, JointFit, Status
from runtime.core.least_squares.solution import Solution, solve
from runtime.core.model import GeneratedModel, joint_labels
from runtime.core.provenance import versions
from runtime.core.rows.factor import Array, Factor
from runtime.core.rows.observation import Observation
from runtime.core.study import EstimateSettings
from runtime.ground.errors import SettingsError
from runtime.ground.settings import Count, Positive, Settings, to_mapping


class LinearOptions(Settings):
    """Options of the methods ols and wls (estimate.options), and of methods that start from them.

    Attributes
    ----------
    rank_tolerance : float or None
        Smallest s_i/s_1 with unit columns that counts as rank; default: the rounding of the rows.
    block : float or None, s
        Length of the blocks of residuals behind `sigma_corrected`; default: that of the rows.
    passes : int
        Largest number of passes if weights are found by iteration.
    """

    rank_tolerance: Positive | None = None
    block: Positive | None = None
    passes: Count = 50


@dataclass(frozen=True)
class System:
    """One system Y = W X + rho, stored as QR factors before and after weighting of its rows.

    Attributes
    ----------
    observation : Observation
        The rows, all columns.
    settings : EstimateSettings
        Method, weights, columns, options.
    raw : Factor
        Factor of [W Y] with the remaining columns.
    weighted : Factor
        Factor of the weighted system, which is solved, with the same columns.
    scales : tuple of float, N m or N
        s_j of each joint, by which its rows are divided; 1 without weights.
    row_covariance : ndarray, shape (n, n), or None
        Covariance of the torques of one instant, by which its rows are whitened in place of the
        scales.
    known_variance : bool
        Whether the rows of the weighted system have variance 1: then C = (W'W)^-1, else
        C = sigma_rho^2 (W'W)^-1.
    iterations : int
        Number of passes that found the weights.
    status, message : str
        As in an Estimate.
    options : LinearOptions
    """

    observation: Observation
    settings: EstimateSettings
    raw: Factor
    weighted: Factor
    scales: tuple[float, ...]
    row_covariance: Array | None = None
    known_variance: bool = False
    iterations: int = 0
    status: Status = "ok"
    message: str = ""
    options: LinearOptions = field(default_factory=LinearOptions)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters whose columns remain in the system."""
        return self.raw.names

    def select(self, names: Sequence[str]) -> System:
        """Return the same system with only the columns of W for the parameters `names`."""
        return self._changed(lambda factor: factor.select(names))

    def drop(self, name: str) -> System:
        """Return the system without the column of parameter `name`, from its triangular factor."""
        return self._changed(lambda factor: factor.drop(name))

    def _changed(self, change: Callable[[Factor], Factor]) -> System:
        raw = change(self.raw)
        return replace(
            self, raw=raw, weighted=raw if self.weighted is self.raw else change(self.weighted)
        )

    def solve(self) -> Solution:
        """Compute the least-squares solution of the weighted system."""
        return solve(self.weighted, self.options.rank_tolerance)

    def norms(self, X: Array) -> tuple[Array, Array]:
        """Compute ||Y_j - W_j X|| and ||Y_j|| of every joint, without weights, shape (n,) each."""
        joints = self.raw.joints
        residual = np.array([joint.residual_norm(X) for joint in joints])
        return residual, np.array([joint.measured_norm for joint in joints])

    @property
    def block(self) -> float:
        """Length, s, of the time blocks from which corrected standard deviations are computed."""
        return self.options.block or self.observation.residual_block

    def block_rows(self) -> Iterator[Array]:
        """Yield the weighted rows [W Y] of every block of time, shape (rows, b + 1)."""
        return self.observation.block_rows(
            self.names, 1 / np.array(self.scales), self.block, self.row_covariance
        )

    def band_rows(self, X: Array) -> Iterator[Iterator[Array]]:
        """Yield the weighted rows [W Y] band by band, for each kind of band (`Observation.bands`).

        Each band has the shape (rows, b + 1); the bands of load use the torques W X.
        """
        return self.observation.band_rows(
            self.names, 1 / np.array(self.scales), X, self.row_covariance
        )


def ordinary(
    observation: Observation, settings: EstimateSettings, options: LinearOptions
) -> System:
    """Make the system of ordinary least squares: all rows Y = W X + rho with equal weight.

    X = argmin ||Y - W X||,    C = sigma_rho^2 (W'W)^-1,    sigma_rho^2 = ||Y - W X||^2 / (r - b)

    Raise SettingsError if `settings` names a column that the observation lacks.
    """
    names = observation.names if settings.columns == "all" else tuple(settings.columns)
    if unknown := [name for name in names if name not in observation.names]:
        message = f"no parameter {', '.join(unknown)}; the model has {', '.join(observation.names)}"
        raise SettingsError(message, path=("estimate", "columns"))
    raw = observation.factor if names == observation.names else observation.factor.select(names)
    return System(observation, settings, raw, raw, (1.0,) * observation.n, options=options)


def standard_deviations(system: System, fit: Solution) -> tuple[float, Array]:
    """Compute sigma_rho, eq. (9), and the covariance C of X, eq. (10), shape (b, b).

    C is nan for undetermined parameters.
    """
    freedom = system.weighted.rows - fit.rank
    sigma_rho = fit.residual_norm / np.sqrt(freedom) if freedom > 0 else np.nan
    C = fit.T @ fit.T.T * (1.0 if system.known_variance else sigma_rho**2)
    lost = _undetermined(system, fit)
    C[lost], C[:, lost] = np.nan, np.nan
    return float(sigma_rho), C


def assemble(
    system: System,
    fit: Solution,
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
    corrected: bool = True,
) -> Estimate:
    """Make the Estimate of a solved system: parameters, statistics, and the fit of every joint.

    model : gives units, names of the joints and the hash of the robot file.
    corrected : whether to compute `sigma_corrected`, most of the time of a long record; else nan.
    """
    observation, names = system.observation, system.names
    sigma_rho, C = standard_deviations(system, fit)
    deviations = np.full(len(names), np.nan)  # as without redundancy
    if corrected and system.raw.rows > len(names):
        blocks, bands = system.block_rows(), system.band_rows(fit.X)
        deviations = corrected_deviations(blocks, bands, fit.X, fit.T)
    deviations[_undetermined(system, fit)] = np.nan
    norms, measured = system.norms(fit.X)
    share = 1 - fit.rank / system.raw.rows
    per_joint = tuple(
        JointFit(
            label,
            rows,
            norm,
            percent(norm, of),
            float(norm / np.sqrt(rows * share)) if share > 0 and rows else np.nan,
            scale,
        )
        for label, rows, norm, of, scale in zip(
            labels_of(model, observation.n),
            [joint.rows for joint in system.raw.joints],
            norms.tolist(),
            measured.tolist(),
            system.scales,
            strict=True,
        )
    )
    status, message = outcome(system, fit)
    return Estimate(
        names=names,
        X=fit.X,
        sigma=np.sqrt(np.diag(C)),
        covariance=C,
        sigma_corrected=deviations,
        sigma_rho=sigma_rho,
        cond=condition(system.weighted, fit.rank),
        cond_unit=fit.cond_unit,
        rank=fit.rank,
        residual_norm=float(np.linalg.norm(norms)),
        relative_error=percent(norms, measured),
        per_joint=per_joint,
        method=system.settings.method,
        status=status,
        message=message,
        groups=fit.groups,
        iterations=system.iterations,
        settings={
            **observation.settings,
            "estimate": to_mapping(system.settings),
            "residual_block": system.block,
        },
        provenance={**describe(observation, model), **(provenance or {})},
        units=dict(getattr(model, "UNITS", {})),
    )


def labels_of(model: GeneratedModel | None, n: int) -> tuple[str, ...]:
    """Return the names of the joints in results; without a model, their numbers from 1."""
    return tuple(map(str, range(1, n + 1))) if model is None else joint_labels(model)


def condition(factor: Factor, rank: int) -> float:
    """Compute the condition number of W from its triangular factor; inf if W is rank-deficient."""
    b = len(factor.names)
    return (float(np.linalg.cond(factor.R11)) if b else 1.0) if rank == b else np.inf


def outcome(system: System, fit: Solution) -> tuple[Status, str]:
    """Return the status of a solution, such as "rank-deficient", and the text that explains it."""
    b = len(system.names)
    if fit.rank < b:
        silent = [group[0] for group in fit.groups if len(group) == 1]
        mixed = ["(" + ", ".join(group) + ")" for group in fit.groups if len(group) > 1]
        parts = [
            (
                f"The {system.weighted.rows} rows of this record have rank {fit.rank} for {b} "
                "parameters (unit columns)."
            )
        ]
        if silent:
            parts.append(f"No effect on these rows: {', '.join(silent)}.")
        if mixed:
            parts.append(
                f"Cannot be separated: {'; '.join(mixed)}; the values given are those of least "
                "norm, and only their combined effect has a meaning."
            )
        parts.append(
            "Likely causes: a motion that does not excite them (a joint at rest, one "
            "configuration, constant velocity), or columns that are not base parameters of this "
            "robot. Use a richer motion, or remove one parameter of "
            "each group (estimate.columns)."
        )
        return "rank-deficient", " ".join(parts)
    if system.weighted.rows <= b:
        return "no-redundancy", (
            f"{system.weighted.rows} rows for {b} parameters: the fit is exact whatever the noise "
            "and no uncertainty can be stated. "
            "Use a longer record or a smaller decimation factor."
        )
    return system.status, system.message


def describe(observation: Observation, model: GeneratedModel | None = None) -> dict[str, Any]:
    """Collect the hashes of robot file and measured files, and the versions of the packages.

    They are the provenance of a result.
    """
    robot: dict[str, Any] = (
        {} if model is None else {"robot": model.NAME, "robot_sha256": model.SOURCE_SHA256}
    )
    if labels := getattr(model, "LABELS", {}):
        robot["labels"] = {f"q{j}": str(name) for j, name in labels.items()}
    return {
        **robot,
        "files": dict(observation.files),
        "versions": versions(),
    }


def _undetermined(system: System, fit: Solution) -> list[int]:
    return [system.names.index(name) for group in fit.groups for name in group]


def percent(error: Array | float, of: Array | float) -> float:
    """Compute the relative error 100 ||error|| / ||of||, %; nan if the reference `of` is zero."""
    norm = float(np.linalg.norm(of))
    return 100 * float(np.linalg.norm(error)) / norm if norm > 0 else float("nan")
