"""Cost of generation: CPU time of derivation + regrouping + text, against `import sympy` in a fresh
process; robots in numbers against the same in constants.

    python benchmarks/generation.py [--rounds 7]

Goals: TX40 at most 0.5, Panda at most 1.0 of the CPU time of `import sympy`; a chain of 30 hinges 2
s; a robot whose constants are numbers twice its twin with constants. Imports are done before the
clock starts, nothing is kept from one generation to the next; each round measures every robot and
one fresh process, so that ratios are taken under one load; medians are quoted.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import time

from symgen.description import Robot, load_robot, parse_robot
from symgen.description.values import at_values
from symgen.emit.generate import generate_module

ROBOTS = ("tx40", "panda", "haptic", "sr400", "four_bar", "five_bar")
LINKS = 30
IN_NUMBERS = ", in numbers"


def import_sympy() -> float:
    """User + system seconds of a fresh process that imports sympy and nothing else."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", "import sympy"], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def chain(n: int) -> Robot:
    """n hinges at right angles in turn, a length of its own each, friction."""
    rows = "".join(
        (
            f"  {j}: {{ant: {j - 1}, sigma: 0, alpha: {'pi/2' if j % 2 else '-pi/2'}, d: L{j}, "
            "theta: "
            f"q{j}, r: 0}}\n"
        )
        for j in range(1, n + 1)
    )
    lengths = ", ".join(f"L{j}: {0.1 + 0.0123 * j:.4f}" for j in range(1, n + 1))
    elements = "elements: {FV: {kind: viscous, along: all}, FS: {kind: coulomb, along: all}}\n"
    text = (
        f"symgen: 1\nname: chain{n}\ngravity: [0, 0, -g]\nconstants: {{g: 9.81, "
        f"{lengths}}}\nframes:\n{rows}{elements}"
    )
    return parse_robot(text.encode(), "chain.yaml")


def forget() -> None:
    """Empty every table of earlier results."""
    for name, module in list(sys.modules.items()):
        if name.startswith("symgen"):
            for value in list(vars(module).values()):
                if hasattr(value, "cache_clear"):
                    value.cache_clear()


def generation(robot: Robot | str) -> float:
    robot = load_robot(robot) if isinstance(robot, str) else robot
    forget()
    start = time.process_time()
    generate_module(robot)
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    robots = {name: load_robot(name) for name in ROBOTS} | {f"chain of {LINKS}": chain(LINKS)}
    robots |= {name + IN_NUMBERS: at_values(robot) for name, robot in robots.items()}
    import_sympy()
    generation("planar_2r")
    times: dict[str, list[float]] = {name: [] for name in (*robots, "import sympy")}
    for _ in range(arguments.rounds):
        times["import sympy"].append(import_sympy())
        for name, robot in robots.items():
            times[name].append(generation(robot))
    print(
        f"{'robot':<26} {'CPU s':>8}  ratio to `import sympy`; in numbers: to its twin; median "
        "[range]"
    )
    for name, row in times.items():
        below = (
            times[name.removesuffix(IN_NUMBERS)]
            if name.endswith(IN_NUMBERS)
            else times["import sympy"]
        )
        r = [a / b for a, b in zip(row, below, strict=True)]
        print(
            f"{name:<26} {statistics.median(row):8.3f}  {statistics.median(r):.2f} [{min(r):.2f}, "
            f"{max(r):.2f}]"
        )


if __name__ == "__main__":
    main()
