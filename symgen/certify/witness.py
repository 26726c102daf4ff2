"""Independent expected values of every emitted function, at random states and parameters.

The dynamics follow from energies, the poses from products of the matrices of the frames
(`certify.lagrange`). Neither shares code with the recursions, the regrouping or the printers. The
formulas give X from random standard parameters of real bodies, so that A is positive definite.

Constants are drawn around their values in the robot file. If the loops do not close, or if a
regrouping formula holds only for one sign of a ratio, constants are drawn closer to these values.
If this fails too, or if coefficients of formulas are numbers, which hold for these values alone,
the values of the robot file itself are used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from symgen.derive.exact import Array
from symgen.derive.loops import close
from symgen.derive.models import EMITTED, MODELS, ON_REQUEST
from symgen.description.expression import ONE
from symgen.description.robot import INERTIAL, Element, Robot, parameter
from symgen.emit.header import one_sided_friction_that_absorbs
from symgen.errors import DescriptionError
from symgen.regroup.regrouping import EXACT, BaseParameter, Regrouping, sign_conditions

if TYPE_CHECKING:
    from symgen.certify.lagrange import Lagrange, Sample

STATES = 20  # of every function: more than a tile of C, the last one at rest
BLOCKS = 8200
MOVED = 1e-9  # rows of a Jacobian below are zero
SMALL = 1e-6  # of the largest entry: columns of the regressor below are compared with that
ANGLE_STEP = 1e-2  # rad or m
SIX_POINTS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # central differences of sixth order
SPREADS = ((0.25, 0.3), (0.25, 0.0), (0.03, 0.03), (0.03, 0.0))  # of constants, of those that are 0
RANDOM, OF_THE_FILE = "random constants", "the constants of the file"

States = tuple[Array, Array, Array]


class Check(NamedTuple):
    """One test call of an emitted function: its arguments, and the result that it must return.

    Attributes
    ----------
    arguments : tuple of ndarray
        States, with or without an axis of samples, or parameters.
    expected : ndarray
        The expected result.
    scale : ndarray or float
        Size by which a difference is divided.
    keywords : mapping
        Keyword arguments besides the constants.
    compared : callable
        Converts the result before it is compared with `expected`.
    """

    arguments: tuple[Array, ...]
    expected: Array
    scale: Array | float
    keywords: Mapping[str, int] = MappingProxyType({})
    compared: Callable[[Array], Array] = np.asarray


class Witness:
    """Independent expected values of every emitted function of a robot, at random states.

    Parameters
    ----------
    regrouping : Regrouping
        Base parameters with their formulas.
    fixed : mapping, optional
        Values of constants, of q1, QP1, QDP1 ... of actuated joints, and of parameters, which
        replace random values.
    options : sequence of str
        Options of `symgen generate --with` whose models are needed too.
    """

    def __init__(
        self,
        regrouping: Regrouping,
        fixed: Mapping[str, float] | None = None,
        options: Sequence[str] = (),
    ) -> None:
        self.regrouping, self.robot, self.options = regrouping, regrouping.robot, options
        fixed = fixed or {}
        sample, self.drawn = _sampled(regrouping, fixed)
        self.base, self.model, self.constants = sample.base, sample.model, sample.model.constants
        absorbing = bool(one_sided_friction_that_absorbs(regrouping))
        self.q, self.qd, self.qdd = sample.q.copy(), sample.qd.copy(), sample.qdd.copy()
        if not absorbing:
            self.qd[-1] = 0.0
        for k, j in enumerate(self.robot.joints):
            for state, letter in ((self.q, "q"), (self.qd, "QP"), (self.qdd, "QDP")):
                state[:, k] = fixed.get(f"{letter}{j}", state[:, k])
        self.chi = bodies(self.robot, np.random.default_rng(6))
        X = dict(zip(regrouping.names, zip(regrouping.own, self.X, strict=True), strict=True))
        for name, value in fixed.items():
            if name in self.robot.parameters:
                self.chi[self.robot.parameters.index(name)] = value
            elif name in X:
                self.chi[self.robot.parameters.index(X[name][0])] += value - X[name][1]
        self.D = self.model.actuated_regressor(self.q, self.qd, self.qdd, self.base)
        self.x, self.xd, self.xdd, self.G = self.model.motion(self.q, self.qd, self.qdd)
        self.A = self.inertia()
        no_direct = np.linalg.matrix_rank(self.A).min() < self.A.shape[1] or self.robot.loaded
        self.left_out = {
            *["gravity"] * absorbing,
            *["forward_dynamics"] * bool(no_direct),
        }

    def torque(
        self, q: Array, qd: Array, qdd: Array, chi: Array | None = None, *, turning: bool = True
    ) -> Array:
        """Compute the torques Gamma of the actuated joints, shape (..., n).

        `chi` are the standard parameters. Default: the parameters of the witness. `turning` :
        whether a base that moves has w0 and wd0 in addition to a0.
        """
        base = self.base
        if base is not None and not turning:
            base = np.concatenate([0 * base[:, :6], base[:, 6:]], axis=1)
        return np.asarray(
            self.model.actuated_regressor(q, qd, qdd, base) @ (self.chi if chi is None else chi)
        )

    def inertia(self) -> Array:
        """Compute the inertia matrix A from the energy, shape (N, n, n), or (N, 6 + n, 6 + n).

        For a free base, the first six rows are force and moment, and the first six columns are the
        torques by a unit of a0 and of wd0.
        """
        A = self.G.swapaxes(1, 2) @ self.model.inertia_matrix(self.x, self.chi) @ self.G
        if not self.robot.base_is_free:
            return np.asarray(A)
        units = (np.tile(row, (len(self.q), 1)) for row in np.eye(9)[[6, 7, 8, 3, 4, 5]])
        links = self.chi * ~of_elements(self.robot, lambda e: True)
        D = [self.model.actuated_regressor(self.q, 0 * self.q, 0 * self.q, u) for u in units]
        of_base = np.stack([x @ links for x in D], axis=-1)
        beside = of_base[:, 6:].swapaxes(1, 2)
        return np.concatenate([of_base, np.concatenate([beside, A], axis=1)], axis=2)

    @property
    def X(self) -> Array:
        """Base parameters X, shape (b,), computed from the standard parameters by the formulas."""
        return base_values(self.regrouping, self.chi, self.constants)

    @property
    def keywords(self) -> dict[str, float]:
        """Test values, by name, of the robot constants that the emitted functions accept as
        keywords.
        """
        return {name: self.constants[name] for name in self.regrouping.constants}

    @property
    def defaults(self) -> dict[str, float]:
        """Values in the robot file, by name, of the constants that the emitted functions accept as
        keywords.
        """
        return {name: self.robot.constants[name] for name in self.regrouping.constants}

    @property
    def tied(self) -> bool:
        """Whether some passive joint positions have no formula and follow only from closure
        equations.
        """
        return bool(close(self.robot).tied)

    @cached_property
    def own(self) -> Array:
        """Regressor columns of the base parameters at the N test states, shape (N, n, b).

        The columns are those of the standard parameters that give the base parameters their names.
        """
        return self.D[:, :, [self.robot.parameters.index(name) for name in self.regrouping.own]]

    @cached_property
    def poses(self) -> Array:
        """Transformation matrices 0T0 and 0Tj of all frames at the N states, shape (N, 1 + frames,
        4, 4).
        """
        base = np.broadcast_to(np.eye(4), (len(self.q), 1, 4, 4))
        return np.concatenate([base, self.model.poses(self.x)], axis=1)

    @cached_property
    def jacobians(self) -> Array:
        """Jacobians of all frames in frame 0, by the actuated joints, shape (N, frames, 6, n)."""
        return self.model.jacobians(self.x) @ self.G[:, None]

    @cached_property
    def tau(self) -> Array:
        """Torques Gamma of the actuated joints, shape (N, n)."""
        return np.asarray(self.D @ self.chi)

    @cached_property
    def rest(self) -> Array:
        """Torques Gamma at rest, qd = qdd = 0, shape (N, n); on a base that does not turn."""
        return self.torque(self.q, 0 * self.q, 0 * self.q, turning=False)

    @cached_property
    def H(self) -> Array:
        """Torques Gamma at qdd = 0, shape (N, n)."""
        return self.torque(self.q, self.qd, 0 * self.q)

    @cached_property
    def unforced(self) -> Array:
        """Torques Gamma without accelerations, shape (N, n): H, of a free base at wd0 = a0 = 0."""
        if self.base is None or not self.robot.base_is_free:
            return self.H
        base = self.base * (np.arange(9) < 3)
        return np.asarray(
            self.model.actuated_regressor(self.q, self.qd, 0 * self.q, base) @ self.chi
        )

    @property
    def accelerations(self) -> Array:
        """Accelerations qdd, shape (N, n); of a free base wd0, a0, qdd, shape (N, 6 + n)."""
        if self.base is None or not self.robot.base_is_free:
            return self.qdd
        return np.hstack([self.base[:, 3:], self.qdd])

    def of_rows(self, accelerations: Array) -> Array:
        """Reorder wd0, a0, qdd of a free base to a0, wd0, qdd, the order of its rows; shape (..., n)."""
        if not self.robot.base_is_free:
            return accelerations
        wd0, a0, qdd = np.split(accelerations, (3, 6), axis=-1)
        return np.concatenate([a0, wd0, qdd], axis=-1)

    @cached_property
    def checks(self) -> dict[str, list[Check]]:
        """Test calls of each function with the expected results, by function name."""
        q, qd, qdd, X = self.q, self.qd, self.qdd, self.X
        N, _, b = self.own.shape
        columns = np.abs(self.own).max(axis=(0, 1))
        columns = np.maximum(columns, SMALL * columns.max(initial=1e-300))
        W, largest = self.own.transpose(1, 0, 2).reshape(-1, b), np.abs(self.tau).max()
        A, H, size = self.A, self.unforced, np.abs(X).max(initial=1e-300)

        def of_states(
            arguments: tuple[Array, ...], expected: Array, scale: Array | float, **given: Any
        ) -> list[Check]:
            first = tuple(a[0] if len(a) == N and a.ndim > 1 else a for a in arguments)
            return [
                Check(arguments, expected, scale, **given),
                Check(first, expected[0], scale, **given),
            ]

        given = {"q": q, "qd": qd, "qdd": qdd, "tau": self.tau, "X": X}
        given |= {} if self.base is None else {"base": self.base}
        given |= {"qdr": qdd, "qddr": self.tau / largest}
        states = tuple(given[a] for a in MODELS["regressor"].on(self.robot).arguments)
        checks = {
            "base_parameters": [Check((self.chi,), X, size)],
            "regressor": [],  # its place, before what is stacked of it
            "observation_matrix": [
                Check(states, W, columns),
                Check(tuple(x[0] for x in states), self.own[0], columns),
            ],
        }
        asked = [m for m in ON_REQUEST.values() if m.option in self.options]
        for m in (m.on(self.robot) for m in (*EMITTED.values(), *asked)):
            arguments, checks[m.name] = tuple(given[a] for a in m.arguments), []
            for j in (None, *(f.j for f in self.robot.frames)) if m.of_frames else (None,):
                expected = self.value(m.name, j or self.robot.frames[-1].j)
                scale = largest if m.reads_X else max(np.abs(expected).max(), 1.0)
                checks[m.name] += of_states(
                    arguments,
                    expected,
                    columns if m.by_columns else scale,
                    keywords={} if j is None else {"frame": j},
                )
        whole, first = checks["forward_dynamics"]  # as good as A is regular: by its torque
        checks["forward_dynamics"] = [
            whole._replace(
                expected=self.tau,
                compared=lambda qdd: _torque(A, self.of_rows(qdd), H),
            ),
            first._replace(
                expected=self.tau[0], compared=lambda qdd: _torque(A[0], self.of_rows(qdd), H[0])
            ),
        ]
        if self.robot.passive:
            place = [self.robot.moving.index(j) for j in self.robot.passive]
            motion = np.stack([x[:, place] for x in (self.x, self.xd, self.xdd)], axis=1)
            size = np.abs(motion).max()
            checks["passive_joints"] = [
                *of_states((q, qd, qdd), motion, size),
                *of_states((q,), motion[:, 0], size),
            ]
        if not self.tied:  # more samples than a block of the NumPy module has
            rows = np.arange(BLOCKS) % N
            arguments = tuple(given[a] for a in MODELS["gravity"].on(self.robot).states)
            many = (*(x[rows] for x in arguments), X)
            checks["gravity"].append(Check(many, self.rest[rows], largest))
        return {name: check for name, check in checks.items() if name not in self.left_out}

    def value(
        self, name: str, of: int = 0, frame: int = 0, rows: Sequence[int] | None = None
    ) -> Array:
        """Compute the expected value of a model, such as the inertia matrix, shape (N, ...).

        The model describes frame `of`, with components in frame `frame`. A determinant uses the
        given rows of the Jacobian, counted from 1, or else all rows that are not zero.
        """
        N, chi, T, friction = len(self.q), self.chi, self.poses, lambda e: e.is_friction
        R = T[:, frame, :3, :3].swapaxes(1, 2)

        def turned(twist: Array) -> Array:
            return np.concatenate([R @ twist[:, :3], R @ twist[:, 3:]], axis=1)

        def jacobian() -> Array:
            still = np.zeros((N, 6, self.q.shape[1]))
            return turned(self.jacobians[:, of - 1] if of else still)

        def acceleration(qdd: Array) -> Array:
            motion = self.model.motion(self.q, self.qd, qdd)[:3]
            return turned(self.model.acceleration(*motion, of)[..., None])[..., 0]

        def determinant() -> Array:
            J = jacobian()
            moved = [k for k in range(6) if np.abs(J[:, k]).max() > MOVED]
            square = J[:, moved if rows is None else [k - 1 for k in rows]]
            return np.asarray(np.linalg.det(square))

        def coriolis() -> Array:
            """Compute the Coriolis matrix C from the torque h = C(qd) qd, which is quadratic in qd.

            With the unit vectors e_j, C e_j = (h(qd + e_j) - h(qd) - h(e_j))/2.
            """
            q, qd, still = self.q, self.qd, chi * ~of_elements(self.robot, friction)
            at_rest = self.torque(q, 0 * q, 0 * q, still)
            h = [
                self.torque(q, u, 0 * q, still) - at_rest
                for e in np.eye(q.shape[1])
                for u in (qd + e, qd, 0 * qd + e)
            ]
            return np.stack([h[k] - h[k + 1] - h[k + 2] for k in range(0, len(h), 3)], axis=-1) / 2

        values: dict[str, Callable[[], Array]] = {
            "regressor": lambda: self.own,
            "inverse_dynamics": lambda: self.tau,
            "inertia_matrix": lambda: self.A,
            "bias": lambda: self.H,
            "gravity": lambda: self.rest,
            "forward_dynamics": lambda: self.accelerations,
            "frame_poses": lambda: T[:, 1:],
            "pose": lambda: np.linalg.inv(T[:, frame]) @ T[:, of],
            "jacobian": jacobian,
            "determinant": determinant,
            "jacobian_rate": lambda: acceleration(0 * self.qdd),
            "velocity": lambda: (jacobian() @ self.qd[..., None])[..., 0],
            "acceleration": lambda: acceleration(self.qdd),
            "coriolis": coriolis,
            "friction": lambda: self.torque(
                self.q, self.qd, 0 * self.q, chi * of_elements(self.robot, friction)
            ),
            "kinetic_energy": lambda: np.einsum("ti,tij,tj->t", self.qd, self.A, self.qd) / 2,
            "potential_energy": lambda: self.model.potential_energy(self.x, chi),
            "base_parameters": lambda: np.tile(self.X, (N, 1)),
            "closure": lambda: np.zeros((N, 1)),
        }
        states, tree = (self.q, self.qd, self.qdd), (self.x, self.xd, self.xdd)
        qddr = self.tau / np.abs(self.tau).max()
        values |= requested_values(self.model, self.regrouping, chi, states, tree, qddr)
        return np.asarray(values[name]())


def requested_values(
    model: Lagrange, regrouping: Regrouping, chi: Array, states: States, tree: States, qddr: Array
) -> dict[str, Callable[[], Array]]:
    """Return functions that compute the expected results of models, such as the Slotine-Li
    regressor, that the code generator writes only on request.

    The results have shape (N, ...).

    `states` are q, qd, qdd of the actuated joints, shape (N, n); qdd serves as qdr too. `tree` are
    the positions, rates and accelerations of all moving joints. `qddr` are reference accelerations.
    """
    robot, (q, qd, qdr), zero = regrouping.robot, states, 0 * states[0]
    own = [robot.parameters.index(name) for name in regrouping.own]

    def columns(q: Array, qd: Array, qdd: Array) -> Array:
        return np.asarray(model.actuated_regressor(q, qd, qdd)[..., own])

    def friction() -> Array:
        rubs = of_elements(robot, lambda e: e.is_friction)[own]
        return np.asarray((columns(q, qd, zero) - columns(q, zero, zero)) * rubs)

    def slotine_li() -> Array:
        """Compute the regressor of the torque A qddr + C qdr + Q + friction of the Slotine-Li
        controller.

        C qdr is a difference of torques that are quadratic in the velocities.
        """
        h = [columns(q, u, zero) for u in (qd + qdr, qd, qdr, zero)]
        rubs = of_elements(robot, lambda e: e.is_friction)[own]
        C = (h[0] - h[1] - h[2] + h[3]) / 2 * ~rubs
        return np.asarray(columns(q, zero, qddr) + C + friction())

    def momentum(q: Array) -> Array:
        return np.asarray(columns(q, zero, qd) - columns(q, zero, zero))

    def momentum_rate() -> Array:
        """Compute the regressor of dE/dq - Q - friction, the rate of the momentum A qd without
        joint torques.

        E = qd' A qd / 2 is the kinetic energy, Q the torques at rest.
        """
        slope = np.zeros((*q.shape, len(own)))
        for i, e in enumerate(np.eye(q.shape[1])):
            for m, c in SIX_POINTS.items():
                p = [momentum(q + s * m * ANGLE_STEP * e) for s in (1, -1)]
                slope[:, i] += c / ANGLE_STEP * np.einsum("ti,tik->tk", qd, p[0] - p[1]) / 2
        return np.asarray(slope - columns(q, zero, zero) - friction())

    def energies() -> Array:
        kinetic = np.einsum("ti,tik->tk", qd, momentum(q)) / 2
        units = np.eye(len(chi))[own]
        potential = [model.potential_energy(tree[0], unit) for unit in units]
        return np.stack([kinetic, np.stack(potential, axis=-1)], axis=1)

    return {
        "slotine_li_regressor": slotine_li,
        "momentum_regressor": lambda: momentum(q),
        "momentum_rate_regressor": momentum_rate,
        "energy_regressor": energies,
        "base_wrench_regressor": lambda: model.base_regressor(*tree),
    }


def of_elements(robot: Robot, which: Callable[[Element], bool]) -> Array:
    """Return, for each standard parameter, whether `which` is true for its element, such as
    friction.

    The result has shape (p,).
    """
    own = {parameter(e.family, j) for e in robot.elements if which(e) for j in e.keys}
    return np.array([name in own for name in robot.parameters])


def ungrouped(robot: Robot) -> Regrouping:
    """Make a regrouping without combinations: each standard parameter is a base parameter."""
    return Regrouping(
        robot, tuple(BaseParameter(name, name, {name: ONE}) for name in robot.parameters), ()
    )


def is_assumed(robot: Robot) -> Array:
    """Return, for each standard parameter, whether the robot file assumes it zero, shape (p,)."""
    return np.array([name in robot.assume for name in robot.parameters])


def bodies(robot: Robot, rng: np.random.Generator) -> Array:
    """Draw random, physically possible standard parameters of a robot, shape (p,).

    Every link is made of four points of mass. All other parameters lie between 0.1 and 1, except
    those that the robot file assumes zero.
    """
    chi = rng.uniform(0.1, 1.0, len(robot.parameters))
    for j in robot.links:
        m, P = rng.uniform(0.5, 2.0, 4), rng.uniform(-0.5, 0.5, (4, 3))
        J = np.einsum("p,pk,pk->", m, P, P) * np.eye(3) - np.einsum("p,pk,pl->kl", m, P, P)
        first = robot.parameters.index(parameter(INERTIAL[0], j))
        chi[first : first + len(INERTIAL)] = [*J[np.triu_indices(3)], *(m @ P), m.sum()]
    return np.asarray(chi * ~is_assumed(robot))


def base_values(regrouping: Regrouping, chi: Array, constants: Mapping[str, float]) -> Array:
    """Compute base parameters X, shape (b, ...), from standard parameters chi, shape (p, ...), by
    the regrouping formulas.
    """
    value = dict(zip(regrouping.robot.parameters, chi, strict=True))
    factor = {c: c.value(constants) for c in regrouping.coefficients}
    return np.array(
        [sum(factor[c] * value[name] for name, c in b.combination.items()) for b in regrouping.base]
    )


def _at(robot: Robot, constants: Mapping[str, float]) -> Sample:
    from symgen.certify.lagrange import in_one_mode, sampled  # CasADi, loaded late

    return sampled(in_one_mode(robot), STATES, seed=7, constants=constants)


def _sampled(regrouping: Regrouping, fixed: Mapping[str, float]) -> tuple[Sample, str]:
    """Draw random states and, if possible, random constants of the robot.

    Return the states, and a text that says whether the constants are random or those of the file.
    """
    robot, rng = regrouping.robot, np.random.default_rng(8)
    spreads = SPREADS[2 * bool(close(robot).tied) :]
    for spread, zero in spreads if robot.constants and regrouping.method == EXACT else ():
        constants = {
            name: x * (1 + rng.uniform(-spread, spread)) if x else rng.uniform(-zero, zero)
            for name, x in robot.constants.items()
        } | {name: x for name, x in fixed.items() if name in robot.constants}
        if all(ratio.value(constants) * sign > 0 for _, ratio, sign in sign_conditions(regrouping)):
            with suppress(DescriptionError):
                return _at(robot, constants), RANDOM
    return _at(robot, robot.constants), OF_THE_FILE


def _torque(A: Array, qdd: Array, H: Array) -> Array:
    """Compute the torque A qdd + H without a warning if an acceleration is infinite.

    A wrong emitted function may give infinite accelerations.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray((A @ qdd[..., None])[..., 0] + H)
