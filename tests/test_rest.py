"""Poses at rest: gravity from them against pinocchio, what they cannot show, which poses next."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

import runtime
import symgen
from oracles.pinocchio_model import PinocchioModel
from runtime.ground.errors import InputError, SettingsError
from runtime.study import study_from_mapping
from symgen.cli.main import app
from symgen.description import load_robot

# of stanford, whose joint 3 is prismatic, rest shows two pairs by their sums alone
DEPENDENT = {"puma560": (), "stanford": ("MX3", "MZ3R")}
NOISE = 0.01


def at_rest(model, poses=None, **sections):
    excitation = {"limits": {"q": [2.0] * len(model.JOINTS)}, "poses": poses}
    study = {"signals": {"reader": "static"}, "excitation": excitation}
    return study_from_mapping(study | sections)


def measured(name, q, seed):
    """Torques at rest by pinocchio, 1 % noise, and standard parameters."""
    oracle, rng = PinocchioModel(load_robot(name)), np.random.default_rng(seed)
    chi = rng.uniform(0.5, 2.0, len(oracle.names))
    G = np.array([oracle.gravity(x, chi) for x in q])
    tau = G + NOISE * np.abs(G).mean(axis=0) * rng.standard_normal(G.shape)
    record = runtime.Record(np.arange(len(q)), q, tau, rate=1.0, name="poses")
    return record, G, dict(zip(oracle.names, chi, strict=True))


@pytest.mark.parametrize("name", DEPENDENT)
def test_gravity_comes_back_from_poses(name):
    model, lost = symgen.model(name), DEPENDENT[name]
    q = runtime.static_poses(model, (), at_rest(model, poses=25)).poses
    record, G, chi = measured(name, q, 3)
    X = dict(zip(model.BASE_PARAMETERS, model.base_parameters(chi), strict=True))
    if lost:
        result = runtime.identify(model, record, at_rest(model))
        assert result.estimate.groups == (("MX2", "MX3"), ("MY2", "MZ3R"))
        X["MX2"], X["MY2"] = X["MX2"] + X["MX3"], X["MY2"] - X["MZ3R"]
    columns = [one for one in model.BASE_PARAMETERS if one not in lost]
    weights = {"method": "wls", "weights": "joint"}  # the noise of the joints differs
    study = at_rest(model, estimate={"columns": columns, **weights})
    result = runtime.identify(model, record, study, plausible=True)
    fit = result.estimate
    z = [(fit[one] - X[one]) / s for one, s in zip(fit.names, fit.sigma, strict=True)]
    assert np.abs(z).max() < 4 and 0.4 < np.std(z) < 1.8
    assert not [one for one in fit.names if one.startswith(("XX", "ZZ", "Ia", "FV", "FS"))]
    assert result.checklist.state == "good" and "approach every pose" in str(result)
    assert any("not judged for poses at rest" in text for text in result.missing)
    zero, full = np.zeros_like(q), np.zeros(len(model.BASE_PARAMETERS))
    full[[model.BASE_PARAMETERS.index(one) for one in fit.names]] = fit.X
    error = model.inverse_dynamics(q, zero, zero, full) - G
    assert np.linalg.norm(error) < NOISE * np.linalg.norm(G)


@pytest.mark.parametrize("name", [*DEPENDENT, "planar_2r"])
def test_poses_that_were_sought_tell_more_than_random_ones(name):
    model = symgen.model(name)
    study = at_rest(model, poses=15)
    result = runtime.static_poses(model, (), study)
    assert result.taken_in == DEPENDENT.get(name, ())
    assert (np.abs(result.poses) <= 2.0).all() and result.poses.shape == (15, len(model.JOINTS))
    before = np.array(list(result.sigma.values()))[:, 1]
    rng, sigma = np.random.default_rng(7), []
    for q in (result.poses, *rng.uniform(-2, 2, (20, *result.poses.shape))):
        record = runtime.Record(np.arange(len(q)), q, 0 * q, rate=1.0)
        W = runtime.observe(model, record, study).columns(tuple(result.sigma)).W
        sigma.append(np.sqrt(np.diag(np.linalg.inv(W.T @ W))))
    assert sigma[0] == pytest.approx([pair[0] for pair in result.sigma.values()], rel=1e-6)
    assert sigma[0].max() <= before.max()
    logs = np.log(sigma).mean(axis=1)
    assert logs[0] < logs[1:].min() and sigma[0].max() < np.median([x.max() for x in sigma[1:]])


def test_poses_beside_those_of_a_record_determine_what_it_left_open():
    model, rng = symgen.model("planar_2r"), np.random.default_rng(1)
    q = np.repeat(rng.uniform(-1, 1, (2, 2)), 5, axis=0)
    record, *_ = measured("planar_2r", q, 1)
    assert not runtime.identify(model, record, at_rest(model)).determined
    result = runtime.static_poses(model, [record], at_rest(model, poses=3))
    assert np.isinf(result.condition[1]) and result.condition[0] < 10
    assert "the record alone" in str(result)


def test_what_poses_cannot_do_is_refused():
    model, rng = symgen.model("planar_2r"), np.random.default_rng(1)
    record, *_ = measured("planar_2r", rng.uniform(-2, 2, (20, 2)), 1)
    study = at_rest(model)
    for ask in (
        lambda: runtime.cestac(model, record, study),
        lambda: runtime.advise(model, record, study),
        lambda: runtime.excite(model, record, study),
        lambda: runtime.delay(model, record, study),
        lambda: runtime.plausibility(model, record, study),
        lambda: runtime.identify(model, record, study, friction=True),
        lambda: runtime.identify(model, record, at_rest(model, estimate={"method": "iv"})),
    ):
        with pytest.raises(SettingsError, match=r"poses at rest.*needs records of a motion"):
            ask()
    with pytest.raises(InputError, match="do not determine the 6 parameters"):
        runtime.static_poses(model, (), at_rest(model, poses=2))
    with pytest.raises(InputError, match="reader: static"):
        runtime.static_poses(model, [record])
    with pytest.raises(SettingsError, match="the reader static does not use this key"):
        runtime.problem(model, record, at_rest(model, signals={"reader": "static", "step": 0.1}))


def test_a_robot_without_gravity_is_refused(tmp_path):
    path = tmp_path / "flat.yaml"
    path.write_text(
        """symgen: 1
name: flat
gravity: [0, 0, 0]
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
elements:
  FV: {kind: viscous, along: all}
limits: {q: [1]}
"""
    )
    model = symgen.model(path)
    record = runtime.Record(np.arange(12), np.linspace(-1, 1, 12), np.ones(12), rate=1.0)
    for ask in (
        lambda: runtime.identify(
            model, record, study_from_mapping({"signals": {"reader": "static"}})
        ),
        lambda: runtime.static_poses(model),
    ):
        with pytest.raises(InputError, match="show no parameter of flat: gravity"):
            ask()


def test_the_command_writes_poses_that_are_read_as_a_record(tmp_path):
    out = CliRunner().invoke(
        app, ["excite", "planar_2r", "--poses", "12", "-o", str(tmp_path / "out")]
    )
    assert out.exit_code == 0 and "12 static poses determine 6 parameters" in out.stdout
    head, *rows = (tmp_path / "out/poses.csv").read_text().splitlines()
    assert head == "t,q1,q2" and len(rows) == 12
    assert (tmp_path / "out/report.html").exists()
