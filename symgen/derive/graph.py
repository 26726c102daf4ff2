"""Hash-consed expression graph: the one intermediate representation between the recursions and every printer, and the one evaluator of it.

A node is (op, operands); equal nodes are one object, so a shared sub-expression is computed once. Signs live on the edges: a `Scalar` is a node and a sign, negations are free and x and -x share everything. A node may carry a name given by the recursion that made it.
Operations: sym, const (exact rational), add, mul, cos, sin of angles of the robot, sign, pos (positive part max(x, 0)), inv (1/x), sqrt; in the laws of columns also exp, tanh, pow, and any of these of operands of which exact arithmetic knows nothing.

`interpret` gives the values of nodes over a domain: residues of F_p, floats, CasADi's SX, SymPy's objects. `rates` gives their time derivatives, as nodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple, Protocol

from symgen.description.expression import Expression

SYM, CONST, ADD, MUL = "sym", "const", "add", "mul"
COS, SIN, SIGN, POS, SQRT, INV = "cos", "sin", "sign", "pos", "sqrt", "inv"

EVEN, ODD = {COS}, {SIN, SIGN, INV, "tanh"}


class Symbol(NamedTuple):
    """An input of a derivation: two inputs of one name and different kinds are different.

    Attributes
    ----------
    kind : str
        constant, pi, number, q, qd, qdd, qdr, qddr, channel, torque, rate (of a tied joint),
        parameter or gravity.
    name : str
        As it is written: D3, q1, QP1, QDP1, GAM1, G31, XX1; of gravity the axis, 0 to 2; of a
        number of the robot file its value, 2159/5000.
    """

    kind: str
    name: str

    def __str__(self) -> str:
        return self.name


Turn = tuple[tuple[int, int | Fraction], ...]  # ((j, n), ...): the angle sum_j n q_j
ActiveRow = tuple[tuple[int, Expression], ...]  # ((i, G_i), ...): the velocity sum_i G_i qd_i


class Angle(NamedTuple):
    """The angle sum_j n q_j + offset of a cosine or sine."""

    turn: Turn
    offset: Expression

    def __neg__(self) -> Angle:
        return Angle(tuple((j, -n) for j, n in self.turn), -self.offset)


class Velocity(NamedTuple):
    """The velocity G qd of a sign or a positive part, qd of the independent joints."""

    row: ActiveRow

    def __neg__(self) -> Velocity:
        return Velocity(tuple((i, -g) for i, g in self.row))


class Node:
    """One operation of the graph. `operands` are Scalars; `fixed` nodes depend on no sample
    (constants and parameters only).

    `value` says what exact arithmetic has to know: the Symbol of an input, the number of a
    constant, the Angle of a cosine or sine, the Velocity of a sign or positive part, the Expression
    of a square root; None if it knows nothing but the operands. `name` is what the emitted line is called; `hint` is used for the name of a node that turns out
    to be shared and has none.
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
    """A node with a sign; + - * build the graph."""

    __slots__ = ("graph", "node", "sign")

    def __init__(self, graph: Graph, node: Node, sign: int) -> None:
        self.graph = graph
        self.node = node
        self.sign = sign

    def __neg__(self) -> Scalar:
        return Scalar(self.graph, self.node, -self.sign)

    def __add__(self, other: Scalar | int) -> Scalar | int:
        return self.graph.add(self, self.graph.lift(other))

    def __sub__(self, other: Scalar | int) -> Scalar | int:
        return self.graph.add(self, -self.graph.lift(other))

    def __mul__(self, other: Scalar | int) -> Scalar | int:
        return self.graph.mul(self, self.graph.lift(other))

    def __radd__(self, other: int) -> Scalar | int:
        return self.graph.add(self.graph.lift(other), self)

    def __rsub__(self, other: int) -> Scalar | int:
        return self.graph.add(self.graph.lift(other), -self)

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
    """Owner of the nodes; two graphs never mix."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._node: dict[tuple[Any, ...], Node] = {}
        self._sealed = 0  # nodes before this one keep the names they have

    def __getstate__(self) -> tuple[Any, ...]:
        """Nodes as a flat list: a chain of operations may be deeper than Python recurses."""
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
        """The value of a node, or its opposite."""
        return Scalar(self, self.nodes[index], sign)

    def seal(self) -> None:
        """Keep the names of the nodes there are: what is derived later renames none of them."""
        self._sealed = len(self.nodes)

    def symbol(self, symbol: Symbol, *, fixed: bool = False) -> Scalar:
        """An input of the emitted code; `fixed` if it is the same for all samples."""
        return self._scalar((SYM, symbol), SYM, (), symbol, fixed)

    def number(self, c: Fraction | int) -> Scalar | int:
        """A constant; 0, 1 and -1 stay Python integers."""
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
        """a + b; the node is kept with its first operand positive, so that a - b and b - a are one node."""
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
        """A function of the table of `description.expression`, or the positive part: even and odd ones of a positive operand.
        `of` is what x is, as `Node.value` says it.
        """
        parity = op in EVEN or op in ODD
        operands = (_positive(x) if parity else x, *more)
        key = (op, *((o.node.index, o.sign) for o in operands))
        s = self._scalar(key, op, operands, None, all(o.node.fixed for o in operands))
        if s.node.value is None and of is not None:
            s.node.value = of if x.sign > 0 else -of
        return -s if op in ODD and x.sign < 0 else s

    def name(self, value: Scalar | int, name: str) -> Scalar | int:
        """Call an operation `name`; the first name holds, inputs and numbers keep theirs."""
        if isinstance(value, Scalar) and self._may_be_named(value.node):
            value.node.name = name
            value.node.name_sign = value.sign
        return value

    def hint(self, value: Scalar | int, name: str) -> Scalar | int:
        """Suggest a name for an operation, to be used if it is needed more than once."""
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
            node = Node(len(self.nodes), op, operands, value, fixed)
            self._node[key] = node
            self.nodes.append(node)
        return Scalar(self, node, 1)


def _positive(x: Scalar) -> Scalar:
    return x if x.sign > 0 else -x


def reachable(
    outputs: Iterable[Scalar | int], known: Mapping[int, Any] | None = None
) -> list[Node]:
    """Nodes that the outputs need, in order of creation (operands first), but those `known`."""
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
    """Where values of graph nodes are: anything with + * and unary minus."""

    def symbol(self, symbol: Symbol) -> Any:
        """The value of an input."""

    def number(self, c: Fraction) -> Any:
        """Represent the rational number c in this domain."""

    def function(self, node: Node, x: list[Any]) -> Any:
        """The value of any other operation than + and *, by those of its operands."""


def interpret(
    outputs: Sequence[Scalar | int], domain: Domain, known: dict[int, Any] | None = None
) -> list[Any]:
    """The values of graph scalars over a domain; 0, 1 and -1 stay whole numbers.

    known : values of nodes by their index; those that are needed besides them are added.
    """
    value: dict[int, Any] = {} if known is None else known

    def signed(s: Scalar | int) -> Any:
        if isinstance(s, int):
            return s
        return value[s.node.index] if s.sign > 0 else -value[s.node.index]

    for node in reachable(outputs, value):
        x = [signed(operand) for operand in node.operands]
        match node.op:
            case "sym":
                made = domain.symbol(node.value)
            case "const":
                made = domain.number(node.value)
            case "add":
                made = x[0] + x[1]
            case "mul":
                made = x[0] * x[1]
            case _:
                made = domain.function(node, x)
        value[node.index] = made
    return [signed(s) for s in outputs]


def rates(
    outputs: Sequence[Scalar | int], inputs: Mapping[Symbol, Scalar | int]
) -> list[Scalar | int]:
    """The rates of change of graph scalars where inputs change at these rates, in forward mode."""
    rate: dict[int, Scalar | int] = {}

    def signed(s: Scalar | int) -> Scalar | int:
        if isinstance(s, int):
            return 0
        return rate[s.node.index] if s.sign > 0 else -rate[s.node.index]

    for node in reachable(outputs):
        x = node.operands
        xd = [signed(operand) for operand in x]
        still = all(isinstance(v, int) and v == 0 for v in xd)
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
                raise NotImplementedError(f"the rate of {op}")
    return [signed(s) for s in outputs]
