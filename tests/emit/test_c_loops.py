"""General loops in C: every function against the independent dynamics, the closing along a motion
against the NumPy module, what cannot be closed, and a program under sanitizers.
"""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
from campaign import sampled
from emit.test_c_target import COMPILERS, FLAGS, SOON, compiled, files, needs_compiler, numpy_module

from oracles.loop_robots import BENNETT, JACKS, LIFT
from oracles.random_loops import KINDS, random_loop
from symgen.certify.texts import text_check
from symgen.certify.witness import Witness
from symgen.derive.loops import close
from symgen.description import load_robot, parse_robot
from symgen.description.robot import Robot
from symgen.emit.generate import generate_files
from symgen.regroup.regrouping import regroup

pytestmark = needs_compiler


def assert_agrees(robot: Robot) -> None:
    """Every function of the C file gives what the independent dynamics gives."""
    text = generate_files(robot, targets=("c",))[f"{robot.name}.c"]
    check = text_check(f"{robot.name}.c", text, "c", Witness(regroup(robot)))
    assert {"closed1", "forward_dynamics1", "jacobian1", "regressor"} <= {*check.errors}
    assert max(check.errors.values()) < 1e-9, check.errors


@pytest.mark.parametrize("text", [LIFT, JACKS, BENNETT], ids=["lift", "jacks", "bennett"])
def test_loops_on_a_turret_in_a_row_and_in_space(text: str) -> None:
    assert_agrees(parse_robot(text.encode(), "loop.yaml"))


@pytest.mark.parametrize("kind", sampled(KINDS, 0, more=9))
@pytest.mark.parametrize("seed", [2, 3])
def test_random_mechanisms(kind: str, seed: int) -> None:
    robot = random_loop(kind, seed)
    if close(robot).tied:
        assert_agrees(robot)


class FourBar:
    """The compiled four-bar and its state: q, qd, qdd (3,), G (2,), qdd0 (2,)."""

    def __init__(self, folder: Path) -> None:
        self.module = numpy_module("four_bar", files("four_bar")["four_bar.py"])
        path = compiled(folder, files("four_bar")["four_bar.c"], COMPILERS[0], SOON)
        self.library = ctypes.CDLL(str(path))
        numbers = ctypes.c_double * 13
        self.state = np.array(numbers.in_dll(self.library, "four_bar_start"))
        self.constants = np.array([*self.module.CONSTANTS.values()])

    def call(self, name: str, *arrays: np.ndarray) -> int:
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in arrays]
        return int(getattr(self.library, f"four_bar_{name}")(*pointers))

    def closed(self, q: float, qd: float = 0.0, qdd: float = 0.0) -> int:
        actuated = [np.array([x]) for x in (q, qd, qdd)]
        return self.call("closed1", *actuated, self.constants, self.state)


@pytest.fixture
def four_bar(tmp_path: Path) -> FourBar:
    return FourBar(tmp_path)


def test_the_state_follows_the_crank_through_turns(four_bar: FourBar) -> None:
    q = 1.0 + np.linspace(0.0, 9.0, 40)
    qd, qdd = np.cos(q), np.sin(3 * q)
    expected = four_bar.module.passive_joints(q[:, None], qd[:, None], qdd[:, None])
    for t, sample in enumerate(zip(q, qd, qdd, strict=True)):
        assert four_bar.closed(*sample) == 0
        motion = four_bar.state[:9].reshape(3, 3)
        assert np.allclose(motion[:, 0], sample, rtol=0, atol=1e-15)
        tied = np.array([x[t, :2] for x in expected])
        assert np.allclose(motion[:, 1:], tied, rtol=0, atol=1e-10)


def test_one_large_step_ends_in_the_same_mode(four_bar: FourBar) -> None:
    assert four_bar.closed(4.5) == 0
    tied = four_bar.module.passive_joints(np.array([4.5]))[:2]
    assert np.allclose(four_bar.state[1:3], tied, rtol=0, atol=1e-10)


@pytest.mark.parametrize("q", [np.nan, np.inf, 1e300])
def test_a_state_that_is_none_is_refused(four_bar: FourBar, q: float) -> None:
    before = four_bar.state.copy()
    assert four_bar.closed(q) == 1
    assert (four_bar.state == before).all()


