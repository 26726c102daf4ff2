"""Rows of long records, made piece by piece: the same numbers as from a matrix W that is kept whole,
in memory that does not hold W.
"""

import json
import tracemalloc
from dataclasses import replace

import numpy as np
import planar_2r_model as planar
import pytest
from planar_data import TRUE, motion

import runtime
import symgen
from runtime import Record
from runtime.compose import problem
from runtime.core.problem import observe_rows
from runtime.core.rows import prepared, streamed
from runtime.core.rows.predicted import Weights
from runtime.core.rows.streamed import StreamedMatrix
from runtime.ground import memory
from runtime.ground.errors import InputError
from runtime.study import study_from_mapping

N = 9000
X = TRUE + 0.1
RATE = 500.0
SETTINGS = {
    "every sample": {"signals": {"decimate": None, "median": 1}},
    "decimated": {"signals": {"decimate": {"factor": 4}, "median": 1}},
    "slow rows left out": {"signals": {"decimate": None}, "rows": {"low_speed": 0.4}},
    "window": {"signals": {"decimate": None}, "rows": {"window": [2.0, 9.0]}},
}


def recorded(seed: int, samples: int = N) -> Record:
    t = np.arange(samples) / RATE
    q, qd, qdd = motion(t + 40 * seed)
    tau = planar.inverse_dynamics(q, qd, qdd, TRUE)
    tau += 0.1 * np.random.default_rng(seed).standard_normal(tau.shape)
    return Record(t, q, tau, rate=RATE, name=f"record {seed}")


def pair(monkeypatch, settings, records=2):
    """The rows of records of the planar arm: W kept whole, and streamed."""
    given = [recorded(k) for k in range(records)]
    study = study_from_mapping({"rows": {"low_speed": 0}, **settings})
    own = problem(planar, given, study)
    whole = observe_rows(own)
    monkeypatch.setattr(prepared, "WHOLE", 0.0)
    monkeypatch.setattr(streamed, "PIECE", 700)
    return whole, observe_rows(own)


def gram(rows):
    rows = np.vstack(list(rows))
    return rows.T @ rows


def grams(groups):
    return np.array([rows.T @ rows for rows in groups])


READ = {
    "factor": lambda o: o.factor.R.T @ o.factor.R,
    "joints": lambda o: [joint.measured_norm for joint in o.factor.joints],
    "columns": lambda o: gram([o.columns(o.names[7:2:-1]).factor.R]),
    "norms": lambda o: np.array(o.norms(o.names[:9], X[:9])),
    "product": lambda o: o.W @ X,
    "product of columns": lambda o: o.W[:, [4, 2]] @ X[:2],
    "rows of a joint": lambda o: np.asarray(o.W[o.joint(1)][:, [0, 3, 8]]),
    "some rows": lambda o: np.asarray(o.W[np.ix_(np.arange(3, len(o.Y), 7), [1, 5])]),
    "rows backwards": lambda o: o.W[np.arange(len(o.Y))[::-9]],
    "one column": lambda o: o.W[:, 3],
    "arithmetic": lambda o: np.abs(2.0 * o.W).sum(axis=0),
    "where": lambda o: np.asarray(o.where(o.t > 5.0).W),
    "between": lambda o: gram([o.between(3.0, 11.0).factor.R]),
    "record": lambda o: gram([o.of_record(1).factor.R]),
    "blocks": lambda o: grams(o.block_rows(o.names, np.array([2.0, 3.0]), o.residual_block)),
    "long blocks": lambda o: grams(o.block_rows(o.names[2:], np.array([2.0, 3.0]), 1.7)),
    "bands": lambda o: [grams(b) for b in sorted_bands(o)],
    "folds": lambda o: [gram([rest.factor.R, 2 * part.factor.R]) for rest, part in o.folds(5)],
    "fold factors": lambda o: [f.R.T @ f.R for f in o.fold_factors(3)],
    "whitened": lambda o: grams(
        o.block_rows(o.names, np.ones(2), 2.0, np.array([[2.0, 0.3], [0.3, 1.0]]))
    ),
    "predicted": lambda o: Weights(o.names, np.array([0.1, 0.3]), np.ones(10)).relative_sigma(
        o, (1.0, 0.4, -0.2)
    ),
    "condition": lambda o: Weights(o.names, np.array([0.1, 0.3]), np.ones(10)).condition(o),
}


def sorted_bands(o):
    return list(map(list, o.band_rows(o.names, np.array([2.0, 3.0]), X)))


