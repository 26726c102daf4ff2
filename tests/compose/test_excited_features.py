"""`excite` of every model and record that a feature changes: a motion, or one sentence."""

from dataclasses import replace

import numpy as np
import pytest
from campaign import some
from features import FEATURES, plain

from runtime.compose import excite, static_poses
from runtime.ground.errors import InputError
from runtime.study import study_from_mapping

SEARCH = {
    "parts": [{"family": "fourier", "period": 4, "harmonics": 2}],
    "starts": 1,
    "iterations": 5,
    "rate": 200,
}
REFUSED = {
    "force sensors": "search for a motion does not support force sensors; remove record.columns",
    "poses at rest": "needs records of a motion",
    "transmitted torque": "does not have the measured signals tau_model2",
    "channels": "does not have the measured signals temperature",
}


def searched(case, records=None, **changes):
    excitation = study_from_mapping({"excitation": SEARCH | changes}).excitation
    records = case.records if records is None else records
    return excite(case.model, records, replace(case.study, excitation=excitation))


def motion_or_sentence(folder, name):
    case = FEATURES[name](folder)
    if name in REFUSED:
        with pytest.raises(InputError, match=REFUSED[name]):
            searched(case)
    else:
        assert np.isfinite(searched(case).condition)


@pytest.mark.parametrize("name", FEATURES)
@some(6)
def test_a_motion_or_one_sentence(tmp_path, name):
    motion_or_sentence(tmp_path, name)


@pytest.mark.parametrize("name", ["force sensors", "counts"])
def test_rows_of_a_sensor_and_counts_of_an_encoder(tmp_path, name):
    motion_or_sentence(tmp_path, name)


def test_without_a_record(tmp_path):
    """Of torques behind the gears, friction is not determined; laws of a torque need a record."""
    result = searched(FEATURES["link side"](tmp_path), ())
    assert not {name[:2] for name in result.relative_sigma} & {"FV", "FS", "Ia"}
    case = FEATURES["transmitted torque"](tmp_path)
    for search in (searched, lambda case, _: static_poses(case.model, (), case.study)):
        with pytest.raises(InputError, match="does not have the measured signals tau_model2"):
            search(case, ())


def test_poses_with_a_force_sensor(tmp_path):
    case = FEATURES["force sensors"](tmp_path)
    with pytest.raises(InputError, match="search for poses does not support force sensors"):
        static_poses(case.model, case.records, case.study)


def test_limits_that_a_urdf_lacks(tmp_path):
    case = plain(tmp_path)
    model = type("Model", (), {"__getattr__": lambda _, name: getattr(case.model, name)})()
    model.LIMITS = {name: x for name, x in case.model.LIMITS.items() if name != "qdd"}
    without = replace(case, model=model)
    for limits in ({}, {"limits": {"qdd": [20, 40]}}):
        assert np.isfinite(searched(without, **limits).condition)
