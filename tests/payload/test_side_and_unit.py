"""Loads whose records are of sensors behind the gears, or in the unit of the drives."""

from __future__ import annotations

import numpy as np
import planar_arm
import pytest

from runtime import compose
from runtime.ground.errors import InputError
from runtime.payload.load import load_effect

LOAD = {"M": 1.0, "MX": 0.1, "ZZ": 0.02}


@pytest.fixture(scope="module")
def arm():
    return planar_arm.arm()


def identified(arm, folder, sides, payload=None, **both):
    """The load of two records, without and with it, on these sides."""
    effect, settings = load_effect(arm, LOAD, link=2), []
    for k, (side, load) in enumerate(zip(sides, (0, effect), strict=True)):
        X = planar_arm.parameters(arm, link=side == "link") + load
        file = planar_arm.written(folder / f"{k}.csv", planar_arm.record(arm, 3 * k, X))
        settings.append({"files": file, "side": side, **both})
    payload = {"link": 2, "record": settings[1], **(payload or {})}
    study = planar_arm.study(record=settings[0], payload=payload)
    run = compose.records_of(study.record, arm, study)
    return compose.identify(arm, run, study, plausible=False).part("payload")


@pytest.mark.parametrize("side", ["joint", "link"])
def test_both_records_of_one_side_give_the_load(arm, tmp_path, side):
    """On the link side, "remove estimate.columns" was said of a key that nobody wrote."""
    found = identified(arm, tmp_path, (side, side)).payload
    for name, value in LOAD.items():
        assert found[name] == pytest.approx(value, abs=3e-3)


@pytest.mark.parametrize("sides", [("joint", "link"), ("link", "joint")])
def test_records_of_two_sides_are_refused(arm, tmp_path, sides):
    """The side of payload.record was ignored: ZZ .0002 in place of .02."""
    with pytest.raises(InputError, match=r"side: link\) in .*csv and not in .*csv"):
        identified(arm, tmp_path, sides)


def test_a_load_in_amperes_needs_gains(arm, tmp_path):
    amperes = {"units": {"tau": "A"}, "torque_constant": "none"}
    with pytest.raises(InputError, match="a load in kg needs torques in N m"):
        identified(arm, tmp_path, ("joint", "joint"), **amperes)
    weighed = {"gains": True, "known": {"M": 1.0}}
    found = identified(arm, tmp_path, ("joint", "joint"), weighed, **amperes)
    np.testing.assert_allclose(found.gains.together, 1.0, atol=0.01)
    assert found.payload["ZZ"] == pytest.approx(0.02, abs=3e-3)


def test_inertial_columns_are_not_left_out(arm, tmp_path):
    study = planar_arm.study(
        estimate={"columns": ["ZZ1R", "FV1"]}, payload={"link": 2, "record": {"files": "l.csv"}}
    )
    runs = [planar_arm.record(arm, k) for k in range(2)]
    with pytest.raises(InputError, match="MX1R, MY1, ZZ2, MX2, MY2 are left out"):
        compose.payload(arm, runs[0], study, loaded=runs[1:])
