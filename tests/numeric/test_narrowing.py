"""Regressors of some entries: the bits of the whole one, and fewer statements."""

import ast
import inspect
from pathlib import Path

import numpy as np
import pytest

from runtime import load_model
from runtime.model.narrowing import _needed, narrowed

GENERATED = Path(__file__).parents[2] / "generated"
MODULES = sorted(path for path in GENERATED.glob("*.py") if not path.stem.endswith(("casadi", "xp", "__init__")))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_wanted_entries_have_the_same_bits(path):
    model, rng = load_model(path), np.random.default_rng(len(path.stem))
    k, j = np.nonzero(model.STRUCTURE)
    some = rng.permutation(len(k))[: max(1, len(k) // 3)]
    few = narrowed(model, list(zip(k[some].tolist(), j[some].tolist(), strict=True)))
    q, qd, qdd = rng.uniform(-0.3, 0.3, (3, 50, len(model.JOINTS)))
    assert few.NAME == model.NAME and few is not model
    assert (few.regressor(q, qd, qdd)[:, j[some], k[some]] == model.regressor(q, qd, qdd)[:, j[some], k[some]]).all()


def test_what_others_need_is_left_out():
    model = load_model(GENERATED / "tx40.py")
    block = next(
        node for node in ast.parse(inspect.getsource(model)).body if isinstance(node, ast.FunctionDef) and node.name == "_regressor_block"
    )
    viscous = _needed(block.body, {f"D[{model.BASE_PARAMETERS.index('FV3')}, 2]"})
    assert [ast.unparse(s) for s in viscous][1:] == ["QP1, QP2, QP3, QP4, QP5, QP6 = qd", "D[22, 2] = QP3"]
