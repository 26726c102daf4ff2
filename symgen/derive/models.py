"""Models of a robot, such as inverse dynamics and the inertia matrix: the table of all of them.

A model has a name, arguments, a shape, a unit, and the formulas of its entries, which come from a
derivation. The entries are grouped in cases; each case has its own values for inputs of the
recursion, such as qdd = 0. `Model.values` writes the formulas into a new graph. Code generators,
symbols, the certificate and the pages iterate over the table MODELS. A new model is one entry of
this table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from symgen.derive.algebra import GraphAlgebra, Matrix, Vector
from symgen.derive.composite import CompositeRates
from symgen.derive.derivation import Derivation
from symgen.derive.energies import (
    Columns,
    base_wrench,
    kinetic_energy,
    momentum_rate,
    origin_velocities,
    potential_energy,
    slotine_li,
)
from symgen.derive.geometry import Frames
from symgen.derive.graph import Scalar, Symbol
from symgen.derive.loop_equations import LoopSystem, loop_system
from symgen.derive.regressor import element_names
from symgen.derive.rewrite import Input, Inputs, Rewrite
from symgen.description.expression import ONE, ZERO
from symgen.description.robot import BASE_ROWS, Element, Robot
from symgen.errors import SymgenError

Place = tuple[int, ...]
LOOP_RESIDUALS = 6  # of a loop: three of position, three of orientation

READ, UNDEFINED, RELATIVE = "read", "undefined", "relative"
"""What the motion of a moving base is for a model: an argument, without meaning, or zero."""
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")  # of an origin, and the angular velocity


class Request(NamedTuple):
    """The choices of a user for one model: its parameters, its frames, and values of inputs.

    Attributes
    ----------
    parameters : mapping
        {standard parameter: symbol} of the parameters that take part, in the order of the columns.
    of, frame : int
        Number of the frame that the model describes; number of the frame of the components.
    inputs : mapping
        {input: value that replaces it}.
    """

    parameters: Mapping[str, str]
    of: int = 0
    frame: int = 0
    inputs: Inputs = MappingProxyType({})


class Entry(NamedTuple):
    """One entry of a model array, such as A or Gamma: its index, value, heading and comment."""

    place: Place
    value: Scalar | int
    heading: str = "Result"
    comment: str = ""


class Case(NamedTuple):
    """Entries of a model that are derived with the same values of some inputs, for instance qdd =
    0.

    `tag` ends the names of the intermediate variables that these replaced inputs change.
    """

    entries: Sequence[Entry]
    inputs: Inputs = MappingProxyType({})
    tag: str = ""


class Values(NamedTuple):
    """The entries of one model, as nodes of a graph made for this model."""

    entries: tuple[Entry, ...]
    algebra: GraphAlgebra

    @property
    def outputs(self) -> list[Scalar | int]:
        return [entry.value for entry in self.entries]


class Model(NamedTuple):
    """One model of a robot, such as the inertia matrix: its name, arguments, shape and formulas.

    Attributes
    ----------
    name : str
        Name of its function in all generated languages.
    letter : str
        Letter of its entries in formulas.
    arguments : tuple of str
        Its arguments, such as q, qd, qdd, tau and X.
    axes : tuple of str
        Meaning of its rows and columns, see `labels`; () for a scalar.
    unit : str
        Unit of its entries, for revolute | prismatic joints, SI.
    meaning : str
        Description of the model, without a full stop.
    cases : callable or None
        Function that returns its entries from a derivation; None if other models compose it.
    closed : callable or None
        Function that returns the same entries in a form that multiplies out to fewer terms.
    composed : str
        How its closed form is composed of other models: "formulas", "determinant" or "quotient".
    instead : str
        Advice for the user if the model has no recursion: another model or form that works.
    denominator : str
        Common divisor of its entries, such as "det A", if the closed form states it separately.
    result : str
        Name of the array in generated code; empty if no generated code has the function.
    symbolic : bool
        Whether the model is available in symbols.
    of_frames : bool
        Whether it describes one chosen frame, in components of another chosen frame.
    symmetric : bool
        Whether the matrix is symmetric, so that entries below the diagonal are left out.
    by_columns : bool
        Whether generated code stores it column by column in an array that is reused.
    of_loops : bool
        Whether it only serves to close general loops.
    up_to_a_constant : bool
        Whether a constant may be added to it.
    page : int
        Its position on the page of a robot, from 1; 0 if it is not shown there.
    case_of : str
        More general model that equals this model if its further arguments are zero; Python modules
        call the general model.
    option : str
        Option of `symgen generate --with` that adds it; empty if it is always generated.
    latex : str
        The letter in LaTeX; default: `letter` in bold.
    base : str
        What a moving base changes: READ if the model takes the motion of the base as its first
        argument, UNDEFINED if it has no meaning on a moving base, RELATIVE if it describes the
        robot with frame 0 at rest and without gravity.
    """

    name: str
    letter: str
    arguments: tuple[str, ...]
    axes: tuple[str, ...]
    unit: str
    meaning: str
    cases: Callable[[Derivation, Request], Iterable[Case]] | None
    closed: Callable[[Derivation, Request], Iterable[Case]] | None = None
    result: str = ""
    symbolic: bool = True
    of_frames: bool = False
    symmetric: bool = False
    by_columns: bool = False
    of_loops: bool = False
    composed: str = ""
    instead: str = ""
    denominator: str = ""
    up_to_a_constant: bool = False
    page: int = 0
    case_of: str = ""
    option: str = ""
    latex: str = ""
    base: str = RELATIVE

    def on(self, robot: Robot) -> Model:
        """Return the model of a robot: on a moving base, its first argument may be `base`.

        Raises SymgenError for a model that has no meaning on a moving base.
        """
        if not self.defined_on(robot):
            raise SymgenError(
                f"{robot.name}: the model {self.name} has no meaning on a moving base; leave it out, "
                "or write base: fixed"
            )
        return (
            self._replace(arguments=("base", *self.arguments))
            if robot.base_moves and self.base == READ
            else self
        )

    def defined_on(self, robot: Robot) -> bool:
        """Whether the model has a meaning on the base of the robot."""
        return not (robot.base_moves and self.base == UNDEFINED)

    @property
    def summary(self) -> str:
        """Description of the model as one sentence; a symbol at its start keeps its case."""
        word = self.meaning.partition(" ")[0]
        first = (
            self.meaning[0] if word in self.arguments + (self.result,) else self.meaning[0].upper()
        )
        return f"{first}{self.meaning[1:]}."

    @property
    def printed(self) -> bool:
        """Whether generated code computes the entries of the model by formulas from the expression
        graph.

        A model of a chosen frame, such as the Jacobian, is computed in generated code from other
        models.
        """
        return bool(self.result) and self.cases is not None and not self.of_frames

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the arguments that vary from sample to sample: all except the parameters X."""
        return tuple(a for a in self.arguments if a != "X")

    @property
    def reads_X(self) -> bool:
        return "X" in self.arguments

    def values(
        self,
        d: Derivation,
        request: Request,
        rewrite: Rewrite | None = None,
        *,
        closed: bool = False,
    ) -> Values:
        """Return the entries of the model for the parameters, frames and inputs of a request.

        rewrite : graph to write the entries into, if several models of the same request share one.
        closed : whether to use the form that multiplies out to fewer terms. Of a symmetric matrix,
        only entries on and above the diagonal are returned.
        """
        cases = (closed and self.closed) or self.cases
        assert cases is not None
        rewrite = rewrite or rewriting(d, request)
        entries = []
        for case in cases(d, request):
            values = rewrite.copied([e.value for e in case.entries], case.inputs, case.tag)
            entries += [
                Entry(e.place, value, e.heading, e.comment)
                for e, value in zip(case.entries, values, strict=True)
                if not self.symmetric or e.place[0] <= e.place[1]
            ]
        return Values(tuple(entries), rewrite.algebra)


