"""What a base that moves costs: operations of the models, and times of the regressor in NumPy and C
beside pinocchio's.

    python benchmarks/base_cost.py [ROBOT or ROBOT:BASE ...] [--samples 7103] [--rounds 9] [--write]

Default: tx40 on a fixed, a moving and a free base. ROBOT is a packaged robot or a file; without BASE,
all kinds. For each, all parameters of the robot file take part, friction and drives too; pinocchio has
none of them. One process, one core, one thread, CPU time; contenders are called in interleaved rounds,
in rotated order:

    NumPy      regressor(base, q, qd, qdd, out=store)
    C          ROBOT_regressor of N samples, cc -O2, called by ctypes; no free base
    pinocchio  computeJointTorqueRegressor, one call a sample from Python, of a free-flyer where the
               base moves; results are not kept. Its 10 columns a link are not combined to base columns.

Before timing, every column of pinocchio is compared with D K, K = d base parameters / d standard, 1e-10 of
the column: of a moving base in the rows of the joints. --write puts the table into base_cost.md.
"""

from __future__ import annotations

import argparse
import ctypes
import shutil
import statistics
import subprocess
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from regressor_speed import TOLERANCE, Array, compare, load_module  # before numpy: one BLAS thread
from rounds import interleave, processor, ratio

# isort: split
import numpy as np
import pinocchio as pin

from oracles.pinocchio_model import PinocchioModel
from symgen.description import load_robot
from symgen.description.robot import Robot
from symgen.emit.c_target import FLAGS
from symgen.emit.generate import generate_files
from symgen.emit.spec import spec_of
from symgen.emit.targets import TARGETS

HERE = Path(__file__).parent
BASES = ("fixed", "moving", "free")
HEAD = ("robot", "base", "rows", "parameters", "regressor", "torques", "inertia matrix")
TIMES = ("NumPy", "C", "pinocchio", "pinocchio / NumPy", "pinocchio / C")


