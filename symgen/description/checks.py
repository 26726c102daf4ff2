"""Checks that frames, elements on the joints, and loops of a robot file make a valid mechanism.

Each check raises DescriptionError with the path of the wrong field, for instance frames.2.alpha.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from symgen.description.element import Element, check_channels, check_law
from symgen.description.expression import ONE, PI, Call, Expression
from symgen.description.fields import Path, dotted
from symgen.description.kinds import KINDS, OWN_LAWS
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

FULL_TURN = 2 * math.pi  # rad: a larger constant in an angle, pi aside, was meant in degrees


def check_robot(robot: Any) -> None:
    """Check that the fields of `robot` describe a valid mechanism.

    Raises DescriptionError if they do not.
    """
    _check_tree(robot.frames, robot.massless)
    check_names(robot)
    if not robot.parameters:
        raise DescriptionError(
            "the robot has no parameters: every link is massless and no element acts on a joint; "
            "remove links from the list massless, or add elements",
            path=("massless",),
        )
    _check_geometry(robot)
    for e in robot.elements:
        _check_element(e, robot)
    check_channels(robot)
    _check_loops(robot)
    _check_drives(robot)
    _check_limits(robot)
    for key, names in (("assume", sorted(robot.assume)), ("values", robot.values)):
        for name in (name for name in names if name not in robot.parameters):
            raise DescriptionError(
                f"{key}: {name!r} is not a standard parameter of {robot.name}{_meant(name, robot)}",
                path=(key, name),
            )


def _check_tree(frames: Sequence[Frame], massless: Collection[int]) -> None:
    """Check the numbers, joint types and antecedents of the frames.

    Frames are numbered 1, 2, 3 ... without gaps, every chain of antecedents ends at the base, and
    at least one joint is actuated.
    """
    numbers = [f.j for f in frames]
    if not numbers:
        raise DescriptionError("the robot has no frames; add at least frame 1", path=("frames",))
    for k, j in enumerate(numbers, start=1):
        if j != k:
            what = (
                f"frame {j} is given twice"
                if j in numbers[: k - 1]
                else f"frame {k} is missing (found {numbers})"
            )
            raise DescriptionError(
                f"{what}; frames are numbered 1, 2, 3 ... without gaps", path=("frames", j)
            )
    for f in frames:
        where = ("frames", f.j)
        if f.sigma not in (REVOLUTE, PRISMATIC, FIXED):
            raise DescriptionError(
                f"joint {f.j}: sigma = {f.sigma}; expected 0 revolute, 1 prismatic or 2 fixed",
                path=(*where, "sigma"),
            )
        if f.mu not in (0, 1) or (f.mu and f.sigma == FIXED):
            raise DescriptionError(
                (
                    f"joint {f.j}: mu = {f.mu}; expected 1 actuated or 0 passive, and 0 for a "
                    "fixed frame"
                ),
                path=(*where, "mu"),
            )
        if f.ant == f.j or f.ant > len(numbers) or f.ant < 0:
            raise DescriptionError(
                f"frame {f.j}: ant = {f.ant}; expected an earlier frame, 0 for the base",
                path=(*where, "ant"),
            )
        chain, i = {f.j}, f.ant
        while i:
            if i in chain:
                raise DescriptionError(
                    (
                        f"frames {sorted(chain)} are each other's antecedents (a cycle); every "
                        "chain of `ant` must end at 0"
                    ),
                    path=(*where, "ant"),
                )
            chain.add(i)
            i = frames[i - 1].ant
        if f.ant > f.j:
            raise DescriptionError(
                f"frame {f.j}: ant = {f.ant} comes later; number frames from the base outward",
                path=(*where, "ant"),
            )
    if strange := sorted(set(massless) - set(numbers)):
        raise DescriptionError(
            f"massless: link {strange[0]} does not exist; frames are {numbers}", path=("massless",)
        )
    if not any(f.mu for f in frames):
        raise DescriptionError(
            "the robot has no actuated joint; set mu: 1 (actuated) for a revolute "
            "or prismatic joint",
            path=("frames",),
        )


def _check_geometry(robot: Any) -> None:
    """Check the expressions of gravity and of the frame table.

    All symbols must be declared constants. q_j must occur once in theta_j of a revolute joint or in
    r_j of a prismatic joint, and nowhere else.
    """
    constants = robot.constants
    for k, component in enumerate(robot.gravity):
        _check_expression(component, ("gravity", k), constants)
    for f in robot.frames:
        for name in GEOMETRY:
            row = robot.row(f.j, name)
            where = ("frames", row, name)
            e: Expression = getattr(f, name)
            variable = (name, f.sigma) in {("theta", REVOLUTE), ("r", PRISMATIC)}
            if variable and (e.coefficient(f.q) != ONE or moves(e - Expression.symbol(f.q))):
                raise DescriptionError(
                    (
                        f"frame {row}: {name} = {e}; expected {f.q} once, as {f.q} or {f.q} + "
                        f"constant{_other_sigma(f)}"
                    ),
                    path=where,
                )
            if not variable and moves(e):
                raise DescriptionError(
                    (
                        f"frame {row}: {name} = {e}; write the joint position in theta if sigma is "
                        "0, in r if sigma is 1, and nowhere else"
                    ),
                    path=where,
                )
            _check_expression(e, where, constants, angle=name in ANGLES, q=f.q if variable else "")
            if name in ANGLES and (
                advice := _degrees_advice(f.theta0 if name == "theta" else e, dict(constants))
            ):
                raise DescriptionError(f"frame {row}: {name} = {e}: {advice}", path=where)


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
) -> None:
    _check_declared(e, path, {*constants, q} if q else constants)
    _check_exact(e, path, angle=angle)
    _check_finite(e, path, constants)


def _check_finite(e: Expression, path: Path, constants: Mapping[str, float]) -> None:
    """Refuse an expression with a division by zero or a square root of a negative number.

    Joint positions have the value 1 in this check.
    """
    try:
        finite = math.isfinite(e.value({**dict.fromkeys(e.symbols, 1.0), **constants}))
    except (ArithmeticError, ValueError):
        finite = False
    if not finite:
        given = ", ".join(
            f"{name} = {constants[name]:g}" for name in sorted(e.symbols & {*constants})
        )
        raise DescriptionError(
            f"{dotted(path)}: {e} has no finite real value{f' at {given}' * bool(given)}; "
            "change the constant or the expression",
            path=path,
        )


def _check_declared(e: Expression, path: Path, symbols: Collection[str]) -> None:
    if unknown := e.symbols - set(symbols):
        declared = ", ".join(name for name in symbols if not re.fullmatch(r"q\d+", name)) or "none"
        raise DescriptionError(
            (
                f"undeclared symbol {', '.join(sorted(unknown))}; declare it under constants "
                f"(declared: {declared})"
            ),
            path=path,
        )


def _check_exact(e: Expression, path: Path, *, angle: bool) -> None:
    """Refuse expressions without exact values: pi outside an angle, or functions inside an angle.

    For instance, pi in a length, or cos in an angle, must be written as a declared constant.
    """
    for a in e.atoms:
        if isinstance(a, Call) and not angle:
            _check_exact(a.argument, path, angle=a.function in ("cos", "sin"))
        elif isinstance(a, Call) or (a == "pi" and not angle):
            problem = f"{a} in an angle" if angle else "pi outside an angle"
            raise DescriptionError(
                f"{dotted(path)}: {problem}; declare a constant of that value and write its name",
                path=path,
            )


def _other_sigma(f: Frame) -> str:
    """Suggest another joint type sigma if the row of frame `f` looks like a joint of another type.

    Returns "" if the position q_j is where sigma expects it.
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


