"""Results of a study of the encoder resolution: errors of the parameters, residuals, verdict.

With N runs X_k at one level and X_LS from the unperturbed record, by parameter:

    mean      (18)  X = sum X_k / N                 sigma  (19)  = sqrt(sum (X_k - X)^2 / (N - 1))
    %sigma    (20)  = 100 sigma / |X|               %e     (21)  = 100 |1 - X / X_LS|
    interval        X +- t sigma / sqrt(N), t of Student's law with N - 1 degrees of freedom

For the residual, with rho_LS = Y - W X_LS, there are two forms of rho_CESTAC, and two measures of
each form:

    printed   rho_CESTAC = Y - W X, the measured W, as printed below (22)
    own       rho_CESTAC = Y - W_CESTAC X_k, mean of the norms over the runs
    %e(rho)   (22)  = 100 |1 - ||rho_CESTAC|| / ||rho_LS|| |
    increase        = 100 (||rho_CESTAC|| - ||rho_LS||) / ||Y||

As printed, (22) grows to hundreds of per cent where Table 3 says about ten; the increase relative
to ||Y|| has the printed order of magnitude.

The verdict is "practically unbiased" if the %e (21) of all requested parameters are below 1 %,
"biased" if one of these is above 5 %, and "doubtful" between. Parameters whose own %sigma (11) is
large do not decide; the result names the parameters that did. Section 4.1.4 of the chapter calls
the residual (22) the best single indicator, because it covers the whole model: `residual_verdict`
applies the same two limits to its increase. The residual hardly sees a parameter on which the
torques depend little.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import takewhile
from typing import Any, Literal, get_args

import numpy as np
from scipy.special import stdtrit

from runtime.core.cestac.runs import Level, Runs
from runtime.core.least_squares.estimate import Estimate
from runtime.core.rows.observation import Observation
from runtime.core.study import CestacSettings
from runtime.ground.documents import Result, Vector, json_text
from runtime.ground.errors import InputError
from runtime.ground.limits import LIMIT
from runtime.ground.part import (
    BLACK,
    BLUE,
    DOTTED,
    GREEN,
    LIGHT,
    ORANGE,
    PURPLE,
    SKY,
    Figure,
    Part,
)
from runtime.ground.table import Table, csv_text, notebook, number, percentage

Array = np.ndarray

MARKED = ((BLUE, "o"), (ORANGE, "s"), (GREEN, "^"), (PURPLE, "D"), (SKY, "v"), ("#8C6D00", "P"))
VERDICTS = "The verdict is that of the parameters asked for, eq. (21): the estimate is practically unbiased if all of them change by less than 1 %, and biased if one changes by more than 5 %. Beside it stands the rule of section 4.1.4 of the chapter, eq. (22): the same limits for the increase of the residual, which hardly sees a parameter on which the torques depend little."

SCHEMA = "symgen-cestac/1"
"""Kind and version of the JSON layout; `symgen schema --of cestac` prints its JSON Schema."""
JUDGED = "judged"
"""Key of the provenance of a reference: names that study.cestac.columns asks for."""
LEAST_SQUARES = "LS"
Verdict = Literal["unbiased", "doubtful", "biased"]


@dataclass(frozen=True, eq=False)
class LevelResult:
    """Results for one pair (level) of position and torque steps: means, errors and verdict.

    Arrays are in the order of the names.

    Attributes
    ----------
    level : Level
        Steps of position and torque.
    runs : Runs
        Estimates of the single runs.
    mean : ndarray, shape (b,), SI
        Mean of the runs, eq. (18).
    sigma : ndarray, shape (b,), SI
        Standard deviation of the runs, eq. (19).
    relative_sigma : ndarray, shape (b,), %
        100 sigma / |mean|, eq. (20).
    e : ndarray, shape (b,), %
        100 |1 - mean / X_LS|, eq. (21).
    half_width : ndarray, shape (b,), SI
        Half width of the Student interval of the mean.
    half_width_percent : ndarray, shape (b,), %
        100 half_width / |X_LS|.
    e_rho : float, %
        Eq. (22) as printed.
    e_rho_own : float, %
        Eq. (22) with the W of each run.
    increase : float, %
        Increase of the residual norm over the norm of Y.
    increase_own : float, %
        The same increase with the W of each run.
    verdict : str
        unbiased, doubtful or biased.
    residual_verdict : str
        Verdict of `increase` alone.
    decided_by : mapping of float, %
        Errors that decided the verdict, by name, largest first; where no parameter decides, the
        error of the residual, rho.
    runs_needed : int
        Number of runs that makes the intervals of the deciding parameters narrower than 1 % of
    X_LS.
    message : str
        The verdict in words.
    """

    level: Level
    runs: Runs
    mean: Vector
    sigma: Vector
    relative_sigma: Vector
    e: Vector
    half_width: Vector
    half_width_percent: Vector
    e_rho: float
    e_rho_own: float
    increase: float
    increase_own: float
    verdict: Verdict
    residual_verdict: Verdict
    decided_by: Mapping[str, float]
    runs_needed: int
    message: str


@dataclass(frozen=True, eq=False)
class Cestac(Result, Part):
    """The result of a study of the encoder resolution, for every rounding step (level).

    Attributes
    ----------
    names : tuple of str
        Parameters, b of them.
    reference : Estimate
        X_LS, the estimate from the measured record.
    levels : tuple of LevelResult
    settings : mapping
        All settings of signals, rows, estimator and study, and the sampling rate: the result
        depends on the bandwidth of the noise.
    provenance : mapping
    notes : tuple of str
        Remarks for the user, a sentence each.
    estimator : str
        Short name of the method in tables; LS for linear least squares, weighted or not.
    """

    names: tuple[str, ...]
    reference: Estimate
    levels: tuple[LevelResult, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    estimator: str = LEAST_SQUARES

    name = "resolution"
    title = "Resolution study"

    @cached_property
    def deciding(self) -> tuple[str, ...]:
        """Names of the parameters that decide the verdict: those with a small %sigma, eq. (11).

        Their %sigma is at most 10 % (DECIDING in limits.toml), and study.cestac.columns names them
        or is "essential" or "all".
        """
        return deciding_names(self.reference)

    @property
    def verdict(self) -> Verdict:
        """Worst verdict of all rounding steps (levels): unbiased, doubtful or biased."""
        return max(
            (result.verdict for result in self.levels),
            key=get_args(Verdict).index,
            default="unbiased",
        )

    @property
    def encoder_steps(self) -> list[LevelResult]:
        """Results for the rounding steps of the encoder alone, without a torque step."""
        return [r for r in self.levels if r.level.delta and not r.level.torque]

    @property
    def enough(self) -> Level | None:
        """Coarsest encoder step such that this step and all finer ones leave the estimate unbiased.

        The value is None if the finest step is not practically unbiased.
        """
        finest_first = sorted(self.encoder_steps, key=lambda r: r.level.delta)
        fine = list(takewhile(lambda r: r.verdict == "unbiased", finest_first))
        return fine[-1].level if fine else None

    @property
    def message(self) -> str:
        """Sentence with the verdict and the largest error, %, at each rounding step."""
        if not self.levels:
            return "Nothing was perturbed."
        by_verdict: dict[str, list[str]] = {}
        for level in self.levels:
            name, error = next(iter(level.decided_by.items()), ("rho", 0.0))
            largest = f"{'the residual' if name == 'rho' else name} {error:.1f} %"
            by_verdict.setdefault(level.verdict, []).append(f"{level.level.label} ({largest})")
        meaning = {"unbiased": "practically unbiased", "doubtful": "doubtful", "biased": "biased"}
        parts = [
            f"{meaning[verdict]} at {', '.join(labels)}" for verdict, labels in by_verdict.items()
        ]
        method = "Least squares" if self.estimator == LEAST_SQUARES else self.estimator
        return f"{method} is {'; '.join(parts)}."

    @property
    def lists_runs(self) -> bool:
        """Whether cestac.json lists every run; for a large study it has only their number."""
        return bool(sum(len(level.runs) for level in self.levels) <= LIMIT.RUNS_LISTED)

    def brief(self) -> str:
        """Return a short text: verdict at each rounding step, then a table of parameter errors."""
        errors = self.error_table()
        return "\n".join([self.message, "", errors.caption, errors.to_text(), *self.notes])

    def to_table(self) -> str:
        """Return the full report as text: tables of means, residuals and errors, and verdicts."""
        means, residual, errors = self.mean_table(), self.residual_table(), self.error_table()
        notes = "\n".join([*(f"{r.level.label}: {r.message}" for r in self.levels), *self.notes])
        below = f"{errors.caption}\n{errors.to_text()}"
        return f"{means.to_text()}\n\n{residual.to_text()}\n\n{notes}\n\n{below}"

    def text(self) -> str:
        """Return the verdicts at every rounding step, after an explanation of both kinds."""
        verdicts = [f"{r.level.label}: {r.message}" for r in self.levels]
        return "\n".join([VERDICTS, *verdicts, *self.notes])

    def tables(self) -> list[Table]:
        """Return three tables: mean estimates, their errors %e, and residuals with the verdicts."""
        return [self.mean_table(), self.error_table(), self.residual_table()]

    def figures(self) -> tuple[Figure, ...]:
        """Return the figure of the parameter errors %e against the encoder step Delta.

        There is no figure without a level of the encoder alone.
        """
        return (error_against_resolution(self),) if self.encoder_steps else ()

    def entries(self) -> dict[str, Any]:
        """Return no entries for estimate.json: the study has a file of its own, cestac.json."""
        return {}

    def files(self) -> dict[str, str]:
        """Return the contents of the files cestac.json and cestac.csv, by file name."""
        return {"cestac.json": self.to_json(), "cestac.csv": cestac_csv(self)}

    def arrays(self) -> dict[str, dict[str, Array]]:
        """Return parameter names, rounding steps and results as arrays for NPZ and MAT files."""
        return {"cestac": cestac_arrays(self)}

    def mean_table(self) -> Table:
        """Return the table of mean estimates: a line per parameter, a column per rounding step."""
        rows = [
            (name, number(self.reference.X[i]), *(number(r.mean[i]) for r in self.levels))
            for i, name in enumerate(self.names)
        ]
        return Table(
            "Mean of the runs (18)",
            ("parameter", self.estimator, *(r.level.label for r in self.levels)),
            rows,
        )

    def error_table(self) -> Table:
        """Return the table of errors %e, eq. (21), and %sigma, eq. (20), at every rounding step.

        The table has one line per parameter; `*` marks parameters that do not decide the verdict,
        "-" parameters whose 95 % interval contains zero.
        """
        reference = self.reference
        own = reference.relative_deviation
        rows = [
            (
                name if name in self.deciding else f"{name} *",
                percentage(reference.relative_sigma[i], own[i]),
                *(
                    f"{percentage(r.e[i], own[i])} ({percentage(r.relative_sigma[i], own[i])})"
                    for r in self.levels
                ),
            )
            for i, name in enumerate(self.names)
        ]
        caption = "%e (21) and, in brackets, %sigma (20); * does not decide"
        return Table(
            caption,
            ("parameter", f"%sigma of {self.estimator}", *(r.level.label for r in self.levels)),
            rows,
        )

    def residual_table(self) -> Table:
        """Return the table of residual errors and verdicts, with one column per rounding step.

        The table has both forms of %e(rho), the increase of the residual norm, and the verdicts.
        """
        levels = self.levels
        rows = [
            (
                "largest error of what decides, %",
                *(number(max(r.decided_by.values(), default=np.nan), ".2f") for r in levels),
            ),
            ("%e(rho) (22), measured W, as printed", *(number(r.e_rho, ".2f") for r in levels)),
            ("%e(rho) (22), each run's own W", *(number(r.e_rho_own, ".2f") for r in levels)),
            (
                "increase of the norm in % of |Y|, measured W",
                *(number(r.increase, ".2f") for r in levels),
            ),
            (
                "increase of the norm in % of |Y|, own W",
                *(number(r.increase_own, ".2f") for r in levels),
            ),
            ("verdict of the parameters, (21)", *(r.verdict for r in levels)),
            (
                "verdict of the residual, (22): increase, measured W",
                *(r.residual_verdict for r in levels),
            ),
            ("runs for intervals within 1 %", *(str(r.runs_needed) for r in levels)),
        ]
        return Table("Residual and verdict", ("reading", *(r.level.label for r in levels)), rows)

    def _repr_html_(self) -> str:
        return notebook(
            [f"Resolution study: {self.verdict}"],
            self.residual_table(),
            self.mean_table(),
            self.error_table(),
        )

    def summary(self) -> dict[str, Any]:
        """Return the content of cestac.json as a mapping."""
        return {
            "schema": SCHEMA,
            "names": self.names,
            "X_LS": self.reference.X,
            "relative_sigma_LS": self.reference.relative_sigma,
            "deciding": self.deciding,
            "verdict": self.verdict,
            "enough": self.enough.label if self.enough else None,
            "levels": [self._level_summary(level) for level in self.levels],
            "settings": self.settings,
            "provenance": self.provenance,
            "notes": self.notes,
        }

    def _level_summary(self, level: LevelResult) -> dict[str, Any]:
        """Return the results at one rounding step for cestac.json; a long list of runs is left out.

        The number of runs is always given.
        """
        shown = {f.name: getattr(level, f.name) for f in fields(level)}
        runs = list(level.runs) if self.lists_runs else None
        return {**shown, "runs": runs, "run_count": len(level.runs)}


def error_against_resolution(result: Cestac, names: Sequence[str] = ()) -> Figure:
    """Draw the parameter error %e, eq. (21), against the encoder step Delta, on logarithmic axes.

    The limits of the verdict and the increase of the residual are drawn too.

    names : parameters drawn in colour; default: the six deciding ones that change most. The others
    are grey.
    """
    levels = [level for level in result.levels if level.level.delta and not level.level.torque]
    levels.sort(key=lambda level: level.level.delta)
    lengths = {result.reference.units.get(name, "") for name in result.names} & {"N*s/m", "kg"}
    delta = np.array([level.level.delta for level in levels])
    e = np.array([level.e for level in levels]).reshape(len(levels), -1)
    largest = dict(zip(result.names, np.nan_to_num(e).max(axis=0), strict=True))
    most = sorted(result.deciding, key=lambda name: -largest[name])[: len(MARKED)]
    coloured = [name for name in names if name in result.names] or most

    def draw(ax: Any) -> None:
        def line(values: np.ndarray, **style: Any) -> None:
            ax.plot(delta, np.where(np.isfinite(values) & (values > 0), values, np.nan), **style)

        for name in result.deciding:
            if name not in coloured:
                line(e[:, result.names.index(name)], color=LIGHT, linewidth=0.8, zorder=1)
        for (color, marker), name in zip(MARKED, coloured, strict=False):
            style: Any = {"color": color, "marker": marker, "markersize": 5, "linewidth": 1.4}
            line(e[:, result.names.index(name)], label=name, **style)
        increase = np.array([abs(level.increase) for level in levels])
        line(increase, color=BLACK, linestyle="--", linewidth=1.8, label="residual, of |Y|")
        ax.set_ylim(0.01, 1000)
        place: Any = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
        for limit in (LIMIT.NEGLIGIBLE, LIMIT.BIASED):
            ax.axhline(limit, color=BLACK, linewidth=0.9, linestyle=DOTTED)
            ax.annotate(f"{limit:g} %", (1.0, limit), xytext=(3, 0), va="center", **place)
        labels = [level.level.label.replace("2*pi/", "2π/") for level in levels]
        ax.set_xticks(delta, labels, rotation=30, ha="right", fontsize=8)
        ax.set_xlabel(f"resolution Δ, {'m' if lengths else 'rad'}")
        ax.set_ylabel("%e: change of the estimate, %")

    return Figure(
        f"%e against resolution; dotted: the limits of the verdict, {LIMIT.NEGLIGIBLE:g} % and {LIMIT.BIASED:g} %; dashed: increase of the residual norm in % of |Y|; grey: the other parameters that decide",
        "Change of the estimates in per cent against encoder resolution, logarithmic axes",
        [draw],
        name="resolution",
        cell=(6.4, 4.0),
        legend=4,
        letters=8,
        logarithmic=True,
    )


def cestac_arrays(result: Cestac) -> dict[str, Array]:
    """Collect parameter names, rounding steps and results of a study in arrays for NPZ and MAT.

    Their shapes are (b,), (levels,) and (levels, b).
    """
    reference, levels, b = result.reference, result.levels, len(result.names)
    by_parameter = ("mean", "sigma", "relative_sigma", "e", "half_width", "half_width_percent")
    by_level = ("e_rho", "e_rho_own", "increase", "increase_own", "runs_needed")
    return {
        "names": texts(result.names),
        "units": texts(reference.units.get(name, "") for name in result.names),
        "deciding": np.array([name in result.deciding for name in result.names], dtype=bool),
        "X_LS": reference.X,
        "relative_sigma_LS": reference.relative_sigma,
        "labels": texts(r.level.label for r in levels),
        "delta": np.array([r.level.delta for r in levels]),
        "torque": np.array([r.level.torque for r in levels]),
        **{
            name: np.array([getattr(r, name) for r in levels]).reshape(len(levels), b)
            for name in by_parameter
        },
        **{name: np.array([getattr(r, name) for r in levels]) for name in by_level},
        "verdicts": texts(r.verdict for r in levels),
        **{
            name: np.array(json_text(part))
            for name, part in (("settings", result.settings), ("provenance", result.provenance))
        },
    }


def cestac_csv(result: Cestac) -> str:
    """Write cestac.csv: one line per parameter and rounding step, and one for each residual.

    The residual is called "rho"; its e is %e(rho), and the last column is its increase.
    """
    reference, numbers = result.reference, ("mean", "sigma", "relative_sigma", "e", "half_width")
    rows: list[Sequence[Any]] = []
    for r in result.levels:
        place = (r.level.label, float(r.level.delta), float(r.level.torque))
        for i, name in enumerate(result.names):
            values = (float(x[i]) for x in (reference.X, *(getattr(r, own) for own in numbers)))
            unit, decides = reference.units.get(name, ""), int(name in result.deciding)
            rows.append((*place, name, unit, *values, decides, ""))
        rows.append((*place, "rho", *[""] * 5, float(r.e_rho), "", 1, float(r.increase)))
    header = ("level", "delta", "torque", "name", "unit", "X_LS", *numbers, "decides", "increase")
    return csv_text(header, rows)


def texts(words: Iterable[str]) -> Array:
    """Convert strings to a NumPy array of strings."""
    return np.array(list(words), dtype=np.str_)


def names_judged(settings: CestacSettings) -> dict[str, tuple[str, ...]]:
    """Return the parameters listed in `cestac.columns` of a study, for the provenance."""
    return {} if isinstance(settings.columns, str) else {JUDGED: settings.columns}


def deciding_names(reference: Estimate) -> tuple[str, ...]:
    """Find the parameters that decide the verdict: %sigma, eq. (11), is at most 10 % (DECIDING of
    the limits).
    """
    asked = reference.provenance.get(JUDGED, reference.names)
    return tuple(
        name
        for name, relative in zip(reference.names, reference.relative_sigma, strict=True)
        if relative <= LIMIT.DECIDING and name in asked
    )


def level_result(
    level: Level, runs: Runs, measured: Observation, reference: Estimate
) -> LevelResult:
    """Compute means, standard deviations, errors and verdict at one rounding step (level).

    Eqs. (18) to (22).

    measured : the unperturbed system with the columns of the runs. reference : estimate from this
    system, with the residual norm of its rows.
    """
    found = np.isfinite(runs.X).all(axis=1)
    runs, failed = runs.where(found), int(np.sum(~found))
    X, N = runs.X, len(runs)
    if N < 2:
        raise InputError(
            f"{reference.method} finds an estimate in only {N} of {N + failed} runs at "
            f"{level.label}; use smaller steps, or another method"
        )
    mean, sigma = X.mean(axis=0), X.std(axis=0, ddof=1)
    norm_Y = float(np.linalg.norm(measured.Y))
    rho_ls = reference.residual_norm
    rho = float(np.linalg.norm(measured.Y - measured.W @ mean))
    own = float(runs.residual_norm.mean())
    with np.errstate(divide="ignore", invalid="ignore"):
        e = 100 * np.abs(1 - mean / reference.X)
        spread = 100 * sigma / np.abs(reference.X)
        relative_sigma = 100 * sigma / np.abs(mean)
    half = float(stdtrit(N - 1, (1 + LIMIT.STUDENT_PROBABILITY) / 2)) / np.sqrt(N)
    decisive = [reference.names.index(name) for name in deciding_names(reference)]
    errors = {reference.names[i]: float(e[i]) for i in decisive}
    e_rho = _relative_change(rho, rho_ls)
    verdict, decided_by = _verdict(errors or {"rho": e_rho})
    needed = runs_needed(float(spread[decisive].max(initial=0.0)))
    return LevelResult(
        level=level,
        runs=runs,
        mean=mean,
        sigma=sigma,
        relative_sigma=relative_sigma,
        e=e,
        half_width=half * sigma,
        half_width_percent=half * spread,
        e_rho=e_rho,
        e_rho_own=_relative_change(own, rho_ls),
        increase=100 * (rho - rho_ls) / norm_Y,
        increase_own=100 * (own - rho_ls) / norm_Y,
        verdict=verdict,
        residual_verdict=_verdict_of_error(100 * abs(rho - rho_ls) / norm_Y),
        decided_by=decided_by,
        runs_needed=needed,
        message=_message(
            verdict,
            decided_by,
            reference,
            decisive,
            N,
            float(half * spread[decisive].max(initial=0.0)),
            needed,
        )
        + (f" {failed} of {N + failed} runs found no estimate and are left out." if failed else ""),
    )


def runs_needed(spread: float) -> int:
    """Find how many runs give means with confidence intervals of +-1 % (NEGLIGIBLE in limits.toml).

    spread : 100 sigma / |X_LS|.
    """
    return 2 + bisect_left(
        range(2, LIMIT.RUNS_ANSWERED),
        True,
        key=lambda N: bool(
            stdtrit(N - 1, (1 + LIMIT.STUDENT_PROBABILITY) / 2) * spread / np.sqrt(N)
            < LIMIT.NEGLIGIBLE
        ),
    )


def _verdict(errors: Mapping[str, float]) -> tuple[Verdict, dict[str, float]]:
    """Return the verdict at one rounding step, and the errors that decided it, largest first.

    If all errors are negligible, only the largest is returned.
    """
    ordered = sorted(errors.items(), key=lambda item: -item[1])
    verdict = _verdict_of_error(ordered[0][1])
    if verdict == "unbiased":
        return verdict, dict(ordered[:1])
    limit = LIMIT.BIASED if verdict == "biased" else LIMIT.NEGLIGIBLE
    return verdict, {name: value for name, value in ordered if value >= limit}


def _verdict_of_error(error: float) -> Verdict:
    """Return the verdict for an error, in %, of a parameter or of the residual norm."""
    return (
        "unbiased" if error < LIMIT.NEGLIGIBLE else "biased" if error > LIMIT.BIASED else "doubtful"
    )


def _message(
    verdict: str,
    decided_by: Mapping[str, float],
    reference: Estimate,
    decisive: Sequence[int],
    N: int,
    half: float,
    needed: int,
) -> str:
    named = ", ".join(f"{name} {value:.2f} %" for name, value in decided_by.items())
    asked = reference.provenance.get(JUDGED, reference.names)
    undecided = [
        name for i, name in enumerate(reference.names) if i not in decisive and name in asked
    ]
    text = {
        "unbiased": (
            "practically unbiased, all errors of the deciding parameters below "
            f"{LIMIT.NEGLIGIBLE:g} % (largest: {named})."
        ),
        "doubtful": (
            f"doubtful, errors between {LIMIT.NEGLIGIBLE:g} and {LIMIT.BIASED:g} %: {named}."
        ),
        "biased": f"biased, errors above {LIMIT.BIASED:g} %: {named}.",
    }[verdict]
    if undecided:
        text += (
            f" Without effect on this verdict, because their %sigma exceeds {LIMIT.DECIDING:g} "
            f"%: {', '.join(undecided)}."
        )
    if half >= LIMIT.NEGLIGIBLE:
        text += (
            f" After {N} runs, the means are uncertain by {half:.1f} %; about {needed} runs reduce "
            f"this to {LIMIT.NEGLIGIBLE:g} %."
        )
    return text


def _relative_change(norm: float, of: float) -> float:
    """Compute the change of a residual norm relative to the residual norm `of`, %, eq. (22)."""
    return 100 * abs(1 - norm / of) if of > 0 else float("inf" if norm > 0 else 0.0)
