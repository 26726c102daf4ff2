"""The Estimate as a record: JSON, table, LaTeX."""

import json

import numpy as np
import planar_2r_model as planar
import pytest
from planar_data import OLS, WLS, observation, one_joint_at_rest

from runtime.compose import estimate_of
from runtime.core.least_squares.estimate import Estimate
from runtime.ground.documents import json_text


@pytest.fixture(scope="module")
def found():
    return estimate_of(
        observation(noise=(0.3, 0.05), seed=1), OLS, model=planar, provenance={"seed": 1}
    )


def no_constant(name):
    raise AssertionError(f"JSON holds {name}")


def test_json_round_trip(found):
    again = Estimate.from_json(found.to_json())
    assert again.to_json() == found.to_json()
    for name in ("X", "sigma", "covariance", "sigma_corrected", "relative_sigma"):
        assert np.array_equal(getattr(again, name), getattr(found, name))
    assert again.per_joint == found.per_joint
    assert again.names == found.names
    assert again.cond == found.cond


def test_json_of_rank_loss_has_null_and_no_nan():
    lost = estimate_of(observation(motion=one_joint_at_rest, noise=(0.1, 0.1)), WLS, model=planar)
    data = json.loads(lost.to_json(), parse_constant=no_constant)
    assert data["status"] == "rank-deficient" and data["cond"] is None
    assert None in data["sigma"] and None in data["relative_sigma"]
    again = Estimate.from_json(lost.to_json())
    assert again.to_json() == lost.to_json()
    assert np.isinf(again.cond) and again.groups == lost.groups


def test_json_holds_what_the_design_promises(found):
    data = json.loads(found.to_json(), parse_constant=no_constant)
    promised = {
        "names",
        "X",
        "sigma",
        "relative_sigma",
        "cond",
        "sigma_rho",
        "residual_norm",
        "relative_error",
        "per_joint",
        "method",
        "settings",
        "provenance",
    }
    assert promised <= set(data)
    assert data["schema"] == "symgen-estimate/1"
    assert data["provenance"]["robot"] == "planar_2r_test" and data["provenance"]["seed"] == 1
    assert set(data["provenance"]["versions"]) == {"symgen", "numpy", "scipy"}
    assert data["provenance"]["files"] == {"q.csv": "ab" * 32}
    assert data["settings"]["estimate"]["method"] == "ols"
    assert data["settings"]["signals"] == {"median": 1}
    assert [fit["rows"] for fit in data["per_joint"]] == [300, 300]


def test_json_text_leaves_brackets_in_texts_alone():
    text = json_text(
        {
            "a": "[ 1 ] {",
            "b": [1, 2.5, float("inf")],
            "c": [{"x": [1]}],
            "d": [],
            "e": {},
            "f": np.float64(2),
            "g": [[1], [2]],
        }
    )
    assert json.loads(text) == {
        "a": "[ 1 ] {",
        "b": [1, 2.5, None],
        "c": [{"x": [1]}],
        "d": [],
        "e": {},
        "f": 2.0,
        "g": [[1], [2]],
    }
    assert '"b": [1, 2.5, null]' in text


def test_estimate_is_frozen(found):
    with pytest.raises(ValueError, match="read-only"):
        found.X[0] = 1
    with pytest.raises(AttributeError):
        found.method = "wls"
    assert found["FV1"] == found.X[3]
    with pytest.raises(ValueError, match="10 parameters"):
        Estimate(**{**{f: getattr(found, f) for f in found.__dataclass_fields__}, "X": np.zeros(3)})


def test_table_is_aligned(found):
    lines = str(found).splitlines()
    head = next(i for i, line in enumerate(lines) if line.startswith("parameter"))
    table = lines[head : head + 11]
    assert {len(line) for line in table} == {len(table[0])}
    assert table[1].startswith("ZZ1R ") and table[1].endswith("kg*m**2")
    assert "relative error %" in str(found)