AXES: Mapping[str, Callable[[Derivation, Sequence[str]], Iterable[object]]] = {
    "joints": lambda d, parameters: d.robot.joints,
    "rows": lambda d, parameters: d.robot.rows.values(),
    "parameters": lambda d, parameters: parameters,
    "standard parameters": lambda d, parameters: d.robot.parameters,
    "frames": lambda d, parameters: [f.j for f in d.robot.frames],
    "pose": lambda d, parameters: range(1, 5),
    "twist": lambda d, parameters: TWIST,
    "wrench": lambda d, parameters: ("fx", "fy", "fz", "nx", "ny", "nz"),
    "energies": lambda d, parameters: ("kinetic", "potential"),
    "equations": lambda d, parameters: range(1, len(equations(d)) + 1),
    "residual, derivatives": lambda d, parameters: ("r", *d.closure.independent),
    "curvatures, traces": lambda d, parameters: [
        *d.closure.tied,
        *(loop.cut for loop in d.robot.loops if loop.cut in d.closure.tied),
    ],
}
"""Labels of the rows or columns of a model, by the name of the axis."""


def labels(d: Derivation, axis: str, parameters: Sequence[str]) -> tuple[str, ...]:
    """Return the labels of the rows or columns of a model, such as joint or parameter names."""
    return tuple(map(str, AXES[axis](d, parameters)))


