"""What every estimator returns: parameters with an honest statement of how far to trust them.

Equation numbers are those of the chapter (Experimental identification of the inverse dynamic model: minimal encoder resolution):

    X        (7)     sigma_rho  (9)  = ||Y - W X|| / sqrt(r - b)
    sigma    (10)    = square roots of the diagonal of C = sigma_rho^2 (W'W)^-1
    %sigma   (11)    = 100 sigma / |X|

Eq. (10) supposes independent residuals; filtered ones are not. `sigma_corrected` stands beside it: blocks of time are taken as
independent instead of samples (`runtime.estimators.block_covariance`). What a record does not determine is nan in memory and null in JSON.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from runtime import json_values as read
from runtime.errors import InputError
from runtime.json_documents import document, read_document
from runtime.latex import parameter_table
from runtime.markup import number
from runtime.table import Table, notebook

Array = np.ndarray

SCHEMA = "symgen-estimate/1"
"""Kind and version of the JSON layout, published as runtime/schemas/estimate.schema.json (`symgen schema --of estimate`)."""


@dataclass(frozen=True)
class JointFit:
    """Fit of the rows of one joint, torques in N m (N for prismatic joints).

    rows : rows of the joint in W.
    residual_norm : ||Y_j - W_j X||.
    relative_error : 100 ||Y_j - W_j X|| / ||Y_j||, in %.
    sigma_rho : ||Y_j - W_j X|| / sqrt(N_j (1 - b/r)), the share of joint j in eq. (9).
    scale : the s_j its rows were divided by (1 without weights).
    """

    joint: str
    rows: int
    residual_norm: float
    relative_error: float
    sigma_rho: float
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters, their uncertainty and the quality of the fit.

    names, X : parameters in column order; X, shape (b,), SI units (`units` by name where the model tells them).
    sigma : ndarray, shape (b,), eq. (10); nan where the record does not determine the parameter.
    covariance : ndarray, shape (b, b), eq. (10).
    sigma_corrected : ndarray, shape (b,), sigma without the assumption of independent residuals.
    sigma_rho : eq. (9) of the system that was solved: N m without weights, near 1 (no unit) with weights.
    cond, cond_unit : condition number of that W, and of W with columns of norm 1; inf when rank-deficient.
    rank : numerical rank judged with unit columns.
    residual_norm, relative_error : ||Y - W X|| in N m and 100 ||Y - W X|| / ||Y|| in %, without weights.
    per_joint : the same by joint.
    status : "ok", "rank-deficient", "no-redundancy" (no more rows than parameters), "singular-weights" or "not-converged";
        `message` explains.
    groups : for "rank-deficient": the names that cannot be told apart, group by group.
    settings, provenance : what was asked for; hashes, versions and seed that reproduce it.
    details : what only this method tells, by name (feasible: standard parameters, eigenvalues, what least squares alone gave).
    """

    names: tuple[str, ...]
    X: Array
    sigma: Array
    covariance: Array
    sigma_corrected: Array
    sigma_rho: float
    cond: float
    cond_unit: float
    rank: int
    residual_norm: float
    relative_error: float
    per_joint: tuple[JointFit, ...]
    method: str
    status: str = "ok"
    message: str = ""
    groups: tuple[tuple[str, ...], ...] = ()
    iterations: int = 0
    settings: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        b = len(self.names)
        for name, shape in (("X", (b,)), ("sigma", (b,)), ("sigma_corrected", (b,)), ("covariance", (b, b))):
            array = np.array(getattr(self, name), dtype=float)
            if array.shape != shape:
                raise ValueError(f"{name} has shape {array.shape}; {b} names ask for {shape}")
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @property
    def relative_sigma(self) -> Array:
        """%sigma of eq. (11), shape (b,), in %; inf for a parameter estimated as exactly zero."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(100 * self.sigma / np.abs(self.X))

    @property
    def rows(self) -> int:
        """Number of rows r of W."""
        return sum(fit.rows for fit in self.per_joint)

    def __getitem__(self, name: str) -> float:
        """Value of one parameter."""
        return float(self.X[self.names.index(name)])

    def __str__(self) -> str:
        return self.to_table()

    def _repr_html_(self) -> str:
        return notebook([*self._head(), *([self.message] if self.message else [])], *self.tables())

    def _repr_latex_(self) -> str:
        return self.to_latex()

    def to_json(self) -> str:
        """JSON text of every field (design: estimate.json); numbers that do not exist are null."""
        return json_text(
            {
                "schema": SCHEMA,
                "names": self.names,
                "X": self.X,
                "sigma": self.sigma,
                "relative_sigma": self.relative_sigma,
                "sigma_corrected": self.sigma_corrected,
                "cond": self.cond,
                "cond_unit": self.cond_unit,
                "rank": self.rank,
                "sigma_rho": self.sigma_rho,
                "residual_norm": self.residual_norm,
                "relative_error": self.relative_error,
                "rows": self.rows,
                "per_joint": self.per_joint,
                "method": self.method,
                "status": self.status,
                "message": self.message,
                "groups": self.groups,
                "iterations": self.iterations,
                "settings": self.settings,
                "provenance": self.provenance,
                "units": self.units,
                "covariance": self.covariance,
                "details": self.details,
            }
        )

    @classmethod
    def from_json(cls, text: str, *, file: str = "estimate.json") -> Estimate:
        """The Estimate that `to_json` wrote, every number to the bit; what stands beside it (estimate.json of `symgen identify`) is left out.

        Raises InputError where the text is no JSON, of another schema or incomplete; `file` is the name it gives.
        """
        return _estimate(document(text, SCHEMA, file), file)

    def to_table(self) -> str:
        """Plain text: one line per parameter, one per joint."""
        parameters, joints = self.tables()
        note = ["", self.message] if self.message else []
        return "\n".join([*self._head(), "", parameters.to_text(), "", joints.to_text(), *note])

    def tables(self) -> tuple[Table, Table]:
        """Parameters, then joints, line by line."""
        parameters = [
            (
                name,
                f"{self.X[i]:.6g}",
                number(self.sigma[i], ".3g"),
                number(self.relative_sigma[i], ".3f"),
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
            Table("parameters", ("parameter", "value", "sigma", "%sigma", "corrected", "unit"), parameters, symbols=True),
            Table("joints", ("joint", "rows", "residual norm", "relative error %", "sigma_rho", "scale"), joints),
        )

    def _head(self) -> tuple[str, str]:
        return (
            f"{self.method}: {self.rows} rows, {len(self.names)} parameters, rank {self.rank}, status {self.status}",
            f"cond {self.cond:.4g} (unit columns {self.cond_unit:.4g}), sigma_rho {self.sigma_rho:.4g}, "
            f"residual norm {self.residual_norm:.6g}, relative error {self.relative_error:.3f} %",
        )

    def to_latex(self, names: Sequence[str] | None = None, *, blocks: int = 1) -> str:
        """LaTeX tabular (booktabs) as the chapter's Table 2; `names` restricts and orders its lines, `blocks` stand side by side."""
        shown = self.names if names is None else tuple(names)
        place = [self.names.index(name) for name in shown]
        return parameter_table(shown, self.X[place], self.relative_sigma[place], self.units, blocks=blocks)


