"""Derivatives of a simulated motion by the base parameters: the tangent system, stepped with the
same Runge-Kutta as the motion.

    A dqdd = dtau - (dGamma/dq) Xi - (dGamma/dqd) Xid - D - G' df,      Xi = dq/dX,  Xid = dqd/dX,
            one column per parameter

with D the regressor without dry friction and df the direction of slip; dtau follows from the
controller, which sees Xi as it sees q. Elements at
rest keep Xid at zero along their rows of G. Where a slip s = G qd stops, its instant moves by dt =
-G Xid/(G qdd_before), and

    Xid_after = Xid_before + (qdd_before - qdd_after) dt
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from runtime.limits import LIMIT
from runtime.loop.controller_tick import (
    LoopInputs,
    blocks,
    control_function,
    flow_function,
    keeps_sliding,
    plant_inputs,
    round_function,
    runge_kutta,
    sliding_friction,
)
from runtime.loop.dry_friction import DryFriction
from runtime.loop.result import Sensitivity
from runtime.loop.stick_slip import friction_function, rest_function, solve
from runtime.model.casadi import SymbolicModel

Array = np.ndarray
MX = Any  # casadi.MX


def tangent_function(
    model: SymbolicModel,
    friction: DryFriction,
    constants: Mapping[str, float],
    substeps: int,
    integrator: str,
) -> Any:
    """(Xi, x, signals, X, law, flags) -> Xi at the next tick, and dtau/dX of this one; Xi (6n, b) =
    dx/dX of the state x of a tick.
    """
    n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
    control, law_columns = control_function(n), control_function(n).size2_in(6)
    Xi, x, signals, X = (
        ca.MX.sym("Xi", 6 * n, b),
        ca.MX.sym("x", 6 * n),
        ca.MX.sym("signals", 5 * n),
        ca.MX.sym("X", b),
    )
    law, flags = ca.MX.sym("law", n, law_columns), ca.MX.sym("flags", 4)
    q, qd, y1, y2, I, before = ca.vertsplit(x, n)
    *wanted, noise, disturbance = ca.vertsplit(signals, n)
    inputs = [q, ca.vertcat(y1, y2), I, before, ca.vertcat(*wanted), noise, law, flags]
    _, tau, _, _ = control(*inputs)
    dq, dqd, dy1, dy2, dI, dbefore = ca.vertsplit(Xi, n)
    dcontrol = ca.vertcat(dq, dy1, dy2, dI, dbefore)
    dtau, dI_next, du = (
        part @ dcontrol for part in ca.vertsplit(_control_jacobian(n, law_columns)(*inputs), n)
    )
    step = _plant_tangent(model, friction, dict(constants), integrator)
    plus, minus, smooth = (
        ca.DM(friction.plus) @ X,
        ca.DM(friction.minus) @ X,
        X * ca.DM(friction.smooth),
    )
    dq1, dqd1 = dq, dqd
    for _ in range(substeps):
        q, qd, dq1, dqd1 = step(
            q, qd, tau + disturbance, smooth, plus, minus, flags[0] / substeps, dq1, dqd1, dtau
        )
    following = ca.vertcat(dq1, dqd1, dq, dy1, dI_next, du)
    names = ["Xi", "x", "signals", "X", "law", "flags"]
    return ca.Function(
        "tangent", [Xi, x, signals, X, law, flags], [following, dtau], names, ["Xi1", "dtau"]
    )


def _control_jacobian(n: int, law_columns: int) -> Any:
    """Rows dtau, dI, du by the columns q, y1, y2, I, u of `control_function`."""
    sizes = (n, 2 * n, n, n, 3 * n, n)
    inputs = [
        *(ca.SX.sym(f"i{k}", size) for k, size in enumerate(sizes)),
        ca.SX.sym("law", n, law_columns),
        ca.SX.sym("flags", 4),
    ]
    _, tau, I, u = control_function(n)(*inputs)
    return ca.Function(
        "control_jacobian",
        inputs,
        [ca.densify(ca.jacobian(ca.vertcat(tau, I, u), ca.vertcat(*inputs[:4])))],
    )


def _plant_tangent(
    model: SymbolicModel, friction: DryFriction, constants: dict[str, float], integrator: str
) -> Any:
    """(q, qd, tau, Xs, plus, minus, h, dq, dqd, dtau) -> q, qd, dq, dqd after h, in the same rounds
    as the plant.
    """
    n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
    inputs = [
        *plant_inputs(model, friction),
        *(ca.MX.sym(name, n, b) for name in ("dq", "dqd", "dtau")),
    ]
    q, qd, tau, X, plus, minus, h, dq, dqd, dtau = inputs
    flow, step = (
        flow_function(model, constants, integrator),
        _runge_kutta_tangent(model, friction, constants),
    )
    if not len(friction.G):
        q1, qd1, _ = flow(q, qd, tau, X, h)
        return ca.Function(
            "plant_tangent", inputs, [q1, qd1, *step(q, qd, tau, X, h, dq, dqd, dtau)]
        )
    f, direction = sliding_friction(friction, qd, plus, minus)
    push, pull = _without_friction(friction, tau, dtau, f, direction)
    q1, qd1, _ = flow(q, qd, push, X, h)
    given = [
        *inputs,
        *(ca.MX.sym(name, n) for name in ("q1", "qd1", "push")),
        ca.MX.sym("pull", n, b),
    ]
    sliding = ca.Function(
        "sliding", given, [given[10], given[11], *step(q, qd, given[12], X, h, dq, dqd, given[13])]
    )
    cut, whole = (_round_tangent(model, friction, constants, flow, step, whole=k) for k in (0, 1))
    idle = ca.Function("idle", inputs, [q, qd, h, dq, dqd])
    again = ca.Function.if_else("again", cut, idle)
    final = ca.Function.if_else("final", whole, ca.Function("idle", inputs, [q, qd, dq, dqd]))
    state = cut(*inputs)
    for _ in range(LIMIT.STICK_ROUNDS - 2):
        state = again(state[2] > 0, state[0], state[1], tau, X, plus, minus, *state[2:], dtau)
    end = final(state[2] > 0, state[0], state[1], tau, X, plus, minus, *state[2:], dtau)
    either = ca.Function.if_else("either", sliding, ca.Function("stopping", given, list(end)))
    return ca.Function(
        "plant_tangent",
        inputs,
        list(either(keeps_sliding(friction, direction, qd, qd1), *inputs, q1, qd1, push, pull)),
    )


def _round_tangent(
    model: SymbolicModel,
    friction: DryFriction,
    constants: dict[str, float],
    flow: Any,
    step: Any,
    *,
    whole: int,
) -> Any:
    """One round of the plant with its tangent; what is left of h among the results of all but the
    `whole` one.
    """
    n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
    inputs = [
        *plant_inputs(model, friction),
        *(ca.MX.sym(name, n, b) for name in ("dq", "dqd", "dtau")),
    ]
    q, qd, tau, X, plus, minus, h, dq, dqd, dtau = inputs
    q1, qd1, left, _, f, direction, Y, stopped = round_function(
        model, friction, constants, flow, whole=whole
    )(*inputs[:7])
    push, pull = _without_friction(friction, tau, dtau, f, direction)
    dq1, dqd1 = step(q, qd, push, X, h - left, dq, dqd, pull)
    rest, held = rest_function(friction, b), direction == 0
    dq1, dqd1 = dq + rest(dq1 - dq, Y, held), rest(dqd1, Y, held)
    if whole:
        return ca.Function("whole_tangent", inputs, [q1, qd1, dq1, dqd1])
    before = flow(q1, qd1, push, X, 0)[2]
    after = friction_function(model, friction, constants)(q1, qd1, tau, X, plus, minus)[2]
    slowing = ca.DM(friction.G) @ before
    share = ca.if_else(
        ca.logic_and(stopped, ca.fabs(slowing) > LIMIT.SLIP_REST), 1 / slowing, 0
    ) / ca.fmax(1, ca.sum1(stopped))
    dt = -share.T @ (ca.DM(friction.G) @ dqd1)
    return ca.Function("cut_tangent", inputs, [q1, qd1, left, dq1, dqd1 + (before - after) @ dt])


def _without_friction(
    friction: DryFriction, tau: MX, dtau: MX, f: MX, direction: MX
) -> tuple[MX, MX]:
    """tau - G' f and its derivative, the forces at rest left to `rest_function`."""
    G = ca.DM(friction.G)
    df = ca.diag(direction > 0) @ ca.DM(friction.plus) - ca.diag(direction < 0) @ ca.DM(
        friction.minus
    )
    return tau - G.T @ f, dtau - G.T @ df