def _check_element(e: Element, robot: Any) -> None:
    """Check an element, such as friction: kind, law, unit, direction of motion, coefficients."""
    where: Path = ("elements", e.family)
    both = sorted(set(e.along) & set(e.form))
    laws = [law for law in (e.torque, e.energy) if law is not None]
    own = e.kind in OWN_LAWS
    problems = (
        (
            own and len(laws) != 1,
            "give one of `torque` and `energy`, or a `kind` that has a law",
            "",
        ),
        (
            laws and not own,
            f"kind {e.kind} already defines the law; leave out torque and energy",
            "kind",
        ),
        (own and not e.unit, "give the `unit` of its parameter, such as N*m", ""),
        (
            not re.fullmatch(r"[\w*/^().°%+-]{0,40}", e.unit),
            f"unit {e.unit!r:.50}; expected up to 40 letters, digits and * / ^ ( ), such as N*m*s/rad",
            "unit",
        ),
        (e.kind not in KINDS, f"kind {e.kind!r}; expected one of {', '.join(KINDS)}", "kind"),
        (
            e.when is not None
            and (e.when not in DIRECTIONS or e.kind not in KINDS or not KINDS[e.kind].when),
            f"when {e.when!r}; expected positive or negative, only for viscous and coulomb elements",
            "when",
        ),
        (not e.along and not e.form, "it acts on no joint; give `along` or `form`", ""),
        (
            e.form and e.kind in KINDS and not KINDS[e.kind].form,
            f"a {e.kind} element has no quadratic form; use `along`",
            "form",
        ),
        (
            e.form and e.when,
            "`when` needs a direction of motion; use `along` instead of `form`",
            "when",
        ),
        (both, f"keys {both} are in both along and form; keep each key in one of the two", "form"),
    )
    for wrong, message, key in problems:
        if wrong:
            raise DescriptionError(
                f"element {e.family}: {message}", path=(*where, key) if key else where
            )
    tables: tuple[tuple[str, Mapping[int, Row | Form]], ...] = (
        ("along", e.along),
        ("form", e.form),
    )
    for part, table in tables:
        for j, coefficients in table.items():
            place = (*where, part, j)
            if not 0 < j <= len(robot.frames):
                raise DescriptionError(
                    f"element {e.family}: frame {j} does not exist; frames are 1 to {len(robot.frames)}",
                    path=place,
                )
            for index, c in coefficients.items():
                for i in (index,) if isinstance(index, int) else index:
                    if i not in robot.moving:
                        raise DescriptionError(
                            f"element {e.family}{j}: q{i} is not a joint of this robot (joints "
                            f"{list(robot.moving)})",
                            path=place,
                        )
                _check_expression(c, place, robot.constants)
            if not any(coefficients.values()):
                raise DescriptionError(
                    f"element {e.family}{j}: all coefficients are zero; give a joint a coefficient that is not zero",
                    path=place,
                )
    if e.is_own and (not own or laws):
        check_law(e, robot)


