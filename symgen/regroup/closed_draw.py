"""Points of a closed mechanism over F_p.

The tied joints are algebraic functions of the actuated ones, so states cannot be drawn at one geometry over F_p. But where the orientations of
every loop agree by construction (sums of angles), the closure equations r = 0 are positions: linear in the lengths and in the strokes of slides.
Angles are therefore drawn at random, all of them, and as many lengths or strokes as there are equations are solved for. Each sample is a robot of its own
in a state of its own, a random point of

    V = {(lengths, configuration) : r = 0} ,

a bundle of linear spaces over the torus of the angles, hence irreducible: an identity that holds at random points of V holds on all of V, for
every geometry and in every assembly mode. Rates and accelerations of the tied joints follow from J qd = 0, J qdd + Jd qd = 0, by linear equations.

Where fewer lengths than equations are free (a kite has two), or one geometry is asked for, lengths and actuated joints are drawn and each loop is closed by two tied joints:
r is linear in (cos v, sin v) of a hinge v, which gives cos(v)**2 + sin(v)**2 = 1, a quadratic in the other joint u; its roots lie in F_p for
every other draw. Where they always do, the closure splits into branches; the file's is told by a relation q_u = sum n_i q_i + k pi/2
that one branch has and the other has not (the parallelogram, and the antiparallelogram beside it).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from symgen.derive.angles import Variable
from symgen.derive.columns import columns
from symgen.derive.exact import Array, Draw, Fp, Point, power, primes_for
from symgen.derive.geometry import Geometry
from symgen.derive.loop_equations import loop_system, residuals
from symgen.derive.newton_euler import Motion
from symgen.description.expression import Call, Number
from symgen.description.robot import PRISMATIC, REVOLUTE, Robot
from symgen.regroup.finite_field import rref

Length = str | Number | Call
SINGULAR = "a singular draw"
ON_BRANCH = 1e-6  # rad


class ClosedDraw(Draw):
    """Random points of V: every sample has its own configuration, closed, and its own lengths unless `one_geometry`.

    Lengths are solved for, or with `by_joints` two tied joints of each loop. Raises ArithmeticError where neither can be.
    """

    def __init__(
        self, robot: Robot, seed: int, samples: int, *, p: int | None = None, by_joints: bool = False, one_geometry: bool = False
    ) -> None:
        p = p if p is not None else primes_for(robot, 1)[0]
        rng = np.random.default_rng([seed, 1])
        more = int(samples * 2.4 ** len(robot.loops)) + 40 if by_joints else samples  # every loop closes in half of its draws
        self.lengths = lengths_of(robot)
        self.drawn: dict[Variable, Array] = {v: np.resize(rng.integers(1, p, 1 if one_geometry else more), more) for v in self.lengths}
        super().__init__(robot, seed, more, p=p, geometry=self.drawn)
        self.system = loop_system(robot)
        self.tied = self.system.closure.tied
        if spatial := [loop for loop in robot.loops if loop.cut in self.tied]:
            raise ArithmeticError(
                f"the orientation of frame {spatial[0].cut} on {spatial[0].twin} is no sum of angles, the loop is spatial"
            )
        if by_joints:
            self._take(np.flatnonzero(self._close_by_joints()), samples)
        else:
            self._close()
        if np.stack([self._array(x) for x in residuals(self.robot, self, self.system.closure)]).any():
            raise ArithmeticError("the loops do not close by their positions alone")
        self._move()

    def _residual(self) -> Array:
        """(equations, samples)."""
        return np.stack([self._array(x) for x in self.system.residual(self)])

    def _array(self, x: Any) -> Array:
        return np.broadcast_to(x.x if isinstance(x, Fp) else np.array([x % self.p]), (self.samples,))

    def _close(self) -> None:
        """Solve r = r0 + M u = 0 for lengths or strokes u, as many as equations; strokes of tied slides first, then the last lengths."""
        strokes = [j for j in self.tied if self.robot.frame(j).sigma == PRISMATIC]
        candidates: list[int | Length] = [*strokes, *reversed(self.lengths)]
        for u in candidates:
            self._put(u, np.zeros(self.samples, dtype=np.int64))
        r0, columns_of = self._residual(), []
        for u in candidates:
            self._put(u, np.ones(self.samples, dtype=np.int64))
            columns_of.append((self._residual() - r0) % self.p)
            self._put(u, np.zeros(self.samples, dtype=np.int64))
        m = len(r0)
        M = np.stack(columns_of, axis=1)  # (m, candidates, samples)
        pivots = rref(M[:, :, 0].copy(), self.p)[0]
        if len(pivots) < m:
            raise ArithmeticError("fewer lengths than closure equations")
        rest = r0
        for k, u in enumerate(candidates):
            if k not in pivots:
                value = self._random(self.samples)
                self._put(u, value)
                rest = (rest + M[:, k] * value) % self.p
        for k, value in zip(pivots, self._solved(M[:, pivots], -rest % self.p), strict=True):
            self._put(candidates[k], value)

    def _close_by_joints(self) -> Array:
        """Solve loop after loop for two tied joints; which samples could be closed, (samples,)."""
        good, pending, left = np.ones(self.samples, dtype=bool), list(enumerate(self.robot.loops)), set(self.tied)
        while pending:
            for k, loop in pending:
                around = {*self.robot.path(loop.cut)} ^ {*self.robot.path(loop.twin)}
                unknown = sorted((j for j in around & left), key=lambda j: self.robot.frame(j).sigma == REVOLUTE)
                rows = [e for e in self.system.equations if 6 * k <= e < 6 * k + 3]
                if len(unknown) == len(rows) == 2 and self.robot.frame(unknown[1]).sigma == REVOLUTE:
                    good &= self._dyad(rows, unknown[0], unknown[1], around)
                    break
            else:
                raise ArithmeticError("the loops are not closed one after the other by two joints each")
            pending.remove((k, loop))
            left -= {*unknown}
        return good

    def _dyad(self, rows: list[int], u: int, v: int, around: set[int]) -> Array:
        """Solve the two equations `rows` for joint u and hinge v; which samples have a root in F_p."""
        p, zero = self.p, self._circle(1)  # where half-angle tangents are zero: a fold has half a turn, whose tangent is none

        def equations(z: Point) -> Array:
            self._point[v] = z
            found = residuals(self.robot, self, self.system.closure)
            return np.stack([self._array(found[k]) for k in rows])

        def place(x: Array) -> tuple[Array, ...]:
            """Joint u at the half-angle tangent or stroke x; 1, cos, sin or 1, x, x**2 there."""
            if self.robot.frame(u).sigma == PRISMATIC:
                self._q[u] = x
                return np.ones_like(x), x, x * x % p
            self._point[u] = self._turned(self._point_at(x), zero)
            return np.ones_like(x), *self._point[u]

        def tip() -> tuple[Point, Array]:
            """(cos v, sin v) that closes the loop, on the circle or not, and the determinant of its equations."""
            one, none = np.ones(self.samples, dtype=np.int64), np.zeros(self.samples, dtype=np.int64)
            r = equations((none, none))
            A = np.stack([equations((one, none)) - r, equations((none, one)) - r], axis=1) % p
            c, s = self._solved(A, -r % p)
            return (c, s), (A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0] % p) % p

        basis, excess = [], []
        for _ in range(4):
            basis.append(np.stack(place(self._random(self.samples))))
            (c, s), scale = tip()
            excess.append((c * c + s * s - 1) % p * scale % p)
        A, B, C = coefficients = self._solved(np.stack(basis[:3]), np.stack(excess[:3]))
        if ((coefficients * basis[3] % p).sum(axis=0) % p != excess[3]).any():
            raise ArithmeticError(f"the loop is not of second degree in q{u}")
        two, one, none = C, B, A
        if self.robot.frame(u).sigma == REVOLUTE:
            B, C = (B * zero[0] + C * zero[1]) % p, (C * zero[0] - B * zero[1]) % p
            two, one, none = (A - B) % p, 2 * C % p, (A + B) % p
        discriminant = (one * one - 4 * (two * none % p)) % p
        root = power(discriminant, (p + 1) // 4, p)
        square = root * root % p == discriminant
        if not two.all():
            raise ArithmeticError(SINGULAR)
        solutions: list[Array] = []
        ends: list[tuple[Array, ...]] = []
        for sign in (1, -1):
            solutions.append((sign * root - one) % p * power(2 * two % p, p - 2, p) % p)
            place(solutions[-1])
            ends.append((*tip()[0], *self._point.get(u, ())))
        second = self.rng.integers(0, 2, self.samples).astype(bool)
        if square.all():
            label = v if self.robot.frame(u).sigma == PRISMATIC else u
            a, b = (end[:2] if label == v else end[2:] for end in ends)
            second = ~self._branch(label, (a[0], a[1]), (b[0], b[1]), around)
        place(np.where(second, solutions[1], solutions[0]))
        self._point[v] = (np.where(second, ends[1][0], ends[0][0]), np.where(second, ends[1][1], ends[0][1]))
        return np.asarray(square)

    def _branch(self, j: int, first: Point, second: Point, around: set[int]) -> Array:
        """Of two branches of a closure that splits, whether hinge j is on that of the file at `first`, (samples,)."""
        hinges = [i for i in self.robot.joints if i in around and self.robot.frame(i).sigma == REVOLUTE]
        start, p = self.system.closure.start, self.p
        for turns in product((0, 1, -1), repeat=len(hinges)):
            turned: Point = (np.ones(self.samples, dtype=np.int64), np.zeros(self.samples, dtype=np.int64))
            for i, n in zip(hinges, turns, strict=True):
                turned = self._turned(turned, self._multiple(self._point[i], n))
            for k in range(4):
                on = [((a[0] - turned[0]) % p == 0) & ((a[1] - turned[1]) % p == 0) for a in (first, second)]
                if (on[0] ^ on[1]).all():
                    angle = start[j] - sum(n * start[i] for i, n in zip(hinges, turns, strict=True)) - k * np.pi / 2
                    return np.asarray(on[0] if abs((angle + np.pi) % (2 * np.pi) - np.pi) < ON_BRANCH else ~on[0])
                turned = (-turned[1] % p, turned[0])
        raise ArithmeticError("the closure has several branches that no relation of angles tells apart")

    def _take(self, places: Array, count: int) -> None:
        """Keep the first `count` samples of `places`."""
        if len(places) < count:
            raise ArithmeticError(SINGULAR)
        whole, kept = self.samples, places[:count]
        tables: tuple[dict[Any, Any], ...] = (self.drawn, self._constants, self._q, self._qd, self._qdd)
        for table in tables:
            table |= {key: x[kept] for key, x in table.items() if len(x) == whole}
        self._point = {j: (c[kept], s[kept]) for j, (c, s) in self._point.items()}
        self.samples = count

    def _put(self, u: int | Length, value: Array) -> None:
        if isinstance(u, int):
            self._q[u] = value
        else:
            self.drawn[u] = value
            if isinstance(u, str):
                self._constants[u] = value

    def _move(self) -> None:
        """Rates and accelerations of the tied joints."""
        joints, n = self.robot.joints, len(self.robot.joints)
        J = np.stack([np.stack([self._array(x) for x in row]) for row in self.system.jacobian(self)])
        J_u = J[:, n:]
        rates = np.stack([self._solved(J_u, -J[:, k] % self.p) for k in range(n)], axis=1)  # (tied, n, samples)
        for a, u in enumerate(self.tied):
            for k, i in enumerate(joints):
                self._rate[u, i] = rates[a, k]
            self._qd[u] = sum((rates[a, k] * self._qd[i] for k, i in enumerate(joints)), start=np.int64(0)) % self.p  # type: ignore[assignment]
        B = np.stack([self._array(x) for x in self.system.curvature(self)])
        bend = self._solved(J_u, -B % self.p)
        for a, u in enumerate(self.tied):
            total = bend[a]
            for k, i in enumerate(joints):
                total = (total + rates[a, k] * self._qdd[i]) % self.p
            self._qdd[u] = total

    def _solved(self, A: Array, b: Array) -> Array:
        """x with A x = b sample by sample, A of shape (m, m, samples), by Gauss elimination; singular samples give ArithmeticError."""
        p, m = self.p, len(b)
        M = np.concatenate([A, b[:, None]], axis=1) % p
        for c in range(m):
            below = (M[c:, c] != 0).argmax(axis=0) + c
            samples = np.arange(M.shape[2])
            swap = M[below, :, samples].copy()
            M[below, :, samples] = M[c, :, samples]
            M[c, :, samples] = swap
            if not M[c, c].all():
                raise ArithmeticError(SINGULAR)
            M[c] = M[c] * power(M[c, c], p - 2, p) % p
            for r in range(m):
                if r != c:
                    M[r] = (M[r] - M[r, c] * M[c]) % p
        return M[:, m]

    def regressor(self, names: Sequence[str]) -> Array:
        """Columns `names`, shape (joints, samples, len(names))."""
        D = columns(Motion(Geometry(self.robot, self, self.system.closure)), names)
        return np.stack([np.stack([self._array(D[name].get(j, 0)) for name in names], axis=-1) for j in self.robot.joints])


def closed_draw(robot: Robot, seed: int, samples: int, *, p: int | None = None, one_geometry: bool = False) -> ClosedDraw:
    """A ClosedDraw: lengths solved for where they can be and may differ, else joints; a draw that happens to be singular is made again."""
    reason = ""
    for by_joints in (True,) if one_geometry else (False, True):
        for k in range(3):
            try:
                return ClosedDraw(robot, seed + 1000 * k, samples, p=p, by_joints=by_joints, one_geometry=one_geometry)
            except ArithmeticError as error:
                reason = str(error)
                if reason != SINGULAR:
                    break
    raise ArithmeticError(reason)


def lengths_of(robot: Robot) -> tuple[Length, ...]:
    """Constants, numbers and roots in b, d and r of the frames, in their order."""
    found: dict[Length, None] = {}
    for f in robot.frames:
        for e in (f.b, f.d, f.r0):
            for a in sorted(e.atoms, key=str):
                if a != "pi":
                    found[a] = None
    return tuple(found)
