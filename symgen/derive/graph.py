"""Expression graph: every formula as nodes that recursions make and code generators print.

A node is (op, operands). Equal nodes are one object (hash-consing), so a shared sub-expression is
computed once. Signs are stored outside the nodes: a `Scalar` is a node and a sign, so that a
negation costs nothing, and x and -x share one node. A recursion may give a name to a node that it
makes.

Operations: sym, const (exact rational), add, mul, cos, sin of angles of the robot, sign, pos
(positive part max(x, 0)), inv (1/x), sqrt. Torque laws of elements may also have exp, tanh, pow,
and any of these functions with operands that exact arithmetic cannot represent.

`interpret` computes the values of nodes over a domain: `Floats` of NumPy or a package such as
CasADi, residues of F_p, SymPy's objects. `rates` gives the time derivatives of nodes, again as
nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple, Protocol

import numpy as np

from symgen.description.expression import FUNCTIONS, Expression
from symgen.description.robot import Robot
from symgen.time_limit import require_time

SYM, CONST, ADD, MUL = "sym", "const", "add", "mul"
COS, SIN, SIGN, POS, SQRT, INV = "cos", "sin", "sign", "pos", "sqrt", "inv"

LOOKS = 256  # nodes made between two looks at the clock

EVEN, ODD = {COS}, {SIN, SIGN, INV, "tanh"}


class Symbol(NamedTuple):
    """An input of a derivation, such as q1 or the constant D3: its kind and its name.

    Two inputs with the same name and different kinds are different.

    Attributes
    ----------
    kind : str
        constant, pi, number, q, qd, qdd, qdr, qddr, channel, torque, rate (of a tied joint),
        parameter or gravity.
    name : str
        Name in formulas: D3, q1, QP1, QDP1, GAM1, G31, XX1; for gravity the axis, 0 to 2; for a
        number of the robot file its value, 2159/5000.
    """

    kind: str
    name: str

    def __str__(self) -> str:
        return self.name


Turn = tuple[tuple[int, int | Fraction], ...]  # ((j, n), ...): the angle sum_j n q_j
ActiveRow = tuple[tuple[int, Expression], ...]  # ((i, G_i), ...): the velocity sum_i G_i qd_i


class Angle(NamedTuple):
    """The angle sum_j n_j q_j + offset of a cosine or sine; `turn` holds the pairs (j, n_j)."""

    turn: Turn
    offset: Expression

    def __neg__(self) -> Angle:
        return Angle(tuple((j, -n) for j, n in self.turn), -self.offset)


class Velocity(NamedTuple):
    """A velocity sum_i G_i qd_i of independent joints, the operand of sign or of max(x, 0)."""

    row: ActiveRow

    def __neg__(self) -> Velocity:
        return Velocity(tuple((i, -g) for i, g in self.row))


class Node:
    """One operation of the expression graph, with its operands and the name of its result.

    `operands` are Scalars. A `fixed` node depends on constants and parameters only, not on the
    sample. `value` describes the node for exact arithmetic: the Symbol of an input, the number of a
    constant, the Angle of a cosine or sine, the Velocity of a sign or positive part, the Expression
    of a square root; None if the operands are the only description. `name` is the name of the
    emitted line. `hint` is used as the name if the node turns out to be shared and has no name.
    """

    __slots__ = ("fixed", "hint", "index", "name", "name_sign", "op", "operands", "value")

    def __init__(
        self, index: int, op: str, operands: tuple[Scalar, ...], value: Any, fixed: bool
    ) -> None:
        self.index = index
        self.op = op
        self.operands = operands
        self.value = value
        self.fixed = fixed
        self.name: str | None = None
        self.hint: str | None = None
        self.name_sign = 1

    def __repr__(self) -> str:
        return f"<{self.name or self.value or self.op} {self.index}>"


class Scalar:
    """A node of the expression graph with a sign; the operators + - * / make new nodes."""

    __slots__ = ("graph", "node", "sign")

    def __init__(self, graph: Graph, node: Node, sign: int) -> None:
        self.graph = graph
        self.node = node
        self.sign = sign

    def __neg__(self) -> Scalar:
        return Scalar(self.graph, self.node, -self.sign)

    def __add__(self, other: Scalar | int) -> Scalar | int:
        return self if other == 0 else self.graph.add(self, self.graph.lift(other))

    def __sub__(self, other: Scalar | int) -> Scalar | int:
        return self if other == 0 else self.graph.add(self, -self.graph.lift(other))

    def __mul__(self, other: Scalar | int) -> Scalar | int:
        if isinstance(other, int) and -1 <= other <= 1:
            return (0, self, -self)[other]
        return self.graph.mul(self, self.graph.lift(other))

    def __radd__(self, other: int) -> Scalar | int:
        return self if other == 0 else self.graph.add(self.graph.lift(other), self)

    def __rsub__(self, other: int) -> Scalar | int:
        return -self if other == 0 else self.graph.add(self.graph.lift(other), -self)

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> Scalar | int:
        return self.graph.mul(self, self.graph.call(INV, other))

    def __rtruediv__(self, other: int) -> Scalar | int:
        return self.graph.mul(self.graph.lift(other), self.graph.call(INV, self))

    def __repr__(self) -> str:
        return f"{'-' if self.sign < 0 else ''}{self.node!r}"

    def __reduce__(self) -> tuple[Any, ...]:
        return self.graph.scalar, (self.node.index, self.sign)


class Graph:
    """An expression graph: the list of its nodes. Nodes of two graphs must never be mixed."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._node: dict[tuple[Any, ...], Node] = {}
        self._sealed = 0  # nodes before this one keep the names they have

    def __getstate__(self) -> tuple[Any, ...]:
        """Return the nodes as a flat list, for pickling.

        Nested nodes would be too deep: a chain of operations may exceed the recursion limit of
        Python.
        """
        key = {node.index: key for key, node in self._node.items()}
        nodes = [
            (key[n.index], [(x.node.index, x.sign) for x in n.operands])
            + (n.op, n.value, n.fixed, n.name, n.hint, n.name_sign)
            for n in self.nodes
        ]
        return nodes, self._sealed

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self.nodes = []
        self._node = {}
        for key, operands, op, value, fixed, name, hint, name_sign in state[0]:
            scalars = tuple(self.scalar(k, sign) for k, sign in operands)
            node = self._scalar(key, op, scalars, value, fixed).node
            node.name = name
            node.hint = hint
            node.name_sign = name_sign
        self._sealed = state[1]

    def scalar(self, index: int, sign: int) -> Scalar:
        """Return graph node number `index` as a `Scalar` with the sign 1 or -1."""
        return Scalar(self, self.nodes[index], sign)

    def seal(self) -> None:
        """Fix the names of all present nodes, so that no later derivation renames one."""
        self._sealed = len(self.nodes)

    def symbol(self, symbol: Symbol, *, fixed: bool = False) -> Scalar:
        """Return the node of an input; `fixed` if the input is the same for all samples."""
        return self._scalar((SYM, symbol), SYM, (), symbol, fixed)

    def number(self, c: Fraction | int) -> Scalar | int:
        """Return the node of a constant number; 0, 1 and -1 stay Python integers."""
        c = Fraction(c)
        if c in (0, 1, -1):
            return int(c)
        return self.lift(c)

    def lift(self, value: Scalar | Fraction | int) -> Scalar:
        if isinstance(value, Scalar):
            return value
        c = Fraction(value)
        s = self._scalar((CONST, abs(c)), CONST, (), abs(c), True)
        return s if c >= 0 else -s

    def add(self, a: Scalar, b: Scalar) -> Scalar | int:
        """Return the node of the sum a + b, simplified if an operand is zero or both are one node.

        The first operand of the node has a positive sign, so that a - b and b - a share one node.
        """
        if a.node is b.node:
            return 0 if a.sign != b.sign else self.mul(self.lift(2), a)
        if a.node.op == CONST and a.node.value == 0:
            return b
        if b.node.op == CONST and b.node.value == 0:
            return a
        if a.node.index > b.node.index:
            a, b = b, a
        key = (ADD, a.node.index, b.node.index, a.sign * b.sign)
        b = b if a.sign > 0 else -b
        s = self._scalar(
            key, ADD, (a if a.sign > 0 else -a, b), None, a.node.fixed and b.node.fixed
        )
        return s if a.sign > 0 else -s

    def mul(self, a: Scalar, b: Scalar) -> Scalar | int:
        sign = a.sign * b.sign
        if a.node.op == CONST and b.node.op == CONST:
            return self.number(sign * a.node.value * b.node.value)
        for x, y in ((a, b), (b, a)) if CONST in (a.node.op, b.node.op) else ():
            if x.node.op == CONST and x.node.value == 0:
                return 0
            if x.node.op == CONST and x.node.value == 1:
                return y if x.sign > 0 else -y
        if a.node.index > b.node.index:
            a, b = b, a
        fixed = a.node.fixed and b.node.fixed
        s = self._scalar(
            (MUL, a.node.index, b.node.index), MUL, (_positive(a), _positive(b)), None, fixed
        )
        return s if sign > 0 else -s

    def call(self, op: str, x: Scalar, *more: Scalar, of: Any = None) -> Scalar:
        """Return the node of a function of x, such as cos, sqrt or the positive part max(x, 0).

        Even and odd functions use a positive operand: sin(-x) becomes -sin(x). `of` describes x for
        exact arithmetic, for instance as an Angle (see `Node.value`).
        """
        parity = op in EVEN or op in ODD
        operands = (_positive(x) if parity else x, *more)
        key = (op, *((o.node.index, o.sign) for o in operands))
        s = self._scalar(key, op, operands, None, all(o.node.fixed for o in operands))
        if s.node.value is None and of is not None:
            s.node.value = of if x.sign > 0 else -of
        return -s if op in ODD and x.sign < 0 else s

    def name(self, value: Scalar | int, name: str) -> Scalar | int:
        """Give a name to the node of a value, and return the value.

        The first name of a node stays; inputs and numbers get no other name.
        """
        if isinstance(value, Scalar) and self._may_be_named(value.node):
            value.node.name = name
            value.node.name_sign = value.sign
        return value

    def hint(self, value: Scalar | int, name: str) -> Scalar | int:
        """Suggest a name for a node, used if the node is needed more than once; return the node."""
        if isinstance(value, Scalar) and self._may_be_named(value.node) and value.node.hint is None:
            value.node.hint = name
            value.node.name_sign = value.sign
        return value

    def _may_be_named(self, node: Node) -> bool:
        return node.name is None and node.op not in (SYM, CONST) and node.index >= self._sealed

    def _scalar(
        self, key: tuple[Any, ...], op: str, operands: tuple[Scalar, ...], value: Any, fixed: bool
    ) -> Scalar:
        node = self._node.get(key)
        if node is None:
            if not len(self.nodes) % LOOKS:
                require_time()
            node = Node(len(self.nodes), op, operands, value, fixed)
            self._node[key] = node
            self.nodes.append(node)
        return Scalar(self, node, 1)


