"""Round measured positions and torques as coarser sensors would, and build Y = W X + rho from them.

Eqs. (15), (16), (28).

    q_CESTAC = R^-1 rounded(R (q - offset)) + offset
            on the motor side; R = 1 on the joint side
    W_CESTAC = W(q_CESTAC, qd_CESTAC, qdd_CESTAC)   through the filters, on the measured rows

Every record has its own streams of random numbers (`runtime.core.cestac.rounding.stream`), one for
the positions and one for the torques. A draw is therefore the same with and without steps of the
torque, and whatever records follow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.core.cestac.rounding import rounded, stream
from runtime.core.cestac.runs import Level
from runtime.core.cestac.sources import EncoderOf, Loop, RecordEncoder
from runtime.core.drives import Drives
from runtime.core.essential import essential_of
from runtime.core.least_squares.method import Method
from runtime.core.model import GeneratedModel, base_columns
from runtime.core.problem import Problem
from runtime.core.record import Record
from runtime.core.rows.observation import Observation, stack
from runtime.core.rows.prepared import (
    Prepared,
    decimated_torque,
    observation_of,
    stacked,
    study_of_record,
)
from runtime.core.rows.regressor import Columns
from runtime.core.rows.selection import Selection
from runtime.core.signals.filters import States, derivative
from runtime.core.signals.reader import Reader
from runtime.core.study import CestacSettings, EstimateSettings, Signals, Study
from runtime.ground.errors import InputError

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class PreparedRecord:
    """One measured record after filtering and selection of rows; the same in every run of a study.

    Attributes
    ----------
    record : Record
        Measured positions and torques of the joints.
    selection : Selection
        Rows used, selected on the measured record.
    torque : ndarray, shape (n, K), N m or N
        Y before the selection of rows.
    states : States
        States of the measured record.
    own : RecordEncoder or None
        Encoder that measured the record, under law phase.
    note : str
        Sentence for the user if the study uses counts, but the positions of the record count as
        exact; else "".
    slip : ndarray or None, shape (N, n), rad/s or m/s
        Recorded velocities minus the differences of q, if signals.velocity uses recorded
        velocities. A drive computes its velocity from its encoder, so that coarser steps change
        both alike and leave this difference.
    """

    record: Record
    selection: Selection
    torque: Array
    states: States
    own: RecordEncoder | None = None
    note: str = ""
    slip: Array | None = None


@dataclass(frozen=True, eq=False)
class Task:
    """Data that all runs of a study of the encoder resolution use: records, model, settings, steps.

    Attributes
    ----------
    records : tuple of PreparedRecord
    model : GeneratedModel
    names : tuple of str
        Columns that the runs fit, in this order.
    estimate, settings : EstimateSettings, CestacSettings
    levels : tuple of Level
    drives : Drives or None
        Drives between motor side and joint side.
    reader : Reader
        Computes the states q, qd, qdd of a record.
    methods : mapping of str to Method
        Estimation methods by name, that of `estimate` among them.
    loop : Loop or None
        Closed loop that the study simulates; None if it simulates none.
    """

    records: tuple[PreparedRecord, ...]
    model: GeneratedModel
    names: tuple[str, ...]
    estimate: EstimateSettings
    settings: CestacSettings
    levels: tuple[Level, ...]
    drives: Drives | None
    reader: Reader
    methods: Mapping[str, Method]
    loop: Loop | None = None

    @property
    def columns(self) -> Columns:
        """Evaluator of the columns of the observation matrix W, shared by several runs."""
        return Columns(self.model, self.names)


def prepared_record(
    own: Prepared,
    study: Study,
    own_encoder: EncoderOf,
    drives: Drives | None = None,
    *,
    exact: bool = True,
) -> PreparedRecord:
    """Filter one measured record and select its rows, once for all runs of a study.

    The filters are those of study.signals, with the median window of study.cestac. Rows are
    selected by the measured velocities, unless `own` has selected rows.

    own_encoder : function that returns the encoder that measured the record, or None.
    exact : whether the study has encoder steps so coarse that recorded counts are exact in
      comparison.
    """
    study = study_of_record(study, own.record)
    signals = replace(study.signals, median=study.cestac.median)
    encoder = own_encoder(own.record, study, drives)
    reader, note = _reader_of_measured(own, study, encoder) if exact else (own.reader, "")
    filtered = replace(own, study=replace(study, signals=signals), reader=reader)
    filtered.take_states(own)
    q = np.asfortranarray(own.record.q)  # one signal after the other, as filters read them
    return PreparedRecord(
        replace(filtered.record, q=_read_only(q)),
        filtered.selection,
        filtered.torque,
        filtered.states,
        encoder,
        note,
        _slip(own.record, signals),
    )


def _reader_of_measured(
    own: Prepared, study: Study, encoder: RecordEncoder | None
) -> tuple[Reader, str]:
    """Return the reader of a measured record, and a note if its positions count as exact.

    In comparison with coarser steps, positions from counts are exact, unless the study gives their
    step, some are missing, or the study needs the counts of the record itself.
    """
    reader, side = own.reader, study.cestac.side
    known = reader.encoder is None or reader.encoder(study.signals)[0] is not None
    if known:
        return reader, ""
    if encoder is not None and (encoder.read or own.record.missing is not None):
        return reader.at_step(tuple(encoder.step), side), ""
    if own.record.missing is not None:
        return reader, ""
    return reader.at_step(0.0, side), (
        f"Beside these steps the positions of {own.record.name} count as exact: the estimate "
        "that runs are compared with reads them by the low-pass."
    )


def _read_only(x: Array) -> Array:
    """Return a view of x that a Record uses without a copy."""
    view = x.view()
    view.setflags(write=False)
    return view


def _slip(record: Record, signals: Signals) -> Array | None:
    v = record.channels.get("qd")
    if v is None or isinstance(signals.velocity, str):
        return None
    slip: Array = v - derivative(record.q, record.rate, signals.ends)
    return slip


def study_columns(
    problem: Problem,
    records: Sequence[Prepared],
    columns: Sequence[str] | None,
    loop: Loop | None = None,
) -> tuple[str, ...]:
    """Choose the parameters that each run estimates: all base parameters, or the essential ones.

    Names of settings.cestac.columns come first. The other essential columns are fitted too, because
    without them their torques would change the named parameters.

    columns : names of the essential parameters, if they are known.
    Raises SettingsError for a name that is no base parameter, and for static poses.
    """
    settings, asked = problem.settings, problem.settings.cestac.columns
    problem.require_motion("the study of encoders")
    named = base_columns(problem.model, asked, (), "cestac", "columns")
    if asked == "all":
        return named
    if columns is None:
        rows = _measured(problem, records) if loop is None else loop.measured()
        columns = essential_of(problem.linear_system(rows), settings.essential).names
    return (*named, *(name for name in columns if name not in named))


def _measured(problem: Problem, records: Sequence[Prepared]) -> Observation:
    """Build the system Y = W X + rho of the measured records, without any rounding.

    If the study reads encoder counts of unknown step and the positions are no counts, the positions
    are taken as exact.
    """
    reader = problem.reader
    try:
        return stacked(problem.model, records)
    except InputError:
        if reader.encoder is None or reader.encoder(problem.settings.signals)[0] is not None:
            raise
    exact = reader.at_step(0.0, "joint")
    return stacked(problem.model, [replace(own, reader=exact) for own in records])


def stream_keys(draw: tuple[int, ...], k: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the keys of two random generators for record k: for its positions, for its torques.

    The keys are (*draw, 2 k) and (*draw, 2 k + 1); the positions of record 0 have the key `draw`
    itself.
    """
    return ((*draw, 2 * k) if k else draw), (*draw, 2 * k + 1)


