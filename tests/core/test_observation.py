"""The observed system: equal to the plain recipe, row bookkeeping, the steps that a resolution
study repeats, several records as one.
"""

import dataclasses
import types
from dataclasses import replace
from pathlib import Path

import emps_model
import numpy as np
import planar_2r_model as planar
import pytest
import scipy.signal
from planar_data import TRUE, motion
from problems import linear_system

from runtime import Record, estimate, load_model, observe
from runtime.compose import estimate_of, problem
from runtime.core.essential import essential_of
from runtime.core.model import BoundModel
from runtime.core.record import Origin
from runtime.core.rows.factor import joint_factors
from runtime.core.rows.observation import stack
from runtime.core.rows.prepared import decimated_torque, observation_of
from runtime.core.rows.regressor import Columns, distinct_entries
from runtime.core.rows.selection import select_rows
from runtime.core.signals.filters import States, decimated, decimation_plan, filtered_states
from runtime.core.study import Decimate
from runtime.core.uncertainty import block_bootstrap
from runtime.core.validation import weak_directions
from runtime.ground.errors import InputError
from runtime.study import study_from_mapping
from symgen.description import load_robot
from symgen.emit import c_target, spec
from symgen.regroup.regrouping import regroup

RATE, N = 1000.0, 6000
T = np.arange(N) / RATE


def study(**sections):
    signals = {"median": 1, "lowpass": {"cutoff": 50}, **sections.pop("signals", {})}
    return study_from_mapping({"signals": signals, **sections})


@pytest.fixture(scope="module")
def record():
    q, qd, qdd = motion(T)
    return Record(
        T,
        q,
        planar.regressor(q, qd, qdd) @ TRUE,
        rate=RATE,
        name="arm",
        origin=Origin({"arm.csv": "ab" * 32}),
    )


def test_noise_free_data_return_the_parameters(record):
    """1e-3: the low-pass at 50 Hz rounds sign(qd) and the derivatives are differences; both are
    errors of the method, not of the code.
    """
    o = observe(planar, record, study())
    X = np.linalg.lstsq(o.W, o.Y, rcond=None)[0]
    np.testing.assert_allclose(X, TRUE, rtol=1e-3, atol=1e-3)


def test_plain_recipe(record):
    """W and Y by the chapter's words, column by column with scipy.signal.decimate."""
    s = study(rows={"trim": 0})
    o = observe(planar, record, s)
    states = filtered_states(record.q, RATE, s.signals)
    W = planar.observation_matrix(states.q, states.qd, states.qdd).reshape(2, N, -1)
    W = scipy.signal.decimate(W, 8, zero_phase=True, axis=1)  # eq. (13): 0.8*1000/(2*50)
    assert o.W.shape == (2 * 750, 10) and o.rate == 125
    np.testing.assert_allclose(o.W, W.reshape(1500, -1), atol=1e-9)
    np.testing.assert_allclose(
        o.Y.reshape(2, -1), scipy.signal.decimate(record.tau.T, 8, zero_phase=True), atol=1e-9
    )
    np.testing.assert_allclose(o.t[:750], T[::8])
    assert o.W.flags.f_contiguous


def test_a_spike_of_a_torque_is_no_measurement(record):
    """One sample far off: the median filter takes it out, and without the filter Y shows it."""
    tau = record.tau.copy()
    tau[3000, 1] += 1e3
    spiked = Record(T, record.q, tau, rate=RATE)
    difference = [
        np.abs(observe(planar, spiked, s).Y - observe(planar, record, s).Y).max()
        for s in (study(signals={"torque_median": 3}), study())
    ]
    assert difference[0] < 1e-2 * np.abs(record.tau).max() and difference[1] > 10


def test_zero_entries_stay_zero(record):
    o = observe(planar, record, study())
    for j in range(2):
        assert not o.W[o.joint(j)][:, ~planar.STRUCTURE[:, j]].any()


def test_equal_signals_are_filtered_once():
    entries = distinct_entries(planar)
    assert len(entries.row) == planar.STRUCTURE.sum() == 13
    assert len(entries.place) == 12  # ZZ2 acts alike on both joints
    states = States(*(x[:100] for x in motion(T)))
    ((_, signals),) = Columns(planar).signals(states, None)
    D = planar.regressor(states.q, states.qd, states.qdd)
    for k, j, which, sign in zip(entries.row, entries.j, entries.which, entries.sign, strict=True):
        np.testing.assert_array_equal(sign * signals[which], D[:, j, k])


