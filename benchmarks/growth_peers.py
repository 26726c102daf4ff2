"""C code of the regressor of large trees: symgen against pinocchio with CasADi's code generator.

    python benchmarks/growth_peers.py [--trees humanoid30 chain30] [--eigen FOLDER] [--program FILE]

The wheel of pinocchio has no module `pinocchio.casadi`, but its headers have the algorithms for any
scalar: growth_peers.cpp is built here with them, those of Eigen (`pip install cmeel-eigen`) and those of
the wheel of casadi, and writes C code of `computeJointTorqueRegressor` with its zeros structural.
symgen writes its C file once without and once with the certificate, which compiles and runs it.
Both are compiled by `cc -O2`, and called for one state, the call that both have.

Before timing, every entry of pinocchio's D, 10 columns a link, is compared with D K of symgen, K =
d base parameters / d standard parameters: at most 1e-9 of the largest entry.

pinocchio's D has the inertial columns of all links; that of symgen the base columns of the links, and
friction. Seconds are those of the processor; a process shows at least the memory of the one that
starts it.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy

import casadi as ca
import numpy as np
from pinocchio_loop import DEFINITIONS, prefix
from trees import TREES

from oracles.pinocchio_model import PinocchioModel, placement
from symgen.certify.witness import base_values
from symgen.description.robot import PRISMATIC, Robot
from symgen.description.yaml import parse_robot
from symgen.regroup.regrouping import regroup

TOLERANCE = 1e-9
CALLS = 200
OURS = "import sys; from pathlib import Path; from symgen.description import load_robot; from symgen.emit.generate import generate_files; [Path(k).write_text(v) for k, v in generate_files(load_robot(sys.argv[1]), targets=('c',)).items()]"
FLAGS = ("-O2", "-fPIC", "-shared")
Used = tuple[float, float]  # processor seconds, MB


def run(command: list[str], folder: Path) -> Used:
    """Run a command; return its processor seconds and largest resident set in MB."""
    started = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(started.pid, 0)
    started.returncode = os.waitstatus_to_exitcode(status)
    if started.returncode:
        raise SystemExit(f"{' '.join(command)[:200]} ended with {started.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e6


def build(program: Path, eigen: Path) -> None:
    """Build growth_peers.cpp, which takes minutes."""
    casadi = Path(ca.__file__).parent
    includes = (prefix() / "include", eigen, casadi / "include")
    source = Path(__file__).with_suffix(".cpp")
    subprocess.run(
        [
            *(os.environ.get("CXX", "c++"), "-std=c++17", "-O2", "-DNDEBUG", "-w"),
            *(f"-D{d}" for d in DEFINITIONS),
            *(f"-I{path}" for path in includes),
            *(str(source), "-o", str(program), f"-L{casadi}", f"-Wl,-rpath,{casadi}", "-lcasadi"),
        ],
        check=True,
    )


def describe(robot: Robot, oracle: PinocchioModel) -> str:
    """The tree as growth_peers.cpp reads it, in the order of pinocchio's joints."""
    gravity = " ".join(repr(e.value(robot.constants)) for e in robot.gravity)
    lines = [f"{len(robot.frames)}", gravity]
    for j in sorted(oracle.joint, key=oracle.joint.__getitem__)[1:]:
        f = robot.frame(j)
        M = placement(robot, f)
        numbers = " ".join(repr(float(x)) for x in (*M.rotation.ravel(), *M.translation))
        lines.append(f"{oracle.joint[f.ant]} {int(f.sigma == PRISMATIC)} {numbers}")
    return "\n".join(lines)


def ours(library: Path, robot: Robot, states: np.ndarray, b: int) -> tuple[np.ndarray, float]:
    """D of one state by symgen's C code, shape (n, b), and microseconds of a call."""
    n = len(robot.joints)
    function = getattr(ctypes.CDLL(str(library)), f"{robot.name}_regressor1")
    S, constants = np.zeros((b, n)), np.array([*robot.constants.values()])
    given = [a.ctypes.data for a in (*states, constants, S)]
    function.argtypes = [ctypes.c_void_p] * len(given)
    return S.T, timed(lambda: function(*given))


def peers(library: Path, states: np.ndarray, n: int) -> tuple[np.ndarray, float]:
    """D of one state by CasADi's C code, shape (n, 10 n), and microseconds of a call."""
    loaded = ctypes.CDLL(str(library))
    loaded.D_sparsity_out.restype = ctypes.POINTER(ctypes.c_longlong)
    shape = loaded.D_sparsity_out(ctypes.c_longlong(0))
    columns = shape[1]
    starts, entries = shape[2 : 3 + columns], shape[2 + columns]
    rows = shape[3 + columns : 3 + columns + starts[-1]]
    values = np.zeros(starts[-1])
    sizes = [ctypes.c_longlong() for _ in range(4)]
    loaded.D_work(*map(ctypes.byref, sizes))
    room = np.zeros(max(1, sizes[3].value))
    arg = (ctypes.c_void_p * max(3, sizes[0].value))(*(x.ctypes.data for x in states))
    res = (ctypes.c_void_p * max(1, sizes[1].value))(values.ctypes.data)
    integers = (ctypes.c_longlong * max(1, sizes[2].value))()
    loaded.D.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_int]
    given = ctypes.addressof(arg), ctypes.addressof(res), ctypes.addressof(integers)
    spent = timed(lambda: loaded.D(*given, room.ctypes.data, 0))
    D = np.zeros((n, columns))
    D[rows, np.repeat(np.arange(columns), np.diff(starts))] = values
    assert entries == len(values)
    return D, spent