def perturbed_position(
    q: Array, level: Level, settings: CestacSettings, drives: Drives | None, key: Sequence[int]
) -> Array:
    """Round the measured positions q at random to q_CESTAC, shape (N, n), eqs. (15), (28).

    key : key of the random stream.
    """
    if not level.delta:
        return q
    rng = stream(settings.seed, *key)
    if settings.side == "joint" or drives is None:
        return rounded(q, level.delta, settings.rounding, rng, settings.uneven)
    return drives.joint_position(
        rounded(drives.motor_position(q), level.delta, settings.rounding, rng, settings.uneven)
    )


def perturbed_torque(
    tau: Array, level: Level, settings: CestacSettings, drives: Drives | None, key: Sequence[int]
) -> Array:
    """Round the motor torques at random in steps of Phi, and return joint torques, shape (N, n).

    Without drives, joint torques are rounded.
    """
    rng = stream(settings.seed, *key)
    if drives is None:
        return rounded(tau, level.torque, settings.rounding, rng)
    motor = drives.motor_command(tau) * drives.torque_constant
    return drives.joint_torque(
        rounded(motor, level.torque, settings.rounding, rng) / drives.torque_constant
    )


def torque_rows(task: Task, record: PreparedRecord, level: Level, key: Sequence[int]) -> Array:
    """Compute the torques Y of one record in one run, shape (n, K), before rows are left out.

    The torques are as measured, or rounded in steps of Phi if the level has a torque step.
    """
    if not level.torque:
        return record.torque
    return decimated_torque(
        perturbed_torque(record.record.torque, level, task.settings, task.drives, key),
        record.selection,
    )


