"""Columns of a record beside positions and torques: known torques are subtracted and said,
feed-forward torques are kept, wherever they lie.
"""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
import scipy.io

from runtime import Record, read_record
from runtime.ground.errors import InputError
from runtime.study import study_from_mapping

T = np.arange(40) / 100
Q = np.stack([np.sin(T), np.cos(3 * T)], axis=1)
TAU = np.stack([T, T**2], axis=1)
BALANCE = 3 + np.cos(Q[:, 1])
LEFT = TAU - np.stack([np.zeros(40), BALANCE], axis=1)


def settings(**record):
    return study_from_mapping({"record": {"rate": 100, **record}}).record[0]


@pytest.mark.parametrize("place", ["one", "torques", "apart", "third"])
def test_known_torques_are_found_subtracted_and_said(tmp_path, place):
    """In the one file, in that of the torques, in one of their own beside one or two others; by
    blocks as at once.
    """
    both, known = {"q": Q, "tau": TAU}, {"cb": BALANCE}
    files = {
        "one": [both | known],
        "torques": [{"q": Q}, {"tau": TAU} | known],
        "apart": [both, known],
        "third": [{"q": Q}, {"tau": TAU}, known],
    }[place]
    for k, arrays in enumerate(files):
        np.savez(tmp_path / f"{k}.npz", **arrays)
    given = settings(
        files=[f"{k}.npz" for k in range(len(files))],
        columns={"q": "q", "tau": "tau", "tau_known": [0, "cb"]},
    )
    record = read_record(given, folder=tmp_path)
    np.testing.assert_array_equal(record.torque, LEFT)
    np.testing.assert_array_equal(record.tau_known[:, 1], BALANCE)
    assert (
        record.subtracted
        == f"known torques subtracted: up to {BALANCE.max():.4g} of joint 2 (N m or N)"
    )


def test_records_keep_what_was_subtracted_once():
    """A changed record is not subtracted from twice, and one that travels to another process is the
    same.
    """
    record = Record(T, Q, TAU, tau_known=np.stack([0 * T, BALANCE], axis=1), tau_ff=TAU)
    np.testing.assert_array_equal(record.torque, LEFT)
    np.testing.assert_array_equal(replace(record, name="b").torque, LEFT)
    for same in (copy.copy(record), pickle.loads(pickle.dumps(record))):  # noqa: S301
        np.testing.assert_array_equal(same.torque, LEFT)
        np.testing.assert_array_equal(same.tau_known, record.tau_known)
        np.testing.assert_array_equal(same.tau_ff, TAU)
        assert same.subtracted == record.subtracted
    with pytest.raises(
        InputError,
        match=r"tau_known has shape \(40,\), but q has shape \(40, 2\); expected the same",
    ):
        Record(T, Q, TAU, tau_known=BALANCE)


def test_structures_of_matlab_by_their_fields(tmp_path):
    """Transposed arrays in structures, as controllers store them; a structure itself, and an array
    of structures, are refused by name.
    """
    log = {"t": T, "pos": {"motor": Q.T}, "torque": TAU.T, "text": "abc"}
    scipy.io.savemat(
        tmp_path / "a.mat", {"rec": log, "many": np.array([(1.0,), (2.0,)], dtype=[("x", "f8")])}
    )
    columns = {"t": "rec.t", "q": "rec.pos.motor", "tau": "rec.torque"}
    record = read_record(settings(files="a.mat", columns=columns), folder=tmp_path)
    np.testing.assert_array_equal(record.q, Q)
    np.testing.assert_array_equal(record.tau, TAU)
    for name, said in (
        ("rec.pos", r"struct of rec\.pos\.motor"),
        ("many", "struct array"),
        ("rec.text", "char"),
    ):
        with pytest.raises(InputError, match=said):
            read_record(settings(files="a.mat", columns={**columns, "q": name}), folder=tmp_path)


def test_a_table_of_columns_by_joint_is_refused_with_what_to_write():
    """{8: spring} is how one might say it; "expected a text" told nothing."""
    with pytest.raises(InputError, match="a mapping of 8; expected a list, one column per joint"):
        settings(columns={"tau_known": {8: "spring"}})
