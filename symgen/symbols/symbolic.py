"""`symgen.symbolic`: the models of a robot as SymPy objects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from symgen.derive.models import SYMBOLIC
from symgen.derive.names import Names
from symgen.description.files import robot_of
from symgen.description.robot import Robot
from symgen.errors import SymgenError, require, require_name
from symgen.symbols.documents import Formulas, printed
from symgen.symbols.expressions import symbol
from symgen.symbols.source import Source, source_of
from symgen.symbols.symbolic_model import LARGEST, SymbolicModel, of_listing, of_model


def symbolic(
    robot: Robot | str | Path,
    *,
    parameters: str = "base",
    values: Mapping[str, Any] | None = None,
    passive: str | None = None,
    limit: int = LARGEST,
    decimals: bool = False,
) -> SymbolicRobot:
    """Prepare the models of a robot as exact SymPy objects.

    The closed form of a model is a method of the result; its recursion comes from the method
    `equations`.

    Parameters
    ----------
    robot : Robot, str or Path
        A robot, the name of a packaged robot or a file, as for `load_robot`.
    parameters : str
        "base": the dynamics in base parameters; "standard": in XX1, ..., M1, Ia1, ...
    values : mapping, optional
        Value of any symbol (constants, q1, QP1, QDP1, parameters), by name: a number, or a text as
        in robot files ("pi/2"). Terms that become zero are removed from the recursion.
    passive : str, optional
        How passive joints of closed loops are written. "functions": as functions of the actuated
        joints, if the relation is linear. "symbols": all passive joints stay symbols, and the model
        `closure` has their equations, closure = 0. Default: functions for joints with a linear
        relation, symbols for the others.
    limit : int
        Largest number of terms of a closed form before it is factored. A longer closed form is
        refused; a recursion has no limit.

    decimals : bool
        Whether functions of numbers alone, such as sin(1.571), are written as decimals.

    Returns
    -------
    SymbolicRobot
        The models. Each is derived only when it is called.

    Raises
    ------
    SymgenError
        A value is given for an unknown symbol, or "functions" is requested and passive joints have
        no linear relation.

    Examples
    --------
    >>> import symgen
    >>> arm = symgen.symbolic("planar_2r")
    >>> arm.inertia_matrix()[0, 1]
    D2*MX2*cos(q2) - D2*MY2*sin(q2) + ZZ2
    """
    require(values, (Mapping, type(None)), "values", "{symbol: number or text}")
    require(limit, int, "limit", "a number of terms")
    require(decimals, bool, "decimals", "True or False")
    return SymbolicRobot(
        source_of(robot_of(robot), parameters, values, passive, decimals=decimals), limit
    )


@dataclass(frozen=True)
class SymbolicRobot:
    """The symbolic models of one robot, for instance `arm.inertia_matrix()` as a SymPy Matrix.

    Each model is a method with the name of the model. Frames are numbered as in the robot file,
    frame 0 is the base. Twists (velocity, acceleration, rows of the Jacobian) have first the linear
    part, at the origin of frame `of` (default: the last frame), then the angular part, both in
    components of frame `frame` (default: 0).
    """

    source: Source
    limit: int = LARGEST

    def model(
        self, name: str, *, of: int | None = None, frame: int = 0, rows: Sequence[int] | None = None
    ) -> SymbolicModel:
        """Return one model, such as the inertia matrix, in closed form and as a recursion.

        Raises
        ------
        SymgenError
            The model or the frame does not exist.
        """
        require_name(name, SYMBOLIC, "name")
        require(of, (int, type(None)), "of", "the number of a frame")
        require(frame, int, "frame", "the number of a frame")
        require(rows, (list, tuple, range, type(None)), "rows", "a list of numbers")
        robot = self.source.robot
        if (of is not None or frame) and not SYMBOLIC[name].of_frames:
            raise SymgenError(
                f"{name} has no frame; leave out `of` and `frame` (only for "
                f"{', '.join(name for name, m in SYMBOLIC.items() if m.of_frames)})"
            )
        if rows is not None and name != "determinant":
            raise SymgenError(
                f"only the model `determinant` has `rows`; leave `rows` out for {name}"
            )
        of = robot.frames[-1].j if of is None else of
        for j in (of, frame):
            if j != 0 and j not in {f.j for f in robot.frames}:
                raise SymgenError(
                    f"frame {j} does not exist; {robot.name} has frames 0 to {robot.frames[-1].j}"
                )
        asked = (name, of, frame, None if rows is None else tuple(rows))
        if asked not in self._models:
            request = self.source.request(of, frame)
            self._models[asked] = SymbolicModel(
                SYMBOLIC[name].on(robot), self.source, request, asked[-1], self.limit
            )
        return self._models[asked]

    @cached_property
    def _models(self) -> dict[tuple[Any, ...], SymbolicModel]:
        """Models requested so far, so that each model is derived only once."""
        return {}

    def equations(
        self, name: str, *, of: int | None = None, frame: int = 0
    ) -> tuple[list[tuple[Any, Any]], Any]:
        """Return the recursive equations of a model, and the model in terms of the variables that
        the equations define.

        As from `sympy.cse`, an equation is a pair (symbol, expression). The symbols have the names
        of SYMORO.
        """
        return of_listing(self.model(name, of=of, frame=frame))

    def show(
        self,
        name: str,
        *,
        form: str = "closed",
        format: str = "text",
        of: int | None = None,
        frame: int = 0,
        rows: Sequence[int] | None = None,
    ) -> str:
        """Write a model as text, like the command `symgen show --model`.

        form : closed or recursive.
        format : text, latex (a document that compiles), latex-fragment (its formulas alone), sympy
            (Python), json.
        """
        return printed(self.model(name, of=of, frame=frame, rows=rows), form, format)

    def formulas(
        self,
        name: str,
        *,
        form: str = "closed",
        of: int | None = None,
        frame: int = 0,
        rows: Sequence[int] | None = None,
    ) -> Formulas:
        """Return the formulas of a model: typeset in a notebook, plain text if printed."""
        return Formulas(self.model(name, of=of, frame=frame, rows=rows), form)

    # --- symbols ---

    @cached_property
    def symbols(self) -> dict[str, Any]:
        """All symbols of the models by name, for instance q1, QP1, GAM1 and ZZ1R.

        The symbols are constants, positions, velocities, accelerations, torques and parameters, and
        the rates G of passive joints that only the closure equations determine.
        """
        robot = self.source.robot
        joints = [f"{state}{j}" for state in ("q", "QP", "QDP", "GAM") for j in robot.moving]
        rates = [
            Names(len(robot.frames))("G", u, i)
            for u in self.source.relations.tied
            for i in robot.joints
        ]
        return {
            name: symbol(name)
            for name in (*robot.constants, *joints, *rates, *self.source.parameters)
        }

    @property
    def q(self) -> tuple[Any, ...]:
        """Symbols of the positions of the actuated joints, q1 ..."""
        return tuple(self.symbols[f"q{j}"] for j in self.source.robot.joints)

    @property
    def qd(self) -> tuple[Any, ...]:
        """Symbols of the velocities of the actuated joints, QP1 ..."""
        return tuple(self.symbols[f"QP{j}"] for j in self.source.robot.joints)

    @property
    def qdd(self) -> tuple[Any, ...]:
        """Symbols of the accelerations of the actuated joints, QDP1 ..."""
        return tuple(self.symbols[f"QDP{j}"] for j in self.source.robot.joints)

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Symbols of the base or standard parameters, in the order of the regressor columns."""
        return tuple(self.symbols[name] for name in self.source.parameters)

    # --- models ---

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """Return the method that computes the model called `name` as a SymPy object.

        For instance arm.inertia_matrix() or arm.pose(of=6, frame=4).
        """
        if name not in SYMBOLIC:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return partial(self._sympy, name)

    def _sympy(
        self, name: str, of: int | None = None, frame: int = 0, rows: Sequence[int] | None = None
    ) -> Any:
        return of_model(self.model(name, of=of, frame=frame, rows=rows))

    def base_parameters(self) -> dict[Any, Any]:
        """Return the formula of each base parameter, {ZZ1R: ZZ1 + Ia1 + ...}."""
        return dict(zip(self.parameters, self._sympy("base_parameters"), strict=True))
