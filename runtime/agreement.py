"""Do several records of one robot tell the same parameters, within their stated deviations?

Each record k is fitted alone with the same b columns, its rows whitened: the rows of a joint are
those of a first-order recursion, a_j the correlation of neighbouring residuals, s_j the deviation
of what is left,

    [W Y]_t -> ([W Y]_t - a_j [W Y]_(t-1))/s_j

so that blocks of time are longer than the memory of the residuals. Rows within SHORTEST of one
that is left out do not count: there the filter smears what the model has as a step. A record k is
compared with the others, X_-k fitted to all their blocks,

    d = X_k - X_-k,     S = C_k + C_-k by the jackknife over blocks, B blocks in all,
    N = (W'W)_k^-1 + (W'W)_-k^-1 of the whitened rows

    per parameter    z = d_i/sqrt(S_ii), Student's t with B - 2 degrees of freedom; probabilities
                     by Holm
    in all           d' N^-1 d/tr(N^-1 S): F(b, B - 2), its probability times the number of
                     comparisons

The second, the statistic of analysis of variance, takes from the blocks the size of the errors
alone and their shape from the rows. Hotelling's d' S^-1 d inverts S, which some 100 unequal blocks
tell too badly: it rejects 9 % of right pairs at AR(0.99) for 2.5 %, this one 1 %. That is why the
test of single parameters has half of the level, and the one in all the whole.

Records that differ say that the robot changed (load, temperature, wear), that something in one
record is wrong, or that the model leaves out what their motions do not share: the stated deviations
know nothing of model error.

References: Box (1954) and Brunner, Dette and Munk (1997) for the test in all; Cochrane and Orcutt
(1949) for whitened rows; Holm (1979).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher
from scipy.stats import t as student

from runtime.core.check import Answer, Check, Question
from runtime.core.documents import Result
from runtime.core.errors import InputError
from runtime.core.least_squares.block_covariance import block_covariance
from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.method import linear_companion, linear_estimate
from runtime.core.limits import LIMIT
from runtime.core.model import GeneratedModel
from runtime.core.part import Part
from runtime.core.provenance import record_names
from runtime.core.result import Identification
from runtime.core.rows.observation import SHORTEST, Observation, split_rows
from runtime.core.study import EstimateSettings
from runtime.core.table import Table

Array = np.ndarray


@dataclass(frozen=True)
class Disagreement:
    """A parameter of one record that the others contradict.

    Attributes
    ----------
    record, parameter : str
    value, deviation : float, SI
        By this record alone, and its corrected deviation.
    others : float, SI
        By the other records.
    z : float
        Their difference in deviations.
    p : float
        Probability of it, corrected for the number of tests (Holm).
    """

    record: str
    parameter: str
    value: float
    deviation: float
    others: float
    z: float
    p: float


@dataclass(frozen=True)
class Homogeneity(Result, Part, keys="records parameters p agree disagreements untested"):
    """Whether records agree.

    Attributes
    ----------
    records, parameters : tuple of str
        What was compared.
    p : float
        Probability of differences as large between records of one robot: of the test in all, or
        twice that of the most different parameter where this is smaller.
    disagreements : tuple of Disagreement
        Parameters that differ, the most certain first.
    untested : tuple of str
        Records left out, each with its reason.
    """

    records: tuple[str, ...]
    parameters: tuple[str, ...]
    p: float
    disagreements: tuple[Disagreement, ...]
    untested: tuple[str, ...] = ()

    name = "homogeneity"
    title = "Agreement of the records"
    about = "prediction"

    @property
    def agree(self) -> bool:
        """Whether neither test rejects."""
        return not self.p < LIMIT.AGREEMENT_LEVEL

    @property
    def largest(self) -> float:
        """Largest difference among the disagreements, % of the larger value; inf where the test in
        all alone rejects.
        """
        differences = [
            100 * abs(d.value - d.others) / max(abs(d.value), abs(d.others))
            for d in self.disagreements
        ]
        return max(differences, default=0.0 if self.agree else float("inf"))

    @property
    def records_differ(self) -> bool:
        """Whether a value differs by more than LIMIT.RELEVANT_DIFFERENCE."""
        return bool(self.largest > LIMIT.RELEVANT_DIFFERENCE)

    def checks(self) -> tuple[Check, ...]:
        """Whether the records agree."""
        return (agreeing(self),)

    def text(self) -> str:
        """One or two sentences."""
        left_out = "".join(f" Not compared: {reason}." for reason in self.untested)
        if len(self.records) < 2:
            return f"Whether the records agree cannot be told.{left_out}"
        names = ", ".join(self.records)
        if self.agree:
            return (
                f"The records {names} agree within their stated deviations (p {self.p:.2g} for "
                f"{len(self.parameters)} parameters).{left_out}"
            )
        differences: dict[str, list[str]] = {}
        for d in self.disagreements:
            text = f"{d.parameter} ({d.value:.3g}, elsewhere {d.others:.3g}, {abs(d.z):.1f} deviations)"
            differences.setdefault(d.record, []).append(text)
        where = "; ".join(
            f"{record}: {', '.join(texts[:4])}{' ...' if len(texts) > 4 else ''}"
            for record, texts in differences.items()
        )
        return (
            f"The records {names} do NOT agree within their stated deviations (p {self.p:.1g}). "
            f"{where or 'No single parameter stands out'}.{left_out}"
        )

    def tables(self) -> list[Table]:
        """Parameters that differ."""
        if not self.disagreements:
            return []
        rows = [
            (
                d.record,
                d.parameter,
                f"{d.value:.4g}",
                f"{d.deviation:.2g}",
                f"{d.others:.4g}",
                f"{d.z:+.1f}",
                f"{d.p:.1g}",
            )
            for d in self.disagreements
        ]
        header = ("record", "parameter", "value", "deviation", "other records", "z", "p")
        return [Table("Parameters in which records differ", header, rows)]


@Question(
    "Do the records agree?",
    f"differences within the stated deviations, p above {LIMIT.AGREEMENT_LEVEL:g}",
    "look at the record that differs: load, temperature, time since the last one; or its "
    "motion shows what the model leaves out",
)
def agreeing(found: Homogeneity) -> Answer:
    """Whether several records tell the same parameters."""
    text = found.text().rstrip(".")
    if len(found.records) < 2:
        return Answer("open", text, "")
    if found.agree or found.largest > LIMIT.RELEVANT_DIFFERENCE:
        return Answer("good" if found.agree else "doubtful", text)
    return Answer(
        "good",
        "They differ by more than their stated deviations, but by at most "
        f"{found.largest:.0f} % of a value",
        limit=f"differences within the stated deviations, p above {LIMIT.AGREEMENT_LEVEL:g}, or by "
        f"at most {LIMIT.RELEVANT_DIFFERENCE:g} % of any value",
    )


def agreement(result: Identification) -> Homogeneity | None:
    """Whether several records agree, those that are predicted too: in all parameters, or in the essential ones where one of the records does not determine all. None for one record."""
    records = [*result.records, *result.problem.unseen]
    if len(records) < 2:
        return None
    settings = result.study.estimate
    parts = {
        name: result.observation.of_record(k)
        for k, name in enumerate(record_names(records)[: len(result.records)])
    }
    parts |= result.unseen_rows
    names = result.essential.all_parameters.names
    in_all = homogeneity(parts, names, settings, model=result.model)
    if not in_all.untested:
        return in_all
    return homogeneity(parts, result.essential.names, settings, model=result.model)


def homogeneity(
    parts: Mapping[str, Observation],
    names: Sequence[str],
    settings: EstimateSettings | None = None,
    *,
    model: GeneratedModel | None = None,
) -> Homogeneity:
    """Whether records agree.

    Parameters
    ----------
    parts : mapping of str to Observation
        Rows of each record, by its name.
    names : sequence of str
        The b columns.
    settings : EstimateSettings, optional
        Weights; a method that is not linear has its linear companion.
    model : GeneratedModel, optional
        Gives joint numbers.
    """
    linear = linear_companion(settings or EstimateSettings())
    fits: dict[str, list[Array]] = {}
    untested = []
    for record, part in parts.items():
        alike = EstimateSettings(linear.method, linear.weights, tuple(names), linear.options)
        try:
            fit = linear_estimate(part, alike, model=model)
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
        fits[record] = _blocks(part.columns(names), fit)
    if len(fits) < 2:
        return Homogeneity(tuple(fits), tuple(names), float("nan"), (), tuple(untested))
    records, b, B = tuple(fits), len(names), sum(map(len, fits.values()))
    compared = records[1:] if len(fits) == 2 else records
    rows, z, overall = [], [], []
    for record in compared:
        X, N, C = _fit(fits[record])
        others, *rest = _fit([rows for name in fits if name != record for rows in fits[name]])
        deviation = np.sqrt(np.diag(C + rest[1]))
        z.append((X - others) / deviation)
        rows.append((X, np.sqrt(np.diag(C)), others))
        F = _in_all(X - others, N + rest[0], C + rest[1])
        overall.append(len(compared) * float(fisher.sf(F, b, B - 2)))
    p = 2 * student.sf(np.abs(z), B - 2)
    corrected = _holm(p.ravel()).reshape(p.shape)
    named = [
        Disagreement(
            compared[k],
            names[i],
            float(rows[k][0][i]),
            float(rows[k][1][i]),
            float(rows[k][2][i]),
            float(z[k][i]),
            float(corrected[k, i]),
        )
        for k, i in zip(*np.unravel_index(np.argsort(p, axis=None), p.shape), strict=True)
        if corrected[k, i] < LIMIT.AGREEMENT_LEVEL / 2
    ]
    p_all = min([1.0, 2 * float(corrected.min()), *overall])
    return Homogeneity(records, tuple(names), p_all, tuple(named), tuple(untested))


def _blocks(part: Observation, fit: Estimate) -> list[Array]:
    """Whitened rows [W Y] of every block of residuals."""
    A, e = np.column_stack([part.W, part.Y]), part.Y - part.W @ fit.X
    instant = np.rint((part.t - part.t.min()) * part.rate).astype(np.intp)
    block = part.blocks()
    near = np.arange(-SHORTEST - 1, SHORTEST + 1)
    whitened, of_block = [], []
    for rows in map(part.joint, range(part.n)):
        at = instant[rows, None] + near
        held = np.isin(at, instant[rows]) | (at < instant.min()) | (at > instant.max())
        held[0] = False
        k = rows.start + np.flatnonzero(held.all(axis=1))
        a = e[k] @ e[k - 1] / (e[k - 1] @ e[k - 1])
        s = np.linalg.norm(e[k] - a * e[k - 1]) / np.sqrt(len(k))
        whitened.append((A[k] - a * A[k - 1]) / s)
        of_block.append(block[k])
    return list(split_rows(np.vstack(whitened), np.concatenate(of_block)))


def _fit(blocks: Sequence[Array]) -> tuple[Array, Array, Array]:
    """X, (W'W)^-1, and the covariance by the jackknife, of the rows [W Y] of some blocks."""
    A = np.vstack(blocks)
    size = np.linalg.norm(A[:, :-1], axis=0)
    R = np.asarray(np.linalg.qr(np.column_stack([A[:, :-1] / size, A[:, -1]]), mode="r"))
    T = np.linalg.inv(R[:-1, :-1]) / size[:, None]
    X = T @ R[:-1, -1]
    return X, T @ T.T, block_covariance(blocks, X, T)


def _in_all(d: Array, N: Array, S: Array) -> float:
    """d' N^-1 d/tr(N^-1 S), columns scaled first."""
    size = np.sqrt(np.diag(S))
    N, z = N / np.outer(size, size), d / size
    return float(z @ np.linalg.solve(N, z) / np.trace(np.linalg.solve(N, S / np.outer(size, size))))


def _holm(p: Array) -> Array:
    """Probabilities corrected for their number, shape (m,)."""
    order = np.argsort(p)
    stepped = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(stepped, 1.0)
    return corrected