def timed(call: object) -> float:
    """Least microseconds of a call, of nine rounds."""
    rounds = []
    for _ in range(9):
        start = time.process_time()
        for _ in range(CALLS):
            call()  # type: ignore[operator]
        rounds.append(time.process_time() - start)
    return 1e6 * min(rounds) / CALLS


def measure(name: str, program: Path, folder: Path) -> list[str]:
    """A row of figures for each of the two, and their ratio."""
    shape, n = re.fullmatch(r"([a-z]+)(\d+)", name).groups()  # type: ignore[union-attr]
    text = TREES[shape](int(n))
    (folder / f"{name}.yaml").write_bytes(text)
    robot = parse_robot(text, file=f"{name}.yaml")
    oracle, regrouping = PinocchioModel(robot), regroup(robot)
    (folder / "model").write_text(describe(robot, oracle))
    theirs = run([str(program), "model", str(folder)], folder)
    plain = run([sys.executable, "-c", OURS, f"{name}.yaml"], folder)
    certified = run(
        [sys.executable, "-m", "symgen", "generate", f"{name}.yaml", "--target", "c", "-o", "out"],
        folder,
    )
    compiled = {}
    for key, file in (("ours", f"{name}.c"), ("theirs", "peer.c")):
        line = ["cc", *FLAGS, file, "-o", f"{file}.so", "-lm"]
        compiled[key] = run(line, folder)
    states = np.random.default_rng(1).uniform(-1, 1, (3, int(n)))
    own, own_call = ours(folder / f"{name}.c.so", robot, states, len(regrouping))
    place = [oracle.joint[j] - 1 for j in robot.joints]
    moved = np.zeros_like(states)
    moved[:, place] = states
    peer, peer_call = peers(folder / "peer.c.so", moved, int(n))
    standard = own @ base_values(regrouping, np.eye(len(robot.parameters)), robot.constants)
    column = [oracle.columns[key] for key in _inertial(robot)]
    used = [robot.parameters.index(f"{p}{j}") for p, j in _inertial(robot)]
    error = np.abs(standard[:, used] - peer[place][:, column]).max() / np.abs(peer).max()
    if not error < TOLERANCE:
        raise SystemExit(f"{name}: the regressors differ by {error:.1e}; nothing is reported")
    sizes = [(folder / file).stat().st_size / 1e3 for file in (f"{name}.c", "peer.c")]
    rows = [
        f"| {name} | symgen, C of all functions | {plain[0]:.1f}, certified {certified[0]:.1f} | "
        f"{plain[1]:.0f}, {certified[1]:.0f} | {sizes[0]:.0f} | {compiled['ours'][0]:.1f} | "
        f"{compiled['ours'][1]:.0f} | {own_call:.1f} |",
        f"| {name} | pinocchio, CasADi: D | {theirs[0]:.1f} | {theirs[1]:.0f} | {sizes[1]:.0f} | "
        f"{compiled['theirs'][0]:.1f} | {compiled['theirs'][1]:.0f} | {peer_call:.1f} |",
    ]
    ratios = zip(
        (*theirs, sizes[1], *compiled["theirs"], peer_call),
        (*plain, sizes[0], *compiled["ours"], own_call),
        strict=True,
    )
    cells = " | ".join(f"{a / b:.2f}" for a, b in ratios)
    return [*rows, f"| {name} | theirs / ours (entries agree to {error:.0e}) | {cells} |"]


def _inertial(robot: Robot) -> list[tuple[str, int]]:
    families = ("M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")
    return [(p, j) for j in robot.links for p in families]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trees", nargs="+", default=["humanoid30", "chain30", "humanoid60"])
    parser.add_argument("--eigen", type=Path, default=prefix() / "include" / "eigen3")
    parser.add_argument("--program", type=Path, help="the built program; built if it is missing")
    arguments = parser.parse_args()
    print("| tree | code of | generate, s | MB | C, KB | cc -O2, s | MB | a call, us |")
    print("|---|---|---|---|---|---|---|---|")
    with TemporaryDirectory() as name:
        program = (arguments.program or Path(name) / "peer").resolve()
        if not program.is_file():
            build(program, arguments.eigen)
        for tree in arguments.trees:
            folder = Path(name) / tree
            folder.mkdir()
            print("\n".join(measure(tree, program, folder)), flush=True)


if __name__ == "__main__":
    main()
