"""One model of one robot: in closed form, factored by parameter, or as recursive equations.

The equations are listed in the order in which they are computed. Intermediate variables have the
names of SYMORO. As in emitted code, an expression has an equation of its own if it has a name or is
used more than once; any other expression is written inside the only equation that uses it.

As SymPy objects, every symbol is real and has the name used in the robot file or in the recursion:
q1, QP1 and QDP1 for position, velocity and acceleration of joint 1, GAM1 for its torque. Numbers
are exact. Cosines and sines are written with their angles: C23 is cos(q2 + q3).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Any

import sympy

from symgen.derive.algebra import GraphAlgebra
from symgen.derive.geometry import Frames
from symgen.derive.graph import INV, POS, SYM, Angle, Domain, Node, Scalar, Symbol, interpret
from symgen.derive.models import MODELS, TWIST, Model, Place, Request, labels, rewriting
from symgen.description.expression import FUNCTIONS, Expression
from symgen.description.grammar import parse
from symgen.description.naming import Namespace
from symgen.emit.printers import PLAIN, Text
from symgen.errors import SymgenError
from symgen.symbols import expressions
from symgen.symbols.expansion import Expansion, Polynomial, TooManyTermsError, length
from symgen.symbols.expressions import Tree, angle, evaluated, rational, rounded, symbol
from symgen.symbols.source import Source


class NoClosedFormError(SymgenError):
    """Error raised if a closed form has too many terms.

    Parameters
    ----------
    reason : str
        Description of the closed form that is too large.
    instead : str
        Form or models that can be used instead.
    """

    def __init__(self, reason: str, instead: str) -> None:
        self.reason, self.instead = reason, instead
        super().__init__(f"{reason}; {instead}")


@dataclass(frozen=True)
class Equation:
    """An equation `name = expression` as two texts, printed under the heading `section`."""

    section: str
    name: str
    expression: str


class Listing:
    """The equations that compute the entries of a model, intermediate variables first.

    Parameters
    ----------
    algebra : GraphAlgebra
        The algebra that made the graph of the outputs.
    outputs : mapping
        Value of each entry of the model, by its label.
    places : sequence of tuple
        Indices of each entry in the model.
    parameters : iterable of str
        Names of the parameters, which no intermediate variable may have.
    decimals : bool
        Whether constants are written as decimals, such as SA2 = 0.999 in place of sin(1.571).
    """

    def __init__(
        self,
        algebra: GraphAlgebra,
        outputs: Mapping[str, Scalar | int],
        places: Sequence[tuple[int, ...]],
        parameters: Iterable[str],
        *,
        decimals: bool = False,
    ) -> None:
        self.decimals = decimals
        self.graph, self.outputs, self.places = algebra.graph, dict(outputs), list(places)
        values = list(self.outputs.values())
        names = Namespace((*algebra.robot.constants, *parameters))
        labels = [x.replace("(", "").replace(")", "").replace(",", "") for x in self.outputs]
        self.text = Text(values, algebra.sections, names, labels, PLAIN)

    @property
    def lines(self) -> list[Equation]:
        """Equations of all intermediate variables, then of all nonzero entries of the model."""
        steps = [
            Equation(section.title, *line.split(" = ", 1))
            for section in self.text.sections
            for line in section.lines
        ]
        if self.decimals:
            steps = _in_decimals(steps)
        results = [
            Equation("Result", label, str(x) if isinstance(x, int) else self.text.expression(x))
            for label, x in self.outputs.items()
            if isinstance(x, Scalar) or x
        ]
        return steps + results

    def steps(
        self, domain: Domain, symbol: Callable[[str], Any]
    ) -> tuple[dict[str, Any], list[Any]]:
        """Convert the equations to objects other than texts, such as SymPy expressions.

        Returns the value of each intermediate variable by name, and the list of the outputs. Each
        value is in terms of the symbols of the inputs and of earlier variables.

        domain : operations on the values of nodes.
        symbol : function that makes a symbol from its name.
        """
        text = self.text
        value = {n.index: symbol(text.called[n.index]) for n in text.nodes if n.op == SYM}
        steps: dict[str, Any] = {}
        for node in text.nodes:
            if node.index in text.named:
                name, sign = text.called[node.index], text.sign[node.index]
                (made,) = interpret([self.graph.scalar(node.index, sign)], domain, value)
                steps[name] = made
                value[node.index] = sign * symbol(name)
        return steps, interpret([*self.outputs.values()], domain, value)


def _in_decimals(equations: Sequence[Equation]) -> list[Equation]:
    """Replace the right-hand sides of constants that depend on numbers alone by decimals."""
    values: dict[str, Expression] = {}
    result = []
    for equation in equations:
        if equation.section == "Constants":
            value = parse(equation.expression, None).substitute(values)
            if not value.symbols:
                values[equation.name] = value = rounded(value)
                equation = replace(equation, expression=str(value))
        result.append(equation)
    return result


LARGEST_DIRECT = 3  # joints of a direct model in closed form
LARGEST = 10_000  # terms of a model, multiplied out


@dataclass(frozen=True)
class ClosedModel:
    """The closed form of a model: formulas of its nonzero entries, and a common denominator.

    The denominator is None for most models. `angles` explains the symbols C and S in the formulas.
    """

    entries: Mapping[Place, Tree]
    denominator: Tree | None
    angles: Mapping[str, Expression]

    @property
    def size(self) -> int:
        """Number of terms of all formulas as they are written, products not multiplied out."""
        below = () if self.denominator is None else (self.denominator,)
        return sum(map(expressions.size, (*self.entries.values(), *below)))


@dataclass(frozen=True)
class SymbolicModel:
    """One model of a robot, in closed form and as a recursion.

    Attributes
    ----------
    model : Model
        The kind of model, for instance the inertia matrix.
    source : Source
        The robot with its parameters, closure and given values.
    request : Request
        The frame that the model describes, and the frame of its components.
    rows : tuple of int or None
        Rows of the Jacobian, from 1, of which the determinant is computed.
    limit : int
        Largest number of terms of the expanded closed form.
    """

    model: Model
    source: Source
    request: Request
    rows: tuple[int, ...] | None = None
    limit: int = LARGEST

    @property
    def axes(self) -> tuple[tuple[str, ...], ...]:
        """Names of the rows of the model's matrix or vector, then of the columns of a matrix."""
        d, parameters = self.source.derivation, self.source.parameters
        return tuple(labels(d, axis, parameters) for axis in self.model.axes)

    @property
    def places(self) -> list[Place]:
        """Indices of the entries of the matrix or vector of the model, row by row.

        For a symmetric matrix, only the entries on and above the diagonal are listed.
        """
        places = list(product(*(range(len(labels)) for labels in self.axes)))
        return [p for p in places if not self.model.symmetric or p[0] <= p[1]]

    def label(self, place: Place) -> str:
        """Return the name of an entry, for instance A(1,2), GAM(3) or E.

        A base parameter has its own name.
        """
        if self.model.axes == ("parameters",):
            return self.source.parameters[place[0]]
        inside = ",".join(labels[k] for labels, k in zip(self.axes, place, strict=True))
        return f"{self.model.letter}({inside})" if place else self.model.letter

    @property
    def title(self) -> str:
        """Title of the model: name of the robot, then name of the model."""
        return (
            f"{self.source.robot.title or self.source.robot.name}: "
            f"{self.model.name.replace('_', ' ')}"
        )

    @property
    def summary(self) -> str:
        """Description of the model, with the numbers of its frames."""
        text = self.model.summary
        if self.model.of_frames:
            text = text.replace("frame `of`", f"frame {self.request.of}").replace(
                "frame `frame`", f"frame {self.request.frame}"
            )
        return text

    # --- closed form ---

    @cached_property
    def closed(self) -> ClosedModel:
        """The closed form of the model: each entry as one factored formula.

        Raises NoClosedFormError if the closed form has too many terms, SymgenError if there is no
        closed form; the message names the form that works.
        """
        try:
            return self._closed()
        except TooManyTermsError as e:
            more = (
                "compute its entries from the models inertia_matrix and bias in form recursive"
                if self.model.cases is None
                else f"use form recursive, with {len(self.listing.lines)} equations"
            )
            told = f"the closed form of {self.model.name} of {self.source.robot.name} has {e}"
            raise NoClosedFormError(told, more) from e

    def _closed(self) -> ClosedModel:
        composed = {
            "formulas": self._formulas,
            "determinant": self._determinant,
            "quotient": self._quotient,
        }
        if self.model.composed:
            return composed[self.model.composed]()
        algebra, entries = self._entries(self.model)
        expansion = self._expansion(algebra, entries)
        return self._collected(expansion, {place: expansion.of(x) for place, x in entries.items()})

    def _formulas(self) -> ClosedModel:
        formulas = self.source.formulas.values()
        return ClosedModel({(k,): expressions.formula(f) for k, f in enumerate(formulas)}, None, {})

    def _entries(self, *models: Model, request: Request | None = None) -> tuple[Any, ...]:
        """Derive the entries of several models as nodes of one expression graph.

        Returns the algebra of the graph, then the entries of each model by their indices. The
        angles between parallel axes of all pairs of frames are added to the graph, for use in
        `Identities`.
        """
        d, request = self.source.derivation, request or self.request
        rewrite = rewriting(d, request)
        entries = [
            {e.place: e.value for e in model.values(d, request, rewrite, closed=True).entries}
            for model in models
        ]
        Frames(d.geometry).register_angles(rewrite.algebra)
        angles = (n.value for n in d.algebra.graph.nodes if isinstance(n.value, Angle))
        for turn, offset in dict.fromkeys(angles):
            if turn and not any(Symbol("q", f"q{j}") in request.inputs for j, _ in turn):
                rewrite.algebra.cos_sin(turn, offset)
        return rewrite.algebra, *entries

    def _expansion(self, algebra: GraphAlgebra, *outputs: Mapping[Any, Scalar | int]) -> Expansion:
        values = [x for entries in outputs for x in entries.values()]
        return Expansion(
            algebra, self.source.parameters, values, self.limit, decimals=self.source.decimals
        )

    def _collected(
        self,
        expansion: Expansion,
        polynomials: Mapping[Place, Polynomial],
        below: Polynomial | None = None,
    ) -> ClosedModel:
        total = sum(map(length, (*polynomials.values(), below or {})))
        if total > self.limit:
            raise TooManyTermsError(f"{total} terms, more than {self.limit}")
        entries = {place: x for place, a in polynomials.items() if (x := expansion.written(a))}
        denominator = None if below is None else expansion.written(below)
        used = {
            str(x)
            for tree in (*entries.values(), denominator or expressions.MINUS)
            for x in tree.free_symbols
        }
        angles = {
            str(x): sum((Expression.symbol(f"q{j}") * n for j, n in turn), rest)
            for (turn, rest), names in expansion.names.items()
            for x in names
            if str(x) in used
        }
        return ClosedModel(entries, denominator, angles)

    def _determinant(self) -> ClosedModel:
        """Compute the determinant of the Jacobian, or of a square matrix of some of its rows.

        The determinant of a whole 6 x 6 Jacobian does not depend on the frame of its components nor
        on the point of the last link, so the choice with the fewest terms is used.
        """
        robot, n, of = self.source.robot, len(self.source.robot.joints), self.request.of
        if n > 6:
            raise SymgenError(
                f"the Jacobian of {robot.name} is 6 x {n}, so no selection of its rows is a square "
                "matrix; use the model jacobian and det(J*J.T) in SymPy"
            )
        requests = [self.request]
        if n == 6 and self.rows is None and of:
            path = robot.path(of)
            moving = {j for j in path if j in robot.moving}
            on_the_last_link = [j for j in path if moving <= set(robot.path(j))]
            requests = [self.source.request(j, i) for j in on_the_last_link for i in (0, *path)]
        candidates = [self._jacobian(request) for request in requests]
        expansion, J = min(candidates, key=lambda made: sum(map(length, made[1].values())))
        rows = [[J.get((k, m), expansion.ring(0)) for m in range(n)] for k in range(6)]
        minor = expansion.determinant([rows[k] for k in self._chosen_rows(rows, n)])
        return self._collected(expansion, {(): minor})

    def _jacobian(self, request: Request) -> tuple[Expansion, Mapping[Place, Any]]:
        algebra, entries = self._entries(MODELS["jacobian"], request=request)
        expansion = self._expansion(algebra, entries)
        return expansion, {p: expansion.tidied(expansion.of(x)) for p, x in entries.items()}

    def _chosen_rows(self, matrix: Sequence[Sequence[Polynomial]], n: int) -> list[int]:
        """Choose the rows of the Jacobian for its determinant, as many as it has columns.

        The rows are those that the user gave, else all rows that are not zero. Raises SymgenError
        if they do not make a square matrix.
        """
        if self.rows is not None:
            rows = {k for k in self.rows if 1 <= k <= 6}
            if not len(rows) == len(self.rows) == n:
                raise SymgenError(
                    f"rows {list(self.rows)}; expected {n} different rows of the Jacobian, each "
                    f"a number from 1 to 6 ({', '.join(TWIST)})"
                )
            return [k - 1 for k in self.rows]
        moved = [k for k, row in enumerate(matrix) if any(row)]
        if len(moved) != n:
            first = [k + 1 for k in (moved + [k for k in range(6) if k not in moved])[:n]]
            raise SymgenError(
                f"a determinant needs a square matrix, but this Jacobian has {n} columns and "
                f"{len(moved)} rows that are not zero ({', '.join(TWIST[k] for k in moved)}); choose "
                f"{n} rows: --rows {','.join(map(str, first))}, or rows={tuple(first)} in Python"
            )
        return moved

    def _quotient(self) -> ClosedModel:
        """Solve the direct dynamic model by Cramer's rule, qdd = adj(A) (Gamma - H) / det A."""
        robot = self.source.robot
        n = range(len(robot.joints))
        if robot.base_is_free:
            raise SymgenError(
                f"the direct model of {robot.name}, whose base is free, has no closed form; solve "
                "A (a0, wd0, qdd) = Gamma - H with inertia_matrix and bias, or use "
                "forward_dynamics of the generated module"
            )
        if robot.loaded:
            raise SymgenError(
                f"the direct model of {robot.name} has no closed form: the laws of "
                f"{', '.join(robot.loaded)} use tau_model, which depends on qdd, so A qdd = Gamma - H "
                "is implicit in qdd; use forward_dynamics of the generated module"
            )
        if len(n) > LARGEST_DIRECT:
            raise SymgenError(
                f"the direct model of {robot.name} has {len(n)} joints; the closed form is limited to "
                f"{LARGEST_DIRECT} joints; solve A qdd = Gamma - H with "
                "inertia_matrix and bias, or use forward_dynamics of the generated module"
            )
        algebra, A, H = self._entries(MODELS["inertia_matrix"], MODELS["bias"])
        torques = {(k,): algebra.graph.symbol(Symbol("torque", f"GAM{robot.joints[k]}")) for k in n}
        expansion = self._expansion(algebra, A, H, torques)
        rest = [expansion.checked(expansion.of(torques[k,]) - expansion.of(H[k,])) for k in n]
        rows = [[expansion.of(A[min(i, k), max(i, k)]) for k in n] for i in n]
        above: dict[Place, Polynomial] = {
            (i,): expansion.determinant([[*rows[k][:i], rest[k], *rows[k][i + 1 :]] for k in n])
            for i in n
        }
        return self._collected(expansion, above, expansion.determinant(rows))

    # --- recursion ---

    @cached_property
    def listing(self) -> Listing:
        """The recursion of the model as equations, in the order in which they are computed.

        Raises SymgenError if the model has no recursion.
        """
        if self.model.cases is None:
            raise SymgenError(f"{self.model.name} has no recursive form; use {self.model.instead}")
        values = self.model.values(self.source.derivation, self.request)
        by_place = {entry.place: entry.value for entry in values.entries}
        outputs = {place: by_place[place] for place in self.places if place in by_place}
        labelled = {self.label(place): x for place, x in outputs.items()}
        return Listing(
            values.algebra,
            labelled,
            list(outputs),
            self.source.parameters,
            decimals=self.source.decimals,
        )


