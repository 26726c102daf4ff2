"""The text of `ros2 topic echo --csv`, and publishers of different joints joined by their stamps."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from bag_files import joint_states, write_bag

from runtime import read_record
from runtime.ground.errors import InputError, RecordWarning
from runtime.reading.formats import read_table
from runtime.study import study_from_mapping

N, PERIOD = 400, 4_000_000  # ns
STAMPS = 1_700_000_000_000_000_000 + np.arange(N) * PERIOD
T = np.arange(N) * PERIOD / 1e9
JOINTS = ("a", "b", "c")
Q = np.stack([np.sin(6 * T), np.cos(4 * T), np.sin(3 * T)], axis=1)
TAU = np.stack([9 * np.cos(6 * T), 5 + 3 * np.sin(4 * T), np.cos(5 * T)], axis=1)


def read(path, columns=None, **record):
    columns = columns or {"q": list(JOINTS), "tau": list(JOINTS)}
    mapping = {"record": {"files": str(path), "columns": columns, **record}}
    return read_record(study_from_mapping(mapping).record[0])


def echoed(messages, frame="base"):
    """The lines of rosidl_runtime_py.convert.message_to_csv, of which `ros2 topic echo` prints one for
    each message: arrays one after the other, an empty one as an empty field.
    """
    lines = []
    for stamp, names, *arrays in messages:
        fields = [str(stamp // 10**9), str(stamp % 10**9), frame, ",".join(names)]
        fields += [",".join(repr(float(x)) for x in array) for array in arrays]
        lines.append(",".join(fields))
    return lines


def written(tmp_path: Path, lines: list[str], ending: str = "\n") -> Path:
    path = tmp_path / "echo.csv"
    path.write_text("\n".join(lines) + ending)
    return path


@pytest.mark.parametrize("frame", ["", "base_link", "7"])
@pytest.mark.parametrize("speeds", [None, 0.5 * Q])
def test_the_text_is_read_as_the_bag(tmp_path, frame, speeds):
    messages = joint_states(STAMPS, JOINTS, Q, TAU, speeds)
    record = read(written(tmp_path, echoed(messages, frame)))
    bag = read(write_bag("mcap", tmp_path / "run", {"/joint_states": messages}))
    for one in (record, bag):
        np.testing.assert_array_equal(one.q, Q)
        np.testing.assert_array_equal(one.tau, TAU)
    np.testing.assert_array_equal(record.t, bag.t)
    assert record.rate == pytest.approx(250)


def test_joints_that_change_places_and_the_names_of_the_robot(tmp_path):
    messages = joint_states(STAMPS, JOINTS, Q, TAU)
    turned = joint_states(STAMPS, JOINTS[::-1], Q[:, ::-1], TAU[:, ::-1])
    mixed = [a if k % 3 else b for k, (a, b) in enumerate(zip(messages, turned, strict=True))]
    record = read(written(tmp_path, echoed(mixed)), {"q": ["b", "a"], "tau": ["b", "a"]})
    np.testing.assert_array_equal(record.q, Q[:, [1, 0]])
    np.testing.assert_array_equal(record.tau, TAU[:, [1, 0]])


def test_lines_between_messages_and_a_cut_end(tmp_path):
    lines = echoed(joint_states(STAMPS, JOINTS, Q, TAU))
    lost = ["A message was lost!!!", "\ttotal count change:1", "\ttotal count: 1---"]
    path = written(tmp_path, [*lines[:9], *lost, *lines[9:], lines[0][:40]], ending="")
    record = read(path)
    np.testing.assert_array_equal(record.tau, TAU)
    assert "ros2 topic echo lost messages 1 times" in record.origin.time
    path = written(tmp_path, [*lines[:9], "1700000000,12,base,a,b,c,0.1", *lines[9:]])
    with pytest.raises(
        InputError, match=r"line 10: no message sensor_msgs/JointState: .*, frame_id, names"
    ):
        read(path)


@pytest.mark.parametrize(
    "line",
    [
        "9" * 400 + ",1,f,a,2,3,4",
        "1,9999999999,f,a,2,3,4",
        "0,1,2,3,4,5,6",
        "0,1,a,5,2,3,4",
        "t,q1,q2,q3,tau1,tau2,tau3",
    ],
)
def test_other_texts_are_no_echo(tmp_path, line):
    table = read_table(written(tmp_path, [line, *["0,1,2,3,4,5,6"] * 3]))
    assert table.joints is None


def parts(late=0, step=PERIOD, start=0, **changes):
    """Messages of an arm, joints a and b, and of a rail, joint c."""
    at = STAMPS[0] + start + late + np.arange((N * PERIOD - start) // step) * step
    t = (at - STAMPS[0]) / 1e9
    q, tau = np.sin(3 * t)[:, None], np.cos(5 * t)[:, None]
    arm = joint_states(STAMPS, ("b", "a"), Q[:, [1, 0]], TAU[:, [1, 0]])
    rail = joint_states(at, ("c",), q, tau)
    return sorted([*arm, *rail], key=lambda message: (message[0], len(message[1])))


def test_equal_stamps_are_joined(tmp_path):
    for path in (
        write_bag("mcap", tmp_path / "run", {"/j": parts()}),
        written(tmp_path, echoed(parts())),
    ):
        with pytest.warns(
            RecordWarning,
            match="joints a, b and the joints c have messages of their own, .*by equal",
        ):
            record = read(path)
        np.testing.assert_allclose(record.q, Q, atol=1e-12)
        np.testing.assert_allclose(record.tau, TAU, atol=1e-12)


@pytest.mark.parametrize(
    ("late", "step"), [(1_300_000, PERIOD), (700_000, 10_000_000), (0, 2 * PERIOD)]
)
def test_other_stamps_are_joined_by_straight_lines_and_told(tmp_path, late, step):
    """The error of a straight line is at most (w h)^2/8 of the amplitude."""
    path = write_bag("ros1", tmp_path / "run", {"/j": parts(late, step)})
    with pytest.warns(RecordWarning, match="by straight lines, at the stamps of a, b; .* ms away"):
        record = read(path)
    k = np.flatnonzero(STAMPS[0] + late <= STAMPS)[: len(record.q)]
    assert len(k) == len(record.q) > N - 6
    np.testing.assert_array_equal(record.q[:, :2], Q[k, :2])
    h = step / 1e9
    assert np.abs(record.q[:, 2] - Q[k, 2]).max() <= (3 * h) ** 2 / 8 * 1.01
    assert np.abs(record.tau[:, 2] - TAU[k, 2]).max() <= (5 * h) ** 2 / 8 * 1.01
    assert "by straight lines" in record.origin.time


def test_no_line_goes_over_a_pause(tmp_path):
    """The rail is silent for half a second: these rows of the arm are left out."""
    quiet = [
        m for m in parts(1_000_000) if m[1] != ("c",) or not 0.4 < (m[0] - STAMPS[0]) / 1e9 < 0.9
    ]
    path = write_bag("mcap", tmp_path / "run", {"/j": quiet})
    with pytest.warns(RecordWarning, match=r"12\d messages without a partner are left out"):
        record = read(path, rate=250)
    assert len(record.q) == pytest.approx(N - 125, abs=3)


def test_one_publisher_of_all_joints_stays_as_it_is(tmp_path):
    whole = joint_states(STAMPS, JOINTS, Q, TAU)
    gripper = joint_states(STAMPS + 5, ("g",), Q[:, :1], TAU[:, :1])
    messages = sorted([*whole, *gripper], key=lambda message: message[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        record = read(write_bag("mcap", tmp_path / "run", {"/j": messages}))
    np.testing.assert_array_equal(record.q, Q)


def test_messages_that_do_not_overlap_are_refused(tmp_path):
    with pytest.raises(InputError, match="do not overlap in time"):
        read(write_bag("mcap", tmp_path / "late", {"/j": parts(10**12)}))
