"""What a robot is: frames of Khalil and Kleinfinger, elements on its joints, loops, and nothing about how it is derived.

Modified Denavit-Hartenberg [KK86]: frame j, antecedent i = ant(j), sigma_j = 0 revolute, 1 prismatic, 2 fixed,

    iTj = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r) .

Signs, here and nowhere else. `gravity` is the acceleration of gravity in frame 0 (m/s^2); a body at rest with z0 up has
gravity (0, 0, -g). Joint torque Gamma is what the actuator delivers, so friction enters with a plus:
Gamma = A qdd + H + FV qd + FS sign(qd) + OFFSET. Inertia XX..ZZ are the tensor elements (XY = -integral x y dm) about the origin
of the link frame, MX MY MZ = M (centre of mass). SI and rad.

[KK86] W. Khalil, J.-F. Kleinfinger, A new geometric notation for open and closed-loop robots, ICRA 1986.
"""

from __future__ import annotations

import builtins
import keyword
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

from symgen.description.advice import degrees_advice
from symgen.description.expression import ONE, ZERO, Call, Expression
from symgen.description.forms import determinant, form_of, moves, row_of
from symgen.errors import DescriptionError

REVOLUTE, PRISMATIC, FIXED = 0, 1, 2
INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
JOINT_FAMILIES = ("Ia", "FV", "FS", "OFFSET")  # the rest of eq. (4), link by link
KINDS = ("inertia", "viscous", "coulomb", "offset", "stiffness")
DIRECTIONS = ("positive", "negative")
IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}\Z")

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Frame:
    """One row of the table: frame j on link j, moved by joint j against frame `ant`. Lengths in m, angles in rad."""

    j: int
    ant: int
    sigma: int
    mu: int
    gamma: Expression
    b: Expression
    alpha: Expression
    d: Expression
    theta: Expression
    r: Expression

    @property
    def q(self) -> str:
        """Name of the joint variable."""
        return f"q{self.j}"

    @property
    def theta0(self) -> Expression:
        """theta_j without q_j."""
        return self.theta - Expression.symbol(self.q) if self.sigma == REVOLUTE else self.theta

    @property
    def r0(self) -> Expression:
        """r_j without q_j."""
        return self.r - Expression.symbol(self.q) if self.sigma == PRISMATIC else self.r


Row = Mapping[int, Expression]  # {j: G_j}: s = sum_j G_j q_j, the G_j constant
Form = Mapping[tuple[int, int], Expression]  # {(i, j): B_ij}, symmetric, the B_ij constant


@dataclass(frozen=True)
class Element:
    """Inertia, friction, offset or spring on the joint coordinates; one parameter per key.

    along {j: G}:  s = G q,  Gamma += G' (c sdd | c sd | c sign(sd) | c | c s)   for inertia, viscous, coulomb, offset, stiffness
    form  {j: B}:  Gamma += c B qdd | c B qd | c B q                             for inertia, viscous, stiffness
    `when` restricts viscous and coulomb to motion along s in one direction. Parameter c of key j is called family + j.
    """

    family: str
    kind: str
    along: Mapping[int, Row]
    form: Mapping[int, Form]
    when: str | None = None

    @property
    def keys(self) -> tuple[int, ...]:
        return tuple(sorted({*self.along, *self.form}))


