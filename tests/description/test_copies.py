"""Robots pass from process to process and are copied, in memory; numbers of other packages are
those of Python.
"""

import copy
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from oracles.random_robots import random_robot
from symgen.description import load_robot, packaged_robots, write_yaml
from symgen.emit.generate import generate_module
from symgen.errors import CertificateError, DescriptionError, ExpressionError, SymgenError


def pickled(robot):
    return pickle.loads(pickle.dumps(robot))  # noqa: S301  our own bytes, in memory


@pytest.mark.parametrize("name", packaged_robots())
def test_a_robot_is_copied_and_pickled(name):
    robot = load_robot(name)
    for again in (pickled(robot), copy.copy(robot), copy.deepcopy(robot)):
        assert again == robot and hash(again) == hash(robot)
        assert write_yaml(again) == write_yaml(robot)
        with pytest.raises(TypeError):
            again.constants["g"] = 1.62


def test_a_pickled_robot_is_equal_in_a_process_with_other_hashes():
    """An expression keeps its hash, and texts have other hashes in another process."""
    code = (
        "import pickle, sys; from symgen.description import load_robot; "
        "robot = pickle.loads(sys.stdin.buffer.read()); own = load_robot('tx40'); "
        "assert robot == own and hash(robot) == hash(own) "
        "and {f.theta for f in robot.frames} == {f.theta for f in own.frames}"
    )
    robot = load_robot("tx40")
    hash(robot)
    subprocess.run([sys.executable, "-c", code], input=pickle.dumps(robot), check=True)


def test_random_robots_are_pickled():
    for seed in range(20):
        robot = random_robot(seed)
        assert pickled(robot) == robot


@pytest.mark.parametrize("number", [np.float64, np.float32, np.longdouble])
def test_numbers_of_numpy_give_the_same_bytes(number):
    """repr(np.float64(0.5)) is np.float64(0.5) and went into the module."""
    robot = replace(
        load_robot("planar_2r"), constants={"D2": 0.5, "g": 9.75}, limits={"qd": (3.0, 2.5)}
    )
    other = replace(
        robot,
        constants={name: number(x) for name, x in robot.constants.items()},
        limits={"qd": (number(3), number(2.5))},
    )
    assert write_yaml(other) == write_yaml(robot)
    assert generate_module(other) == generate_module(robot)


@pytest.mark.parametrize(
    "error",
    [
        SymgenError("no"),
        DescriptionError("no", path=("frames", 1), file="arm.yaml", line=7),
        ExpressionError("no", text="1/0", column=3, advice="; write it otherwise"),
        CertificateError("no", {"rank": 3}),
    ],
)
def test_errors_are_copied_and_pickled(error):
    for again in (pickled(error), copy.copy(error), copy.deepcopy(error)):
        assert type(again) is type(error) and str(again) == str(error)
        assert vars(again) == vars(error)
