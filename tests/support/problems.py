"""Settings that steps find of records alone, and states of bare positions, for tests that have no robot."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from runtime.compose import METHODS, READERS, problem, state_problem
from runtime.core.automatic import automatic_cutoff
from runtime.core.least_squares import method
from runtime.core.problem import prepared
from runtime.core.record import Origin, Record
from runtime.core.study import EstimateSettings
from runtime.loop.closed_loop import closed_loop
from runtime.speeds import recorded_speeds


def problem_of(study, records):
    """The problem of a study and records without a robot, without any step."""
    model = SimpleNamespace(JOINTS=range(records[0].n), NAME="none", DRIVES=None)
    return state_problem(model, records, study)


def resolved(study, records):
    """The settings after the automatic ones have their numbers, and what the steps say."""
    steps = (recorded_speeds, automatic_cutoff)
    problem = prepared(problem_of(study, records), steps)
    return problem.settings, " ".join(note.text for note in problem.notes)


def observed_states(q, rate, signals, drives=None, *, missing=None):
    """States of joint positions q, shape (N, n), by the reader of the signals."""
    record = Record(
        np.arange(len(q)) / rate,
        q,
        np.zeros_like(q),
        rate=rate,
        missing=missing,
        origin=Origin(drives=drives),
    )
    return READERS[signals.reader].states(record, signals)


def linear_system(rows, settings=None):
    """The rows as linear least squares weighs them for a method of symgen; default: ols."""
    return method.linear_system(rows, settings or EstimateSettings(), METHODS)


def loop_of_records(model, records, study, simulator, around=0.0, **options):
    """The closed loop of records, as a study reads them, without rows `around` slow ones."""
    study = replace(study, rows=replace(study.rows, around=around))
    whole = problem(model, records, study)
    return closed_loop(whole, whole.prepared, simulator, **options)
