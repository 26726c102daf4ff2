"""Regressors of some entries: the bits of the whole one, and fewer statements."""

import ast
import inspect
from pathlib import Path

import numpy as np
import pytest

from runtime import load_model
from runtime.model.narrowing import _needed, narrowed, narrowed_source

GENERATED = Path(__file__).parents[2] / "generated"
MODULES = sorted(
    path for path in GENERATED.glob("*.py") if not path.stem.endswith(("casadi", "xp", "__init__"))
)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_wanted_entries_have_the_same_bits(path):
    model, rng = load_model(path), np.random.default_rng(len(path.stem))
    k, j = np.nonzero(model.STRUCTURE)
    some = rng.permutation(len(k))[: max(1, len(k) // 3)]
    few = narrowed(model, list(zip(k[some].tolist(), j[some].tolist(), strict=True)))
    q, qd, qdd = rng.uniform(-0.3, 0.3, (3, 50, len(model.JOINTS)))
    assert few.NAME == model.NAME and few is not model
    assert (
        few.regressor(q, qd, qdd)[:, j[some], k[some]]
        == model.regressor(q, qd, qdd)[:, j[some], k[some]]
    ).all()


def test_what_others_need_is_left_out():
    model = load_model(GENERATED / "tx40.py")
    block = next(
        node
        for node in ast.parse(inspect.getsource(model)).body
        if isinstance(node, ast.FunctionDef) and node.name == "_regressor_block"
    )
    viscous = _needed(block.body, "D", {f"D[{model.BASE_PARAMETERS.index('FV3')}, 2]"})
    assert [ast.unparse(s) for s in viscous][1:] == [
        "QP1, QP2, QP3, QP4, QP5, QP6 = qd",
        "D[22, 2] = QP3",
    ]


DIVIDED = """
/* One tile of regressor, part 1 of 2. */
        const double a = q[0][t];
        V[0][t] = a*T[0][t];
        D[0][t] = a;  /* DG1A */
        V[1][t] = 2*a;
/* One tile of regressor, part 2 of 2. */
        const double b = V[0][t];
        V[0][t] = V[1][t];
        D[1][t] = V[0][t];
        D[2][t] = b;
/* One tile of regressor. */
        T[0][t] = cos(q[1][t]);
        T[1][t] = sin(q[1][t]);
/* Entries that are not zero
        D[9][t] = 0;"""


@pytest.mark.parametrize(
    ("signal", "left"),
    [
        (0, ["const double a = q[0][t];", "D[0][t] = a;  /* DG1A */"]),
        (
            1,
            [
                "const double a = q[0][t];",
                "V[1][t] = 2*a;",
                "V[0][t] = V[1][t];",
                "D[1][t] = V[0][t];",
            ],
        ),
        (
            2,
            [
                "const double a = q[0][t];",
                "V[0][t] = a*T[0][t];",
                "const double b = V[0][t];",
                "D[2][t] = b;",
                "T[0][t] = cos(q[1][t]);",
            ],
        ),
    ],
)
def test_c_in_parts(signal, left):
    """The loops of the function that calls the parts come first; a row of V that is used again does
    not need what it held before.
    """
    lines = [line.strip() for line in narrowed_source(DIVIDED, [signal]).splitlines()]
    assert [
        line for line in lines if line.endswith(("; ", ";", "*/")) and "One tile" not in line
    ] == [*left, "D[9][t] = 0;"]