def test_opposite_and_constant_signals():
    def regressor(q, qd, qdd, *, out=None):
        S = np.zeros((4, 2, len(q))) if out is None else out
        S[0, 0], S[0, 1], S[1, 0], S[2, 1], S[3, 0] = qd[:, 0], -qd[:, 0], 1, 1, np.sign(qd[:, 0])
        return S.transpose(2, 1, 0)

    structure = np.array([[1, 1], [1, 0], [0, 1], [1, 0]], dtype=bool)
    model = types.SimpleNamespace(
        JOINTS=(1, 2),
        BASE_PARAMETERS=tuple("ABCD"),
        STRUCTURE=structure,
        store=lambda N: np.zeros((4, 2, N)),
        regressor=regressor,
    )
    entries = distinct_entries(model)
    assert len(entries.place) == 3  # qd1, 1 and sign(qd1)
    qd = np.random.default_rng(0).normal(size=(300, 2))
    columns = Columns(model).decimated(States(qd, qd, qd), decimation_plan(300, 2, Decimate()))
    np.testing.assert_array_equal(columns[0, 1], -columns[0, 0])
    np.testing.assert_array_equal(columns[1, 0], columns[2, 1])
    np.testing.assert_allclose(columns[3, 0], decimated(np.sign(qd[:, 0]), 2, Decimate()))


def test_states_out_of_reach_are_not_merged():
    """A loop that does not close at the random states gives nan there: every entry then stands for
    itself.
    """

    def regressor(q, qd, qdd, *, out=None):
        S = np.zeros((2, 1, len(q))) if out is None else out
        S[0, 0], S[1, 0] = np.arccos(q[:, 0]), np.arcsin(q[:, 0])
        return S.transpose(2, 1, 0)

    model = types.SimpleNamespace(
        JOINTS=(1,),
        BASE_PARAMETERS=("A", "B"),
        STRUCTURE=np.ones((2, 1), dtype=bool),
        store=lambda N: np.zeros((2, 1, N)),
        regressor=regressor,
    )
    assert len(distinct_entries(model).place) == 2


def test_loops_that_do_not_close_at_random_states():
    """The five-bar raises there; its identification treats every entry by itself."""
    model = load_model(Path(__file__).parents[2] / "generated" / "five_bar.py")
    entries = distinct_entries(model)
    assert len(entries.place) == len(entries.row) == np.count_nonzero(model.STRUCTURE)


def test_signals_are_those_found_over_a_finite_field():
    """The distinct entries of the graph, derived exactly: the numbers find the same signals; constants
    are one signal there as here.
    """
    f = spec.function(regroup(load_robot("tx40")), "regressor")
    _, places = c_target.signals(f, [e for e in f.values.entries if e.value != 0])
    exact = {place: (s, sign) for place, s, sign in places}
    folder = Path(__file__).parents[2] / "generated"
    e = distinct_entries(load_model(folder / "tx40.py", trust=True))
    assert set(exact) == set(zip(e.row.tolist(), e.j.tolist(), strict=True))
    pairs = {
        (w, *exact[k, j][:1], s * exact[k, j][1])
        for k, j, w, s in zip(e.row.tolist(), e.j.tolist(), e.which.tolist(), e.sign, strict=True)
    }
    assert (
        len(pairs) == len(e.place) == len({s for s, _ in exact.values()})
    )  # one to one, the sign of each signal apart


def test_pieces_of_the_regressor_equal_the_whole():
    entries = distinct_entries(planar)
    states = States(*motion(np.arange(10000) / RATE))  # longer than two pieces
    D = planar.regressor(states.q, states.qd, states.qdd).transpose(2, 1, 0)
    expected = D.reshape(-1, len(states))[entries.place]
    end = 0
    for part, signals in Columns(planar).signals(states, None):
        assert part.start == end
        np.testing.assert_array_equal(signals, expected[:, part])
        end = part.stop
    assert end == len(states)


def test_rows_left_out_are_counted(record):
    s = study(rows={"window": [1.0, 5.0], "trim": 4, "low_speed": [0.5, 0.0]})
    o = observe(planar, record, s)
    states = filtered_states(record.q, RATE, s.signals)
    K = len(range(1000, 5001, 8))
    slow = np.abs(states.qd[1000:5001:8, 0][4:-4]) < 0.5
    assert o.dropped == {"trim": (8, 8), "low_speed": (int(slow.sum()), 0), "mask": (0, 0)}
    assert o.rows == (K - 8 - int(slow.sum()), K - 8)
    assert o.t.min() == pytest.approx(1.032) and o.t.max() <= 5
    np.testing.assert_allclose(o.t[o.joint(0)], T[1000:5001:8][4:-4][~slow])
    assert o.joints.tolist() == [0] * o.rows[0] + [1] * o.rows[1]