def _runge_kutta_tangent(
    model: SymbolicModel, friction: DryFriction, constants: dict[str, float]
) -> Any:
    """(q, qd, tau, Xs, h, dq, dqd, dtau) -> dq, dqd after h; tau without dry friction."""
    n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
    q, qd, tau, X, _, _, h = plant_inputs(model)
    dq, dqd, dtau = (ca.MX.sym(name, n, b) for name in ("dq", "dqd", "dtau"))
    linear = _linear_function(model, friction, constants)

    def rates(q: MX, qd: MX, dq: MX, dqd: MX) -> tuple[MX, ...]:
        qdd, inverse, K, C, D = linear(q, qd, tau, X)
        return qd, qdd, dqd, inverse @ (dtau - K @ dq - C @ dqd - D)

    end, _ = runge_kutta(rates, [q, qd, dq, dqd], h)
    return ca.Function("runge_kutta_tangent", [q, qd, tau, X, h, dq, dqd, dtau], end[2:])


def _linear_function(
    model: SymbolicModel, friction: DryFriction, constants: dict[str, float]
) -> Any:
    """(q, qd, tau, Xs) -> qdd, A^-1, dGamma/dq and dGamma/dqd at that qdd, and D without the
    columns of dry friction.
    """
    n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
    q, qd, qdd, tau, X = (
        ca.SX.sym(name, k) for name, k in (("q", n), ("qd", n), ("qdd", n), ("tau", n), ("X", b))
    )
    Gamma = model.inverse_dynamics(q=q, qd=qd, qdd=qdd, X=X, **constants)["GAM"]
    D = model.regressor(q=q, qd=qd, qdd=qdd, **constants)["D"] @ ca.diag(ca.DM(friction.smooth))
    forward = model.forward_dynamics(q=q, qd=qd, tau=tau, X=X, **constants)["qdd"]
    A = model.inertia_matrix(q=q, X=X, **constants)["A"]
    parts = ca.substitute([ca.jacobian(Gamma, q), ca.jacobian(Gamma, qd), D], [qdd], [forward])
    inverse = solve(A, ca.SX.eye(n))
    return ca.Function(
        "linear", [q, qd, tau, X], [forward, ca.densify(inverse), *map(ca.densify, parts)]
    )


def tangent_along(
    function: Any, before: Array, inputs: LoopInputs, flags: Array, block: int, every: int
) -> Sensitivity:
    """The tangent system along the states `before` each tick, (S + N, 6n); derivatives at every
    `every`-th tick after the settling.
    """
    n, b = before.shape[1] // 6, len(inputs.X)
    Xi = np.zeros((6 * n, b))
    ticks: list[Array] = []  # dq, dqd, dtau of the ticks that count, (3n, b) each
    tick = 0
    for rows, used in blocks(np.hstack([before, inputs.signals]), block):
        Xi1, dtau = (
            x.full()
            for x in function(
                Xi, rows[:, : 6 * n].T, rows[:, 6 * n :].T, inputs.X, inputs.law, flags
            )
        )
        after, torque = Xi1.reshape(6 * n, block, b), dtau.reshape(n, block, b)
        for k in range(used):
            if tick >= inputs.settling and (tick - inputs.settling) % every == 0:
                ticks.append(
                    np.vstack([(Xi if k == 0 else after[:, k - 1])[: 2 * n], torque[:, k]])
                )
            tick += 1
        Xi = after[:, used - 1]
    q, qd, tau = np.split(np.array(ticks), 3, axis=1)
    return Sensitivity(q, qd, tau)
