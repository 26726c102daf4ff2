"""The TX40 record: facts of its description (ranges, rest pose, top speeds), reached through the
drives.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from runtime import read_record
from runtime.core.signals.filters import filtered_states
from runtime.reading.datasets import dataset_study
from runtime.study import study_from_mapping

RATIO = np.diag([32.0, 32, 45, -48, 45, 32])
RATIO[5, 4] = 32  # motor 6 turns with joint 5 as well
DRIVES = {
    "ratio": RATIO.tolist(),
    "offset": [0, -np.pi / 2, np.pi / 2, 0, 0, 0],
    "torque_constant": [1.0] * 6,
}
MODEL = SimpleNamespace(
    NAME="tx40", JOINTS=(1, 2, 3, 4, 5, 6), DRIVES=DRIVES
)  # what reading a record asks of a model


@pytest.fixture(scope="module")
def study():
    return study_from_mapping(dataset_study("tx40"))


@pytest.fixture(scope="module")
def record(tx40_data, study):
    return read_record(study.record[0], MODEL)


def test_starts_and_ends_at_the_zero_pose(record):
    assert record.q.shape == (45000, 6) and record.rate == 5000
    assert set(record.files) == {"pos_read_data.csv", "curr_data.csv"}  # compressed or not
    np.testing.assert_allclose(record.q[[0, -1]], 0, atol=2e-5)


def test_ranges_in_degrees_before_the_shifts(record):
    degrees = np.rad2deg(record.q - DRIVES["offset"])
    np.testing.assert_allclose(degrees.min(axis=0), [-100, -4, -135, -240, -90, -200], atol=1)
    np.testing.assert_allclose(degrees.max(axis=0), [120, 110, 30, 80, 108, 200], atol=1)


def test_top_speeds_at_50_hz(record, study):
    states = filtered_states(record.q, record.rate, study.signals)
    np.testing.assert_allclose(
        np.abs(states.qd).max(axis=0), [5.0, 5.0, 7.0, 7.2, 5.6, 11.5], atol=0.06
    )
    np.testing.assert_allclose(np.abs(states.qdd).max(axis=0), [27, 28, 46, 55, 40, 72], atol=0.6)


def test_torque_coupling_of_the_wrist(record, study):
    plain = read_record(study.record[0], MODEL)
    alone = read_record(
        type(study.record[0])(**{**vars(study.record[0]), "coupling": "none"}), MODEL
    )
    np.testing.assert_array_equal(plain.q, record.q)
    np.testing.assert_allclose(
        plain.tau[:, 4] - alone.tau[:, 4], alone.tau[:, 5]
    )  # 32 taum6, added to 45 taum5
    np.testing.assert_allclose(alone.q[:, 5] - plain.q[:, 5], plain.q[:, 4], atol=1e-12)
