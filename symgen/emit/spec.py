"""What the text of a robot has to say, as data without text: its models as values of a graph, what
each of them reads, its constant entries, its costs. Made once, printed by every target.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

from symgen.derive.derivation import Derivation, derive
from symgen.derive.graph import ADD, COS, MUL, SIN, SYM, Node, Scalar, Symbol, reachable
from symgen.derive.model import Entry, Model, Place, Request, Values, labels, rewriting
from symgen.derive.models import MODELS
from symgen.derive.regressor import element_names, inertial_names
from symgen.derive.rewrite import Rewrite
from symgen.description.naming import Namespace
from symgen.description.robot import Robot
from symgen.regroup.regrouping import Regrouping, regroup

STATES = {"q": "q", "qd": "QP", "qdd": "QDP", "qdr": "QPR", "qddr": "QDPR"}
"""Argument: family of its components."""


@dataclass(frozen=True)
class Function:
    """One function: a model over the base parameters, and the array that it fills.

    Attributes
    ----------
    model : Model
        What it evaluates.
    values : Values
        Its entries.
    shape : tuple of int
        Of its result without samples; column by column, (b, n), where the model is stored so.
    """

    model: Model
    values: Values
    shape: tuple[int, ...]

    @cached_property
    def nodes(self) -> list[Node]:
        """The operations that its entries need."""
        return reachable(self.values.outputs)

    @cached_property
    def inputs(self) -> set[Symbol]:
        """The symbols that its entries need."""
        return {node.value for node in self.nodes if node.op == SYM}

    def reads(self, kind: str) -> bool:
        return any(symbol.kind == kind for symbol in self.inputs)

    @property
    def states(self) -> tuple[str, ...]:
        """The states that the function reads; among them G, the rates of the tied joints."""
        kinds = {**{state: state for state in STATES}, "G": "rate"}
        return tuple(state for state, kind in kinds.items() if self.reads(kind))

    def constants(self, free: Iterable[str]) -> tuple[str, ...]:
        """The names in `free` that the function reads, in the same order."""
        read = {symbol.name for symbol in self.inputs if symbol.kind in ("constant", "channel")}
        return tuple(name for name in free if name in read)

    def places(self, entry: Entry) -> tuple[Place, ...]:
        """Where an entry stands in the array: twice beside the diagonal of a symmetric matrix."""
        mirrored = entry.place[::-1]
        if self.model.by_columns:
            return (mirrored,)
        return tuple(
            dict.fromkeys((entry.place, mirrored if self.model.symmetric else entry.place))
        )

    @property
    def by_place(self) -> list[tuple[Place, Entry]]:
        """Every place with its entry, in the order of the places."""
        pairs = [(place, entry) for entry in self.values.entries for place in self.places(entry)]
        return sorted(pairs, key=lambda pair: pair[0])

    @property
    def preset(self) -> list[tuple[Place, float]]:
        """Entries that are numbers other than zero."""
        return [
            (p, float(e.value)) for p, e in self.by_place if isinstance(e.value, int) and e.value
        ]

    @property
    def computed(self) -> list[Entry]:
        """Entries that are no numbers, in the order of their places read from the right."""
        return [entry for entry in self.values.entries if isinstance(entry.value, Scalar)]

    def count(self, op: str) -> int:
        """Operations that depend on the sample; those of constants and parameters are none."""
        return sum(node.op == op and not node.fixed for node in self.nodes)

    @property
    def operations(self) -> tuple[int, int]:
        """(multiplications, additions) per sample."""
        return self.count(MUL), self.count(ADD)

    @property
    def cost(self) -> str:
        """Operations per sample."""
        return (
            f"{self.count(MUL)} multiplications, {self.count(ADD)} additions, "
            f"{self.count(SIN)} sin, {self.count(COS)} cos"
        )


@dataclass(frozen=True)
class Signals:
    """The distinct entries of a function up to sign.

    Attributes
    ----------
    entries : tuple of Entry
        The first of each, its sign as it stands there, with the comments of all.
    places : tuple of (place, signal, sign)
        Every place of the array that is not zero.
    """

    entries: tuple[Entry, ...]
    places: tuple[tuple[Place, int, int], ...]


def signals(f: Function, entries: Sequence[Entry]) -> Signals:
    """The signals of some entries of a function; numbers among them are 0, 1 and -1."""
    number: dict[tuple[str, int], tuple[int, int]] = {}  # node or number: signal, its sign
    distinct: list[Entry] = []
    places = []
    for entry in entries:
        value = entry.value
        if isinstance(value, int):
            key, own = ("number", abs(value)), -1 if value < 0 else 1
        else:
            key, own = ("node", value.node.index), value.sign
        signal, sign = number.setdefault(key, (len(distinct), own))
        if signal == len(distinct):
            distinct.append(entry)
        elif entry.comment:
            comment = f"{distinct[signal].comment}, {entry.comment}".removeprefix(", ")
            distinct[signal] = replace(distinct[signal], comment=comment)
        places += [(place, signal, own * sign) for place in f.places(entry)]
    return Signals(tuple(distinct), tuple(places))


@dataclass(frozen=True, eq=False)
class ModuleSpec:
    """The functions of a robot over its base parameters."""

    derivation: Derivation
    regrouping: Regrouping
    functions: Mapping[str, Function]

    @property
    def robot(self) -> Robot:
        return self.regrouping.robot

    @property
    def tied(self) -> tuple[int, ...]:
        """Passive joints that only the closure equations tie to the actuated ones."""
        return self.derivation.closure.tied

    @cached_property
    def structure(self) -> tuple[tuple[bool, ...], ...]:
        """[k][row]: whether base parameter k acts on a joint: D is not identically zero there."""
        b, n = self.functions["regressor"].shape
        acts = {place for place, e in self.functions["regressor"].by_place if e.value != 0}
        return tuple(tuple((k, row) in acts for row in range(n)) for k in range(b))

    @property
    def sizes(self) -> dict[str, int]:
        """Actuated, tied, independent joints n, m, k; base, standard parameters b, p; frames."""
        n, m = len(self.robot.joints), len(self.tied)
        p, frames = len(self.robot.parameters), len(self.robot.frames)
        return {"n": n, "m": m, "k": n + m, "b": len(self.regrouping), "p": p, "frames": frames}

    def names(self, is_word: Callable[[str], bool] = lambda name: False) -> Namespace:
        """The names of one text of this robot."""
        robot = self.robot
        own = (*robot.constants, *robot.parameters, *self.regrouping.names)
        return Namespace(own, is_word)


SHARING = ("regressor", "inverse_dynamics")
"""Models over one graph: the motion of the links is the same in both."""


def module_spec(regrouping: Regrouping, options: Sequence[str] = ()) -> ModuleSpec:
    """Every model of an emitted module, over the base parameters of `regrouping`, and those that
    `options` ask for.
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
    """A model over the base parameters that are called after a standard parameter with `only`; in
    the `graph` of other models, of all parameters, where one is given.
    """
    d, model, request = derive(regrouping.robot), MODELS[name], _request(regrouping, only)
    shape = shape_of(model, d, tuple(request.parameters.values()))
    return Function(model, model.values(d, request, graph), shape)


def _request(regrouping: Regrouping, only: Callable[[str], bool] = lambda own: True) -> Request:
    return Request({b.own: b.name for b in regrouping.base if only(b.own)})


def shape_of(model: Model, d: Derivation, parameters: tuple[str, ...]) -> tuple[int, ...]:
    """The shape of the array without samples."""
    shape = tuple(len(labels(d, axis, parameters)) for axis in model.axes)
    return shape[::-1] if model.by_columns else shape


@lru_cache(maxsize=2)
def spec_of(robot: Robot, options: tuple[str, ...] = ()) -> ModuleSpec:
    """The models of a robot over its base parameters; kept, since its module and its C file are
    asked for one after the other.
    """
    return module_spec(regroup(robot), options)


def is_inertial(robot: Robot) -> Callable[[str], bool]:
    """Whether a standard parameter is one of the ten of a link."""
    return inertial_names(robot).__contains__


def is_inertial_or_actuator(robot: Robot) -> Callable[[str], bool]:
    """Whether a standard parameter is inertial or the inertia of an actuator."""
    inertial, elements = inertial_names(robot), element_names(robot)
    return lambda own: own in inertial or elements[own][0].kind == "inertia"
