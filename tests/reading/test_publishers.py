"""Two publishers of one topic: the one without efforts is left out and named, two with values are
refused; a right record is read as it is.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from bag_files import joint_states, write_bag

from runtime import read_record
from runtime.ground.errors import InputError, RecordWarning
from runtime.study import study_from_mapping

N, PERIOD = 400, 4_000_000  # ns
STAMPS = 1_700_000_000_000_000_000 + np.arange(N) * PERIOD
T = np.arange(N) * PERIOD / 1e9
JOINTS = ("a", "b")
Q = np.stack([np.sin(6 * T), np.cos(4 * T)], axis=1)
NOISE = np.random.default_rng(1).standard_normal((N, 2))
TAU = np.stack([9 * np.cos(6 * T), 5 + 3 * np.sin(4 * T)], axis=1) + 0.1 * NOISE
DATA = os.environ.get("SYMGEN_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data"
CASE = Path(DATA).parent / "cases5" / "second_publisher"


def read(path, **record):
    columns = {"q": list(JOINTS), "tau": list(JOINTS)}
    mapping = {"record": {"files": str(path), "columns": columns, "resample": {}, **record}}
    return read_record(study_from_mapping(mapping).record[0])


def mixed(every=5, late=1_500_000, tau=lambda tau: 0 * tau, q=lambda q: q + 1e-5):
    """Messages of an arm, and of a second publisher after every `every`th of them: sorted, with
    the number of the publisher by message.
    """
    arm = joint_states(STAMPS, JOINTS, Q, TAU)
    at = slice(None, None, every)
    second = joint_states(STAMPS[at] + late, JOINTS, q(Q[at]), [tau(x) for x in TAU[at]])
    both = sorted(
        [(message, 0) for message in arm] + [(message, 1) for message in second],
        key=lambda pair: pair[0][0],
    )
    return [message for message, _ in both], [k for _, k in both]


def written(tmp_path, messages, kind="mcap", **others):
    return write_bag(kind, tmp_path / "run", {"/j": messages}, **others)


def test_the_record_of_the_arm_remains(tmp_path):
    if not CASE.is_dir():
        pytest.skip("the case is not on this machine")
    settings = {"files": str(CASE / "bag"), "topic": "/joint_states", "resample": {}}
    joints = [f"j_{x}" for x in ("pan", "lift", "elbow", "roll", "bend", "turn")]
    settings["columns"] = {"q": joints, "tau": joints}
    with pytest.warns(RecordWarning, match="400 of 2400 messages on /joint_states have no efforts"):
        record = read_record(study_from_mapping({"record": settings}).record[0])
    assert record.rate == pytest.approx(250, rel=1e-3)
    assert (np.abs(record.tau).max(axis=1) > 0.5).all()


@pytest.mark.parametrize("every", [1, 2, 5, 50])
@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_zero_efforts_between_others(tmp_path, kind, every):
    messages, _ = mixed(every)
    with pytest.warns(RecordWarning, match="second publisher, which are left out"):
        record = read(written(tmp_path, messages, kind))
    np.testing.assert_allclose(record.q, Q, atol=1e-12)
    np.testing.assert_allclose(record.tau, TAU, atol=1e-12)
    assert f"{len(messages) - N} of {len(messages)} messages on /j" in record.origin.time


def test_a_faster_second_publisher(tmp_path):
    rest = np.zeros_like(TAU)
    second = [
        message
        for late in (500_000, 1_500_000, 2_500_000)
        for message in joint_states(STAMPS + late, JOINTS, Q, rest)
    ]
    messages = sorted([*joint_states(STAMPS, JOINTS, Q, TAU), *second], key=lambda m: m[0])
    with pytest.warns(RecordWarning, match="1200 of 1600"):
        np.testing.assert_allclose(read(written(tmp_path, messages)).tau, TAU, atol=1e-12)


@pytest.mark.parametrize("tau", [lambda x: x[:0], lambda x: np.nan * x])
def test_no_efforts_between_others(tmp_path, tau):
    messages, _ = mixed(tau=tau)
    with pytest.warns(RecordWarning, match="left out"):
        np.testing.assert_allclose(read(written(tmp_path, messages)).tau, TAU, atol=1e-12)


@pytest.mark.parametrize("tau", [lambda x: 0 * x, lambda x: x[:0], lambda x: 0.5 * x])
@pytest.mark.parametrize("told", ["frames", "nodes", "counts"])
def test_what_the_bag_tells_of_publishers(tmp_path, told, tau):
    messages, of = mixed(tau=tau)
    names = {"frames": ("base", "world"), "nodes": ("/driver", "/echo")}.get(told)
    counter = [iter(range(7, 10_000)), iter(range(3000, 10_000))]
    values = [next(counter[k]) if names is None else names[k] for k in of]
    path = written(tmp_path, messages, "ros1", **{told: values})
    if tau(np.ones(1)).sum():
        with pytest.raises(
            InputError, match=r"2 publishers .* the messages of both would be mixed"
        ):
            read(path)
        return
    other = "counts to 3079" if names is None else names[1]
    with pytest.warns(RecordWarning, match=f"80 of 480 .*another publisher .*{other}"):
        np.testing.assert_allclose(read(path).tau, TAU, atol=1e-12)


def test_two_drivers_with_torques_and_no_name(tmp_path):
    for name, changes in {
        "currents": {"tau": lambda x: 0.2 * x},
        "offset": {"tau": lambda x: x, "q": lambda q: q + 0.2},
        "equal rates": {"every": 1, "tau": lambda x: 0.2 * x},
    }.items():
        messages, _ = mixed(**changes)
        with pytest.raises(InputError, match="the stamps on /j are of two publishers, with steps"):
            read(write_bag("mcap", tmp_path / name, {"/j": messages}))


def test_zeros_in_place_of_efforts_are_refused(tmp_path):
    """A driver that fails to read writes zeros: there is no second publisher to leave out."""
    tau = TAU.copy()
    tau[::6] = 0
    with pytest.raises(InputError, match="67 of 400 messages on /j have no efforts, or only zeros"):
        read(written(tmp_path, joint_states(STAMPS, JOINTS, Q, tau)))


def rounded(period):
    return np.round(np.arange(N) * period / 1e6).astype(np.int64) * 1_000_000


RIGHT = {
    "no torque at all": (STAMPS, 0 * TAU),
    "one joint without torque": (STAMPS, TAU * [1, 0]),
    "brakes during pauses": (STAMPS, np.where((T % 0.5 < 0.2)[:, None], 0, TAU)),
    "torque in coarse steps": (STAMPS, np.round(np.stack([np.sin(6 * T), 0 * T], axis=1) * 4) / 4),
    "noise about zero in steps": (STAMPS, np.round(NOISE * [0.6, 0])),
    "two single failures": (STAMPS, np.where(np.isin(np.arange(N), [90, 200])[:, None], 0, TAU)),
    "stamps rounded to ms": (rounded(2_500_000), TAU),
    "late stamps": (STAMPS + np.random.default_rng(2).integers(0, 2_000_000, N), TAU),
    "lost messages": (np.delete(STAMPS, slice(3, None, 9)), np.delete(TAU, slice(3, None, 9), 0)),
}


@pytest.mark.filterwarnings("error::runtime.ground.errors.RecordWarning")
@pytest.mark.parametrize("name", RIGHT)
def test_a_right_record_is_read(tmp_path, name):
    stamps, tau = RIGHT[name]
    t = (stamps - stamps[0]) / 1e9
    q = np.stack([np.sin(6 * t), np.cos(4 * t)], axis=1)
    record = read(written(tmp_path, joint_states(stamps, JOINTS, q, tau)), resample={"longest": 5})
    assert len(record) >= len(stamps) - 1
    assert "publisher" not in record.origin.time


@pytest.mark.filterwarnings("error::runtime.ground.errors.RecordWarning")
def test_a_node_that_starts_again_is_one_publisher(tmp_path):
    nodes = ["/driver_1"] * 150 + ["/driver_2"] * (N - 150)
    messages = joint_states(STAMPS, JOINTS, Q, TAU)
    counts = [*range(150), *range(N - 150)]
    record = read(written(tmp_path, messages, "ros1", nodes=nodes, counts=counts))
    np.testing.assert_allclose(record.tau, TAU, atol=1e-12)


@pytest.mark.filterwarnings("error::runtime.ground.errors.RecordWarning")
def test_messages_in_another_order_are_of_one_publisher(tmp_path):
    counts = np.arange(N).reshape(-1, 2)
    counts[::10] = counts[::10, ::-1]
    path = written(
        tmp_path, joint_states(STAMPS, JOINTS, Q, TAU), "ros1", counts=counts.ravel().tolist()
    )
    np.testing.assert_allclose(read(path).tau, TAU, atol=1e-12)