def test_mask_of_samples_and_joints(record):
    keep = np.ones((N, 2), dtype=bool)
    keep[:3000, 1] = False

    def masked(keep, sections):
        reading = problem(planar, record, study(**sections)).prepared[0]
        s, qd = reading.study, reading.states.qd
        selected = select_rows(reading.record, qd, s.signals, s.rows, keep=keep)
        return replace(reading, selected=selected).observation(planar)

    o = masked(keep, {"rows": {"trim": 0}})
    assert o.dropped["mask"] == (0, 375) and o.t[o.joint(1)].min() == pytest.approx(3.0)
    assert masked(keep[:, 1], {"rows": {"trim": 0}}).rows == (375, 375)
    with pytest.raises(InputError, match="expected bool"):
        masked(np.ones(5, dtype=bool), {})


def test_settings_are_written_in_full(record):
    o = observe(planar, record, study())
    assert o.settings["factor"] == 8
    assert o.settings["signals"]["lowpass"] == {
        "cutoff": 50.0,
        "order": 4,
        "on": ["q", "qd"],
        "padding": "matlab",
    }
    assert o.settings["rows"] == {
        "window": [None, None],
        "trim": "auto",
        "low_speed": 0.0,
        "around": 0.0,
    }
    assert o.files == {"arm.csv": "ab" * 32}


def test_steps_of_a_resolution_study(record):
    """Perturbed positions give another W; Y and the rows stay those of the record."""
    s = study(rows={"low_speed": 0.3})
    states = filtered_states(record.q, RATE, s.signals)
    selection = select_rows(record, states.qd, s.signals, s.rows)
    torque = decimated_torque(record.tau, selection)
    whole = observe(planar, record, s)
    same = observation_of(Columns(planar), states, torque, selection, files=record.files)
    np.testing.assert_array_equal(same.W, whole.W)
    np.testing.assert_array_equal(same.Y, whole.Y)
    noise = 1e-3 * np.random.default_rng(1).choice([-1, 1], size=record.q.shape)
    noisy = observation_of(
        Columns(planar), filtered_states(record.q + noise, RATE, s.signals), torque, selection
    )
    np.testing.assert_array_equal(noisy.Y, whole.Y)
    assert noisy.rows == whole.rows and not np.allclose(noisy.W, whole.W, atol=1e-6)


def test_constants_in_place_of_the_robot_file(record):
    a, b = (
        observe(planar, record, study()),
        observe(BoundModel(planar, {"g": 0.0}), record, study()),
    )
    assert np.linalg.norm(a.W[:, 1]) > 0 and not b.W[:, 1].any()


def test_wanted_columns_alone(record):
    names = ["FS2", "ZZ2", "ZZ1R"]
    reading = problem(planar, record, study()).prepared[0]
    some, every = reading.observation(planar, names), reading.observation(planar)
    np.testing.assert_allclose(
        some.W, every.columns(names).W, rtol=0, atol=1e-13 * np.abs(every.W).max()
    )  # sums in another order
    assert some.names == tuple(names)
    with pytest.raises(InputError, match="no column FV9"):
        reading.observation(planar, ["FV9"])


def test_no_filters_at_all(record):
    o = observe(
        planar,
        record,
        study(signals={"median": 1, "lowpass": None, "decimate": None}, rows={"trim": 0}),
    )
    np.testing.assert_array_equal(o.Y, record.tau.T.ravel())
    assert o.W.shape == (2 * N, 10)


# --- selecting and stacking
# -------------------------------------------------------------------------------------------


def test_columns_and_windows(record):
    o = observe(planar, record, study())
    some = o.columns(["FV2", "ZZ1R"])
    np.testing.assert_array_equal(some.W, o.W[:, [8, 0]])
    first, second = o.between(None, 3.0), o.between(np.nextafter(3.0, 4), None)
    assert tuple(np.add(first.rows, second.rows)) == o.rows
    np.testing.assert_array_equal(
        np.concatenate([first.Y[first.joint(1)], second.Y[second.joint(1)]]), o.Y[o.joint(1)]
    )
    with pytest.raises(InputError, match="no column FV9; expected some of ZZ1R"):
        o.columns(["FV9"])
    with pytest.raises(InputError, match=r"no row of the observation lies in \[100, 200\] s"):
        o.between(100, 200)