class Peer:
    """pinocchio's regressor of a robot on its base, and states of both."""

    def __init__(self, robot: Robot, samples: int) -> None:
        self.oracle = oracle = PinocchioModel(robot)
        rng, n = np.random.default_rng(7), len(robot.joints)
        self.robot, self.model = robot, oracle.model
        q, qd, qdd = rng.uniform(-2, 2, (3, samples, n))
        self.states: tuple[Array, ...] = (q, qd, qdd)
        Q, v, a = (np.zeros((samples, len(oracle.columns) // 10)) for _ in range(3))
        Q[:, oracle.rows], v[:, oracle.rows], a[:, oracle.rows] = q, qd, qdd
        if robot.base_moves:
            flyer = pin.Model()
            flyer.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
            flyer.addJointFrame(1)
            self.model = pin.appendModel(flyer, oracle.model, 1, pin.SE3.Identity())
            self.model.gravity = oracle.model.gravity
            turn = rng.normal(size=(samples, 4))
            turn /= np.linalg.norm(turn, axis=1)[:, None]
            v0, dv0 = rng.normal(size=(2, samples, 6))
            R = np.array([pin.Quaternion(x).matrix() for x in turn])
            weight = np.einsum("tji,j->ti", R, oracle.model.gravity.linear)
            a0 = dv0[:, :3] + np.cross(v0[:, 3:], v0[:, :3]) - weight
            self.states = (np.hstack([v0[:, 3:], dv0[:, 3:], a0]), *self.states)
            Q, v, a = np.hstack([0 * v0[:, :3], turn, Q]), np.hstack([v0, v]), np.hstack([dv0, a])
        self.data, self.given = self.model.createData(), list(zip(Q, v, a, strict=True))

    def __call__(self) -> None:
        for Q, v, a in self.given:
            pin.computeJointTorqueRegressor(self.model, self.data, Q, v, a)

    def regressor(self, count: int) -> Array:
        """Rows of the robot and columns of its links with frames, shape (count, rows, 10 frames)."""
        W = np.array(
            [pin.computeJointTorqueRegressor(self.model, self.data, *x) for x in self.given[:count]]
        )
        joints = [6 * self.robot.base_moves + k for k in self.oracle.rows]
        rows = [*range(6), *joints] if self.robot.base_is_free else joints
        return W[:, rows, 10 * self.robot.base_moves :]


def of_c(
    robot: Robot, folder: Path, states: tuple[Array, ...], shape: tuple[int, ...]
) -> Callable[[], object]:
    """A call of the C regressor for all states."""
    texts = generate_files(robot, targets=("c",))
    for file, text in texts.items():
        (folder / file).write_text(text, encoding="utf-8")
    library, name = folder / "robot.so", robot.name
    cc = shutil.which("cc") or "gcc"
    command = [cc, *FLAGS.split(), str(folder / f"{name}.c"), "-o", str(library), "-lm"]
    subprocess.run(command, check=True)
    function = getattr(ctypes.CDLL(str(library)), f"{name}_regressor")
    constants = np.array([*spec_of(robot).regrouping.constants.values(), 0.0])
    arrays = [*map(np.ascontiguousarray, states), constants, np.zeros((*shape, len(states[0])))]
    arguments = [ctypes.c_int64(len(states[0])), *(ctypes.c_void_p(x.ctypes.data) for x in arrays)]

    def call() -> Array:
        function(*arguments)
        return arrays[-1]

    return call


def rows(robot: Robot, samples: int, rounds: int) -> tuple[list[str], list[str]]:
    """A row of the table of operations, and one of the table of times."""
    spec, peer = spec_of(robot), Peer(robot, samples)
    with TemporaryDirectory() as made:
        folder = Path(made)
        for file, text in generate_files(robot).items():
            (folder / file).write_text(text, encoding="utf-8")
        module = load_module(folder / f"{robot.name}.py")
        store = module.store(samples)
        D = module.regressor(*peer.states, out=store)
        few = min(samples, 200)
        wrong = compare(module, peer.oracle, D[:few], peer.regressor(few))
        if wrong > TOLERANCE:
            raise SystemExit(f"{robot.name}, {robot.base}: differs from pinocchio by {wrong:.1e}")
        contenders: dict[str, Callable[[], object]] = {
            "NumPy": lambda: module.regressor(*peer.states, out=store),
            "pinocchio": peer,
        }
        if robot.base in TARGETS["c"].bases:
            call = of_c(robot, folder, peer.states, spec.functions["regressor"].shape)
            defect = np.abs(call() - np.asarray(store)).max()  # type: ignore[operator]
            if defect > TOLERANCE * np.abs(store).max():
                raise SystemExit(
                    f"{robot.name}, {robot.base}: C differs from NumPy by {defect:.1e}"
                )
            contenders["C"] = call
        times = interleave(contenders, rounds)
    counts = [
        "{} + {}".format(*spec.functions[name].operations)
        for name in ("regressor", "inverse_dynamics", "inertia_matrix")
    ]
    head = [robot.name, robot.base]
    ns = {key: f"{1e9 * statistics.median(row) / samples:.0f}" for key, row in times.items()}
    ratios = [
        ratio(times, "pinocchio", key).strip() if key in times else "" for key in ("NumPy", "C")
    ]
    sizes = [str(len(robot.rows)), str(len(spec.regrouping))]
    return [*head, *sizes, *counts], [*head, *(ns.get(key, "") for key in TIMES[:3]), *ratios]


def table(head: tuple[str, ...], lines: list[list[str]]) -> str:
    """A table in Markdown."""
    every = [[*head], ["---"] * len(head), *lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in every)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("robots", nargs="*", default=["tx40"], metavar="ROBOT[:BASE]")
    parser.add_argument("--samples", type=int, default=7103)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    operations, times = [], []
    for text in given.robots:
        source, _, base = text.partition(":")
        for kind in (base,) if base else BASES:
            counts, seconds = rows(load_robot(source, base=kind), given.samples, given.rounds)
            operations.append(counts)
            times.append(seconds)
            print(*counts, *seconds[2:], sep="  ")
    text = f"""\
# What a base that moves costs

Written by `python benchmarks/base_cost.py {" ".join(Path(x).name for x in given.robots)} --write`.
Multiplications + additions of one sample, all parameters of the robot file; rows: torques, of a free base with force and moment.

{table(HEAD, operations)}

The regressor, ns a sample (median of {given.rounds} rounds of {given.samples} samples, CPU time of one core, {processor()}); ratios are taken in one run, median [least, largest].
pinocchio's computeJointTorqueRegressor is called from Python for each sample, of a free-flyer where the base moves; it has no friction and no drives, and its columns are not combined.
Before timing, all its columns agree with those of NumPy to 1e-10, and NumPy with C. C has no free bases.

{table((*HEAD[:2], *TIMES), times)}
"""
    print(text)
    if given.write:
        (HERE / "base_cost.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
