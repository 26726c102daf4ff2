"""One sampling period (tick) of a closed loop as a CasADi function, compiled to C if possible.

    y     = position that the encoder shows for q         qd_m = its difference
    u     = P e + Vr qd_r - Vm qd_m + K I + feed-forward,  e = q_r - y
            (both laws of the study file, runtime.loop.control_law)
    tau   = g sat(u), u of this tick or of the tick before, in steps of the converter, held until
            the next tick
    q, qd = Runge-Kutta of order 4 in equal substeps (or CVODES), cut where a slip stops
    (`runtime.loop.stick_slip`)

State of a tick: q, qd, the last two positions shown, I, and u. Everything that changes from run to
run is an input, so that one compilation serves all runs.
"""

from __future__ import annotations

import ctypes
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from runtime.core.loading import cache_folder
from runtime.core.model import GeneratedModel
from runtime.ground.limits import limits
from runtime.loop.compile_cache import FallbackWarning, NotCompiledError, shared_object
from runtime.loop.control_law import VECTORS
from runtime.loop.dry_friction import DryFriction
from runtime.loop.stick_slip import event_function, friction_function, kinetic, rest_function

LIMIT = limits(__package__)

Array = np.ndarray
MX = Any  # casadi.MX

FLAGS = (
    "-std=c11",
    "-O2",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",
    "-shared",
    "-fPIC",
)
CVODES = {"abstol": 1e-10, "reltol": 1e-9}


def blocks(rows: Array, size: int) -> Iterator[tuple[Array, int]]:
    """Yield input samples in blocks of `size` rows, each with its number of rows before padding.

    The last block is filled up with copies of its last row.
    """
    for k in range(0, len(rows), size):
        block = rows[k : k + size]
        yield np.vstack([block, np.repeat(block[-1:], size - len(block), axis=0)]), len(block)


def tick_function(
    model: GeneratedModel,
    friction: DryFriction,
    substeps: int,
    integrator: str,
) -> Any:
    """Make the CasADi function that simulates the closed loop over one sampling period (tick).

    (x, signals, X, law, flags) -> x at the next tick, and y, tau, qdd of this tick.

    x : q, qd, y1, y2, I, u.
    signals : q_r, qd_r, feed-forward, encoder noise, disturbance.
    law : the settings of the control law in `VECTORS`, one column each, shape (n, columns), then R,
        R^-1 and offset of the encoder.
    flags : T, delay, weights of the two differences.
    """
    n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
    x, signals, X = ca.MX.sym("x", 6 * n), ca.MX.sym("signals", 5 * n), ca.MX.sym("X", b)
    law, flags = ca.MX.sym("law", n, len(VECTORS) + 2 * n + 1), ca.MX.sym("flags", 4)
    q: Any
    q, qd, y1, y2, I, u1 = ca.vertsplit(x, n)
    *wanted, noise, disturbance = ca.vertsplit(signals, n)
    y, tau, I_next, u = control_function(n)(
        q, ca.vertcat(y1, y2), I, u1, ca.vertcat(*wanted), noise, law, flags
    )
    plus, minus = ca.DM(friction.plus) @ X, ca.DM(friction.minus) @ X
    plant = plant_function(model, friction, integrator)
    starts: list[MX] = []  # qdd at the start of every substep
    for _ in range(substeps):
        q, qd, qdd = plant(
            q, qd, tau + disturbance, X * ca.DM(friction.smooth), plus, minus, flags[0] / substeps
        )
        starts.append(qdd)
    results: list[MX] = [ca.vertcat(q, qd, y, y1, I_next, u), ca.vertcat(y, tau, starts[0])]
    return ca.Function(
        "tick",
        [x, signals, X, law, flags],
        results,
        ["x", "signals", "X", "law", "flags"],
        ["x1", "out"],
    )


def control_function(n: int) -> Any:
    """Make the CasADi function that computes the control law in one sampling period (tick).

    (q, y1 y2, I, u of the tick before, q_r qd_r ff, noise, law, flags) -> y, tau, I, u.
    """
    q, past, I, before, wanted, noise = (
        ca.SX.sym(name, k * n)
        for name, k in (("q", 1), ("past", 2), ("I", 1), ("u", 1), ("wanted", 3), ("noise", 1))
    )
    law, flags = ca.SX.sym("law", n, len(VECTORS) + 2 * n + 1), ca.SX.sym("flags", 4)
    v = {name: law[:, k] for k, name in enumerate(VECTORS)}
    R, R_inverse, offset = (
        law[:, len(VECTORS) : len(VECTORS) + n],
        law[:, len(VECTORS) + n : -1],
        law[:, -1],
    )
    T, delay, last, average = (flags[k] for k in range(4))
    q_r, qd_r, feedforward = ca.vertsplit(wanted, n)
    y1, y2 = ca.vertsplit(past, n)
    y = R_inverse @ _steps(R @ (q - offset) + noise, v["encoder_step"]) + offset
    qd_m = (last * (y - y1) + average * (y - y2)) / T
    e = q_r - y
    u = v["P"] * e + v["Vr"] * qd_r - v["Vm"] * qd_m + v["K"] * I + feedforward
    I_next = _clip(I + T * (v["Ie"] * e + v["Ir"] * qd_r - v["Im"] * qd_m), v["antiwindup"])
    tau = _steps(
        v["g"] * _clip(delay * before + (1 - delay) * u, v["saturation"]), v["torque_step"]
    )
    return ca.Function(
        "control", [q, past, I, before, wanted, noise, law, flags], [y, tau, I_next, u]
    )