def _check_loops(robot: Any) -> None:
    """Check the closed loops and the constraints on passive joints.

    A cut joint must be passive and its twin frame fixed. A constraint must give the position of a
    passive joint. Passive joints need a loop or a constraint.
    """
    numbers = [f.j for f in robot.frames]
    for k, loop in enumerate(robot.loops):
        where = ("loops", k)
        for name, j in (("cut", loop.cut), ("twin", loop.twin)):
            if j not in numbers:
                raise DescriptionError(
                    f"loop {k + 1}: {name} frame {j} does not exist; frames are 1 to {len(numbers)}",
                    path=(*where, name),
                )
        cut, twin = robot.frame(loop.cut), robot.frame(loop.twin)
        if twin.sigma != FIXED:
            raise DescriptionError(
                f"loop {k + 1}: twin frame {loop.twin} has sigma {twin.sigma}; expected 2 (fixed "
                f"on its link){'; exchange cut and twin' if cut.sigma == FIXED else ''}",
                path=(*where, "twin"),
            )
        if cut.mu:
            raise DescriptionError(
                f"loop {k + 1}: cut joint {loop.cut} is actuated; cut the loop at a passive joint (mu: 0)",
                path=(*where, "cut"),
            )
    passive = list(robot.passive)
    for j, e in robot.constraints.items():
        place = ("constraints", f"q{j}")
        if j not in passive:
            raise DescriptionError(
                f"constraint on q{j}: joint {j} is not a passive joint (passive joints: "
                f"{passive}); remove the constraint, or set mu: 0 (passive)",
                path=place,
            )
        _check_declared(e, place, [*robot.constants, *(f"q{i}" for i in robot.moving)])
        _check_finite(e, place, robot.constants)
    if passive and not robot.loops and not robot.constraints:
        raise DescriptionError(
            f"joints {passive} are passive, but there is no loop and no constraint; set mu: 1 "
            "(actuated), or add a loop or a constraint",
            path=("frames", passive[0], "mu"),
        )


def _check_drives(robot: Any) -> None:
    """Check the drives: one row per actuated joint, and an invertible matrix of gear ratios."""
    drives, n = robot.drives, len(robot.joints)
    if drives is None:
        return
    shape = [len(row) for row in drives.ratio]
    if shape != [n] * n:
        raise DescriptionError(
            f"drives: ratio has rows with {shape} numbers; expected {n} rows with {n} numbers, one row per actuated joint",
            path=("drives", "ratio"),
        )
    import numpy as np

    if np.linalg.matrix_rank(drives.ratio) < n:
        raise DescriptionError(
            "drives: ratio is singular; expected an invertible matrix, so that motor positions determine joint positions",
            path=("drives", "ratio"),
        )
    for name, row in (("offset", drives.offset), ("torque_constant", drives.torque_constant)):
        if row is not None and len(row) != n:
            raise DescriptionError(
                f"drives: {name} has {len(row)} entries; expected {n}, one per actuated joint",
                path=("drives", name),
            )


def _check_limits(robot: Any) -> None:
    """Check the joint limits: one entry per actuated joint, lower bounds below upper bounds."""
    n = len(robot.joints)
    for name, row in robot.limits.items():
        if name not in ("q", "qd", "qdd", "tau") or len(row) != n:
            raise DescriptionError(
                f"limits: {name} has {len(row)} entries; expected the keys q, qd, qdd, tau with {n} "
                "entries each, one per actuated joint",
                path=("limits", name),
            )
        for i, entry in enumerate(row):
            low, high = entry if isinstance(entry, tuple) else (0.0, entry)
            if not low < high and (name, entry) != ("tau", 0.0):
                raise DescriptionError(
                    f"limits: {name} of joint {robot.joints[i]} is {entry}; expected lower < "
                    "upper, or a positive number; for tau of a joint without a motor write 0",
                    path=("limits", name, i),
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