def perturbed(columns: Columns, task: Task, level: Level, draw: tuple[int, ...]) -> Observation:
    """Build the system Y = W X + rho of one CESTAC run, from measurements rounded at random.

    Without steps, the system is that of the measurements.

    draw : numbers that identify the random draw.
    """
    loop = task.loop
    if loop is not None and loop.in_loop:
        rows = loop.rows(level, draw) if draw else loop.measured()
        return rows.columns(task.names)
    keys = [stream_keys(draw, k) for k in range(len(task.records))]
    positions = [
        run_position(task, r, level, own) for r, (own, _) in zip(task.records, keys, strict=True)
    ]
    torques = [
        torque_rows(task, r, level, own) for r, (_, own) in zip(task.records, keys, strict=True)
    ]
    observation = system_of(columns, task, positions, torques, level)
    return observation if loop is None else loop.perturbed(observation, positions)


def measured_rows(task: Task, records: Sequence[Prepared]) -> Observation:
    """Build the system Y = W X + rho of the records without rounding, as reference of the study.

    The reference is the system of a run without steps if a loop is simulated, or if the positions
    of a record count as exact.
    """
    if task.loop is not None or any(record.note for record in task.records):
        return perturbed(task.columns, task, Level(0.0), ())
    return stacked(task.model, records, task.names)


def run_position(task: Task, record: PreparedRecord, level: Level, key: Sequence[int]) -> Array:
    """Compute the rounded positions q_CESTAC of one record in one run, shape (N, n).

    The measured positions are rounded. If the steps are hardly coarser than those of the record, a
    random motion that agrees with the recorded counts is rounded instead.
    """
    q = record.record.q
    if level.delta and record.own is not None:
        q = record.own.positions(q, level.delta, stream(task.settings.seed, *key, 0))
    return perturbed_position(q, level, task.settings, task.drives, key)


def run_states(task: Task, record: PreparedRecord, q: Array, level: Level) -> States:
    """Compute the states q, qd, qdd of one run from its positions q, shape (N, n).

    The reader knows the steps of the level, but not the phase of its counts.
    """
    if q is record.record.q:
        return record.states
    reader = task.reader.at_step(level.delta, task.settings.side)
    try:
        states = reader.states(_moved(record, q, task.drives), record.selection.signals)
    except np.linalg.LinAlgError as e:
        raise InputError(
            f"an encoder step of {level.label} is too coarse for this motion ({e}); use finer steps"
        ) from e
    return replace(states, channels=record.states.channels)


def _moved(record: PreparedRecord, q: Array, drives: Drives | None) -> Record:
    """Return the record with the positions q of one run, and velocities that have moved with them."""
    measured = record.record
    moved = measured.moved(_read_only(q), origin=replace(measured.origin, drives=drives))
    if record.slip is None:
        return moved
    v = derivative(q, measured.rate, record.selection.signals.ends) + record.slip
    return replace(moved, channels={**moved.channels, "qd": v})


def system_of(
    columns: Columns,
    task: Task,
    positions: Sequence[Array],
    torques: Sequence[Array],
    level: Level | None = None,
) -> Observation:
    """Build the system Y = W X + rho of all records from positions and torques of each record.

    positions : shape (N, n) each. torques : rows of Y, shape (n, K) each.
    level : steps that the reader gets; default: none, and positions are used as they are.
    """
    observations = [
        observation_of(
            columns,
            run_states(task, record, q, level or Level(0.0)),
            torque,
            record.selection,
            files=record.record.files,
        )
        for record, q, torque in zip(task.records, positions, torques, strict=True)
    ]
    return stack(observations)