def _clip(x: MX, bound: MX) -> MX:
    return ca.fmin(ca.fmax(x, -bound), bound)


def _steps(x: MX, step: MX) -> MX:
    """Round x to a multiple of `step`; a step of 0 leaves x unchanged."""
    return ca.if_else(step > 0, step * ca.floor(x / step + 0.5), x)


def plant_function(model: GeneratedModel, friction: DryFriction, integrator: str) -> Any:
    """Make the CasADi function that moves the arm with dry friction over an integration step h.

    (q, qd, tau, Xs, plus, minus, h) -> q, qd after h, and qdd at its start.

    If every slip keeps its direction, h is one step; otherwise h is divided into rounds, each until
    the next slip stops.
    """
    n, m = friction.G.shape[1], len(friction.G)
    inputs = plant_inputs(model, friction)
    q, qd, tau, X, plus, minus, h = inputs
    flow = (_cvodes if integrator == "cvodes" else _runge_kutta)(model)
    if not m:
        return ca.Function("plant", inputs, list(flow(q, qd, tau, X, h)))
    f, direction = sliding_friction(friction, qd, plus, minus)
    sliding = flow(q, qd, tau - ca.DM(friction.G).T @ f, X, h)
    calm = keeps_sliding(friction, direction, qd, sliding[1])
    given = [*inputs, *(ca.MX.sym(name, n) for name in ("q1", "qd1", "qdd"))]
    done = ca.Function("sliding", given, given[7:])
    stopping = ca.Function("stopping", given, list(_rounds(model, friction, flow)(*inputs)))
    return ca.Function(
        "plant",
        inputs,
        list(ca.Function.if_else("either", done, stopping)(calm, *inputs, *sliding)),
    )


def sliding_friction(friction: DryFriction, qd: MX, plus: MX, minus: MX) -> tuple[MX, MX]:
    """Compute dry friction forces f and slip directions, if all friction elements slip."""
    direction = ca.sign(ca.DM(friction.G) @ qd)
    return kinetic(direction, plus, minus), direction


def keeps_sliding(friction: DryFriction, direction: MX, qd: MX, end: MX) -> MX:
    """Whether every friction element slips in the same direction at the velocities qd and `end`."""
    G = ca.DM(friction.G)
    return ca.mmin(ca.vertcat(ca.fabs(G @ qd), direction * (G @ end))) > LIMIT.SLIP_REST


def _rounds(model: GeneratedModel, friction: DryFriction, flow: Any) -> Any:
    """Make the CasADi function that moves the arm over a step in which friction elements stop.

    The step h is divided into rounds; each round lasts until the next slip stops.
    """
    inputs = plant_inputs(model, friction)
    cut, whole = (round_function(model, friction, flow, whole=k) for k in (0, 1))

    # a switch gives only what is used: in C, CasADi crashes on a result of one that nobody takes
    q, qd, *fixed, h = inputs
    of_cut, results = list(cut(*inputs)[:4]), [q, qd, h]
    again = ca.Function.if_else(
        "again", ca.Function("next", inputs, of_cut[:3]), ca.Function("idle", inputs, results)
    )
    final = ca.Function.if_else(
        "final",
        ca.Function("last", inputs, list(whole(*inputs)[:2])),
        ca.Function("idle", inputs, results[:2]),
    )
    q, qd, h, qdd = ca.Function("first", inputs, of_cut)(*inputs)
    for _ in range(LIMIT.STICK_ROUNDS - 2):
        q, qd, h = again(h > 0, q, qd, *fixed, h)
    q, qd = final(h > 0, q, qd, *fixed, h)
    return ca.Function("rounds", inputs, [q, qd, qdd])


def round_function(
    model: GeneratedModel,
    friction: DryFriction,
    flow: Any,
    *,
    whole: int,
) -> Any:
    """Make the CasADi function that moves the arm over a time h, or until a friction element stops.

    whole : 1 for the whole of h. Results: q, qd, the remaining part of h, qdd, f, direction, Y, and
    which slips stopped.
    """
    inputs = plant_inputs(model, friction)
    q, qd, tau, X, plus, minus, h = inputs
    f, direction, qdd, Y = friction_function(model, friction)(q, qd, tau, X, plus, minus)
    q1, qd1, _ = flow(q, qd, tau - ca.DM(friction.G).T @ f, X, h)
    qx, qdx, left, at_rest = event_function(friction)(q, qd, qdd, q1, qd1, h, direction, whole)
    rest, held = rest_function(friction), direction == 0
    results = [
        q + rest(qx - q, Y, held),
        rest(qdx, Y, at_rest),
        left,
        qdd,
        f,
        direction,
        Y,
        at_rest * (direction != 0),
    ]
    return ca.Function(f"round_{whole}", inputs, results)


