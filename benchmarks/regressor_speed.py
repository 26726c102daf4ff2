"""Speed of an emitted regressor against pinocchio's computeJointTorqueRegressor called in a Python
loop.

    python benchmarks/regressor_speed.py [--robots tx40 panda] [--modules generated] [--rounds 9]
    [--large 1000000]

One process pinned to one core, one BLAS thread, CPU time. Before timing, every entry of pinocchio's
regressor (standard inertial columns) is compared with D K, K = d base_parameters / d standard. Each
round runs every contender once, in rotated order and each for about the same time; the ratio is
taken per round and given as median [range]. All write into buffers already in use:

    emitted      regressor(q, qd, qdd, out=store)                all base columns, then those of the inertial parameters and Ia alone
    pinocchio    W[k] = computeJointTorqueRegressor(...)         10 standard columns per link; the product to base columns is not counted
    calls        the same calls without keeping the result
    fill         the same store filled with a constant; `nonzero`: only its rows that are not identically zero

Then the time per sample at a large N against the small one, and the peak memory of a call without a
store: at most W + 64 MB.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import importlib.util
import os
import platform
import statistics
import sys
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import numpy as np
import pinocchio as pin
from rounds import SPENT, interleave, processor, ratio

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from oracles.pinocchio_model import PinocchioModel
from oracles.random_robots import random_state
from symgen.description import load_robot
from symgen.description.robot import Robot
from symgen.emit.generate import generate_module

SAMPLES = 7103  # not a multiple of 8
MEMORY = 64e6  # bytes beside W
TOLERANCE = 1e-10
Array = np.ndarray[Any, Any]
States = tuple[Array, Array, Array]


def load_module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None or not path.exists():
        raise SystemExit(f"{path}: no emitted module; run `symgen generate {path.stem}` first")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class PinocchioLoop:
    """The peer: one call per sample from Python, results kept in W, shape (N, n, 10 frames)."""

    def __init__(self, oracle: PinocchioModel, states: States) -> None:
        if oracle.rows != list(range(len(states[0].T))):
            raise SystemExit(
                f"{oracle.robot.name}: the loop takes serial robots without fixed frames"
            )
        self.model, self.data, self.states = oracle.model, oracle.data, states
        self.W = np.zeros((len(states[0]), len(oracle.rows), 10 * len(oracle.rows)))

    def __call__(self) -> None:
        model, data, W = self.model, self.data, self.W
        for k, (q, qd, qdd) in enumerate(zip(*self.states, strict=True)):
            W[k] = pin.computeJointTorqueRegressor(model, data, q, qd, qdd)

    def calls(self) -> None:
        model, data = self.model, self.data
        for q, qd, qdd in zip(*self.states, strict=True):
            pin.computeJointTorqueRegressor(model, data, q, qd, qdd)


def compare(module: ModuleType, oracle: PinocchioModel, D: Array, W: Array) -> float:
    """Largest defect of pinocchio's columns against D K, relative to each column's maximum (floor:
    1e-3 of W's).
    """
    names = list(module.STANDARD_PARAMETERS)
    K = np.array([module.base_parameters(unit) for unit in np.eye(len(names))]).T  # X = K chi
    worst = 0.0
    for (p, j), column in oracle.columns.items():
        ours, theirs = D @ K[:, names.index(f"{p}{j}")], W[:, :, column]
        worst = max(
            worst,
            float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), 1e-3 * np.abs(W).max())),
        )
    return worst


def fill(store: Array, value: float) -> None:
    store.fill(value)


def fill_rows(rows: list[Array]) -> None:
    for row in rows:
        row.fill(1.0)


def without_friction(robot: Robot) -> ModuleType:
    """The module of the inertial parameters and Ia alone: nearest to what pinocchio computes."""
    inertia = tuple(e for e in robot.elements if e.kind == "inertia")
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{robot.name}.py"
        path.write_text(
            generate_module(replace(robot, elements=inertia, values={})), encoding="utf-8"
        )
        return load_module(path)


def small(title: str, robot: Robot, module: ModuleType, rounds: int) -> None:
    states = random_state(robot, SAMPLES, seed=7)
    oracle = PinocchioModel(robot)
    loop, out = PinocchioLoop(oracle, states), module.store(SAMPLES)
    loop()
    defect = compare(module, oracle, module.regressor(*states, out=out), loop.W)
    N, n, b = module.regressor(*states, out=out).shape
    print(
        f"\n{title}: {N} samples, {n} joints, {b} base columns ({int(np.sum(module.STRUCTURE))} of "
        f"{n * b} entries not zero)"
    )
    print(
        f"  largest defect against pinocchio, all {loop.W.size} entries: {defect:.1e} of the column"
    )
    if defect > TOLERANCE:
        raise SystemExit(f"{title}: the regressors differ; nothing was timed")
    plain = np.ones((b, n, N))
    rows = [plain[c, j] for c, j in zip(*np.nonzero(module.STRUCTURE), strict=True)]
    contenders: dict[str, Callable[[], object]] = {
        "emitted": lambda: module.regressor(*states, out=out),
        "pinocchio": loop,
        "calls": loop.calls,
        "fill": lambda: fill(plain, 1.0),
        "nonzero": lambda: fill_rows(rows),
    }
    times = interleave(contenders, rounds)
    for key, row in times.items():
        print(f"  {key:10} {1e9 * statistics.median(row) / N:9.1f} ns/sample")
    for above, below in (
        ("pinocchio", "emitted"),
        ("calls", "emitted"),
        ("emitted", "fill"),
        ("emitted", "nonzero"),
    ):
        print(f"  {above + ' / ' + below:22} {ratio(times, above, below)}")


def large(name: str, module: ModuleType, N: int, rounds: int) -> None:
    robot = load_robot(name)
    states, few = random_state(robot, N, seed=8), random_state(robot, SAMPLES, seed=7)
    tracemalloc.start()
    D = module.regressor(*states)
    peak, W = tracemalloc.get_traced_memory()[1], D.size * 8
    tracemalloc.stop()
    verdict = "" if peak <= W + MEMORY else "   MORE THAN ALLOWED"
    print(
        f"\n{name}: {N} samples without a store: peak {peak / 1e6:.0f} MB, W {W / 1e6:.0f} MB, "
        f"beside it {(peak - W) / 1e6:.1f} MB{verdict}"
    )
    del D
    out, out_few = module.store(N), module.store(SAMPLES)
    module.regressor(*states, out=out)  # first touch of the pages
    times = interleave(
        {
            "large": lambda: module.regressor(*states, out=out),
            "small": lambda: module.regressor(*few, out=out_few),
        },
        rounds,
        spent=5 * SPENT,
    )
    per_sample = {
        "large": [t / N for t in times["large"]],
        "small": [t / SAMPLES for t in times["small"]],
    }
    for key, row in per_sample.items():
        print(f"  {key:10} {1e9 * statistics.median(row):9.1f} ns/sample")
    print(f"  {'large / small':22} {ratio(per_sample, 'large', 'small')}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", nargs="+", default=["tx40", "panda"])
    parser.add_argument(
        "--modules", type=Path, default=ROOT / "generated", help="folder of the emitted modules"
    )
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument(
        "--large", type=int, default=1_000_000, help="samples of the large run; 0 leaves it out"
    )
    settings = parser.parse_args()
    load, core = os.getloadavg(), max(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {core})
    print(
        f"{processor()}, Python {platform.python_version()}, numpy {np.__version__}, pinocchio "
        f"{pin.__version__}, load {load[0]:.1f}"
    )
    print(f"CPU time on one core, {settings.rounds} interleaved rounds, ratios as median [range]")
    modules = {name: load_module(settings.modules / f"{name}.py") for name in settings.robots}
    for name, module in modules.items():
        robot = load_robot(name)
        small(f"{name}, all columns", robot, module, settings.rounds)
        small(f"{name}, inertial and Ia", robot, without_friction(robot), settings.rounds)
    for name, module in modules.items():
        if settings.large:
            large(name, module, settings.large, settings.rounds)


if __name__ == "__main__":
    main()
