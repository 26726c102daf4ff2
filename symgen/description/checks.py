"""Checks that frames, elements on the joints, and loops of a robot file make a valid mechanism.

Each check yields rows: whether the field is wrong, the message, and the path of the field, for
instance frames.2.alpha. The first wrong row is raised as DescriptionError.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from symgen.description.element import KINDS, OWN_LAWS, Element, check_channels, check_law
from symgen.description.expression import ONE, PI, Call, Expression
from symgen.description.fields import Path, Problem, dotted
from symgen.description.naming import check_names
from symgen.description.parts import (
    ANGLES,
    DIRECTIONS,
    FIXED,
    GEOMETRY,
    INERTIAL,
    PRISMATIC,
    REVOLUTE,
    Form,
    Frame,
    Row,
    moves,
)
from symgen.errors import DescriptionError

OF_BASE = re.compile(r"(base|(W|WP|VP)[123]_?0)\Z")  # the motion of a base that moves
FULL_TURN = 2 * math.pi  # rad: a larger constant in an angle, pi aside, was meant in degrees


def check_robot(robot: Any) -> None:
    """Check that the fields of `robot` describe a valid mechanism.

    Raises DescriptionError if they do not.
    """
    for wrong, message, path in _problems(robot):
        if wrong:
            raise DescriptionError(message, path=path)


def _problems(robot: Any) -> Iterator[Problem]:
    yield from _check_tree(robot.frames, robot.massless)
    yield from check_names(robot)
    yield (
        not robot.parameters,
        "the robot has no parameters: every link is massless and no element acts on a joint; "
        "remove links from the list massless, or add elements",
        ("massless",),
    )
    yield from _check_geometry(robot)
    for e in robot.elements:
        yield from _check_element(e, robot)
    yield from check_channels(robot)
    yield from _check_loops(robot)
    yield from _check_base(robot)
    yield from _check_drives(robot)
    yield from _check_limits(robot)
    for key, names in (("assume", sorted(robot.assume)), ("values", robot.values)):
        for name in (name for name in names if name not in robot.parameters):
            what = f"is not a standard parameter of {robot.name}{_meant(name, robot)}"
            yield True, f"{key}: {name!r} {what}", (key, name)


def _check_tree(frames: Sequence[Frame], massless: Collection[int]) -> Iterator[Problem]:
    """Check the numbers, joint types and antecedents of the frames.

    Frames are numbered 1, 2, 3 ... without gaps, every chain of antecedents ends at the base, and
    at least one joint is actuated.
    """
    numbers = [f.j for f in frames]
    yield not numbers, "the robot has no frames; add at least frame 1", ("frames",)
    for k, j in enumerate(numbers, start=1):
        given = j in numbers[: k - 1]
        what = f"frame {j} is given twice" if given else f"frame {k} is missing (found {numbers})"
        yield j != k, f"{what}; frames are numbered 1, 2, 3 ... without gaps", ("frames", j)
    for f in frames:
        where = ("frames", f.j)
        yield (
            f.sigma not in (REVOLUTE, PRISMATIC, FIXED),
            f"joint {f.j}: sigma = {f.sigma}; expected 0 revolute, 1 prismatic or 2 fixed",
            (*where, "sigma"),
        )
        yield (
            f.mu not in (0, 1) or (f.mu and f.sigma == FIXED),
            f"joint {f.j}: mu = {f.mu}; expected 1 actuated or 0 passive, and 0 for a fixed frame",
            (*where, "mu"),
        )
        yield (
            f.ant == f.j or f.ant > len(numbers) or f.ant < 0,
            f"frame {f.j}: ant = {f.ant}; expected an earlier frame, 0 for the base",
            (*where, "ant"),
        )
    for f in frames:
        chain, i = {f.j}, f.ant
        while i and i not in chain:
            chain.add(i)
            i = frames[i - 1].ant
        yield (
            i,
            f"frames {sorted(chain)} are each other's antecedents (a cycle); every chain of `ant` "
            "must end at 0",
            ("frames", f.j, "ant"),
        )
        yield (
            f.ant > f.j,
            f"frame {f.j}: ant = {f.ant} comes later; number frames from the base outward",
            ("frames", f.j, "ant"),
        )
    for j in sorted(set(massless) - set(numbers)):
        yield True, f"massless: link {j} does not exist; frames are {numbers}", ("massless",)
    yield (
        not any(f.mu for f in frames),
        "the robot has no actuated joint; set mu: 1 (actuated) for a revolute or prismatic joint",
        ("frames",),
    )


def _check_base(robot: Any) -> Iterator[Problem]:
    """Check that a moving base has a known kind, belongs to no loop, and that its names are free."""
    if not robot.base_moves:
        return
    for loop in robot.loops:
        yield (
            not robot.root(loop),
            f"the loop of frames {loop.cut} and {loop.twin} closes through frame 0, so that the base "
            "cannot move; write base: fixed or, if the moving body itself carries both branches, "
            "mount them on a fixed frame (sigma: 2) of frame 0",
            ("base",),
        )
    for name in filter(OF_BASE.match, robot.constants):
        yield (
            True,
            f"constants: {name} is an input of a robot whose base moves; rename the constant",
            ("constants", name),
        )


def _check_geometry(robot: Any) -> Iterator[Problem]:
    """Check the expressions of gravity and of the frame table.

    All symbols must be declared constants. q_j must occur once in theta_j of a revolute joint or in
    r_j of a prismatic joint, and nowhere else.
    """
    constants = robot.constants
    for k, component in enumerate(robot.gravity):
        yield from _check_expression(component, ("gravity", k), constants)
    for f in robot.frames:
        for name in GEOMETRY:
            row = robot.row(f.j, name)
            where = ("frames", row, name)
            e: Expression = getattr(f, name)
            variable = (name, f.sigma) in {("theta", REVOLUTE), ("r", PRISMATIC)}
            yield (
                variable and (e.coefficient(f.q) != ONE or moves(e - Expression.symbol(f.q))),
                f"frame {row}: {name} = {e}; expected {f.q} once, as {f.q} or {f.q} + "
                f"constant{_other_sigma(f)}",
                where,
            )
            yield (
                not variable and moves(e),
                f"frame {row}: {name} = {e}; write the joint position in theta if sigma is 0, in r "
                "if sigma is 1, and nowhere else",
                where,
            )
            q = f.q if variable else ""
            yield from _check_expression(e, where, constants, angle=name in ANGLES, q=q)
            if name in ANGLES:
                advice = _degrees_advice(f.theta0 if name == "theta" else e, dict(constants))
                yield advice, f"frame {row}: {name} = {e}: {advice}", where


def _degrees_advice(angle: Expression, constants: dict[str, float]) -> str:
    """Return a hint if an angle larger than a full turn was probably written in degrees.

    Multiples of pi in the angle are ignored. `angle` is given without the joint variable q_j.
    """
    turn = angle - PI * angle.coefficient("pi")
    if "pi" in turn.atoms or turn.symbols - constants.keys():
        return ""
    value = turn.value(constants)
    return (
        (
            f"{value:g} rad are {abs(value) / FULL_TURN:.3g} turns; angles are in rad: 90 degrees "
            "are pi/2"
        )
        if abs(value) > FULL_TURN
        else ""
    )


def _check_expression(
    e: Expression, path: Path, constants: Mapping[str, float], *, angle: bool = False, q: str = ""
) -> Iterator[Problem]:
    yield from _check_declared(e, path, {*constants, q} if q else constants)
    yield from _check_exact(e, path, angle=angle)
    yield from _check_finite(e, path, constants)


def _check_finite(e: Expression, path: Path, constants: Mapping[str, float]) -> Iterator[Problem]:
    """Refuse an expression with a division by zero or a square root of a negative number.

    Joint positions have the value 1 in this check.
    """
    try:
        finite = math.isfinite(e.value({**dict.fromkeys(e.symbols, 1.0), **constants}))
    except (ArithmeticError, ValueError):
        finite = False
    if not finite:
        names = sorted(e.symbols & {*constants})
        given = ", ".join(f"{name} = {constants[name]:g}" for name in names)
        what = f"has no finite real value{f' at {given}' * bool(given)}"
        yield True, f"{dotted(path)}: {e} {what}; change the constant or the expression", path


def _check_declared(e: Expression, path: Path, symbols: Collection[str]) -> Iterator[Problem]:
    if unknown := e.symbols - set(symbols):
        declared = ", ".join(name for name in symbols if not re.fullmatch(r"q\d+", name)) or "none"
        what = f"undeclared symbol {', '.join(sorted(unknown))}"
        yield True, f"{what}; declare it under constants (declared: {declared})", path


def _check_exact(e: Expression, path: Path, *, angle: bool) -> Iterator[Problem]:
    """Refuse expressions without exact values: pi outside an angle, or functions inside an angle.

    For instance, pi in a length, or cos in an angle, must be written as a declared constant.
    """
    for a in e.atoms:
        if isinstance(a, Call) and not angle:
            yield from _check_exact(a.argument, path, angle=a.function in ("cos", "sin"))
            continue
        problem = f"{a} in an angle" if angle else "pi outside an angle"
        yield (
            isinstance(a, Call) or (a == "pi" and not angle),
            f"{dotted(path)}: {problem}; declare a constant of that value and write its name",
            path,
        )


def _other_sigma(f: Frame) -> str:
    """Suggest another joint type sigma if the row of frame `f` looks like a joint of another type.

    Returns "" if the position q_j is in the column that sigma requires.
    """
    if moves(f.theta) or (f.sigma == PRISMATIC and moves(f.r)):
        return ""
    if f.sigma == REVOLUTE:
        return (
            f"; sigma: 0 is revolute; a prismatic joint has sigma: 1 and r: {f.q}, a fixed "
            "frame (a tool) sigma: 2"
        )
    return (
        f"; sigma: 1 is prismatic; a revolute joint has sigma: 0 and theta: {f.q}, a fixed "
        "frame (a tool) sigma: 2"
    )


def _check_element(e: Element, robot: Any) -> Iterator[Problem]:
    """Check an element, such as friction: kind, law, unit, direction of motion, coefficients."""
    where: Path = ("elements", e.family)
    both = sorted(set(e.along) & set(e.form))
    laws = [law for law in (e.torque, e.energy) if law is not None]
    own = e.kind in OWN_LAWS
    kind = KINDS.get(e.kind)
    rows = (
        (
            own and len(laws) != 1,
            "give one of `torque` and `energy`, or a `kind` that has a law",
            where,
        ),
        (
            laws and not own,
            f"kind {e.kind} already defines the law; leave out torque and energy",
            (*where, "kind"),
        ),
        (own and not e.unit, "give the `unit` of its parameter, such as N*m", where),
        (
            not re.fullmatch(r"[\w*/^().°%+-]{0,40}", e.unit),
            f"unit {e.unit!r:.50}; expected up to 40 letters, digits and * / ^ ( ), such as N*m*s/rad",
            (*where, "unit"),
        ),
        (kind is None, f"kind {e.kind!r}; expected one of {', '.join(KINDS)}", (*where, "kind")),
        (
            e.when is not None and (e.when not in DIRECTIONS or kind is None or not kind.when),
            f"when {e.when!r}; expected positive or negative, only for viscous and coulomb elements",
            (*where, "when"),
        ),
        (not e.along and not e.form, "it acts on no joint; give `along` or `form`", where),
        (
            e.form and kind and not kind.form,
            f"a {e.kind} element has no quadratic form; use `along`",
            (*where, "form"),
        ),
        (
            e.form and e.when,
            "`when` needs a direction of motion; use `along` instead of `form`",
            (*where, "when"),
        ),
        (
            both,
            f"keys {both} are in both along and form; keep each key in one of the two",
            (*where, "form"),
        ),
    )
    yield from ((wrong, f"element {e.family}: {message}", path) for wrong, message, path in rows)
    tables: tuple[tuple[str, Mapping[int, Row | Form]], ...] = (
        ("along", e.along),
        ("form", e.form),
    )
    for part, table in tables:
        for j, coefficients in table.items():
            place = (*where, part, j)
            yield (
                not 0 < j <= len(robot.frames),
                f"element {e.family}: frame {j} does not exist; frames are 1 to {len(robot.frames)}",
                place,
            )
            for index, c in coefficients.items():
                for i in (index,) if isinstance(index, int) else index:
                    yield (
                        i not in robot.moving,
                        f"element {e.family}{j}: q{i} is not a joint of this robot (joints "
                        f"{list(robot.moving)})",
                        place,
                    )
                yield from _check_expression(c, place, robot.constants)
            yield (
                not any(coefficients.values()),
                f"element {e.family}{j}: all coefficients are zero; give a joint a coefficient that is not zero",
                place,
            )
    if e.is_own and (not own or laws):
        yield from check_law(e, robot)


def _check_loops(robot: Any) -> Iterator[Problem]:
    """Check the closed loops and the constraints on passive joints.

    A cut joint must be passive and its twin frame fixed. A constraint must give the position of a
    passive joint. Passive joints need a loop or a constraint.
    """
    numbers = [f.j for f in robot.frames]
    for k, loop in enumerate(robot.loops):
        where = ("loops", k)
        for name, j in (("cut", loop.cut), ("twin", loop.twin)):
            yield (
                j not in numbers,
                f"loop {k + 1}: {name} frame {j} does not exist; frames are 1 to {len(numbers)}",
                (*where, name),
            )
        cut, twin = robot.frame(loop.cut), robot.frame(loop.twin)
        yield (
            twin.sigma != FIXED,
            f"loop {k + 1}: twin frame {loop.twin} has sigma {twin.sigma}; expected 2 (fixed on its "
            f"link){'; exchange cut and twin' if cut.sigma == FIXED else ''}",
            (*where, "twin"),
        )
        yield (
            cut.mu,
            f"loop {k + 1}: cut joint {loop.cut} is actuated; cut the loop at a passive joint (mu: 0)",
            (*where, "cut"),
        )
    passive = list(robot.passive)
    for j, e in robot.constraints.items():
        place = ("constraints", f"q{j}")
        yield (
            j not in passive,
            f"constraint on q{j}: joint {j} is not a passive joint (passive joints: {passive}); "
            "remove the constraint, or set mu: 0 (passive)",
            place,
        )
        symbols = [*robot.constants, *(f"q{i}" for i in robot.moving)]
        yield from _check_declared(e, place, symbols)
        yield from _check_finite(e, place, robot.constants)
    yield (
        passive and not robot.loops and not robot.constraints,
        f"joints {passive} are passive, but there is no loop and no constraint; set mu: 1 "
        "(actuated), or add a loop or a constraint",
        ("frames", *passive[:1], "mu"),
    )


def _check_drives(robot: Any) -> Iterator[Problem]:
    """Check the drives: one row per actuated joint, and an invertible matrix of gear ratios."""
    drives, n = robot.drives, len(robot.joints)
    if drives is None:
        return
    shape = [len(row) for row in drives.ratio]
    yield (
        shape != [n] * n,
        f"drives: ratio has rows with {shape} numbers; expected {n} rows with {n} numbers, one row per actuated joint",
        ("drives", "ratio"),
    )
    import numpy as np

    yield (
        np.linalg.matrix_rank(drives.ratio) < n,
        "drives: ratio is singular; expected an invertible matrix, so that motor positions determine joint positions",
        ("drives", "ratio"),
    )
    for name, row in (("offset", drives.offset), ("torque_constant", drives.torque_constant)):
        count = n if row is None else len(row)
        yield (
            count != n,
            f"drives: {name} has {count} entries; expected {n}, one per actuated joint",
            ("drives", name),
        )


def _check_limits(robot: Any) -> Iterator[Problem]:
    """Check the joint limits: one entry per actuated joint, lower bounds below upper bounds."""
    n = len(robot.joints)
    for name, row in robot.limits.items():
        yield (
            name not in ("q", "qd", "qdd", "tau") or len(row) != n,
            f"limits: {name} has {len(row)} entries; expected the keys q, qd, qdd, tau with {n} "
            "entries each, one per actuated joint",
            ("limits", name),
        )
        for i, entry in enumerate(row):
            low, high = entry if isinstance(entry, tuple) else (0.0, entry)
            yield (
                not low < high and (name, entry) != ("tau", 0.0),
                f"limits: {name} of joint {robot.joints[i]} is {entry}; expected lower < upper, or "
                "a positive number; for tau of a joint without a motor write 0",
                ("limits", name, i),
            )


def _meant(name: str, robot: Any) -> str:
    """Suggest the standard parameter that the user probably meant by an unknown name in a file."""
    if name.endswith("R") and name[:-1] in robot.parameters:
        return f"; {name} is a base parameter; give the standard parameter {name[:-1]}"
    number = re.search(r"\d+\Z", name)
    j = int(number.group()) if number else 0
    if name.removesuffix(str(j)) in INERTIAL and 0 < j <= len(robot.frames):
        return (
            f"; link {j} has no inertial parameters, because it is massless or frame {j} is cut"
            if j not in robot.links
            else ""
        )
    own = [p for p in robot.parameters if p.endswith(str(j))] if j else []
    return f"; expected names such as {', '.join(own or robot.parameters[:12])}"
