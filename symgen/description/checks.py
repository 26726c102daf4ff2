"""What makes a table of frames, elements and loops a mechanism. Each check takes the fields it reads and raises DescriptionError with their path."""

from __future__ import annotations

import builtins
import keyword
import re
from collections.abc import Collection, Mapping, Sequence

from symgen.description.advice import degrees_advice
from symgen.description.expression import ONE, Call, Expression
from symgen.description.forms import determinant, moves
from symgen.description.parts import (
    ANGLES,
    DIRECTIONS,
    FIXED,
    GEOMETRY,
    INERTIAL,
    KINDS,
    PRISMATIC,
    REVOLUTE,
    Drives,
    Element,
    Form,
    Frame,
    Limits,
    Loop,
    Path,
    Row,
)
from symgen.errors import DescriptionError

IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}\Z")
ARGUMENTS = {"q", "qd", "qdd", "tau", "X", "D", "out", "frame", "standard", "np", "pi", "N", "B", "A", "array_namespace", *dir(builtins)}
MARKS = ("\\", '"""', "*/", "/*", "??/")  # none of which a docstring, a comment of C (the last is \\ there) or LaTeX may meet
LONGEST_LABEL = 60
RESERVED = {"CON", "PRN", "AUX", "NUL", *(f"{device}{k}" for device in ("COM", "LPT") for k in range(10))}


def check_identifier(name: str, path: Path) -> None:
    """Refuse what is no name in emitted code."""
    if not IDENTIFIER.match(name) or keyword.iskeyword(name):
        what = "is a word of Python; choose another"
        if not keyword.iskeyword(name):
            what = "is no identifier; use a letter followed by letters, digits or _ (at most 40)"
        raise DescriptionError(f"{_dotted(path[:-1] or path)}: {name!r} {what}", path=path)


def check_texts(name: str, texts: Mapping[str, str]) -> None:
    """The name, and texts that end up in docstrings and comments of emitted files: nothing in them may close one."""
    check_identifier(name, ("name",))
    if name.upper() in RESERVED:
        raise DescriptionError(f"{name!r} names a device on Windows, where no file can be called so; choose another", path=("name",))
    for key, text in texts.items():
        if not text.isprintable() or len(text) > 1000 or text.endswith('"') or any(mark in text for mark in MARKS):
            raise DescriptionError(
                f"{key} {text[:60]!r}: expected one line of printable text, at most 1000 characters, without \\, triple or final quotes, /*, */ or ??/",
                path=(key,),
            )


def check_labels(labels: Mapping[int, str], frames: Collection[int]) -> None:
    """Labels name frames that exist, each by another name: one line of printable text that no docstring or comment of emitted files minds."""
    used: dict[str, int] = {}
    for j, text in labels.items():
        if j not in frames:
            raise DescriptionError(f"labels: frame {j} does not exist; frames are 1 to {len(frames)}", path=("labels", j))
        if not is_label(text):
            raise DescriptionError(
                f"labels.{j}: found {text[:LONGEST_LABEL]!r}; expected 1 to {LONGEST_LABEL} printable characters without \\, quotes, /* or */",
                path=("labels", j),
            )
        if text in used:
            raise DescriptionError(f"labels.{j}: {text!r} names frame {used[text]} already; names differ", path=("labels", j))
        used[text] = j


def is_label(text: str) -> bool:
    """Whether `text` may name a joint."""
    return 0 < len(text) <= LONGEST_LABEL and text.isprintable() and not any(mark in text for mark in (*MARKS, '"', "'"))


