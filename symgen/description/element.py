"""Elements: torques on the joints that do not come from links, such as friction or springs.

For each key j, an element has one standard parameter c, named family + key (for instance FV3):

    along {j: G}:  s = G q,  Gamma += G' c law(s, sd, sdd)
    form  {j: B}:  Gamma += c B qdd | c B qd | c B q

The law of each kind is an expression in the table `KINDS`, in which q, qd, qdd mean s, sd, sdd. A
new kind is one entry of this table (docs/contributing.md). A column is an element with a law of the
user, in s, sd, q1, qd1 ... of any joints, constants and scalars. This law is a torque, or an energy
U with Gamma += c dU/dq. A form is possible only for the laws qdd, qd and q. If `when` is given, a
viscous or coulomb element acts only in motion along s in this direction. In a law, channel.NAME is
the constant NAME as a function of time, and tau_model is the torque that the rest of the model
transmits at the joint.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass

from symgen.description.expression import ONE, ZERO, Atom, Call, Expression, Number
from symgen.description.fields import (
    CONFIG,
    UNWRITTEN,
    Numeric,
    Path,
    Problem,
    Text,
    Whole,
    Written,
)
from symgen.description.grammar import LAWS, parse
from symgen.description.parts import (
    DIRECTIONS,
    GEOMETRY,
    Form,
    Row,
    form_of,
    parameter,
    reduced,
    rows,
)
from symgen.errors import DescriptionError, ExpressionError

JOINT_FAMILIES = ("Ia", "FV", "FS", "OFFSET")  # after the inertial ones of eq. (4), link by link


class Kind(NamedTuple):
    """One kind of element on the joints, such as viscous friction: law, units and allowed options.

    Attributes
    ----------
    law : str
        Torque along the coordinate s for the parameter value 1; q, qd, qdd mean s, sd, sdd.
    units : tuple of str
        Units of the parameter for a revolute and for a prismatic joint.
    meaning : str
        Name of the kind in words.
    dissipative : bool
        Whether the parameter cannot be negative, because the element takes power from the motion.
    form, when : bool
        Whether an element of this kind may have `form` and `when`.
    fit : mapping
        Default scalars of the law, as a file gives them. A file may give other values.
    """

    law: str
    units: tuple[str, str]
    meaning: str
    dissipative: bool = False
    form: bool = False
    when: bool = False
    fit: Mapping[str, Any] = {}

    @property
    def torque(self) -> Expression:
        return parse(self.law, None, LAWS)


SLOW = {"vs": {"bounds": [0.002, 5], "start": 0.1}}  # rad/s or m/s
KINDS = {
    "inertia": Kind("qdd", ("kg*m**2", "kg"), "inertia of the actuator", form=True),
    "viscous": Kind(
        "qd", ("N*m*s/rad", "N*s/m"), "viscous friction", dissipative=True, form=True, when=True
    ),
    "coulomb": Kind("sign(qd)", ("N*m", "N"), "Coulomb friction", dissipative=True, when=True),
    "offset": Kind("1", ("N*m", "N"), "constant torque or force"),
    "stiffness": Kind("q", ("N*m/rad", "N/m"), "stiffness", form=True),
    "cubic": Kind("qd**3", ("N*m*s**3/rad**3", "N*s**3/m**3"), "cubic friction", dissipative=True),
    "stribeck": Kind(
        "sign(qd)*exp(-(abs(qd)/vs)**delta)",
        ("N*m", "N"),
        "friction of slow motion beyond Coulomb's",
        fit={**SLOW, "delta": 2},
    ),
    "tanh": Kind(
        "tanh(qd/vs)", ("N*m", "N"), "smooth Coulomb friction", dissipative=True, fit=SLOW
    ),
    "sigmoid": Kind(
        "1/(1 + exp(-(qd + vo)/vs)) - 1/(1 + exp(-vo/vs))",
        ("N*m", "N"),
        "Coulomb friction as a sigmoid of the velocity",
        dissipative=True,
        fit={**SLOW, "vo": 0},
    ),
    "load_dependent": Kind(
        "abs(tau_model)*sign(qd)",
        ("1", "1"),
        "Coulomb friction per transmitted torque",
        dissipative=True,
    ),
    "cogging": Kind(
        "sin(order*q + phase)", ("N*m", "N"), "cogging of the motor", fit={"order": 1, "phase": 0}
    ),
    "column": Kind("0", ("", ""), "column of the robot file"),
    "dissipative": Kind("0", ("", ""), "friction of the robot file", dissipative=True),
}
OWN_LAWS = ("column", "dissipative")  # kinds whose law the file gives
STATE = re.compile(r"(q|qd|qdd)([1-9][0-9]*)?\Z")
"""Names of a law: of s and its rates, and of those of a joint."""
CHANNEL = "channel."
"""Before the name of a function of time in a law: a constant whose value the record gives."""
TRANSMITTED = "tau_model"
"""In a law, the torque that the rest of the model transmits at its joint: channel.tau_model3."""
USUAL_KINDS = dict(zip((*JOINT_FAMILIES, "K"), KINDS, strict=False))


def varies(a: Atom) -> bool:
    """Whether a symbol or function call in a torque law depends on the joint state or on time.

    A function other than cos, sin and 1/x counts as varying, even if its operand is constant.
    """
    if isinstance(a, Call):
        exact = a.function in ("cos", "sin", "inv")
        return not exact or any(varies(b) for e in a.operands for b in e.atoms)
    return not isinstance(a, Number) and (a.startswith(CHANNEL) or bool(STATE.match(a)))


@dataclass(frozen=True, config=CONFIG)
class LawScalar:
    """A nonlinear constant of a law, such as a Stribeck velocity; equal bounds fix its value."""

    bounds: Annotated[
        tuple[float, float],
        Written(Annotated[list[Numeric], Field(min_length=2, max_length=2)], lambda x, _: tuple(x)),
        Field(description="[lower, upper]"),
    ]
    start: Annotated[
        float | None,
        Written(Numeric | None),
        Field(description="value before a fit; default: the middle of the bounds"),
    ] = None
    grid: Annotated[Whole, Field(description="starts of a fit within the bounds")] = 5

    @property
    def value(self) -> float:
        """Start value of this constant in a fit of the law: `start`, or the middle of its range."""
        lower, upper = self.bounds
        middle = (lower * upper) ** 0.5 if lower > 0 else (lower + upper) / 2
        return middle if self.start is None else self.start

    @property
    def fixed(self) -> bool:
        return self.bounds[0] == self.bounds[1]


def _scalars(table: Mapping[str, Any], declared: Any) -> dict[str, LawScalar]:
    """Convert the nonlinear constants of a torque law to LawScalars; a plain number becomes a
    constant that a fit does not change.
    """
    return {
        name: x if isinstance(x, LawScalar) else LawScalar((float(x), float(x)))
        for name, x in table.items()
    }


def _law(text: str | None, declared: Any) -> Expression | None:
    """Parse the text of a torque or energy law; `check_law` later refuses unknown names."""
    try:
        return None if text is None else parse(text, None, LAWS)
    except ExpressionError as error:
        raise DescriptionError(str(error)) from error


def _scalar(name: str, given: Any) -> LawScalar:
    """Make a nonlinear constant (LawScalar) of an element from its default in the table `KINDS`.

    The default is a fixed number, or bounds and a start value.
    """
    if not isinstance(given, Mapping):
        return LawScalar((float(given), float(given)))
    lower, upper = map(float, given["bounds"])
    return LawScalar((lower, upper), given["start"])


@dataclass(frozen=True, config=CONFIG)
class Element:
    """Joint torques not due to links: motor inertia, friction, offset, spring or your own law."""

    family: Annotated[str, *UNWRITTEN]
    kind: Annotated[
        str,
        Field(
            default="column",
            description=f"one of {', '.join(KINDS)}; of columns: default column",
            json_schema_extra={"enum": list(KINDS)},
        ),
    ]
    along: Annotated[
        Mapping[int, Row],
        Written(Literal["all"] | Whole | list[Whole] | dict[Whole, Text], rows),
        Field(
            default={},
            description=(
                "{6: q5 + q6} (6, a frame, numbers the parameter), joints 2 or [2, 3], or all: "
                "every actuated joint"
            ),
        ),
    ]
    form: Annotated[
        Mapping[int, Form],
        Written(dict[Whole, Text], partial(reduced, form_of)),
        Field(default={}, description="quadratic forms: {6: q6**2 + 2*q5*q6}"),
    ]
    when: Annotated[
        str | None,
        Field(
            description="direction of motion: positive or negative",
            json_schema_extra={"enum": [*DIRECTIONS, None]},
        ),
    ] = None
    torque: Annotated[
        Expression | None,
        Written(Text | None, _law),
        Field(description="law of a column: tanh(qd/vs), q2*cos(q); q, qd are those along it"),
    ] = None
    energy: Annotated[
        Expression | None,
        Written(Text | None, _law),
        Field(description="its energy in the place of a torque: (q - qs)**2/2"),
    ] = None
    unit: Annotated[str, Field(description="of the parameter of a column: N*m")] = ""
    fit: Annotated[
        Mapping[str, LawScalar],
        Written(dict[str, Numeric | LawScalar], _scalars),
        Field(description="scalars of the law: {vs: {bounds: [0.01, 1]}}; a number is fixed"),
    ] = Field(default={})

    @property
    def scalars(self) -> dict[str, LawScalar]:
        """Constants on which the law depends nonlinearly, by name, from the robot file or by
        default.
        """
        kind = KINDS.get(self.kind)
        return {name: _scalar(name, x) for name, x in (kind.fit if kind else {}).items()} | {
            **self.fit
        }

    @property
    def constants(self) -> dict[str, float]:
        """Start values of the nonlinear constants to be fitted, by name, for instance vs3.

        The name vs3 means the constant vs for frame 3. If the law depends on the transmitted
        torque, the mapping also has its name for each frame, such as tau_model3, with the value 0.
        """
        values = {name: x.value for name, x in self.scalars.items() if not x.fixed}
        if TRANSMITTED in (self.torque or KINDS.get(self.kind, KINDS["column"]).torque).symbols:
            values[TRANSMITTED] = 0.0
        return {parameter(name, j): x for name, x in values.items() for j in self.keys}

    def _of_key(self, law: Expression, j: int) -> Expression:
        """Return the law of this element for frame j: each constant becomes a symbol or a number.

        For j = 3, a nonlinear constant vs that a fit may change becomes the symbol vs3, and the
        transmitted torque tau_model becomes channel.tau_model3. A fixed constant becomes its
        number.
        """
        torque = Expression.symbol(f"{CHANNEL}{parameter(TRANSMITTED, j)}")
        return law.substitute(
            {TRANSMITTED: torque}
            | {
                name: Expression.number(repr(x.value))
                if x.fixed
                else Expression.symbol(parameter(name, j))
                for name, x in self.scalars.items()
            }
        )

    def channels(self, j: int) -> list[str]:
        """List the names of the functions of time (channels), such as temperature, in the law for
        frame j.
        """
        names = self.law(j).symbols if j in self.along else ()
        return sorted(name.removeprefix(CHANNEL) for name in names if name.startswith(CHANNEL))

    def law(self, j: int) -> Expression:
        """Return the torque law of the element for frame j as an expression: the torque along the
        coordinate s = G q for the parameter value 1.

        The law is zero if the user gives an energy.
        """
        return self._of_key(self.torque or KINDS[self.kind].torque, j)

    def potential(self, j: int) -> Expression:
        """Return the energy of the element for frame j and a unit parameter; zero if undefined."""
        return self._of_key(self.energy or ZERO, j)

    def laws(self, j: int) -> tuple[Expression, dict[int, Expression]]:
        """Return the element's torque along the coordinate s = G q, and torques at single joints.

        The torques are those for frame j and the parameter value 1. With the torque x along s and
        the energy U, Gamma = G' x + dU/dq_i. The torque x includes the derivative of U with respect
        to s. The second result maps each joint i that U names to dU/dq_i.
        """
        law, U = self.law(j), self.potential(j)
        joints = sorted(int(match[2]) for n in U.symbols if (match := STATE.match(n)) and match[2])
        return law + U.derivative("q"), {i: U.derivative(f"q{i}") for i in joints}

    @property
    def is_own(self) -> bool:
        """Whether the element has a special law: not inertia, viscous or Coulomb friction, offset
        or spring.

        Every law that the user writes, and every law with nonlinear constants, is special.
        """
        return (
            bool(self.torque or self.energy or self.scalars)
            or self.kind not in USUAL_KINDS.values()
        )

    @property
    def acts_as(self) -> str:
        """Kind of the element in generated modules: "column" or "dissipative" for special laws.

        Generated modules do not know special laws, only whether such a law dissipates energy.
        """
        return OWN_LAWS[KINDS[self.kind].dissipative] if self.is_own else self.kind

    @property
    def symbols(self) -> set[str]:
        """Names of the symbols in the torque and energy laws of the element."""
        return set().union(*((self.law(j) + self.potential(j)).symbols for j in self.keys))

    @property
    def is_friction(self) -> bool:
        """Whether the torque of the element depends on joint velocities."""
        return any((match := STATE.match(name)) and match[1] == "qd" for name in self.symbols)

    @property
    def keys(self) -> tuple[int, ...]:
        """Numbers of the frames for which the element has a parameter, in ascending order."""
        return tuple(sorted({*self.along, *self.form}))


def check_law(e: Element, robot: Any) -> Iterator[Problem]:
    """Check that the torque law of an element, such as joint friction, gives finite torques.

    The torques are computed at rest and in motion. The law may contain only names that the robot
    file or the element defines.
    """
    where: Path = ("elements", e.family)
    states = [f"{state}{j}" for state in ("q", "qd") for j in ("", *robot.moving)]
    for name, x in e.scalars.items():
        lower, upper = x.bounds
        yield (
            not lower <= x.value <= upper or not 1 <= x.grid <= 50,
            f"{e.family}: fit.{name}: start {x.value:g}, bounds [{lower:g}, {upper:g}], grid "
            f"{x.grid}; expected a start within the bounds and a grid of 1 to 50 starts",
            (*where, "fit", name),
        )
    law = e.energy if e.energy is not None else e.torque
    key = "energy" if e.energy is not None else "torque"
    if law is None:
        law = KINDS[e.kind].torque
    for name in e.scalars:
        yield (
            name not in law.symbols or name in states,
            f"{e.family}: fit.{name}: the law {law} has no constant {name} to fit; use {name} in the law or remove fit.{name}",
            (*where, "fit", name),
        )
    channels = {f"{CHANNEL}{name}": x for name, x in robot.constants.items()}
    declared = [*states, *e.scalars, *robot.constants, *channels, TRANSMITTED]
    if e.energy is not None:
        timed = ("qd", CHANNEL, TRANSMITTED)
        declared = [name for name in declared if not name.startswith(timed)]
    for j in e.keys if TRANSMITTED in law.symbols else ():
        yield (
            e.along.get(j) != {j: ONE} or j not in robot.joints,
            f"{e.family}{j}: a law with {TRANSMITTED} acts on one actuated joint; expected "
            f"`along: j` with j one of {list(robot.joints)}",
            (*where, "along", j),
        )
    for name in sorted(law.symbols - {*declared}):
        yield (
            True,
            f"{e.family}: {key}: {name!r} is unknown in this law; expected q, qd, q1, qd1 ... of "
            f"the joints{' (in an energy: positions only)' * bool(e.energy)}, constants of the law "
            "given under `fit`, constants of the robot file "
            f"({', '.join(robot.constants) or 'none'}), {TRANSMITTED}, or {CHANNEL}NAME for a constant "
            "NAME whose values the record has",
            (*where, key),
        )
    for j in e.along:
        for position, speed in product(_positions(robot, e.along[j]), (0.0, 1.0)):
            reason = ""
            values = {name: speed if name.startswith("qd") else position for name in states}
            try:
                along, others = e.laws(j)
                values |= {**robot.constants, **channels}
                torque = [f.value(values) for f in (along, *others.values())]
                finite = all(map(math.isfinite, torque))
            except (ArithmeticError, ValueError) as error:
                finite, reason = False, f" ({error})"
            yield (
                not finite,
                f"{e.family}: {law} is not finite at q = {position:g}, qd = {speed:g} with the "
                f"constants of the robot file{reason}; write a law that is finite at rest and in motion",
                (*where, key),
            )


def _positions(robot: Any, row: Any) -> tuple[float, float]:
    """Choose two joint positions at which a torque law is tested, if possible within the joint
    limits.

    Without limits, or for several joints, the positions are -0.4 and 0.7.
    """
    (j, *others), limits = row, robot.limits.get("q")
    if others or limits is None or j not in robot.joints:
        return -0.4, 0.7
    low, high = limits[robot.joints.index(j)]
    return low + 0.3 * (high - low), low + 0.9 * (high - low)


def check_channels(robot: Any) -> Iterator[Problem]:
    """Check that a constant used as a function of time (a channel) is not also used as a number."""
    of_frames = [getattr(f, name) for f in robot.frames for name in GEOMETRY]
    rows = [c for e in robot.elements for row in e.along.values() for c in row.values()]
    every = [*of_frames, *rows, *robot.gravity, *robot.constraints.values()]
    laws = set().union(*(e.symbols for e in robot.elements if e.is_own))
    for name in robot.channels:
        yield (
            name in laws or any(name in x.symbols for x in every),
            f"{name} is used as a constant and as the measured quantity {CHANNEL}{name}; write "
            f"{CHANNEL}{name} for the measured quantity, and rename the constant",
            ("constants", name),
        )