def plant_inputs(model: GeneratedModel, friction: DryFriction | None = None) -> list[MX]:
    """Make the symbolic inputs of the functions that move the arm: state, torques, parameters.

    The inputs are q, qd, tau, Xs, plus, minus, h. Xs : parameters without dry friction; plus, minus
    : largest friction forces in each direction; h : time step. Without dry friction, plus and minus
    are empty.
    """
    n, m = len(model.JOINTS), 0 if friction is None else len(friction.G)
    names = ("q", "qd", "tau", "X", "plus", "minus", "h")
    sizes = (n, n, n, len(model.BASE_PARAMETERS), m, m, 1)
    return [ca.MX.sym(name, rows) for name, rows in zip(names, sizes, strict=True)]


def runge_kutta(
    rates: Callable[..., Sequence[MX]], state: Sequence[MX], h: MX
) -> tuple[list[MX], Sequence[MX]]:
    """Integrate a state over the time h by one Runge-Kutta step of order 4.

    Returns the state after h, and its derivative at the start. rates(*state) gives the derivative.
    """

    def moved(share: MX, slope: Sequence[MX]) -> list[MX]:
        return [x + share * k for x, k in zip(state, slope, strict=True)]

    k1 = rates(*state)
    k2 = rates(*moved(h / 2, k1))
    k3 = rates(*moved(h / 2, k2))
    k4 = rates(*moved(h, k3))
    slopes = zip(k1, k2, k3, k4, strict=True)
    return moved(h / 6, [a + 2 * b + 2 * c + d for a, b, c, d in slopes]), k1


def _runge_kutta(model: GeneratedModel) -> Any:
    """Make the CasADi function that moves the arm over a step h by Runge-Kutta of order 4.

    (q, qd, tau, Xs, h) -> q, qd after h at constant torque, and qdd at the start.
    """
    q, qd, tau, X, _, _, h = plant_inputs(model)

    def rates(q: MX, qd: MX) -> tuple[MX, MX]:
        return qd, model.casadi("forward_dynamics")(q=q, qd=qd, tau=tau, X=X)["qdd"]

    end, start = runge_kutta(rates, [q, qd], h)
    return ca.Function("runge_kutta", [q, qd, tau, X, h], [*end, start[1]])


def _cvodes(model: GeneratedModel) -> Any:
    """Make the CasADi function that moves the arm over a step h by CVODES.

    Inputs and results are those of `_runge_kutta`.
    """
    q, qd, tau, X, _, _, h = plant_inputs(model)
    n = len(model.JOINTS)
    x = ca.MX.sym("x", 2 * n)
    a = model.casadi("forward_dynamics")(q=x[:n], qd=x[n:], tau=tau, X=X)["qdd"]
    problem = {"x": x, "p": ca.vertcat(tau, X, h), "ode": h * ca.vertcat(x[n:], a)}
    end = ca.integrator("cvodes", "cvodes", problem, 0, 1, CVODES)(
        x0=ca.vertcat(q, qd), p=ca.vertcat(tau, X, h)
    )["xf"]
    start = model.casadi("forward_dynamics")(q=q, qd=qd, tau=tau, X=X)["qdd"]
    return ca.Function("flow", [q, qd, tau, X, h], [end[:n], end[n:], start])


def compiled(function: Any, cache: Path | None = None) -> Any:
    """Compile a CasADi function as C code, or load its compiled form from the cache.

    If the compilation fails, the result is the function itself, with a FallbackWarning.
    """
    generator = ca.CodeGenerator(f"{function.name()}.c")
    generator.add(function)
    text = generator.dump().encode()
    objects: list[Path] = []

    def opened(path: Path) -> ctypes.CDLL:
        library = ctypes.CDLL(str(path))
        if not hasattr(library, function.name()):
            raise NotCompiledError(f"the compiled file {path} has no function {function.name()}")
        objects.append(path)
        return library

    try:
        shared_object(
            Path(f"{function.name()}.c"), text, cache or cache_folder("compiled"), opened, FLAGS
        )
    except (
        NotCompiledError,
        OSError,
        RuntimeError,
    ) as e:  # RuntimeError: no home folder, a circle of links
        warnings.warn(
            f"the simulation runs in the interpreter of CasADi, because it cannot run as compiled C: {e}",
            FallbackWarning,
            stacklevel=2,
        )
        return function
    return ca.external(function.name(), str(objects[-1]))
