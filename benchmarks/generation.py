"""Cost of generation: CPU time of derivation + regrouping + text, against `import sympy` in a fresh process.

    python benchmarks/generation.py [--robots tx40 panda] [--rounds 7]

Goals: TX40 at most 0.5, Panda at most 1.0 of the CPU time of `import sympy`. Imports are done before the clock starts; each round
measures every robot and one fresh process, so that the ratio is taken under one load; the median of the ratios is quoted.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import time

from symgen.description import load_robot
from symgen.emit.generate import generate_module


def import_sympy() -> float:
    """User + system seconds of a fresh process that imports sympy and nothing else."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", "import sympy"], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def generation(name: str) -> float:
    robot = load_robot(name)
    start = time.process_time()
    generate_module(robot)
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", default=["tx40", "panda"])
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    import_sympy()
    for name in arguments.robots:
        generation(name)
    ratios: dict[str, list[float]] = {name: [] for name in arguments.robots}
    times: dict[str, list[float]] = {name: [] for name in arguments.robots}
    for _ in range(arguments.rounds):
        yardstick = import_sympy()
        for name in arguments.robots:
            times[name].append(generation(name))
            ratios[name].append(times[name][-1] / yardstick)
    print(f"{'robot':<16} {'CPU ms':>8}  ratio to `import sympy`: median [range]")
    for name in arguments.robots:
        r = ratios[name]
        print(f"{name:<16} {1e3 * statistics.median(times[name]):8.1f}  {statistics.median(r):.3f} [{min(r):.3f}, {max(r):.3f}]")


if __name__ == "__main__":
    main()
