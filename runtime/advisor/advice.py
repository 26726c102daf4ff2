"""Results of the resolution advisor: encoder steps, curves, confirming runs, and the verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np
from scipy.special import stdtrit

from runtime.core.cestac.result import (
    NOTHING_KNOWN,
    deciding_names,
    known_names,
    negligible,
    verdict_of,
    weighed_change,
)
from runtime.core.cestac.runs import Level
from runtime.core.least_squares.estimate import Estimate
from runtime.core.result import Identification
from runtime.counts.encoder_advice import visible_steps
from runtime.ground.check import Answer, Check, Question, state_of
from runtime.ground.documents import Result, json_text
from runtime.ground.limits import limits
from runtime.ground.part import BLACK, BLUE, DOTTED, GREY, ORANGE, Figure, Part
from runtime.ground.table import Table, number, percentage

LIMIT = limits(__package__)

Array = np.ndarray

LOWEST, HIGHEST = 0.03, 300.0  # %, of the axes of the figure
LIMITS = (LIMIT.NEGLIGIBLE, LIMIT.BIASED)  # weighed changes at which a step is sought
POSES = "Not judged for poses at rest, which have no accelerations"
"""What is said of the encoder where the records are poses."""
ALL = "all"  # Label of the advice on all encoders alike
FEW = (
    "if you need few parameters, name them: --columns ZZ1R,MX2R of symgen report and cestac, or "
    "cestac: {columns: [ZZ1R, MX2R]} of the study"
)
"""Remedy: judge only the parameters that the user needs."""


@dataclass(frozen=True)
class EncoderGroup:
    """Encoders that are coarse together, while all others are exact.

    Attributes
    ----------
    label : str
        "all", or the joint.
    encoders : tuple of int
        Their numbers, from 0.
    unit : str
        Unit of their steps: "rad", "m", or "rad or m".
    """

    label: str
    encoders: tuple[int, ...]
    unit: str


@dataclass(frozen=True, eq=False)
class Sampled:
    """Mean change of X in several CESTAC runs with one encoder step, and its Student interval.

    Attributes
    ----------
    delta : float, rad or m
    runs : int
    change : ndarray, shape (b,), %
        Change of the mean of the estimates, signed.
    half_width : ndarray, shape (b,), %
        Half width of the Student interval of this change.
    """

    delta: float
    runs: int
    change: Array
    half_width: Array


def sampled(delta: float, ratios: Array) -> Sampled:
    """Compute the mean change of X in several CESTAC runs, and its Student interval.

    The change, in %, and its Student interval follow eqs. (18) and (21). ratios : estimate of each
    run over that of the record, shape (runs, b).
    """
    N = len(ratios)
    half = float(stdtrit(N - 1, (1 + LIMIT.STUDENT_PROBABILITY) / 2)) / np.sqrt(N)
    change = 100 * (ratios.mean(axis=0) - 1)
    return Sampled(delta, N, change, 100 * half * ratios.std(axis=0, ddof=1))


@dataclass(frozen=True, eq=False)
class Limit:
    """Coarsest encoder step that keeps the change of every parameter below a limit of the verdict.

    Attributes
    ----------
    percent : float, %
        1 or 5: least squares is practically unbiased below, or biased above. The limit of a
        parameter is `percent`, or a tenth or half of its 95 % interval if that is more.
    delta : float, rad or m
        inf if no step reaches the limit; nan if even the finest step exceeds the limit, or if no
        parameter is judged.
    parameter : str
        The first parameter that reaches the limit; "" if there is none.
    change : float, %
        Limit of this parameter.
    sampled : Sampled or None
        CESTAC runs at that step; None without runs.
    error, half_width : float, %
        %e of the parameter in the runs, and half width of its Student interval.
    """

    percent: float
    delta: float
    parameter: str
    change: float = float("nan")
    sampled: Sampled | None = None
    error: float = float("nan")
    half_width: float = float("nan")

    @property
    def agrees(self) -> bool:
        """Whether CESTAC runs at the coarsest step confirm the predicted change of the parameter.

        A difference up to the Student interval plus 30 % of %e (15 % in Delta) is allowed. Without
        runs, the result is True.
        """
        return (
            self.sampled is None
            or abs(self.error - self.change)
            <= self.half_width + LIMIT.PREDICTION_AGREES * self.change
        )


@dataclass(frozen=True, eq=False)
class EncoderAdvice:
    """Coarsest steps that one encoder, or all together, may have; all other encoders are exact.

    Attributes
    ----------
    label : str
        "all", or the joint.
    limits : tuple of Limit
        The coarsest steps for 1 % and 5 %.
    delta : ndarray, shape (m,), rad or m
        Steps of the curve.
    change : ndarray, shape (m, b), %
        Predicted change of the estimate, signed.
    sampled : tuple of Sampled
        CESTAC runs at some steps of the curve.
    unit : str
        Unit of the steps: "rad", "m", or "rad or m" if encoders of both kinds are coarse.
    """

    label: str
    limits: tuple[Limit, ...]
    delta: Array
    change: Array
    sampled: tuple[Sampled, ...] = ()
    unit: str = "rad"

    def reached(self, percent: float) -> Array:
        """Find, for each parameter, the smallest encoder step at which its value changes by
        `percent` %, whatever its interval.

        Return the steps, shape (b,); nan if the curve does not show this step.
        """
        return np.array([crossing(self.delta, np.abs(e), percent) for e in self.change.T])


@dataclass(frozen=True, eq=False)
class ReaderAdvice:
    """Coarsest allowed steps of real encoders, for one method that computes the motion. The method
    is a low-pass filter of the positions, or the estimation from encoder counts.

    Attributes
    ----------
    reader : str
        Name of the reader, such as lowpass.
    read_as : str
        "positions", or "counts".
    encoders : tuple of EncoderAdvice
        All together first, then one at a time.
    notes : tuple of str
    steps : ndarray, shape (len(asked), b), %
        Change at the requested steps of all encoders; nan if the records do not show this change.
    """

    reader: str
    read_as: str
    encoders: tuple[EncoderAdvice, ...]
    notes: tuple[str, ...] = ()
    steps: Array = field(default_factory=lambda: np.empty((0, 0)))


@dataclass(frozen=True, eq=False)
class Advice(Result, Part):
    """Largest encoder steps at which the estimated parameters of one robot stay unbiased.

    Attributes
    ----------
    names : tuple of str
        Names of the b parameters.
    reference : Estimate
        Estimate from the record as measured.
    encoders : tuple of EncoderAdvice
        All together first, then one at a time.
    asked : tuple of float, rad or m
        Requested steps, of all encoders.
    steps : ndarray, shape (len(asked), b), %
        Change predicted at the requested steps by the chapter's rounding law. Under the law phase,
        the change is that of real encoders, read as the study reads them; nan if the records do not
        show this change.
    torque_sigma : ndarray, shape (b,)
        Standard deviation of the parameters for white torque noise of the motors of standard
        deviation 1 N m (N).
    real : tuple of ReaderAdvice
        Real encoders read as positions, and as counts; empty if they were not requested.
    assumptions : tuple of str
    settings, provenance : mapping
    """

    names: tuple[str, ...]
    reference: Estimate
    encoders: tuple[EncoderAdvice, ...]
    asked: tuple[float, ...]
    steps: Array
    torque_sigma: Array
    assumptions: tuple[str, ...]
    real: tuple[ReaderAdvice, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    name = "advice"
    title = "Resolution advice"

    def text(self) -> str:
        """Write the verdict, the change of each parameter at the requested encoder steps, and assumptions."""
        return "\n".join([self.verdict, *self.doubts(), *self.asked_lines(), *self.assumptions])

    def figures(self) -> tuple[Figure, ...]:
        """Plot the change of every parameter that decides the verdict against the encoder step.

        No figure if the record determines none of them.
        """
        return (advice_figure(self),) if known_names(self.reference) else ()

    def checks(self) -> tuple[Check, ...]:
        """Return the check "Does the encoder resolve enough?" of the report, as a tuple."""
        return (answer(self),)

    def entries(self) -> dict[str, Any]:
        """Return no entries for estimate.json: the advice has a file of its own, advice.json."""
        return {}

    def files(self) -> dict[str, str]:
        """Return a mapping from the file name advice.json to the text of the file."""
        return {"advice.json": self.to_json()}

    @property
    def deciding(self) -> tuple[str, ...]:
        """Names of the parameters that decide the verdict: those that study.cestac.columns names."""
        return deciding_names(self.reference)

    @property
    def ways(self) -> tuple[tuple[str, tuple[EncoderAdvice, ...], Array], ...]:
        """Tuples (label, advice for each encoder, changes of parameters), one for each encoder
        model. The changes are those at the requested encoder steps.

        An encoder model is a rounding law, or a reader of real encoders; it has one advice for each
        choice of encoders. The chapter's law is first, with an empty label, unless only real
        encoders were judged. Real encoders follow, once for each reader.
        """
        real = tuple((one.read_as, one.encoders, one.steps) for one in self.real)
        if self.real and self.encoders is self.real[0].encoders:
            return real
        return (("", self.encoders, self.steps), *real)

    @property
    def unit(self) -> str:
        """Unit of the encoder steps: "rad", "m", or "rad or m" for encoders of both kinds.

        The unit is that of the first advice, usually on all encoders together.
        """
        return self.encoders[0].unit

    @property
    def place(self) -> str:
        """Side of the gears where the encoders are, in words, for instance "at the joints"."""
        return {"joint": "at the joints", "motor": "at the motors"}[
            self.settings.get("cestac", {}).get("side", "joint")
        ]

    def worst(self, step: int, steps: Array | None = None) -> tuple[str, float, float]:
        """Find which parameter is affected most by a requested encoder step.

        Return its name, its change %e, and this change in units of what is negligible for it.

        step : number of the requested step, from 0.
        steps : changes at the requested steps; default: those of the advice.
        """
        decisive = deciding_columns(self.reference)
        change = (self.steps if steps is None else steps)[step]
        weighed = weighed_change(change, self.reference)[decisive]
        k = int(np.argmax(weighed))
        return self.names[decisive[k]], float(np.abs(change[decisive[k]])), float(weighed[k])

    @property
    def negative(self) -> bool:
        """Whether a requested encoder step biases X, or CESTAC runs contradict the prediction.

        The runs are those of CESTAC at the steps of the limits.
        """
        several = (encoder for _, encoders, _ in self.ways for encoder in encoders)
        contradicted = any(not limit.agrees for encoder in several for limit in encoder.limits)
        return contradicted or any(self.worst(k)[2] > LIMIT.BIASED for k in range(len(self.asked)))

    @property
    def verdict(self) -> str:
        """Verdict in sentences: how coarse the encoders may be without bias of the estimate.

        It states the coarsest steps of all encoders together, and which single encoder must be
        finest.
        """
        sentences = dict.fromkeys(one for way in self.ways for one in self._answers(*way[:2]))
        return " ".join(
            [*sentences, "Noise of the torques does not bias the estimate; it adds to sigma."]
        )

    def _way(self, name: str) -> str:
        """Say how positions are rounded and read, for one of the `ways`."""
        law = self.settings.get("cestac", {}).get("rounding", "")
        return f"real, {name}" if name else f"rounding {law}"

    def _answers(self, name: str, encoders: Sequence[EncoderAdvice]) -> list[str]:
        """Write the verdict, in sentences, for one rounding law or one way to read real encoders.

        The first sentence is about all encoders together.
        """
        first, single = encoders[0], encoders[1:]
        if not known_names(self.reference):
            return [f"{NOTHING_KNOWN}."]
        way = f"{self._way(name)}:"
        parts = [f"{way[0].upper()}{way[1:]} {self._sentence(first)}"]
        for unit in dict.fromkeys(advice.unit for advice in single) if len(single) > 1 else ():
            known = [
                advice
                for advice in single
                if advice.unit == unit and np.isfinite(advice.limits[0].delta)
            ]
            if known:
                hardest = min(known, key=lambda advice: advice.limits[0].delta)
                kind = "" if unit == self.unit else f" of those in {unit}"
                parts.append(
                    f"Alone, that of joint {hardest.label} must be the finest{kind}: "
                    f"{step_text(hardest.limits[0].delta, unit)}."
                )
        return parts

    def _sentence(self, advice: EncoderAdvice) -> str:
        """Say up to which step one choice of encoders does not bias least squares."""
        small, large = advice.limits
        if np.isnan(small.delta) and not small.parameter:
            return "no step could be judged on this record."
        alike = "all encoders alike" if advice.label == ALL else f"that of joint {advice.label}"
        if np.isnan(small.delta):
            text = f"with {alike}, the finest step tried changes {small.parameter} visibly"
        elif np.isinf(small.delta):
            return f"with {alike}, no step changes a parameter visibly."
        else:
            text = (
                f"with {alike}, least squares is practically unbiased up to Delta = "
                f"{step_text(small.delta, advice.unit)} {self.place} ({small.parameter} first)"
            )
        if not np.isfinite(large.delta):
            return f"{text}."
        return f"{text}, and biased from {step_text(large.delta, advice.unit)} ({large.parameter})."

    def doubts(self) -> list[str]:
        """List the predicted steps that random runs do not confirm, a sentence for each way."""
        found = []
        for name, encoders, _ in self.ways:
            doubted = [
                f"{advice.label} at {limit.change:.2g} % of {limit.parameter} ({limit.error:.2g} +- "
                f"{limit.half_width:.2g} % in the runs)"
                for advice in encoders
                for limit in advice.limits
                if not limit.agrees
            ]
            if doubted:
                found.append(
                    f"Random runs do not confirm these steps ({self._way(name)}): "
                    f"{', '.join(doubted)}; use the result of the runs."
                )
        return found

    def brief(self) -> str:
        """Write the coarsest step of each encoder in one table, the verdict, and doubts."""
        table = self.answer_table()
        answers = dict.fromkeys(line for way in self.ways for line in self._answers(*way[:2]))
        return "\n\n".join(
            [
                f"{table.caption}\n{table.to_text()}",
                *self.asked_lines(),
                "\n".join([*answers, *self.doubts()]),
                "Which parameter changes first, the runs at each step, and the assumptions: --verbose",
            ]
        )

    def answer_table(self) -> Table:
        """Make the table of the answer: the coarsest step of each encoder, by law and by reader.

        The first step is practically unbiased; from the second step on, a parameter is biased.
        """

        def cell(advice: EncoderAdvice) -> str:
            small, large = (
                "none"
                if np.isnan(limit.delta)
                else "any"
                if np.isinf(limit.delta)
                else (counts(limit.delta) if advice.unit == "rad" else "") or f"{limit.delta:.3g}"
                for limit in advice.limits
            )
            doubt = "" if all(limit.agrees for limit in advice.limits) else " ?"
            return f"{small}, {large}{doubt}"

        rows = []
        for alike in zip(*(encoders for _, encoders, _ in self.ways), strict=True):
            label = (
                alike[0].label
                if alike[0].unit == self.unit
                else f"{alike[0].label}, {alike[0].unit}"
            )
            rows.append((label, *map(cell, alike)))
        caption = (
            f"Encoder step {self.place}, {self.unit}: least squares is practically unbiased up to the "
            "first, biased from the second; row of a joint: the others exact; ? runs disagree"
        )
        return Table(caption, ("encoder", *(self._way(name) for name, *_ in self.ways)), rows)

    def to_table(self) -> str:
        """Write tables of the coarsest acceptable encoder steps, then doubts and assumptions."""
        tables = [table.to_text() for table in self.tables()]
        notes = [note for reader in self.real for note in reader.notes]
        return "\n\n".join(
            [
                *tables,
                *self.asked_lines(),
                "\n".join(f"- {text}" for text in (*self.doubts(), *self.assumptions, *notes)),
            ]
        )

    def tables(self) -> list[Table]:
        """Make the tables of the coarsest encoder steps: in short, for each encoder, for each parameter.

        The steps of each encoder have one table for the chapter's rounding law and one for real
        encoders.
        """
        law, real = ([way for way in self.ways if bool(way[0]) == real] for real in (False, True))
        captions = (
            "Coarsest step of each encoder, the others exact; sampled: %e of that parameter with "
            "the Student interval of the runs",
            "Real encoders, counts of random phase: coarsest step of each, the others exact; none: "
            "not even the finest step tried",
        )
        tables = [
            self._step_table(caption, ways)
            for caption, ways in zip(captions, (law, real), strict=True)
            if ways
        ]
        return [self.answer_table(), *tables, self.parameter_table()]

    def _step_table(
        self, caption: str, ways: Sequence[tuple[str, tuple[EncoderAdvice, ...], Array]]
    ) -> Table:
        """Make the table of the coarsest step that each encoder may have.

        Each rounding law or reader has its own columns.
        """
        headers, rows = ["encoder"], []
        for name, *_ in ways:
            for words in ("unbiased", "biased"):
                step = f"{name}, {words}" if name else f"{words}: Delta, {self.unit}"
                headers += [step, "first parameter", "%e", "sampled %e"]
        for alike in zip(*(encoders for _, encoders, _ in ways), strict=True):
            unit = alike[0].unit
            cells = [alike[0].label if unit == self.unit else f"{alike[0].label}, {unit}"]
            for limit in (limit for advice in alike for limit in advice.limits):
                runs = f"{limit.error:.2f} ± {limit.half_width:.2f}" if limit.sampled else "-"
                step = "none" if np.isnan(limit.delta) else f"{limit.delta:.3g}"
                turn = counts(limit.delta) if unit == "rad" else ""
                cells += [turn or step, limit.parameter or "-", number(limit.change, ".3g"), runs]
            rows.append(tuple(cells))
        return Table(caption, headers, rows)

    def parameter_table(self) -> Table:
        """Make the table of the parameters: %sigma, the encoder steps that change each parameter by
        1 % and 5 % whatever its interval, and the increase of %sigma by torque noise.

        The steps are those of all encoders together. The effect is %sigma added by torque noise,
        per N m (N) of its standard deviation.
        """
        first = self.encoders[0]
        reached = [first.reached(limit.percent) for limit in first.limits]
        header = (
            "parameter",
            "%sigma",
            *(f"Delta at {limit.percent:g} %" for limit in first.limits),
            "% per unit torque deviation",
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            added = 100 * self.torque_sigma / np.abs(self.reference.X)
        own = self.reference.relative_deviation
        rows = []
        for i, name in enumerate(self.names):
            mark = "" if name in self.deciding else " *"
            steps = (f"{step[i]:.3g}" if np.isfinite(step[i]) else "-" for step in reached)
            rows.append(
                (
                    name + mark,
                    percentage(self.reference.relative_sigma[i], own[i]),
                    *steps,
                    percentage(added[i], own[i], ".3g"),
                )
            )
        caption = (
            "All encoders alike, by parameter; * does not decide; last column: %sigma added "
            "by white motor torque noise of deviation 1"
        )
        return Table(caption, header, rows)

    def asked_lines(self) -> list[str]:
        """Write, for each requested encoder step, the largest predicted change of a parameter.

        There is one line for each step and rounding law. Return one text with all lines in a list,
        or an empty list without requested steps.
        """
        lines = []
        for k, delta in enumerate(self.asked):
            for reader, _, steps in self.ways:
                name, e, weighed = self.worst(k, steps)
                way = f", read as {reader}" if reader else ""
                change = (
                    "not judged on this record"
                    if np.isnan(e) or not known_names(self.reference)
                    else f"predicted {verdict_of(weighed)}, {name} changes by {e:.2f} %"
                )
                lines.append(f"Delta = {Level(delta).label}{way}: {change}")
        return ["\n".join(lines)] if lines else []

    def to_json(self) -> str:
        """Write the advice as JSON text."""
        return json_text(
            {
                "schema": 1,
                "names": self.names,
                "X_LS": self.reference.X,
                "relative_sigma_LS": self.reference.relative_sigma,
                "deciding": self.deciding,
                "negligible": negligible(self.reference),
                "verdict": self.verdict,
                "encoders": [_summary(advice) for advice in self.encoders],
                "real": {
                    reader.reader: [_summary(advice) for advice in reader.encoders]
                    for reader in self.real
                },
                "asked": [
                    {"delta": delta, "change": change, "worst": self.worst(k)}
                    for k, (delta, change) in enumerate(zip(self.asked, self.steps, strict=True))
                ],
                "torque_sigma": self.torque_sigma,
                "assumptions": self.assumptions,
                "settings": self.settings,
                "provenance": self.provenance,
            }
        )


def advice_figure(advice: Advice) -> Figure:
    """Plot the change %e of each parameter of small %sigma against the step Delta of all encoders.

    Lines are predicted; points are CESTAC runs with their Student intervals. If real encoders were
    judged, all readers are shown, otherwise the rounding law of the paper.
    """
    curves = [("", advice.encoders[0], BLUE, ORANGE)]
    if advice.real:
        curves = [
            (f"{r.read_as}, ", r.encoders[0], color, color)
            for r, color in zip(advice.real, cycle((ORANGE, BLUE)), strict=False)
        ]

    def draw(name: str, ax: Any) -> None:
        for curve in curves:
            _panel(ax, *curve, advice.names.index(name))
        ax.set_title(name)

    return Figure(
        "%e against resolution: predicted curve and sampled points of every parameter that matters; dotted: 1 % and 5 %; grey: the steps advised",
        "Change of every parameter in per cent against encoder resolution, predicted and sampled, logarithmic axes",
        [partial(draw, name) for name in advice.deciding],
        name="advice",
        columns=5,
        cell=(2.1, 1.5),
        extra=1.0,
        least=4.6,
        legend=4,
        letters=8,
        logarithmic=True,
        x=f"resolution Δ of every encoder, {advice.unit}",
        y="%e: change of the estimate, %",
    )


def _panel(ax: Any, reader: str, encoder: EncoderAdvice, line: str, points: str, i: int) -> None:
    e = np.abs(encoder.change[:, i])
    shown = np.where(e > 0, e, np.nan)
    ax.plot(encoder.delta, shown, color=line, linewidth=1.3, label=f"{reader}predicted")
    delta = np.array([point.delta for point in encoder.sampled])
    change = np.array([abs(point.change[i]) for point in encoder.sampled])
    half = np.array([point.half_width[i] for point in encoder.sampled])
    below = np.minimum(half, change - LOWEST / 10).clip(
        min=0
    )  # an interval that holds zero ends below the axis
    style: Any = {"fmt": "o", "markersize": 3.5, "linewidth": 1.0, "capsize": 2}
    label = f"{reader}sampled, 95 %"
    ax.errorbar(delta, change, yerr=np.array([below, half]), color=points, label=label, **style)
    for limit in encoder.limits:
        ax.axhline(limit.percent, color=BLACK, linewidth=0.8, linestyle=DOTTED)
        if np.isfinite(limit.delta):
            ax.axvline(limit.delta, color=GREY, linewidth=0.8)
    ax.set_ylim(LOWEST, HIGHEST)


@Question(
    "Does the encoder resolve enough?",
    f"bias below {LIMIT.NEGLIGIBLE:g} % or a tenth of the interval (usable to {LIMIT.BIASED:g} % or "
    "half of it)",
)
def answer(advice: Advice | None, steps: str = "", share: float = 0.0) -> Answer:
    """Judge whether the encoder step is small enough, from the resolution advice if there is one.
    Without advice, judge the encoder steps visible in the recorded positions.

    steps : without an advice, a sentence on the steps that the positions show.
    share : share of the mean square of an acceleration that these steps make.
    """
    if advice is None:
        ask = "ask with symgen report --encoder STEP, or symgen cestac --advise"
        if steps == POSES:
            return Answer("open", steps, "")
        if not steps:
            return Answer("open", "Not asked", ask)
        text = f"{steps}, which make {100 * share:.2g} % of the mean square of an acceleration"
        if 100 * share <= LIMIT.NEGLIGIBLE:
            return Answer("open", f"{text}; the effect on each value was not computed", ask)
        return Answer(
            "doubtful",
            f"{text}, and inertias too small",
            "finer positions, or signals: {reader: counts}; symgen cestac --advise says how far "
            f"each value moves; {FEW}",
        )
    small, large = (
        step_text(one.delta, advice.unit) if np.isfinite(one.delta) else "any step"
        for one in advice.encoders[0].limits
    )
    text = (
        f"Least squares is practically unbiased up to {small}, biased from {large} {advice.place}"
    )
    if not advice.asked:
        return Answer(
            "open",
            text,
            "give the step of your encoder: symgen report --encoder STEP (with --side motor for "
            "an encoder on the motor)",
        )
    found = [advice.worst(k) for k in range(len(advice.asked))]
    name, error, weighed = max(found, key=lambda item: item[2])
    labels = ", ".join(Level(step).label for step in advice.asked)
    return Answer(
        state_of(weighed, LIMIT.NEGLIGIBLE, LIMIT.BIASED),
        f"{text}; at {labels} {name} is affected most and changes by "
        f"{error:.{0 if error >= 10 else 1}f} %",
        f"{FEW}; or a finer encoder; with a section `controller` of the study, also estimate.method: "
        "iv or didim",
    )


@dataclass(frozen=True, eq=False)
class NoAdvice(Part):
    """Part of a report without resolution advice: judges the encoder steps visible in positions."""

    result: Identification

    name = "advice"
    title = "Resolution advice"

    def checks(self) -> tuple[Check, ...]:
        """Return the check "Does the encoder resolve enough?" of the report, as a tuple."""
        if self.result.problem.reader.at_rest:
            return (answer(None, POSES),)
        simulated = self.result.problem.method.observe is not None
        return (answer(None, *(("", 0.0) if simulated else visible_steps(self.result))),)


def _summary(advice: EncoderAdvice) -> dict[str, Any]:
    return {
        "encoder": advice.label,
        "unit": advice.unit,
        "limits": advice.limits,
        "delta": advice.delta,
        "change": advice.change,
        "sampled": advice.sampled,
        "reached": {f"{limit.percent:g}": advice.reached(limit.percent) for limit in advice.limits},
    }


def confirm_by_runs(
    advice: EncoderAdvice, reference: Estimate, level: Callable[[float], Sampled]
) -> EncoderAdvice:
    """Add CESTAC runs at the coarsest allowed encoder steps, to confirm or refute the prediction.

    If all encoders are coarse together, runs between these steps and above them are added, too.

    level : makes the runs at a step.
    """
    made = {limit.delta: level(limit.delta) for limit in advice.limits if np.isfinite(limit.delta)}
    limits = []
    for limit in advice.limits:
        if limit.delta in made:
            point, i = made[limit.delta], reference.names.index(limit.parameter)
            limit = replace(
                limit,
                sampled=point,
                error=abs(float(point.change[i])),
                half_width=float(point.half_width[i]),
            )
        limits.append(limit)
    if advice.label == ALL and made:
        low, high = min(made), max(made)
        for delta in (np.sqrt(low * high), 2 * high, 5 * high):
            if delta <= advice.delta[-1]:
                made[float(delta)] = level(float(delta))
    return replace(
        advice, limits=tuple(limits), sampled=tuple(made[delta] for delta in sorted(made))
    )


def deciding_columns(reference: Estimate) -> list[int]:
    """Numbers of the parameters that decide the verdict."""
    return [reference.names.index(name) for name in deciding_names(reference)]


def limits_of(delta: Array, change: Array, reference: Estimate) -> tuple[Limit, ...]:
    """Find the coarsest encoder steps that do not bias a parameter visibly, and that do not bias it.

    A limit is nan if the finest step is already too coarse or no step could be tried; inf if every
    step is fine enough.
    """
    if not len(delta):
        return tuple(Limit(percent, np.nan, "") for percent in LIMITS)
    decisive, limits = deciding_columns(reference), []
    weighed, allowed = weighed_change(change, reference), negligible(reference)
    for percent in LIMITS:
        first = {i: crossing(delta, weighed[:, i], percent) for i in decisive}
        beyond = [i for i in decisive if weighed[0, i] > percent]
        reached = [i for i in decisive if np.isfinite(first[i])]
        if beyond:
            i = max(beyond, key=lambda i: weighed[0, i])
            step = np.nan
        elif reached:
            i = min(reached, key=lambda i: first[i])
            step = first[i]
        else:
            limits.append(Limit(percent, np.inf, ""))
            continue
        limits.append(Limit(percent, step, reference.names[i], float(percent * allowed[i])))
    return tuple(limits)


def crossing(delta: Array, e: Array, percent: float) -> float:
    """Find the smallest encoder step at which the change e of a parameter reaches `percent`.

    Between the points of the curve, lines are straight on logarithmic axes. The result is nan if no
    point reaches `percent`, or if the first point is already above.
    """
    above = np.flatnonzero(e >= percent)
    if not len(above) or (above[0] == 0 and e[0] > percent):
        return float("nan")
    k = int(above[0])
    if k == 0:
        return float(delta[0])
    low, high = max(float(e[k - 1]), 1e-12), float(e[k])
    share = np.log(percent / low) / np.log(high / low)
    return float(delta[k - 1] * (delta[k] / delta[k - 1]) ** share)


def counts(delta: float) -> str:
    """Write an encoder step in rad as a share of a turn, for instance 2*pi/5236."""
    return f"2*pi/{2 * np.pi / delta:.0f}" if 0 < delta < np.pi else ""


def step_text(delta: float, unit: str) -> str:
    """Write an encoder step with its unit, for instance 9.16e-05 rad (2*pi/68626).

    An angle is also written as a share of a turn.
    """
    text = counts(delta) if unit == "rad" else ""
    return f"{delta:.3g} {unit}" + (f" ({text})" if text else "")
