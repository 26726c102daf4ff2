"""The emitted text as its readers meet it: nothing listed twice, comments of any language that stay
comments, declarations whole, X of the robot file, models of one number, sentences for wrong input.
"""

from __future__ import annotations

import ctypes
import re
import subprocess
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from symgen.derive import models
from symgen.derive.models import Case, Entry, Model
from symgen.description import load_robot
from symgen.emit.generate import generate_files, generate_module
from symgen.emit.printers import PYTHON
from symgen.emit.render import WIDTH, lines_that_fit


def module(text: str) -> ModuleType:
    found = ModuleType("emitted")
    exec(compile(text, "emitted", "exec"), found.__dict__)  # noqa: S102 (our own output)
    return found


@pytest.fixture(scope="module")
def tx40() -> Any:
    return module(generate_module(load_robot("tx40")))


def test_no_step_of_the_motion_is_listed_again() -> None:
    """W, U and VP stand where they are computed and read, in no tuple of names."""
    text = generate_module(load_robot("tx40"))
    listed = [line for line in text.splitlines() if re.fullmatch(r" +(\w+, ){4}.*", line)]
    assert not [line for line in listed if re.search(r"\b(U|DV|WP|VP)\d", line)]


def test_results_stand_under_their_heading_alone() -> None:
    """A step names one value; entries of A and T are assigned at the end."""
    text = generate_module(load_robot("tx40"))
    assert not re.search(r"^ +\w+ = [AT]\[", text, re.MULTILINE)


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_the_head_says_what_was_not_read_and_whose_values_differ(target: str) -> None:
    robot = load_robot("planar_2r")
    texts = [
        *generate_files(robot, targets=(target,)).values(),
        *generate_files(
            replace(robot, distal=2, not_read=("forces of a fluid",)), targets=(target,)
        ).values(),
    ]
    plain, told = [" ".join(text.split()) for text in texts[:: len(texts) // 2][:2]]
    assert "Not read" not in plain and "classic table" not in plain
    assert "Not read forces of a fluid" in told
    assert (
        "Values parameters are in Khalil's frames" in told and "has another number in each" in told
    )


def test_signs_are_called_signs() -> None:
    text = generate_module(load_robot("tx40"))
    assert "signQP1 = xp.sign(QP1)" in text and "signQPFSM6 = xp.sign(QPFSM6)" in text
    assert not re.search(r"GAM\w+ = xp\.sign", text)


def test_comments_of_another_language_stay_comments() -> None:
    language = PYTHON._replace(comment="//", prose=("/*", "*/"), breaks=True)
    words = " ".join(["word"] * 40)
    lines = [*lines_that_fit([f"    x = f(a);  // {words}", f"  // {words}", "y = 1;"], language)]
    code = [line for line in lines if not line.strip().startswith("//")]
    assert code == ["    x = f(a);", "y = 1;"] and max(map(len, lines)) <= WIDTH
    assert " ".join(lines).count("word") == 80


def test_declarations_are_whole_and_compile(tmp_path) -> None:
    """No line of the header ends in a type or starts with a star; a compiler takes it alone."""
    for name in ("tx40", "five_bar"):
        text = generate_files(load_robot(name), targets=("c",))[f"{name}.h"]
        assert not re.search(r"(_REAL|const)$|^ +\*\w", text, re.MULTILINE)
        (tmp_path / f"{name}.h").write_text(text, encoding="utf-8")
        (tmp_path / "unit.c").write_text(f'#include "{name}.h"\n', encoding="utf-8")
        flags = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-fsyntax-only"]
        subprocess.run(["cc", *flags, str(tmp_path / "unit.c")], check=True)


def test_X_of_the_robot_file(tx40, tmp_path) -> None:
    np.testing.assert_array_equal(tx40.BASE_VALUES, tx40.base_parameters(tx40.VALUES))
    path = tmp_path / "tx40.c"
    path.write_text(generate_files(load_robot("tx40"), targets=("c",))["tx40.c"], encoding="utf-8")
    library = tmp_path / "tx40.so"
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-O0", str(path), "-o", str(library), "-lm"], check=True
    )
    values = (ctypes.c_double * 60).in_dll(ctypes.CDLL(str(library)), "tx40_values")
    np.testing.assert_allclose([*values], tx40.BASE_VALUES, rtol=1e-14)
    text = generate_module(load_robot("two_branch"))
    assert ("BASE_VALUES" in text) == bool(load_robot("two_branch").values)


def test_missing_values_are_named(tx40) -> None:
    whole = dict.fromkeys(tx40.STANDARD_PARAMETERS, 1.0)
    acting = {name: x for name, x in whole.items() if name not in tx40.NO_EFFECT}
    np.testing.assert_array_equal(tx40.base_parameters(acting), tx40.base_parameters(whole))
    del acting["MX3"], acting["FV6"]
    with pytest.raises(ValueError, match=r"^standard: no value of MX3, FV6$"):
        tx40.base_parameters(acting)
    with pytest.raises(ValueError, match=r"standard of shape \(3,\); expected \(86,\)"):
        tx40.base_parameters([1.0, 2.0, 3.0])


def test_states_of_a_package_with_X_of_numpy(tx40) -> None:
    import array_api_strict as xp

    q, qd, qdd = np.random.default_rng(0).normal(size=(3, 5, 6))
    X = tx40.BASE_VALUES
    found = tx40.inverse_dynamics(*map(xp.asarray, (q, qd, qdd)), X)
    expected = tx40.inverse_dynamics(q, qd, qdd, X)
    np.testing.assert_allclose(np.asarray(found._array), expected, rtol=1e-12, atol=1e-12)
    with pytest.raises(TypeError, match="states of ndarray beside states or X of array_api_strict"):
        tx40.inverse_dynamics(xp.asarray(q), qd, qdd, X)


@pytest.fixture
def power(monkeypatch) -> None:
    """The model Gamma' qd: one number."""

    def entries(d: Any, request: Any) -> Any:
        yield Case([Entry((), sum(x * d.algebra.qd(j) for j, x in d.torque.items()))])

    of = ("q", "qd", "qdd", "X")
    row = Model(
        "power", "PW", of, (), "W", "mechanical power of the actuators", entries, result="PW"
    )
    for table in (models.MODELS, models.EMITTED):
        monkeypatch.setitem(table, "power", row)


def test_a_model_of_one_number(power, tmp_path) -> None:
    files = generate_files(load_robot("planar_2r"), targets=("numpy", "c"))
    arm: Any = module(files["planar_2r.py"])
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, 4, 2))
    X = arm.BASE_VALUES
    expected = (arm.inverse_dynamics(q, qd, qdd, X) * qd).sum(axis=1)
    np.testing.assert_allclose(arm.power(q, qd, qdd, X), expected, rtol=1e-12)
    assert np.shape(arm.power(q[0], qd[0], qdd[0], X)) == ()
    found = arm.casadi("power")(q=q[0], qd=qd[0], qdd=qdd[0], X=X)["PW"]
    assert float(found) == pytest.approx(expected[0], rel=1e-12)
    path, library = tmp_path / "planar_2r.c", tmp_path / "planar_2r.so"
    path.write_text(files["planar_2r.c"], encoding="utf-8")
    subprocess.run(["cc", "-shared", "-fPIC", str(path), "-o", str(library), "-lm"], check=True)
    given = [np.ascontiguousarray(x) for x in (q[0], qd[0], qdd[0], X, [*arm.CONSTANTS.values()])]
    S = np.zeros(1)
    pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (*given, S)]
    ctypes.CDLL(str(library)).planar_2r_power1(*pointers)
    assert S[0] == pytest.approx(expected[0], rel=1e-12)
