"""A force sensor below the base: parameters from its wrench, which pinocchio computes."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import campaign

import runtime
import symgen
from oracles.applying import motion
from oracles.pinocchio_model import PinocchioModel
from oracles.test_on_request import base_wrench
from runtime.errors import InputError
from runtime.loop.methods import estimate_of
from runtime.model.generated import load_model
from runtime.rows.wrench import observe_wrench
from runtime.settings.study import study_from_mapping
from symgen.certify.modules import certified_files

STUDY = study_from_mapping(
    {
        "signals": {"median": 1, "lowpass": None, "decimate": None},
        "rows": {"trim": 20},
        "estimate": {"method": "wls"},
    }
)
BIAS = np.array([3.0, -2.0, 5.0, 0.4, -0.3, 0.2])
SIGMA = np.array([0.2, 0.3, 0.5, 0.02, 0.03, 0.05])


@pytest.fixture(scope="module", params=["planar_2r", pytest.param("scara", marks=campaign)])
def measured(request, tmp_path_factory):
    """(module, standard parameters, record without noise), 1 kHz."""
    robot = symgen.load_robot(request.param)
    ((name, text),) = certified_files(robot, options=("base_wrench_regressor",)).items()
    path = tmp_path_factory.mktemp("wrench") / name
    path.write_text(text)
    model = load_model(path, trust=True)
    oracle, rng = PinocchioModel(robot), np.random.default_rng(4)
    chi = rng.uniform(0.2, 1.0, len(robot.parameters))
    assert tuple(robot.parameters) == tuple(model.STANDARD_PARAMETERS)
    t, *states = motion(len(robot.joints), 3, 6.0, 1000.0)
    tau = np.array([oracle.torque(*x, chi) for x in zip(*states, strict=True)])
    wrench = np.array([base_wrench(oracle, *x, chi) for x in zip(*states, strict=True)]) + BIAS
    record = runtime.Record(t, states[0], tau, rate=1000.0, channels={"wrench": wrench})
    return model, chi, record


@pytest.mark.parametrize("torques", [True, False])
def test_parameters_come_back(measured, torques) -> None:
    model, chi, record = measured
    rows = observe_wrench(model, record, STUDY, torques=torques)
    W = rows.observation.W
    assert np.linalg.matrix_rank(W / np.linalg.norm(W, axis=0)) == W.shape[1]
    fit = estimate_of(rows.observation, STUDY.estimate)
    true = dict(zip(rows.observation.names, rows.K @ [*chi, *BIAS], strict=True))
    assert fit.status == "ok"
    # differences of positions at 1 kHz err by (w T)**2/6 of a rate: 5e-6; a sign at a reversal is
    # that of the difference
    for name, x in true.items():
        assert fit[name] == pytest.approx(x, abs=2e-2), name
    names = {name.removesuffix("R") for name in true}
    own = {name.removesuffix("R") for name in model.BASE_PARAMETERS}
    assert {"XZ1", "YZ1", "M1"} <= names - own  # what the wrench alone knows
    assert torques == ("FV1" in names)
    assert (own <= names) if torques else not own <= names


@campaign
def test_deviations_by_row_group(measured) -> None:
    """Weights and deviations of each of the six; scatter of 40 records within what is stated."""
    model, chi, record = measured
    rng, z = np.random.default_rng(5), []
    for _ in range(40):
        wrench = record.channels["wrench"] + SIGMA * rng.standard_normal((len(record.t), 6))
        tau = record.tau + 0.1 * rng.standard_normal(record.tau.shape)
        noisy = runtime.Record(record.t, record.q, tau, rate=1000.0, channels={"wrench": wrench})
        rows = observe_wrench(model, noisy, STUDY)
        fit = estimate_of(rows.observation, STUDY.estimate)
        z.append((fit.X - rows.K @ [*chi, *BIAS]) / fit.sigma)
    scales = np.array([joint.scale for joint in fit.per_joint])
    np.testing.assert_allclose(scales[-6:], SIGMA, rtol=0.05)
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.1)


def test_what_is_missing_is_said(measured) -> None:
    model, _, record = measured
    bare = runtime.Record(record.t, record.q, record.tau, rate=1000.0)
    with pytest.raises(InputError, match="no channel `wrench`"):
        observe_wrench(model, bare, STUDY)
    with pytest.raises(InputError, match="--with base_wrench_regressor"):
        observe_wrench(symgen.model("planar_2r"), record, STUDY)
