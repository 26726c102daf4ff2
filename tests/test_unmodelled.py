"""What the model lacks: laws of load and position in simulated records, whose torques are
pinocchio's (`benchmarks/verdicts.py`), and records without such laws.
"""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
import truth_simulator as world
from truth_shared import emitted, true_parameters
from truth_simulator import Truth, fourier, noise
from verdicts import World, record_of, rms_of

import runtime
import symgen
from runtime.expected import missing_limits
from runtime.unmodelled import lacking_of
from symgen.description.files import write_robot

QUESTION = "Does the error depend on load, position or time?"


def simulated(robot, kind, seed=31, rho=0.0, **changed):
    """A record, and the world that it is of."""
    robot = world.ROBOTS[robot]
    own = World.of(Truth(robot, seed), kind, np.random.default_rng(seed))
    own = replace(own, **{key: np.full(robot.n, x) for key, x in changed.items()})
    move = fourier(robot, seed, seconds=8.0)
    q, tau = own.recorded(move, seed)
    return own, record_of(move.t, q, tau + noise(tau, rho, 0.01, seed)), rms_of(own.rigid(move))


def lacking(result):
    return result.part("expected_error").lacking


def answer(result):
    (check,) = (c for c in result.checklist.checks if c.question == QUESTION)
    return check


def test_friction_that_grows_with_the_load_is_named():
    own, record, _ = simulated("anthropomorphic", "load friction", size=0.06)
    result = runtime.identify(emitted("anthropomorphic")[0], record)
    laws = {law.j: law for law in lacking(result).laws}
    assert {law.kind for law in laws.values()} == {"load"} and {1} <= {*laws}
    for j, law in laws.items():
        assert abs(law.a[0] - own.size[j]) < max(4 * law.sigma[0], 0.01)
    check = answer(result)
    assert check.state == "doubtful" and "grows with its load" in check.finding
    assert "kind: load_dependent" in check.remedy and result.checklist.state != "good"


def test_the_law_that_is_offered_is_not_offered_again(tmp_path):
    _, record, _ = simulated("planar", "load friction", size=0.07)
    urdf = tmp_path / "planar.urdf"
    urdf.write_text(world.ROBOTS["planar"].urdf(world.ROBOTS["planar"].nominal), encoding="utf-8")
    plain = symgen.load_robot(str(urdf))
    text, _ = write_robot(plain, "planar.yaml")
    assert "elements:" in text
    law = "elements:\n  FL: {kind: load_dependent, along: all}"
    file = tmp_path / "planar.yaml"
    file.write_text(text.replace("elements:", law, 1), encoding="utf-8")
    before = runtime.identify(symgen.model(urdf), record)
    after = runtime.identify(symgen.model(file), record)
    assert answer(before).state == "doubtful" and answer(after).state == "good"
    assert after.model_estimate.relative_error < 0.7 * before.model_estimate.relative_error


@pytest.mark.parametrize("order", [3, 8])
def test_a_torque_of_the_position_is_named_with_its_multiple(order):
    _, record, _ = simulated("planar", "cogging", size=0.05, order=order)
    result = runtime.identify(emitted("planar")[0], record)
    laws = lacking(result).laws
    assert laws and {law.kind for law in laws} == {"position"}
    assert all(abs(law.order - order) <= 1 for law in laws[:2])
    assert "depends on its position" in answer(result).finding
    assert 'torque: "sin(' in answer(result).remedy


@pytest.mark.parametrize("rho", [0.0, 0.99])
def test_noise_has_no_law(rho):
    _, record, _ = simulated("anthropomorphic", "ordinary", rho=rho)
    result = runtime.identify(emitted("anthropomorphic")[0], record)
    assert lacking(result).laws == () and answer(result).state == "good"


@pytest.mark.parametrize("kind", ["load friction", "cogging", "ordinary"])
def test_intervals_include_what_a_law_moves(kind):
    """FS of a joint is off by what the load does to it in every part of the record: intervals held 72 %."""
    own, record, _ = simulated("anthropomorphic", kind, size=0.06)
    model = emitted("anthropomorphic")[0]
    result, alone = runtime.identify(model, record), runtime.estimate(model, record)
    X = true_parameters(own.truth)
    moved = np.abs(lacking(result).dX)
    for fit in (result.estimate, result.model_estimate):
        assert fit.names == alone.names
        assert np.mean(np.abs(fit.X - X) < 1.96 * fit.sigma_corrected) > 0.9
    s = alone.sigma_corrected
    if kind == "ordinary":
        assert (result.estimate.sigma_corrected == s).all()
    else:
        assert result.estimate.sigma_corrected == pytest.approx(np.hypot(s, moved))
        assert np.mean(np.abs(alone.X - X) < 1.96 * s) < 0.9


def test_other_motions_suffer_as_much_as_is_expected():
    own, record, rms = simulated("rail", "load friction", seed=33, size=0.08)
    result = runtime.identify(emitted("rail")[0], record)
    expected = result.part("expected_error").expected
    moves = fourier(own.truth.robot, 99, seconds=10.0)
    some = world.Motion(*(x[::50] for x in (moves.t, moves.q, moves.qd, moves.qdd)))
    tau, fit = own.torque(some, rms), result.model_estimate
    X = [fit[name] for name in result.model.BASE_PARAMETERS]
    left = tau - np.asarray(result.model.regressor(some.q, some.qd, some.qdd)) @ X
    true = 100 * np.linalg.norm(left) / np.linalg.norm(tau)
    assert expected.low < true < expected.high and expected.high > 5


def test_nothing_is_said_of_parameters_that_are_not_determined():
    result = SimpleNamespace(determined=False, observation=None, estimate=None, model=None)
    assert lacking_of(result) is None


@pytest.mark.parametrize(
    ("limits", "told"),
    [({}, "limits"), ({"q": [[-1, 1]]}, "limits.qd"), ({"qd": [1]}, "limits.q")],
)
def test_the_limits_that_the_file_lacks_are_named(limits, told):
    assert missing_limits(SimpleNamespace(LIMITS=limits)) == told
