"""Emitted modules at the border: found, checked, and refused when they are something else."""

import types
from pathlib import Path

import emps_model
import numpy as np
import planar_2r_model
import pytest

from runtime import load_model
from runtime.errors import ModelError
from runtime.model.generated import check_states, joint_units, require
from runtime.model.loading import check_source
from symgen.description import load_robot
from symgen.emit.generate import generate_module

HERE = Path(__file__).parent
EMITTED = HERE.parents[1] / "generated"
HEAD = '"""A model."""\nimport numpy as np\n'


@pytest.mark.parametrize("given", [emps_model, HERE / "emps_model.py", str(HERE / "emps_model.py")])
def test_load(given):
    model = load_model(given)
    assert model.NAME == "emps" and model.BASE_PARAMETERS[0] == "M1R"


def test_load_by_name(tmp_path, monkeypatch):
    (tmp_path / "generated").mkdir()
    (tmp_path / "generated" / "axis.py").write_bytes((HERE / "emps_model.py").read_bytes())
    monkeypatch.chdir(tmp_path)
    assert load_model("axis").NAME == "emps"
    assert load_model("axis", folder=tmp_path / "generated").NAME == "emps"
    assert not list(tmp_path.rglob("__pycache__"))
    with pytest.raises(ModelError, match=r"holds axis: emit it with `symgen generate arm`"):
        load_model("arm")


@pytest.mark.parametrize(
    "path", [p for p in sorted(EMITTED.glob("*.py")) if "casadi" not in p.stem and not p.stem.endswith("_xp")], ids=lambda p: p.stem
)
def test_models_of_this_repository(path):
    assert str(load_model(path).NAME) == path.stem


def changed(**values):
    module = types.ModuleType("changed")
    vars(module).update({k: v for k, v in vars(planar_2r_model).items() if not k.startswith("__")} | values)
    return module


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"JOINTS": (1, 2, 3)}, "expected bool (10, 3)"),
        ({"STRUCTURE": np.ones((10, 2))}, "STRUCTURE is float64"),
        ({"BASE_PARAMETERS": ("A",) * 10}, "names once"),
        ({"DRIVES": {"ratio": [[1.0]]}}, "DRIVES of 1 joints; expected 2"),
        ({"regressor": 3}, "no function regressor"),
        ({"store": lambda N: np.zeros((N, 2, 10))}, "expected (10, 2, 2)"),
        ({"observation_matrix": lambda q, qd, qdd: np.zeros((2, 10))}, "expected (2, 2, 10) and (4, 10)"),
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
    check_states(emps_model, good, good, good)
    check_states(emps_model, good[0], good[0], good[0])
    with pytest.raises(ValueError, match=r"qd has shape \(4, 1\), q \(5, 1\); expected \(N, 1\)"):
        check_states(emps_model, good, good[:4], good)
    with pytest.raises(ValueError, match=r"q has shape \(5, 2\)"):
        check_states(emps_model, np.zeros((5, 2)), good, good)
    with pytest.raises(ValueError, match="real numbers"):
        check_states(emps_model, good.astype(complex), good, good)


@pytest.mark.parametrize(
    "text",
    [
        "import os",
        "from numpy import load",
        "import numpy as np, os",
        "def f():\n    import os",
        "x = open('a')",
        "x = eval('1')",
        "exec('1')",
        "x = __import__('os')",
        "x = getattr(np, 'load')",
        "x = type(1).__subclasses__()",
        "x = np.load('a')",
        "x = np.lib",
        "y = np\nx = y.load",
        "def f(a=np):\n    return a.load('x')",
        "x = np.linalg._linalg",
        "y = np.linalg\nx = y._linalg",
        "x = ().__class__",
        "x = '{0.real}'.format(1)",
        "x = (lambda: 0).__globals__",
        "def f(x):\n    match x:\n        case object(__class__=c):\n            return c",
        "def open(f):\n    return f",
        "def f(np):\n    return np.load('a')",
        "class np:\n    pass",
        "def f():\n    global g\n    g = 1",
        "x = np.zeros(3).tofile('a')",
        "x = [i for i in ()].gi_frame",
        "for i in range(3):\n    x = i",
        "if True:\n    x = 1",
        "x = undefined_name",
        "def f():\n    yield 1",
        "class A:\n    __reduce__ = None",
        "x = (",
        "x = '\x00'",
    ],
)
def test_files_no_emitter_writes(tmp_path, text):
    path = tmp_path / "a.py"
    path.write_text(HEAD + text + "\n", encoding="utf-8")
    with pytest.raises(ModelError, match=r"a\.py"):
        load_model(path)


@pytest.mark.parametrize(
    "text",
    [
        "x = 1\ny = 2.0",
        "def f(q, *, out=None):\n    '''Sum.'''\n    if out is None:\n        raise ValueError(f'{q} no')\n    return np.linalg.solve(q, out)",
        "class Store(np.ndarray):\n    ready = False\n    def __array_finalize__(self, parent):\n        self.ready = False\nx = np.zeros(3).view(Store)",
        "T = {name: i for i, name in enumerate(('A', 'B'))}\nS = np.array([[True]])",
        "def f(x):\n    for i in range(3):\n        x = x + i\n    return max(x, 0)",
    ],
)
def test_files_an_emitter_may_write(text):
    check_source(HEAD + text, "a.py")


def test_a_file_that_fails_says_so(tmp_path):
    (tmp_path / "a.py").write_text(HEAD + "x = [][1]\n", encoding="utf-8")
    with pytest.raises(ModelError, match="fails on import with IndexError"):
        load_model(tmp_path / "a.py")


@pytest.mark.parametrize(
    ("robot", "units"), [("scara", "rad rad rad m"), ("stanford", "rad rad m rad rad rad"), ("emps", "m"), ("sr400", "rad " * 6)]
)
def test_units_of_the_joints(tmp_path, robot, units):
    """From friction and inertia along each joint; without such elements from what acts on it."""
    (tmp_path / f"{robot}.py").write_text(generate_module(load_robot(robot)), encoding="utf-8")
    model = load_model(tmp_path / f"{robot}.py")
    assert joint_units(model) == tuple(units.split())
    model.ELEMENTS = {}
    assert joint_units(model) == tuple(units.split())