@pytest.mark.parametrize("settings", SETTINGS)
def test_rows_are_the_same_in_every_bit(settings, monkeypatch):
    whole, parts = pair(monkeypatch, SETTINGS[settings])
    assert isinstance(parts.W, StreamedMatrix) and isinstance(whole.W, np.ndarray)
    assert parts.W.shape == whole.W.shape and len(parts.W) == len(whole.Y)
    np.testing.assert_array_equal(parts.W, whole.W)
    for name in ("Y", "t", "record", "motion"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
    assert (parts.rows, parts.dropped) == (whole.rows, whole.dropped)


@pytest.mark.parametrize("read", READ)
@pytest.mark.parametrize("settings", SETTINGS)
def test_whatever_reads_the_rows_gives_the_same(read, settings, monkeypatch):
    whole, parts = pair(monkeypatch, SETTINGS[settings])
    expected, found = (np.asarray(READ[read](o), dtype=float) for o in (whole, parts))
    size = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12 * size)


def numbers(x):
    """All numbers of a document, in order."""
    if isinstance(x, dict):
        return [v for key in sorted(x) for v in numbers(x[key])]
    if isinstance(x, list):
        return [v for one in x for v in numbers(one)]
    return [float(x)] if isinstance(x, (int, float)) else []


@pytest.mark.parametrize(
    "estimate",
    [
        {"method": "ols", "weights": "none"},
        {"method": "wls"},
        {"method": "wls", "weights": "covariance"},
        {"method": "irls"},
        {"method": "ols", "options": {"block": 0.7}},
    ],
)
def test_an_identification_is_the_same(estimate, monkeypatch):
    study = study_from_mapping(
        {"estimate": estimate, "rows": {"low_speed": 0}, "signals": {"decimate": {"factor": 2}}}
    )
    results = []
    for _ in range(2):
        result = runtime.identify(planar, [recorded(0), recorded(1, 6000)], study)
        document = json.loads(result.to_json())
        kept = ("X", "sigma", "sigma_corrected", "sigma_rho", "per_joint", "essential", "by_record")
        results.append((numbers([document[key] for key in kept]), result.to_text()))
        monkeypatch.setattr(prepared, "WHOLE", 0.0)
        monkeypatch.setattr(streamed, "PIECE", 700)
    assert isinstance(result.observation.W, StreamedMatrix)
    assert results[0][1] == results[1][1]
    np.testing.assert_allclose(results[1][0], results[0][0], rtol=1e-8, atol=1e-12)


def peak(call) -> float:
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_long_record_is_fitted_without_the_memory_of_its_matrix(monkeypatch):
    """From 12,000 rows of six joints to 36,000, memory grows by less than a third of W."""
    model, rng = symgen.model("tx40"), np.random.default_rng(0)
    w, phase = rng.uniform(0.5, 4.0, (5, 6)), rng.uniform(0, 6, (5, 6))
    study = study_from_mapping({"signals": {"decimate": None}, "rows": {"low_speed": 0}})

    def record(samples: int) -> Record:
        t = np.arange(samples) / 100.0
        angle = w * t[:, None, None] + phase
        q, qd, qdd = 0.3 * np.array(
            [np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle)]
        ).sum(axis=2)
        tau = model.inverse_dynamics(q, qd, qdd, model.base_parameters(model.VALUES))
        return Record(t, q, tau + rng.normal(0, 0.3, tau.shape), rate=100.0)

    given = {samples: record(samples) for samples in (12_000, 36_000)}
    monkeypatch.setattr(prepared, "WHOLE", 0.0)
    few, many = (
        peak(lambda own=own: runtime.estimate(model, own, study)) for own in given.values()
    )
    W = 8 * 6 * len(model.BASE_PARAMETERS)  # bytes of a row of six joints
    assert many - few < W / 3 * 24_000


def test_all_of_a_long_matrix_is_refused_where_it_does_not_fit(monkeypatch):
    _, parts = pair(monkeypatch, SETTINGS["every sample"])
    monkeypatch.setattr(memory, "SMALL", 0.0)
    monkeypatch.setattr(memory, "available_memory", lambda: 8.0 * parts.W.shape[0] * 9)
    with pytest.raises(InputError, match=r"at once need about .* GB"):
        np.asarray(parts.W)
    assert parts.factor.rows == len(parts.Y)


def test_values_that_are_not_finite_are_refused(monkeypatch):
    _, parts = pair(monkeypatch, SETTINGS["every sample"], records=1)
    Y = parts.Y.copy()
    Y[2000] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        _ = replace(parts, Y=Y).factor
