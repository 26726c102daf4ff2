"""Array modules at the border: found, checked, and closed to files that no emitter writes."""

import sys
from pathlib import Path
from types import ModuleType

import pytest

from runtime.errors import ModelError
from runtime.model.array_model import load_arrays
from runtime.model.generated import load_model
from runtime.model.loading import check_source

pytest.importorskip("array_api_compat")

GENERATED = Path(__file__).resolve().parents[2] / "generated"
HEAD = '"""A model."""\nfrom array_api_compat import array_namespace\n'


def test_load():
    model = load_arrays("tx40", of=load_model("tx40", folder=GENERATED), folder=GENERATED)
    assert (model.NAME, model.SIGNALS) == ("tx40", 136)
    assert load_arrays(GENERATED / "tx40_xp.py").ENTRIES == model.ENTRIES
    assert load_arrays(model) is model


def test_what_is_no_array_model(tmp_path):
    with pytest.raises(ModelError, match="emit it with `symgen generate arm --target numpy,xp"):
        load_arrays("arm", folder=tmp_path)
    with pytest.raises(ModelError, match=r"no NAME.*emit it again"):
        load_arrays(ModuleType("empty"))
    with pytest.raises(ModelError, match="different robot files"):
        load_arrays("tx40", of=load_model("panda", folder=GENERATED), folder=GENERATED)
    changed = (GENERATED / "tx40_xp.py").read_text(encoding="utf-8").replace("SIGNALS = 136", "SIGNALS = 3")
    (tmp_path / "tx40_xp.py").write_text(changed, encoding="utf-8")
    with pytest.raises(ModelError, match=r"ENTRIES holds .*; expected less than \(60, 6, 3\)"):
        load_arrays("tx40", folder=tmp_path)


def test_without_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "array_api_compat", None)
    with pytest.raises(ModelError, match=r"pip install symgen\[gpu\]"):
        load_arrays("tx40", folder=GENERATED)


@pytest.mark.parametrize(
    "text",
    [
        "import numpy as np",
        "import array_api_compat",
        "from array_api_compat import *",
        "from array_api_compat import numpy",
        "from array_api_compat.torch import load",
        "from torch import load",
        "def f(x):\n    from array_api_compat import array_namespace",
        "def f(x):\n    return array_namespace(x).load('a')",
        "def f(x):\n    xp = array_namespace(x)\n    return xp.save(x, 'a')",
        "def f(x):\n    y = array_namespace(x)\n    return y.hub",
        "def f(x):\n    xp = array_namespace(x)\n    return xp.ops.load_library('a')",
        "def f(x):\n    return array_namespace(x).linalg.lapack",
        "def f(x):\n    return array_namespace(x).from_dlpack(x)",
        "def f(m):\n    return m.dump('a')\ndef g(x):\n    return f(array_namespace(x))",
        "def f(x):\n    return x.tofile('a')",
        "def f(x):\n    return x.data",
        "def f(x):\n    return x.numpy()",
        "def f(x):\n    return x.__array_namespace__()",
        "f = array_namespace",
        "x = array_namespace.__globals__",
        "def f(g=array_namespace):\n    return g(1).load",
        "def array_namespace(x):\n    return x",
        "def f(array_namespace):\n    return array_namespace(1)",
        "x = open('a')",
        "x = getattr(array_namespace(1), 'load')",
        "x = np.zeros(3)",
    ],
)
def test_files_no_emitter_writes(tmp_path, text):
    (tmp_path / "a.py").write_text(HEAD + text + "\n", encoding="utf-8")
    with pytest.raises(ModelError, match=r"a\.py"):
        load_arrays(tmp_path / "a.py")


def test_a_numpy_file_may_not_reach_other_packages():
    for text in ("x = array_namespace(1)", "from array_api_compat import array_namespace"):
        with pytest.raises(ModelError, match=r"a\.py"):
            check_source(f'"""A model."""\nimport numpy as np\n{text}\n', "a.py")


def test_files_an_emitter_may_write():
    check_source(HEAD + "def f(x, *, a=1.0):\n    xp = array_namespace(x)\n    return xp.where(x > 0.0, a*xp.cos(x), -x[..., 0])\n", "a.py")
