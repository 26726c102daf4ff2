"""Robots with loops: cost of generation, operations, speed of the regressor, Newton passes of
general loops.

    python benchmarks/loops.py [--rounds 7]

1  CPU time of derivation + regrouping + text against `import sympy` in a fresh process (goal: at
most 1.0 for parallelograms) 2  multiplications and additions in inertial parameters (with Ia for
the regressor) against the limits of the regrouping theory, section 6 3  regressor on 7103 samples,
CPU time per emitted operation against the serial TX40's (goal: at most 1.5); operations are
   multiplications, additions, sines and cosines of the header, all columns. General loops: closure
   by Newton included, and their closure alone
4  Newton passes per sample on a smooth record, those of the samples followed from `start` included
(goal: at most 5). A pass is an
   evaluation of `_linearised_closure_block` with a step; the evaluation that finds the loops closed is none
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import os
import statistics
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import numpy as np
from generation import generation, import_sympy
from regressor_speed import SAMPLES, Array, States, load_module
from rounds import interleave, processor, ratio

from symgen.derive.loops import close
from symgen.description import load_robot
from symgen.emit.python_target import render
from symgen.emit.spec import ModuleSpec, function, is_inertial, is_inertial_or_actuator, module_spec
from symgen.regroup.regrouping import regroup

PARALLELOGRAMS, GENERAL, SERIAL = ("haptic", "sr400"), ("four_bar", "five_bar"), "tx40"
LIMITS = {"haptic": ((145, 108), (169, 142)), "sr400": ((430, 328), (315, 287))}


def generation_cost(rounds: int) -> None:
    names = (*PARALLELOGRAMS, *GENERAL)
    for name in names:
        generation(name)  # lazy imports
    ratios: dict[str, list[float]] = {name: [] for name in names}
    for _ in range(rounds):
        yardstick = import_sympy()
        for name in names:
            close.cache_clear()
            ratios[name].append(generation(name) / yardstick)
    print("\nGeneration, CPU time against `import sympy`: median [range]")
    for name, r in ratios.items():
        print(f"  {name:10} {statistics.median(r):6.2f}  [{min(r):.2f}, {max(r):.2f}]")


def operations(specs: dict[str, ModuleSpec]) -> None:
    print("\nOperations, multiplications / additions (limit)")
    for name, (limit, limit_torques) in LIMITS.items():
        regrouping = specs[name].regrouping
        robot = regrouping.robot
        mul, add = function(regrouping, "regressor", is_inertial_or_actuator(robot)).operations
        torques = function(regrouping, "inverse_dynamics", is_inertial(robot)).operations
        print(f"  {name:10} regressor {mul} / {add} ({limit[0]} / {limit[1]})", end="")
        print(
            f"   inverse dynamics {torques[0]} / {torques[1]} ({limit_torques[0]} / "
            f"{limit_torques[1]})"
        )


def record(module: ModuleType) -> States:
    """Sines about the start of general loops, about zero for the others, q within 0.6 rad."""
    n = len(module.JOINTS)
    t = np.linspace(0.0, 10.0, SAMPLES)[:, None]
    w, phase = 2.1 + 0.7 * np.arange(n), 0.3 * np.arange(n)
    centre = np.array(module._START[:n]) if hasattr(module, "_START") else np.zeros(n)
    return (
        centre + 0.6 * np.sin(w * t + phase),
        0.6 * w * np.cos(w * t + phase),
        -0.6 * w**2 * np.sin(w * t + phase),
    )


def speed(modules: dict[str, ModuleType], specs: dict[str, ModuleSpec], rounds: int) -> None:
    contenders: dict[str, Callable[[], object]] = {}
    weight: dict[str, int] = {}
    for name, module in modules.items():
        contenders[name] = _regressor(module, record(module))
        f = specs[name].functions["regressor"]
        weight[name] = f.mul + f.add + f.sin + f.cos
        if hasattr(module, "_START"):
            contenders[f"{name}, closure"] = _closed(module, record(module))
    times = interleave(contenders, rounds)
    print(f"\nRegressor on {SAMPLES} samples")
    for name, row in times.items():
        per = [t / SAMPLES * 1e9 for t in row]
        text = f"  {name:18} {statistics.median(per):8.1f} ns/sample"
        if name in weight:
            text += (
                f"  {weight[name]:5} operations  {statistics.median(per) / weight[name]:6.2f} "
                "ns each"
            )
        print(text)
    per_operation = {name: [t / weight[name] for t in times[name]] for name in weight}
    for name in weight:
        if name != SERIAL:
            print(
                f"  time per operation, {name + ' / ' + SERIAL:20} "
                f"{ratio(per_operation, name, SERIAL)}"
            )


def _regressor(module: ModuleType, states: States) -> Callable[[], object]:
    out = module.store(SAMPLES)
    return lambda: module.regressor(*states, out=out)


def _closed(module: ModuleType, states: States) -> Callable[[], object]:
    return lambda: module._closed(*states, *module.CONSTANTS.values())


def newton_passes(module: ModuleType, q: Array) -> tuple[float, int]:
    """Passes per sample on the whole, and those that the samples themselves needed from their first
    guess.
    """
    passes: list[tuple[int, int]] = []
    newton, block = module._newton, module._linearised_closure_block
    evaluations = [0]

    def counted_block(*arguments: Array) -> None:
        evaluations[0] += 1
        block(*arguments)

    def counted_newton(states: Array, *arguments: Array) -> object:
        evaluations[0] = 0
        result = newton(states, *arguments)
        passes.append((len(states), evaluations[0] - 1))  # up to 8192 samples: one block
        return result

    module._linearised_closure_block, module._newton = counted_block, counted_newton  # type: ignore[attr-defined]
    module.passive_joints(q)
    module._linearised_closure_block, module._newton = block, newton  # type: ignore[attr-defined]
    return sum(size * count for size, count in passes) / len(q), passes[-1][1]


def crank_turning(turns: float) -> Array:
    return np.linspace(1.0, 1.0 + 2 * np.pi * turns, SAMPLES)[:, None]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    load, core = os.getloadavg(), max(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {core})
    print(
        f"{processor()}, numpy {np.__version__}, load {load[0]:.1f}; CPU time on one core, "
        f"{rounds} rounds"
    )
    generation_cost(rounds)
    specs = {
        name: module_spec(regroup(load_robot(name))) for name in (SERIAL, *PARALLELOGRAMS, *GENERAL)
    }
    operations(specs)
    with TemporaryDirectory() as folder:
        modules = {}
        for name, spec in specs.items():
            path = Path(folder) / f"{name}.py"
            path.write_text(render(spec), encoding="utf-8")
            modules[name] = load_module(path)
    speed(modules, specs, rounds)
    print("\nNewton passes per sample: all, last guess to closed")
    records = {
        "four_bar, sine": ("four_bar", record(modules["four_bar"])[0]),
        "four_bar, 10 turns": ("four_bar", crank_turning(10)),
        "five_bar, sines": ("five_bar", record(modules["five_bar"])[0]),
    }
    for title, (name, q) in records.items():
        mean, last = newton_passes(modules[name], q)
        print(f"  {title:20} {mean:5.2f}  {last}")


if __name__ == "__main__":
    main()
