"""Tests of the assumptions behind the standard deviations and the essential parameters.

    bootstrap     blocks of time are drawn again with replacement, least squares each time: this
                  gives standard deviations without the assumption of independent residuals, to
                  compare with sigma (10) and the corrected one
    whiteness     are the residuals of every joint independent (`runtime.core.residuals`)?
    F-test        does a removed parameter have an effect? Removing q of b parameters raises the
                  squared residual norm S from S_0 to S_q:
                  F = (S_q - S_0)/q / (S_0/(r - b)), F(q, r - b) without effect; r counts only the
                  effective number of rows (N_eff)
    sensitivity   which parameters are added or removed if the threshold on sigma_rho changes?

S_q = ratio^2 (r - b + q) S_0/(r - b), with the ratio of sigma_rho from the steps of the elimination
(`runtime.core.essential`).

References: Seber and Lee (2003), section 4.3, for F.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import fdtrc

from runtime.core.essential import Essential
from runtime.core.least_squares.block_covariance import gram_solution, scatter
from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import System
from runtime.core.model import SIGNED, GeneratedModel, is_form
from runtime.core.residuals import Whiteness, effective_share, whiteness
from runtime.core.validation import JointComparison
from runtime.ground.documents import Result
from runtime.ground.limits import LIMIT
from runtime.ground.table import Table

Array = np.ndarray

SEED = 1


@dataclass(frozen=True, eq=False)
class BlockBootstrap:
    """Standard deviations of the essential parameters: by eq. (10), jackknife and bootstrap.

    Attributes
    ----------
    names : tuple of str
        The b parameters.
    sigma : ndarray, shape (b,), SI
        Eq. (10).
    corrected : ndarray, shape (b,), SI
        Jackknife over blocks of time, or over bands of speed.
    drawn : ndarray, shape (b,), SI
        Bootstrap: blocks of time drawn again with replacement.
    blocks : int
        Number of blocks.
    length : float, s
        Length of a block.
    runs, seed : int
        Draws, and the seed of their random numbers.
    """

    names: tuple[str, ...]
    sigma: Array
    corrected: Array
    drawn: Array
    blocks: int
    length: float
    runs: int = LIMIT.BOOTSTRAP_RUNS
    seed: int = SEED

    @property
    def ratio(self) -> Array:
        """Standard deviations from the bootstrap, divided by those from eq. (10), shape (b,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.drawn / self.sigma)


@dataclass(frozen=True)
class FTest:
    """F-tests after the removal of one parameter: do the removed parameters have an effect?

    Attributes
    ----------
    name : str
        Parameter removed.
    ratio : float
        sigma_rho over its first value.
    F, p : float
        Statistic and probability of all removals up to this one.
    F_step, p_step : float
        Statistic and probability of this removal against the step before.
    removed : bool
        Whether the threshold allowed the removal.
    """

    name: str
    ratio: float
    F: float
    p: float
    F_step: float
    p_step: float
    removed: bool

    @property
    def significant(self) -> bool:
        """Whether p is below 5 %: at least one of the parameters removed so far has an effect."""
        return bool(self.p < LIMIT.SIGNIFICANT)


