"""Columns of records found by the names of the joints: in any order, beside words for the quantity,
refused where they say too little.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from bag_files import joint_states, write_bag

from runtime.ground.errors import InputError
from runtime.reading.records import read_records
from runtime.reading.settings import Columns, RecordSettings

NAMES = ("elbow", "shoulder", "wrist")
MODEL = SimpleNamespace(
    NAME="arm",
    JOINTS=(1, 2, 4),
    LABELS={1: "shoulder", 2: "elbow", 3: "flange", 4: "wrist"},
    DRIVES=None,
)
Q, TAU = np.random.default_rng(3).standard_normal((2, 50, 3))
ORDER = [1, 0, 2]  # of the robot, among NAMES


def record(tmp_path, head, columns, model=MODEL):
    file = tmp_path / "run.csv"
    np.savetxt(
        file,
        np.column_stack([np.arange(50) / 100, Q, TAU]),
        delimiter=",",
        header=",".join(["t", *head]),
        comments="",
    )
    return read_records(
        [RecordSettings(files=(str(file),), columns=Columns(t="t", **columns))], model
    )[0]


@pytest.mark.parametrize(
    ("q", "tau"),
    [
        ("{}_pos", "tau_{}"),
        ("q/{}", "{}.effort"),
        ("{}", "torque_{}"),
        ("position.{}", "{}/torque"),
        ("{}.q", "{}"),
    ],
)
def test_columns_are_found_in_any_order(q, tau, tmp_path):
    head = [*(q.format(name) for name in NAMES), *(tau.format(name) for name in NAMES)]
    for columns in ({"q": "names"}, {"q": "names", "tau": "names"}):
        found = record(tmp_path, head, columns)
        assert (found.q == Q[:, ORDER]).all() and (found.tau == TAU[:, ORDER]).all()


@pytest.mark.parametrize(
    ("head", "model", "words"),
    [
        (["elbow", "shoulder", "wrist", "a", "b", "c"], MODEL, "positions and torques"),
        (
            ["q_elbow", "q_shoulder", "x", "tau_elbow", "tau_shoulder", "tau_wrist"],
            MODEL,
            "no column wrist",
        ),
        (
            ["q_elbow", "elbow.q", "q_wrist", "q_shoulder", "b", "c"],
            MODEL,
            "columns q_elbow, elbow.q",
        ),
        (
            ["a", "b", "c", "d", "e", "f"],
            SimpleNamespace(**{**vars(MODEL), "LABELS": {1: "shoulder"}}),
            "some joints of the robot have no name",
        ),
        (["a", "b", "c", "d", "e", "f"], None, "some joints of the robot have no name"),
    ],
)
def test_what_says_too_little_is_refused(head, model, words, tmp_path):
    with pytest.raises(InputError, match=words):
        record(tmp_path, head, {"q": "names"}, model)


def test_messages_of_a_bag_need_no_columns(tmp_path):
    stamps = np.arange(50) * 10_000_000
    path = write_bag(
        "bare mcap",
        tmp_path / "run",
        {
            "/joint_states": joint_states(
                stamps, (*NAMES, "gripper"), *(np.pad(x, ((0, 0), (0, 1))) for x in (Q, TAU))
            )
        },
    )
    for columns in ({}, {"q": "names"}):
        found = read_records(
            [RecordSettings(files=(str(path),), columns=Columns(**columns))], MODEL
        )[0]
        assert (found.q == Q[:, ORDER]).all() and (found.tau == TAU[:, ORDER]).all()