def equations(d: Derivation) -> tuple[int, ...]:
    """Return the indices of the loop residuals that serve as closure equations.

    There is one equation for each tied joint, a passive joint that only these equations relate to
    the actuated joints. If every passive joint stays a symbol instead, all six residuals of each
    loop are used.
    """
    if d.closure.tied and d.closure == loop_system(d.robot).closure:
        return loop_system(d.robot).equations
    return tuple(range(LOOP_RESIDUALS * len(d.robot.loops)))


def rewriting(d: Derivation, request: Request) -> Rewrite:
    """Return a new graph to which formulas are copied with parameters, gravity and inputs replaced
    as in `request`.

    Standard parameters become the symbols of the request or zero, gravity becomes that of the
    robot, and the inputs of the request become their values.
    """
    inputs: dict[Symbol, Input] = {}
    for name in d.robot.parameters:
        symbol = request.parameters.get(name)
        inputs[Symbol("parameter", name)] = Symbol("parameter", symbol) if symbol else ZERO
    inputs |= {Symbol("gravity", str(k)): -e for k, e in enumerate(d.robot.gravity) if e}
    return Rewrite(d.algebra, {**inputs, **request.inputs})


HOMOGENEOUS = (0, 0, 0, 1)  # last row of a pose


def _still(d: Derivation, *kinds: str, tied: bool = True) -> dict[Symbol, Input]:
    """Return replacements of inputs that set joint velocities (qd) or accelerations (qdd) to zero.

    If `tied` is true, the inputs of the tied passive joints are zero too.
    """
    independent = d.closure.independent if tied else d.robot.joints
    letter = {"qd": "QP", "qdd": "QDP"}
    return {Symbol(kind, f"{letter[kind]}{i}"): ZERO for kind in kinds for i in independent}


def _without(
    d: Derivation, kept: Callable[[Element], bool], links: bool = True
) -> dict[Symbol, Input]:
    """Return replacements that set to zero the parameters of all elements (friction, springs, ...)
    for which `kept` is false.

    The inertial parameters are zero too if `links` is false.
    """
    elements = element_names(d.robot)
    return {
        Symbol("parameter", name): ZERO
        for name in d.robot.parameters
        if not (kept(elements[name][0]) if name in elements else links)
    }


def _weightless(d: Derivation) -> dict[Symbol, Input]:
    return {Symbol("gravity", str(k)): ZERO for k in range(3)} | _at_rest(d)


def _at_rest(d: Derivation, *families: str) -> dict[Symbol, Input]:
    """Return replacements of inputs that set the motion of a moving base to zero.

    families : families of inputs that are set to zero, among W, WP and VP; default: all.
    """
    return {
        Symbol("base", name): ZERO
        for name in d.algebra.base_motion
        if not families or name.rstrip("0123456789_") in families
    }


# --- torques ---


def _torques(d: Derivation, heading: str = "Torques", column: tuple[int, ...] = ()) -> list[Entry]:
    return [Entry((row, *column), x, heading) for row, x in enumerate(d.torque.values())]


def _inverse_dynamics(d: Derivation, r: Request) -> Iterator[Case]:
    yield Case(_torques(d))