@dataclass(frozen=True, eq=False)
class Uncertainty(Result):
    """Tests of the essential parameters of one identification: bootstrap, whiteness, F-tests.

    Attributes
    ----------
    bootstrap : BlockBootstrap
        Standard deviations by three methods.
    whiteness : tuple of Whiteness
        Residuals by joint.
    f_tests : tuple of FTest
        Steps of the elimination.
    sets : tuple of (float, int, tuple of str)
        For each threshold: the threshold, the number of parameters left, and the names that differ
        from the set used ("-": removed in addition, "+": not removed).
    all_count : int
        Number of all parameters.
    memory : float, s
        Correlation time of the residuals: rows divided by effective rows, in time.
    """

    bootstrap: BlockBootstrap
    whiteness: tuple[Whiteness, ...]
    f_tests: tuple[FTest, ...]
    sets: tuple[tuple[float, int, tuple[str, ...]], ...]
    all_count: int
    memory: float

    @property
    def kept_by_f_test(self) -> int:
        """Number of parameters left before the first removal that an F-test finds significant."""
        return self.all_count - next(
            (k for k, test in enumerate(self.f_tests) if test.significant), len(self.f_tests)
        )

    @property
    def verdict(self) -> tuple[str, ...]:
        """The results of the tests, one sentence for each test."""
        ratio = self.bootstrap.ratio[np.isfinite(self.bootstrap.ratio)]
        spread = (
            f"from {ratio.min():.1f} to {ratio.max():.1f}, median {np.median(ratio):.1f}"
            if len(ratio)
            else "unknown"
        )
        coloured = [w.joint for w in self.whiteness if not w.white]
        white = f"not white on joint {', '.join(coloured)}" if coloured else "white on every joint"
        share = 100 * effective_share(self.whiteness)
        kept = self.all_count - sum(test.removed for test in self.f_tests)
        long = self.memory > LIMIT.BLOCK_MEMORY * self.bootstrap.length
        return (
            *((self.too_short,) if long else ()),
            (
                f"Deviations by blocks drawn again are {spread} times sigma (10): "
                f"{self.bootstrap.blocks} blocks of {self.bootstrap.length:.3g} s, "
                f"{self.bootstrap.runs} draws."
            ),
            (
                f"Residuals are {white} (Ljung-Box, 5 %); the effective number of rows is {share:.0f} % of "
                "their number."
            ),
            (
                f"The threshold keeps {kept} parameters, an F-test at 5 % on the rows that count "
                f"keeps {self.kept_by_f_test}."
            ),
        )

    @property
    def too_short(self) -> str:
        """Sentence, with a remedy, on residuals that are correlated for longer than a block."""
        return (
            f"The residuals are correlated over {self.memory:.2g} s, but the blocks last "
            f"{self.bootstrap.length:.2g} s, so the corrected deviations may be too small. Find "
            "the cause of such slow errors (friction, temperature, an offset), record longer, or "
            "set longer blocks: estimate: {options: {block: ...}}, s."
        )

    def to_table(self) -> str:
        """Write the results of the tests as sentences, then as tables."""
        return "\n\n".join(["\n".join(self.verdict), *(own.to_text() for own in self.tables())])

    def to_text(self) -> str:
        """Write the results of the tests, the standard deviations and the residuals by joint."""
        return "\n\n".join(["\n".join(self.verdict), *(own.to_text() for own in self.tables()[:2])])

    def tables(self) -> tuple[Table, ...]:
        """Return four tables: standard deviations, residuals, F-tests, parameters by threshold."""
        drawn = self.bootstrap
        deviations = (drawn.sigma, drawn.corrected, drawn.drawn)
        columns = [[f"{x:.3g}" for x in own] for own in deviations]
        columns.append([f"{x:.2f}" for x in drawn.ratio])
        return (
            Table(
                "Deviations: eq. (10), corrected for correlation, blocks of time drawn again",
                ("parameter", "sigma (10)", "corrected", "drawn", "drawn / (10)"),
                list(zip(drawn.names, *columns, strict=True)),
            ),
            Table(
                "Residuals by joint: correlation of neighbours, Ljung-Box, rows that count, "
                "spectrum",
                (
                    *("joint", "rows", "rho_1", "Q", "p", "effective rows", "peak Hz"),
                    "half of the power below Hz",
                ),
                [
                    (
                        *(w.joint, str(w.rows), f"{w.correlation[0]:+.2f}", f"{w.Q:.4g}"),
                        *(f"{w.p:.2g}", f"{w.effective_rows:.0f}", f"{w.peak:.3g}"),
                        f"{w.half:.3g}",
                    )
                    for w in self.whiteness
                ],
            ),
            Table(
                "F-tests along the trail; rows that count instead of rows",
                ("removed", "sigma_rho ratio", "F", "p", "F of this one", "p of this one"),
                [
                    (
                        t.name if t.removed else f"{t.name} (kept)",
                        *(f"{t.ratio:.5f}", f"{t.F:.3g}", f"{t.p:.2g}"),
                        *(f"{t.F_step:.3g}", f"{t.p_step:.2g}"),
                    )
                    for t in self.f_tests
                ],
            ),
            Table(
                "Essential parameters by threshold; - removed besides, + kept besides",
                ("threshold", "parameters", "against the set used"),
                [
                    (f"{threshold:g}", str(count), " ".join(names) or "the same")
                    for threshold, count, names in self.sets
                ],
            ),
        )

    def summary(self) -> dict[str, Any]:
        """Return the results of the tests as a mapping for JSON."""
        return {
            "verdict": self.verdict,
            "scatter": {**vars(self.bootstrap), "ratio": self.bootstrap.ratio},
            "whiteness": [{**vars(w), "white": w.white} for w in self.whiteness],
            "f_tests": self.f_tests,
            "kept_by_f_test": self.kept_by_f_test,
            "sets": [
                {"threshold": threshold, "count": count, "difference": names}
                for threshold, count, names in self.sets
            ],
        }


