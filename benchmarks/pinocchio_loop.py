"""Emitted regressors against loops over pinocchio's computeJointTorqueRegressor, in C++ and in
Python, and against filling the store.

    python benchmarks/pinocchio_loop.py [--robots tx40 panda] [--samples 7103 45000] [--rounds 9]
    [--programs FOLDER]

Needs pinocchio (`pip install pin`), the Eigen headers (`pip install cmeel-eigen`) and a C++
compiler (CXX, else c++). The C++ loop,
pinocchio_loop.cpp, reuses its data and writes W joint-major; it is built twice against the
installed package: "C++ headers" with
-O3 -march=native -DNDEBUG, everything from the headers, and "C++ library" with -O3 -DNDEBUG, the
algorithms from the package's library, which is not compatible with -march=native. Each runs as a
process of its own beside this one, on the same core; the clock is its CPU time.

pinocchio computes the 10 n standard columns. The product to base columns is not counted in its
time, nor are friction and Ia; the emitted W holds base columns with friction ("all columns") or
those of the inertial parameters and Ia alone ("inertial"). Before timing, every entry of both W is
compared: standard columns = D K, K = d base parameters / d standard parameters, 1e-10 of the
column.

Goals, TX40 / Panda: NumPy 3 / 2.5 and C 25 / 20 times faster than the C++ loop of the library,
joint-major W; C at most 1.4 times the fill.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import cast

from regressor_speed import (
    TOLERANCE,
    Array,
    PinocchioLoop,
    States,
    compare,
    fill,
)  # before numpy: one BLAS thread
from rounds import interleave, processor, ratio

# isort: split
import numpy as np
import pinocchio as pin

from oracles.pinocchio_model import PinocchioModel, placement
from oracles.random_robots import random_state
from runtime import load_model
from runtime.core.model import GeneratedModel
from symgen.description import load_robot
from symgen.description.robot import PRISMATIC, Robot
from symgen.emit.generate import generate_files

SOURCE = Path(__file__).with_suffix(".cpp")
DEFINITIONS = (  # those of the package's CMake target
    "BOOST_MPL_LIMIT_LIST_SIZE=30",
    "BOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "BOOST_FUSION_INVOKE_MAX_ARITY=12",
)


def prefix() -> Path:
    """The folder of include/ and lib/ of the installed pinocchio."""
    return next(
        p for p in Path(pin.__file__).resolve().parents if (p / "include" / "pinocchio").is_dir()
    )


def build(folder: Path) -> dict[str, Path]:
    """The two programs, by name of the contender; those already in the folder are taken."""
    include, lib = prefix() / "include", prefix() / "lib"
    if not (include / "eigen3").is_dir():
        raise SystemExit("no Eigen headers beside those of pinocchio: pip install cmeel-eigen")
    compiler = os.environ.get("CXX") or shutil.which("c++") or "g++"
    common = [
        compiler,
        "-std=c++17",
        "-O3",
        "-DNDEBUG",
        *(f"-D{d}" for d in DEFINITIONS),
        f"-I{include}",
        f"-I{include / 'eigen3'}",
    ]
    library = [
        "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
        f"-L{lib}",
        f"-Wl,-rpath,{lib}",
        "-lpinocchio_default",
    ]
    folder.mkdir(parents=True, exist_ok=True)
    options = {"C++ headers": ["-march=native"], "C++ library": library}
    for name, own in options.items():
        if not (folder / name).is_file():
            subprocess.run([*common, str(SOURCE), "-o", str(folder / name), *own], check=True)
    return {name: folder / name for name in options}


def describe(robot: Robot) -> str:
    """The chain as pinocchio_loop.cpp reads it."""
    lines = [
        f"{len(robot.frames)}",
        " ".join(repr(e.value(robot.constants)) for e in robot.gravity),
    ]
    for f in robot.frames:
        M = placement(robot, f)
        numbers = (*M.rotation.ravel(), *M.translation)
        lines.append(" ".join([str(int(f.sigma == PRISMATIC)), *(repr(float(x)) for x in numbers)]))
    return "\n".join(lines)


@dataclass
class CppLoop:
    """The C++ loop as a contender: a process that answers requests."""

    process: subprocess.Popen[str]
    W_file: Path
    request: str = "keep"

    @classmethod
    def start(cls, program: Path, robot: Robot, states: States, folder: Path) -> CppLoop:
        model, states_file, W_file = (
            folder / f"{program.name}.{end}" for end in ("model", "states", "W")
        )
        model.write_text(describe(robot))
        states_file.write_bytes(
            np.int64(len(states[0])).tobytes()
            + b"".join(np.ascontiguousarray(x).tobytes() for x in states)
        )
        line = [str(program), str(model), str(states_file), str(W_file)]
        return cls(
            subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True), W_file
        )

    def ask(self, request: str) -> str:
        assert self.process.stdin is not None and self.process.stdout is not None  # PIPE
        self.process.stdin.write(request + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline().strip()
        if not answer:
            raise SystemExit(f"{self.W_file.stem} stopped with {self.process.poll()}")
        return answer

    def cpu(self, repeats: int) -> float:
        return float(self.ask(f"{self.request} {repeats}"))

    def __call__(self) -> None:
        self.cpu(1)

    def W(self, n: int, N: int) -> Array:
        """What the loop wrote, (N, n, 10 n)."""
        self.ask("save")
        return np.fromfile(self.W_file).reshape(10 * n, n, N).transpose(2, 1, 0)


def emitted(robot: Robot, folder: Path) -> GeneratedModel:
    """The NumPy module of a robot."""
    for file, text in generate_files(robot, targets=("numpy",)).items():
        (folder / file).write_text(text, encoding="utf-8")
    return load_model(robot.name, folder=folder, trust=True)


def measure(robot: Robot, title: str, programs: dict[str, Path], N: int, rounds: int) -> None:
    states, oracle = random_state(robot, N, seed=7), PinocchioModel(robot)
    with TemporaryDirectory() as name:
        folder = Path(name)
        model = emitted(robot, folder)
        n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
        loop = PinocchioLoop(oracle, states)
        out, plain = model.store(N), np.ones((b, n, N))
        cpp = {
            key: CppLoop.start(program, robot, states, folder) for key, program in programs.items()
        }
        contenders: dict[str, Callable[[], object]] = {
            "Python loop": loop,
            **cpp,
            "C++ calls": replace(cpp["C++ library"], request="calls"),
            "NumPy": lambda: model.regressor(*states, out=out),
            "fill": lambda: fill(plain, 1.0),
        }
        for run in contenders.values():
            run()
        module = cast(ModuleType, model)
        loops = [loop.W, *(x.W(n, N) for x in cpp.values())]
        D = model.regressor(*states, out=out)
        defects = [compare(module, oracle, D, W) for W in loops]
        report(
            f"{title}, {N} samples, {n} joints, {b} base columns",
            defects,
            interleave(contenders, rounds),
            N,
        )
        for process in cpp.values():
            process.process.terminate()
            process.process.wait()


def report(title: str, defects: list[float], times: dict[str, list[float]], N: int) -> None:
    print(f"\n{title}; W against that of each loop: at most {max(defects):.1e} of the column")
    if max(defects) > TOLERANCE:
        raise SystemExit("the regressors differ; nothing was timed")
    for key, row in times.items():
        print(f"  {key:12} {1e9 * statistics.median(row) / N:9.1f} ns/sample")
    for above in ("C++ library", "C++ headers", "C++ calls", "Python loop"):
        print(f"  {above + ' / NumPy':22} {ratio(times, above, 'NumPy')}")
    print(f"  {'NumPy / fill':22} {ratio(times, 'NumPy', 'fill')}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", nargs="+", default=["tx40", "panda"])
    parser.add_argument("--samples", nargs="+", type=int, default=[7103, 45000])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument(
        "--programs",
        type=Path,
        help="folder that keeps the C++ programs, which take a minute to build",
    )
    settings = parser.parse_args()
    load = os.getloadavg()
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # of the programs too
    print(f"{processor()}, numpy {np.__version__}, pinocchio {pin.__version__}, load {load[0]:.1f}")
    print(f"CPU time on one core, {settings.rounds} interleaved rounds, ratios as median [range]")
    with TemporaryDirectory() as folder:
        programs = build(settings.programs or Path(folder))
        for name in settings.robots:
            robot = load_robot(name)
            inertial = replace(
                robot, elements=tuple(e for e in robot.elements if e.kind == "inertia"), values={}
            )
            for N in settings.samples:
                measure(robot, f"{name}, all columns", programs, N, settings.rounds)
                measure(inertial, f"{name}, inertial and Ia", programs, N, settings.rounds)


if __name__ == "__main__":
    main()
