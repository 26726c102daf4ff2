"""A table of the public URDF files of benchmarks/urdf_files.md: joints, base parameters, certificate, torques
against pinocchio; run with `python -m oracles.urdf_table`.

Of each file as it is read by default, angles snapped, against the same text with its angles
snapped; then of the file as it is.
"""

import math
import re
import sysconfig
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from oracles.test_urdf_agrees import Pinocchio, legend
from symgen.certify.modules import certify
from symgen.derive.derivation import derive
from symgen.derive.graph import Floats, Symbol, interpret, states_of
from symgen.description import Robot
from symgen.description.angles import SNAP
from symgen.description.robot import FIXED, INERTIAL, PRISMATIC, parameter
from symgen.description.tree_robot import read_tree
from symgen.errors import SymgenError
from symgen.regroup.regrouping import regroup

SITE = Path(sysconfig.get_paths()["purelib"])
FOLDERS = ("airo_models", "cmeel.prefix/share/example-robot-data/robots")
MOVES = ('type="revolute"', 'type="prismatic"', 'type="continuous"')
FOUND = sorted(
    p
    for folder in FOLDERS
    for p in (SITE / folder).rglob("*.urdf")
    if any(word in p.read_text("utf-8") for word in MOVES)
)


def snapped_text(text: str) -> str:
    """The text with every roll, pitch and yaw near a multiple of pi/12 replaced by it."""

    def snap(match: re.Match[str]) -> str:
        angles = []
        for word in match[2].split() if re.fullmatch(r"[-+.eE\d\s]+", match[2]) else ():
            nearest = round(float(word) * 12 / math.pi) * math.pi / 12
            angles.append(repr(nearest) if abs(nearest - float(word)) <= SNAP else word)
        return f"{match[1]}{' '.join(angles) or match[2]}{match[3]}"

    return re.sub(r"""(\brpy\s*=\s*["'])([^"']*)(["'])""", snap, text)


def open_tree(robot: Robot) -> Robot:
    """The mechanism with every joint its own and nothing but its links."""
    values = {
        name: robot.values[name]
        for j in robot.links
        for p in INERTIAL
        if (name := parameter(p, j)) in robot.values
    }
    frames = tuple(replace(f, mu=int(f.sigma != FIXED)) for f in robot.frames)
    return replace(robot, frames=frames, constraints={}, elements=(), limits={}, values=values)


def difference(text: str, robot: Robot, names: dict[int, str]) -> float:
    """Largest difference of torque over the largest torque, every joint on its own, whatever
    follows what.
    """
    tree, rng = open_tree(robot), np.random.default_rng(7)
    reach = np.array(
        [1.0 if f.sigma == PRISMATIC else np.pi for f in tree.frames if f.sigma != FIXED]
    )
    oracle, torque, largest, error = Pinocchio(text), derive(tree).torque, 0.0, 0.0
    for _ in range(3):
        x = rng.standard_normal((3, len(reach)))
        x[0] = rng.uniform(-1, 1, len(reach)) * reach
        theirs = oracle.torque([names[j] for j in tree.joints], *x)
        q, qd, qdd = (dict(zip(tree.joints, row, strict=True)) for row in x)
        parameters = {
            Symbol("parameter", name): tree.values.get(name, 0.0) for name in tree.parameters
        }
        floats = Floats(tree, states_of(q=q, qd=qd, qdd=qdd) | parameters)
        ours = np.array(interpret([torque[j] for j in tree.joints], floats), dtype=float)
        largest, error = max(largest, np.abs(theirs).max()), max(error, np.abs(ours - theirs).max())
    return error / largest if largest else error


def row(path: Path) -> str:
    """One line of the table, or why the file is refused."""
    text, start = path.read_text("utf-8"), time.process_time()
    try:
        robot, notes = read_tree(text.encode(), path.name)
        regrouping = regroup(robot)
        certificate = certify(regrouping)
        seconds = time.process_time() - start
        as_it_is, said = read_tree(text.encode(), path.name, exact=True)
    except SymgenError as error:
        return f"| `{path.stem}` | | | | refused: {str(error).partition(' (')[0]} | | | |"
    angles = int((robot.angles.split() or ["0"])[0])
    torques = ["no masses", "no masses"]
    if robot.values:
        torques = [
            f"{difference(snapped_text(text), robot, legend(notes)):.0e}",
            f"{difference(text, as_it_is, legend(said)):.0e}",
        ]
    joints = f"{len(robot.joints)}" + f" + {len(robot.passive)}" * bool(robot.passive)
    verdict = "valid" if certificate.valid else "**FALSE**"
    return (
        f"| `{path.stem}` | {joints} | {angles} | {len(regrouping)} | {verdict} | "
        f"{' | '.join(torques)} | {seconds:.1f} |"
    )


if __name__ == "__main__":
    print(
        "| file | joints | angles snapped | base parameters | certificate | torques, snapped | "
        "torques, `--exact` | s |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for folder in FOLDERS:
        for p in FOUND:
            if p.is_relative_to(SITE / folder):
                print(row(p), flush=True)