def test_what_does_not_close_or_is_singular_leaves_the_state(four_bar: FourBar) -> None:
    four_bar.constants[list(four_bar.module.CONSTANTS).index("L2")] = 0.9
    before = four_bar.state.copy()
    assert four_bar.closed(1.0) == 1
    four_bar.constants[:] = [*four_bar.module.CONSTANTS.values()]
    L0, L1, L3 = (four_bar.module.CONSTANTS[name] for name in ("L0", "L1", "L3"))
    # coupler and rocker in one line: L2 + L3 from the end of the crank to the second fixed hinge
    stretched = four_bar.module.CONSTANTS | {"L2": np.hypot(L0, L1) - L3}
    four_bar.constants[:] = [*stretched.values()]
    assert four_bar.closed(np.pi / 2) in (1, 2)
    assert (four_bar.state == before).all()


PROGRAM = """
#include "four_bar.h"
#include <stdio.h>
int main(void)
{
    four_bar_state s = four_bar_start, record[40];
    FOUR_BAR_REAL q[1] = {1.0}, qd[1] = {0.0}, qdd[1] = {0.0}, tau[1] = {0.0}, X[FOUR_BAR_PARAMETERS];
    FOUR_BAR_REAL S[40*FOUR_BAR_PARAMETERS] = {0}, J[6];
    for (int k = 0; k < FOUR_BAR_PARAMETERS; k++)
        X[k] = k == 0 ? 1 : (FOUR_BAR_REAL)0.01;
    for (int t = 0; t < 40; t++) {
        if (four_bar_closed1(q, qd, qdd, four_bar_constants, &s)
            || four_bar_forward_dynamics1(&s, tau, X, four_bar_constants, qdd)
            || four_bar_jacobian1(4, &s, four_bar_constants, J))
            return 1;
        record[t] = s;
        qd[0] += (FOUR_BAR_REAL)0.01*qdd[0];
        q[0] += (FOUR_BAR_REAL)0.01*qd[0];
    }
    if (four_bar_regressor(40, record, four_bar_constants, S))
        return 1;
    printf("%.12g %.12g %.12g\\n", (double)q[0], (double)J[0], (double)S[39]);
    return 0;
}
"""


def printed(folder: Path, compiler: str, *flags: str) -> np.ndarray:
    """What the program prints, compiled with these flags without a warning."""
    for file, text in files("four_bar").items():
        (folder / file).write_text(text, encoding="utf-8")
    (folder / "main.c").write_text(PROGRAM, encoding="utf-8")
    command = [compiler, *FLAGS, *flags, "main.c", "four_bar.c", "-o", "main", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    run = subprocess.run([folder / "main"], capture_output=True, text=True, check=True)
    return np.array(run.stdout.split(), dtype=float)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_simulation_of_a_closed_mechanism(tmp_path: Path, compiler: str) -> None:
    module = numpy_module("four_bar", files("four_bar")["four_bar.py"])
    q, qd = np.array([1.0]), np.array([0.0])
    qdd = np.array([0.0])
    X = np.where(np.arange(len(module.BASE_PARAMETERS)) == 0, 1, 0.01)
    for _ in range(40):
        last = q, qd, qdd
        qdd = module.forward_dynamics(q, qd, np.zeros(1), X)
        qd = qd + 0.01 * qdd
        q = q + 0.01 * qd
    expected = [q[0], module.jacobian(last[0], frame=4)[0, 0], module.regressor(*last)[0, 0]]
    sanitized = printed(tmp_path, compiler, "-fsanitize=address,undefined", "-g")
    assert np.allclose(sanitized, expected, rtol=1e-10)
    single = printed(tmp_path, compiler, "-DREAL=float")
    assert np.allclose(single, expected, rtol=1e-3)


def test_the_packaged_robots_have_them() -> None:
    for name in ("four_bar", "five_bar"):
        assert close(load_robot(name)).tied
        assert f"int32_t {name}_closed1(" in files(name)[f"{name}.h"]
