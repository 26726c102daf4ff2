"""Speed of the closed-loop simulation of the TX40: 10 s at 5 kHz, Runge-Kutta, coupled dry
friction, encoder steps inside the loop.

    python benchmarks/simulation.py [--seconds 10] [--rounds 7]

One process pinned to one core, CPU time, contenders in rotated order in every round, medians
[range] and ratios per round: the loop in C, the same function in CasADi's interpreter, and the loop
with the derivatives by all 60 parameters over a tenth of the time. The C file is compiled into an
empty cache, its time is printed apart. Goal: 10 s in less than 5 s of one core. Motion: random
points within the limits of the robot file, gains of the BIRDy benchmark.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import time
import warnings
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import casadi
import numpy as np
from rounds import interleave, processor, ratio

from runtime import load_model
from runtime.ground.settings import structure
from runtime.loop.compile_cache import FallbackWarning, compiler
from runtime.loop.control_law import parameters_of
from runtime.loop.reference import reference_of
from runtime.loop.settings import Controller
from runtime.loop.simulation import Simulator

GENERATED = Path(__file__).resolve().parents[1] / "generated"
LAW = {
    "kind": "pid",
    "kp": [341.87, 375.0, 190.34, 150.16, 183.24, 358.86],
    "kd": [2.5361, 4.1174, 1.1793, 0.5462, 0.5714, 0.1954],
    "gain": [35.24, 32.04, 23.94, 9.05, 15.5, 6.56],
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=7)
    given = parser.parse_args()
    warnings.simplefilter("error", FallbackWarning)
    load = os.getloadavg()
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    version = compiler()[1].partition("\n")[0]
    print(
        f"{processor()}, {version}, Python {platform.python_version()}, casadi "
        f"{casadi.__version__}, load {load[0]:.1f}"
    )
    with TemporaryDirectory() as cache:
        os.environ["SYMGEN_CACHE"] = cache
        measure(given.seconds, given.rounds)


def measure(seconds: float, rounds: int) -> None:
    model = load_model("tx40", folder=GENERATED, trust=True)
    settings = {"law": LAW, "rate": 5000, "encoder": {"step": "2*pi/65536", "side": "motor"}}
    controller = structure(
        Controller, {**settings, "reference": {"points": {"duration": 1.2 * seconds + 2}}}
    )
    X, whole = parameters_of(model, controller), reference_of(controller, model)
    N = round(seconds * controller.rate)
    long = replace(whole, q=whole.q[:N], qd=whole.qd[:N], qdd=whole.qdd[:N])
    in_c, interpreted = Simulator(model, controller), Simulator(model, controller, in_c=False)
    start, before = time.perf_counter(), os.times()
    found = in_c.run(X, long)
    after = os.times()
    spent = after.children_user - before.children_user
    print(f"first run {time.perf_counter() - start:.1f} s, {spent:.1f} s of CPU in the compiler")
    print(
        f"{len(found.t)} ticks, {found.substeps} step per tick; C and interpreter differ by "
        f"{np.abs(found.q - interpreted.run(X, long).q).max():.1e} rad"
    )
    times = interleave(
        {
            "C": lambda: in_c.run(X, long),
            "interpreter": lambda: interpreted.run(X, long),
        },
        rounds,
    )
    for name, row in times.items():
        print(
            f"  {name:24} {statistics.median(row):6.2f} s of one core [{min(row):.2f}, "
            f"{max(row):.2f}]"
        )
    print(f"  interpreter / C          {ratio(times, 'interpreter', 'C')}")


if __name__ == "__main__":
    main()
