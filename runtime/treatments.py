"""Find which treatment of the records (choice of settings) predicts validation records best.

A treatment is a choice of settings, for instance with all rows or without rows at rest, or with or
without a known torque of a counterbalance. Every candidate is identified with its own settings. Of
its sets of parameters (`runtime.core.parameter_sets`), the essential set included, the set that
predicts the validation records best is used. All candidates are then judged on the same rows, made
by the filters and row selection of every candidate in turn, so that no candidate wins because it
leaves out rows that it cannot explain,

    e_ck = 100 ||Y_k - W_k X_c|| / ||tau_k||
            residual of candidate c on the validation records treated as by candidate k, of the
            measured torque

The measured torque includes known torques, so that a candidate with known torques gets no smaller
error from the norm. Candidates are ordered by the geometric mean over k. A candidate whose
estimator did not converge comes after all others. The validation records choose the winner, so they
are no longer unseen data for it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.core.identify import Extra, Judge, identify, with_parts
from runtime.core.least_squares.estimate import Estimate
from runtime.core.parameter_sets import ORDER, SetName, best_set
from runtime.core.problem import Problem, estimated
from runtime.core.record import Record
from runtime.core.result import Identification
from runtime.core.rows.prepared import stacked
from runtime.ground.errors import InputError
from runtime.ground.progress import at
from runtime.ground.table import Table


@dataclass(frozen=True, eq=False)
class Ranking:
    """Result of a comparison of treatments (settings for the same records), the best first.

    Attributes
    ----------
    results : mapping of str to Identification
        By name of the candidate, the best first.
    errors : mapping of str to mapping of str to float, %
        e_ck, by candidate, then by the treatment whose rows are used.
    standing : mapping of str to (str, Estimate)
        Name and estimate of the set of parameters that is used for each candidate.
    missing : tuple of str
        Candidates that could not be identified, each with its reason.
    """

    results: Mapping[str, Identification]
    errors: Mapping[str, Mapping[str, float]]
    standing: Mapping[str, tuple[SetName, Estimate]]
    missing: tuple[str, ...] = ()

    @property
    def best(self) -> Identification:
        """Identification with the treatment that predicts validation records best."""
        return next(iter(self.results.values()))

    @property
    def mean_errors(self) -> dict[str, float]:
        """Mean error, %, with which each treatment predicts the validation rows of all treatments.

        The mean is the geometric mean of e_ck over k.
        """
        return {
            name: float(np.exp(np.mean(np.log(list(own.values())))))
            for name, own in self.errors.items()
        }

    @property
    def verdict(self) -> str:
        """One sentence that ranks the treatments by their prediction error, best first."""
        first, *others = [
            f"{name} ({columns_text(*self.standing[name])}) {error:.1f} %"
            for name, error in self.mean_errors.items()
        ]
        then = f"; then {', '.join(others)}" if others else ""
        return f"Predicts {self.best.unseen} best: {first}{then} of the measured torques."

    def table(self) -> Table:
        """Return a table with one line per treatment: parameters, errors in %, verdict."""
        header = (
            "treatment",
            "parameters",
            "fit %",
            "unseen, mean %",
            *(f"unseen, {name} %" for name in ORDER),
            "use",
        )
        rows = [
            (
                name,
                columns_text(*self.standing[name]),
                f"{self.standing[name][1].relative_error:.2f}",
                f"{self.mean_errors[name]:.2f}",
                *(
                    f"{result.set_errors[own]:.2f}" if own in result.set_errors else "-"
                    for own in ORDER
                ),
                result.checklist.answer if result.usable else result.estimate.status,
            )
            for name, result in self.results.items()
        ]
        return Table(
            "Treatments of the records, the best first",
            header,
            rows,
            note="Unseen, mean: error on the validation record, geometric mean over the rows of each treatment. "
            "Unseen by set of parameters: on the treatment's own rows.",
        )

    def summary(self) -> dict[str, Any]:
        """Return the ranking as a mapping for JSON."""
        treatments = [
            {
                "name": name,
                "status": result.estimate.status,
                "columns": self.standing[name][0],
                "count": len(self.standing[name][1].names),
                "fit": self.standing[name][1].relative_error,
                "unseen": self.mean_errors[name],
                "unseen_by_rows": self.errors[name],
                "unseen_by_set": result.set_errors,
                "state": result.checklist.state,
            }
            for name, result in self.results.items()
        ]
        return {
            "schema": 1,
            "verdict": self.verdict,
            "treatments": treatments,
            "missing": self.missing,
        }

    def __str__(self) -> str:
        return "\n\n".join([self.table().to_text(), *self.missing, self.verdict])


def compare(
    problems: Mapping[str, Problem],
    extras: Sequence[Extra],
    judge: Judge,
    of_the_best: Sequence[Extra] = (),
) -> Ranking:
    """Identify a robot by each treatment of its records, and order these by prediction error.

    Parameters
    ----------
    problems : mapping of str to Problem
        Prepared problems by name of the treatment, whose unseen records have the same instants.
    extras : sequence of Extra
        Further analyses of every treatment.
    judge : function of Identification
        Answers the questions of the verdict.
    of_the_best : sequence of Extra
        Additional analyses of the best treatment.

    Raises
    ------
    InputError
        There is no treatment; a treatment has no validation records, or others than the first; or
        no treatment can be identified.
    """
    if not problems:
        raise InputError("no study to compare; expected two or more")
    first = next(iter(problems.values())).unseen
    for name, problem in problems.items():
        _require_alike(name, problem.unseen, first)
    results: dict[str, Identification] = {}
    missing: list[str] = []
    for name, problem in problems.items():
        at(f"treatment {name}")
        try:
            results[name] = identify(problem, extras, judge)
        except InputError as e:
            missing.append(f"{name}: {e}")
    if not results:
        raise InputError(f"no treatment can be identified; {missing[0]}")
    standing = {name: standing_set(result) for name, result in results.items()}
    errors = {
        name: {other: _error(problems[name], fit, problems[other]) for other in results}
        for name, (_, fit) in standing.items()
    }
    means = Ranking(results, errors, standing).mean_errors
    order = sorted(results, key=lambda name: (not results[name].usable, means[name]))
    results[order[0]] = with_parts(results[order[0]], of_the_best)
    return Ranking(
        {name: results[name] for name in order},
        {name: errors[name] for name in order},
        standing,
        tuple(missing),
    )


def standing_set(result: Identification) -> tuple[SetName, Estimate]:
    """Return name and estimate of the set of parameters that predicts validation records best."""
    name = best_set(result.set_errors, essential=True) if result.set_errors else "all"
    fit = result.sets.get(name, result.estimate)
    if name == "essential" and not result.sets:  # of a method that is not linear
        own = replace(result.study.estimate, columns=result.essential.names)
        fit = estimated(result.problem, result.observation, own)
    return name, fit


def columns_text(name: SetName, fit: Estimate) -> str:
    """Write the name of a set of parameters and their number, such as "all parameters, 58"."""
    return f"{name} parameters, {len(fit.names)}"


def _require_alike(name: str, further: Sequence[Record], first: Sequence[Record]) -> None:
    if not further:
        raise InputError(
            f"{name} has no validation record, on which studies are compared; set "
            "validate.record in every study file"
        )
    for record in further:
        if not record.tau.any():
            raise InputError(
                (
                    "all torques are zero; a validation record needs measured torques to compare "
                    "predictions with"
                ),
                file=record.file,
            )
    if [len(record) for record in further] != [len(record) for record in first]:
        raise InputError(
            f"{name} predicts {', '.join(r.file for r in further)}, but the first study predicts "
            f"{', '.join(r.file for r in first)}; set the same validate.record, with as many "
            "samples, in every study file"
        )


def _error(problem: Problem, fit: Estimate, treatment: Problem) -> float:
    """Compute the error, %, of torques that an estimate predicts for the validation records.

    The error is the norm of the residual, % of the norm of the measured torque.
    """
    rows, signals = treatment.settings.rows, treatment.settings.signals
    settings = replace(problem.settings, rows=rows, signals=signals)
    unseen = tuple(
        record.cut_at(other.origin.cutoff)
        for record, other in zip(problem.unseen, treatment.unseen, strict=True)
    )
    treated = problem.changed(settings=settings, reader=treatment.reader, unseen=unseen)
    whole = tuple(replace(record, tau_known=None) for record in unseen)
    residual, _ = stacked(problem.model, treated.prepared_unseen).norms(fit.names, fit.X)
    measured = treated.changed(unseen=whole).prepared_unseen
    _, total = stacked(problem.model, measured).norms((), np.zeros(0))
    return 100 * float(np.linalg.norm(residual) / np.linalg.norm(total))
