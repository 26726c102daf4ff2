"""The models of a robot as data, before a printer writes them as source code.

The data of a model are its entries as nodes of an expression graph, the states and parameters that
they depend on, its constant entries, and its number of operations. The data are made once, and
every target prints them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

from symgen.derive.derivation import Derivation, derive, derived
from symgen.derive.graph import ADD, COS, MUL, SIN, Node, Scalar, reachable
from symgen.derive.loops import close
from symgen.derive.models import MODELS, Entry, Model, Place, Request, Values, labels, rewriting
from symgen.derive.regressor import element_names, inertial_names
from symgen.derive.rewrite import Rewrite
from symgen.description.naming import Namespace
from symgen.description.robot import Robot
from symgen.regroup.regrouping import Regrouping, regroup

STATES = {"q": "q", "qd": "QP", "qdd": "QDP", "qdr": "QPR", "qddr": "QDPR"}
"""Argument: family of its components."""
BASE = ("base",)
"""The argument before the others of a robot whose base moves, (N, 9): w0, wd0 and a0."""


@dataclass(frozen=True)
class Function:
    """One function of the emitted code, such as the inverse dynamics, written in base parameters.

    Attributes
    ----------
    model : Model
        Model that the function computes, such as the inverse dynamics.
    values : Values
        Entries of the result as expressions.
    shape : tuple of int
        Shape of the result for one sample. A model that is stored column by column has its axes
        reversed: (b, n) for the regressor.
    """

    model: Model
    values: Values
    shape: tuple[int, ...]

    @cached_property
    def nodes(self) -> list[Node]:
        """Nodes of the expression graph on which the result depends: inputs and operations."""
        return reachable(self.values.outputs)

    def places(self, entry: Entry) -> tuple[Place, ...]:
        """List the indices at which the result array contains an entry: (i, k), and (k, i) if it is
        symmetric.

        In a model that is stored column by column the indices are reversed.
        """
        mirrored = entry.place[::-1]
        if self.model.by_columns:
            return (mirrored,)
        return tuple(
            dict.fromkeys((entry.place, mirrored if self.model.symmetric else entry.place))
        )

    @property
    def by_place(self) -> list[tuple[Place, Entry]]:
        """Pairs of array index and entry for the whole result, sorted by index."""
        pairs = [(place, entry) for entry in self.values.entries for place in self.places(entry)]
        return sorted(pairs, key=lambda pair: pair[0])

    @property
    def preset(self) -> list[tuple[Place, float]]:
        """Array index and value of each result entry that is a constant number other than zero."""
        return [
            (p, float(e.value)) for p, e in self.by_place if isinstance(e.value, int) and e.value
        ]

    @property
    def computed(self) -> list[Entry]:
        """Result entries that the code must compute because they are not constant numbers."""
        return [entry for entry in self.values.entries if isinstance(entry.value, Scalar)]

    def count(self, op: str) -> int:
        """Count the operations of one kind, such as multiplications, that depend on the sample.

        Operations on constants and parameters alone are not counted.
        """
        return sum(node.op == op and not node.fixed for node in self.nodes)

    @property
    def operations(self) -> tuple[int, int]:
        """Number of multiplications and number of additions per sample."""
        return self.count(MUL), self.count(ADD)

    @property
    def cost(self) -> str:
        """Text with the numbers of multiplications, additions, sines and cosines per sample."""
        return (
            f"{self.count(MUL)} multiplications, {self.count(ADD)} additions, "
            f"{self.count(SIN)} sin, {self.count(COS)} cos"
        )


@dataclass(frozen=True, eq=False)
class ModuleSpec:
    """All functions of the emitted code of one robot, as data before they are written as text."""

    derivation: Derivation
    regrouping: Regrouping
    functions: Mapping[str, Function]

    @property
    def robot(self) -> Robot:
        return self.regrouping.robot

    @property
    def tied(self) -> tuple[int, ...]:
        """Passive joints whose positions have no formula: only closure equations define them."""
        return self.derivation.closure.tied

    @cached_property
    def structure(self) -> tuple[tuple[bool, ...], ...]:
        """Table structure[k][i]: whether base parameter k can affect the torque with index i: of a
        joint, or of a row of a free base.

        The parameter can affect the torque if the entry of the regressor D is not identically zero.
        """
        b, n = self.functions["regressor"].shape
        acts = {place for place, e in self.functions["regressor"].by_place if e.value != 0}
        return tuple(tuple((k, row) in acts for row in range(n)) for k in range(b))

    @cached_property
    def base_values(self) -> tuple[float, ...]:
        """Base parameters X of the values in the robot file; empty if the file lacks a value that
        they contain.
        """
        values, constants = self.robot.values, self.robot.constants
        rows = [b.combination for b in self.regrouping.base]
        if not {name for row in rows for name in row} <= {*values}:
            return ()
        return tuple(
            sum(c.value(constants) * values[name] for name, c in row.items()) for row in rows
        )

    @property
    def sizes(self) -> dict[str, int]:
        """Numbers of joints, parameters and frames by name: n, r, m, k, b, p, frames.

        n actuated joints, r rows of the torques, m tied joints, k = n + m independent joints, b
        base parameters, p standard parameters.
        """
        n, r, m = len(self.robot.joints), len(self.robot.rows), len(self.tied)
        p, frames, b = len(self.robot.parameters), len(self.robot.frames), len(self.regrouping)
        return {"n": n, "r": r, "m": m, "k": n + m, "b": b, "p": p, "frames": frames}

    def names(self, is_word: Callable[[str], bool] = lambda name: False) -> Namespace:
        """Make the table of names of one source text, so that no two quantities share a name.

        `is_word` tests whether the language reserves a name.
        """
        robot = self.robot
        own = (*robot.constants, *robot.parameters, *self.regrouping.names)
        return Namespace(own, is_word)


SHARING = ("regressor", "inverse_dynamics")
"""Models over one graph: the motion of the links is the same in both."""


def module_spec(regrouping: Regrouping, options: Sequence[str] = ()) -> ModuleSpec:
    """Make the data of all functions of the emitted code of a robot, written in base parameters.

    Models on request are included if `options` names them.
    """
    d = derive(regrouping.robot)
    printed = [
        m
        for m in MODELS.values()
        if m.printed and (d.closure.tied or not m.of_loops) and m.option in ("", *options)
    ]
    shared = rewriting(d, _request(regrouping))
    return ModuleSpec(
        d,
        regrouping,
        {
            m.name: function(regrouping, m.name, graph=shared if m.name in SHARING else None)
            for m in printed
        },
    )


def function(
    regrouping: Regrouping,
    name: str,
    only: Callable[[str], bool] = lambda own: True,
    graph: Rewrite | None = None,
) -> Function:
    """Make the description of one emitted function: its model, its expressions and its shape.

    `name` is the model, such as inverse_dynamics. Only base parameters named after a standard
    parameter for which `only` is true take part. `graph` is an expression graph that several models
    share; it needs all parameters. A model on request adds nodes to its derivation, so that it has
    a derivation of its own: the operations of the other models then do not depend on earlier
    requests.
    """
    robot, request = regrouping.robot, _request(regrouping, only)
    model = MODELS[name].on(robot)
    d = derived(robot, close) if model.option else derive(robot)
    shape = shape_of(model, d, tuple(request.parameters.values()))
    return Function(model, model.values(d, request, graph), shape)


def _request(regrouping: Regrouping, only: Callable[[str], bool] = lambda own: True) -> Request:
    return Request({b.own: b.name for b in regrouping.base if only(b.own)})


def shape_of(model: Model, d: Derivation, parameters: tuple[str, ...]) -> tuple[int, ...]:
    """Return the shape of the result of a model, such as the regressor, for one sample."""
    shape = tuple(len(labels(d, axis, parameters)) for axis in model.axes)
    return shape[::-1] if model.by_columns else shape


@lru_cache(maxsize=2)
def spec_of(robot: Robot, options: tuple[str, ...] = ()) -> ModuleSpec:
    """Make the data of all functions of the emitted code of a robot, and cache the result.

    The cache saves time if the Python module and the C file of a robot are made one after the
    other.
    """
    return module_spec(regroup(robot), options)


def is_inertial(robot: Robot) -> Callable[[str], bool]:
    """Return a function that tests if a name belongs to an inertial parameter of a link."""
    return inertial_names(robot).__contains__


def is_inertial_or_actuator(robot: Robot) -> Callable[[str], bool]:
    """Return a function that tests if a name belongs to an inertial parameter of a link or an
    actuator.
    """
    inertial, elements = inertial_names(robot), element_names(robot)
    return lambda own: own in inertial or elements[own][0].kind == "inertia"
