"""Random states of a robot, with their regressor columns, computed exactly modulo a prime p.

Without loops, or if all joint relations are linear, states are drawn freely (`derive.exact`). In
general loops, the tied joints are algebraic functions of the actuated joints. The method serves loops
whose orientations agree by construction (sums of angles), so that the closure equations r = 0 are
equations of positions. Lengths and actuated joints are drawn at random, and each loop is closed by
two tied joints. r is linear in (cos v, sin v) of a hinge v, so that cos(v)**2 + sin(v)**2 = 1 gives
a quadratic equation for the other joint u. Its roots lie in F_p, the field of integers modulo p,
for every other draw. The solutions are points of

    V = {(lengths, configuration) : r = 0} ,

each as likely as any other. V is linear in the lengths, a bundle of linear spaces over the torus of
the angles, hence irreducible: an identity that holds at random points of V holds on all of V, for
every geometry and in every assembly mode. Rates and accelerations of the tied joints follow from
linear equations:

    J qd = 0 ,   J qdd + Jd qd = 0 .

If lengths are equal, the roots may always lie in F_p, and the closure splits into branches, such as
the parallelogram and the antiparallelogram. The branch of the robot file is found by a relation
that holds on one branch and not on the other:

    q_u = sum n_i q_i + k pi/2 .
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from symgen.derive.algebra import GraphAlgebra, Scalar
from symgen.derive.assembly import coincidence, loop_ends
from symgen.derive.constants import Variable, numbered
from symgen.derive.derivation import derive
from symgen.derive.exact import Array, Draw, Point, power, primes_for
from symgen.derive.graph import Symbol, interpret
from symgen.derive.loop_equations import loop_system
from symgen.derive.loops import close
from symgen.description.expression import Call, Number
from symgen.description.robot import PRISMATIC, REVOLUTE, Robot
from symgen.regroup.finite_field import solve_each

Length = str | Number | Call
SINGULAR = "a singular draw"
SPARE, ATTEMPTS = 20, 3  # draws more than close as a rule, and draws of all of them
ON_BRANCH = 1e-6  # rad


class ClosedDraw(Draw):
    """Random joint states modulo a prime p in which the loops close: `samples` states for each of
    `count` random geometries.

    `geometry` gives the values modulo p of the quantities that vary, shape (count, 1). By default
    these are all lengths; with `at_numbers`, lengths that are numbers in the robot file have their
    values.

    `wide` times as many states as usual are drawn, because not all of them close. ArithmeticError
    is raised if no two joints close each loop.
    """

    def __init__(
        self,
        robot: Robot,
        seed: int,
        samples: int,
        *,
        count: int = 1,
        p: int | None = None,
        geometry: Mapping[Variable, Array] | None = None,
        at_numbers: bool = False,
        wide: int = 1,
    ) -> None:
        self.system = loop_system(robot)
        self.tied = self.system.closure.tied
        if spatial := [loop for loop in robot.loops if loop.cut in self.tied]:
            raise ArithmeticError(
                f"the orientation of frame {spatial[0].cut} relative to frame {spatial[0].twin} is not a sum of joint angles, so the loop is spatial"
            )
        p = p if p is not None else primes_for(robot, 1)[0]
        rng = np.random.default_rng([seed, 1])
        if geometry is None:
            lengths = lengths_of(robot if at_numbers else numbered(robot))
            geometry = {v: rng.integers(1, p, count) for v in lengths}
        # half of the draws close a loop
        more = wide * (int(samples * 2.4 ** len(robot.loops)) + SPARE)
        drawn = {v: np.repeat(x, more) for v, x in geometry.items()}
        super().__init__(robot, seed, count * more, p=p, geometry=drawn)
        self.rng = rng
        hinges = [u for u in self.tied if robot.frame(u).sigma == REVOLUTE]
        self.parts |= dict.fromkeys(hinges, 1)  # of second degree in points of q_u alone
        self.shape = (count, samples)
        self._take(self._close().reshape(-1, more))
        geometry_of_all = self.system.derivation.geometry
        algebra = GraphAlgebra(geometry_of_all.robot)
        ends = loop_ends(geometry_of_all.robot, algebra, geometry_of_all.closure)
        if any(self.residues(x).any() for x in interpret(coincidence(ends), self)):
            raise ArithmeticError("the loops close in position, but not in orientation")
        self._move()

    def _array(self, x: Scalar) -> Array:
        return np.broadcast_to(self.residues(x), (self.samples,))

    def spread(self, value: Scalar) -> Array:
        return self._array(value).reshape(self.shape)

    def _close(self) -> Array:
        """Solve the closure equations loop by loop, each loop for two joints, modulo p.

        Return which samples could be closed, shape (samples,).
        """
        closed, left = np.ones(self.samples, dtype=bool), set(self.tied)
        pending = dict(enumerate(self.robot.loops))
        while pending:
            for k, loop in pending.items():
                around = {*self.robot.path(loop.cut)} ^ {*self.robot.path(loop.twin)}
                unknown = sorted(around & left, key=lambda j: self.robot.frame(j).sigma == REVOLUTE)
                rows = [e for e in self.system.equations if 6 * k <= e < 6 * k + 3]
                hinged = unknown and self.robot.frame(unknown[-1]).sigma == REVOLUTE
                if hinged and len(unknown) == len(rows) == 2:
                    closed &= self._dyad(rows, unknown[0], unknown[1], around)
                    break
            else:
                raise ArithmeticError(
                    "the loops cannot be solved one after the other, each for two joints"
                )
            del pending[k]
            left -= {*unknown}
        return closed

    def _dyad(self, rows: list[int], u: int, v: int, around: set[int]) -> Array:
        """Solve the two closure equations of a loop for joint u and revolute joint v, modulo p.

        Return which samples have a solution in F_p. The equations have the form

            r = sum_ik R_ik y_i z_k ,

        with y = (1, cos u, sin u) or (1, u), z = (1, cos v, sin v).
        """
        p = self.p
        slides = self.robot.frame(u).sigma == PRISMATIC
        q_u = Symbol("q", f"q{u}")
        # where half-angle tangents are zero: a fold has half a turn, whose tangent is none
        zero = self._point_at(self.rng.integers(1, p, 1))
        whole = np.ones(self.samples, dtype=np.int64)
        corners: list[Point] = [(0 * whole, 0 * whole), (whole, 0 * whole), (0 * whole, whole)]

        def equations(i: int, k: int) -> Array:
            self._points[v] = corners[k]
            if slides:
                self._residues[q_u] = i * whole
            else:
                self._points[u] = corners[i]
            r = interpret([self.system.rows[row] for row in rows], self)
            return np.stack([self._array(x) for x in r])

        R = np.array([[equations(i, k) for k in range(3)] for i in range(2 if slides else 3)])
        R[1:] -= R[:1]
        R[:, 1:] -= R[:, :1]

        def place(x: Array) -> Array:
            """Set the position of joint u: x is the tangent of half its angle, or its displacement
            if joint u is prismatic.

            Return y = (1, cos q_u, sin q_u), or (1, x, x**2) if u slides.
            """
            if slides:
                self._residues[q_u] = x
                return np.stack([whole, x, x * x % p])
            self._points[u] = self._turned(self._point_at(x), zero)
            return np.stack([whole, *self._points[u]])

        def tip(y: Array) -> tuple[Point, Array]:
            """Compute the cosine and sine of joint v that close the loop, and the determinant of
            the two linear equations for them.

            The point (cos, sin) need not lie on the unit circle.
            """
            r, *A = (R % p * y[: len(R), None, None] % p).sum(axis=0) % p
            c, s = self._solved(np.stack(A, axis=1), -r % p)
            return (c, s), (A[0][0] * A[1][1] - A[0][1] * A[1][0] % p) % p

        basis, excess = [], []
        for _ in range(4):
            basis.append(place(self.rng.integers(1, p, self.samples)))
            (c, s), scale = tip(basis[-1])
            excess.append((c * c + s * s - 1) % p * scale % p)
        none, one, two = coefficients = self._solved(np.stack(basis[:3]), np.stack(excess[:3]))
        if ((coefficients * basis[3] % p).sum(axis=0) % p != excess[3]).any():
            raise ArithmeticError(f"the closure equation of the loop is not quadratic in q{u}")
        if not slides:
            B, C = (one * zero[0] + two * zero[1]) % p, (two * zero[0] - one * zero[1]) % p
            none, one, two = (none + B) % p, 2 * C % p, (none - B) % p
        discriminant = (one * one - 4 * (two * none % p)) % p
        root = power(discriminant, (p + 1) // 4, p)
        square = root * root % p == discriminant
        if not two.all():
            raise ArithmeticError(SINGULAR)
        ends: list[tuple[Array, Point, Point | None]] = []
        for sign in (1, -1):
            x = (sign * root - one) % p * power(2 * two % p, p - 2, p) % p
            ends.append((x, tip(place(x))[0], self._points.get(u)))
        second = self.rng.integers(0, 2, self.samples).astype(bool)
        if square.all():
            label, a, b = (v, ends[0][1], ends[1][1]) if slides else (u, ends[0][2], ends[1][2])
            second = ~self._branch(label, a, b, around)  # type: ignore[arg-type]
        place(np.where(second, ends[1][0], ends[0][0]))
        self._points[v] = (
            np.where(second, ends[1][1][0], ends[0][1][0]),
            np.where(second, ends[1][1][1], ends[0][1][1]),
        )
        return np.asarray(square)

    def _branch(self, j: int, first: Point, second: Point, around: set[int]) -> Array:
        """Return, for each sample, whether the first of two solutions has the assembly mode of the
        robot file.

        `first` and `second` are the two solutions for hinge j. The test is needed if the closure
        splits into two branches; the result has shape (samples,).
        """
        hinges = [
            i for i in self.robot.joints if i in around and self.robot.frame(i).sigma == REVOLUTE
        ]
        start = self.system.closure.start
        p = self.p
        for turns in product((0, 1, -1), repeat=len(hinges)):
            turned: Point = (
                np.ones(self.samples, dtype=np.int64),
                np.zeros(self.samples, dtype=np.int64),
            )
            for i, n in zip(hinges, turns, strict=True):
                turned = self._turned(turned, self._multiple(self._joint(i), n))
            for k in range(4):
                on = [
                    ((a[0] - turned[0]) % p == 0) & ((a[1] - turned[1]) % p == 0)
                    for a in (first, second)
                ]
                if (on[0] ^ on[1]).all():
                    angle = (
                        start[j]
                        - sum(n * start[i] for i, n in zip(hinges, turns, strict=True))
                        - k * np.pi / 2
                    )
                    return np.asarray(
                        on[0] if abs((angle + np.pi) % (2 * np.pi) - np.pi) < ON_BRANCH else ~on[0]
                    )
                turned = (-turned[1] % p, turned[0])
        raise ArithmeticError(
            "the closure equations have several solution branches, which no relation of joint angles separates"
        )

    def _take(self, closed: Array) -> None:
        """Keep samples in which all loops close, the same number for each geometry.

        A geometry is one random choice of the lengths of the robot. `closed`, shape (geometries,
        samples), says in which samples the loops close.
        """
        count = self.shape[1]
        whole = self.samples
        if (closed.sum(axis=1) < count).any():
            raise ArithmeticError(SINGULAR)
        places = np.flatnonzero(closed & (closed.cumsum(axis=1) <= count))
        residues: Any = (self._geometry, self._residues)
        for table in residues:
            table |= {key: x[places] for key, x in table.items() if len(x) == whole}
        self._points |= {
            key: (c[places], s[places]) for key, (c, s) in self._points.items() if len(c) == whole
        }
        self.samples = len(places)

    def _move(self) -> None:
        """Compute velocities and accelerations of the dependent joints from the motion of the
        actuated joints, modulo p.
        """
        joints = self.robot.joints
        n = len(joints)
        named = self.system.derivation.algebra.named
        rows = [interpret(row, self) for row in self.system.jacobian]
        J = np.stack([np.stack([self._array(x) for x in row]) for row in rows])
        J_u = J[:, n:]
        G = np.stack([self._solved(J_u, -J[:, k] % self.p) for k in range(n)], axis=1)
        qd = np.stack([self._state(Symbol("qd", f"QP{i}")) for i in joints])
        qdd = np.stack([self._state(Symbol("qdd", f"QDP{i}")) for i in joints])
        for a, u in enumerate(self.tied):  # G (tied, n, samples)
            for k, i in enumerate(joints):
                self._residues[Symbol("rate", named("G", u, i))] = G[a, k]
            self._residues[Symbol("qd", f"QP{u}")] = (G[a] * qd % self.p).sum(axis=0) % self.p
        B = np.stack([self._array(x) for x in interpret(self.system.curvature, self)])
        for a, (u, bend) in enumerate(zip(self.tied, self._solved(J_u, -B % self.p), strict=True)):
            along = (G[a] * qdd % self.p).sum(axis=0)
            self._residues[Symbol("qdd", f"QDP{u}")] = (along + bend) % self.p

    def _solved(self, A: Array, b: Array) -> Array:
        """Solve A x = b modulo p, sample by sample; A has shape (m, m, samples).

        A singular sample raises ArithmeticError.
        """
        M = np.moveaxis(np.concatenate([A, b[:, None]], axis=1) % self.p, -1, 0)
        x = solve_each(M, self.p, self.rng)
        if x is None:
            raise ArithmeticError(SINGULAR)
        return x.T


def closed_draw(robot: Robot, seed: int, samples: int, **given: Any) -> ClosedDraw:
    """Draw random states modulo p that close the loops; repeat the draw if it fails by chance.

    A draw fails if it is singular, or if too few states close at one of the geometries. Each
    repetition draws more samples.
    """
    for k in range(ATTEMPTS):
        try:
            return ClosedDraw(robot, seed + 1000 * k, samples, wide=1 + k, **given)
        except ArithmeticError as error:
            if str(error) != SINGULAR:
                raise
    raise ArithmeticError(SINGULAR)


def lengths_of(robot: Robot) -> tuple[Length, ...]:
    """Collect the constants, numbers and square roots in the lengths b, d and r of the frames."""
    atoms: dict[Length, None] = {}
    for f in robot.frames:
        for e in (f.b, f.d, f.r0):
            for a in sorted(e.atoms, key=str):
                if a != "pi":
                    atoms[a] = None
    return tuple(atoms)


def draw_states(
    robot: Robot,
    seed: int,
    samples: int,
    *,
    p: int | None = None,
    geometry: Mapping[Variable, Array] | None = None,
    count: int = 0,
) -> Draw:
    """Draw `samples` random states modulo p, for one robot geometry or each of `count` geometries.

    If closure equations tie joints, the states satisfy these equations. ArithmeticError is raised
    for loops that cannot be closed exactly modulo p, such as spatial loops.
    """
    if close(robot).tied:
        return closed_draw(robot, seed, samples, p=p, count=max(count, 1), geometry=geometry)
    return Draw(robot, seed, samples, p=p, geometry=geometry, count=count)


def sample(draw: Draw, names: tuple[str, ...]) -> Array:
    """Compute the regressor columns `names` at the random states of `draw`, modulo p.

    The result has shape (..., rows * samples, len(names)), int64 residues; the axis ... counts
    the geometries if the draw has several.
    """
    robot = draw.robot
    D = derive(robot).columns
    entries = {
        (k, row): D[name][j]
        for k, name in enumerate(names)
        for row, j in enumerate(robot.rows)
        if j in D[name]
    }
    W = np.zeros((len(names), len(robot.rows), *draw.shape), dtype=np.int64)
    for place, value in zip(entries, interpret([*entries.values()], draw), strict=True):
        W[place] = draw.spread(value)
    W = np.moveaxis(W, -1, 2)  # names, joints, samples, geometries
    return np.moveaxis(W.reshape(len(names), -1, *draw.shape[:-1]), (0, 1), (-1, -2))


def states_for(robot: Robot, names: Sequence[str], spare: int = 4) -> int:
    """Return how many random states are enough to show the rank of the regressor columns `names`.

    The columns that act only on the joints of a set S need |columns| <= states |S|. The condition
    is required for the set of every column, and for all joints. At least `spare` states are added.
    """
    acting = _acting(robot)
    acts = np.stack([acting[name] for name in names])
    sets = {tuple(row) for row in acts.tolist() if any(row)} | {(True,) * len(robot.rows)}
    needed = max(np.count_nonzero((acts <= S).all(axis=1)) / sum(S) for S in sets)
    return int(np.ceil(needed + (6 + spare) / len(robot.rows))) + spare


@lru_cache(maxsize=8)
def _acting(robot: Robot) -> dict[str, Array]:
    """Find, with random states, the joints whose torques depend on each standard parameter."""
    W = sample(Draw(robot, 5, 2), robot.parameters).reshape(len(robot.rows), 2, -1)
    return dict(zip(robot.parameters, (W != 0).any(axis=1).T, strict=True))