def test_several_records_are_stacked(record):
    s = study(rows={"low_speed": 0.2})
    both, alone = observe(planar, [record, record], s), observe(planar, record, s)
    assert both.rows == tuple(2 * k for k in alone.rows) and set(both.record) == {0, 1}
    for k in range(2):
        np.testing.assert_array_equal(both.of_record(k).W, alone.W)
    assert np.array_equal(observe(planar, [record, record], s).W, stack([alone, alone]).W)
    with pytest.raises(InputError, match="no record"):
        observe(planar, [], s)


def test_rows_are_factored_once(record, monkeypatch):
    """Estimates, essential parameters and deviations read one factor."""
    calls = []
    monkeypatch.setattr(
        "runtime.core.rows.observation.joint_factors",
        lambda *given: calls.append(1) or joint_factors(*given),
    )
    o = observe(planar, record, study())
    system = linear_system(o)
    fits = estimate_of(o, model=planar), essential_of(system)
    weak_directions(system)
    block_bootstrap(system, fits[1].estimate)
    assert len(calls) == 1 and fits[1].all_parameters.names == fits[0].names
    assert np.array_equal(fits[1].all_parameters.X, fits[0].X) and np.array_equal(
        estimate(planar, record, study()).X, fits[0].X
    )


def test_stack_is_joint_major(record):
    a = observe(planar, record, study(rows={"window": [0, 2.0]}))
    b = observe(planar, record, study(rows={"window": [3.0, 6.0]}))
    o = stack([a, b, b])
    assert o.rows == tuple(np.add(a.rows, np.add(b.rows, b.rows)))
    np.testing.assert_array_equal(
        o.W[o.joint(1)], np.vstack([a.W[a.joint(1)], b.W[b.joint(1)], b.W[b.joint(1)]])
    )
    np.testing.assert_array_equal(o.W[o.record == 1], b.W)
    assert sorted(set(o.record)) == [0, 1, 2]
    assert o.dropped["trim"] == (18, 18)
    assert [s["rows"]["window"] for s in o.settings["records"]] == [
        [0.0, 2.0],
        [3.0, 6.0],
        [3.0, 6.0],
    ]
    assert stack([a]).W.shape == a.W.shape and "records" not in stack([b, b]).settings
    nested = stack([stack([a, b]), b])
    np.testing.assert_array_equal(nested.record[nested.joint(0)], o.record[o.joint(0)])


def test_stack_keeps_every_hash(record):
    a = observe(planar, record, study())
    b = dataclasses.replace(a, files={"arm.csv": "cd" * 32})
    assert stack([a, a]).files == a.files
    assert stack([a, b]).files == {"arm.csv": "ab" * 32, "arm.csv (2)": "cd" * 32}


def test_stack_refuses(record):
    a = observe(planar, record, study())
    with pytest.raises(InputError, match="no observation"):
        stack([])
    with pytest.raises(InputError, match="expected the columns of the first record"):
        stack([a, a.columns(["FV1"])])


# --- refusals
# ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        (
            {"rows": {"window": [10, 20]}},
            "no sample lies in rows.window [10.0, 20.0] s; the record spans [0, 5.999] s",
        ),
        ({"rows": {"window": [0, 0.02], "trim": 0}}, "needs more than 27"),
        ({"rows": {"trim": 400}}, "rows.trim leaves out 800"),
        ({"rows": {"low_speed": 100}}, "rows per joint is used: rows.trim leaves out"),
        (
            {"rows": {"low_speed": [1, 2, 3]}},
            "rows.low_speed has 3 values; expected one value, or 2 values",
        ),
        ({"signals": {"lowpass": {"cutoff": 500}}}, "Nyquist"),
    ],
)
def test_refusals(record, sections, said):
    with pytest.raises(InputError) as e:
        observe(planar, record, study(**sections))
    assert said in str(e.value)


def test_model_of_another_robot(record):
    with pytest.raises(
        InputError, match=r"arm\.csv: the record has 2 joints, but emps has 1; give a record"
    ):
        observe(emps_model, record, study())


def test_rows_of_one_instant_are_one_part(record):
    """A cut-off far below the motion leaves one row a joint: 0/0 was printed as a warning."""
    rows = observe(planar, record, study())
    single = rows.where(rows.t == rows.t[0])
    with np.errstate(all="raise"):
        assert (single.equal_parts(5) == 0).all()
