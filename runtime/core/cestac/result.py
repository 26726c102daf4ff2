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

By the chapter, the estimate is practically unbiased if the effect of the encoder is negligible
against model errors and noise of the torques: %e (21) below 1 %; above 5 % it is biased. The effect
of model errors and noise on a parameter is its 95 % interval +-h, in %, corrected for slow
residuals. So a change is divided by what is negligible for the parameter,

    weighed = %e / max(1 %, h/10),

and the verdict is "practically unbiased" if this number is below 1 for all requested parameters,
"biased" if it is above 5 for one of them, and "doubtful" between. A biased parameter changes by
more than 5 % and by more than h/2, about its standard deviation. With normal errors, a bias of h/10
leaves 94.5 % of the 95 % intervals right, a bias of h/2 83 %. `chapter_verdict` has the limits 1 %
and 5 % alone, for all requested parameters whose %sigma (11) is at most 10 % (MAIN in limits.toml):
the chapter excepts MX3, OFFSET4 and OFFSET6, which "do not contribute significantly". Its section
4.1.4 calls the residual (22) the best single indicator, because it covers the whole model:
`residual_verdict` applies the same two limits to its increase. The residual hardly sees a parameter
on which the torques depend little.
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
VERDICTS = "The verdict is that of the parameters asked for, eq. (21): the estimate is practically unbiased if each of them changes by less than 1 % or by less than a tenth of its 95 % interval, and biased if one changes by more than 5 % and by more than half of its interval. Beside it stand the limits of the chapter, 1 % and 5 % whatever the interval, and the rule of its section 4.1.4, eq. (22): the same limits for the increase of the residual, which hardly sees a parameter on which the torques depend little."