def _bias(d: Derivation, r: Request) -> Iterator[Case]:
    yield Case(_torques(d), _still(d, "qdd", tied=False))


def _gravity(d: Derivation, r: Request) -> Iterator[Case]:
    yield Case(_torques(d), _still(d, "qd", "qdd") | _at_rest(d, "W", "WP"))


def _friction(d: Derivation, r: Request) -> Iterator[Case]:
    others = _without(d, lambda e: e.is_friction, links=False)
    yield Case(_torques(d), others | _still(d, "qdd"))


def _inertia_matrix(d: Derivation, r: Request) -> Iterator[Case]:
    row = {j: k for k, j in enumerate(d.robot.rows)}
    entries = [Entry((row[i], row[k]), x, "Inertia matrix") for (i, k), x in d.inertia.items()]
    yield Case(entries)


def _unit_accelerations(d: Derivation, r: Request) -> Iterator[Case]:
    """Yield the columns of A: column i is Gamma for qdd_i = 1, from rest and without gravity.

    For a free base, the first columns belong to a unit of a0 and of wd0. A tied passive joint then
    has the acceleration G = dq_u/dq_i.
    """
    named, common = d.algebra.named, _still(d, "qd", "qdd") | _weightless(d)
    common |= _without(d, lambda e: e.kind == "inertia")
    columns = [*d.robot.rows]
    for key, name in zip(BASE_ROWS, d.algebra.accelerations, strict=False):
        symbol = {Symbol("base", name): ONE}
        yield Case(
            _torques(d, "Inertia matrix", (columns.index(key),)), common | symbol, f"_{name}"
        )
    for i in d.robot.joints:
        column = columns.index(i)
        unit: dict[Symbol, Input] = {Symbol("qdd", f"QDP{i}"): ONE}
        for u in d.closure.tied:
            unit[Symbol("qdd", f"QDP{u}")] = Symbol("rate", named("G", u, i))
        yield Case(_torques(d, "Inertia matrix", (column,)), common | unit, f"{named.separator}{i}")


def _require_closed_form(d: Derivation) -> None:
    if d.closure.tied:
        tied = ", ".join(f"q{u}" for u in d.closure.tied)
        raise SymgenError(
            f"C(q, qd) of {d.robot.name} has no formula in the actuated joints alone, because the loops give "
            f"the passive joints {tied} only by iteration; use the model bias, C qd + Q + friction"
        )


def _coriolis(d: Derivation, r: Request) -> Iterator[Case]:
    _require_closed_form(d)
    row = {j: k for k, j in enumerate(d.robot.joints)}
    C = CompositeRates(d.motion, d.chi).coriolis()
    projected = d.geometry.closure.project_twice(d.algebra, C)  # of a constant G
    yield Case([Entry((row[i], row[k]), x) for (i, k), x in projected.items()])


def _heading(j: int) -> str:
    return "Base" if j in BASE_ROWS else f"Joint {j}"


def _regressor(d: Derivation, r: Request) -> Iterator[Case]:
    entries = [
        Entry((row, column), d.columns[own][j], _heading(j), f"DG{label}{own}")
        for row, (j, label) in enumerate(d.robot.rows.items())
        for column, own in enumerate(r.parameters)
        if j in d.columns[own]
    ]
    yield Case(entries)


def _by_column(d: Derivation, r: Request, columns: Columns) -> list[Entry]:
    return [
        Entry((row, column), columns[own].get(j, 0), _heading(j))
        for row, j in enumerate(d.robot.rows)
        for column, own in enumerate(r.parameters)
    ]


def _momentum_regressor(d: Derivation, r: Request) -> Iterator[Case]:
    """Yield the regressor of the momentum p = A qd.

    The result is the regressor of Gamma at rest and without gravity, with qd in place of qdd.
    """
    elements = element_names(d.robot)
    moved = {
        own: {} if own in elements and elements[own][0].kind != "inertia" else d.columns[own]
        for own in r.parameters
    }
    rates = {Symbol("qdd", f"QDP{i}"): Symbol("qd", f"QP{i}") for i in d.closure.independent}
    yield Case(_by_column(d, r, moved), {**_still(d, "qd"), **rates, **_weightless(d)})


