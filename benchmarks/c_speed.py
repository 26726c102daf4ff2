"""Speed of the C target: regressor into a reused store against NumPy and against filling the dense
store.

    python benchmarks/c_speed.py [--robots tx40 panda] [--samples 7103 45000] [--rounds 11]

One process pinned to one core, CPU time, contenders in rotated order in every round, ratios per
round as median [range]. All write into
stores already in use. Before timing, every entry is compared with NumPy, in units of its column's
maximum. Compile time is that of the
whole C file (six functions, the vector width of this processor), into an empty cache. Goals: C at
most 1.4 times the fill; compiled in 2 s; 1e-12.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rounds import interleave, processor, ratio

from runtime import load_model
from runtime.compiled.cache import FallbackWarning, compiler
from runtime.compiled.model import compiled_model
from runtime.core.model import GeneratedModel
from symgen.description import load_robot
from symgen.emit.generate import generate_files

Array = np.ndarray


def deviation(found: Array, expected: Array) -> float:
    """Largest difference in units of each column's maximum."""
    scale = np.abs(expected).max(axis=tuple(range(expected.ndim - 1)))
    return float((np.abs(found - expected) / np.where(scale > 0, scale, 1)).max())


def measure(name: str, folder: Path, samples: list[int], rounds: int) -> None:
    for file, text in generate_files(
        load_robot(name), targets=("numpy", "c"), command=name
    ).items():
        (folder / file).write_text(text, encoding="utf-8")
    model = load_model(name, folder=folder, trust=True)
    start, before = time.perf_counter(), os.times()
    c = compiled_model(model, cache=folder / "cache")
    after = os.times()
    spent = (
        after.children_user + after.children_system - before.children_user - before.children_system
    )
    print(
        f"\n{name}: compiled, loaded and checked in {time.perf_counter() - start:.2f} s, "
        f"{spent:.2f} s of CPU in the compiler"
    )
    for N in samples:
        regressors(model, c, N, rounds)


def regressors(model: GeneratedModel, c: GeneratedModel, N: int, rounds: int) -> None:
    n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
    q, qd, qdd = np.random.default_rng(7).uniform(-2, 2, (3, N, n))
    X, nonzero = np.random.default_rng(8).uniform(-1, 1, b), int(np.sum(model.STRUCTURE))
    out, out_c, plain = model.store(N), model.store(N), np.ones((b, n, N))
    rows = [plain[k, j] for k, j in zip(*np.nonzero(model.STRUCTURE), strict=True)]
    difference = deviation(c.regressor(q, qd, qdd, out=out_c), model.regressor(q, qd, qdd, out=out))
    torques = {"C torques": c.inverse_dynamics, "NumPy torques": model.inverse_dynamics}  # type: ignore[attr-defined]
    print(
        f"  {N} samples, {n} joints, {b} columns ({nonzero} of {n * b} entries not zero), store "
        f"{plain.nbytes / 1e6:.0f} MB"
    )
    print(f"    largest deviation, of the column: regressor {difference:.1e}, inverse dynamics "
          f"{deviation(*(f(q, qd, qdd, X) for f in torques.values())):.1e}")  # fmt: skip
    contenders: dict[str, Callable[[], object]] = {
        "C": lambda: c.regressor(q, qd, qdd, out=out_c),
        "NumPy": lambda: model.regressor(q, qd, qdd, out=out),
        "fill": lambda: plain.fill(1.0),
        "fill nonzero": lambda: [row.fill(1.0) for row in rows],
        **{name: (lambda f=f: f(q, qd, qdd, X)) for name, f in torques.items()},
    }
    times = interleave(contenders, rounds)
    for key, row in times.items():
        print(f"    {key:14} {1e9 * statistics.median(row) / N:8.1f} ns/sample")
    for above, below in (
        ("NumPy", "C"),
        ("C", "fill"),
        ("C", "fill nonzero"),
        ("NumPy torques", "C torques"),
    ):
        print(f"    {above + ' / ' + below:26} {ratio(times, above, below)}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", nargs="+", default=["tx40", "panda"])
    parser.add_argument("--samples", nargs="+", type=int, default=[7103, 45000])
    parser.add_argument("--rounds", type=int, default=11)
    settings = parser.parse_args()
    warnings.simplefilter("error", FallbackWarning)
    load = os.getloadavg()
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    version = compiler()[1].partition("\n")[0]
    print(
        f"{processor()}, {version}, Python {platform.python_version()}, numpy {np.__version__}, "
        f"load {load[0]:.1f}"
    )
    print(f"CPU time on one core, {settings.rounds} interleaved rounds, ratios as median [range]")
    for name in settings.robots:
        with TemporaryDirectory() as folder:
            measure(name, Path(folder), settings.samples, settings.rounds)


if __name__ == "__main__":
    main()
