"""Names of the robot file: kept in every text, or refused in one sentence before anything is
derived. Torques are compared with those of a double pendulum written out by hand.
"""

from __future__ import annotations

import ast
import builtins
import ctypes
import keyword
import os
import string
import subprocess
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from itertools import product
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from campaign import sampled, some

from symgen.description import Element, Robot, load_robot, parse_robot
from symgen.description.naming import LAYOUT, check_families
from symgen.emit.c_target import RESERVED
from symgen.emit.generate import generate_files
from symgen.errors import DescriptionError

PENDULUM = """
symgen: 1
name: pendulum
gravity: [0, -{g}, 0]
constants: {{{L}: 0.7, {g}: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: 0, d: {L}, theta: q2, r: 0}}
elements: {{{C}: {{kind: viscous, along: all}}}}
"""
TARGETS = ("numpy", "c")


def pendulum(L: str = "L", g: str = "g", C: str = "C") -> Robot:
    return parse_robot(PENDULUM.format(L=L, g=g, C=C).encode(), "pendulum.yaml")


def torque(q, qd, qdd, chi, C: str) -> np.ndarray:
    """The double pendulum: Lagrange by hand, second link's angle from the first, L = 0.7."""
    L, g, (q1, q2), (w1, w2), (a1, a2) = 0.7, 9.81, q.T, qd.T, qdd.T
    along = L * (np.cos(q2) * chi["MX2"] - np.sin(q2) * chi["MY2"])
    across = L * (np.sin(q2) * chi["MX2"] + np.cos(q2) * chi["MY2"])
    second = chi["ZZ2"] * (a1 + a2) + along * a1 + across * w1**2
    second += g * (chi["MX2"] * np.cos(q1 + q2) - chi["MY2"] * np.sin(q1 + q2))
    first = second + (chi["ZZ1"] + L**2 * chi["M2"]) * a1
    first += along * (a1 + a2) - across * (w1 + w2) ** 2
    first += g * (chi["MX1"] * np.cos(q1) - chi["MY1"] * np.sin(q1) + L * chi["M2"] * np.cos(q1))
    return np.stack([first + chi[f"{C}1"] * w1, second + chi[f"{C}2"] * w2], axis=1)


def regressor_in_c(folder: Path, module: ModuleType, *states: np.ndarray) -> np.ndarray:
    """D of the C file, shape (N, n, b)."""
    library = folder / "pendulum.so"
    flags = ["-std=c11", "-O1", "-shared", "-fPIC"]
    compiler = os.environ.get("CC") or "cc"
    subprocess.run([compiler, *flags, folder / "pendulum.c", "-o", library, "-lm"], check=True)
    b, n = module.STRUCTURE.shape
    store = np.zeros((b, n, len(states[0])))
    constants = np.array([*module.CONSTANTS.values(), 0.0])
    arrays = (*(np.ascontiguousarray(x) for x in states), constants, store)
    pointers = [ctypes.c_void_p(x.ctypes.data) for x in arrays]
    function = ctypes.CDLL(str(library)).pendulum_regressor
    assert function(ctypes.c_int64(len(states[0])), *pointers) == 0
    return store.transpose(2, 1, 0)


def loaded(path: Path) -> ModuleType:
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def agrees(robot: Robot, C: str, folder: Path) -> None:
    """Every target gives the torques written by hand."""
    rng = np.random.default_rng(1)
    q, qd, qdd = rng.uniform(-1, 1, (3, 5, 2))
    chi = dict(zip(robot.parameters, rng.uniform(0.5, 2, len(robot.parameters)), strict=True))
    expected = torque(q, qd, qdd, chi, C)
    texts = generate_files(robot, targets=TARGETS)
    for file, text in texts.items():
        (folder / file).write_text(text, encoding="utf-8")
    module = loaded(folder / "pendulum.py")
    X = module.base_parameters(chi)
    assert np.allclose(module.inverse_dynamics(q, qd, qdd, X), expected, rtol=1e-12)
    assert np.allclose(module.regressor(q, qd, qdd) @ X, expected, rtol=1e-12)
    function = module.casadi("inverse_dynamics")
    found = function(q=q.T, qd=qd.T, qdd=qdd.T, X=X)[function.name_out(0)]
    assert np.allclose(np.array(found).T, expected, rtol=1e-12)
    vars(module)["_IN_PLACE"] = False
    assert np.allclose(module.regressor(q, qd, qdd) @ X, expected, rtol=1e-12)
    assert np.allclose(module.inverse_dynamics(q, qd, qdd, X), expected, rtol=1e-12)
    assert np.allclose(regressor_in_c(folder, module, q, qd, qdd) @ X, expected, rtol=1e-12)


