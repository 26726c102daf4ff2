"""Closed-loop simulation on the emitted CasADi model.

    found = simulate(model, X, controller, reference)              # one run
    simulator = Simulator(model, controller)                       # many: compiled once
    found = simulator.run(X, reference, g=g, ideal=True)           # exact states, no noise, no steps

Torque is held between the ticks of the controller; between them Runge-Kutta of order 4 (or CVODES), with dry friction that holds at rest and only
takes energy. Substeps are at most `pole_step` over the fastest pole of the loop. Before a run the inertia matrix must be positive definite and
the sampled loop stable along the reference: what is not raises SimulationError, which says where, and what to try.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.signal import butter, lfilter

from runtime.control_law import ControlLaw, continuous_pole, control_law, discrete_poles
from runtime.controller_settings import Controller
from runtime.errors import InputError, SettingsError
from runtime.model import GeneratedModel
from runtime.record import Record
from runtime.reference import Reference
from runtime.studies.simulation_friction import DryFriction, dry_friction
from runtime.studies.simulation_loop import compiled, tick_function
from runtime.symbolic_model import SymbolicModel, load_symbolic

Array = np.ndarray

POINTS = 12  # of the reference where inertia and poles are looked at
BLOCK = 250  # ticks in one call
UNSTABLE = 1 + 1e-6  # modulus of a discrete pole
FAR = 1e3  # times the range of the reference, plus 1 rad or m: the loop has left it


class SimulationError(InputError):
    """A run that cannot be made: inertia not positive definite, loop unstable, motion lost. `time` : s, where it was seen."""

    def __init__(self, message: str, *, time: float) -> None:
        self.time = time
        super().__init__(message)


@dataclass(frozen=True, eq=False)
class Simulation:
    """A run, at the recorded ticks; arrays of shape (N, n), joint side, SI.

    q, qd, qdd, tau : exact states, and the torque on the arm without the disturbance.   q_measured, tau_measured : what a record would hold.
    saturated : share of ticks with the torque at its limit, per joint.   state : last state of the loop, for a run that goes on.
    """

    t: Array
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    q_measured: Array
    tau_measured: Array
    q_r: Array
    rate: float
    saturated: Array
    substeps: int
    state: Array = field(repr=False)
    name: str = "simulation"

    def record(self) -> Record:
        """What was measured, with its reference."""
        return Record(self.t, self.q_measured, self.tau_measured, self.rate, self.name, {}, self.q_r)

    def to_csv(self) -> str:
        """t, q1 ..., tau1 ..., qr1 ...: the measured columns, SI, joint side, as `identify` reads them."""
        n = self.q.shape[1]
        names = ["t", *(f"{x}{j}" for x in ("q", "tau", "qr") for j in range(1, n + 1))]
        rows = np.column_stack([self.t, self.q_measured, self.tau_measured, self.q_r])
        return "\n".join([",".join(names), *(",".join(f"{x:.10g}" for x in row) for row in rows), ""])


class Simulator:
    """The closed loop of one robot and one controller, ready for many runs.

    constants : geometry and gravity that replace those of the robot file.   in_c : compile where there is a compiler.
    """

    def __init__(
        self,
        model: GeneratedModel,
        controller: Controller,
        *,
        symbolic: SymbolicModel | None = None,
        constants: Mapping[str, float] | None = None,
        in_c: bool = True,
    ) -> None:
        if unknown := sorted(set(constants or {}) - set(model.CONSTANTS)):
            raise InputError(f"{model.NAME} has no constant {', '.join(unknown)}; there are {', '.join(model.CONSTANTS)}")
        self.model, self.controller, self.constants = model, controller, dict(constants or {})
        self.law: ControlLaw = control_law(controller, model)
        self.symbolic = symbolic or _beside(model)
        self.friction: DryFriction = dry_friction(self.symbolic)
        self._in_c = in_c and controller.integrator == "rk4"  # CVODES has no C of its own
        self._ticks: dict[int, Any] = {}
        self._blocks: dict[int, Any] = {}
        self._bias = _rest_functions(self.symbolic, self.constants)

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
        """The arm with base parameters X (b,) along the reference.

        g : factor on everything between position error and torque, (n,).   start : joint positions at t = 0, at rest.
        ideal : no noise, no steps of encoder and converter.   disturbance : torques on the arm that are not recorded, (N, n).
        feedforward : torques added to the command, (N, n), in place of those of the settings.   seed : of the noise; default: that of the settings.
        """
        n, N = len(self.model.JOINTS), len(reference)
        X, g = self._parameters(X), np.broadcast_to(np.asarray(g, dtype=float), (n,)).copy()
        _check_shapes(reference, self.controller.rate, n, N, disturbance, feedforward)
        substeps = self.substeps(X, reference, g)
        rng = np.random.default_rng(self.controller.seed if seed is None else seed)
        noise, pushed, torque_noise = (np.zeros((N, n)),) * 3 if ideal else self._noise(rng, N)
        pushed = pushed if disturbance is None else pushed + np.asarray(disturbance)
        known = self._feedforward(reference) if feedforward is None else np.asarray(feedforward)
        signals = np.hstack([reference.q, reference.qd, known + self.law.ca * reference.qdd, noise, pushed])
        law = self.law.matrix(g, ideal=ideal)
        x = self._start(X, reference, known[0], law, start, substeps, ideal=ideal)
        states, out = self._iterated(substeps, x, signals, X, law)
        q, qd = states[:, :n], states[:, n : 2 * n]
        y, tau, qdd = np.split(out, 3, axis=1)
        _check_motion(q, reference)
        kept = slice(None, None, self.controller.record_every)
        bound = g * self.law.saturation
        return Simulation(
            t=reference.t[kept],
            q=np.vstack([x[:n], q[:-1]])[kept],
            qd=np.vstack([x[n : 2 * n], qd[:-1]])[kept],
            qdd=qdd[kept],
            tau=tau[kept],
            q_measured=y[kept],
            tau_measured=(tau + torque_noise)[kept],
            q_r=reference.q[kept],
            rate=self.controller.rate / self.controller.record_every,
            saturated=(np.abs(tau) >= bound * (1 - 1e-9)).mean(axis=0),
            substeps=substeps,
            state=states[-1],
            name=name,
        )

    def substeps(self, X: Array, reference: Reference, g: Array) -> int:
        """Steps per tick. SimulationError where the inertia is not positive definite or the sampled loop is unstable on the reference."""
        fastest = 0.0
        for k in np.unique(np.linspace(0, len(reference) - 1, POINTS).astype(int)):
            A, B = (np.atleast_2d(x.full()) for x in self._bias(reference.q[k], X * self.friction.smooth))
            smallest, time = np.linalg.eigvalsh((A + A.T) / 2)[0], k / reference.rate
            if not smallest > 0:
                raise SimulationError(
                    f"the inertia matrix of these parameters is not positive definite at {time:g} s of the reference, smallest eigenvalue {smallest:.3g}; "
                    "take parameters of a physical robot (feasible, CAD), or a smaller step towards these",
                    time=time,
                )
            pole = np.abs(discrete_poles(self.law, A, B, g)).max()
            if pole > UNSTABLE:
                raise SimulationError(
                    f"the loop of these gains and parameters is unstable at {time:g} s of the reference: discrete pole of modulus {pole:.4g}, at most 1; "
                    f"lower kp and {'kd' if self.controller.law.kind == 'pid' else 'kv'}, raise the controller's rate, or scale the gains with the inertia (g)",
                    time=time,
                )
            fastest = max(fastest, continuous_pole(self.law, A, B, g))
        return max(1, ceil(fastest / self.controller.rate / self.controller.pole_step))

    def tick(self, substeps: int) -> Any:
        """The CasADi function of one tick (`simulation_loop.tick_function`)."""
        if substeps not in self._ticks:
            tick = tick_function(self.symbolic, self.friction, self.constants, substeps, self.controller.integrator)
            self._ticks[substeps] = compiled(tick) if self._in_c else tick
        return self._ticks[substeps]

    def _iterated(self, substeps: int, x: Array, signals: Array, X: Array, law: Array) -> tuple[Array, Array]:
        """Ticks along signals (N, 5n), BLOCK at a time: states after each tick (N, 6n), outputs (N, 3n)."""
        if substeps not in self._blocks:
            self._blocks[substeps] = self.tick(substeps).mapaccum(BLOCK)
        states, out = [], []
        for k in range(0, len(signals), BLOCK):
            rows = signals[k : k + BLOCK]
            padded = np.vstack([rows, np.repeat(rows[-1:], BLOCK - len(rows), axis=0)])
            found = self._blocks[substeps](x, padded.T, X, law, self.law.flags)
            states.append(found[0].full().T[: len(rows)])
            out.append(found[1].full().T[: len(rows)])
            x = states[-1][-1]
        return np.vstack(states), np.vstack(out)

    def _start(self, X: Array, reference: Reference, known: Array, law: Array, start: Array | None, substeps: int, *, ideal: bool) -> Array:
        """State of the loop at t = 0: at rest; where there is an integral, after `settle` s on the first reference point."""
        n = len(self.model.JOINTS)
        given = self.controller.start if start is None else start
        q = np.asarray(reference.q[0] if given is None else given, dtype=float)
        if q.shape != (n,) or not np.isfinite(q).all():
            raise InputError(f"start {q}; expected {n} finite joint positions")
        y = q if ideal else self.law.seen(q)
        x = np.concatenate([q, np.zeros(n), y, y, np.zeros(2 * n)])
        N = round(self.controller.settle * self.controller.rate)
        if not self.law.K.any() or not N:
            return x
        still = np.concatenate([reference.q[0], np.zeros(n), known, np.zeros(2 * n)])
        return np.asarray(self._iterated(substeps, x, np.tile(still, (N, 1)), X, law)[0][-1])

    def _feedforward(self, reference: Reference) -> Array:
        """Torque of the reference with the parameters of the robot file, (N, n), where the settings ask for it."""
        if self.controller.feedforward == "none":
            return np.zeros_like(reference.q)
        X = parameters_of(self.model, self.controller)
        return np.asarray(self.model.inverse_dynamics(reference.q, reference.qd, reference.qdd, X, **self.constants))  # type: ignore[attr-defined]

    def _noise(self, rng: np.random.Generator, N: int) -> tuple[Array, Array, Array]:
        """Encoder noise, torque on the arm, noise of the recorded torque: (N, n) each."""
        n, torque, rate = len(self.model.JOINTS), self.controller.torque, self.controller.rate
        encoder, pushed, recorded = rng.standard_normal((3, N, n))
        size = np.broadcast_to(np.asarray(torque.disturbance, dtype=float), (n,))
        if size.any():
            if torque.bandwidth >= rate / 2:
                raise SettingsError(
                    f"{torque.bandwidth} Hz; expected less than half the controller's rate", path=("controller", "torque", "bandwidth")
                )
            pushed = lfilter(*butter(2, torque.bandwidth, fs=rate), pushed, axis=0)
            pushed = pushed / pushed.std(axis=0)
        return self.law.encoder_noise * encoder, size * pushed, np.asarray(torque.noise, dtype=float) * recorded

    def _parameters(self, X: Array) -> Array:
        X = np.asarray(X, dtype=float)
        b = len(self.model.BASE_PARAMETERS)
        if X.shape != (b,) or not np.isfinite(X).all():
            raise InputError(f"X of shape {X.shape}; expected {b} finite base parameters of {self.model.NAME}")
        return X


def simulate(model: GeneratedModel, X: Array, controller: Controller, reference: Reference, **settings: Any) -> Simulation:
    """One run; `settings` as for `Simulator.run`. Many runs of one loop: make a Simulator."""
    return Simulator(model, controller).run(X, reference, **settings)


def parameters_of(model: GeneratedModel, controller: Controller) -> Array:
    """Base parameters (b,) of the standard ones of the robot file, with `values` of the settings in their place."""
    values = {**model.VALUES, **controller.values}
    if missing := [name for name in model.STANDARD_PARAMETERS if name not in values]:  # type: ignore[attr-defined]
        raise SettingsError(
            f"{model.NAME} has no value of {', '.join(missing[:6])}{' ...' if len(missing) > 6 else ''}; give them in the robot file or here",
            path=("controller", "values"),
        )
    if unknown := sorted(set(controller.values) - set(values.keys() & set(model.STANDARD_PARAMETERS))):  # type: ignore[attr-defined]
        raise SettingsError(f"no standard parameter {', '.join(unknown)}", path=("controller", "values"))
    return np.asarray(model.base_parameters(values), dtype=float)  # type: ignore[attr-defined]


def inertia_ratio(model: GeneratedModel, X: Array, X_reference: Array, reference: Reference) -> Array:
    """g_j = J_j(X)/J_j(X_reference), J_j the mean of A_jj over the reference: gains times g keep the bandwidth of the loop. Shape (n,)."""
    inertia_matrix = model.inertia_matrix  # type: ignore[attr-defined]
    J, J_reference = (np.einsum("tjj->j", inertia_matrix(reference.q, x)) for x in (X, X_reference))
    return np.asarray(J / J_reference)


def _beside(model: GeneratedModel) -> SymbolicModel:
    """The CasADi module in the folder of the NumPy module."""
    file = getattr(model, "__file__", None)
    if file is None:
        raise InputError(f"{model.NAME} has no file to look beside for its CasADi module; pass it as `symbolic`")
    return load_symbolic(Path(file).with_name(f"{model.NAME}_casadi.py"), of=model)


def _rest_functions(model: SymbolicModel, constants: Mapping[str, float]) -> Any:
    """(q, Xs) -> A and the viscous friction B = dGamma/dqd at rest."""
    n = len(model.JOINTS)
    q, qd, X = ca.SX.sym("q", n), ca.SX.sym("qd", n), ca.SX.sym("X", len(model.BASE_PARAMETERS))
    A = model.inertia_matrix(q=q, X=X, **constants)["A"]
    B = ca.substitute(ca.jacobian(model.bias(q=q, qd=qd, X=X, **constants)["GAM"], qd), qd, ca.DM.zeros(n))
    return ca.Function("at_rest", [q, X], [ca.densify(A), ca.densify(B)])


def _check_shapes(reference: Reference, rate: float, n: int, N: int, *given: Array | None) -> None:
    if reference.q.shape[1] != n:
        raise InputError(f"reference of {reference.q.shape[1]} joints; expected {n}")
    if abs(reference.rate / rate - 1) > 1e-9:
        raise InputError(f"reference at {reference.rate:g} Hz; the controller runs at {rate:g} Hz")
    for x in given:
        if x is not None and np.shape(x) != (N, n):
            raise InputError(f"torques of shape {np.shape(x)}; expected {(N, n)}, one row per tick of the reference")


def _check_motion(q: Array, reference: Reference) -> None:
    """SimulationError at the first tick where the motion is not finite or far from all reference."""
    far = np.abs(reference.q).max() + FAR * (1 + np.ptp(reference.q, axis=0))
    lost = ~(np.abs(q) < far)
    if lost.any():
        k, j = np.argwhere(lost)[0]
        raise SimulationError(
            f"the motion leaves its reference at {(k + 1) / reference.rate:g} s, position {j + 1} first: the loop is unstable there; lower the gains, "
            "raise the rate, or slow the reference down",
            time=(k + 1) / reference.rate,
        )