def _positive(x: Scalar) -> Scalar:
    return x if x.sign > 0 else -x


def reachable(
    outputs: Iterable[Scalar | int], known: Mapping[int, Any] | None = None
) -> list[Node]:
    """Return the nodes that the outputs depend on, operands first, without the nodes in `known`.

    The order is that of creation.
    """
    nodes: dict[int, Node] = {}
    known = {} if known is None else known
    stack = [o.node for o in outputs if isinstance(o, Scalar) and o.node.index not in known]
    while stack:
        node = stack.pop()
        if node.index in nodes:
            continue
        nodes[node.index] = node
        for x in node.operands:
            if x.node.index not in known:
                stack.append(x.node)
    return [nodes[k] for k in sorted(nodes)] if len(nodes) > 1 else [*nodes.values()]


class Domain(Protocol):
    """A number system in which graph nodes are evaluated: floats, integers modulo a prime p, ...

    Its values have the operations +, -, * and unary minus.
    """

    def symbol(self, symbol: Symbol) -> Any:
        """Return the value of an input of the graph, such as q1."""

    def number(self, c: Fraction) -> Any:
        """Represent the rational number c in this number system."""

    def function(self, node: Node, x: list[Any]) -> Any:
        """Return the value of an operation other than + and *, from the values of its operands."""


