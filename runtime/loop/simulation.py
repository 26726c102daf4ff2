"""Closed-loop simulation of a robot, on its generated CasADi model.

    run = simulate(model, study)                            # one run, by the section `controller`
    simulator = Simulator(model, controller)                # many: compiled once
    run = simulator.run(X, reference, g=g, ideal=True)      # exact states, no noise, no steps

The torque is held between the ticks of the controller. The motion between ticks is integrated by
Runge-Kutta of order 4 (or CVODES), with dry friction that holds at rest and only takes energy.
Substeps are at most `pole_step` over the fastest pole of the loop. Before a run, the inertia matrix
must be positive definite and the sampled loop stable along the reference; otherwise a
SimulationError names the place and a remedy.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.signal import butter, lfilter

from runtime.core.model import GeneratedModel, require, require_no_channels
from runtime.core.record import Record
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import limits
from runtime.loop.control_law import (
    ControlLaw,
    continuous_pole,
    control_law,
    discrete_poles,
    parameters_of,
)
from runtime.loop.controller_tick import blocks, compiled, tick_function
from runtime.loop.dry_friction import DryFriction, dry_friction
from runtime.loop.reference import Reference, reference_of
from runtime.loop.result import Simulation, SimulationError
from runtime.loop.settings import Controller

LIMIT = limits(__package__)

Array = np.ndarray

BLOCK = 250  # ticks in one call


class Simulator:
    """Simulator of the closed loop of one robot and one controller, for one or many runs.

    Parameters
    ----------
    model : GeneratedModel
    controller : Controller
    """

    def __init__(
        self,
        model: GeneratedModel,
        controller: Controller,
    ) -> None:
        require_no_channels(model, "a simulated motion")
        self.model, self.controller = model, controller
        self.law: ControlLaw = control_law(controller, model)
        require(model, "casadi")
        self.friction: DryFriction = dry_friction(model)
        self._in_c = controller.integrator == "rk4"  # CVODES has no C of its own
        self._compiled: dict[int, Any] = {}
        self._bias = _rest_functions(self.model)

    def run(
        self,
        X: Array,
        reference: Reference,
        *,
        g: Array | float = 1.0,
        start: Array | None = None,
        ideal: bool = False,
        disturbance: Array | None = None,
        feedforward: Array | None = None,
        seed: int | None = None,
        name: str = "simulation",
    ) -> Simulation:
        """Simulate the arm and the controller in closed loop along a reference motion.

        Parameters
        ----------
        X : ndarray, shape (b,)
            Base parameters.
        reference : Reference
        g : ndarray, shape (n,), or float
            Factor on everything between position error and torque.
        start : ndarray, shape (n,), optional, rad or m
            Joint positions at t = 0, at rest; default: from the settings, else the first position
            of the reference.
        ideal : bool
            Whether to leave out noise, and the steps of encoder and converter.
        disturbance : ndarray, shape (N, n), optional, N m or N
            Torques on the arm that are not recorded.
        feedforward : ndarray, shape (N, n), optional, N m or N
            Torques added to the command, in place of those of the settings.
        seed : int, optional
            Seed of the noise; default: the seed of the settings.
        name : str
            Name of the record.

        Raises
        ------
        SimulationError
            An inertia that is not positive definite, a loop that is not stable, or a motion that
            leaves its reference.
        """
        n, b, N = len(self.model.JOINTS), len(self.model.BASE_PARAMETERS), len(reference)
        X, g = np.asarray(X, dtype=float), np.broadcast_to(np.asarray(g, dtype=float), (n,)).copy()
        if X.shape != (b,) or not np.isfinite(X).all():
            raise InputError(
                f"X has shape {X.shape}; expected finite numbers, one for each of the {b} base "
                f"parameters of {self.model.NAME}"
            )
        _check_shapes(reference, self.controller.rate, n, N, disturbance, feedforward)
        substeps = self.substeps(X, reference, g)
        rng = np.random.default_rng(self.controller.seed if seed is None else seed)
        noise, pushed, torque_noise = (np.zeros((N, n)),) * 3 if ideal else self._noise(rng, N)
        pushed = pushed if disturbance is None else pushed + np.asarray(disturbance)
        known = self._feedforward(reference) if feedforward is None else np.asarray(feedforward)
        signals = np.hstack(
            [reference.q, reference.qd, known + self.law.ca * reference.qdd, noise, pushed]
        )
        settling = round(self.controller.settle * self.controller.rate) if self.law.K.any() else 0
        still = np.concatenate([reference.q[0], np.zeros(n), known[0], np.zeros(2 * n)])
        signals = np.vstack([np.tile(still, (settling, 1)), signals])
        x = self._start(reference, start, ideal=ideal)
        states, out = self._iterated(x, signals, X, self.law.matrix(g, ideal=ideal), substeps)
        _check_motion(states[settling:, :n], reference)
        every = self.controller.record_every
        before = np.vstack([x, states[:-1]])[settling::every]
        y, tau, qdd = np.split(out[settling:], 3, axis=1)
        qd = before[:, n : 2 * n]
        return Simulation(
            t=reference.t[::every],
            q=before[:, :n],
            qd=np.where(np.abs(qd) <= LIMIT.SLIP_REST, 0.0, qd),
            qdd=qdd[::every],
            tau=tau[::every],
            q_measured=y[::every],
            tau_measured=(tau + torque_noise)[::every],
            q_r=reference.q[::every],
            rate=self.controller.rate / every,
            saturated=(np.abs(tau) >= g * self.law.saturation * (1 - 1e-9)).mean(axis=0),
            substeps=substeps,
            state=states[-1],
            model=self.model,
            X=X,
            ideal=ideal,
            name=name,
        )

    def _feedforward(self, reference: Reference) -> Array:
        """Compute the feed-forward torques of the settings along the reference, shape (N, n)."""
        if self.controller.feedforward != "values":
            return np.zeros_like(reference.q)
        X = parameters_of(self.model, self.controller)
        return self.model.inverse_dynamics(reference.q, reference.qd, reference.qdd, X)

    def substeps(self, X: Array, reference: Reference, g: Array) -> int:
        """Compute the integration steps per sampling period from the fastest closed-loop pole.

        Raise SimulationError if, on the reference, the inertia is not positive definite or the
        sampled loop is unstable.
        """
        fastest = 0.0
        for k in np.unique(np.linspace(0, len(reference) - 1, LIMIT.LOOP_POINTS).astype(int)):
            A, B = (
                np.atleast_2d(x.full())
                for x in self._bias(reference.q[k], X * self.friction.smooth)
            )
            smallest, time = np.linalg.eigvalsh((A + A.T) / 2)[0], k / reference.rate
            if not smallest > 0:
                raise SimulationError(
                    f"the inertia matrix of the simulated robot is not positive definite at {time:g} "
                    f"s of the reference, smallest eigenvalue {smallest:.3g}; "
                    "use parameters of a physical robot, from CAD or from estimate: {method: feasible}",
                    time=time,
                )
            pole = np.abs(discrete_poles(self.law, A, B, g)).max()
            if pole > LIMIT.UNSTABLE_POLE:
                raise SimulationError(
                    f"the simulated control loop is unstable at {time:g} s of the "
                    f"reference: a discrete pole has modulus {pole:.4g}, expected at most 1; "
                    f"lower kp and {'kd' if self.controller.law.kind == 'pid' else 'kv'}, raise "
                    "the controller's rate, or scale the gains with the inertia (g)",
                    time=time,
                )
            fastest = max(fastest, continuous_pole(self.law, A, B, g))
        steps = max(1, ceil(fastest / self.controller.rate / self.controller.pole_step))
        if steps > LIMIT.MOST_SUBSTEPS:
            raise SettingsError(
                (
                    f"a pole of the control loop at {fastest:.3g} 1/s needs {steps} integration steps per tick of the controller; at most "
                    f"{LIMIT.MOST_SUBSTEPS} are allowed: raise the rate or pole_step, or lower the gains"
                ),
                path=("controller", "rate"),
            )
        return steps

    def _ticks(self, substeps: int) -> Any:
        """Return the CasADi function that simulates one block of ticks, each in `substeps`
        integrations.

        A tick is a sampling period of the controller. Each function is made once.
        """
        if substeps not in self._compiled:
            tick = tick_function(self.model, self.friction, substeps, self.controller.integrator)
            self._compiled[substeps] = (compiled(tick) if self._in_c else tick).mapaccum(BLOCK)
        return self._compiled[substeps]

    def _iterated(
        self, x: Array, signals: Array, X: Array, law: Array, substeps: int
    ) -> tuple[Array, Array]:
        """Simulate all sampling periods (ticks) of a run, in blocks of ticks.

        Parameters
        ----------
        x : ndarray, shape (6n,)
            State of the loop at the first tick: q, qd, y1, y2, I, u.
        signals : ndarray, shape (S + N, 5n)
            q_r, qd_r, feed-forward, encoder noise, disturbance at every tick; during the first S
            ticks the loop only settles.
        X : ndarray, shape (b,)
            Base parameters.
        law : ndarray, shape (n, columns)
            Result of `ControlLaw.matrix`.
        substeps : int
            Integration steps per tick.

        Returns
        -------
        ndarray, shape (S + N, 6n)
            States after each tick.
        ndarray, shape (S + N, 3n)
            Outputs y, tau, qdd.
        """
        function = self._ticks(substeps)
        states = []
        out = []
        for rows, used in blocks(signals, BLOCK):
            after, outputs = function(x, rows.T, X, law, self.law.flags)
            states.append(after.full().T[:used])
            out.append(outputs.full().T[:used])
            x = states[-1][-1]
        return np.vstack(states), np.vstack(out)

    def _start(self, reference: Reference, start: Array | None, *, ideal: bool) -> Array:
        """Return the initial state of the closed loop, with the arm at rest, shape (6n,)."""
        n = len(self.model.JOINTS)
        given = self.controller.start if start is None else start
        q = np.asarray(reference.q[0] if given is None else given, dtype=float)
        if q.shape != (n,) or not np.isfinite(q).all():
            raise InputError(f"start positions {q}; expected {n} finite numbers, one per joint")
        y = q if ideal else self.law.shown(q)
        return np.concatenate([q, np.zeros(n), y, y, np.zeros(2 * n)])

    def _noise(self, rng: np.random.Generator, N: int) -> tuple[Array, Array, Array]:
        """Draw the encoder noise, the disturbance on the arm, and the noise of the recorded torque.

        Each has shape (N, n).
        """
        n, torque, rate = len(self.model.JOINTS), self.controller.torque, self.controller.rate
        encoder, pushed, recorded = rng.standard_normal((3, N, n))
        size = np.broadcast_to(np.asarray(torque.disturbance, dtype=float), (n,))
        if size.any():
            if torque.bandwidth >= rate / 2:
                raise SettingsError(
                    f"the disturbance of the torque has a bandwidth of {torque.bandwidth} Hz; "
                    "expected less than half the rate of the controller",
                    path=("controller", "torque", "bandwidth"),
                )
            pushed = lfilter(*butter(2, torque.bandwidth, fs=rate), pushed, axis=0)
            pushed = pushed / pushed.std(axis=0)
        return (
            self.law.encoder_noise * encoder,
            size * pushed,
            np.asarray(torque.noise, dtype=float) * recorded,
        )


def simulate(
    model: GeneratedModel,
    controller: Controller,
    *,
    records: Sequence[Record] = (),
    folder: str | Path | None = None,
    ideal: bool = False,
    name: str | None = None,
) -> Simulation:
    """Simulate arm and controller in closed loop along the reference motion of the settings.

    records : records that may hold the reference. folder : folder of relative file names.
    ideal, name : as for `runtime.simulate`.
    """
    X = parameters_of(model, controller)
    index = controller.reference.record
    reference = reference_of(controller, model, records=records, folder=folder)
    start = records[index].q[0] if index is not None and controller.start is None else None
    return Simulator(model, controller).run(
        X, reference, ideal=ideal, start=start, name=name or f"SIMULATED {model.NAME}"
    )


def _rest_functions(model: GeneratedModel) -> Any:
    """Make the CasADi function that computes inertia matrix A and viscous friction B at rest.

    (q, Xs) -> A, B = dGamma/dqd.
    """
    n = len(model.JOINTS)
    q, qd, X = ca.SX.sym("q", n), ca.SX.sym("qd", n), ca.SX.sym("X", len(model.BASE_PARAMETERS))
    A = model.casadi("inertia_matrix")(q=q, X=X)["A"]
    B = ca.substitute(
        ca.jacobian(model.casadi("bias")(q=q, qd=qd, X=X)["GAM"], qd),
        qd,
        ca.DM.zeros(n),
    )
    return ca.Function("at_rest", [q, X], [ca.densify(A), ca.densify(B)])


def _check_shapes(reference: Reference, rate: float, n: int, N: int, *given: Array | None) -> None:
    if reference.q.shape[1] != n:
        raise InputError(
            f"the reference has {reference.q.shape[1]} joints, but the model has {n}; give a "
            "reference of all joints of the robot"
        )
    if abs(reference.rate / rate - 1) > 1e-9:
        raise InputError(
            f"the reference is at {reference.rate:g} Hz, but the controller runs at {rate:g} Hz; resample the reference"
        )
    for x in given:
        if x is not None and np.shape(x) != (N, n):
            raise InputError(
                f"torques of shape {np.shape(x)}; expected {(N, n)}, one row per tick of the "
                "reference"
            )


def _check_motion(q: Array, reference: Reference) -> None:
    """Raise SimulationError if positions are not finite, or far outside the range of the reference.

    The error gives the first such tick.
    """
    far = np.abs(reference.q).max() + LIMIT.MOTION_LOST * (1 + np.ptp(reference.q, axis=0))
    lost = ~(np.abs(q) < far)
    if lost.any():
        k, j = np.argwhere(lost)[0]
        raise SimulationError(
            f"the simulated motion leaves its reference at {(k + 1) / reference.rate:g} s, first at "
            f"joint {j + 1}: the control loop is unstable there; lower the gains, raise the rate of "
            "the controller, or slow down the reference",
            time=(k + 1) / reference.rate,
        )