SCHEMA = "symgen-cestac/1"
"""Kind and version of the JSON layout; `symgen schema --of cestac` prints its JSON Schema."""
JUDGED = "judged"
"""Key of the provenance of a reference: names that study.cestac.columns asks for."""
LEAST_SQUARES = "LS"
NOTHING_KNOWN = (
    "The 95 % intervals of all parameters asked for contain zero, so this record cannot judge an "
    "encoder: record a motion that excites the joints more"
)
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
    weighed : ndarray, shape (b,)
        e in units of what is negligible for the parameter: 1 %, or a tenth of its 95 % interval.
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
    chapter_verdict : str
        Verdict by the limits 1 % and 5 % of e, whatever the intervals, for the main parameters.
    residual_verdict : str
        Verdict of `increase` alone.
    decided_by : mapping of float, %
        Changes %e of the parameters that decided the verdict, by name, the largest `weighed` first.
    runs_needed : int
        Number of runs that makes the Student intervals of the deciding parameters narrower than
        what is negligible for them.
    message : str
        The verdict in words.
    """

    level: Level
    runs: Runs
    mean: Vector
    sigma: Vector
    relative_sigma: Vector
    e: Vector
    weighed: Vector
    half_width: Vector
    half_width_percent: Vector
    e_rho: float
    e_rho_own: float
    increase: float
    increase_own: float
    verdict: Verdict
    chapter_verdict: Verdict
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
        """Names of the parameters that decide the verdict: those that study.cestac.columns names.

        They are all parameters if it is "essential" or "all".
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
    def unit(self) -> str:
        """Unit of the encoder steps: "rad", "m", or "rad or m" at joints of both kinds."""
        units = {*self.reference.units.values()}
        slides, turns = units & {"N*s/m", "kg"}, units & {"N*m*s/rad", "kg*m**2"}
        if not slides or self.settings.get("cestac", {}).get("side") == "motor":
            return "rad"
        return "rad or m" if turns else "m"

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
            name, error = next(iter(level.decided_by.items()))
            by_verdict.setdefault(level.verdict, []).append(
                f"{level.level.text(self.unit)} ({name} {error:.1f} %)"
            )
        meaning = {"unbiased": "practically unbiased", "doubtful": "doubtful", "biased": "biased"}
        parts = [
            f"{meaning[verdict]} at {', '.join(labels)}" for verdict, labels in by_verdict.items()
        ]
        method = "Least squares" if self.estimator == LEAST_SQUARES else self.estimator
        return f"{method} is {'; '.join(parts)}."

    @property
    def reasons(self) -> tuple[str, ...]:
        """Sentences on parameters whose interval decides the verdict at an encoder or torque step.

        They are on the parameter that decides, and on the one that changes most in per cent if the
        limits of the chapter, 1 % and 5 %, give a worse verdict.
        """
        half = 1.96 * self.reference.relative_deviation
        worse, main = get_args(Verdict).index, main_columns(self.reference)
        if not known_names(self.reference):
            return (f"{NOTHING_KNOWN}.",)
        told = []
        for r in self.levels:
            shown = [self.names.index(next(iter(r.decided_by)))]
            if worse(r.chapter_verdict) > worse(r.verdict):
                shown.append(max(main, key=lambda i: r.e[i]))
            told += [
                f"{r.level.text(self.unit)}: {_against(self.names[i], float(r.e[i]), float(half[i]))}."
                for i in dict.fromkeys(shown)
                if half[i] > 2 * LIMIT.BIASED
            ]
        return tuple(told)

    @property
    def lists_runs(self) -> bool:
        """Whether cestac.json lists every run; for a large study it has only their number."""
        return bool(sum(len(level.runs) for level in self.levels) <= LIMIT.RUNS_LISTED)

    def brief(self) -> str:
        """Return a short text: verdict at each rounding step, then a table of parameter errors."""
        errors = self.error_table()
        head = [self.message, *self.reasons]
        return "\n".join([*head, "", errors.caption, errors.to_text(), *self.notes])

    def to_table(self) -> str:
        """Return the full report as text: tables of means, residuals and errors, and verdicts."""
        means, residual, errors = self.mean_table(), self.residual_table(), self.error_table()
        notes = "\n".join(
            [*(f"{r.level.text(self.unit)}: {r.message}" for r in self.levels), *self.notes]
        )
        below = f"{errors.caption}\n{errors.to_text()}"
        return f"{means.to_text()}\n\n{residual.to_text()}\n\n{notes}\n\n{below}"

    def text(self) -> str:
        """Return the verdicts at every rounding step, after an explanation of both kinds."""
        verdicts = [f"{r.level.text(self.unit)}: {r.message}" for r in self.levels]
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
            ("parameter", self.estimator, *(r.level.text(self.unit) for r in self.levels)),
            rows,
        )

    def error_table(self) -> Table:
        """Return the table of errors %e, eq. (21), and %sigma, eq. (20), at every rounding step.

        The table has one line per parameter, with half of its 95 % interval, corrected for slow
        residuals; `*` marks parameters that do not decide the verdict, "-" parameters whose
        interval contains zero.
        """
        reference = self.reference
        own = reference.relative_deviation
        rows = [
            (
                name if name in self.deciding else f"{name} *",
                percentage(reference.relative_sigma[i], own[i]),
                percentage(1.96 * own[i], own[i]),
                *(
                    f"{percentage(r.e[i], own[i])} ({percentage(r.relative_sigma[i], own[i])})"
                    for r in self.levels
                ),
            )
            for i, name in enumerate(self.names)
        ]
        caption = "Change %e (21) and, in brackets, %sigma (20); * does not decide"
        header = ("parameter", f"%sigma of {self.estimator}", "+- 95 %, %")
        return Table(caption, (*header, *(r.level.text(self.unit) for r in self.levels)), rows)

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
            ("verdict of the parameters, (21) and intervals", *(r.verdict for r in levels)),
            (
                f"verdict of the chapter, (21): {LIMIT.NEGLIGIBLE:g} % and {LIMIT.BIASED:g} %",
                *(r.chapter_verdict for r in levels),
            ),
            (
                "verdict of the residual, (22): increase, measured W",
                *(r.residual_verdict for r in levels),
            ),
            ("runs for means within what is negligible", *(str(r.runs_needed) for r in levels)),
        ]
        return Table(
            "Residual and verdict", ("reading", *(r.level.text(self.unit) for r in levels)), rows
        )

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
        ax.set_xlabel(f"resolution Δ, {result.unit}")
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
    """Return the parameters that decide the verdict: those that study.cestac.columns names."""
    return tuple(reference.provenance.get(JUDGED, reference.names))


def known_names(reference: Estimate) -> tuple[str, ...]:
    """Return the parameters that decide the verdict and whose 95 % interval does not contain zero."""
    known = dict(zip(reference.names, 1.96 * reference.relative_deviation < 100, strict=True))
    return tuple(name for name in deciding_names(reference) if known[name])


def main_columns(reference: Estimate) -> list[int]:
    """Find the indices of the requested parameters with %sigma, eq. (11), of at most 10 %."""
    asked = deciding_names(reference)
    return [
        i
        for i, name in enumerate(reference.names)
        if name in asked and reference.relative_sigma[i] <= LIMIT.MAIN
    ]


def negligible(reference: Estimate) -> Vector:
    """Compute the change of each parameter that is negligible, shape (b,), % of |X_LS|.

    It is 1 %, or a tenth of h if that is more, with +-h the 95 % interval, corrected for slow
    residuals.
    """
    h = 1.96 * reference.relative_deviation
    return np.asarray(np.fmax(LIMIT.NEGLIGIBLE, LIMIT.NEGLIGIBLE / LIMIT.BIASED * h / 2))