def interpret(
    outputs: Sequence[Scalar | int], domain: Domain, known: dict[int, Any] | None = None
) -> list[Any]:
    """Compute the values of graph nodes in a number system; Python integers stay integers.

    known : {index of a node: its value}; the values that are computed here are added to this
    mapping.
    """
    values: dict[int, Any] = {} if known is None else known
    for node in reachable(outputs, values):
        values[node.index] = value_of(node, domain, values)
    return [s if isinstance(s, int) else _signed(s, values) for s in outputs]


def value_of(node: Node, domain: Domain, values: Mapping[int, Any] | Sequence[Any]) -> Any:
    """Compute the value of one node; `values` has those of its operands, by their index."""
    match node.op:
        case "sym":
            return domain.symbol(node.value)
        case "const":
            return domain.number(node.value)
    if node.op in (ADD, MUL):  # of which only the second term of a sum has a sign
        a, b = node.operands
        x, y = values[a.node.index], values[b.node.index]
        return x * y if node.op == MUL else x + y if b.sign > 0 else x - y
    return domain.function(node, [_signed(operand, values) for operand in node.operands])


def _signed(s: Scalar, values: Mapping[int, Any] | Sequence[Any]) -> Any:
    value = values[s.node.index]
    return value if s.sign > 0 else -value