def _of_columns(columns: Callable[[Derivation], Columns]) -> Callable[..., Iterator[Case]]:
    def cases(d: Derivation, r: Request) -> Iterator[Case]:
        _require_closed_form(d)
        yield Case(_by_column(d, r, columns(d)))

    return cases


def _energy_regressor(d: Derivation, r: Request) -> Iterator[Case]:
    energies = (kinetic_energy(d), potential_energy(d))
    for column, own in enumerate(r.parameters):
        unit: dict[Symbol, Input] = {
            Symbol("parameter", name): ONE if name == own else ZERO for name in d.robot.parameters
        }
        yield Case([Entry((row, column), x) for row, x in enumerate(energies)], unit)


def _base_wrench_regressor(d: Derivation, r: Request) -> Iterator[Case]:
    found = base_wrench(d)
    yield Case(
        [
            Entry((row, column), x, f"Parameter {own}")
            for column, own in enumerate(d.robot.parameters)
            for row, x in enumerate(found.get(own, (0,) * 6))
        ]
    )


def _kinetic_energy(d: Derivation, r: Request) -> Iterator[Case]:
    yield Case([Entry((), kinetic_energy(d))])


def _potential_energy(d: Derivation, r: Request) -> Iterator[Case]:
    yield Case([Entry((), potential_energy(d))])


# --- kinematics ---


def _pose_entries(first: Place, A: Matrix, P: Vector) -> list[Entry]:
    rows = (*((*A[k], P[k]) for k in range(3)), HOMOGENEOUS)
    return [
        Entry((*first, k, m), x, "Poses") for k, row in enumerate(rows) for m, x in enumerate(row)
    ]


def _frame_poses(d: Derivation, r: Request) -> Iterator[Case]:
    yield Case([e for j, (A, P) in d.poses.items() for e in _pose_entries((j - 1,), A, P)])


def _pose(d: Derivation, r: Request) -> Iterator[Case]:
    in_base = r.of and not r.frame
    yield Case(
        _pose_entries((), *(d.poses[r.of] if in_base else Frames(d.geometry).pose(r.of, r.frame)))
    )


def _jacobian(d: Derivation, r: Request) -> Iterator[Case]:
    columns = Frames(d.geometry).columns(r.of, r.frame)
    for k in range(6):
        row = d.actuated({j: (*v, *w)[k] for j, (v, w) in columns.items()})
        yield Case([Entry((k, column), x) for column, x in enumerate(row.values())])


def _twist(d: Derivation, r: Request, linear: Vector, angular: Vector) -> list[Entry]:
    frames = Frames(d.geometry)
    both = (*frames.rotated(linear, r.of, r.frame), *frames.rotated(angular, r.of, r.frame))
    return [Entry((k,), x) for k, x in enumerate(both)]


def _velocity(d: Derivation, r: Request) -> Iterator[Case]:
    v, w = origin_velocities(d.motion)[r.of], d.motion.link[r.of].w
    yield Case(_twist(d, r, v, w), _at_rest(d))


def _acceleration(d: Derivation, r: Request) -> Iterator[Case]:
    link = d.motion.link[r.of]
    yield Case(_twist(d, r, link.a, link.wd), _weightless(d))


def _jacobian_rate(d: Derivation, r: Request) -> Iterator[Case]:
    for case in _acceleration(d, r):
        yield Case(case.entries, {**case.inputs, **_still(d, "qdd", tied=False)})


# --- loops ---


def _closure(d: Derivation, r: Request) -> Iterator[Case]:
    if not d.closure.tied:
        why = "its passive joints are functions of the actuated joints; use passive=symbols to keep the passive joints as symbols"
        raise SymgenError(
            f"{d.robot.name} has no closure equations to solve: "
            f"{why if d.robot.passive else 'it has no passive joints'}"
        )
    residuals = LoopSystem(d, equations(d)).residual
    yield Case([Entry((k,), x) for k, x in enumerate(residuals)])


def _linearised(d: Derivation, r: Request) -> Iterator[Case]:
    system, title = LoopSystem(d, equations(d)), "Residuals and their derivatives by the joints"
    rows = zip(system.residual, system.jacobian, strict=True)
    yield Case(
        [
            Entry((k, column), x, title)
            for k, (residual, derivatives) in enumerate(rows)
            for column, x in enumerate((residual, *derivatives))
        ]
    )