def weighed_change(change: Array, reference: Estimate) -> Array:
    """Divide changes of the parameters, shape (..., b), %, by what is negligible for each.

    The limits of the result are those of the chapter: 1, and 5 for a bias. A value of
    exactly zero gives nan.
    """
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(change) / negligible(reference))


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
    weighed = np.nan_to_num(weighed_change(e, reference), posinf=np.inf)
    verdict, decided_by = _verdict({reference.names[i]: float(weighed[i]) for i in decisive})
    main = max((float(e[i]) for i in main_columns(reference)), default=0.0)
    uncertain = np.nan_to_num(weighed_change(spread, reference)[decisive]).max()
    needed = runs_needed(float(uncertain))
    return LevelResult(
        level=level,
        runs=runs,
        mean=mean,
        sigma=sigma,
        relative_sigma=relative_sigma,
        e=e,
        weighed=weighed,
        half_width=half * sigma,
        half_width_percent=half * spread,
        e_rho=_relative_change(rho, rho_ls),
        e_rho_own=_relative_change(own, rho_ls),
        increase=100 * (rho - rho_ls) / norm_Y,
        increase_own=100 * (own - rho_ls) / norm_Y,
        verdict=verdict,
        chapter_verdict=verdict_of(main),
        residual_verdict=verdict_of(100 * abs(rho - rho_ls) / norm_Y),
        decided_by={name: float(e[reference.names.index(name)]) for name in decided_by},
        runs_needed=needed,
        message=_message(verdict, decided_by, e, reference, N, float(half * uncertain), needed)
        + (f" {failed} of {N + failed} runs found no estimate and are left out." if failed else ""),
    )


def runs_needed(spread: float) -> int:
    """Find how many runs give means whose Student intervals are negligible for the parameter.

    spread : standard deviation of the runs, in units of what is negligible for the parameter.
    """
    return 2 + bisect_left(
        range(2, LIMIT.RUNS_ANSWERED),
        True,
        key=lambda N: bool(
            stdtrit(N - 1, (1 + LIMIT.STUDENT_PROBABILITY) / 2) * spread / np.sqrt(N)
            < LIMIT.NEGLIGIBLE
        ),
    )


def _verdict(weighed: Mapping[str, float]) -> tuple[Verdict, tuple[str, ...]]:
    """Return the verdict at one rounding step, and the parameters that decided it, largest first.

    If all weighed changes are negligible, only the largest is named.
    """
    ordered = sorted(weighed.items(), key=lambda item: -item[1])
    verdict = verdict_of(ordered[0][1])
    if verdict == "unbiased":
        return verdict, (ordered[0][0],)
    limit = LIMIT.BIASED if verdict == "biased" else LIMIT.NEGLIGIBLE
    return verdict, tuple(name for name, value in ordered if value >= limit)


def verdict_of(error: float) -> Verdict:
    """Return the verdict for a weighed change, or an error, in %, of the residual norm."""
    return (
        "unbiased" if error < LIMIT.NEGLIGIBLE else "biased" if error > LIMIT.BIASED else "doubtful"
    )


def _against(name: str, e: float, half: float) -> str:
    """Compare a change with half of the 95 % interval of its parameter, both in %, in words."""
    share, why = next(
        (words, why)
        for most, words, why in (
            (0.1, "less than a tenth of", ": the record, not the encoder, limits it"),
            (0.5, "less than half of", ""),
            (1.0, "more than half of", ""),
            (np.inf, "more than", ""),
        )
        if e < most * half
    )
    if half >= 100:
        return f"{name} changes by {share} its 95 % interval, which contains zero{why}"
    digits = 0 if half >= 10 else 1
    return f"{name} changes by {e:.1f} %, {share} its 95 % interval of +-{half:.{digits}f} %{why}"


def _message(
    verdict: str,
    decided_by: Sequence[str],
    e: Array,
    reference: Estimate,
    N: int,
    half: float,
    needed: int,
) -> str:
    named = ", ".join(f"{name} {e[reference.names.index(name)]:.2f} %" for name in decided_by)
    small, large = f"{LIMIT.NEGLIGIBLE:g} % or a tenth", f"{LIMIT.BIASED:g} % and half"
    text = {
        "unbiased": f"practically unbiased, all changes below {small} of the interval (largest: {named}).",
        "doubtful": f"doubtful, changes above {small} of the interval: {named}.",
        "biased": f"biased, changes above {large} of the interval: {named}.",
    }[verdict]
    if half >= LIMIT.NEGLIGIBLE:
        text += (
            f" The means of {N} runs are uncertain by {half:.1f} times what is negligible; about "
            f"{needed} runs make this negligible."
        )
    return text


def _relative_change(norm: float, of: float) -> float:
    """Compute the change of a residual norm relative to the residual norm `of`, %, eq. (22)."""
    return 100 * abs(1 - norm / of) if of > 0 else float("inf" if norm > 0 else 0.0)
