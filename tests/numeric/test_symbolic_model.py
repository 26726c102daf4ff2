"""CasADi modules at the border: found beside the NumPy module, checked, and refused when no emitter wrote them."""

import types
from pathlib import Path

import pytest

from runtime import load_model
from runtime.errors import ModelError
from runtime.model.casadi import load_symbolic
from runtime.model.loading import check_source

GENERATED = Path(__file__).resolve().parents[2] / "generated"
HEAD = '"""A model."""\nimport casadi as ca\n'


def test_load():
    model = load_model("tx40", folder=GENERATED)
    for given in ("tx40", "tx40_casadi"):
        assert load_symbolic(given, of=model, folder=GENERATED).BASE_PARAMETERS == model.BASE_PARAMETERS
    assert load_symbolic(GENERATED / "emps_casadi.py").NAME == "emps"


def test_what_is_no_casadi_model(tmp_path):
    with pytest.raises(ModelError, match="emit it with `symgen generate arm --target numpy,casadi"):
        load_symbolic("arm", folder=tmp_path)
    with pytest.raises(ModelError, match="different robot files"):
        load_symbolic("tx40", of=load_model("emps", folder=GENERATED), folder=GENERATED)
    with pytest.raises(ModelError, match="no NAME, JOINTS"):
        load_symbolic(types.ModuleType("nothing"))
    with pytest.raises(ModelError, match="regressor takes None; expected q, qd, qdd"):
        load_symbolic(GENERATED / "tx40.py")
    with pytest.raises(ModelError, match="no store, observation_matrix"):
        load_model(GENERATED / "tx40_casadi.py")


@pytest.mark.parametrize(
    "text",
    [
        "import numpy as np",  # two array packages
        "import casadi",
        "from casadi import Function",
        "y = ca",
        "def f(ca):\n    return ca.external('a', 'b.so')",
        "class ca:\n    pass",
        "x = ca.Importer('a.c', 'shell')",
        "x = ca.external('f', './f.so')",
        "x = ca.Function.load('f')",
        "x = ca.CodeGenerator('f')",
        "x = ca.GlobalOptions",
        "x = ca.os",
        "x = ca.tools",
        "x = ca.DM.from_file('a')",
        "x = ca.SX.from_file('a')",
        "F = ca.Function",
        "F = (ca.Function)\nf = F('f', [], [], [], [], {'jit': True})",
        "x = [ca.Function for _ in range(2)]",
        "f = ca.Function('f', [], [], [], [], {'jit': True})",
        "f = ca.Function('f', [], [], [], [], {'default_in': [], 'jit': True})",
        "f = ca.Function('f', [], [], [], [], {'default_in': [], **{'jit': True}})",
        "f = ca.Function('f', [], [], [], [], {**{'jit': True}})",
        "f = ca.Function('f', [], [], [], [], {'default_' + 'in': []})",
        "o = {'jit': True}\nf = ca.Function('f', [], [], [], [], o)",
        "o = {'jit': True}\nf = ca.Function('f', [], [], o)",
        "o = [{'jit': True}]\nf = ca.Function('f', [], [], [], [], *o)",
        "f = ca.Function('f', [], [], [], [], opts={'jit': True})",
        "f = ca.Function('f', {}, [], [], {'jit': True})",
        "f = ca.Function('f.casadi')",
        "x = ca.SX.sym('x')\nj = ca.jacobian(x, x, {'helper_options': {'jit': True}})",
        "j = ca.jacobian\nx = j(1, 2, {})",
        "x = ca.SX.sym('x')\nx.to_file('a')",
        "def f(g):\n    return g.generate('a.c')",
        "def f(g):\n    return g.save('a')",
        "def f(g):\n    return g.map(2, 'thread', {'jit': True})",
        "def f(g):\n    return g.jacobian",
        "def f(g):\n    return g.mapaccum('a', 2, {})",
        "x = open('a')",
        "x = getattr(ca, 'external')",
        "x = ().__class__",
    ],
)
def test_files_no_emitter_writes(text):
    with pytest.raises(ModelError, match=r"a\.py"):
        check_source(HEAD + text + "\n", "a.py")


def test_numpy_modules_may_not_reach_casadi():
    with pytest.raises(ModelError, match="a name the file does not define"):
        check_source('"""A model."""\nimport numpy as np\nx = ca.cos(1.0)\n', "a.py")


@pytest.mark.parametrize(
    "text",
    [
        "x = ca.SX.sym('x', 2)\nf = ca.Function('f', [x], [ca.cos(x)], ['x'], ['y'], {'default_in': [0.0]})\ny = f(x)",
        "def f(J):\n    J[:3, 0] = ca.cross(J[:3, 1], J[3:, 0])\n    return ca.jacobian(J.T, J)",
    ],
)
def test_files_an_emitter_may_write(text):
    check_source(HEAD + text, "a.py")
