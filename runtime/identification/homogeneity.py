"""Do several records of one robot tell the same parameters, within their stated deviations?

Each record k is fitted alone with the same b columns: X_k, and S_k = D C_k D, the covariance of eq.
(10) with the corrected deviations, which take blocks of
time as independent, on its diagonal.

    per parameter    z = (X_ik - X_i,-k)/sqrt(s_ik^2 + s_i,-k^2),
            X_i,-k the mean of the other records weighted by their deviations; Student's t with the
                     blocks of the record less one as degrees of freedom; probabilities by Holm
    in all           Q = sum_k (X_k - X)' S_k^-1 (X_k - X),
            X = (sum_k S_k^-1)^-1 sum_k S_k^-1 X_k: (K - 1) b F((K - 1) b, least number of blocks
            less b)

Each test has half of the level. The second is left out where a record has fewer than 2 b blocks:
S_k is then known too badly to be inverted.
Records that differ say that the robot changed (load, temperature, wear), that something in one
record is wrong, or that the model leaves out what their motions do
not share: the stated deviations know nothing of model error.

References: Rao (1973), section 4b.3, for the likelihood of homogeneity; Holm (1979).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher
from scipy.stats import t as student

from runtime.errors import InputError
from runtime.estimators.estimate import Estimate
from runtime.estimators.method import linear_companion
from runtime.json_documents import Result
from runtime.limits import LIMIT
from runtime.loop.methods import estimate_of
from runtime.model.generated import GeneratedModel
from runtime.rows.observation import Observation
from runtime.settings.study import EstimateSettings
from runtime.table import Table

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
    fits: dict[str, Estimate] = {}
    blocks: dict[str, int] = {}
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
        fits[record], blocks[record] = (
            fit,
            sum(1 for _ in part.block_rows(names, np.ones(part.n), part.residual_block)),
        )
    if len(fits) < 2:
        return Homogeneity(tuple(fits), tuple(names), float("nan"), (), tuple(untested))
    X = np.array([fit.X for fit in fits.values()])
    s = np.array([np.fmax(fit.sigma, fit.sigma_corrected) for fit in fits.values()])
    freedom = np.array([count - 1 for count in blocks.values()])
    z, others = _against_others(X, s)
    p = 2 * student.sf(np.abs(z), freedom[:, None])
    tested = p[:1] if len(fits) == 2 else p  # of two records each contradicts the other alike
    corrected = _holm(tested.ravel()).reshape(tested.shape)
    corrected = np.broadcast_to(corrected, p.shape)
    order = np.argsort(p, axis=None)
    records = tuple(fits)
    named = [
        Disagreement(
            records[k],
            names[i],
            float(X[k, i]),
            float(s[k, i]),
            float(others[k, i]),
            float(z[k, i]),
            float(corrected[k, i]),
        )
        for k, i in zip(*np.unravel_index(order, p.shape), strict=True)
        if corrected[k, i] < LIMIT.AGREEMENT_LEVEL / 2 and (len(fits) > 2 or k == 1)
    ]
    least = min(blocks.values())
    tests = [
        float(corrected.min()),
        _overall(X, s, list(fits.values()), least) if least >= 2 * len(names) else 1.0,
    ]
    return Homogeneity(
        records, tuple(names), min(1.0, 2 * min(tests)), tuple(named), tuple(untested)
    )


def _against_others(X: Array, s: Array) -> tuple[Array, Array]:
    """z of each record and parameter, and the mean of the other records; X, s : (K, b)."""
    w = 1 / s**2
    W = w.sum(axis=0) - w
    others = ((w * X).sum(axis=0) - w * X) / W
    return (X - others) / np.sqrt(s**2 + 1 / W), others


def _holm(p: Array) -> Array:
    """Probabilities corrected for their number, shape (m,)."""
    order = np.argsort(p)
    stepped = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(stepped, 1.0)
    return corrected


def _overall(X: Array, s: Array, fits: Sequence[Estimate], blocks: int) -> float:
    """Probability of Q."""
    K, b = X.shape
    inverses = []
    for fit, own in zip(fits, s, strict=True):
        scale = own / np.sqrt(np.diag(fit.covariance))
        inverses.append(np.linalg.inv(fit.covariance * np.outer(scale, scale)))
    mean = np.linalg.solve(np.sum(inverses, axis=0), np.einsum("kij,kj->i", np.array(inverses), X))
    Q = sum(
        float((x - mean) @ inverse @ (x - mean)) for x, inverse in zip(X, inverses, strict=True)
    )
    q = (K - 1) * b
    return float(fisher.sf(Q / q, q, max(blocks - b, 1)))