def _curvature(d: Derivation, r: Request) -> Iterator[Case]:
    system = LoopSystem(d, equations(d))
    values = (*system.curvature, *system.alignment)
    title = "Second derivatives at constant rates"
    yield Case([Entry((k,), x, title) for k, x in enumerate(values)])


TORQUE, INERTIA, TWIST_UNIT = "N*m | N", "kg*m**2 | kg*m | kg", "m/s, rad/s"
MODELS = {
    model.name: model
    for model in (
        Model(
            "regressor", "D", ("q", "qd", "qdd"), ("rows", "parameters"), "Gamma by X",
            "D of Gamma = D X", _regressor, result="D", by_columns=True, base=READ,
        ),
        Model(
            "inverse_dynamics", "GAM", ("q", "qd", "qdd", "X"), ("rows",), TORQUE,
            "joint torques Gamma = A qdd + C qd + Q + friction", _inverse_dynamics, result="GAM",
            page=7, latex=r"\Gamma", base=READ,
        ),
        Model(
            "inertia_matrix", "A", ("q", "X"), ("rows", "rows"), INERTIA,
            "A(q), actuators included: column i is Gamma for a unit acceleration of joint i from "
            "rest",
            _inertia_matrix, closed=_unit_accelerations, result="A", symmetric=True, page=3,
        ),
        Model(
            "bias", "H", ("q", "qd", "X"), ("rows",), TORQUE,
            "Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset", _bias,
            result="GAM", page=6, case_of="inverse_dynamics", base=READ,
        ),
        Model(
            "gravity", "Q", ("q", "X"), ("rows",), TORQUE,
            "Gamma at rest without friction: gravity, offset and springs "
            "(a base parameter may mix them)", _gravity, result="GAM", page=5, base=READ,
        ),
        Model(
            "forward_dynamics", "QDP", ("q", "qd", "tau", "X"), ("rows",), "rad/s**2 | m/s**2",
            "qdd = A(q)**-1 (tau - bias)", None, result="qdd", composed="quotient",
            latex=r"\det \mathbf{A} \; \ddot{q}",
            denominator="det A",
            instead="A qdd = Gamma - H, with the equations of inertia_matrix and bias", base=READ,
        ),
        Model(
            "frame_poses", "T", ("q",), ("frames", "pose", "pose"), "1, m",
            "Homogeneous transform of every frame j in frame 0, at index j - 1", _frame_poses,
            result="T", symbolic=False,
        ),
        Model(
            "pose", "T", ("q",), ("pose", "pose"), "1, m",
            "homogeneous transform: axes and origin of frame `of` in frame `frame`", _pose,
            of_frames=True, page=1,
        ),
        Model(
            "jacobian", "J", ("q",), ("twist", "joints"), "m/s, rad/s by rad/s | m/s",
            "velocity of the origin of frame `of`, then its angular velocity, per joint rate, "
            "in frame `frame`", _jacobian, result="J", of_frames=True,
            page=2,
        ),
        Model(
            "determinant", "det J", ("q",), (), "m**3 for six hinges",
            "determinant of the Jacobian, where it is square", None, of_frames=True,
            composed="determinant", instead="form closed, or the equations of jacobian", latex=r"\det \mathbf{J}",
        ),
        Model(
            "jacobian_rate", "JPQP", ("q", "qd"), ("twist",), "m/s**2, rad/s**2",
            "Jd qd: acceleration of the origin of frame `of` and its angular acceleration at "
            "qdd = 0, in frame `frame`", _jacobian_rate, of_frames=True, latex=r"\dot{\mathbf{J}} \dot{q}",
        ),
        Model(
            "velocity", "V", ("q", "qd"), ("twist",), TWIST_UNIT,
            "velocity of the origin of frame `of`, then its angular velocity, in frame `frame`",
            _velocity, of_frames=True,
        ),
        Model(
            "acceleration", "VP", ("q", "qd", "qdd"), ("twist",), "m/s**2, rad/s**2",
            "acceleration of the origin of frame `of`, then its angular acceleration, "
            "in frame `frame`", _acceleration, of_frames=True, latex=r"\dot{\mathbf{V}}",
        ),
        Model(
            "coriolis", "C", ("q", "qd", "X"), ("joints", "joints"), "N*m*s/rad | N*s/m",
            "C(q, qd) of Coriolis and centrifugal torques C qd, with Christoffel symbols: "
            "Ad - 2C is skew symmetric", _coriolis, page=4, result="C", option="coriolis",
            base=UNDEFINED,
        ),
        Model(
            "slotine_li_regressor", "Y", ("q", "qd", "qdr", "qddr"), ("joints", "parameters"),
            "Gamma by X",
            "Y of Y X = A qddr + C qdr + Q + friction(qd), reference rates qdr and accelerations "
            "qddr", _of_columns(slotine_li), result="Y", symbolic=False, option="slotine_li",
            base=UNDEFINED,
        ),
        Model(
            "momentum_regressor", "PI", ("q", "qd"), ("joints", "parameters"),
            "generalised momentum by X", "columns of p = A qd", _momentum_regressor, result="PI",
            symbolic=False, option="momentum", base=UNDEFINED,
        ),
        Model(
            "momentum_rate_regressor", "PIP", ("q", "qd"), ("joints", "parameters"), "Gamma by X",
            "columns of dp/dt - Gamma = C' qd - Q - friction", _of_columns(momentum_rate),
            result="PIP", symbolic=False, option="momentum", base=UNDEFINED,
        ),
        Model(
            "energy_regressor", "EU", ("q", "qd"), ("energies", "parameters"), "J by X",
            "columns of the kinetic and of the potential energy", _energy_regressor, result="EU",
            symbolic=False, option="energy", base=UNDEFINED,
        ),
        Model(
            "base_wrench_regressor", "WB", ("q", "qd", "qdd"), ("wrench", "standard parameters"),
            "wrench by standard parameter",
            "columns of force and moment about the origin of frame 0, in frame 0, by which the "
            "base moves the links; of the standard parameters, more of which act here than on the "
            "joints", _base_wrench_regressor, result="WB", symbolic=False,
            option="base_wrench_regressor", base=UNDEFINED,
        ),
        Model(
            "friction", "F", ("q", "qd", "X"), ("rows",), TORQUE,
            "viscous and Coulomb friction", _friction,
        ),
        Model(
            "kinetic_energy", "E", ("q", "qd", "X"), (), "J",
            "kinetic energy, actuators included", _kinetic_energy, base=UNDEFINED,
        ),
        Model(
            "potential_energy", "U", ("q", "X"), (), "J",
            "potential energy of gravity, springs and offset: dU/dq = Q", _potential_energy,
            up_to_a_constant=True, base=UNDEFINED,
        ),
        Model(
            "base_parameters", "X", ("standard",), ("parameters",), "see UNITS",
            "what each parameter is made of", None, composed="formulas",
            instead="form closed, or symgen show ROBOT --recursive for the regrouping link by link",
        ),
        Model(
            "closure", "r", ("q",), ("equations",), "m | rad",
            "residuals of the loops, zero where they close", _closure, page=8,
        ),
        Model(
            "linearised_closure", "R", ("q",), ("equations", "residual, derivatives"), "m | rad",
            "Closure residuals, then their derivatives by the joints", _linearised,
            result="R", symbolic=False, of_loops=True,
        ),
        Model(
            "curvature", "B", ("q", "qd"), ("curvatures, traces",), "m/s**2 | rad/s**2",
            "Second derivatives of the residuals at constant rates, then traces of A_cut' A_twin",
            _curvature, result="B", symbolic=False, of_loops=True,
        ),
    )
}  # fmt: skip
SYMBOLIC = {name: model for name, model in MODELS.items() if model.symbolic}
EMITTED = {n: m for n, m in MODELS.items() if m.result and not m.of_loops and not m.option}
"""Models that every target has as functions."""
ON_REQUEST = {n: m for n, m in MODELS.items() if m.option}
"""Models that a target has only if they are asked for."""
OPTIONS = tuple(dict.fromkeys(m.option for m in ON_REQUEST.values()))
