"""The identification of one robot from the records of a prepared problem.

problem -> Y = W X + rho -> all parameters, eqs. (7)-(11), and the essential ones
        -> measured and predicted torques, cross-validation, correlated parameters
        -> parts: the results of further analyses, each made by an Extra
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

from runtime.core.parameter_sets import fit_problem, validated
from runtime.core.problem import SIGNALS, Problem, observe_rows, observed_unseen
from runtime.core.provenance import record_names
from runtime.core.result import Identification
from runtime.core.uncertainty import uncertainty
from runtime.core.validation import direct_comparison, weak_directions
from runtime.ground.checklist import Checklist
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.part import Part

Judge: TypeAlias = Callable[[Identification], Checklist]
"""A function that answers the questions of the verdict (`runtime.verdict`)."""
Extra: TypeAlias = Callable[[Identification], Part | None]
"""A function that makes a Part of an identification, or None if it has nothing to say."""
Correction: TypeAlias = Callable[[Identification], Identification]
"""A function that changes the deviations of an identification, by what the model lacks."""


@dataclass(frozen=True)
class OnRequest:
    """An analysis that is made only if the user requests it.

    Attributes
    ----------
    keyword : str
        Name by which the user requests the analysis.
    label : str
        Name of the analysis in messages.
    make : function of Identification and options
        Makes the Part.
    otherwise : Extra or None
        Makes a Part in place of the analysis if it was not requested or failed, with the question
        that stays open.
    options : mapping
        Options of the request.
    attempted : bool
        Whether a setting that does not suit the analysis is named in `missing`, as for a record
        that does not suit. False: such a setting is an error.
    """

    keyword: str
    label: str
    make: Callable[..., Part | None]
    otherwise: Extra | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    attempted: bool = False

    def __call__(self, result: Identification) -> Part | None:
        return self.make(result, **self.options)


def identify(
    problem: Problem,
    extras: Sequence[Extra],
    judge: Judge,
    *,
    corrections: Sequence[Correction] = (),
    provenance: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] = lambda label: None,
) -> Identification:
    """Identify the parameters of a prepared problem and judge how far they can be trusted.

    Parameters
    ----------
    problem : Problem
        A prepared problem.
    extras : sequence of Extra
        Further analyses, made in this order.
    judge : function of Identification
        Answers the questions of the verdict.
    corrections : sequence of Correction
        Changes of the deviations, made in this order before the analyses.
    provenance : mapping, optional
        Further entries that help to reproduce the result; names of the records, hashes and versions
        are added.
    progress : function of str
        Called with the label of every OnRequest before it is made.

    Returns
    -------
    Identification
        `missing` holds the analyses that failed, each with its reason.

    Raises
    ------
    InputError
        A record or setting that does not suit.
    """
    provenance = {**problem.provenance, **(provenance or {})}
    names = record_names([*problem.records, *problem.unseen])
    fitted_names = names[: len(problem.records)]
    unseen_names = names[len(problem.records) :]
    observation = observe_rows(problem)
    notes = tuple(note.text for note in problem.notes if note.text and note.kind != SIGNALS)
    if notes:
        observation = replace(observation, findings=(*observation.findings, *notes))
    unseen = {name: observed_unseen(problem, k) for k, name in enumerate(unseen_names)}
    sets, essential = fit_problem(problem, observation, provenance)
    sets, validation, missing = validated(
        problem, sets, observation, unseen, ", ".join(fitted_names)
    )
    comparison = direct_comparison(observation, sets.estimate(sets.used))
    system = problem.linear_system(observation)
    result = Identification(
        problem=problem,
        observation=observation,
        unseen_rows=unseen,
        sets=sets,
        essential=essential,
        validation=validation,
        comparison=comparison,
        correlations=weak_directions(system),
        uncertainty=uncertainty(system, essential, comparison),
        judge=judge,
        missing=missing,
    )
    for correction in corrections:
        result = correction(result)
    return with_parts(result, extras, progress)


def with_parts(
    result: Identification,
    extras: Sequence[Extra],
    progress: Callable[[str], None] = lambda label: None,
) -> Identification:
    """Make further analyses of an identification, and store the result of each as a Part.

    Each analysis uses the identification without the new parts.
    """
    parts = list(result.parts)
    missing = list(result.missing)
    for extra in extras:
        if isinstance(extra, OnRequest):
            progress(extra.label)
            try:
                part = extra(result)
            except InputError as e:
                if isinstance(e, SettingsError) and not extra.attempted:
                    raise
                missing.append(f"{extra.label}: {e}")
                part = None if extra.otherwise is None else extra.otherwise(result)
        else:
            part = extra(result)
        if part is not None:
            parts.append(part)
    return replace(result, parts=tuple(parts), missing=tuple(missing))
