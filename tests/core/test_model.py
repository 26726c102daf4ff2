"""Emitted modules at the border: found, checked, and refused when they are something else."""

import types
from pathlib import Path

import emps_model
import numpy as np
import planar_2r_model
import pytest

from runtime import load_model
from runtime.core.model import check_states, joint_units, require
from runtime.ground.errors import ModelError
from symgen.description import load_robot
from symgen.emit.generate import generate_module

HERE = Path(__file__).resolve().parents[1] / "support"
EMITTED = HERE.parents[1] / "generated"
HEAD = '"""A model."""\nimport numpy as np\n'


@pytest.mark.parametrize("given", [emps_model, HERE / "emps_model.py", str(HERE / "emps_model.py")])
def test_load(given):
    model = load_model(given, trust=True)
    assert model.NAME == "emps" and model.BASE_PARAMETERS[0] == "M1R"


def test_load_by_name(tmp_path, monkeypatch):
    (tmp_path / "generated").mkdir()
    (tmp_path / "generated" / "axis.py").write_bytes((HERE / "emps_model.py").read_bytes())
    monkeypatch.chdir(tmp_path)
    assert load_model("axis", trust=True).NAME == "emps"
    assert load_model("axis", folder=tmp_path / "generated", trust=True).NAME == "emps"
    assert not list(tmp_path.rglob("__pycache__"))
    with pytest.raises(
        ModelError, match=r"contains axis\); generate the model with `symgen generate arm`"
    ):
        load_model("arm")


@pytest.mark.parametrize(
    "path",
    sorted(EMITTED.glob("*.py")),
    ids=lambda p: p.stem,
)
def test_models_of_this_repository(path):
    assert str(load_model(path).NAME) == path.stem


def changed(**values):
    module = types.ModuleType("changed")
    vars(module).update(
        {k: v for k, v in vars(planar_2r_model).items() if not k.startswith("__")} | values
    )
    return module


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"JOINTS": (1, 2, 3)}, "expected bool (10, 3)"),
        ({"STRUCTURE": np.ones((10, 2))}, "STRUCTURE is float64"),
        ({"BASE_PARAMETERS": ("A",) * 10}, "each name once"),
        ({"DRIVES": {"ratio": [[1.0]]}}, "DRIVES is for 1 joints, but the model has 2"),
        ({"regressor": 3}, "no function regressor"),
        ({"store": lambda N: np.zeros((N, 2, 10))}, "expected (10, 2, 2)"),
        (
            {"observation_matrix": lambda q, qd, qdd: np.zeros((2, 10))},
            "expected (2, 2, 10) and (4, 10)",
        ),
    ],
)
def test_modules_that_contradict_themselves(values, said):
    with pytest.raises(ModelError) as e:
        load_model(changed(**values))
    assert said in str(e.value)


def test_not_a_model():
    with pytest.raises(ModelError, match="no NAME, JOINTS"):
        load_model(types.ModuleType("nothing"))
    with pytest.raises(ModelError, match="no function forward_dynamics"):
        require(load_model(emps_model), "forward_dynamics")


def test_states_at_the_border():
    good = np.zeros((5, 1))
    check_states(emps_model, q=good, qd=good, qdd=good)
    check_states(emps_model, q=good[0], qd=good[0], qdd=good[0])
    with pytest.raises(ValueError, match=r"qd has shape \(4, 1\), q \(5, 1\); expected \(N, 1\)"):
        check_states(emps_model, q=good, qd=good[:4], qdd=good)
    with pytest.raises(ValueError, match=r"q has shape \(5, 2\)"):
        check_states(emps_model, q=np.zeros((5, 2)), qd=good, qdd=good)
    with pytest.raises(ValueError, match="real numbers"):
        check_states(emps_model, q=good.astype(complex), qd=good, qdd=good)


def test_a_file_that_fails_says_so(tmp_path):
    (tmp_path / "a.py").write_text(HEAD + "x = [][1]\n", encoding="utf-8")
    with pytest.raises(ModelError, match="the import of the module fails with IndexError"):
        load_model(tmp_path / "a.py", trust=True)


@pytest.mark.parametrize(
    ("robot", "units"),
    [
        ("scara", "rad rad rad m"),
        ("stanford", "rad rad m rad rad rad"),
        ("emps", "m"),
        ("sr400", "rad " * 6),
    ],
)
def test_units_of_the_joints(tmp_path, robot, units):
    """From friction and inertia along each joint; without such elements from what acts on it."""
    (tmp_path / f"{robot}.py").write_text(generate_module(load_robot(robot)), encoding="utf-8")
    model = load_model(tmp_path / f"{robot}.py", trust=True)
    assert joint_units(model) == tuple(units.split())
    model.ELEMENTS = {}
    assert joint_units(model) == tuple(units.split())