def check_tree(frames: Sequence[Frame]) -> None:
    """Frames are numbered without gaps, every chain of antecedents ends at the base, some joint is actuated."""
    numbers = [f.j for f in frames]
    if not numbers:
        raise DescriptionError("no frames; a robot has at least frame 1", path=("frames",))
    for k, j in enumerate(numbers, start=1):
        if j != k:
            what = f"frame {j} is given twice" if j in numbers[: k - 1] else f"frame {k} is missing (found {numbers})"
            raise DescriptionError(f"{what}; frames are numbered 1, 2, 3 ... without gaps", path=("frames", j))
    for f in frames:
        where = ("frames", f.j)
        if f.sigma not in (REVOLUTE, PRISMATIC, FIXED):
            raise DescriptionError(f"joint {f.j}: sigma = {f.sigma}; expected 0 revolute, 1 prismatic or 2 fixed", path=(*where, "sigma"))
        if f.mu not in (0, 1) or (f.mu and f.sigma == FIXED):
            raise DescriptionError(
                f"joint {f.j}: mu = {f.mu}; expected 1 actuated or 0 passive, and 0 for a fixed frame", path=(*where, "mu")
            )
        if f.ant == f.j or f.ant > len(numbers) or f.ant < 0:
            raise DescriptionError(f"frame {f.j}: ant = {f.ant}; expected an earlier frame, 0 for the base", path=(*where, "ant"))
        chain, i = {f.j}, f.ant
        while i:
            if i in chain:
                raise DescriptionError(
                    f"frames {sorted(chain)} are each other's antecedents (a cycle); every chain of `ant` must end at 0",
                    path=(*where, "ant"),
                )
            chain.add(i)
            i = frames[i - 1].ant
        if f.ant > f.j:
            raise DescriptionError(f"frame {f.j}: ant = {f.ant} comes later; number frames from the base outward", path=(*where, "ant"))
    if not any(f.mu for f in frames):
        raise DescriptionError("no actuated joint; set mu: 1 on a revolute or prismatic frame", path=("frames",))


def check_names(elements: Sequence[Element], constants: Collection[str], parameters: Sequence[str]) -> None:
    """Families, constants and parameters have names of their own."""
    families = [e.family for e in elements]
    for family in families:
        check_identifier(family, ("elements", family))
        if family in INERTIAL or families.count(family) > 1 or family[-1].isdigit() or family.endswith("_"):
            raise DescriptionError(
                f"element {family!r}: give each family a name of its own, not an inertial parameter's, that does not end in a digit or _",
                path=("elements", family),
            )
    names = set(parameters)
    taken = names | {n + "R" for n in names} | ARGUMENTS
    for name in constants:
        check_identifier(name, ("constants", name))
        if name in taken or re.fullmatch(r"(q|QP|QDP)\d+", name):
            raise DescriptionError(
                f"constant {name!r} is the name of a parameter, joint, argument or builtin; choose another", path=("constants", name)
            )
    if len(names) != len(parameters):
        double = sorted(n for n in names if parameters.count(n) > 1)
        raise DescriptionError(f"parameters {double} would be named twice; rename an element family", path=("elements",))


def check_geometry(frames: Sequence[Frame], gravity: Sequence[Expression], constants: Mapping[str, float]) -> None:
    """Expressions of declared constants; q_j once, where the joint moves."""
    for k, component in enumerate(gravity):
        _check_expression(component, ("gravity", k), constants)
    for f in frames:
        for name in GEOMETRY:
            where = ("frames", f.j, name)
            e: Expression = getattr(f, name)
            variable = (name, f.sigma) in {("theta", REVOLUTE), ("r", PRISMATIC)}
            if variable and (e.coefficient(f.q) != ONE or moves(e - Expression.symbol(f.q))):
                raise DescriptionError(
                    f"frame {f.j}: {name} = {e}; expected {f.q} once, as {f.q} or {f.q} + constant{_other_sigma(f)}", path=where
                )
            if not variable and moves(e):
                raise DescriptionError(
                    f"frame {f.j}: {name} = {e}; a joint position stands in theta if sigma is 0, in r if sigma is 1, nowhere else",
                    path=where,
                )
            _check_expression(e, where, {*constants, f.q} if variable else constants, angle=name in ANGLES)
            if name in ANGLES and (advice := degrees_advice(f.theta0 if name == "theta" else e, dict(constants))):
                raise DescriptionError(f"frame {f.j}: {name} = {e}: {advice}", path=where)


