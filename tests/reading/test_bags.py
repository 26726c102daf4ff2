"""Bags: every storage gives the same bits; joints go by name; what a message lacks, and a bag that
is none, is named.
"""

import hashlib
import sys

import numpy as np
import pytest
from bag_files import KINDS, joint_states, write_bag
from campaign import campaign, some

from runtime import read_record
from runtime.ground.errors import InputError
from runtime.reading.formats import read_table
from runtime.study import study_from_mapping

N, RATE = 40, 200
STAMPS = 1_700_000_000_123_456_789 + np.arange(N) * (10**9 // RATE)
RNG = np.random.default_rng(5)
Q, QD, TAU = RNG.normal(size=(3, N, 2))
JOINTS = ("shoulder", "elbow")
COLUMNS = {"q": list(JOINTS), "tau": list(JOINTS)}


def settings(path, **record):
    return study_from_mapping(
        {"record": {"files": str(path), "columns": COLUMNS, **record}}
    ).record[0]


def bag(tmp_path, kind="mcap", topics=None, **others):
    return write_bag(
        kind,
        tmp_path / "run",
        topics or {"/joint_states": joint_states(STAMPS, JOINTS, Q, TAU, QD)},
        **others,
    )


@pytest.mark.parametrize("kind", KINDS)
@some(4)
def test_every_storage_gives_the_same_bits(tmp_path, kind):
    path = bag(tmp_path, kind)
    record = read_record(settings(path))
    np.testing.assert_array_equal(record.q, Q)
    np.testing.assert_array_equal(record.tau, TAU)
    np.testing.assert_array_equal(record.t, np.arange(N) / RATE)
    assert record.rate == pytest.approx(RATE, rel=1e-15)
    if path.is_file():
        assert dict(record.files) == {path.name: hashlib.sha256(path.read_bytes()).hexdigest()}
    else:
        (store,) = (p for p in path.iterdir() if p.name != "metadata.yaml")
        line = f"{hashlib.sha256(store.read_bytes()).hexdigest()}  {store.name}\n"
        assert dict(record.files) == {"run": hashlib.sha256(line.encode()).hexdigest()}


@campaign
def test_columns(tmp_path):
    path = bag(tmp_path)
    np.testing.assert_array_equal(
        read_record(settings(path, columns={"q": ["elbow", "shoulder"]})).tau, TAU[:, ::-1]
    )
    velocities = read_record(
        settings(path, columns={"q": ["elbow.velocity"], "tau": ["elbow"]}, rate=RATE)
    )
    np.testing.assert_array_equal(velocities.q[:, 0], QD[:, 1])
    for columns, said in (
        ({}, "/joint_states has the joints shoulder, elbow; list the joints of the robot"),
        (
            {"q": ["wrist"]},
            (
                "no column wrist; the file has t, shoulder.position, shoulder.velocity, "
                "shoulder.effort, elbow.position"
            ),
        ),
        (
            {"q": ["wrist.position"]},
            "message 1 of /joint_states: no joint wrist among the joints shoulder, elbow",
        ),
    ):
        with pytest.raises(InputError) as e:
            read_record(settings(path, columns=columns))
        assert said in str(e.value)
    with pytest.raises(InputError, match="time stamps of bags are in s"):
        read_record(settings(path, units={"t": "ms"}))
    with pytest.raises(InputError, match="a bag contains no variable 'gain'"):
        read_record(settings(path, scale={"q": "gain"}))


@pytest.mark.parametrize("start", [0, 1])
def test_numbered_joints_need_no_names(tmp_path, start):
    joints = [f"arm_{start + 1}", f"arm_{start}"]
    path = bag(tmp_path, topics={"/j": joint_states(STAMPS, joints, Q, TAU)})
    record = read_record(settings(path, columns={}))
    np.testing.assert_array_equal(record.q, Q[:, ::-1])
    np.testing.assert_array_equal(record.tau, TAU[:, ::-1])


def test_joints_change_places(tmp_path):
    messages = [
        (s, JOINTS, q, (), tau) if i % 3 else (s, JOINTS[::-1], q[::-1], (), tau[::-1])
        for i, (s, q, tau) in enumerate(zip(STAMPS, Q, TAU, strict=True))
    ]
    record = read_record(settings(bag(tmp_path, topics={"/j": messages})))
    np.testing.assert_array_equal(record.q, Q)
    np.testing.assert_array_equal(record.tau, TAU)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda s, q, tau: (s, JOINTS, q, (), ()), "0 values of effort for 2 joints"),
        (
            lambda s, q, tau: (s, JOINTS[:1], q[:1], (), tau[:1]),
            "no joint elbow among the joints shoulder",
        ),
        (lambda s, q, tau: (s, JOINTS, q[:1], (), tau), "1 values of position for 2 joints"),
        (
            lambda s, q, tau: (s, ("shoulder", "elbow", "elbow"), (*q, 0), (), (*tau, 0)),
            "joint elbow more than once",
        ),
        (
            lambda s, q, tau: (s, JOINTS, q * np.nan, (), tau),
            "the value is nan (2 such values in all)",
        ),
    ],
)
@some(2)
def test_what_a_message_lacks_is_named(tmp_path, spoil, said):
    messages = joint_states(STAMPS, JOINTS, Q, TAU)
    messages[6] = spoil(STAMPS[6].item(), Q[6], TAU[6])
    with pytest.raises(InputError) as e:
        read_record(settings(bag(tmp_path, topics={"/j": messages})))
    assert "run" in str(e.value) and "message 7 of /j: " in str(e.value) and said in str(e.value)