@dataclass(frozen=True)
class Loop:
    """Frame `twin` (sigma 2) coincides with the cut frame; `start` picks the assembly mode of a general loop."""

    cut: int
    twin: int
    start: Mapping[int, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Drives:
    """qm = ratio (q - offset), tau = ratio' (torque_constant * u); for the runtime only. Offsets in rad or m."""

    ratio: tuple[tuple[float, ...], ...]
    offset: tuple[float, ...]
    torque_constant: tuple[float, ...]


@dataclass(frozen=True)
class Robot:
    """A mechanism, complete and checked; raises DescriptionError (with the path of the field) if it is none.

    `limits`, one entry per actuated joint: q as (lower, upper), qd, qdd and tau as largest absolute values.
    """

    name: str
    frames: tuple[Frame, ...]
    gravity: tuple[Expression, Expression, Expression]
    title: str = ""
    source: str = ""
    constants: Mapping[str, float] = field(default_factory=dict)
    elements: tuple[Element, ...] = ()
    loops: tuple[Loop, ...] = ()
    constraints: Mapping[int, Expression] = field(default_factory=dict)
    massless: frozenset[int] = frozenset()
    drives: Drives | None = None
    limits: Mapping[str, tuple[float, ...] | tuple[tuple[float, float], ...]] = field(default_factory=dict)
    values: Mapping[str, float] = field(default_factory=dict)
    file: str = ""  # name of the file, without its folder
    sha256: str = ""  # of its bytes

    def __post_init__(self) -> None:
        for name in ("constants", "constraints", "limits", "values"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        _check(self)

    def __hash__(self) -> int:
        return hash((self.name, self.frames, self.gravity, self.sha256))

    def frame(self, j: int) -> Frame:
        return self._by_number[j]

    @cached_property
    def _by_number(self) -> dict[int, Frame]:
        return {f.j: f for f in self.frames}

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Numbers of the joints that move (sigma 0 or 1), the cut ones included."""
        return tuple(f.j for f in self.frames if f.sigma != FIXED)

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Numbers of the actuated joints: the order of q, qd, qdd, Gamma."""
        return tuple(f.j for f in self.frames if f.mu)

    @cached_property
    def passive(self) -> tuple[int, ...]:
        return tuple(j for j in self.moving if not self.frame(j).mu)

    @cached_property
    def cut(self) -> frozenset[int]:
        """Frames without a link: the cut joint of each loop and its twin."""
        return frozenset(k for loop in self.loops for k in (loop.cut, loop.twin))

    @cached_property
    def links(self) -> tuple[int, ...]:
        """Numbers of the links that carry inertial parameters."""
        return tuple(f.j for f in self.frames if f.j not in self.cut and f.j not in self.massless)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of the standard parameters in the order of eq. (4), link by link, then further families in file order."""
        by_family = {e.family: e for e in self.elements}
        names: list[str] = []
        for f in self.frames:
            if f.j in self.links:
                names += [parameter(p, f.j) for p in INERTIAL]
            names += [parameter(p, f.j) for p in JOINT_FAMILIES if p in by_family and f.j in by_family[p].keys]
        for e in self.elements:
            if e.family not in JOINT_FAMILIES:
                names += [parameter(e.family, j) for j in e.keys]
        return tuple(names)

    def children(self, i: int) -> tuple[int, ...]:
        return tuple(f.j for f in self.frames if f.ant == i)

    def path(self, j: int) -> tuple[int, ...]:
        """Frames from the base to j, j included."""
        frames: list[int] = []
        while j:
            frames.insert(0, j)
            j = self.frame(j).ant
        return tuple(frames)


def parameter(family: str, j: int) -> str:
    """Name of a standard parameter: family + link, e.g. XX2."""
    return f"{family}{j}"


# --- checks -----------------------------------------------------------------------------------------------------------

ARGUMENTS = {"q", "qd", "qdd", "tau", "X", "D", "out", "frame", "standard", "np", "pi", "N", "B", "A", "array_namespace", *dir(builtins)}
MARKS = ("\\", '"""', "*/", "/*", "??/")  # none of which a docstring, a comment of C (the last is \\ there) or LaTeX may meet
RESERVED = {"CON", "PRN", "AUX", "NUL", *(f"{device}{k}" for device in ("COM", "LPT") for k in range(10))}


def _check(robot: Robot) -> None:
    check_identifier(robot.name, ("name",))
    if robot.name.upper() in RESERVED:
        raise DescriptionError(f"{robot.name!r} names a device on Windows, where no file can be called so; choose another", path=("name",))
    for name in ("title", "source", "file"):
        _check_text(getattr(robot, name), name)
    _check_tree(robot)
    _check_names(robot)
    _check_geometry(robot)
    for e in robot.elements:
        _check_element(robot, e)
    _check_loops(robot)
    _check_tables(robot)


def check_identifier(name: str, path: Path) -> None:
    if not IDENTIFIER.match(name) or keyword.iskeyword(name):
        what = (
            "is a word of Python; choose another"
            if keyword.iskeyword(name)
            else "is no identifier; use a letter followed by letters, digits or _ (at most 40)"
        )
        where = ".".join(str(key) for key in path[:-1] or path)
        raise DescriptionError(f"{where}: {name!r} {what}", path=path)


def _check_text(text: str, name: str) -> None:
    """Titles end up in docstrings and comments of emitted files: nothing in them may close one."""
    if not text.isprintable() or len(text) > 1000 or text.endswith('"') or any(mark in text for mark in MARKS):
        raise DescriptionError(
            f"{name} {text[:60]!r}: expected one line of printable text, at most 1000 characters, without \\, triple or final quotes, /*, */ or ??/",
            path=(name,),
        )


def _check_tree(robot: Robot) -> None:
    numbers = [f.j for f in robot.frames]
    if not numbers:
        raise DescriptionError("no frames; a robot has at least frame 1", path=("frames",))
    for k, j in enumerate(numbers, start=1):
        if j != k:
            what = f"frame {j} is given twice" if j in numbers[: k - 1] else f"frame {k} is missing (found {numbers})"
            raise DescriptionError(f"{what}; frames are numbered 1, 2, 3 ... without gaps", path=("frames", j))
    for f in robot.frames:
        where = ("frames", f.j)
        if f.sigma not in (REVOLUTE, PRISMATIC, FIXED):
            raise DescriptionError(f"joint {f.j}: sigma = {f.sigma}; expected 0 revolute, 1 prismatic or 2 fixed", path=(*where, "sigma"))
        if f.mu not in (0, 1) or (f.mu and f.sigma == FIXED):
            raise DescriptionError(
                f"joint {f.j}: mu = {f.mu}; expected 1 actuated or 0 passive, and 0 for a fixed frame", path=(*where, "mu")
            )
        if f.ant == f.j or f.ant > len(numbers) or f.ant < 0:
            raise DescriptionError(f"frame {f.j}: ant = {f.ant}; expected an earlier frame, 0 for the base", path=(*where, "ant"))
        seen, i = {f.j}, f.ant
        while i:
            if i in seen:
                raise DescriptionError(
                    f"frames {sorted(seen)} are each other's antecedents (a cycle); every chain of `ant` must end at 0",
                    path=(*where, "ant"),
                )
            seen.add(i)
            i = robot.frames[i - 1].ant
        if f.ant > f.j:
            raise DescriptionError(f"frame {f.j}: ant = {f.ant} comes later; number frames from the base outward", path=(*where, "ant"))
    if not robot.joints:
        raise DescriptionError("no actuated joint; set mu: 1 on a revolute or prismatic frame", path=("frames",))


def _check_names(robot: Robot) -> None:
    families = [e.family for e in robot.elements]
    for family in families:
        check_identifier(family, ("elements", family))
        if family in INERTIAL or families.count(family) > 1 or family[-1].isdigit() or family.endswith("_"):
            raise DescriptionError(
                f"element {family!r}: give each family a name of its own, not an inertial parameter's, that does not end in a digit or _",
                path=("elements", family),
            )
    names = set(robot.parameters)
    taken = names | {n + "R" for n in names} | ARGUMENTS
    for name in robot.constants:
        check_identifier(name, ("constants", name))
        if name in taken or re.fullmatch(r"(q|QP|QDP)\d+", name):
            raise DescriptionError(
                f"constant {name!r} is the name of a parameter, joint, argument or builtin; choose another", path=("constants", name)
            )
    if len(names) != len(robot.parameters):
        double = sorted(n for n in names if robot.parameters.count(n) > 1)
        raise DescriptionError(f"parameters {double} would be named twice; rename an element family", path=("elements",))


def _declared(robot: Robot, e: Expression, path: Path, allowed: set[str] = frozenset()) -> None:  # type: ignore[assignment]
    unknown = e.symbols - set(robot.constants) - set(allowed)
    if unknown:
        raise DescriptionError(
            f"undeclared symbol {', '.join(sorted(unknown))}; declare it under constants (declared: {', '.join(robot.constants) or 'none'})",
            path=path,
        )


def _exact(e: Expression, path: Path, *, angle: bool = False) -> None:
    """Refuse what exact arithmetic has no numbers for: pi outside an angle, functions inside one; a constant may have such a value."""
    for a in e.atoms:
        if isinstance(a, Call) and angle:
            problem = f"{a} in an angle"
        elif isinstance(a, Call):
            _exact(a.argument, path, angle=a.function in ("cos", "sin"))
            continue
        elif a == "pi" and not angle:
            problem = "pi outside an angle"
        else:
            continue
        raise DescriptionError(
            f"{'.'.join(str(key) for key in path)}: {problem}; declare a constant of that value and write its name", path=path
        )


def _check_geometry(robot: Robot) -> None:
    for k, component in enumerate(robot.gravity):
        _declared(robot, component, ("gravity", k))
        _exact(component, ("gravity", k))
    for f in robot.frames:
        for name in ("gamma", "b", "alpha", "d", "theta", "r"):
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
            _declared(robot, e, where, {f.q} if variable else set())
            angle = name in ("gamma", "alpha", "theta")
            _exact(e, where, angle=angle)
            if angle and (advice := degrees_advice(f.theta0 if name == "theta" else e, dict(robot.constants))):
                raise DescriptionError(f"frame {f.j}: {name} = {e}: {advice}", path=where)


def _other_sigma(f: Frame) -> str:
    """What sigma says, where the row reads as one of another joint."""
    if moves(f.theta) or (f.sigma == PRISMATIC and moves(f.r)):
        return ""
    if f.sigma == REVOLUTE:
        return f"; sigma: 0 is revolute; a prismatic joint has sigma: 1 and r: {f.q}, a fixed frame (a tool) sigma: 2"
    return f"; sigma: 1 is prismatic; a revolute joint has sigma: 0 and theta: {f.q}, a fixed frame (a tool) sigma: 2"


def _check_element(robot: Robot, e: Element) -> None:
    where: Path = ("elements", e.family)
    if e.kind not in KINDS:
        raise DescriptionError(f"element {e.family}: kind {e.kind!r}; expected one of {', '.join(KINDS)}", path=(*where, "kind"))
    if e.when is not None and (e.when not in DIRECTIONS or e.kind not in ("viscous", "coulomb")):
        raise DescriptionError(
            f"element {e.family}: when {e.when!r}; viscous and coulomb elements take positive or negative", path=(*where, "when")
        )
    if not e.along and not e.form:
        raise DescriptionError(f"element {e.family}: acts along nothing; give `along` or `form`", path=where)
    if e.form and e.kind in ("coulomb", "offset"):
        raise DescriptionError(f"element {e.family}: a {e.kind} element has no quadratic form; use `along`", path=(*where, "form"))
    if e.form and e.when:
        raise DescriptionError(f"element {e.family}: `when` needs a direction of motion, hence `along`, not `form`", path=(*where, "when"))
    if set(e.along) & set(e.form):
        raise DescriptionError(
            f"element {e.family}: keys {sorted(set(e.along) & set(e.form))} in both along and form", path=(*where, "form")
        )
    tables: tuple[tuple[str, Mapping[int, Row | Form]], ...] = (("along", e.along), ("form", e.form))
    for part, table in tables:
        for j, coefficients in table.items():
            place = (*where, part, j)
            if j not in robot._by_number:
                raise DescriptionError(f"element {e.family}: frame {j} does not exist", path=place)
            for index, c in coefficients.items():
                for i in (index,) if isinstance(index, int) else index:
                    if i not in robot.moving:
                        raise DescriptionError(
                            f"element {e.family}{j}: q{i} is not a joint of this robot (joints {list(robot.moving)})", path=place
                        )
                _declared(robot, c, place)
                _exact(c, place)
            if not any(coefficients.values()):
                raise DescriptionError(f"element {e.family}{j}: zero along every joint", path=place)


def _check_loops(robot: Robot) -> None:
    for k, loop in enumerate(robot.loops):
        where = ("loops", k)
        for name in ("cut", "twin"):
            if getattr(loop, name) not in robot._by_number:
                raise DescriptionError(f"loop {k + 1}: {name} frame {getattr(loop, name)} does not exist", path=(*where, name))
        if robot.frame(loop.twin).sigma != FIXED:
            raise DescriptionError(
                f"loop {k + 1}: twin frame {loop.twin} has sigma {robot.frame(loop.twin).sigma}; expected 2 (fixed on its link)"
                f"{'; cut and twin are exchanged' if robot.frame(loop.cut).sigma == FIXED else ''}",
                path=(*where, "twin"),
            )
        if robot.frame(loop.cut).mu:
            raise DescriptionError(f"loop {k + 1}: cut joint {loop.cut} is actuated; cut a passive joint (mu: 0)", path=(*where, "cut"))
    for j, e in robot.constraints.items():
        place = ("constraints", f"q{j}")
        if j not in robot.passive:
            raise DescriptionError(f"constraint on q{j}: not a passive joint (passive: {list(robot.passive)})", path=place)
        _declared(robot, e, place, {f"q{i}" for i in robot.moving})
    if robot.passive and not robot.loops and not robot.constraints:
        raise DescriptionError(
            f"joints {list(robot.passive)} are passive but there is no loop and no constraint; set mu: 1 or add one",
            path=("frames", robot.passive[0], "mu"),
        )


def _check_tables(robot: Robot) -> None:
    n = len(robot.joints)
    if robot.drives is not None:
        shape = [len(row) for row in robot.drives.ratio]
        if shape != [n] * n:
            raise DescriptionError(
                f"drives: ratio has rows of {shape}; expected {n} rows of {n}, one per actuated joint", path=("drives", "ratio")
            )
        if determinant(robot.drives.ratio) == 0:
            raise DescriptionError(
                "drives: ratio is singular; motor positions must determine the joint positions", path=("drives", "ratio")
            )
        for name in ("offset", "torque_constant"):
            if len(getattr(robot.drives, name)) != n:
                raise DescriptionError(
                    f"drives: {name} has {len(getattr(robot.drives, name))} entries; expected {n}", path=("drives", name)
                )
    for name, row in robot.limits.items():
        if name not in ("q", "qd", "qdd", "tau") or len(row) != n:
            raise DescriptionError(
                f"limits: {name} has {len(row)} entries; expected q, qd, qdd, tau with {n} numbers each", path=("limits", name)
            )
        for i, entry in enumerate(row):
            if (low_high := entry if isinstance(entry, tuple) else (0.0, entry)) and not low_high[0] < low_high[1]:
                raise DescriptionError(
                    f"limits: {name} of joint {robot.joints[i]} is {entry}; expected lower < upper, or a positive number",
                    path=("limits", name, i),
                )
    for name in robot.values:
        if name not in robot.parameters:
            raise DescriptionError(
                f"values: {name!r} is not a standard parameter of {robot.name}{_nearest(robot, name)}", path=("values", name)
            )


def _nearest(robot: Robot, name: str) -> str:
    """Where a name under `values` was probably meant to lead."""
    if name.endswith("R") and name[:-1] in robot.parameters:
        return f"; base parameters (...R) are not given, standard ones are: {name[:-1]}"
    number = re.search(r"\d+\Z", name)
    j = int(number.group()) if number else 0
    if name.removesuffix(str(j)) in INERTIAL and j in robot._by_number:
        return f"; frame {j} is massless or cut" if j not in robot.links else ""
    own = [p for p in robot.parameters if p.endswith(str(j))] if j else []
    return f"; expected names such as {', '.join(own or robot.parameters[:12])}"


__all__ = [
    "DIRECTIONS",
    "FIXED",
    "INERTIAL",
    "JOINT_FAMILIES",
    "KINDS",
    "ONE",
    "PRISMATIC",
    "REVOLUTE",
    "ZERO",
    "Drives",
    "Element",
    "Frame",
    "Loop",
    "Robot",
    "form_of",
    "parameter",
    "row_of",
]