def rates(
    outputs: Sequence[Scalar | int], inputs: Mapping[Symbol, Scalar | int]
) -> list[Scalar | int]:
    """Return the time derivatives of graph nodes, from the rates of the inputs (forward mode)."""
    rate: dict[int, Scalar | int] = {}

    def signed(s: Scalar | int) -> Scalar | int:
        if isinstance(s, int):
            return 0
        return rate[s.node.index] if s.sign > 0 else -rate[s.node.index]

    for node in reachable(outputs):
        x = node.operands
        xd = [signed(operand) for operand in x]
        still = all(v == 0 for v in xd)
        match node.op:
            case "sym":
                rate[node.index] = inputs.get(node.value, 0)
            case _ if still:
                rate[node.index] = 0
            case "add":
                rate[node.index] = xd[0] + xd[1]
            case "mul":
                rate[node.index] = xd[0] * x[1] + x[0] * xd[1]
            case "cos":
                rate[node.index] = -(x[0].graph.call(SIN, x[0], of=node.value) * xd[0])
            case "sin":
                rate[node.index] = x[0].graph.call(COS, x[0], of=node.value) * xd[0]
            case op:
                raise NotImplementedError(f"no rule for the time derivative of {op}")
    return [signed(s) for s in outputs]


Array = np.ndarray[Any, Any]
NUMPY = {name: getattr(np, f.numpy) for name, f in FUNCTIONS.items() if f.numpy} | {POS: np.maximum}
LETTERS = {"q": "q", "qd": "QP", "qdd": "QDP"}


class Floats:
    """Values of the constants and states of a robot, at which its formulas are evaluated.

    Parameters
    ----------
    robot : Robot
        The robot.
    states : mapping, optional
        {input: value} for the inputs that vary, such as q1; rad or m and seconds.
    constants : mapping, optional
        Values that replace constants of the robot file.
    functions : mapping, optional
        Functions, such as cos, of the package whose symbols the states are. Default: NumPy.
    """

    def __init__(
        self,
        robot: Robot,
        states: Mapping[Symbol, Any] | None = None,
        constants: Mapping[str, Any] | None = None,
        functions: Mapping[str, Callable[..., Any]] = NUMPY,
    ) -> None:
        self.robot = robot
        self.states = states or {}
        self.functions = functions
        self.constants = {**robot.constants, **(constants or {})}

    def symbol(self, symbol: Symbol) -> Any:
        """Return the value of an input, such as q1 or a constant of the robot."""
        match symbol.kind:
            case "constant" | "channel":
                return self.constants[symbol.name]
            case "pi":
                return np.pi
            case "number":
                return float(Fraction(symbol.name))
            case "gravity":
                return -self.robot.gravity[int(symbol.name)].value(self.constants)
        return self.states[symbol]

    def number(self, c: Fraction) -> float:
        """Return a rational number, rounded to a float."""
        return float(c)

    def function(self, node: Node, x: list[Any]) -> Any:
        """Apply the function of a node, such as cos or 1/x, to the values x of its operands."""
        if node.op == INV:
            return 1.0 / x[0]
        if node.op == POS:
            return self.functions[POS](x[0], 0.0)
        function = self.functions[node.op]
        if node.op == SQRT and node.fixed:  # of constants, which may have none
            with np.errstate(invalid="raise"):
                return function(*x)
        return function(*x)


def states_of(**states: Mapping[int, Any]) -> dict[Symbol, Any]:
    """Return {graph input: value} from mappings {joint number: value} of q, qd and qdd."""
    return {
        Symbol(kind, f"{LETTERS[kind]}{j}"): x
        for kind, by_joint in states.items()
        for j, x in by_joint.items()
    }