def uncertainty(
    system: System,
    essential: Essential,
    comparison: Sequence[JointComparison],
) -> Uncertainty:
    """Test the essential parameters of a fit: bootstrap, whiteness, F-tests, other thresholds.

    Parameters
    ----------
    system : System
        Rows from which the parameters were estimated, as linear least squares weighs them.
    essential : Essential
        Parameters, and their elimination.
    comparison : sequence of JointComparison
        Residuals whose whiteness is tested.
    """
    rate = system.observation.rate
    by_joint = whiteness(comparison, rate)
    share = effective_share(by_joint)
    return Uncertainty(
        bootstrap=block_bootstrap(system, essential.estimate),
        whiteness=by_joint,
        f_tests=f_tests(essential, share),
        sets=sets(essential),
        all_count=len(essential.all_parameters.names),
        memory=1 / (share * rate) if share > 0 else 0.0,
    )


def block_bootstrap(
    system: System,
    fit: Estimate,
    *,
    runs: int = LIMIT.BOOTSTRAP_RUNS,
    seed: int = SEED,
) -> BlockBootstrap:
    """Compute the standard deviations of an estimate by a bootstrap over blocks of time.

    system : rows as linear least squares weighs them, with the columns of `fit` among others. runs : number of draws. The weights of the rows do not change.
    """
    system = system.select(fit.names)
    blocks, drawn = list(system.block_rows()), np.full(len(fit.names), np.nan)
    if len(blocks) > 1 and fit.status == "ok":
        drawn = scatter(blocks, gram_solution, runs, seed)
    length = float(fit.settings["residual_block"])
    return BlockBootstrap(
        fit.names, fit.sigma, fit.sigma_corrected, drawn, len(blocks), length, runs, seed
    )


def f_tests(essential: Essential, share: float = 1.0) -> tuple[FTest, ...]:
    """Test by F-tests whether the removed parameters have a significant effect on the torques.

    There are no tests without more rows than parameters. share : effective number of rows divided
    by the number of rows.
    """
    r, b = essential.all_parameters.rows, len(essential.all_parameters.names)
    if r <= b:
        return ()
    tests = []
    before = 1.0  # S over S_0
    for q, step in enumerate(essential.trail, start=1):
        S = step.ratio**2 * (r - b + q) / max(r - b, 1)
        free = max(share * r - b, 1.0)
        F, F_step = (S - 1) / q * free, (S - before) / before * (free + q - 1)
        tests.append(
            FTest(
                step.name,
                step.ratio,
                F,
                float(fdtrc(q, free, max(F, 0))),
                F_step,
                float(fdtrc(1, free + q - 1, max(F_step, 0))),
                step.removed,
            )
        )
        before = S
    return tuple(tests)


def sets(essential: Essential) -> tuple[tuple[float, int, tuple[str, ...]], ...]:
    """Compare the essential parameters at each threshold with those at the threshold that is used.

    Return for each threshold: the threshold, the number of parameters left, and the names that
    differ from the used set ("-": removed in addition, "+": not removed).
    """
    steps = [*essential.trail, *essential.further]
    names = essential.all_parameters.names
    by_threshold = []
    for threshold, count in essential.counts.items():
        gone = [step.name for step in steps[: len(names) - count]]
        differs = [f"-{name}" for name in gone if name in essential.names] + [
            f"+{name}" for name in essential.removed if name not in gone
        ]
        by_threshold.append((threshold, count, tuple(differs)))
    return tuple(by_threshold)


def negative_elements(model: GeneratedModel, fit: Estimate) -> tuple[str, ...]:
    """Return the friction parameters and motor inertias of a fit that are certainly below zero.

    A value is certainly below zero if it is several standard deviations below (CERTAIN_SIGN in
    limits.toml), by the larger of the stated and the corrected deviation. Parameters that are
    regrouped with others are not tested.
    """
    elements: Mapping[str, Any] = getattr(model, "ELEMENTS", {})
    signed = {
        name for name, (kind, _, acts) in elements.items() if kind in SIGNED and not is_form(acts)
    }
    sigma = np.fmax(fit.sigma, fit.sigma_corrected)
    return tuple(
        name
        for i, name in enumerate(fit.names)
        if name in signed and fit.X[i] < -LIMIT.CERTAIN_SIGN * sigma[i]
    )
