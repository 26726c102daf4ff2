"""Wanted entries of the regressor by recorded operations: the bits of the emitted modules, and the modules themselves where more is done."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from runtime import load_model
from runtime.core.rows.regressor import Columns
from runtime.core.rows.tape import recorded
from runtime.core.signals.filters import States

FOLDER = Path(__file__).resolve().parents[2] / "generated"
LOOPS = ("five_bar", "four_bar")
MODELS = sorted(p.stem for p in FOLDER.glob("*.py") if p.stem not in ("__init__", *LOOPS))


@pytest.mark.parametrize("name", MODELS)
def test_bits_of_the_module(name):
    """All columns, and every second one in reverse, over pieces of two lengths."""
    model = load_model(name, folder=FOLDER)
    n = len(model.JOINTS)
    for columns in (model.BASE_PARAMETERS, model.BASE_PARAMETERS[::-2]):
        wanted = Columns(model, columns)
        assert wanted.tape is not None
        numbers = [model.BASE_PARAMETERS.index(column) for column in columns]
        for N in (1, 300):
            q, qd, qdd = np.random.default_rng(N).uniform(-1, 1, (3, N, n))
            expected = model.regressor(q, qd, qdd).transpose(2, 1, 0)[numbers]
            assert np.array_equal(wanted.decimated(States(q, qd, qdd), None), expected)


def test_fewer_columns_need_fewer_operations():
    model = load_model("tx40", folder=FOLDER)
    every = Columns(model).tape
    few = Columns(model, model.BASE_PARAMETERS[-10:]).tape
    assert len(few.operations) < len(every.operations) / 2


@pytest.mark.parametrize("name", LOOPS)
def test_loops_are_closed_by_the_module(name):
    assert Columns(load_model(name, folder=FOLDER)).tape is None


def decided(xp, q, qd, qdd, D):
    D[0, 0] = q[0] if qd[0] else qdd[0]


def sorted_rows(xp, q, qd, qdd, D):
    D[0, 0] = xp.sort(q[0])


def of_time(xp, q, qd, qdd, u, D):
    D[0, 0] = u * q[0]


def test_a_constant_that_is_a_function_of_time_is_not_recorded():
    model = SimpleNamespace(
        JOINTS=(1,),
        CONSTANTS={"u": 1.0},
        CHANNELS={"u": ("FV1",)},
        _regressor_block=of_time,
        store=lambda N: np.zeros((1, 1, N)),
    )
    assert recorded(model, [(0, 0)]) is None


@pytest.mark.parametrize("block", [decided, sorted_rows, of_time])
def test_what_is_no_operation_on_rows_is_not_recorded(block):
    model = SimpleNamespace(
        JOINTS=(1,), CONSTANTS={}, _regressor_block=block, store=lambda N: np.zeros((1, 1, N))
    )
    assert recorded(model, [(0, 0)]) is None


def test_powers_and_numbers_are_those_of_numpy():
    def block(xp, q, qd, qdd, D, g):
        D[0, 0] = q[0] ** 2 - g / (1 + qd[0] ** 4) + xp.cos(g) * xp.tanh(-qdd[0]) ** 0.5
        D[1, 0] = 2.0

    model = SimpleNamespace(
        JOINTS=(1,),
        CONSTANTS={"g": 9.81},
        _regressor_block=block,
        store=lambda N: np.ones((3, 1, N)),
    )
    q, qd, qdd = -np.random.default_rng(0).uniform(0.1, 1, (3, 50, 1))
    found = recorded(model, [(0, 0), (1, 0), (2, 0)]).evaluate(q, qd, qdd, np.empty((3, 50)))
    D = {}
    block(np, q.T, qd.T, qdd.T, D, 9.81)
    assert np.array_equal(found[0], D[0, 0])
    assert (found[1] == 2.0).all() and (found[2] == 1.0).all()