def test_a_family_called_as_a_cosine_keeps_its_parameter(tmp_path: Path) -> None:
    """C for damping, as MuJoCo writes it: C1 was overwritten by cos(q1)."""
    agrees(pendulum(C="C"), "C", tmp_path)
    text = (tmp_path / "pendulum.py").read_text(encoding="utf-8")
    assert "C1_ = xp.cos(q1)" in text and "C1_ stands for C1" in text


@pytest.mark.parametrize("family", ["q", "QP", "QDP", "GAM"])
def test_families_of_the_states_are_refused(family: str) -> None:
    with pytest.raises(DescriptionError, match=f"element '{family}'.*choose another family"):
        pendulum(C=family)


def families() -> list[str]:
    letters = string.ascii_letters
    return ["".join(w) for n in (1, 2, 3) for w in product(letters, repeat=n)]


def refusal(element: Element) -> str:
    try:
        return next((message for wrong, message, _ in check_families([element]) if wrong), "")
    except DescriptionError as error:
        return str(error)


def test_the_guard_answers_for_families_of_three_letters() -> None:
    element = next(iter(pendulum().elements))
    refused = set()
    for name in [*"qMG", *families()[::7], "QP", "QDP", "GAM", "XX", "MX", "if", "for"]:
        if message := refusal(replace(element, family=name)):
            assert name in message
            refused.add(name)
    assert {"q", "QP", "QDP", "GAM", "XX", "MX", "M", "if", "for"} <= refused
    assert len(refused) < 40


WORDS = sorted(
    {
        *keyword.kwlist,
        *dir(builtins),
        *RESERVED,
        *LAYOUT,
        *string.ascii_letters,
        *[
            "C1",
            "S2",
            "W12",
            "U312",
            "VP11",
            "DG1ZZ1",
            "N16",
            "th1",
            "QP1",
            "q1",
            "GAM1",
            "XX1",
            "ZZ1R",
            "FV1",
            "double",
            "lambda",
            "self",
        ],
    }
)


OF_NUMPY = sorted({w for w in dir(np) if not w.startswith("_")} - {*WORDS})
SAMPLE = [
    *sampled(WORDS, 5, always=("C1", "D", "T", "double", "self"), more=30),
    *sampled(OF_NUMPY, 2, more=10),
]


@pytest.mark.parametrize("word", SAMPLE)
@some(5)
def test_a_word_as_a_constant_is_kept_or_refused(word: str, tmp_path: Path) -> None:
    try:
        robot = pendulum(L=word)
    except DescriptionError as error:
        assert word in str(error) and len(str(error).splitlines()) == 1
    else:
        agrees(robot, "C", tmp_path)


@pytest.mark.parametrize(
    "family",
    sampled([*"SrWU", "CA", *families()[::287]], 3, always=("S", "CA", "U"), more=10),
)
@some(3)
def test_a_family_is_kept_or_refused(family: str, tmp_path: Path) -> None:
    try:
        robot = pendulum(C=family)
    except DescriptionError as error:
        assert family in str(error)
    else:
        agrees(robot, family, tmp_path)


@pytest.mark.parametrize("name", ["tx40", "haptic", "four_bar", "sr400"])
def test_layouts_use_reserved_words_alone(name: str) -> None:
    """In functions that take constants: what is neither theirs nor private is in LAYOUT."""
    robot = load_robot(name)
    allowed = LAYOUT | {*dir(builtins), *robot.constants}
    for file, text in generate_files(robot).items():
        for f in (n for n in ast.parse(text).body if isinstance(n, ast.FunctionDef)):
            arguments = {a.arg for a in (*f.args.args, *f.args.kwonlyargs)}
            if not arguments & {*robot.constants} or f.name.endswith(("_block", "_motion")):
                continue
            scoped = {
                x.id
                for c in ast.walk(f)
                if isinstance(c, ast.comprehension)
                for x in ast.walk(c.target)
                if isinstance(x, ast.Name)
            }
            used = {n.id for n in ast.walk(f) if isinstance(n, ast.Name)} | arguments
            own = {w for w in used if w.startswith("_")} | scoped | {*robot.parameters}
            bases = {f"{p}R" for p in robot.parameters}
            assert used - own - bases <= allowed, (file, f.name)