def load_estimate(path: Path | str) -> Estimate:
    """The Estimate in a file that `Estimate.to_json` or `symgen identify -o` wrote; InputError as `Estimate.from_json`."""
    return _estimate(read_document(Path(path), SCHEMA), str(path))


def plain(value: Any) -> Any:
    """`value` as JSON knows it: mappings, lists, text, finite numbers; what is not finite becomes null.

    Dataclasses become mappings of their fields, arrays lists, anything else its text.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def json_text(value: Any) -> str:
    """`plain(value)` as JSON, indented by two, lists of scalars on one line, with a final newline."""
    return _render(plain(value), "") + "\n"


def _render(value: Any, indent: str) -> str:
    deeper = indent + "  "
    if isinstance(value, dict) and value:
        items = [f"{deeper}{json.dumps(key, ensure_ascii=False)}: {_render(item, deeper)}" for key, item in value.items()]
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(item, list | dict) for item in value):
        return "[\n" + ",\n".join(deeper + _render(item, deeper) for item in value) + f"\n{indent}]"
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


MISSING = {"cond": math.inf, "cond_unit": math.inf, "sigma_rho": math.nan, "residual_norm": math.nan, "relative_error": math.nan}
"""What null stands for in the numbers of an Estimate; in an array it is nan."""


def _estimate(data: Mapping[str, Any], file: str) -> Estimate:
    """The fields of a document, whose kind and version are right; InputError names the one that is not."""
    given: dict[str, Any] = {}
    for f in dataclasses.fields(Estimate):
        if f.name not in data:
            raise InputError(f"no {f.name!r}; the file is incomplete", file=file)
        try:
            given[f.name] = _field(f.name, data[f.name])
        except (TypeError, ValueError) as e:
            raise InputError(f"{f.name}: {e}; the file was changed", file=file) from e
    try:
        return Estimate(**given)
    except ValueError as e:
        raise InputError(f"{e}; the file was changed", file=file) from e


def _field(name: str, value: Any) -> Any:
    if name in MISSING:
        return read.number(value, MISSING[name])
    match name:
        case "X" | "sigma" | "sigma_corrected":
            return read.numbers(value)
        case "covariance":
            return read.numbers(value) if value else np.empty((0, 0))
        case "names":
            return read.texts(value)
        case "method" | "status" | "message":
            return read.text(value)
        case "rank" | "iterations":
            return read.whole(value)
        case "groups":
            return tuple(map(read.texts, read.items(value)))
        case "per_joint":
            return tuple(map(_joint_fit, read.items(value)))
        case "units":
            return {key: read.text(unit) for key, unit in read.mapping(value).items()}
        case _:
            return read.mapping(value)


def _joint_fit(value: Any) -> JointFit:
    given: dict[str, Any] = {}
    for key, item in read.mapping(value).items():
        given[key] = read.text(item) if key == "joint" else read.whole(item) if key == "rows" else read.number(item)
    return JointFit(**given)
