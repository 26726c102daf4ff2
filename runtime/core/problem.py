"""A problem: the model, the records and the settings of one identification.

    problem = prepared(Problem(model, records, unseen, settings, reader), steps)
    rows = observe_rows(problem)
    fit  = estimated(problem, rows)               eqs. (6) to (11) of the chapter

A Step changes the problem before its rows are made. Every analysis starts from a prepared problem,
so that all analyses use the same model, rows and torques.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import System, assemble
from runtime.core.least_squares.method import Beginning, Method, Methods, linear_system, method_of
from runtime.core.model import GeneratedModel, drives_of, require_emitted
from runtime.core.provenance import origin
from runtime.core.record import Record
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import Prepared, stacked, study_of_record
from runtime.core.signals.reader import Reader
from runtime.core.study import EstimateSettings, Study
from runtime.ground.arrays import require_kind
from runtime.ground.errors import InputError, SettingsError

RECORD_EXPECTED = (
    "a Record, or a list of them: runtime.Record(t, q, tau), runtime.read_record(file)"
)
CONTACTS = "contacts"
"""Kind of the note that contacts of the robot with the world are measured."""
SIGNALS = "signals"
"""Kind of the notes on settings of signals that were automatic."""


@dataclass(frozen=True)
class Note:
    """Message of a preparation step about a problem (model, records and settings).

    Attributes
    ----------
    kind : str
        Subject of the note, by which code finds it; no code interprets the text.
    text : str
        Sentences for people; "" if the note has data only.
    data : mapping
        Entries of the provenance, JSON values.
    result : object
        Result of the step, for the part that reports it.
    """

    kind: str
    text: str
    data: Mapping[str, Any] = field(default_factory=dict)
    result: Any = None


@dataclass(frozen=True, eq=False)
class Problem:
    """Everything that an analysis needs: model, records and settings.

    Attributes
    ----------
    model : GeneratedModel
        n joints, b base parameters.
    records : tuple of Record
        Joint side, SI; fitted together.
    unseen : tuple of Record
        Records that are not fitted but predicted.
    settings : Study
    reader : Reader
        Computes the states q, qd, qdd of a record, as settings.signals.reader names it.
    methods : mapping of str to Method
        Methods of estimation by name; settings.estimate.method is one of the names.
    notes : tuple of Note
        Messages of the steps.
    """

    model: GeneratedModel
    records: tuple[Record, ...]
    unseen: tuple[Record, ...]
    settings: Study
    reader: Reader
    methods: Methods
    notes: tuple[Note, ...] = ()

    def __post_init__(self) -> None:
        require_emitted(self.model)
        n = len(self.model.JOINTS)
        for record in (*self.records, *self.unseen):
            require_kind(record, Record, "record", RECORD_EXPECTED)
            if record.n != n:
                raise InputError(
                    f"the record has {record.n} joints, but {self.model.NAME} has {n}; give a record of all joints of this robot",
                    file=record.file,
                )

    @cached_property
    def prepared(self) -> tuple[Prepared, ...]:
        """The fitted records with their filtered states q, qd, qdd, computed only once."""
        return tuple(self.reading(record) for record in self.records)

    @cached_property
    def prepared_unseen(self) -> tuple[Prepared, ...]:
        """The records that are not fitted, with their filtered states q, qd, qdd."""
        return tuple(self.reading(record) for record in self.unseen)

    def reading(self, record: Record) -> Prepared:
        """Combine a record with settings and reader into a Prepared, which computes q, qd, qdd.

        A record without drives gets those of the model. If a record has a cut-off of its own, this
        cut-off is used.
        """
        drives = drives_of(self.model)
        if record.origin.drives is None and drives is not None:
            record = replace(record, origin=replace(record.origin, drives=drives))
        return Prepared(record, study_of_record(self.settings, record), self.reader)

    @property
    def method(self) -> Method:
        """Method of estimation that settings.estimate names."""
        return self.methods[self.settings.estimate.method]

    def linear_system(self, rows: Observation, **changes: Any) -> System:
        """Weigh the rows Y = W X + rho for linear least squares with the weights of the settings.

        The result is the system of the method or, if the method is not linear, of its companion.
        changes : other values of settings.estimate, such as columns.
        """
        settings = self.settings.estimate
        return linear_system(
            rows, replace(settings, **changes) if changes else settings, self.methods
        )

    def noted(self, kind: str) -> Note | None:
        """Return the first message (note) on the subject `kind`; None if there is no message."""
        return next((note for note in self.notes if note.kind == kind), None)

    def require_motion(self, who: str) -> None:
        """Raise SettingsError if the records are poses at rest, for an analysis of a motion.

        who : name of the analysis in the message.
        """
        if self.reader.at_rest:
            raise SettingsError(
                f"reader: {self.settings.signals.reader} is for poses at rest, but {who} needs "
                "records of a motion; set another reader",
                path=("signals", "reader"),
            )

    @property
    def provenance(self) -> dict[str, Any]:
        """Names and time stamps of the records, and data from the preparation steps, for JSON."""
        automatic = " ".join(note.text for note in self.notes if note.kind == SIGNALS)
        entries = {**origin(self.records), **({SIGNALS: automatic} if automatic else {})}
        for note in self.notes:
            entries |= note.data
        return entries

    def changed(self, *notes: Note, **changes: Any) -> Problem:
        """Copy the problem with new values of some fields and with further messages (notes).

        Filtered states are reused for records whose positions and signals do not change.
        """
        other = replace(self, **changes, notes=(*self.notes, *notes))
        for made in ("prepared", "prepared_unseen"):
            if made in vars(self):
                pairs = zip(getattr(other, made), vars(self)[made], strict=False)
                for after, before in pairs:
                    after.take_states(before)
        return other


Step: TypeAlias = Callable[[Problem], Problem]


def prepared(problem: Problem, steps: Iterable[Step]) -> Problem:
    """Apply all preparation steps to the problem, in their order, and return the result."""
    for step in steps:
        problem = step(problem)
    return problem


def observe_rows(problem: Problem) -> Observation:
    """Build the observation matrix W and the torques Y of all fitted records.

    A method of estimation may have its own function for this step (`Method.observe`).

    Parameters
    ----------
    problem : Problem
        A prepared problem.

    Returns
    -------
    Observation
        Y = W X + rho, eqs. (6) and (14), rows joint-major.

    Raises
    ------
    InputError
        There is no record, or no row of a record is left.
    """
    method = problem.method
    return (
        stacked(problem.model, problem.prepared)
        if method.observe is None
        else method.observe(problem)
    )


def observed_unseen(problem: Problem, k: int) -> Observation:
    """Build W and Y of validation record k, counted from 0, which is not used for the fit."""
    alone = problem.changed(records=(problem.unseen[k],), unseen=())
    if "prepared_unseen" in vars(problem):
        alone.prepared[0].take_states(problem.prepared_unseen[k])
    return observe_rows(alone)


def estimated(
    problem: Problem,
    rows: Observation,
    settings: EstimateSettings | None = None,
    provenance: Mapping[str, Any] | None = None,
    corrected: bool = True,
) -> Estimate:
    """Estimate the parameters X of a problem from given rows Y = W X + rho of its records.

    settings : method of estimation; default: the settings of the problem.
    corrected : as for `estimate_of`.
    """
    settings, model = settings or problem.settings.estimate, problem.model
    return estimate_of(
        rows, settings, problem.methods, model=model, provenance=provenance, corrected=corrected
    )


def estimate_of(
    observation: Observation,
    settings: EstimateSettings,
    methods: Methods,
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
    corrected: bool = True,
) -> Estimate:
    """Estimate X of Y = W X + rho by the method that `settings` names.

    Parameters
    ----------
    observation : Observation
        Rows of the records.
    settings : EstimateSettings
        Method, weights, columns, options.
    methods : mapping of str to Method
        All methods, by name.
    model : GeneratedModel, optional
        Model that gives units, joint numbers and the hash of the robot file.
    provenance : mapping, optional
        Further entries for Estimate.provenance (a seed, the study file).
    corrected : bool
        Whether to compute `sigma_corrected`; False, for a fit of which only X is used, leaves nan.
    """
    method = method_of(settings, methods)
    system = method.system(observation, settings)
    solution = system.solve()
    if method.fit is None or (solution.rank < len(system.names) and not method.any_rank):
        return assemble(system, solution, model=model, provenance=provenance, corrected=corrected)
    rows, options = observation.columns(system.names), method.checked(settings)
    fitted = method.fit(Beginning(rows, settings, options, system, solution, model))
    estimate = assemble(
        fitted.system,
        fitted.solution,
        model=model,
        provenance=provenance,
        corrected=corrected and fitted.corrected is None,
    )
    own = fitted.corrected() if corrected and fitted.corrected else estimate.sigma_corrected
    C = estimate.covariance if fitted.covariance is None else fitted.covariance
    return replace(
        estimate,
        covariance=C,
        sigma=estimate.sigma if fitted.covariance is None else np.sqrt(np.diag(C)),
        sigma_corrected=own,
        status=fitted.status if estimate.status == "ok" else estimate.status,
        message=" ".join(note for note in (estimate.message, fitted.message) if note),
        details=fitted.details,
    )


def point_estimate(settings: EstimateSettings, methods: Methods) -> EstimateSettings:
    """Return settings for a faster fit that gives X only, without explanations for the user.

    Settings of a method without options for this purpose stay unchanged.
    """
    brief = method_of(settings, methods).brief
    return replace(settings, options={**settings.options, **brief}) if brief else settings