def test_several_publishers(tmp_path):
    """A gripper and a wheel publish on the topic of the arm, before it and between: skipped and
    counted; the clock is that of the arm.
    """
    arm = joint_states(STAMPS, JOINTS, Q, TAU)
    grip = joint_states(STAMPS - 1_234_567, ("grip", "left"), Q, TAU[:, :0])
    wheel = joint_states(STAMPS[::3] + 500, ("wheel",), Q[::3, :1], TAU[::3, :1])
    messages = sorted([*arm, *grip, *wheel], key=lambda message: message[0])
    path = bag(tmp_path, topics={"/joint_states": messages})
    record = read_record(settings(path))
    np.testing.assert_array_equal(record.q, Q)
    np.testing.assert_array_equal(record.tau, TAU)
    np.testing.assert_array_equal(record.t, np.arange(N) / RATE)
    others = len(grip) + len(wheel)
    assert record.origin.time.endswith(
        f"{others} of {N + others} messages on /joint_states have none of these joints and are "
        "skipped"
    )
    wheel_alone = read_record(settings(path, columns={"q": ["wheel"]}))
    np.testing.assert_array_equal(wheel_alone.q, Q[::3, :1])
    spoilt = [
        *messages[:8],
        (int(STAMPS[-1]) + 7, JOINTS[:1], Q[0, :1], (), TAU[0, :1]),
        *messages[8:],
    ]
    with pytest.raises(
        InputError, match="message 94 of /joint_states: no joint elbow among the joints shoulder"
    ):
        read_record(settings(write_bag("mcap", tmp_path / "other", {"/joint_states": spoilt})))
    nan = [
        (s, names, np.array(q) * (np.nan if names == JOINTS and k > 4 else 1), *rest)
        for k, (s, names, q, *rest) in enumerate(messages)
    ]
    with pytest.raises(InputError, match="message 7 of /joint_states"):
        read_record(settings(write_bag("mcap", tmp_path / "nan", {"/joint_states": nan})))


def test_topics(tmp_path):
    first, second = joint_states(STAMPS, JOINTS, Q, TAU), joint_states(STAMPS, JOINTS, 2 * Q, TAU)
    path = bag(tmp_path, topics={"/left/joint_states": first, "/right/joint_states": second})
    with pytest.raises(
        InputError,
        match=(
            r"several topics .*: /left/joint_states, /right/joint_states; choose one by "
            r"record\.topic"
        ),
    ):
        read_record(settings(path))
    np.testing.assert_array_equal(read_record(settings(path, topic="/right/joint_states")).q, 2 * Q)
    with pytest.raises(
        InputError,
        match=r"no topic /up of type sensor_msgs/msg/JointState; set record.topic to one of the topics of the bag: /left",
    ):
        read_record(settings(path, topic="/up"))


def test_time_of_the_log_where_there_are_no_stamps(tmp_path):
    messages = joint_states(0 * STAMPS, JOINTS, Q, TAU)
    record = read_record(settings(bag(tmp_path, topics={"/j": messages}, logged=STAMPS.tolist())))
    np.testing.assert_array_equal(record.t, np.arange(N) / RATE)


def test_a_stamp_that_goes_back_is_found(tmp_path):
    stamps = STAMPS.copy()
    stamps[20:] -= 10**9
    messages = joint_states(stamps, JOINTS, Q, TAU)
    with pytest.raises(InputError, match=r"message 21 of /j: time goes from 0\.095 s to -0\.9 s"):
        read_record(settings(bag(tmp_path, topics={"/j": messages}, logged=STAMPS.tolist())))
    np.testing.assert_array_equal(read_record(settings(tmp_path / "run", rate=RATE)).q, Q)


def test_without_its_library(tmp_path, monkeypatch):
    path = bag(tmp_path)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(InputError, match=r"pip install symgen\[bags\]"):
        read_table(path)


def test_paths(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_record(settings(tmp_path / "no.bag"))
    (tmp_path / "a.bag.gz").write_bytes(b"")
    with pytest.raises(InputError, match="uncompress the file"):
        read_record(settings(tmp_path / "a.bag.gz"))
    with pytest.raises(InputError, match=r"this folder has no metadata\.yaml"):
        read_record(settings(tmp_path))
