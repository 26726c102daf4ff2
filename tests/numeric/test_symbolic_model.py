"""CasADi modules at the border: found beside the NumPy module, checked, and refused when no emitter
wrote them.
"""

import types
from pathlib import Path

import pytest

from runtime import load_model
from runtime.errors import ModelError
from runtime.model.casadi import load_symbolic

GENERATED = Path(__file__).resolve().parents[2] / "generated"


def test_load():
    model = load_model("tx40", folder=GENERATED)
    for given in ("tx40", "tx40_casadi"):
        assert (
            load_symbolic(given, of=model, folder=GENERATED).BASE_PARAMETERS
            == model.BASE_PARAMETERS
        )
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