def _check_expression(e: Expression, path: Path, symbols: Collection[str], *, angle: bool = False) -> None:
    _check_declared(e, path, symbols)
    _check_exact(e, path, angle=angle)


def _check_declared(e: Expression, path: Path, symbols: Collection[str]) -> None:
    if unknown := e.symbols - set(symbols):
        declared = ", ".join(name for name in symbols if not re.fullmatch(r"q\d+", name)) or "none"
        raise DescriptionError(
            f"undeclared symbol {', '.join(sorted(unknown))}; declare it under constants (declared: {declared})", path=path
        )


def _check_exact(e: Expression, path: Path, *, angle: bool) -> None:
    """Refuse what exact arithmetic has no numbers for: pi outside an angle, functions inside one; a constant may have such a value."""
    for a in e.atoms:
        if isinstance(a, Call) and not angle:
            _check_exact(a.argument, path, angle=a.function in ("cos", "sin"))
        elif isinstance(a, Call) or (a == "pi" and not angle):
            problem = f"{a} in an angle" if angle else "pi outside an angle"
            raise DescriptionError(f"{_dotted(path)}: {problem}; declare a constant of that value and write its name", path=path)


def _dotted(path: Path) -> str:
    return ".".join(str(key) for key in path)


def _other_sigma(f: Frame) -> str:
    """What sigma says, where the row reads as one of another joint."""
    if moves(f.theta) or (f.sigma == PRISMATIC and moves(f.r)):
        return ""
    if f.sigma == REVOLUTE:
        return f"; sigma: 0 is revolute; a prismatic joint has sigma: 1 and r: {f.q}, a fixed frame (a tool) sigma: 2"
    return f"; sigma: 1 is prismatic; a revolute joint has sigma: 0 and theta: {f.q}, a fixed frame (a tool) sigma: 2"


def check_element(e: Element, frames: Collection[int], moving: Sequence[int], constants: Mapping[str, float]) -> None:
    """Kind, direction, and tables along joints of the robot."""
    where: Path = ("elements", e.family)
    both = sorted(set(e.along) & set(e.form))
    problems = (
        (e.kind not in KINDS, f"kind {e.kind!r}; expected one of {', '.join(KINDS)}", "kind"),
        (
            e.when is not None and (e.when not in DIRECTIONS or e.kind not in ("viscous", "coulomb")),
            f"when {e.when!r}; viscous and coulomb elements take positive or negative",
            "when",
        ),
        (not e.along and not e.form, "acts along nothing; give `along` or `form`", ""),
        (e.form and e.kind in ("coulomb", "offset"), f"a {e.kind} element has no quadratic form; use `along`", "form"),
        (e.form and e.when, "`when` needs a direction of motion, hence `along`, not `form`", "when"),
        (both, f"keys {both} in both along and form", "form"),
    )
    for wrong, message, key in problems:
        if wrong:
            raise DescriptionError(f"element {e.family}: {message}", path=(*where, key) if key else where)
    tables: tuple[tuple[str, Mapping[int, Row | Form]], ...] = (("along", e.along), ("form", e.form))
    for part, table in tables:
        for j, coefficients in table.items():
            place = (*where, part, j)
            if j not in frames:
                raise DescriptionError(f"element {e.family}: frame {j} does not exist", path=place)
            for index, c in coefficients.items():
                for i in (index,) if isinstance(index, int) else index:
                    if i not in moving:
                        raise DescriptionError(
                            f"element {e.family}{j}: q{i} is not a joint of this robot (joints {list(moving)})", path=place
                        )
                _check_expression(c, place, constants)
            if not any(coefficients.values()):
                raise DescriptionError(f"element {e.family}{j}: zero along every joint", path=place)