FACTORED = 300  # terms of a determinant, up to which it is factored over the rationals


def of_model(model: SymbolicModel) -> Any:
    """Convert the closed form of a model to a SymPy object.

    A matrix is a Matrix, a vector a Matrix of one column, a scalar an expression.
    """
    closed = model.closed
    angles = {name: evaluated(angle(name[0], e), {}) for name, e in closed.angles.items()}
    values = {place: evaluated(x, angles) for place, x in closed.entries.items()}
    if closed.denominator is not None:
        below = evaluated(closed.denominator, angles)
        values = {place: x / below for place, x in values.items()}
    if not model.axes and model.model.cases is None and closed.size <= FACTORED:
        values = {place: sympy.factor(x) for place, x in values.items()}
    return _shaped(model, values)


def of_listing(model: SymbolicModel) -> tuple[list[tuple[Any, Any]], Any]:
    """Return a model in SymPy: its recursive equations, and the model in terms of the variables
    that the equations define.

    As from `sympy.cse`, an equation is a pair (symbol, expression).
    """
    steps, outputs = model.listing.steps(Objects(), symbol)
    values = dict(zip(model.listing.places, map(sympy.sympify, outputs), strict=True))
    return [(symbol(name), x) for name, x in steps.items()], _shaped(model, values)


