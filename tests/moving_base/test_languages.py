"""Models of a base that moves in C, CasADi and JAX: torques and regressor of pinocchio's free-flyer."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from functools import cache

import jax
import numpy as np
import pytest

import symgen
from oracles.free_flyer import free_flyer
from oracles.urdf_robots import random_tree, ur5
from symgen.certify.modules import certify
from symgen.derive.regressor import inertial_names
from symgen.description import load_robot
from symgen.description.files import on_base
from symgen.description.tree_robot import read_tree
from symgen.emit.generate import generate_files
from symgen.regroup.regrouping import regroup

TOLERANCE = 1e-12  # of the largest entry
TEXTS = {"ur5": ur5(), "tree": random_tree(3)}
COMPILERS = [c for c in ("gcc", "clang", "cc") if shutil.which(c)]
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O2", "-ffp-contract=off"]
needs_compiler = pytest.mark.skipif(not COMPILERS, reason="no C compiler")


class Case:
    """A URDF on a base that moves: its module, X of its links, and states of a free-flyer."""

    def __init__(self, text):
        robot, notes = read_tree(text.encode(), "arm.urdf", exact=True)
        self.robot = on_base(robot, "moving")
        self.module = symgen.model(self.robot)
        inertial = inertial_names(robot)  # pinocchio's recursion has no friction
        chi = {
            name: self.robot.values.get(name, 0.0) * (name in inertial)
            for name in self.module.STANDARD_PARAMETERS
        }
        self.X = self.module.base_parameters(chi)
        own = regroup(self.robot).own
        self.inertial = [k for k, name in enumerate(own) if name in inertial]
        names = dict(re.findall(r"q(\d+) = '([^']*)'", notes[0]))
        self.states = free_flyer(text, [names[str(j)] for j in robot.joints], 40)

    @property
    def motion(self):
        return self.states[:4]


case = cache(lambda name: Case(TEXTS[name]))


def assert_equal(found, expected):
    assert np.shape(found) == np.shape(expected)
    assert np.abs(found - expected).max() < TOLERANCE * np.abs(expected).max()


def residual_of_map(D, W):
    """Largest residual, of the largest D, of columns of D as combinations of the columns of W.

    The combinations are fitted on half of the states, and tried on the other half.
    """
    half = len(W) // 2
    (W1, W2), (D1, D2) = (
        (x[:half].reshape(-1, x.shape[-1]), x[half:].reshape(-1, x.shape[-1])) for x in (W, D)
    )
    M = np.linalg.lstsq(W1, D1, rcond=1e-10)[0]
    return np.abs(W2 @ M - D2).max() / np.abs(D).max()


class Compiled:
    """Functions of a C file on arrays of NumPy; results have samples first, as in Python."""

    def __init__(self, robot, folder):
        for file, text in generate_files(robot, targets=("c",)).items():
            (folder / file).write_text(text, encoding="utf-8")
        source, library = folder / f"{robot.name}.c", folder / "robot.so"
        command = [COMPILERS[0], *FLAGS, "-shared", "-fPIC", source, "-o", library, "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0 and done.stderr == "", done.stderr
        self.library, self.robot = ctypes.CDLL(str(library)), robot

    def __call__(self, name, *arrays, shape):
        """Call a function of many states, or, where its name ends in 1, of one."""
        one, N = name.endswith("1"), len(arrays[0])
        S = np.zeros(shape if one else (*shape, N))
        constants = [*self.robot.constants.values(), 0.0]
        given = [np.ascontiguousarray(x, dtype=float) for x in (*arrays, constants, S)]
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in given]
        count = [] if one else [ctypes.c_int64(N)]
        getattr(self.library, f"{self.robot.name}_{name}")(*count, *pointers)
        return given[-1] if one else np.moveaxis(given[-1], -1, 0)


@needs_compiler
@pytest.mark.parametrize("name", TEXTS)
def test_c_is_the_free_flyer_of_pinocchio(name, tmp_path):
    c, C = case(name), Compiled(case(name).robot, tmp_path)
    n, b = len(c.robot.joints), len(c.X)
    tau = c.states.tau
    D = C("regressor", *c.motion, shape=(b, n)).transpose(0, 2, 1)
    assert_equal(D @ c.X, tau)
    assert residual_of_map(D[..., c.inertial], c.states.W) < TOLERANCE
    assert_equal(C("inverse_dynamics", *c.motion, c.X, shape=(n,)), tau)
    base, q, qd, qdd = (x[7] for x in c.motion)
    assert_equal(C("inverse_dynamics1", base, q, qd, qdd, c.X, shape=(n,)), tau[7])
    found = C("forward_dynamics1", base, q, qd, tau[7], c.X, shape=(n,))
    assert np.abs(found - qdd).max() < 1e-9 * np.abs(qdd).max()  # as good as A is regular


@pytest.mark.parametrize("name", TEXTS)
def test_casadi_is_the_free_flyer_of_pinocchio(name):
    c = case(name)
    torques, regressor = map(c.module.casadi, ("inverse_dynamics", "regressor"))
    given = dict(zip(("base", "q", "qd", "qdd"), (x.T for x in c.motion), strict=True))
    assert_equal(np.array(torques(**given, X=c.X)["GAM"]).T, c.states.tau)
    D = np.array([regressor(**{k: x[:, i] for k, x in given.items()})["D"] for i in range(40)])
    assert residual_of_map(D[..., c.inertial], c.states.W) < TOLERANCE


@pytest.mark.parametrize("name", TEXTS)
def test_jax_is_the_free_flyer_of_pinocchio(name):
    """Compiled and mapped over the states."""
    jax.config.update("jax_enable_x64", True)
    c = case(name)
    torques = jax.jit(jax.vmap(c.module.inverse_dynamics, in_axes=(0, 0, 0, 0, None)))
    motion = [jax.numpy.asarray(x) for x in c.motion]
    assert_equal(np.asarray(torques(*motion, jax.numpy.asarray(c.X))), c.states.tau)
    D = np.asarray(jax.jit(jax.vmap(c.module.regressor))(*motion))
    assert residual_of_map(D[..., c.inertial], c.states.W) < TOLERANCE


@needs_compiler
def test_a_wrong_c_text_is_refused():
    """The base is read in other rows, its turning is forgotten, or forward dynamics leaves it out."""
    regrouping = regroup(load_robot("tx40", base="moving"))
    texts = generate_files(regrouping.robot, targets=("c",), regrouping=regrouping)
    assert certify(regrouping, texts).valid
    for old, new in (
        ("const real W20 = AT(base, 1);", "const real W20 = AT(base, 0);"),
        ("load(m, 9, 9, base + 9*start", "load(m, 9, 9, base + 6*start"),
        ("const real VP30 = AT(base, 8);", "const real VP30 = AT(base, 5);"),
        ("tx40_bias1(base, q, qd", "tx40_bias1(q, base, qd"),
    ):
        assert old in texts["tx40.c"]
        wrong = {**texts, "tx40.c": texts["tx40.c"].replace(old, new)}
        assert not certify(regrouping, wrong).valid, new
