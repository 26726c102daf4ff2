"""Relations of the passive joints: declared ones checked, linear ones derived, and the mobility of the mechanism.

Loop: frame `cut` (one branch) and frame `twin` (sigma 2, other branch) coincide, 0T_cut = 0T_twin. At a numerical solution the passive
rates are G = -J_u^+ J_a; where G keeps the same whole numbers along a motion, the relation q_u = G q_a + c is linear. It is then
*proved*: the two frames must coincide identically over F_p, with random lengths, so equal lengths must be equal symbols.
The second branch of a parallelogram (anti-parallelogram) is not linear and never taken for one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from itertools import product

import numpy as np

from symgen.derive.angles import fixed_angles
from symgen.derive.closure import Closure, open_tree
from symgen.derive.exact import Draw, Fp
from symgen.derive.float_algebra import FloatAlgebra
from symgen.derive.geometry import Geometry
from symgen.derive.kinematics import frame_poses
from symgen.derive.numeric_closure import LoopEquations, Relations, declared_relations
from symgen.description.expression import ONE, PI, ZERO, Expression
from symgen.description.robot import REVOLUTE, Loop, Robot
from symgen.errors import DescriptionError

STARTS = 60
CLOSED = 1e-6  # residual below which two frames coincide


def find_relations(robot: Robot) -> Closure:
    """The closure of a robot with passive joints: declared relations checked, linear ones of the other passive joints derived."""
    relations = declared_relations(robot)
    equations = LoopEquations(robot, relations)
    in_loops = {j for loop in robot.loops for k in (loop.cut, loop.twin) for j in robot.path(k)}
    for j in equations.unknown:
        if j not in in_loops:
            raise DescriptionError(
                f"passive joint {j} has no relation: it is in no loop; declare q{j} under constraints or set mu: 1",
                path=("frames", j, "mu"),
                file=robot.file or None,
            )
    rng = np.random.default_rng(3)
    general: dict[int, float] | None = None
    wanted = {j: x for loop in robot.loops for j, x in loop.start.items()}
    for attempt in range(STARTS):
        spread = 0.0 if attempt == 0 else np.pi
        q0 = {j: wanted.get(j, 0.3 + 0.1 * j if attempt == 0 else float(rng.uniform(-spread, spread))) for j in equations.free}
        q = equations.solve(q0) if robot.loops else q0
        if q is None:
            continue
        _check_mobility(robot, equations, q)
        general = q if general is None else general
        linear = _linear(robot, equations, relations, q)
        if linear is not None:
            return linear
        if wanted and attempt == 0:
            break
    if general is None:
        general = equations.solve(equations.closest()[2])  # the actuators moved too: short jacks fit no pose drawn at random
        if general is None or equations.mobility(general) != (len(robot.joints), 0):
            raise _cannot_close(robot, equations)
        linear = _linear(robot, equations, relations, general)
        if linear is not None:
            return linear
    return _general(robot, equations, relations, general)


def _general(robot: Robot, equations: LoopEquations, relations: Relations, q: Mapping[int, float]) -> Closure:
    """The solution q as a general closure: declared relations, the sums of angles that planar loops fix, the rest tied."""
    row: dict[int, Mapping[int, Expression]] = {j: r for j, (r, _) in relations.items()}
    offset = {j: c for j, (_, c) in relations.items()}
    configuration = equations.configuration(q)
    for loop in robot.loops:
        relation = _angle_sum(robot, loop, configuration)
        if relation is not None and loop.cut in equations.unknown and set(relation[0]) <= set(equations.free):
            row[loop.cut], offset[loop.cut] = relation
    tied = tuple(j for j in equations.unknown if j not in row)
    return _closure(robot, row, offset, tied, configuration)


def _angle_sum(robot: Robot, loop: Loop, configuration: Mapping[int, float]) -> tuple[dict[int, Expression], Expression] | None:
    """q_cut in the other angles of a planar loop: all its hinges turn about one direction, forwards or backwards, slides and twists between them or not.

    The directions are looked at in two configurations of the open tree; `regroup.general` proves the sum over F_p.
    """
    if robot.frame(loop.cut).sigma != REVOLUTE:
        return None
    branches = [(sign, robot.path(k)) for sign, k in ((1, loop.twin), (-1, loop.cut))]
    hinges = [
        (sign, j)
        for k, (sign, path) in enumerate(branches)
        for j in path
        if robot.frame(j).sigma == REVOLUTE and j not in branches[1 - k][1]
    ]
    total: dict[int, int] = {}
    for shift in (0.0, 0.3):
        q = {j: np.asarray(x + shift * k) for k, (j, x) in enumerate(configuration.items())}
        pose = frame_poses(Geometry(robot, FloatAlgebra(robot, q), open_tree(robot)))
        axis = {j: np.array([float(pose[j][0][k][2]) for k in range(3)]) for _, j in hinges}
        along = {j: float(z @ axis[loop.cut]) for j, z in axis.items()}
        if any(abs(abs(x) - 1) > 1e-9 for x in along.values()):
            return None
        total = {}
        for sign, j in hinges:
            total[j] = total.get(j, 0) + sign * round(along[j])
    del total[loop.cut]
    row = {j: Expression.number(n) for j, n in total.items() if n}
    offset = _constant(robot, configuration[loop.cut] - sum(n * configuration[j] for j, n in total.items()))
    if offset is None:
        return None
    now = offset.value(robot.constants) + sum(n * configuration[j] for j, n in total.items())
    return row, offset + PI * (2 * round((configuration[loop.cut] - now) / (2 * np.pi)))


def _check_mobility(robot: Robot, equations: LoopEquations, q: Mapping[int, float]) -> None:
    freedoms, left = equations.mobility(q)
    if freedoms != len(robot.joints) or left:
        raise _wrong_mobility(robot, freedoms, left)


def _wrong_mobility(robot: Robot, freedoms: int, left: int) -> DescriptionError:
    expected = len(robot.joints)
    what = (
        "over-constrained or has too many actuators; joints without a motor have mu: 0"
        if freedoms < expected
        else "under-constrained or lacks actuators (mu: 1) or relations"
    )
    return DescriptionError(
        f"mobility is {freedoms}, but {expected} joints are actuated ({list(robot.joints)})"
        f"{f'; with them held, {left} freedoms are left' if left else ''}; the mechanism is {what}",
        path=("loops",),
        file=robot.file or None,
    )


def _linear(robot: Robot, equations: LoopEquations, relations: Relations, q: Mapping[int, float]) -> Closure | None:
    """The solution q as a linear closure, if it is one: whole constant rates, a recognised constant, proof over F_p."""
    G = equations.rates(q)
    N = np.round(G)
    if G.size and np.abs(G - N).max() > 1e-5:
        return None
    moved = equations.solve({j: x + (0.37 + 0.1 * k if j in equations.active else 0.0) for k, (j, x) in enumerate(q.items())})
    if moved is None or (G.size and np.abs(equations.rates(moved) - N).max() > 1e-5):
        return None
    row: dict[int, dict[int, Expression]] = {}
    offset: dict[int, Expression] = {}
    for k, j in enumerate(equations.unknown):
        row[j] = {i: Expression.number(int(n)) for i, n in zip(equations.active, N[k], strict=True) if n}
        c = q[j] - sum(float(n) * q[i] for i, n in zip(equations.active, N[k], strict=True))
        recognised = _constant(robot, c) if robot.frame(j).sigma == REVOLUTE else _length(robot, c)
        if recognised is None:
            return None
        offset[j] = recognised
    for j, (r, c_j) in relations.items():
        row[j], offset[j] = {}, c_j
        for i, g in r.items():
            for m, n in row[i].items() if i in equations.unknown else ((i, ONE),):
                row[j][m] = row[j].get(m, ZERO) + g * n
            if i in equations.unknown:
                offset[j] = offset[j] + g * offset[i]
    linear = _closure(robot, row, offset, (), equations.configuration(q))
    return linear if _coincide(linear) else None


def _constant(robot: Robot, c: float) -> Expression | None:
    """An angle as a multiple of pi/2 plus fixed angles of the robot."""
    angles = fixed_angles(robot)[:4]
    values = [e.value(robot.constants) for e in angles]
    for signs in sorted(product((0, 1, -1), repeat=len(angles)), key=lambda s: sum(map(abs, s))):
        rest = c - sum(s * v for s, v in zip(signs, values, strict=True))
        quarters = round(rest / (np.pi / 2))
        if abs(rest - quarters * np.pi / 2) < 1e-7:
            quarters = (quarters + 1) % 4 - 1  # -pi/2, 0, pi/2, pi
            total = PI * Fraction(quarters, 2)
            for s, e in zip(signs, angles, strict=True):
                total = total + e * s
            return total
    return None


def _length(robot: Robot, c: float) -> Expression | None:
    """A length as a sum or difference of at most two lengths of the robot."""
    lengths = [ZERO, *dict.fromkeys(e for f in robot.frames for e in (f.b, f.d, f.r0) if e)]
    for e, f in product(lengths, repeat=2):
        for s, t in product((1, -1), repeat=2):
            if abs((e * s + f * t).value(robot.constants) - c) < 1e-9:
                return e * s + f * t
    return None


def _closure(
    robot: Robot,
    row: Mapping[int, Mapping[int, Expression]],
    offset: Mapping[int, Expression],
    tied: tuple[int, ...],
    start: Mapping[int, float],
) -> Closure:
    """The relations of the joints that have one, and every other joint in itself."""
    free = (*robot.joints, *tied)
    return Closure(robot, {j: {j: ONE} for j in free} | dict(row), dict.fromkeys(free, ZERO) | dict(offset), tied, start)


def _coincide(closure: Closure) -> bool:
    """Whether cut and twin frames are equal over F_p for random lengths and positions: the proof of the relations."""
    draw = Draw(closure.robot, 17, 3)
    pose = frame_poses(Geometry(closure.robot, draw, closure))

    def equal(a: object, b: object) -> bool:
        x, y = (v.x if isinstance(v, Fp) else np.array([int(v) % draw.p]) for v in (a, b))  # type: ignore[call-overload]
        return bool(((x - y) % draw.p == 0).all())

    for loop in closure.robot.loops:
        (A, P), (B, Q) = pose[loop.cut], pose[loop.twin]
        entries = [*zip(P, Q, strict=True), *((A[k][m], B[k][m]) for k in range(3) for m in range(3))]
        if not all(equal(a, b) for a, b in entries):
            return False
    return True


def _cannot_close(robot: Robot, equations: LoopEquations) -> DescriptionError:
    """Why no configuration closes: the declared relations, the actuators, or the frames themselves."""
    in_loops = {j for loop in robot.loops for k in (loop.cut, loop.twin) for j in robot.path(k)}
    declared = {j: e for j, e in robot.constraints.items() if j in in_loops}
    also = ""
    if declared:
        try:
            closure = find_relations(replace(robot, constraints={j: e for j, e in robot.constraints.items() if j not in declared}))
        except DescriptionError:
            also = ", with or without the declared relations"
        else:
            return _contradiction(robot, equations, declared, closure)
    loop, gap, q = equations.closest()
    if gap < CLOSED:
        return _wrong_mobility(robot, *equations.mobility(q))
    return DescriptionError(
        f"frame {loop.cut} (cut) and frame {loop.twin} (twin) cannot coincide{also}; they come as close as {gap:.3g} (positions per longest link); "
        "check the lengths, alpha, theta and the row of the twin",
        path=("loops", robot.loops.index(loop)),
        file=robot.file or None,
    )


def _contradiction(robot: Robot, equations: LoopEquations, declared: Mapping[int, Expression], closure: Closure) -> DescriptionError:
    """Both sides of every declared relation that is not the closure's, and how far the loop is open with the declared ones."""
    relations = declared_relations(robot)
    sides = []
    for j, e in declared.items():
        if j in closure.tied:
            sides.append(f"q{j}: declared {e}, the closure gives no linear relation (these lengths make no parallelogram)")
        elif not _same(robot, relations[j], closure, j):
            sides.append(f"q{j}: declared {e}, the closure gives {_text(closure, j)}")
    q = {j: closure.start[j] for j in equations.free}
    loop = max(robot.loops, key=lambda loop: equations.gap(q, loop))
    return DescriptionError(
        f"declared relations contradict the closure; {'; '.join(sides)}; with the declared ones frame {loop.cut} (cut) and frame {loop.twin} (twin) "
        f"are {equations.gap(q, loop):.3g} apart (positions per longest link)",
        path=("constraints", f"q{min(declared)}"),
    )


def _same(robot: Robot, relation: tuple[Mapping[int, Expression], Expression], closure: Closure, j: int) -> bool:
    """Whether a declared relation is that of the closure, in the actuated joints, up to whole turns."""
    row: dict[int, Expression] = {}
    offset = relation[1]
    for i, g in relation[0].items():
        for k, n in closure.row[i].items():
            row[k] = row.get(k, ZERO) + g * n
        offset = offset + g * closure.offset[i]
    turn = (offset - closure.offset[j]).value(robot.constants) / (2 * np.pi) if robot.frame(j).sigma == REVOLUTE else 0.0
    return {k: n for k, n in row.items() if n} == dict(closure.row[j]) and abs(turn - round(turn)) < 1e-9


def _text(closure: Closure, j: int) -> str:
    """q_j as a relation, in the grammar of the robot file."""
    total = closure.offset[j]
    for i, g in closure.row[j].items():
        total = total + g * Expression.symbol(f"q{i}")
    return str(total)


@lru_cache(maxsize=64)
def close(robot: Robot) -> Closure:
    """The closure of `robot`: declared relations checked, linear ones derived. Raises DescriptionError where the loops cannot close."""
    if not robot.passive:
        return open_tree(robot)
    return find_relations(robot)
