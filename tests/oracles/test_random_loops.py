"""Planar loops of one and two degrees of freedom, drawn at random: exact certificates, generation
below a second, torques by Lagrange multipliers.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType, ModuleType

import numpy as np
import pytest
from campaign import FULL, sampled, some

from oracles.multipliers import Multipliers
from oracles.random_loops import KINDS, random_loop
from oracles.random_robots import random_parameters
from oracles.test_loops_agree import whole
from symgen import Robot, regrouping
from symgen.certify.modules import certify
from symgen.derive.loops import close
from symgen.emit.generate import generate_module
from symgen.regroup.regrouping import EXACT

SECOND = 1.0  # of processor time for derivation, regrouping and text
SEEDS = range(2, 12 if FULL else 3)


def module_of(text: str, folder: Path) -> ModuleType:
    (folder / "loop.py").write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("loop", folder / "loop.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def torques_agree(robot: Robot, module: ModuleType, behind: int = 0) -> None:
    """Around the start, joints before the loops at all angles, at the states farthest from dead
    points of many, to 1e-10 of the largest torque.
    """
    rng, start, joints = np.random.default_rng(3), close(robot).start, robot.joints
    loop = robot.frames[behind:]
    size = max(abs(e.value(robot.constants)) for f in loop for e in (f.b, f.d, f.r0))
    reach = [0.1 * size if robot.frame(j).sigma else 0.3 for j in joints]
    reach[:behind] = [np.pi] * behind
    q = np.array([start[j] for j in joints]) + np.array(reach) * rng.uniform(
        -1, 1, (20, len(joints))
    )
    q = q[[closes(module, one) for one in q]]
    assert len(q) >= 4
    at, zero = whole(robot, q, module.passive_joints(q)), np.zeros((1, len(joints)))
    keep = np.argsort(Multipliers(robot, at[:1], zero, zero).regularity(at))[-4:]
    qd, qdd = rng.standard_normal((2, 4, len(joints)))
    oracle, chi = Multipliers(robot, at[keep], qd, qdd), random_parameters(robot, seed=7)
    X, tau = module.base_parameters(chi), oracle.torque(chi)
    for found in (
        module.inverse_dynamics(q[keep], qd, qdd, X),
        module.regressor(q[keep], qd, qdd) @ X,
    ):
        assert np.abs(found - tau).max() < 1e-10 * np.abs(tau).max()


def closes(
    module: ModuleType, q: np.ndarray, constants: Mapping[str, float] = MappingProxyType({})
) -> bool:
    """Whether the mechanism reaches q, shape (n,), with these constants in place of the file's."""
    try:
        module.passive_joints(q, **constants)
    except ValueError:
        return False
    return True


def check(kind: str, seed: int, folder: Path) -> None:
    robot = random_loop(kind, seed)
    begun = time.process_time()
    text = generate_module(robot)
    spent = time.process_time() - begun
    assert spent < SECOND, (kind, seed, spent)
    found = regrouping(robot)
    certificate = certify(found, {f"{robot.name}.py": text})
    assert found.method == EXACT and certificate.valid and len(certificate.primes) >= 2, (
        kind,
        seed,
        str(certificate),
    )
    assert not certificate.rank_in_floats
    torques_agree(robot, module_of(text, folder))


@pytest.mark.parametrize(
    "kind",
    sampled(KINDS, 5, always=("kite across the ground", "antiparallelogram", "slotted lever")),
)
@some(2)
def test_exact_and_quick(kind: str, tmp_path: Path) -> None:
    """Constants for every other kind, numbers for the rest."""
    check(kind, KINDS.index(kind) % 2, tmp_path)


@pytest.mark.parametrize("kind", sampled(KINDS, 0, more=6))
def test_more_of_each_kind(kind: str, tmp_path: Path) -> None:
    for seed in SEEDS:
        check(kind, seed, tmp_path)
