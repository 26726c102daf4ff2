"""Records of static poses: each sample is a pose, qd = qdd = 0, with the mean of its torques.

Inertias and friction cause no torque in such rows, so their columns are left out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from runtime.core.missing import COUNTS, require_positions
from runtime.core.problem import Note, Problem
from runtime.core.record import Record
from runtime.core.rows.prepared import stacked
from runtime.core.signals.filters import States
from runtime.core.signals.reader import Reader
from runtime.core.study import Signals
from runtime.ground.errors import InputError

ROUNDING = 1e-9  # of the largest entry of W: a column below it is zero
TEXT = "others (inertias, friction) are left out. Dry friction holds a joint with a torque of unknown sign: approach every pose from both sides and record the mean, or both as poses."


def at_rest(record: Record, signals: Signals) -> States:
    """Return the states of static poses: recorded q, with qd = qdd = 0."""
    require_positions(record.missing, f"reader: {signals.reader}", record.name, COUNTS)
    rest = np.zeros_like(record.q)
    return States(record.q, rest, rest)


STATIC = Reader(at_rest, linear=True, at_rest=True)
"""Each sample is a pose."""


def poses_at_rest(problem: Problem) -> Problem:
    """Restrict the estimate to the base parameters that cause a torque in static poses.

    This is a step of the preparation of a problem. A problem whose records are motions is not
    changed.

    Raises
    ------
    InputError
        No parameter causes a torque in the poses.
    SettingsError
        The method simulates the closed loop, for which it needs a motion.
    """
    settings = problem.settings
    if not problem.reader.at_rest or not problem.records:
        return problem
    if problem.method.observe is not None:
        problem.require_motion("a method that simulates the loop,")
    W, names = stacked(problem.model, problem.prepared).W, problem.model.BASE_PARAMETERS
    acting = np.abs(W).max(axis=0) > ROUNDING * np.abs(W).max()
    asked = names if settings.estimate.columns == "all" else settings.estimate.columns
    columns = tuple(name for name in asked if acting[names.index(name)])
    if not columns:
        raise InputError(
            f"poses at rest show no parameter of {problem.model.NAME}: gravity acts along no joint, and no joint has an offset or spring; record a motion, or correct gravity in the robot file"
        )
    text = f"Poses at rest: {len(columns)} of {len(asked)} base parameters have a torque in them, the {TEXT}"
    estimate = replace(settings.estimate, columns=columns)
    return problem.changed(Note("rest", text), settings=replace(settings, estimate=estimate))
