"""Which of several treatments of the same records predicts best? One call for "with all rows or without rest, with the counterbalance known or not".

Every candidate is identified on its own terms; the set of parameters that predicts its validation records best stands for it. All of them are then judged on the
same rows: those of every candidate's filters and rows in turn, so that none wins by leaving out what it cannot explain,

    e_ck = 100 ||Y_k - W_k X_c|| / ||tau_k||         residual of candidate c on the validation records treated as by candidate k, of the measured torque

known torques included in what is measured, so that those who know them have no advantage by the norm. Order: the geometric mean over k.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import InputError
from runtime.identification.identification import identify
from runtime.identification.result import Identification
from runtime.model.generated import GeneratedModel
from runtime.observation.observation import observe
from runtime.parallel import single_threaded
from runtime.progress import at
from runtime.records.reading import read_records
from runtime.records.record import Record
from runtime.settings.study import Study
from runtime.table import Table

Candidate = Study | tuple[Study, Record | Sequence[Record], Record | Sequence[Record]]
"""A study that names its records and validation records, or a study, records and validation records."""


@dataclass(frozen=True, eq=False)
class Ranking:
    """Treatments in the order in which they predict.

    Attributes
    ----------
    results : mapping of str to Identification
        By name of the candidate, the best first.
    errors : mapping of str to mapping of str to float, %
        e_ck, by candidate, then by the treatment that it is judged in.
    """

    results: Mapping[str, Identification]
    errors: Mapping[str, Mapping[str, float]]

    @property
    def best(self) -> Identification:
        """The identification that predicts best."""
        return next(iter(self.results.values()))

    @property
    def verdict(self) -> str:
        """The order, in one sentence."""
        parts = [
            f"{name} ({result.model_columns} parameters, {len(result.model_estimate.names)}) {mean_error(self.errors[name]):.1f} %"
            for name, result in self.results.items()
        ]
        unseen = next(iter(self.results.values())).unseen
        return f"Predicts {unseen} best: {parts[0]}; then {', '.join(parts[1:])} of the measured torques."

    def table(self) -> Table:
        """One line by candidate."""
        header = ("treatment", "parameters", "fit %", "mean unseen %", *(f"rows of {name}, %" for name in self.results))
        rows = [
            (
                name,
                f"{result.model_columns} ({len(result.model_estimate.names)})",
                f"{result.model_estimate.relative_error:.2f}",
                f"{mean_error(self.errors[name]):.2f}",
                *(f"{self.errors[name][other]:.2f}" for other in self.results),
            )
            for name, result in self.results.items()
        ]
        return Table("Treatments of the records, the best first", header, rows)

    def __str__(self) -> str:
        return f"{self.table().to_text()}\n\n{self.verdict}"


@single_threaded
def compare(model: GeneratedModel, candidates: Mapping[str, Candidate]) -> Ranking:
    """Identify with each of several treatments, and order them by what they predict.

    Parameters
    ----------
    model : GeneratedModel
        An emitted module.
    candidates : mapping of str to Candidate
        At least two, by name, each with validation records of the same instants.

    Raises
    ------
    InputError
        One candidate alone, or one without validation records, or with others than the first.
    """
    if len(candidates) < 2:
        raise InputError(f"{len(candidates)} treatment; expected two or more to compare")
    results: dict[str, Identification] = {}
    unseen: dict[str, list[Record]] = {}
    for name, candidate in candidates.items():
        at(f"treatment {name}")
        study, records, further = _opened(model, candidate)
        unseen[name] = further
        _require_alike(name, further, next(iter(unseen.values())))
        results[name] = identify(model, records, study, further=further)
    errors = {name: {other: _error(model, results[name], unseen[name], results[other].study) for other in results} for name in results}
    order = sorted(results, key=lambda name: mean_error(errors[name]))
    return Ranking({name: results[name] for name in order}, {name: errors[name] for name in order})


def mean_error(errors: Mapping[str, float]) -> float:
    """Geometric mean."""
    return float(np.exp(np.mean(np.log(list(errors.values())))))


def _opened(model: GeneratedModel, candidate: Candidate) -> tuple[Study, list[Record], list[Record]]:
    if isinstance(candidate, Study):
        return candidate, read_records(candidate.record, model), read_records(candidate.validate.record, model)
    study, records, further = candidate
    own, unseen = ([x] if isinstance(x, Record) else list(x) for x in (records, further))
    return study, own, unseen


def _require_alike(name: str, further: Sequence[Record], first: Sequence[Record]) -> None:
    if not further:
        raise InputError(f"{name} has no validation record, by which treatments are compared; set validate.record")
    if [len(record) for record in further] != [len(record) for record in first]:
        raise InputError(
            f"{name} is validated by {', '.join(r.file for r in further)}, the first by {', '.join(r.file for r in first)}; expected the same"
        )


def _error(model: GeneratedModel, result: Identification, unseen: Sequence[Record], study: Study) -> float:
    """Residual of a result on validation records treated as by `study`, % of the measured torque."""
    fit = result.model_estimate
    own = observe(model, unseen, study)
    residual, _ = own.norms(fit.names, fit.X)
    measured = [x if x.tau_known is None else replace(x, tau=x.tau + x.tau_known) for x in unseen]
    _, total = observe(model, measured, study).norms((), np.zeros(0))
    return 100 * float(np.linalg.norm(residual) / np.linalg.norm(total))
