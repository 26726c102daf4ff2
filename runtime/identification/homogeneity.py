"""Do several records of one robot tell the same parameters, within their stated deviations?

Each record k is fitted alone with the same b columns, its rows whitened: the rows of a joint are
those of a first-order recursion, a_j the correlation of neighbouring residuals, s_j the deviation
of what is left,

    [W Y]_t -> ([W Y]_t - a_j [W Y]_(t-1))/s_j

so that blocks of time are longer than the memory of the residuals. Rows within SHORTEST of one
that is left out do not count: there the filter smears what the model has as a step. A record k is
compared with the others, X_-k fitted to all their blocks,

    d = X_k - X_-k,     S = C_k + C_-k by the jackknife over blocks, B blocks in all

    per parameter    z = d_i/sqrt(S_ii), Student's t with nu_i degrees of freedom; probabilities
                     by Holm
    in all           (nu + 1 - b)/(nu b) d' S^-1 d: F(b, nu + 1 - b), its probability times the
                     number of comparisons

A scatter of blocks of which some tell more than others is known as badly as that of fewer equal
ones. With w_k the share of block k in what is known of a parameter or, by its trace, of all, of
independent residuals,

    nu = (B - 2)/B/(sum_k w_k^2)    after Satterthwaite,    B - 2 of equal blocks

Each test has half of the level. The second is left out where nu < FREEDOM b: S is then known too
badly to be inverted.
Records that differ say that the robot changed (load, temperature, wear), that something in one
record is wrong, or that the model leaves out what their motions do
not share: the stated deviations know nothing of model error.

References: Hotelling (1931) for the test in all; Satterthwaite (1946), Bell and McCaffrey (2002)
for degrees of freedom, by blocks; Cochrane and Orcutt (1949) for whitened rows; Holm
(1979).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher
from scipy.stats import t as student

from runtime.errors import InputError
from runtime.estimators.block_covariance import block_covariance
from runtime.estimators.estimate import Estimate
from runtime.estimators.method import linear_companion
from runtime.json_documents import Result
from runtime.limits import LIMIT
from runtime.loop.methods import estimate_of
from runtime.model.generated import GeneratedModel
from runtime.rows.observation import SHORTEST, Observation, split_rows
from runtime.settings.study import EstimateSettings
from runtime.table import Table

Array = np.ndarray
FREEDOM = 1.2  # least degrees of freedom over parameters


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
class Homogeneity(Result, keys="records parameters p agree disagreements untested"):
    """Whether records agree.

    Attributes
    ----------
    records, parameters : tuple of str
        What was compared.
    p : float
        Probability of differences as large between records of one robot: twice the smaller of the
        two tests.
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
        told: dict[str, list[str]] = {}
        for one in self.disagreements:
            told.setdefault(one.record, []).append(
                f"{one.parameter} ({one.value:.3g}, elsewhere {one.others:.3g}, {abs(one.z):.1f} "
                "deviations)"
            )
        where = "; ".join(
            f"{record}: {', '.join(own[:4])}{' ...' if len(own) > 4 else ''}"
            for record, own in told.items()
        )
        return (
            f"The records {names} do NOT agree within their stated deviations (p "
            f"{self.p:.1g}). "
            f"{where or 'No single parameter stands out'}.{left_out}"
        )

    def table(self) -> Table:
        """Parameters that differ."""
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
        return Table(
            "Parameters in which records differ",
            ("record", "parameter", "value", "deviation", "other records", "z", "p"),
            rows,
        )


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
        own = EstimateSettings(linear.method, linear.weights, tuple(names), linear.options)
        try:
            fit = estimate_of(part, own, model=model)
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
    records, b = tuple(fits), len(names)
    compared = records[1:] if len(fits) == 2 else records
    rows, z, degrees, overall = [], [], [], []
    for record in compared:
        one = _fit(fits[record])
        rest = _fit([rows for name in fits if name != record for rows in fits[name]])
        S = one.C + rest.C
        deviation = np.sqrt(np.diag(S))
        z.append((one.X - rest.X) / deviation)
        rows.append((one.X, np.sqrt(np.diag(one.C)), rest.X))
        single, nu = _degrees(one, rest)
        degrees.append(single)
        if FREEDOM * b <= nu:
            square = z[-1] @ np.linalg.solve(S / np.outer(deviation, deviation), z[-1])
            F = (nu + 1 - b) / (nu * b) * square
            overall.append(len(compared) * float(fisher.sf(F, b, nu + 1 - b)))
    p = 2 * student.sf(np.abs(z), degrees)
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
    least = min([float(corrected.min()), *overall])
    return Homogeneity(records, tuple(names), min(1.0, 2 * least), tuple(named), tuple(untested))


def _blocks(part: Observation, fit: Estimate) -> list[Array]:
    """Whitened rows [W Y] of every block of residuals; of rows that are not held, those over the
    deviation of their joint.
    """
    if part.reduced:
        scale = np.array([1 / joint.sigma_rho for joint in fit.per_joint])
        return list(part.block_rows(part.names, scale, part.residual_block))
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


@dataclass(frozen=True)
class _Fit:
    """X and its covariance by the jackknife; what independent residuals would give: `V`, and the
    shares of each block in the variance of a parameter, (K, b), and in what is known of all, (K,).
    """

    X: Array
    C: Array
    V: Array
    of_variance: Array
    of_all: Array


def _fit(blocks: Sequence[Array]) -> _Fit:
    """The fit of the rows [W Y] of some blocks."""
    A = np.vstack(blocks)
    size = np.linalg.norm(A[:, :-1], axis=0)
    R = np.asarray(np.linalg.qr(np.column_stack([A[:, :-1] / size, A[:, -1]]), mode="r"))
    T = np.linalg.inv(R[:-1, :-1]) / size[:, None]
    X, V = T @ R[:-1, -1], T @ T.T
    P = [rows[:, :-1] @ T for rows in blocks]
    of_variance = np.array([((p @ T.T) ** 2).sum(axis=0) for p in P]) / np.diag(V)
    of_all = np.array([(p**2).sum() for p in P]) / len(X)
    return _Fit(X, block_covariance(blocks, X, T), V, of_variance, of_all)


def _degrees(one: _Fit, rest: _Fit) -> tuple[Array, float]:
    """Degrees of freedom of the scatter of X_k - X_-k: of each parameter, (b,), and of all."""
    size = np.sqrt(np.diag(one.V + rest.V))
    A, B = (fit.V / np.outer(size, size) for fit in (one, rest))
    part = np.trace(np.linalg.solve(A + B, A)) / len(A)  # of the record in what is unknown
    single = np.vstack([one.of_variance * np.diag(A), rest.of_variance * np.diag(B)])
    of_all = np.concatenate([part * one.of_all, (1 - part) * rest.of_all])
    scale = 1 - 2 / len(of_all)
    return scale / (single**2).sum(axis=0), float(scale / (of_all @ of_all))


def _holm(p: Array) -> Array:
    """Probabilities corrected for their number, shape (m,)."""
    order = np.argsort(p)
    stepped = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(stepped, 1.0)
    return corrected
