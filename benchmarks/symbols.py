"""Closed forms and recursions of models as symbols: terms, characters, CPU seconds; beside the same
recursion over SymPy matrices.

    python benchmarks/symbols.py [--robots tx40] [--expand]

The second way is that of SymPyBotics (sympybotics/dynamics/rne_khalil.py): Newton-Euler of Khalil
over SymPy matrices, a column of A for each unit acceleration, nothing simplified. It is written
here from the equations, since SymPyBotics is on no package index and was written for an older
SymPy.
--expand multiplies its result out by sympy.expand. Both ways have the same base parameters, and
agree at a random state before anything is printed.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import sympy

from symgen.derive.newton_euler import INERTIAL
from symgen.description import load_robot
from symgen.description.robot import PRISMATIC, REVOLUTE, Robot, parameter
from symgen.symbols.symbolic import SymbolicRobot, symbolic


def real(name: str) -> sympy.Symbol:
    return sympy.Symbol(name, real=True)


def number(e: object) -> sympy.Expr:
    return sympy.sympify(str(e), locals={s: real(s) for s in e.symbols}, rational=True)  # type: ignore[attr-defined]


def torques(
    robot: Robot, K: dict[str, sympy.Expr], qdd: dict[int, int], gravity: bool
) -> sympy.Matrix:
    """Gamma of a robot without loops at rest, by Newton and Euler over SymPy matrices."""
    z, zero = sympy.Matrix([0, 0, 1]), sympy.zeros(3, 1)
    g = sympy.Matrix([number(e) for e in robot.gravity]) if gravity else zero
    wd, a, U, R, P = {0: zero}, {0: -g}, {0: sympy.zeros(3)}, {}, {}
    for f in robot.frames:
        j, i, q = f.j, f.ant, real(f"q{f.j}")
        theta = number(f.theta0) + (q if f.sigma == REVOLUTE else 0)
        r = number(f.r0) + (q if f.sigma == PRISMATIC else 0)
        A = sympy.rot_axis3(-number(f.gamma)) * sympy.rot_axis1(-number(f.alpha))
        R[j], P[j] = (
            A * sympy.rot_axis3(-theta),
            A * sympy.Matrix([number(f.d), 0, r]) + number(f.b) * z,
        )
        wd[j] = R[j].T * wd[i] + (qdd.get(j, 0) * z if f.sigma == REVOLUTE else zero)
        a[j] = R[j].T * (a[i] + U[i] * P[j]) + (qdd.get(j, 0) * z if f.sigma == PRISMATIC else zero)
        U[j] = sympy.Matrix(
            [[0, -wd[j][2], wd[j][1]], [wd[j][2], 0, -wd[j][0]], [-wd[j][1], wd[j][0], 0]]
        )
    force, moment, result = {}, {}, {}
    for f in reversed(robot.frames):
        j, i = f.j, f.ant
        XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = (K.get(parameter(p, j), 0) for p in INERTIAL)
        J, MS = sympy.Matrix([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]]), sympy.Matrix([MX, MY, MZ])
        force[j] = M * a[j] + U[j] * MS + force.get(j, zero)
        moment[j] = J * wd[j] + MS.cross(a[j]) + moment.get(j, zero)
        result[j] = (moment if f.sigma == REVOLUTE else force)[j][2]
        fi = R[j] * force[j]
        force[i] = force.get(i, zero) + fi
        moment[i] = moment.get(i, zero) + R[j] * moment[j] + P[j].cross(fi)
    return sympy.Matrix([result[j] for j in robot.joints])


def by_matrices(models: SymbolicRobot) -> tuple[sympy.Matrix, sympy.Matrix]:
    """A and Q."""
    robot = models.source.robot
    K = {own: real(name) for own, name in models.source.own.items() if own.startswith(INERTIAL)}
    A = sympy.Matrix.hstack(*(torques(robot, K, {i: 1}, gravity=False) for i in robot.joints))
    return A, torques(robot, K, {}, gravity=True)


def terms(matrix: sympy.Matrix) -> int:
    return sum(len(sympy.Add.make_args(e)) for e in matrix if e != 0)


def value(matrix: sympy.Matrix, at: dict[sympy.Symbol, float]) -> np.ndarray:
    used = sorted(matrix.free_symbols, key=str)
    return np.array(sympy.lambdify(used, matrix, "numpy")(*(at[x] for x in used)), dtype=float)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", nargs="+", default=["tx40"])
    parser.add_argument("--expand", action="store_true")
    arguments = parser.parse_args()
    for name in arguments.robots:
        models = symbolic(load_robot(name))
        print(f"{name}: way, model, terms, characters of str, CPU s")
        for form in ("inverse_dynamics", "inertia_matrix"):
            start = time.process_time()
            listed = symbolic(load_robot(name)).show(form, form="recursive")
            print(
                f"  recursion with regrouping  {form:18} {len(listed.splitlines()):7} lines "
                f"{len(listed):9} {time.process_time() - start:8.2f}"
            )
        ours = {}
        for model, letter in (("inertia_matrix", "A"), ("gravity", "Q")):
            start = time.process_time()
            size = models.model(model).closed.size
            derived = time.process_time() - start
            ours[letter] = models._sympy(model)
            total = time.process_time() - start
            upper = ours[letter].upper_triangular() if letter == "A" else ours[letter]
            print(
                f"  symgen closed              {letter} {size:7} {len(str(upper)):9} "
                f"{derived:8.2f}, as SymPy {total:8.2f}"
            )
        start = time.process_time()
        A, Q = by_matrices(models)
        seconds = time.process_time() - start
        rng = np.random.default_rng(0)
        robot = models.source.robot
        at = {
            real(x): float(rng.uniform(0.2, 1.2))
            for x in (*robot.constants, *(f"q{j}" for j in robot.joints), *models.source.parameters)
        }
        offsets = {
            real(name): 0.0
            for own, name in models.source.own.items()
            if not own.startswith(INERTIAL)
        }  # links alone
        for mine, theirs in ((ours["A"], A), (ours["Q"], Q)):
            assert np.allclose(
                value(mine, at | offsets), value(theirs, at | offsets), rtol=1e-11, atol=1e-12
            )
        for letter, matrix in (("A", A.upper_triangular()), ("Q", Q)):
            print(
                f"  SymPy matrices             {letter} {terms(matrix):7} {len(str(matrix)):9} "
                f"{seconds:8.2f} (A and Q)"
            )
            if arguments.expand:
                start = time.process_time()
                expanded = matrix.applyfunc(sympy.expand)
                print(
                    f"  the same, expanded         {letter} {terms(expanded):7} "
                    f"{len(str(expanded)):9} {time.process_time() - start:8.2f} more"
                )


if __name__ == "__main__":
    main()
