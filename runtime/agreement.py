"""Compare the parameters of several records of one robot, each record fitted alone.

Each record k is fitted alone, as `identify` fits it, with the same b columns. The fit gives X_k
with standard deviations s_k. X_k is compared with the mean of the other records, weighted by their
standard deviations,

    X_-k = s_-k^2 sum X_m/s_m^2,    s_-k^-2 = sum 1/s_m^2,    d = (X_k - X_-k)/sqrt(s_k^2 + s_-k^2)

s_k is the corrected standard deviation. The deviation is multiplied by the root of a factor c if
residuals stay correlated for longer than a block (`runtime.core.residuals.unseen_by_blocks`). A
parameter differs if |d| exceeds 3 (`DIFFERS`). This limit is a convention, not a statistical test
(benchmarks/truth.md). Differences up to 10 % of the value (RELEVANT_DIFFERENCE in limits.toml) do
not change the verdict.

Records differ if the robot changed (load, temperature, wear), if one record has an error, or if the
model lacks an effect that appears in the motion of only some records.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import System, assemble
from runtime.core.least_squares.wls import weighted_system
from runtime.core.model import GeneratedModel
from runtime.core.provenance import record_names
from runtime.core.residuals import unseen_by_blocks
from runtime.core.result import Identification
from runtime.core.rows.observation import Observation
from runtime.ground.check import Answer, Check, Question
from runtime.ground.documents import Result
from runtime.ground.errors import InputError
from runtime.ground.limits import LIMIT
from runtime.ground.part import Part
from runtime.ground.table import Table

DIFFERS = 3.0
"""Distance of a parameter of one record from that of the others, from which it differs, deviations. Measured: benchmarks/truth.md."""

Array = np.ndarray


@dataclass(frozen=True)
class Disagreement:
    """One parameter whose value from one record contradicts the other records.

    Attributes
    ----------
    record, parameter : str
        Names of the record and of the parameter.
    value, deviation : float, SI
        Value from this record alone, and its corrected standard deviation.
    others : float, SI
        Weighted mean of the values from the other records.
    z : float
        Difference of the two values, divided by the standard deviation of this difference.
    """

    record: str
    parameter: str
    value: float
    deviation: float
    others: float
    z: float

    @property
    def difference(self) -> float:
        """Difference of this value from the mean of the other records, % of the larger value."""
        return 100 * abs(self.value - self.others) / max(abs(self.value), abs(self.others))


@dataclass(frozen=True)
class Homogeneity(Result, Part, keys="records parameters agree disagreements untested"):
    """Result of the comparison of records: whether all records give the same parameters.

    Attributes
    ----------
    records, parameters : tuple of str
        Names of the records and of the parameters that were compared.
    disagreements : tuple of Disagreement
        Parameters that differ between records, the largest |z| first.
    untested : tuple of str
        Records that could not be compared, each with its reason.
    """

    records: tuple[str, ...]
    parameters: tuple[str, ...]
    disagreements: tuple[Disagreement, ...] = ()
    untested: tuple[str, ...] = ()

    name = "homogeneity"
    title = "Agreement of the records"
    about = "prediction"

    @property
    def agree(self) -> bool:
        """Whether no parameter differs between the records."""
        return not self.disagreements

    @property
    def records_differ(self) -> bool:
        """Whether a parameter differs between records by more than 10 % of its value.

        The limit is RELEVANT_DIFFERENCE in limits.toml.
        """
        return any(d.difference > LIMIT.RELEVANT_DIFFERENCE for d in self.disagreements)

    def checks(self) -> tuple[Check, ...]:
        """Return the check "Do the records agree?" of the report, as a tuple with one check."""
        return (agreeing(self),)

    def text(self) -> str:
        """Write one or two sentences that say whether the records agree."""
        left_out = "".join(f" Not compared: {reason}." for reason in self.untested)
        if len(self.records) < 2:
            return f"The records cannot be compared.{left_out}"
        names = ", ".join(self.records)
        if self.agree:
            return f"The records {names} give the same {len(self.parameters)} parameters.{left_out}"
        differences: dict[str, list[str]] = {}
        for d in self.disagreements:
            text = f"{d.parameter} ({d.value:.3g}, elsewhere {d.others:.3g}, {abs(d.z):.0f} deviations)"
            differences.setdefault(d.record, []).append(text)
        where = "; ".join(
            f"{record}: {', '.join(texts[:4])}{' ...' if len(texts) > 4 else ''}"
            for record, texts in differences.items()
        )
        return f"The records {names} differ. {where}.{left_out}"

    def tables(self) -> list[Table]:
        """Return a table of the parameters that differ between records; no table if none does."""
        if not self.disagreements:
            return []
        rows = [
            (
                d.record,
                d.parameter,
                f"{d.value:.4g}",
                f"{d.deviation:.2g}",
                f"{d.others:.4g}",
                f"{d.difference:.0f}",
                f"{d.z:+.1f}",
            )
            for d in self.disagreements
        ]
        header = (
            "record",
            "parameter",
            "value",
            "deviation",
            "other records",
            "difference, %",
            "in deviations",
        )
        return [Table("Parameters in which records differ", header, rows)]


@Question(
    "Do the records agree?",
    f"no parameter differs by {DIFFERS:g} standard deviations and {LIMIT.RELEVANT_DIFFERENCE:g} %",
    "check the load and the temperature of the record that differs; its motion may also show an "
    "effect that the model lacks",
)
def agreeing(found: Homogeneity) -> Answer:
    """Judge whether several records give the same parameters."""
    text = found.text().rstrip(".")
    if len(found.records) < 2:
        return Answer("open", text, "")
    return Answer("doubtful" if found.records_differ else "good", text)


def agreement(result: Identification) -> Homogeneity | None:
    """Fit each record alone, validation records too, and compare the parameters between records.

    All parameters are compared. If one record does not determine all of them, only the essential
    parameters are compared.
    """
    records = [*result.records, *result.problem.unseen]
    if len(records) < 2:
        return None
    parts = {
        name: result.observation.of_record(k)
        for k, name in enumerate(record_names(records)[: len(result.records)])
    }
    parts |= result.unseen_rows
    names = result.essential.all_parameters.names
    weigh = result.problem.linear_system
    in_all = homogeneity(parts, names, weigh, model=result.model)
    if not in_all.untested:
        return in_all
    return homogeneity(parts, result.essential.names, weigh, model=result.model)


def homogeneity(
    parts: Mapping[str, Observation],
    names: Sequence[str],
    weigh: Callable[..., System] = weighted_system,
    *,
    model: GeneratedModel | None = None,
) -> Homogeneity:
    """Fit each record alone, and compare its parameters with those of the other records.

    Parameters
    ----------
    parts : mapping of str to Observation
        Rows of W and Y of each record, by the name of the record.
    names : sequence of str
        The b base parameters that are fitted.
    weigh : function of rows and `columns`, optional
        Weighs the rows for linear least squares; default: equal weights.
    model : GeneratedModel, optional
        Gives the joint numbers.
    """
    fits: dict[str, tuple[Estimate, Array]] = {}
    untested = []
    for record, part in parts.items():
        try:
            system = weigh(part, columns=tuple(names))
            fit = assemble(system, system.solve(), model=model)
        except InputError as e:
            untested.append(f"{record}, {e}")
            continue
        if fit.status != "ok" or not np.isfinite(fit.sigma_corrected).all() or not fit.sigma.all():
            lost = ", ".join(name for group in fit.groups for name in group)
            untested.append(
                f"{record}, which alone does not determine "
                f"{lost or 'the parameters and their deviations'}"
            )
            continue
        wider = np.sqrt(unseen_by_blocks(part, fit))
        fits[record] = fit, wider * fit.sigma_corrected
    found = [
        d
        for record in list(fits)[len(fits) == 2 :]  # of two, the second against the first
        for d in _apart(record, fits)
        if abs(d.z) > DIFFERS
    ]
    found.sort(key=lambda d: -abs(d.z))
    return Homogeneity(tuple(fits), tuple(names), tuple(found), tuple(untested))


def _apart(record: str, fits: Mapping[str, tuple[Estimate, Array]]) -> list[Disagreement]:
    """Compare each parameter of one record with the weighted mean of the other records.

    The list has every parameter, however small its difference.
    """
    others = [fit for name, fit in fits.items() if name != record]
    if not others:
        return []
    own, s = fits[record]
    precision = np.array([deviation**-2.0 for _, deviation in others])
    variance = 1 / precision.sum(axis=0)
    mean = variance * sum(w * fit.X for w, (fit, _) in zip(precision, others, strict=True))
    columns = (
        own.names,
        own.X,
        own.sigma_corrected,
        mean,
        (own.X - mean) / np.sqrt(s**2 + variance),
    )
    return [
        Disagreement(record, name, *map(float, numbers))
        for name, *numbers in zip(*columns, strict=True)
    ]
