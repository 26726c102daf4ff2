"""The border to callers: every entry point with every wrong kind of argument, one sentence each.

`pytest -rP -k test_table tests/core/test_wrong_kinds.py` prints how many pairs were tried and refused.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import runtime
import symgen
from runtime.ground.errors import InputError, SettingsError
from runtime.study import study_from_mapping
from symgen.errors import SymgenError

N = 200
T = np.arange(N) / 100.0
Q = np.column_stack([np.sin(2 * T), 0.5 * np.cos(3 * T)])
TAU = np.column_stack([np.cos(T), T])
ARRAYS: dict[str, Callable[[np.ndarray], Any]] = {
    "None": lambda x: None,
    "text": lambda x: "x",
    "bytes": lambda x: b"x",
    "dict": lambda x: {"a": 1},
    "set": lambda x: {1.0, 2.0},
    "object": lambda x: object(),
    "number": lambda x: 1.0,
    "empty": lambda x: [],
    "ragged list": lambda x: [*x.tolist()[:-1], [1.0, 2.0, 3.0]],
    "None in a list": lambda x: [*x.tolist()[:-1], None],
    "texts": lambda x: x.astype(str),
    "text in a list": lambda x: [*x.tolist()[:-1], "0.5"],
    "bytes in an array": lambda x: x.astype("S8"),
    "complex": lambda x: x + 1j,
    "complex, imaginary parts zero": lambda x: x.astype(complex),
    "datetime64": lambda x: np.datetime64("2026-01-01", "ns") + (1e9 * x).astype("m8[ns]"),
    "timedelta64": lambda x: (1e9 * x).astype("m8[ns]"),
    "masked": lambda x: np.ma.masked_greater(x, np.median(x)),
    "structured": lambda x: np.zeros(len(x), dtype=[("a", float), ("b", float)]),
    "objects": lambda x: np.full(x.shape, object()),
    "complex objects": lambda x: (x + 1j).astype(object),
    "function": lambda x: np.sin,
}
OTHERS: dict[str, Any] = {
    "None": None,
    "number": 5,
    "text": "x.none",
    "bytes": b"x",
    "dict": {"a": 1},
    "list": [1, 2],
    "object": object(),
    "array": T,
    "class": int,
    "tuple": (1, 2),
}
STUDY = {kind: x for kind, x in OTHERS.items() if x is not None}
NAMES = {kind: x for kind, x in OTHERS.items() if kind != "bytes"}
RATES = {"text": "250", "list": [250.0], "complex": 250 + 0j, "dict": {}, "nan": np.nan, "zero": 0}


def _arrays(x: np.ndarray) -> dict[str, Any]:
    return {kind: made(x) for kind, made in ARRAYS.items()}


def _pairs() -> list[tuple[str, str, Callable[[Any], Any], Any]]:
    """Entry point, kind, call, wrong value."""
    model = symgen.model("planar_2r")
    record = runtime.Record(T, Q, TAU)
    study = runtime.Study()
    X = np.arange(1.0, 1 + len(model.BASE_PARAMETERS))
    table: dict[str, tuple[Callable[[Any], Any], dict[str, Any]]] = {
        "Record(t)": (lambda x: runtime.Record(x, Q, TAU), _arrays(T)),
        "Record(q)": (lambda x: runtime.Record(T, x, TAU), _arrays(Q)),
        "Record(tau)": (lambda x: runtime.Record(T, Q, x), _arrays(TAU)),
        "Record(qd)": (lambda x: runtime.Record(T, Q, TAU, qd=x), _without_none(_arrays(Q))),
        "Record(channels)": (
            lambda x: runtime.Record(T, Q, TAU, channels={"temperature": x}),
            _without_none(_arrays(T)),
        ),
        "Record(tau_known)": (
            lambda x: runtime.Record(T, Q, TAU, tau_known=x),
            _without_none(_arrays(Q)),
        ),
        "Record(missing)": (
            lambda x: runtime.Record(T, Q, TAU, missing=x),
            _without_none(_arrays(Q)),
        ),
        "Record(rate)": (lambda x: runtime.Record(T, Q, TAU, rate=x), RATES),
        "Record(name)": (lambda x: runtime.Record(T, Q, TAU, name=x), _without("text", OTHERS)),
        "Record(origin)": (lambda x: runtime.Record(T, Q, TAU, origin=x), STUDY),
        "resample(t)": (lambda x: runtime.resample(x, Q), _arrays(T)),
        "resample(x)": (lambda x: runtime.resample(T, x), _arrays(Q)),
        "resample(rate)": (lambda x: runtime.resample(T, Q, x), _without("text", RATES)),
        "resample(longest)": (
            lambda x: runtime.resample(T, Q, longest=x),
            _without("number", STUDY),
        ),
        "load_model": (runtime.load_model, OTHERS),
        "load_study": (runtime.load_study, OTHERS),
        "read_record": (runtime.read_record, OTHERS),
        "report": (lambda x: runtime.report(x, "folder"), OTHERS),
        "simulate(model)": (lambda x: runtime.simulate(x, study), OTHERS),
        "simulate(study)": (lambda x: runtime.simulate(model, x), OTHERS),
        "compare(candidate)": (lambda x: runtime.compare(model, x), _without("dict", OTHERS)),
        "compare(model)": (lambda x: runtime.compare(x, {"a": (study, record, record)}), OTHERS),
        "symgen.model": (symgen.model, NAMES),
        "load_robot": (symgen.load_robot, NAMES),
        "symbolic": (symgen.symbolic, NAMES),
        "variants": (symgen.variants, NAMES),
        "parse_robot": (lambda x: symgen.parse_robot(x, "x.yaml"), OTHERS),
        "regressor(q)": (lambda x: model.regressor(x, Q, Q), _arrays(Q)),
        "regressor(qdd)": (lambda x: model.regressor(Q, Q, x), _arrays(Q)),
        "observation_matrix(qd)": (lambda x: model.observation_matrix(Q, x, Q), _arrays(Q)),
        "inverse_dynamics(q)": (lambda x: model.inverse_dynamics(x, Q, Q, X), _arrays(Q)),
        "inverse_dynamics(X)": (lambda x: model.inverse_dynamics(Q, Q, Q, x), _arrays(X)),
        "bias(qd)": (lambda x: model.bias(Q, x, X), _arrays(Q)),
        "gravity(q)": (lambda x: model.gravity(x, X), _arrays(Q)),
        "inertia_matrix(q)": (lambda x: model.inertia_matrix(x, X), _arrays(Q)),
        "forward_dynamics(tau)": (lambda x: model.forward_dynamics(Q, Q, x, X), _arrays(Q)),
        "frame_poses(q)": (model.frame_poses, _arrays(Q)),
        "jacobian(q)": (model.jacobian, _arrays(Q)),
    }
    for name in ("observe", "estimate", "essential", "identify", "cestac", "advise", "plausibility",
                 "delay", "problem", "excite", "static_poses"):  # fmt: skip
        call = getattr(runtime, name)
        of_records = _without("list", OTHERS) | {"list": [1, 2]}
        table[f"{name}(model)"] = (lambda x, call=call: call(x, record), OTHERS)
        table[f"{name}(records)"] = (lambda x, call=call: call(model, x), of_records)
        table[f"{name}(study)"] = (lambda x, call=call: call(model, record, x), STUDY)
    return [(at, kind, call, x) for at, (call, kinds) in table.items() for kind, x in kinds.items()]


def _without_none(kinds: dict[str, Any]) -> dict[str, Any]:
    return {kind: x for kind, x in kinds.items() if x is not None}


def _without(name: str, kinds: dict[str, Any]) -> dict[str, Any]:
    return {kind: x for kind, x in kinds.items() if kind != name}


def _answer(call: Callable[[Any], Any], x: Any) -> str:
    """ "" for one sentence of the project; else what happened."""
    try:
        call(x)
    except (InputError, SymgenError, ValueError) as error:
        raised = inspect.trace()[-1].filename
        own = isinstance(error, InputError | SymgenError) or "generated_" in raised or (
            raised.endswith(".py") and "planar_2r" in raised
        )  # fmt: skip
        return "" if own and "\n" not in str(error) else f"{type(error).__name__}: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "accepted"


def test_table_of_entry_points_and_wrong_kinds() -> None:
    pairs = _pairs()
    answers = [(at, kind, _answer(call, x)) for at, kind, call, x in pairs]
    wrong = [answer for answer in answers if answer[2]]
    print(f"{len(pairs)} pairs, {len(pairs) - len(wrong)} refused in one sentence")
    assert len(pairs) > 600
    assert not wrong, "\n".join(f"{at}, {kind}: {text[:160]}" for at, kind, text in wrong)


@pytest.mark.parametrize(
    ("t", "text"),
    [
        ((1e9 * T).astype("m8[ns]"), r"t has dtype timedelta64\[ns\], time spans; give seconds"),
        (T + 1j, "t has dtype complex128, complex numbers"),
        (np.ma.masked_less(T, 0.1), "t has 10 masked values"),
        (T.astype(str), "t has dtype <U"),
    ],
)
def test_the_sentence_names_the_dtype(t: Any, text: str) -> None:
    for call in (lambda: runtime.Record(t, Q, TAU), lambda: runtime.resample(t, Q)):
        with pytest.raises(InputError, match=text):
            call()


@pytest.mark.parametrize(
    "same",
    [
        np.ndarray.tolist,
        lambda x: x.astype(object),
        lambda x: np.ma.array(x, mask=False),
        lambda x: np.array([[Fraction(v) for v in row] for row in x.tolist()]),
        lambda x: x.astype(np.longdouble),
    ],
)
def test_other_ways_to_write_real_numbers_are_taken(same: Callable[[Any], Any]) -> None:
    np.testing.assert_allclose(runtime.Record(T, same(Q), TAU).q, Q, rtol=1e-15)
    with pytest.raises(InputError, match="contains a Decimal; expected numbers"):
        runtime.Record(T, np.full(Q.shape, Decimal(1)), TAU)


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [
        ("signals.lowpass", "cutoff", 1e-300),
        ("signals.lowpass", "cutoff", 1e300),
        ("signals", "median", 99_999_999),
        ("signals.decimate", "factor", 10**12),
        ("signals", "velocity", 1e-320),
        ("rows", "window", [0, 1e300]),
        ("rows", "low_speed", 1e300),
        ("cestac", "runs", 10**12),
        ("cestac", "delta", 1e300),
        ("cestac", "delta", 1e-300),
        ("cestac", "seed", -1),
        ("cestac", "seed", 10**30),
        ("excitation", "grid", 1e12),
        ("excitation", "grid", 5000),
        ("excitation", "rate", 1e-300),
        ("excitation", "starts", 10**9),
        ("excitation", "starts", 1e9),
        ("excitation", "iterations", 10**9),
        ("excitation", "poses", 10**9),
        ("excitation", "seed", -1),
        ("excitation", "smooth", 1e-300),
        ("controller.reference.points", "seed", -1),
        ("controller.reference.points", "duration", 1e300),
        ("record", "rate", 1e300),
    ],
)
def test_settings_without_end_are_refused_at_their_key(section: str, key: str, value: Any) -> None:
    mapping: dict[str, Any] = {key: value}
    for name in reversed(section.split(".")):
        mapping = {name: mapping}
    with pytest.raises(SettingsError) as caught:
        study_from_mapping(mapping)
    assert key in str(caught.value) and "expected" in str(caught.value)
    assert "\n" not in str(caught.value)
