"""Joints without a motor by the robot file: `limits.tau` 0 is the 0 of `record.columns.tau`."""

from dataclasses import replace

import numpy as np
import pytest

import runtime
import symgen
from runtime.study import study_from_mapping
from symgen.errors import DescriptionError

T = np.arange(500) / 100
TABLE = np.column_stack([T, np.sin(T), np.cos(T), 3 * np.cos(2 * T), 1e-3 * np.sin(T)])
NAMES = ("t", "q1", "q2", "tau1", "tau2")


def robot(tau):
    return replace(symgen.load_robot("planar_2r"), limits={"tau": tau})


@pytest.mark.parametrize("columns", [5, 4], ids=["with tau2", "without tau2"])
@pytest.mark.parametrize("named", [False, True])
def test_the_torque_of_a_joint_without_a_motor_is_zero(tmp_path, columns, named):
    names = NAMES[:columns]
    np.savetxt(
        tmp_path / "run.csv",
        TABLE[:, :columns],
        delimiter=",",
        header=",".join(names),
        comments="",
    )
    study = study_from_mapping({"record": {"files": "run.csv"}})
    if named:
        study = study_from_mapping(
            {"record": {"files": "run.csv", "columns": {"q": ["q1", "q2"], "tau": names[3:]}}}
        )
    model = symgen.model(robot((100.0, 0.0)))
    record = runtime.read_record(study.record[0], model, folder=tmp_path)
    np.testing.assert_allclose(record.tau[:, 0], TABLE[:, 3], rtol=1e-9)
    assert not record.tau[:, 1].any()


def test_other_limits_and_negative_torques_stay_refused():
    with pytest.raises(DescriptionError, match="for tau of a joint without a motor write 0"):
        robot((100.0, -1.0))
    with pytest.raises(DescriptionError, match="qd of joint 2 is 0"):
        replace(symgen.load_robot("planar_2r"), limits={"qd": (1.0, 0.0)})