def _shaped(model: SymbolicModel, values: Mapping[tuple[int, ...], Any]) -> Any:
    shape = [len(labels) for labels in model.axes]
    if not shape:
        return values.get((), sympy.Integer(0))
    if model.model.symmetric:
        values = {**values, **{place[::-1]: x for place, x in values.items()}}
    rows, columns = (*shape, 1)[:2]
    return sympy.Matrix(
        rows, columns, lambda k, m: values.get((k, m)[: len(shape)], sympy.Integer(0))
    )


class Objects:
    """Operations that convert the nodes of an expression graph to SymPy objects.

    `rational` is the function that converts a rational number.
    """

    def __init__(self, rational: Callable[[Fraction], Any] = rational) -> None:
        self.number = rational

    def symbol(self, symbol_: Symbol) -> Any:
        """Make a SymPy symbol with the name of an input (joint variable, parameter, constant)."""
        return symbol(symbol_.name)

    def function(self, node: Node, x: list[Any]) -> Any:
        """Apply the function of a graph node, such as cos, to its operands x in SymPy."""
        if node.op == INV:
            return 1 / x[0]
        if node.op == POS:
            return sympy.Max(x[0], 0)
        return getattr(sympy, FUNCTIONS[node.op].sympy)(*x, evaluate=node.value is not None)
