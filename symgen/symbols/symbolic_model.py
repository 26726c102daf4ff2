"""One model of one robot: its closed form, multiplied out and factored by parameter, or its recursion as a listing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product

from symgen.description.expression import ONE, Expression
from symgen.errors import SymgenError
from symgen.regroup.formula import Formula
from symgen.symbols.closed import ClosedForm, Expansion, Group
from symgen.symbols.derivation import Derivation, Source
from symgen.symbols.frames import Frames
from symgen.symbols.listing import Listing
from symgen.symbols.models import LARGEST_DIRECT, MODELS, STEPS, TWIST, Entries, Model, Place, Request
from symgen.symbols.polynomial import Polynomial, TooManyTermsError

LARGEST = 10_000  # terms of a model, multiplied out


@dataclass(frozen=True)
class ClosedModel:
    """Entries that differ from zero, each over `denominator` where there is one, and the angles that their C and S stand for."""

    entries: Mapping[Place, ClosedForm]
    denominator: ClosedForm | None
    angles: Mapping[str, Expression]

    @property
    def size(self) -> int:
        """Terms as they are written."""
        return sum(group.size for entry in (*self.entries.values(), self.denominator or ()) for group in entry)


@dataclass(frozen=True)
class SymbolicModel:
    """A model asked of a robot.

    Attributes
    ----------
    model : Model
        Which one.
    source : Source
        The robot with its parameters, closure and given values.
    request : Request
        Which frame's, in which frame.
    rows : tuple of int or None
        Rows of the Jacobian, from 1, whose determinant is meant.
    limit : int
        Terms that the closed form may have, multiplied out.
    """

    model: Model
    source: Source
    request: Request
    rows: tuple[int, ...] | None = None
    limit: int = LARGEST

    @property
    def axes(self) -> tuple[tuple[str, ...], ...]:
        """Labels of the rows, and of the columns."""
        robot = self.source.robot
        labels = {
            "pose": ("1", "2", "3", "4"),
            "twist": TWIST,
            "joints": tuple(map(str, robot.joints)),
            "parameters": self.source.parameters,
            "equations": tuple(str(k + 1) for k in range(len(self.source.closure.tied) if not self._all_loops else 6 * len(robot.loops))),
        }
        return tuple(labels[axis] for axis in self.model.axes)

    @property
    def _all_loops(self) -> bool:
        return self.source.closure is not self.source.relations

    @property
    def places(self) -> list[Place]:
        """All places, row by row; of a symmetric matrix those on and above the diagonal."""
        places = list(product(*(range(len(labels)) for labels in self.axes)))
        return [p for p in places if not self.model.symmetric or p[0] <= p[1]]

    def label(self, place: Place) -> str:
        """The name of an entry: A(1,2), GAM(3), E; the base parameters by theirs."""
        if self.model.name == "base_parameters":
            return self.source.parameters[place[0]]
        inside = ",".join(labels[k] for labels, k in zip(self.axes, place, strict=True))
        return f"{self.model.letter}({inside})" if place else self.model.letter

    @property
    def title(self) -> str:
        """Which model of which robot."""
        return f"{self.source.robot.title or self.source.robot.name}: {self.model.name.replace('_', ' ')}"

    @property
    def summary(self) -> str:
        """What the model is, its frames by their numbers."""
        text = self.model.summary[0].upper() + self.model.summary[1:]
        if self.model.of_frames:
            text = text.replace("frame `of`", f"frame {self.request.of}").replace("frame `frame`", f"frame {self.request.frame}")
        return f"{text}."

    # --- closed form ---

    @cached_property
    def closed(self) -> ClosedModel:
        """The closed form. Raises SymgenError where it has too many terms, or where the model has none; the message names the form that works."""
        try:
            return self._closed()
        except TooManyTermsError as e:
            more = (
                "its entries can be had from the inertia matrix and the bias by recursion"
                if self.model.entries is None
                else f"its recursion has {len(self.listing.lines)} equations: form recursive"
            )
            raise SymgenError(f"the closed form of {self.model.name} of {self.source.robot.name} has {e}; {more}") from e

    def _closed(self) -> ClosedModel:
        name = self.model.name
        if name == "base_parameters":
            formulas: dict[Place, ClosedForm] = {(k,): of_formula(f) for k, f in enumerate(self.source.formulas.values())}
            return ClosedModel(formulas, None, {})
        if self.model.letter == "C":
            self.refuse_tied("C(q, qd)")
        d = Derivation(self.source)
        Frames(d.geometry).register_angles()
        if name == "determinant":
            expansion, polynomials = self._determinant(d)
        elif name == "coriolis" and not any(f"q{j}" in self.source.given for j in self.source.robot.joints):  # it differentiates by them
            expansion, polynomials = self._christoffel(d)
        elif name == "forward_dynamics":
            return self._direct(d)
        else:
            expansion, polynomials = self._expanded(d, self.model)
        return self._collected(expansion, polynomials)

    def _expanded(self, d: Derivation, model: Model) -> tuple[Expansion, dict[Place, Polynomial]]:
        assert model.entries is not None
        entries: Entries = {place: x for place, x in model.entries(d, self.request).items() if not model.symmetric or place[0] <= place[-1]}
        expansion = Expansion(d.algebra, self.source.parameters, self.limit)
        return expansion, dict(zip(entries, expansion.of(list(entries.values())), strict=True))

    def _collected(self, expansion: Expansion, polynomials: Mapping[Place, Polynomial], below: Polynomial | None = None) -> ClosedModel:
        total = sum(map(len, polynomials.values())) + len(below or ())
        if total > self.limit:
            raise TooManyTermsError(f"{total} terms, more than {self.limit}")
        entries = {place: form for place, a in polynomials.items() if (form := expansion.collected(a))}
        denominator = None if below is None else expansion.collected(below)
        return ClosedModel(entries, denominator, expansion.angles_in((*entries.values(), denominator or ())))

    def _christoffel(self, d: Derivation) -> tuple[Expansion, dict[Place, Polynomial]]:
        """C_ij = sum_k 1/2 (dA_ij/dq_k + dA_ik/dq_j - dA_jk/dq_i) qd_k."""
        robot = self.source.robot
        expansion, A = self._expanded(d, MODELS["inertia_matrix"])
        ring, n = expansion.ring, len(robot.joints)
        derivative = {(place, k): ring.derivative(a, f"q{j}", j) for place, a in A.items() for k, j in enumerate(robot.joints)}

        def dA(i: int, j: int, k: int) -> Polynomial:
            return derivative.get(((min(i, j), max(i, j)), k), {})

        C: dict[Place, Polynomial] = {}
        for i, j in product(range(n), repeat=2):
            total: Polynomial = {}
            for k in range(n):
                slope = ring.add(ring.add(dA(i, j, k), dA(i, k, j)), dA(j, k, i), -1)
                (rate,) = expansion.of([d.algebra.qd(robot.joints[k])])
                total = ring.add(total, ring.mul(slope, ring.scaled(rate, Fraction(1, 2))))
            C[i, j] = total
        return expansion, C

    def refuse_tied(self, what: str) -> None:
        if self.source.closure.tied:
            tied = ", ".join(f"q{u}" for u in self.source.closure.tied)
            raise SymgenError(
                f"{what} of {self.source.robot.name} has no closed form in its actuated joints while {tied} are symbols; "
                "bias has C qd + Q + friction, with the passive joints as symbols"
            )

    def _determinant(self, d: Derivation) -> tuple[Expansion, dict[Place, Polynomial]]:
        """Of the whole Jacobian in the frames that give the fewest terms: neither the frame nor the point of the last link changes it."""
        robot, n, best = self.source.robot, len(self.source.robot.joints), None
        if n > 6:
            raise SymgenError(
                f"the Jacobian of {robot.name} is 6 x {n}: no rows of it make a square matrix; take jacobian, and det(J*J.T) in SymPy"
            )
        path = robot.path(self.request.of)
        if n == 6 and self.rows is None and self.request.of:
            moving = {j for j in path if j in robot.moving}
            pairs = [(j, i) for j in path if moving <= set(robot.path(j)) for i in (0, *path)]  # every j is on the last link
        else:
            pairs = [(self.request.of, self.request.frame)]
        for j, i in pairs:
            expansion, entries = self._expanded_at(d, j, i)
            size = sum(map(len, entries.values()))
            if best is None or size < best[0]:
                best = (size, expansion, entries)
        assert best is not None
        _, expansion, J = best
        matrix = [[J.get((k, m), {}) for m in range(n)] for k in range(6)]
        chosen = self._chosen_rows(matrix, n)
        determinant = expansion.ring.determinant([matrix[k] for k in chosen])
        return expansion, {(): determinant}

    def _chosen_rows(self, matrix: Sequence[Sequence[Polynomial]], n: int) -> list[int]:
        """The rows asked for, else those that are not zero, if they make a square matrix."""
        if self.rows is not None:
            if sorted(set(self.rows)) != sorted(self.rows) or not all(1 <= k <= 6 for k in self.rows) or len(self.rows) != n:
                raise SymgenError(f"rows {list(self.rows)}; expected {n} different rows of the Jacobian among 1 to 6 ({', '.join(TWIST)})")
            return [k - 1 for k in self.rows]
        moved = [k for k, row in enumerate(matrix) if any(row)]
        if len(moved) != n:
            first = [k + 1 for k in (moved + [k for k in range(6) if k not in moved])[:n]]
            raise SymgenError(
                f"the Jacobian of frame {self.request.of} of {self.source.robot.name} in frame {self.request.frame} has {len(moved)} rows that "
                f"are not zero ({', '.join(TWIST[k] for k in moved)}) and {n} columns; name {n} of its rows, 1 to 6: "
                f"rows={tuple(first)}, --rows {','.join(map(str, first))}"
            )
        return moved

    def _expanded_at(self, d: Derivation, j: int, i: int) -> tuple[Expansion, dict[Place, Polynomial]]:
        entries = MODELS["jacobian"].entries(d, Request(j, i))  # type: ignore[misc]
        expansion = Expansion(d.algebra, self.source.parameters, self.limit)
        polynomials = expansion.of(list(entries.values()))
        return expansion, {place: expansion.ring.tidy(a) for place, a in zip(entries, polynomials, strict=True)}

    def _direct(self, d: Derivation) -> ClosedModel:
        """qdd = adj(A) (Gamma - H) / det A."""
        robot, n = self.source.robot, len(self.source.robot.joints)
        if n > LARGEST_DIRECT:
            raise SymgenError(
                f"the direct model of {robot.name} has {n} joints; its closed form is given up to {LARGEST_DIRECT}: solve A qdd = Gamma - H with "
                "inertia_matrix and bias, or take forward_dynamics of the emitted module"
            )
        A = MODELS["inertia_matrix"].entries(d, self.request)  # type: ignore[misc]
        H = MODELS["bias"].entries(d, self.request)  # type: ignore[misc]
        for name in {f"GAM{j}" for j in robot.joints} & {*robot.constants}:
            raise SymgenError(f"two quantities would be called {name}; rename the constant of that name in the robot file")
        torques = [d.algebra.graph.symbol(f"GAM{j}") for j in robot.joints]
        expansion = Expansion(d.algebra, self.source.parameters, self.limit)
        ring = expansion.ring
        a = dict(zip(A, expansion.of(list(A.values())), strict=True))
        rest = [ring.add(g, h, -1) for g, h in zip(expansion.of(torques), expansion.of(list(H.values())), strict=True)]
        rows = [[a[i, k] for k in range(n)] for i in range(n)]
        numerators: dict[Place, Polynomial] = {
            (i,): ring.determinant([[*row[:i], rest[k], *row[i + 1 :]] for k, row in enumerate(rows)]) for i in range(n)
        }  # Cramer
        return self._collected(expansion, numerators, ring.determinant(rows))

    # --- recursion ---

    @cached_property
    def listing(self) -> Listing:
        """The recursion as equations in the order in which they are computed. Raises SymgenError where the model has none."""
        entries = STEPS.get(self.model.name, self.model.entries)
        if entries is None:
            works = {
                "determinant": "form closed, or the equations of jacobian",
                "forward_dynamics": "A qdd = Gamma - H, with the equations of inertia_matrix and bias",
                "base_parameters": "form closed, or symgen show ROBOT --recursive for the regrouping link by link",
            }[self.model.name]
            raise SymgenError(f"{self.model.name} has no recursion; what works is {works}")
        if self.model.name == "coriolis":
            self.refuse_tied("C(q, qd)")
        d = Derivation(self.source)
        values = entries(d, self.request)
        outputs = {place: values[place] for place in self.places if place in values}
        return Listing(d.algebra, {self.label(place): x for place, x in outputs.items()}, list(outputs))


def of_formula(formula: Formula) -> ClosedForm:
    """A regrouping formula as groups that share a coefficient."""
    groups = []
    for c, members in formula.groups():
        first = members[0][0]
        total = Expression()
        for added, name in members:
            total = total + Expression.symbol(name) * (1 if added == first else -1)
        signed = c if first else -c
        groups.append(Group(total, signed, ONE) if len(c.terms) == 1 else Group(total, ONE, signed))
    return tuple(groups)
