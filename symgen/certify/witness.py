"""What every function has to give, at states, parameters and constants drawn at random.

The dynamics are those of energies, the poses products of the frames' matrices (`derive.lagrange`):
neither shares code with the recursions, the regrouping or the printers. X is what the formulas
make of random standard parameters, those of bodies, so that A is positive definite.

Constants are drawn around those of the file. Where loops do not close for them, and where a
regrouping formula holds for one sign of a ratio, they are drawn nearer; else they are the file's,
as they are where formulas are numbers, which hold for these alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from symgen.derive.exact import Array
from symgen.derive.loops import close
from symgen.derive.models import MODELS
from symgen.description.expression import ONE
from symgen.description.robot import INERTIAL, Robot, parameter
from symgen.emit.header import one_sided_friction_that_absorbs
from symgen.errors import DescriptionError
from symgen.regroup.regrouping import EXACT, BaseParameter, Regrouping, sign_conditions

if TYPE_CHECKING:
    from symgen.derive.lagrange import Sample

STATES = 20  # of every function: more than a tile of C, the last one at rest
BLOCKS = 8200
FEW = 4  # states of the derivatives
SMALL = 1e-6  # of the largest entry: columns of the regressor below are compared with that
SPREADS = ((0.25, 0.3), (0.25, 0.0), (0.03, 0.03), (0.03, 0.0))  # of constants, of those that are 0
RANDOM, OF_THE_FILE = "random constants", "the constants of the file"
ANGLE_STEP, SPEED_STEP = 1e-2, 1e-4  # rad or m, and their rates
SIX_POINTS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # central differences of sixth order


@dataclass(frozen=True)
class Check:
    """What a function has to give.

    Attributes
    ----------
    arguments : tuple of ndarray
        Of all states, first axis, or parameters.
    expected : ndarray
        First axis states, unless `alone` is None.
    scale : ndarray or float
        What a difference is divided by.
    alone : ndarray or None
        What one state, the first, without its axis, has to give; None where no state is read.
    keywords : mapping
        Keyword arguments beside the constants.
    compared : callable
        Makes of the result what is compared with `expected`.
    """

    arguments: tuple[Array, ...]
    expected: Array
    scale: Array | float
    alone: Array | None = None
    keywords: Mapping[str, int] = field(default_factory=dict)
    compared: Callable[[Array], Array] = np.asarray


class Witness:
    """Independent values of every function of a robot.

    Parameters
    ----------
    regrouping : Regrouping
        Base parameters with their formulas.
    fixed : mapping, optional
        Values of constants, of q1, QP1, QDP1 ... of actuated joints, and of parameters, in the
        place of drawn ones.
    """

    def __init__(self, regrouping: Regrouping, fixed: Mapping[str, float] | None = None) -> None:
        self.regrouping, self.robot = regrouping, regrouping.robot
        fixed = fixed or {}
        sample, self.drawn = _sampled(regrouping, fixed)
        self.model, self.constants = sample.model, sample.model.constants
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
        self.D = self.model.actuated_regressor(self.q, self.qd, self.qdd)
        self.x, self.xd, self.xdd, self.G = self.model.motion(self.q, self.qd, self.qdd)
        self.A = self.model.actuated_inertia(self.q, self.chi)  # (N, n, n)
        massless = np.linalg.matrix_rank(self.A).min() < self.q.shape[1]
        self.left_out = {
            *["gravity"] * absorbing,
            *["forward_dynamics", "forward_dynamics_derivatives"] * bool(massless),
        }

    def torque(self, q: Array, qd: Array, qdd: Array, chi: Array | None = None) -> Array:
        """Gamma of the actuated joints, (..., n)."""
        return np.asarray(
            self.model.actuated_regressor(q, qd, qdd) @ (self.chi if chi is None else chi)
        )

    @property
    def X(self) -> Array:
        """Base parameters of chi by the formulas."""
        return base_values(self.regrouping, self.chi, self.constants)

    @cached_property
    def own(self) -> Array:
        """Columns of the parameters that the base parameters are called after, (N, n, b)."""
        return self.D[:, :, [self.robot.parameters.index(name) for name in self.regrouping.own]]

    @cached_property
    def tau(self) -> Array:
        """Gamma, (N, n)."""
        return np.asarray(self.D @ self.chi)

    @cached_property
    def rest(self) -> Array:
        """Gamma at rest, (N, n)."""
        return self.torque(self.q, 0 * self.q, 0 * self.q)

    @cached_property
    def H(self) -> Array:
        """Gamma at qdd = 0, (N, n)."""
        return self.torque(self.q, self.qd, 0 * self.q)

    @cached_property
    def checks(self) -> dict[str, list[Check]]:
        """{function: what it has to give}."""
        q, qd, qdd, X = self.q, self.qd, self.qdd, self.X
        N, _, b = self.own.shape
        columns = np.abs(self.own).max(axis=(0, 1))
        columns = np.maximum(columns, SMALL * columns.max(initial=1e-300))
        W, largest = self.own.transpose(1, 0, 2).reshape(-1, b), np.abs(self.tau).max()
        A, H, size = self.A, self.H, np.abs(X).max(initial=1e-300)

        def of_states(
            arguments: tuple[Array, ...], expected: Array, scale: Array | float = largest
        ) -> Check:
            return Check(arguments, expected, scale, expected[0])

        def driven(qdd: Array) -> Array:
            return np.asarray((A[: len(qdd)] @ qdd[..., None])[..., 0] + H[: len(qdd)])

        given = {"q": q, "qd": qd, "qdd": qdd, "X": X}
        expected = {
            "regressor": (self.own, columns),
            "inverse_dynamics": (self.tau,),
            "inertia_matrix": (A,),
            "bias": (H,),
            "gravity": (self.rest,),
            "frame_poses": (T := self.model.poses(self.x), np.abs(T).max()),
        }
        composed = {
            "forward_dynamics": [
                Check((q, qd, self.tau, X), self.tau, largest, self.tau[0], {}, driven)
            ],
            "jacobian": list(self._jacobians()),
        }
        checks = {
            "base_parameters": [Check((self.chi,), X, size)],
            "regressor": [],  # its place, before what is stacked of it
            "observation_matrix": [Check((q, qd, qdd), W, columns, self.own[0])],
        } | {
            m.name: composed.get(m.name)
            or [of_states(tuple(given[a] for a in m.arguments), *expected[m.name])]
            for m in MODELS.values()
            if m.result and not m.of_loops
        }
        if self.robot.passive:
            place = [self.robot.moving.index(j) for j in self.robot.passive]
            motion = np.stack([x[:, place] for x in (self.x, self.xd, self.xdd)], axis=1)
            checks["passive_joints"] = [
                of_states((q, qd, qdd), motion, np.abs(motion).max()),
                of_states((q,), motion[:, 0], np.abs(motion).max()),
            ]
        if not close(self.robot).tied:  # more samples than a block of the NumPy module has
            rows = np.arange(BLOCKS) % N
            checks["gravity"].append(Check((q[rows], X), self.rest[rows], largest))
        return self._kept(checks)

    def _kept(self, checks: dict[str, list[Check]]) -> dict[str, list[Check]]:
        return {name: check for name, check in checks.items() if name not in self.left_out}

    def _jacobians(self) -> Iterator[Check]:
        """Of the last frame without its number, then of every frame by its number."""
        for j in (None, *(f.j for f in self.robot.frames)):
            J = self.model.jacobian(self.x, j) @ self.G
            keywords = {} if j is None else {"frame": j}
            yield Check((self.q,), J, max(np.abs(J).max(), 1.0), J[0], keywords)

    @cached_property
    def derivatives(self) -> dict[str, list[Check]]:
        """Derivatives of both dynamics by their arguments, side by side; those of sign(qd) are
        zero.
        """
        q, qd, qdd, n = self.q[:FEW], self.qd[:FEW], self.qdd[:FEW], self.q.shape[1]
        smooth = self.chi * [name not in dry(self.robot) for name in self.robot.parameters]
        by_q, by_qd = np.zeros((2, FEW, n, n))
        for k, e in enumerate(np.eye(n)):
            for m, c in SIX_POINTS.items():
                ahead, behind = (
                    self.torque(q + s * m * ANGLE_STEP * e, qd, qdd, smooth) for s in (1, -1)
                )
                by_q[:, :, k] += c * (ahead - behind) / ANGLE_STEP
            ahead, behind = (self.torque(q, qd + s * SPEED_STEP * e, qdd, smooth) for s in (1, -1))
            by_qd[:, :, k] = (ahead - behind) / (2 * SPEED_STEP)
        A, D = self.A[:FEW], self.own[:FEW]
        by_motion = np.concatenate([by_q, by_qd], axis=2)
        inverse = np.concatenate([by_motion, A, D], axis=2)
        forward = np.concatenate([-by_motion, np.broadcast_to(np.eye(n), A.shape), -D], axis=2)
        scale = np.abs(inverse).max()
        checks = {
            "inverse_dynamics_derivatives": [Check((q, qd, qdd, self.X), inverse, scale)],
            "forward_dynamics_derivatives": [
                Check(
                    (q, qd, self.tau[:FEW], self.X),
                    forward,
                    scale,
                    compared=lambda d: np.asarray(A @ d),
                )
            ],
        }
        return self._kept(checks)


def ungrouped(robot: Robot) -> Regrouping:
    """All standard parameters as they are."""
    return Regrouping(
        robot, tuple(BaseParameter(name, name, {name: ONE}) for name in robot.parameters), ()
    )


def dry(robot: Robot) -> set[str]:
    """Parameters of Coulomb friction."""
    return {parameter(e.family, j) for e in robot.elements for j in e.keys if e.kind == "coulomb"}


def bodies(robot: Robot, rng: np.random.Generator) -> Array:
    """Standard parameters (p,): every link made of four points of mass, all else between 0.1 and
    1.
    """
    chi = rng.uniform(0.1, 1.0, len(robot.parameters))
    for j in robot.links:
        m, P = rng.uniform(0.5, 2.0, 4), rng.uniform(-0.5, 0.5, (4, 3))
        J = np.einsum("p,pk,pk->", m, P, P) * np.eye(3) - np.einsum("p,pk,pl->kl", m, P, P)
        first = robot.parameters.index(parameter(INERTIAL[0], j))
        chi[first : first + len(INERTIAL)] = [*J[np.triu_indices(3)], *(m @ P), m.sum()]
    return chi


def base_values(regrouping: Regrouping, chi: Array, constants: Mapping[str, float]) -> Array:
    """X (b, ...) of standard parameters chi (p, ...) by the formulas."""
    value = dict(zip(regrouping.robot.parameters, chi, strict=True))
    return np.array(
        [
            sum(c.value(constants) * value[name] for name, c in b.combination.items())
            for b in regrouping.base
        ]
    )


def _at(robot: Robot, constants: Mapping[str, float]) -> Sample:
    from symgen.derive.lagrange import in_one_mode, sampled  # CasADi, loaded late

    return sampled(in_one_mode(robot), STATES, seed=7, constants=constants)


def _sampled(regrouping: Regrouping, fixed: Mapping[str, float]) -> tuple[Sample, str]:
    """States at drawn constants, and which these are."""
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