def check_loops(
    frames: Mapping[int, Frame],
    loops: Sequence[Loop],
    constraints: Mapping[int, Expression],
    passive: Sequence[int],
    symbols: Collection[str],
) -> None:
    """Cut joints are passive, twins fixed, constraints those of passive joints, and passive joints have a relation; `symbols` of constraints."""
    for k, loop in enumerate(loops):
        where = ("loops", k)
        for name in ("cut", "twin"):
            if getattr(loop, name) not in frames:
                raise DescriptionError(f"loop {k + 1}: {name} frame {getattr(loop, name)} does not exist", path=(*where, name))
        cut, twin = frames[loop.cut], frames[loop.twin]
        if twin.sigma != FIXED:
            raise DescriptionError(
                f"loop {k + 1}: twin frame {loop.twin} has sigma {twin.sigma}; expected 2 (fixed on its link)"
                f"{'; cut and twin are exchanged' if cut.sigma == FIXED else ''}",
                path=(*where, "twin"),
            )
        if cut.mu:
            raise DescriptionError(f"loop {k + 1}: cut joint {loop.cut} is actuated; cut a passive joint (mu: 0)", path=(*where, "cut"))
    for j, e in constraints.items():
        place = ("constraints", f"q{j}")
        if j not in passive:
            raise DescriptionError(f"constraint on q{j}: not a passive joint (passive: {list(passive)})", path=place)
        _check_declared(e, place, symbols)
    if passive and not loops and not constraints:
        raise DescriptionError(
            f"joints {list(passive)} are passive but there is no loop and no constraint; set mu: 1 or add one",
            path=("frames", passive[0], "mu"),
        )


def check_drives(drives: Drives, n: int) -> None:
    """Matrices and rows of n actuated joints, a ratio that can be inverted."""
    shape = [len(row) for row in drives.ratio]
    if shape != [n] * n:
        raise DescriptionError(
            f"drives: ratio has rows of {shape}; expected {n} rows of {n}, one per actuated joint", path=("drives", "ratio")
        )
    if determinant(drives.ratio) == 0:
        raise DescriptionError("drives: ratio is singular; motor positions must determine the joint positions", path=("drives", "ratio"))
    for name in ("offset", "torque_constant"):
        if (given := len(getattr(drives, name))) != n:
            raise DescriptionError(f"drives: {name} has {given} entries; expected {n}", path=("drives", name))


def check_limits(limits: Limits, joints: Sequence[int]) -> None:
    """Rows of one entry per actuated joint, lower below upper."""
    n = len(joints)
    for name, row in limits.items():
        if name not in ("q", "qd", "qdd", "tau") or len(row) != n:
            raise DescriptionError(
                f"limits: {name} has {len(row)} entries; expected q, qd, qdd, tau with {n} numbers each", path=("limits", name)
            )
        for i, entry in enumerate(row):
            low, high = entry if isinstance(entry, tuple) else (0.0, entry)
            if not low < high:
                raise DescriptionError(
                    f"limits: {name} of joint {joints[i]} is {entry}; expected lower < upper, or a positive number",
                    path=("limits", name, i),
                )


def check_values(robot: str, values: Collection[str], parameters: Sequence[str], frames: Collection[int], links: Sequence[int]) -> None:
    """Values are those of standard parameters."""
    for name in values:
        if name not in parameters:
            advice = _nearest(name, parameters, frames, links)
            raise DescriptionError(f"values: {name!r} is not a standard parameter of {robot}{advice}", path=("values", name))


def _nearest(name: str, parameters: Sequence[str], frames: Collection[int], links: Sequence[int]) -> str:
    """Where a name under `values` was probably meant to lead."""
    if name.endswith("R") and name[:-1] in parameters:
        return f"; base parameters (...R) are not given, standard ones are: {name[:-1]}"
    number = re.search(r"\d+\Z", name)
    j = int(number.group()) if number else 0
    if name.removesuffix(str(j)) in INERTIAL and j in frames:
        return f"; frame {j} is massless or cut" if j not in links else ""
    own = [p for p in parameters if p.endswith(str(j))] if j else []
    return f"; expected names such as {', '.join(own or parameters[:12])}"
