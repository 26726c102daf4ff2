"""One state, as a controller asks for it: the C file of a robot against pinocchio's C++.

    python benchmarks/one_state.py tx40 panda

Processor time of one call of inverse_dynamics1 (with friction; pinocchio's rnea has none),
inertia_matrix1 (crba) and regressor1 (base parameters; computeJointTorqueRegressor has ten columns
a link), medians of paired rounds of one process, and the size of the object code. Needs what
pinocchio_loop.py needs.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from pinocchio_loop import DEFINITIONS, describe, prefix

from symgen.description import load_robot
from symgen.emit.generate import generate_files

C = [
    "-std=c99",
    "-O2",
    "-ftree-vectorize",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",
]
HERE = Path(__file__).parent


def table(name: str, rounds: int = 41) -> None:
    """Print the times of a robot."""
    robot, lib = load_robot(name), prefix() / "lib"
    with TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "model").write_text(describe(robot))
        for file, text in generate_files(robot, targets=("c",)).items():
            (folder / file).write_text(text, encoding="utf-8")
        cc, cxx = shutil.which("cc") or "gcc", shutil.which("c++") or "g++"
        subprocess.run([cc, *C, "-c", f"{name}.c", "-o", "robot.o"], cwd=folder, check=True)
        portable = [cc, *C, "-Os", "-DPORTABLE", "-DTILE=1", "-c", f"{name}.c", "-o", "small.o"]
        subprocess.run(portable, cwd=folder, check=True)
        line = [cxx, "-std=c++17", "-O3", "-DNDEBUG", f"-DROBOT={name}", f'-DHEADER="{name}.h"']
        line += [f"-D{d}" for d in DEFINITIONS] + [f"-I{folder}", f"-I{prefix() / 'include'}"]
        line += [
            f"-I{prefix() / 'include' / 'eigen3'}",
            "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
        ]
        line += [str(HERE / "one_state.cpp"), str(folder / "robot.o"), "-o", str(folder / "run")]
        line += [f"-L{lib}", f"-Wl,-rpath,{lib}", "-lpinocchio_default"]
        subprocess.run(line, check=True)
        ran = [str(folder / "run"), str(folder / "model"), str(rounds)]
        for row in subprocess.run(
            ran, capture_output=True, text=True, check=True
        ).stdout.splitlines():
            function, ours, theirs = row.split()
            ratio = float(theirs) / float(ours)
            print(
                f"{name:6} {function:17} {float(ours):7.0f} ns  pinocchio {float(theirs):7.0f} ns  {ratio:.2f}"
            )
        for what in ("robot.o", "small.o"):
            size = subprocess.run(
                ["size", what], cwd=folder, capture_output=True, text=True, check=True
            )
            print(f"{name:6} {what:8} {size.stdout.splitlines()[1].split()[0]} bytes of code")


if __name__ == "__main__":
    for robot_name in sys.argv[1:] or ["tx40", "panda"]:
        table(robot_name)
