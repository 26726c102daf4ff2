"""Relations between passive and independent joints of closed loops: declared, or linear and proved.

A loop closes if its frame `cut` (on one branch) and its frame `twin` (sigma 2, on the other branch)
coincide, 0T_cut = 0T_twin. At a closed configuration the passive rates are G = -J_u^+ J_a. If G has
the same whole numbers along a motion, the relation q_u = G q_a + c is linear, and its constant c is
searched among the fixed angles or lengths of the loops (`_offset`). The relation is then *proved*:
the two frames must coincide identically over F_p, with random lengths, so equal lengths must be
equal symbols. The second branch of a parallelogram (anti-parallelogram) is not linear, and is never
accepted as linear. Declared relations and the mobility of the mechanism are checked too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from itertools import product

import numpy as np

from symgen.derive.algebra import GraphAlgebra
from symgen.derive.assembly import (
    STEPS,
    TOLERANCE,
    Array,
    Assembly,
    coincidence,
    declared_relations,
    loop_ends,
    newton,
)
from symgen.derive.closure import Closure, Relation, open_tree
from symgen.derive.exact import Draw
from symgen.derive.geometry import Geometry, frame_poses
from symgen.derive.graph import Floats, interpret, states_of
from symgen.description.expression import ONE, PI, ZERO, Expression, quarter_turns
from symgen.description.robot import PRISMATIC, REVOLUTE, Loop, Robot
from symgen.errors import DescriptionError

STARTS, NEAR_STARTS = 60, 16  # places looked from, without and with a `start`
BESIDE = 1.0  # rad or m: passive joints looked from beside a `start`
DRAWN = 0.01  # rad or m: a `start` is drawn to half a degree
CLOSED = 1e-6  # residual below which two frames coincide
VARIED = 1e-3  # of a length, or rad: constants at which an offset is looked at once more
FEW_TERMS, MOST_TERMS = 5, 10  # fixed angles or lengths of an offset, each at most twice or once
EQUAL = 1e-9  # rad or m
Sample = tuple[Mapping[str, float], Mapping[int, float]]  # constants, closed configuration


@lru_cache(maxsize=64)
def close(robot: Robot) -> Closure:
    """Return the closure of a robot: its passive joints as functions of independent joints.

    Declared relations are checked, linear relations are derived. Raises DescriptionError if the
    loops cannot close.
    """
    return find_relations(robot) if robot.passive else open_tree(robot)


def find_relations(robot: Robot) -> Closure:
    """Find the relations of the passive joints from configurations that close the loops.

    The closure is linear if one of the configurations shows linear relations, else general.
    """
    assembly = Assembly(robot, declared_relations(robot))
    in_loops = {j for loop in robot.loops for k in (loop.cut, loop.twin) for j in robot.path(k)}
    for j in assembly.unknown:
        if j not in in_loops:
            raise DescriptionError(
                f"passive joint {j} is in no loop, so no equation gives its position; declare q{j} "
                "under constraints, or set mu: 1 (actuated)",
                path=("frames", j, "mu"),
                file=robot.file or None,
            )
    general: Array | None = None
    for q in _configurations(assembly):
        freedoms, left = assembly.mobility(q)
        if freedoms != len(robot.joints) or left:
            raise _wrong_mobility(robot, freedoms, left)
        if (linear := _linear(assembly, q)) is not None:
            return linear
        general = q if general is None else general
    assert general is not None
    return _general(assembly, general)


def _configurations(assembly: Assembly) -> Iterator[Array]:
    """Yield joint configurations in which all loops of the mechanism close.

    If the robot has a `start` and a closed configuration near it is found, only this configuration
    is yielded. Otherwise the search begins at random configurations and, if none of them closes, at
    the configuration in which the loops are nearest to closing.
    """
    robot, rng, closed = assembly.robot, np.random.default_rng(3), False
    wanted = {j: x for j, x in robot.start.items() if j in assembly.free}
    if wanted and (near := _nearest(assembly, wanted)) is not None:
        yield near
        return
    for attempt in range(STARTS):
        q = assembly.guess(wanted, rng if attempt else None)
        if (solution := assembly.solve(q)) is not None:
            closed = True
            yield solution
    if not closed:  # the actuators move too: short jacks fit no pose drawn at random
        solution = assembly.solve(assembly.closest())
        if solution is None or assembly.mobility(solution) != (len(robot.joints), 0):
            raise _cannot_close(assembly)
        yield solution


def _nearest(assembly: Assembly, wanted: Mapping[int, float]) -> Array | None:
    """Return the configuration nearest to `start` that closes the loops, or None if none is found.

    Joints that are not in `start` begin at several positions. Passive joints in `start` begin near
    it. Whole turns of a hinge do not count as a distance.
    """
    rng, free = np.random.default_rng(5), assembly.free
    others, passive = [k for k, j in enumerate(free) if j not in wanted], assembly.passive
    nearest, least = None, np.inf
    for attempt in range(NEAR_STARTS):
        q = assembly.guess(wanted, rng if attempt else None)
        if attempt:
            q[passive] += rng.uniform(-BESIDE, BESIDE, len(passive)) * (attempt % 2)
            q = newton(assembly.rows, q, others, steps=STEPS, tolerance=TOLERANCE)
        if (closed := assembly.solve(q)) is None:
            continue
        for k, j in enumerate(free):
            if assembly.robot.frame(j).sigma == REVOLUTE and (j in wanted or attempt):
                turns = np.round((closed[k] - wanted.get(j, 0.0)) / (2 * np.pi))
                closed[k] -= 2 * np.pi * turns
        away = max(abs(closed[k] - wanted[j]) for k, j in enumerate(free) if j in wanted)
        if away < least - EQUAL:
            nearest, least = closed, away
        if least < DRAWN:
            break
    return nearest


def _general(assembly: Assembly, q: Array) -> Closure:
    """Return the joint relations of general (not linear) loops, with q as the start configuration.

    The result has the declared relations and the sums of angles that planar loops fix. All other
    passive joints are tied: only the closure equations give them.
    """
    relations: dict[int, Relation] = {}
    configuration = assembly.configuration(q)
    samples = _samples(assembly, q) or [(assembly.constants, configuration)]
    for loop in assembly.robot.loops:
        row = _angle_sum(assembly, loop, configuration)
        given = [r for j, (r, _) in assembly.relations.items() if row and j in row]
        if row is None or loop.cut not in assembly.unknown or any(loop.cut in r for r in given):
            continue
        if (c := _offset(assembly, samples, loop.cut, row)) is not None:
            angle = c.value(assembly.constants)
            angle += sum(float(n) * configuration[j] for j, n in row.items())
            turns = round((configuration[loop.cut] - angle) / (2 * np.pi))
            relations[loop.cut] = row, c + PI * (2 * turns)
    return _closure(assembly, relations, configuration)


def _angle_sum(
    assembly: Assembly, loop: Loop, configuration: Mapping[int, float]
) -> dict[int, Expression] | None:
    """Return the multiples {j: n_j} in q_cut = sum_j n_j q_j + c, the cut joint angle of a planar
    loop; None for another loop.

    In a planar loop all hinges have parallel axes, in equal or opposite directions, with or without
    prismatic joints between them. The axes are compared in two configurations of the open tree;
    `regroup.states` proves the sum over F_p.
    """
    robot = assembly.robot
    if robot.frame(loop.cut).sigma != REVOLUTE:
        return None
    twin, cut = robot.path(loop.twin), robot.path(loop.cut)
    hinges = [(1, j) for j in twin if j not in cut] + [(-1, j) for j in cut if j not in twin]
    hinges = [(sign, j) for sign, j in hinges if robot.frame(j).sigma == REVOLUTE]
    row: dict[int, Expression] = {}
    pose = frame_poses(Geometry(robot, GraphAlgebra(robot), open_tree(robot)))
    axes = [axis[2] for _, j in hinges for axis in pose[j][0]]
    for shift in (0.0, 0.3):
        q = {j: x + shift * k for k, (j, x) in enumerate(configuration.items())}
        z = np.array(interpret(axes, Floats(robot, states_of(q=q))), dtype=float).reshape(-1, 3)
        axis_of = {j: z[k] for k, (_, j) in enumerate(hinges)}
        along = {j: float(axis @ axis_of[loop.cut]) for j, axis in axis_of.items()}
        if any(abs(abs(x) - 1) > 1e-9 for x in along.values()):
            return None
        row = {j: Expression.number(s * round(along[j])) for s, j in hinges if j != loop.cut}
    return row


def _linear(assembly: Assembly, q: Array) -> Closure | None:
    """Return linear relations for all passive joints, or None if there are no such relations.

    The rates of the passive joints must be constant whole numbers near configuration q, the
    constants must be sums of fixed angles or lengths, and the relations must be proved over F_p.
    """
    N = np.round(assembly.rates(q))
    moved = q.copy()
    moved[assembly.active] += 0.37 + 0.1 * np.array(assembly.active)
    for place in (q, assembly.solve(moved)):
        if place is None or np.abs(assembly.rates(place) - N).max(initial=0.0) > 1e-5:
            return None
    samples = _samples(assembly, q)
    relations: dict[int, Relation] = {}
    for j, rates in zip(assembly.unknown, N.astype(int).tolist(), strict=True):
        whole = zip(assembly.active, rates, strict=True)
        row = {assembly.free[k]: Expression.number(n) for k, n in whole if n}
        c = _offset(assembly, samples, j, row) if samples else None
        if c is None:
            return None
        relations[j] = row, c
    linear = _closure(assembly, relations, assembly.configuration(q))
    return linear if _coincide(linear) else None


def _closure(
    assembly: Assembly, relations: Mapping[int, Relation], start: Mapping[int, float]
) -> Closure:
    """Combine the found and the declared joint relations into one `Closure` of the robot.

    Passive joints without a relation are tied: only the closure equations give them.
    """
    robot = assembly.robot
    tied = tuple(j for j in assembly.unknown if j not in relations)
    free = (*robot.joints, *tied)
    every: dict[int, Relation] = {j: ({j: ONE}, ZERO) for j in free}
    every |= {**relations, **assembly.relations}

    def closure() -> Closure:
        row, offset = ({j: r[k] for j, r in every.items()} for k in (0, 1))
        return Closure(robot, row, offset, tied, start)  # type: ignore[arg-type]

    for _ in robot.loops:  # relations of joints that have one themselves
        every |= {j: closure().relation(*r) for j, r in every.items() if not {*r[0]} <= {*free}}
    return closure()


# --- offsets ---


def _samples(assembly: Assembly, q: Array) -> list[Sample]:
    """Return the constants of the file, and slightly changed constants, each set with a
    configuration that closes the loops.

    At the changed constants, equal values of different symbols differ. The list is empty if the
    loops do not close with the constants, and has only the constants of the file if an expression
    has no value at the changed constants.
    """
    rng, robot = np.random.default_rng(7), assembly.robot
    angles = {s for f in robot.frames for e in (f.gamma, f.alpha, f.theta0) for s in e.symbols}
    varied = {
        name: x + VARIED * float(rng.uniform(0.5, 1)) * (1 if name in angles else x)
        for name, x in robot.constants.items()
    }
    samples: list[Sample] = [(assembly.constants, assembly.configuration(q))]
    try:
        other = Assembly(robot, assembly.relations, varied)
        there = other.solve(q)
    except (ArithmeticError, ValueError):  # an expression of the file has no value there
        return samples
    return [] if there is None else [*samples, (other.constants, other.configuration(there))]


def _offset(
    assembly: Assembly, samples: list[Sample], j: int, row: Mapping[int, Expression]
) -> Expression | None:
    """Find an expression for the constant c of q_j = sum n_i q_i + c, or return None.

    Constants that the frames add to q_j and q_i in theta or r enter c with their factors. The rest
    of c is a sum of other fixed angles of the loops and quarter turns, or of lengths.
    """
    robot, whole = assembly.robot, {j: -ONE} | dict(row)
    hinge = robot.frame(j).sigma == REVOLUTE
    c, terms = _beside(robot, whole), _fixed(assembly, hinge)
    reach = range(-2, 3) if len(terms) <= FEW_TERMS else range(-1, 2)
    n = np.array(list(product(reach, repeat=len(terms))), dtype=int)
    rest = np.array(
        [
            -sum(float(g) * q[i] for i, g in whole.items())
            - c.value(constants)
            - n @ np.array([e.value(constants) for e in terms])
            for constants, q in samples
        ]
    )
    quarters = np.round(rest[0] * (2 / np.pi)) * hinge
    fits = (np.abs(rest - quarters * (np.pi / 2)) < EQUAL).all(axis=0)
    if not fits.any():
        return None
    best = int(np.where(fits, np.abs(n).sum(axis=1), np.inf).argmin())
    c = c + sum((e * int(k) for e, k in zip(terms, n[best], strict=True)), ZERO)
    if not hinge:
        return c
    turns, angle = quarter_turns(c + PI * Fraction(int(quarters[best]), 2))
    return angle + PI * Fraction((turns + 1) % 4 - 1, 2)  # from -pi/2, 0, pi/2 or pi


def _beside(robot: Robot, row: Mapping[int, Expression]) -> Expression:
    """Return the constant part of the relation sum n_i (q_i + c_i), c_i the fixed theta or r of frame i.

    row : the integers n_i by frame i."""
    frames = {i: robot.frame(i) for i in row}
    terms = ((f.theta0 if f.sigma == REVOLUTE else f.r0) * row[i] for i, f in frames.items())
    return sum(terms, ZERO)


def _fixed(assembly: Assembly, hinge: bool) -> list[Expression]:
    """Return the candidate terms for the constant of a joint relation: fixed angles, or lengths.

    The terms come from the frames of the loops and from the declared relations, without quarter
    turns, each once up to its sign. Constants added to a joint position are left out.
    """
    robot, own = assembly.robot, REVOLUTE if hinge else PRISMATIC
    around = {k for l in robot.loops for k in {*robot.path(l.cut)} ^ {*robot.path(l.twin)}}
    entries = [
        e
        for f in map(robot.frame, sorted(around))
        for e in ((f.gamma, f.alpha, f.theta0) if hinge else (f.b, f.d, f.r0))[
            : 3 - (f.sigma == own)
        ]
    ] + [
        c + _beside(robot, {j: -ONE} | dict(row)) * -1
        for j, (row, c) in assembly.relations.items()
        if robot.frame(j).sigma == own
    ]
    rest = [quarter_turns(e)[1] if hinge else e for e in entries]
    return list(dict.fromkeys(max(e, -e, key=str) for e in rest if e))[:MOST_TERMS]


def _coincide(closure: Closure) -> bool:
    """Whether the two frames at the cut joint of each loop coincide, tested with random lengths and
    positions modulo a prime p.

    The test proves the relations in `closure`.
    """
    draw, algebra = Draw(closure.robot, 17, 3), GraphAlgebra(closure.robot)
    rows = interpret(coincidence(loop_ends(closure.robot, algebra, closure)), draw)
    return not any(draw.residues(x).any() for x in rows)


# --- mechanisms that cannot be ---


def _wrong_mobility(robot: Robot, freedoms: int, left: int) -> DescriptionError:
    expected = len(robot.joints)
    joints = [robot.labels.get(j, j) for j in robot.joints]
    foreign = robot.file and not robot.file.endswith((".yaml", ".yml"))  # mu follows from motors
    fewer, more = (
        ("name fewer joints with motors", "name more joints with motors")
        if foreign
        else ("set mu: 0 for each joint without a motor", "set mu: 1 for more joints")
    )
    what = (
        f"over-constrained or has too many actuators; {fewer}"
        if freedoms < expected
        else f"under-constrained; {more}, or add relations under constraints"
    )
    held = f"; if these joints are fixed, {left} degrees of freedom remain" if left else ""
    return DescriptionError(
        f"mobility is {freedoms}, but {expected} joints are actuated ({joints}){held}; "
        f"the mechanism is {what}",
        path=("loops",),
        file=robot.file or None,
    )


def _cannot_close(assembly: Assembly) -> DescriptionError:
    """Return an error that says why the loops cannot close: relations, actuators or frames."""
    robot = assembly.robot
    in_loops = {j for loop in robot.loops for k in (loop.cut, loop.twin) for j in robot.path(k)}
    declared = {j: e for j, e in robot.constraints.items() if j in in_loops}
    also = ""
    if declared:
        others = {j: e for j, e in robot.constraints.items() if j not in declared}
        try:
            closure = find_relations(replace(robot, constraints=others))
        except DescriptionError:
            also = ", with or without the declared relations"
        else:
            return _contradiction(assembly, declared, closure)
    q = assembly.closest()
    loop, gap = assembly.widest(q)
    if gap < CLOSED:
        return _wrong_mobility(robot, *assembly.mobility(q))
    return DescriptionError(
        f"frame {loop.cut} (cut) and frame {loop.twin} (twin) cannot coincide{also}; their "
        f"smallest difference is {gap:.3g} (positions divided by the longest link); check the lengths, "
        f"alpha, theta and the table row of frame {loop.twin}",
        path=("loops", robot.loops.index(loop)),
        file=robot.file or None,
    )


def _contradiction(
    assembly: Assembly, declared: Mapping[int, Expression], closure: Closure
) -> DescriptionError:
    """Return an error for joint relations of the file with which the loops cannot close.

    The error gives both forms of each such relation, and how far the loop is open with the declared
    relations.
    """
    sides = []
    for j, e in declared.items():
        if j in closure.tied:
            sides.append(
                f"q{j}: declared {e}, the closure gives no linear relation (these lengths make no "
                "parallelogram)"
            )
        elif not _same(closure, j, *closure.relation(*assembly.relations[j])):
            sides.append(f"q{j}: declared {e}, the closure gives {closure.formula(j)}")
    loop, gap = assembly.widest(np.array([closure.start[j] for j in assembly.free]))
    return DescriptionError(
        f"declared relations contradict the closure; {'; '.join(sides)}; with the declared relations "
        f"frame {loop.cut} (cut) and frame {loop.twin} (twin) are {gap:.3g} apart (positions divided "
        "by the longest link); correct or remove these relations under constraints",
        path=("constraints", f"q{min(declared)}"),
    )


def _same(closure: Closure, j: int, row: Mapping[int, Expression], c: Expression) -> bool:
    """Whether q_j = sum_i row_i q_i + c equals the relation of joint j in `closure`, up to whole
    turns.
    """
    apart = (c - closure.offset[j]).value(closure.robot.constants)
    if closure.robot.frame(j).sigma == REVOLUTE:
        apart -= 2 * np.pi * round(apart / (2 * np.pi))
    return row == dict(closure.row[j]) and abs(apart) < EQUAL
