"""Result of every estimator: parameters, their standard deviations and the quality of the fit.

Equation numbers are those of the chapter (Experimental identification of the inverse dynamic model:
minimal encoder resolution):

    X        (7)     sigma_rho  (9)  = ||Y - W X|| / sqrt(r - b)
    sigma    (10)    = square roots of the diagonal of C = sigma_rho^2 (W'W)^-1
    %sigma   (11)    = 100 sigma / |X|

Eq. (10) supposes independent residuals; filtered ones are not. `sigma_corrected` is given too: it
assumes that blocks of time are independent, not samples, and includes errors of the friction model
that depend on the speed (`runtime.core.least_squares.block_covariance`). A number that the record
does not determine is nan in memory and null in JSON.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from runtime.ground.documents import (
    InfIfNull,
    Matrix,
    NanIfNull,
    Vector,
    Whole,
    from_text,
    json_text,
)
from runtime.ground.table import Table, notebook, number, parameter_table, percentage

SCHEMA = "symgen-estimate/1"
"""Kind and version of the JSON layout; `symgen schema --of estimate` prints its JSON Schema."""


Status = Literal[
    "ok",
    "rank-deficient",
    "no-redundancy",
    "singular-weights",
    "not-converged",
    "weak-instruments",
    "simulation-apart",
]
"""Outcome of an estimator; the message of the Estimate explains."""


@dataclass(frozen=True)
class JointFit:
    """Quality of the fit of one joint: residual norm, relative error and scale s_j of its rows.

    Attributes
    ----------
    joint : str
        Label of the joint.
    rows : int
        Rows of the joint in W.
    residual_norm : float, N m or N
        ||Y_j - W_j X||.
    relative_error : float, %
        100 ||Y_j - W_j X|| / ||Y_j||; nan if Y_j is zero: a joint without a motor.
    sigma_rho : float
        ||Y_j - W_j X|| / sqrt(N_j (1 - b/r)), the share of joint j in eq. (9).
    scale : float, N m or N
        s_j by which the rows were divided; 1 without weights.
    """

    joint: str
    rows: Whole
    residual_norm: NanIfNull
    relative_error: NanIfNull
    sigma_rho: NanIfNull
    scale: NanIfNull = 1.0

    @property
    def has_motor(self) -> bool:
        """Whether the joint has rows and its measured torque is not always zero."""
        return self.rows > 0 and not np.isnan(self.relative_error)

    @property
    def is_axis(self) -> bool:
        """Whether this is an axis of a force sensor (`runtime.wrench`), not a joint."""
        return not self.joint[:1].isdigit()


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters of a robot, their uncertainty and the quality of the fit.

    Attributes
    ----------
    names : tuple of str
        Parameters in column order; b of them.
    X : ndarray, shape (b,), SI
        Values.
    sigma : ndarray, shape (b,), SI
        Standard deviations, eq. (10); nan for a parameter that the record does not determine.
    covariance : ndarray, shape (b, b), SI
        Covariance of X, eq. (10).
    sigma_corrected : ndarray, shape (b,), SI
        Standard deviations that allow for slow residuals and for errors of the friction model.
    sigma_rho : float, N m or N
        Eq. (9) of the system that was solved; with weights near 1 and without unit.
    cond : float
        Condition number of the W that was solved; inf if W is rank-deficient.
    cond_unit : float
        Condition number of W with columns of norm 1.
    rank : int
        Numerical rank of W with columns of norm 1.
    residual_norm : float, N m or N
        ||Y - W X||, without weights.
    relative_error : float, %
        100 ||Y - W X|| / ||Y||, without weights.
    per_joint : tuple of JointFit
        Fit by joint.
    method : str
        Estimator.
    status : str
        Outcome; no-redundancy: no more rows than parameters.
    message : str
        Explanation of the outcome.
    groups : tuple of tuple of str
        For rank-deficient: the names that cannot be separated, group by group.
    iterations : int
        Number of passes.
    settings : mapping
        Settings of the study, complete.
    provenance : mapping
        Hashes, versions and seed that reproduce the result.
    units : mapping of str
        Units by name, such as kg*m**2.
    details : mapping
        Further results of the method, by name; for the method feasible: standard parameters,
        eigenvalues, the result of least squares alone.
    """

    names: tuple[str, ...]
    X: Vector
    sigma: Vector
    covariance: Matrix
    sigma_corrected: Vector
    sigma_rho: NanIfNull
    cond: InfIfNull
    cond_unit: InfIfNull
    rank: Whole
    residual_norm: NanIfNull
    relative_error: NanIfNull
    per_joint: tuple[JointFit, ...]
    method: str
    status: Status = "ok"
    message: str = ""
    groups: tuple[tuple[str, ...], ...] = ()
    iterations: Whole = 0
    settings: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        b = len(self.names)
        for name, shape in (
            ("X", (b,)),
            ("sigma", (b,)),
            ("sigma_corrected", (b,)),
            ("covariance", (b, b)),
        ):
            array = np.array(getattr(self, name), dtype=float)
            if array.shape != shape:
                raise ValueError(
                    f"{name} has shape {array.shape}; expected {shape} for {b} parameters"
                )
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @property
    def relative_sigma(self) -> Vector:
        """Relative standard deviation 100 sigma / |X| of each parameter, %; inf if X is zero."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(100 * self.sigma / np.abs(self.X))

    @property
    def relative_deviation(self) -> Vector:
        """The larger of the stated and the corrected standard deviation, % of |X|; inf if X is zero.

        The 95 % interval of a parameter contains zero if 1.96 times this number is 100 or more.
        """
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(100 * np.fmax(self.sigma, self.sigma_corrected) / np.abs(self.X))

    @property
    def rows(self) -> Whole:
        """Number of rows r of W."""
        return sum(fit.rows for fit in self.per_joint)

    @property
    def worst_joint(self) -> JointFit:
        """Fit of the joint with the largest relative error, of joints with a motor and rows in W.

        If there is no such joint, the result is the fit of an axis of a force sensor, which may
        measure only noise.
        """
        return max(
            self.per_joint, key=lambda fit: (fit.has_motor, not fit.is_axis, fit.relative_error)
        )

    def __getitem__(self, name: str) -> float:
        """Return the value of one parameter by its name."""
        return float(self.X[self.names.index(name)])

    def __str__(self) -> str:
        return self.to_table()

    def _repr_html_(self) -> str:
        return notebook([*self._head(), *([self.message] if self.message else [])], *self.tables())

    def _repr_latex_(self) -> str:
        return self.to_latex()

    def to_json(self) -> str:
        """Return the JSON text of all fields (estimate.json), with null for nan and infinity."""
        computed = {"relative_sigma": self.relative_sigma, "rows": self.rows}
        return json_text({"schema": SCHEMA, **vars(self), **computed})

    @classmethod
    def from_json(cls, text: str, *, file: str = "estimate.json") -> Estimate:
        """Read an Estimate from the JSON text of `to_json`, with exactly the same numbers.

        Other keys of estimate.json are ignored. Raises InputError if the text is not JSON, has
        another schema or is incomplete; `file` is the name in its message.
        """
        return from_text(cls, text, SCHEMA, file)

    def to_table(self) -> str:
        """Return a plain text with one line for each parameter and each joint."""
        parameters, joints = self.tables()
        note = ["", self.message] if self.message else []
        return "\n".join([*self._head(), "", parameters.to_text(), "", joints.to_text(), *note])

    def tables(self) -> tuple[Table, Table]:
        """Return two tables: one of the parameters, one of the joints."""
        parameters = [
            (
                name,
                f"{self.X[i]:.6g}",
                number(self.sigma[i], ".3g"),
                percentage(self.relative_sigma[i], self.relative_deviation[i], ".3f"),
                number(self.sigma_corrected[i], ".3g"),
                self.units.get(name, ""),
            )
            for i, name in enumerate(self.names)
        ]
        joints = [
            (
                fit.joint,
                str(fit.rows),
                f"{fit.residual_norm:.6g}",
                number(fit.relative_error, ".3f"),
                number(fit.sigma_rho, ".4g"),
                f"{fit.scale:.4g}",
            )
            for fit in self.per_joint
        ]
        return (
            Table(
                "parameters",
                ("parameter", "value", "sigma", "%sigma", "corrected", "unit"),
                parameters,
                symbols=True,
            ),
            Table(
                "joints",
                ("joint", "rows", "residual norm", "relative error %", "sigma_rho", "scale"),
                joints,
            ),
        )

    def _head(self) -> tuple[str, str]:
        return (
            (
                f"{self.method}: {self.rows} rows, {len(self.names)} parameters, rank {self.rank}, "
                f"status {self.status}"
            ),
            f"cond {self.cond:.4g} (unit columns {self.cond_unit:.4g}), sigma_rho "
            f"{self.sigma_rho:.4g}, residual norm {self.residual_norm:.6g}, relative error "
            f"{self.relative_error:.3f} %",
        )

    def to_latex(self, names: Sequence[str] | None = None, *, blocks: int = 1) -> str:
        """Return a LaTeX table (booktabs) of the parameters, like Table 2 of the chapter.

        names : parameters and their order. blocks : number of blocks side by side.
        """
        shown = self.names if names is None else tuple(names)
        place = [self.names.index(name) for name in shown]
        percent = np.where(1.96 * self.relative_deviation < 100, self.relative_sigma, np.nan)
        return parameter_table(shown, self.X[place], percent[place], self.units, blocks=blocks)
