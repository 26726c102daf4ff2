"""Simulate the closed loop of a record again, with other parameters, for methods IV and DIDIM.

    loop = closed_loop(problem, problem.prepared, simulator)
    observation = loop.measured()             Y = W X + rho, to which the loop stays attached
    runs = loop.run(X, g)                     one simulation per record, exact states, no noise, no
                                              steps
    loop.simulated(runs, observation, exact=False)
                                              Z = F_p[W(q_s, ...)], q_s through the filters of the
                                              record                   IDIM-IV
    loop.simulated(runs, observation, exact=True)
                                              Z = F_p[W(q_s, qd_s, qdd_s)], exact states through the
                                              decimation alone       DIDIM

g_j^k = J_j(X^k)/J_j(X_ref), J_j the mean of A_jj over the reference, multiplies everything between
position error and torque: the bandwidth of the simulated loop stays that of the real loop while X^k
is far from the truth. Rows are chosen by the velocity of the reference, never by that of the
measured positions: a choice that depends on noise biases every method. Slow rows of joint j
(`rows.low_speed`) are rows where a dry friction that acts on the joint slips slowly (coupled
friction of a wrist included): at rest the torque of such friction is anything between -FS and FS,
not W X, and the decimation spreads the difference into the neighbouring rows (`rows.around`).
Instants with the torque at its limit are left out.

If the reference is not known (`reference: measured`), the measured motion through the filters
replaces it: the instruments then contain the noise of the same run, and DIDIM is output error about
the measured motion itself. The Estimate states this assumption.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from runtime.core.model import GeneratedModel, joint_labels, require_no_axes
from runtime.core.problem import Problem
from runtime.core.record import Record
from runtime.core.rows.observation import LoopRows, Observation, stack
from runtime.core.rows.prepared import Prepared, observation_of, stacked, study_of_record
from runtime.core.rows.regressor import Columns
from runtime.core.rows.selection import Selection, certain_rows, select_rows
from runtime.core.signals.filters import States, decimated
from runtime.counts.reading import REACH
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import limits
from runtime.ground.progress import at
from runtime.ground.settings import Settings, structure
from runtime.loop.law_check import LawFit, law_fits, law_text
from runtime.loop.reference import Reference, of_record, reference_of, require_rate
from runtime.loop.result import Simulation
from runtime.loop.settings import Controller

if TYPE_CHECKING:
    from runtime.loop.simulation import Simulator  # CasADi

LIMIT = limits(__package__)

Array = np.ndarray

ASSUMED = (
    "The reference of this record is not known; the filtered measured motion is used instead. "
    "Instruments then contain the noise of the same run, and a simulated motion is compared with "
    "itself: bias is removed only as far as the noise does not pass through the loop."
)


class LoopOptions(Settings):
    """Options (estimate.options) of every estimation method that simulates the closed loop.

    Attributes
    ----------
    reference : str
        known: the reference comes from the settings, or from the columns qr1 ... of each record.
        measured: the measured motion replaces an unknown reference.
    """

    reference: Literal["known", "measured"] = "known"


@dataclass(frozen=True, eq=False)
class LoopPart:
    """One record of a closed loop, with the reference of its controller and the rows of W to use.

    Attributes
    ----------
    prepared : Prepared
        The record with its filtered states and the rows used.
    reference : Reference
        Reference that the controller followed, at its rate; T ticks.
    feedforward, disturbance : ndarray, shape (T, n), N m or N, or None
        Recorded feed-forward torque; and the known torque with the opposite sign, which acts on the
        arm in addition to the torque of the drives.
    """

    prepared: Prepared
    reference: Reference
    feedforward: Array | None = None
    disturbance: Array | None = None

    @property
    def record(self) -> Record:
        """Record of measured or simulated positions and torques."""
        return self.prepared.record

    def exact_states(self, q: Array) -> States:
        """Compute the states of simulated positions q, shape (N, n), as the record is read."""
        reader = self.prepared.reader.at_step(0.0, "joint")
        return reader.states(self.record.moved(q, missing=None), self.selection.signals)

    @property
    def selection(self) -> Selection:
        """Rows used."""
        return self.prepared.selection

    @property
    def given(self) -> dict[str, Any]:
        """Data to simulate this record: first position, disturbance torque, feed-forward torque."""
        return {
            "start": self.record.q[0],
            "disturbance": self.disturbance,
            "feedforward": self.feedforward,
        }

    def decimated(self, x: Array) -> Array:
        """Decimate signals, shape (N, n, ...), in the same way as the torques in Y: (n, ..., K)."""
        window = np.moveaxis(x[: len(self.record)][self.selection.samples], 0, -1)
        return decimated(
            np.ascontiguousarray(window), self.selection.factor, self.selection.signals.decimate
        )


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """The closed loop of one or more records, ready to be simulated with other parameters.

    `assumption`: text on the assumed reference; empty if the reference is known. `law`: how well
    the control law explains the records, by joint.
    """

    model: GeneratedModel
    simulator: Simulator
    parts: tuple[LoopPart, ...]
    assumption: str = ""
    law: tuple[LawFit, ...] = ()

    def all_of(self, names: Sequence[str], X: Array) -> Array:
        """Extend the values X of the parameters `names` to all base parameters; the others are zero."""
        by_name = dict(zip(names, X, strict=True))
        return np.array([by_name.get(name, 0.0) for name in self.model.BASE_PARAMETERS])

    def run(self, X: Array, g: Array | float = 1.0) -> list[Simulation]:
        """Simulate every record with base parameters X, shape (b,), without noise or quantisation.

        Each simulation starts at rest, at the first measured position. g : factor on everything
        between position error and torque.
        """
        return [
            self.simulator.run(X, part.reference, g=g, ideal=True, **part.given)
            for part in self.parts
        ]

    def torques(self, runs: Sequence[Simulation]) -> list[Array]:
        """Compute the drive torque of each simulation minus the known torque, shape (N, n) each.

        The known torque is that of the record (`tau_known`). The result is comparable with
        `Record.torque`.
        """
        pairs = zip(runs, (part.record.tau_known for part in self.parts), strict=True)
        return [run.tau if known is None else run.tau[: len(known)] - known for run, known in pairs]

    def measured(self) -> Observation:
        """Build the system Y = W X + rho from measured positions, and store this loop with it."""
        states = [p.prepared.states for p in self.parts]
        observation = self._observed([replace(s, errors=None) for s in states])
        observation = replace(
            observation, closed_loop=LoopRows(self, np.arange(len(observation.Y)))
        )
        if all(s.errors is None for s in states):
            return observation
        certain = [
            certain_rows(self.model, s[p.selection.samples][p.selection.kept])
            for s, p in zip(states, self.parts, strict=True)
        ]
        used = [
            c[j, p.selection.mask[j]]
            for j in range(observation.n)
            for c, p in zip(certain, self.parts, strict=True)
        ]
        return observation.where(np.concatenate(used))

    def simulated(
        self, runs: Sequence[Simulation], observation: Observation, *, exact: bool
    ) -> Observation:
        """Replace W of `observation` by Z, the observation matrix of the simulated motion.

        The rows and columns stay the same. If `exact`, Z is computed from the exact simulated
        states; else the simulated positions pass through the filters of the record.
        """
        assert observation.closed_loop is not None
        states = [
            States(run.q, run.qd, run.qdd)[: len(part.record)]
            if exact
            else part.exact_states(run.q[: len(part.record)])
            for run, part in zip(runs, self.parts, strict=True)
        ]
        Z = self._observed(states).columns(observation.names).W
        return replace(observation, W=np.asfortranarray(Z[observation.closed_loop.rows]))

    def outputs(self, signals: Sequence[Array], observation: Observation) -> Array:
        """Decimate signals of every record in the same way as Y; select the rows of `observation`.

        The signals have shape (N, n) or (N, n, c) per record, the result shape (r,) or (r, c).
        """
        assert observation.closed_loop is not None
        by_joint: list[Array] = []
        kept = [part.decimated(x) for x, part in zip(signals, self.parts, strict=True)]
        for j in range(len(self.model.JOINTS)):
            by_joint += [
                x[j][..., part.selection.mask[j]].T
                for x, part in zip(kept, self.parts, strict=True)
            ]
        return np.asarray(np.concatenate(by_joint)[observation.closed_loop.rows])

    def inertia(self, X: Array) -> Array:
        """Compute the mean inertia J_j of each joint along the reference motions, shape (n,).

        J_j is the mean of A_jj, A the inertia matrix with parameters X.
        """
        functions: Any = self.model
        q = np.concatenate(
            [part.reference.q[:: max(1, len(part.reference) // 500)] for part in self.parts]
        )
        return np.asarray(np.einsum("tjj->j", functions.inertia_matrix(q, X)) / len(q))

    def _observed(self, states: Sequence[States]) -> Observation:
        columns = Columns(self.model)
        return stack(
            [
                observation_of(
                    columns, s, part.prepared.torque, part.selection, files=part.record.files
                )
                for s, part in zip(states, self.parts, strict=True)
            ]
        )


def observed_loop(problem: Problem, simulator: Simulator | None = None) -> Observation:
    """Build the system Y = W X + rho of all records, together with the closed loop to simulate.

    Methods that simulate the loop need the result. simulator : default: the simulator of the
    section `controller` of the settings; without this section, no loop is attached.
    """
    settings: Any = problem.settings
    require_no_axes(problem.model, f"estimate.method: {settings.estimate.method}")
    if simulator is None and settings.controller is not None:
        from runtime.loop.simulation import Simulator as FromController

        simulator = FromController(problem.model, settings.controller)
    if simulator is None:
        return stacked(problem.model, problem.prepared)
    options = settings.estimate.options
    asked = {key: options[key] for key in ("reference",) if key in options}
    return closed_loop(problem, problem.prepared, simulator, **asked).measured()


def closed_loop(
    problem: Problem,
    measured: Sequence[Prepared],
    simulator: Simulator,
    **options: Any,
) -> ClosedLoop:
    """Prepare the closed loop of the records: find references and rows, check the control law.

    measured : the records with filtered states.
    options : the options of LoopOptions.
    """
    asked = structure(LoopOptions, options, ("estimate", "options"))
    controller, model, study = simulator.controller, problem.model, problem.settings
    parts = []
    every = controller.record_every
    for k, own in enumerate(measured):
        record = own.record
        require_rate(record, controller)
        fed = record.tau_ff if controller.feedforward == "record" else None
        if controller.feedforward == "record" and fed is None:
            raise SettingsError(
                f"{record.file} contains no feed-forward torque; give its columns in "
                "record.columns.tau_ff",
                path=("controller", "feedforward"),
            )
        followed = _reference(model, measured, k, controller, asked.reference)
        if -(-len(followed) // every) < len(record):
            raise InputError(
                f"the reference ends after {len(followed) / controller.rate:g} s, but the record "
                f"after {record.t[-1] - record.t[0]:g} s; give a longer reference, or cut the record",
                file=record.file,
            )
        speed = slips(followed.qd[::every][: len(record)], simulator.friction.G)
        selection = select_rows(
            record,
            speed,
            study_of_record(study, record).signals,
            study.rows,
            keep=_usable(simulator, record),
        )
        torques = [
            None if x is None else _at_ticks(x, every, len(followed))
            for x in (fed, None if record.tau_known is None else -record.tau_known)
        ]
        chosen = replace(own, selected=selection)
        chosen.take_states(own)
        parts.append(LoopPart(chosen, followed, *torques))
    if asked.reference == "measured":
        return ClosedLoop(model, simulator, tuple(parts), ASSUMED)
    fits = law_fits(simulator.law, parts, controller, joint_labels(model))
    at(law_text(fits))
    return ClosedLoop(model, simulator, tuple(parts), "", fits)


def _at_ticks(x: Array, every: int, ticks: int) -> Array:
    """Interpolate recorded samples, shape (N, n), linearly at T controller samples: shape (T, n).

    The last sample is held.
    """
    places = np.arange(ticks) / every
    return np.column_stack([np.interp(places, np.arange(len(x)), column) for column in x.T])


def _reference(
    model: GeneratedModel,
    records: Sequence[Prepared],
    k: int,
    controller: Controller,
    reference: str,
) -> Reference:
    """Find the reference that the controller followed in record k, at the controller rate."""
    record = records[k].record
    if reference == "measured":
        states, every = records[k].states, controller.record_every
        ticks = (len(record) - 1) * every + 1
        return Reference(
            controller.rate,
            *(_at_ticks(x, every, ticks) for x in (states.q, states.qd, states.qdd)),
        )
    if record.q_r is not None:
        return of_record(record, controller)
    given = controller.reference
    if all(getattr(given, name) is None for name in ("file", "motion", "points", "record")):
        raise SettingsError(
            f"the reference of the controller in {record.file} is not known; give columns qr1 ... "
            "(record.columns.q_ref) or controller.reference, or set "
            "estimate.options.reference: measured",
            path=("controller", "reference"),
        )
    if len(records) > 1 and given.record is None:
        raise SettingsError(
            f"the setting controller.reference is one reference, but the study has {len(records)} "
            "records; give the reference columns qr1 ... in each record",
            path=("controller", "reference"),
        )
    return reference_of(
        replace(controller, reference=replace(given, limits="ignore")),
        model,
        records=[own.record for own in records],
    )


def slips(qd: Array, G: Array) -> Array:
    """Compute the smallest sliding speed at each joint: of the joint and its friction elements.

    The speeds are |qd_j| and the slips of the friction elements that act on joint j. The result has
    shape (N, n), like qd. G : shape (elements, n); G qd are the slips of the friction elements.
    """
    speed: Array = np.abs(qd)
    for element in G:
        acts = np.flatnonzero(element)
        speed[:, acts] = np.minimum(speed[:, acts], np.abs(qd @ element)[:, None])
    return speed


def _usable(simulator: Simulator, record: Record) -> Array | None:
    """Select the samples whose torque is below its limit, and that are not near a long gap.

    A gap is a time without measured positions. The result None means all samples.
    """
    bound = np.broadcast_to(np.asarray(simulator.law.saturation, dtype=float), (record.n,))
    if not np.isfinite(bound).any() and record.missing is None:
        return None
    free: Array = np.abs(record.tau) <= LIMIT.CLIPPED * bound
    if record.missing is not None:
        free &= ~record.missing.near_gaps(
            round(REACH / 2 * record.rate), round(REACH * record.rate)
        )[:, None]
    return free


def loop_of(observation: Observation, method: str) -> ClosedLoop:
    """Return the closed loop that was stored with the system Y = W X + rho of an observation.

    Raise SettingsError if no loop is stored; the message names `method`, which needs the loop.
    """
    if observation.closed_loop is None:
        raise SettingsError(
            f"{method} simulates the closed loop of the record, but this study does not describe it; add a "
            "section `controller` with law, rate and reference "
            "(symgen identify then builds the loop), or use ols, wls or irls",
            path=("estimate", "method"),
        )
    loop: ClosedLoop = observation.closed_loop.loop
    return loop
