"""Streamed least squares: normal equations and triangular factors that never form W, against W and lstsq; time and digits.

    python benchmarks/streamed_least_squares.py [--samples 100000] [--rounds 7]

TX40, 60 columns, a trajectory of sinusoids with torque noise; every contender starts from q, qd, qdd, tau of shape (N, n).

    W, lstsq         observation_matrix of the emitted NumPy module on all samples into a used store, numpy.linalg.lstsq
    NumPy NE, TSQR   `runtime.estimators.reductions`: normal equations and one refinement; structured triangular factor
    C NE, TSQR       the same by `runtime.resolution.c.least_squares`

One process pinned to one core, one BLAS thread, CPU time, contenders in rotated order in every round, ratios per round as median [range]. Goals at
100000 samples: NumPy NE 20, C NE 30, C TSQR 10 times faster, with lstsq's digits up to cond(W) 1e6.

Digits: the same motion made smaller and slower, 20000 samples, torque noise 0.01 N m; max|dX|/max|X| against the solution refined in extended
precision (residuals in numpy.longdouble until they stop changing). NE is what `normal_equations` gives with the switch to the factor at kappa 1e4;
"NE alone" has the switch off.
"""
# ruff: noqa: E402 (the number of BLAS threads is set before numpy is loaded)

from __future__ import annotations

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import platform
import statistics
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import scipy
from c_speed import interleave, processor, ratio

from runtime import load_model
from runtime.estimators.reductions import normal_equations, triangular_factor
from runtime.estimators.solution import solve
from runtime.model.compile_cache import FallbackWarning, compiler
from runtime.model.compiled import CompiledModel, compiled_model
from runtime.model.generated import GeneratedModel
from runtime.resolution.c import least_squares as in_c
from symgen.description import load_robot
from symgen.emit import generate_files

Array = np.ndarray
ROBOT = "tx40"
SMALLER = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)


def motion(N: int, n: int, smaller: float = 1.0) -> tuple[Array, Array, Array]:
    """q, qd, qdd, shape (N, n): four sinusoids a joint over 10 s, amplitudes (and so speeds) divided by `smaller`."""
    rng = np.random.default_rng(5)
    a, w, phase = rng.uniform(0.2, 0.7, (4, n)), rng.uniform(1.0, 8.0, (4, n)), rng.uniform(0, 6, (4, n))
    angle, a = np.linspace(0, 10, N)[:, None, None] * w + phase, a / smaller
    return (a * np.sin(angle)).sum(1), (a * w * np.cos(angle)).sum(1), -(a * w**2 * np.sin(angle)).sum(1)


def times(module: GeneratedModel, c: CompiledModel, N: int, rounds: int) -> None:
    n = len(module.JOINTS)
    states = motion(N, n)
    X = np.random.default_rng(6).uniform(-1, 1, len(module.BASE_PARAMETERS))
    tau = module.regressor(*states) @ X + 0.1 * np.random.default_rng(7).standard_normal((N, n))
    out = module.store(N)

    def whole() -> Array:
        return np.linalg.lstsq(module.observation_matrix(*states, out=out), tau.T.ravel(), rcond=None)[0]

    estimates: dict[str, Callable[[], Array]] = {
        "W, lstsq": whole,
        "NumPy NE": lambda: normal_equations(module, *states, tau).X,
        "NumPy TSQR": lambda: solve(triangular_factor(module, *states, tau)).X,
        "C NE": lambda: in_c.normal_equations(c, *states, tau).X,
        "C TSQR": lambda: solve(in_c.triangular_factor(c, *states, tau)).X,
    }
    right = whole()
    worst = max(float(np.abs(f() - right).max() / np.abs(right).max()) for f in estimates.values())
    print(f"\n{N} samples, largest difference from lstsq {worst:.1e} of the largest parameter")
    spent = interleave(estimates, rounds)
    for name, row in spent.items():
        print(f"    {name:12} {1e3 * statistics.median(row):9.2f} ms {1e9 * statistics.median(row) / N:9.0f} ns/sample")
    for name, goal in (("NumPy NE", "20"), ("NumPy TSQR", "-"), ("C NE", "30"), ("C TSQR", "10")):
        print(f"    W, lstsq / {name:12} {ratio(spent, 'W, lstsq', name)}   goal {goal}")


def extended(W: Array, Y: Array, X: Array) -> Array:
    """Least squares refined until nothing changes: residuals and sums in extended precision, steps by the double factor of unit columns."""
    scale = np.linalg.norm(W, axis=0)
    R = np.linalg.qr(W / scale, mode="r")
    exact_W, exact_Y, x = W.astype(np.longdouble), Y.astype(np.longdouble), X.astype(np.longdouble)
    for _ in range(12):
        g = (exact_W.T @ (exact_Y - exact_W @ x)).astype(float) / scale
        x = x + scipy.linalg.solve_triangular(R, scipy.linalg.solve_triangular(R, g, trans="T")) / scale
    return x


def digits(module: GeneratedModel, c: CompiledModel, N: int = 20000) -> None:
    rng = np.random.default_rng(8)
    n, b = len(module.JOINTS), len(module.BASE_PARAMETERS)
    X = rng.uniform(-1, 1, b)
    print("\nmax|dX|/max|X| against extended precision, 20000 samples")
    print("    smaller  cond(W)     kappa     lstsq  NumPy NE      C NE  C NE alone    C TSQR  taken in C")
    for smaller in SMALLER:
        states = motion(N, n, smaller)
        W = np.array(module.observation_matrix(*states))
        tau = (W @ X).reshape(n, N).T + 0.01 * rng.standard_normal((N, n))
        Y = np.ascontiguousarray(tau.T).ravel()
        lstsq = np.linalg.lstsq(W, Y, rcond=None)[0]
        right = extended(W, Y, lstsq)
        c_fit = in_c.normal_equations(c, *states, tau)
        found = (
            lstsq,
            normal_equations(module, *states, tau).X,
            c_fit.X,
            in_c.normal_equations(c, *states, tau, limit=np.inf).X,
            solve(in_c.triangular_factor(c, *states, tau)).X,
        )
        error = [float(np.abs(x - right).max() / np.abs(right).max()) for x in found]
        kappa = np.linalg.cond(W / np.linalg.norm(W, axis=0))
        print(f"    {smaller:6.0f}  {np.linalg.cond(W):9.1e} {kappa:9.1e} " + " ".join(f"{e:9.1e}" for e in error[:3])
              + f"   {error[3]:9.1e} {error[4]:9.1e}  {c_fit.method}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", nargs="+", type=int, default=[100000])
    parser.add_argument("--rounds", type=int, default=7)
    settings = parser.parse_args()
    warnings.simplefilter("error", FallbackWarning)
    load = os.getloadavg()
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    versions = f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}"
    print(f"{processor()}, {compiler()[1].partition(chr(10))[0]}, {versions}, load {load[0]:.1f}")
    print(f"CPU time on one core, {settings.rounds} interleaved rounds, ratios as median [range]")
    with TemporaryDirectory() as folder:
        for file, text in generate_files(load_robot(ROBOT), targets=("numpy", "c"), command=ROBOT).items():
            Path(folder, file).write_text(text, encoding="utf-8")
        module = load_model(ROBOT, folder=Path(folder))
        c = compiled_model(module)
        assert isinstance(c, CompiledModel)
        digits(module, c)
        for N in settings.samples:
            times(module, c, N, settings.rounds)


if __name__ == "__main__":
    main()
