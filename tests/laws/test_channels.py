"""Functions of time in the laws of columns: channel.NAME of the record, and tau_model, the torque
that the rest of the model transmits. Oracles: columns by CasADi, hand-written NumPy, least squares
on all unknowns by scipy; what does not have them refuses.
"""

from __future__ import annotations

import warnings

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import least_squares

import runtime
import symgen
from runtime.compose import problem
from runtime.core.model import require
from runtime.ground.errors import InputError, ModelError
from runtime.reading.records import read_records
from runtime.study import study_from_mapping
from symgen.certify.modules import certified_files
from symgen.description.yaml import parse_robot
from symgen.errors import DescriptionError, SymgenError

ARM = """
symgen: 1
name: arm
gravity: [0, 0, -g]
constants: {{g: 9.81, temperature: 25}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: pi/2, d: {d}, theta: q2, r: 0}}
elements:
  Ia: {{kind: inertia, along: all}}
  FV: {{kind: viscous, along: all}}
  FS: {{kind: coulomb, along: all}}
columns:
  {columns}
"""
COLUMNS = """FT: {along: all, torque: "sign(qd)*(channel.temperature/25 - 1)", unit: N*m}
  FX: {along: 2, torque: "exp(-channel.temperature/20)*qd", unit: N*m*s/rad}
  LD: {kind: load_dependent, along: 2}"""
SETTINGS = {"signals": {"median": 1, "lowpass": None, "decimate": None}, "rows": {"trim": 3}}
WEIGHTED = {"estimate": {"method": "wls", "weights": "joint"}}
STUDY = study_from_mapping(SETTINGS | WEIGHTED)
TRUE = {"FS1": 2.0, "FV1": 1.0, "FS2": 1.5, "FV2": 0.8, "FT1": 0.9, "FT2": -0.7, "LD2": 0.15}


def robot(columns: str = COLUMNS, d: str = "0"):
    return parse_robot(ARM.format(columns=columns, d=d).encode(), "arm.yaml")


@pytest.fixture(scope="module")
def model():
    return symgen.model(robot(COLUMNS.replace("  FX", "  # FX")))


def motion():
    """t, q, qd, qdd and a temperature: slow and fast sines, a rise of 20 K."""
    t = np.arange(4000) / 200
    q = np.zeros((3, len(t), 2))
    for j, shift in enumerate((0.3, 1.9)):
        for k, w in enumerate(2 * np.pi * np.array([0.1, 0.25, 0.6, 1.1])):
            a, phase = 0.7 / (k + 1), shift * (k + 1)
            q += (
                a
                * np.array(
                    [
                        np.sin(w * t + phase),
                        w * np.cos(w * t + phase),
                        -w * w * np.sin(w * t + phase),
                    ]
                )[:, :, None]
                * (np.arange(2) == j)
            )
    return t, q, 20 + 20 * t / t[-1]


def record_of(model, noise: float, seed: int = 2):
    """A record with torques written here: tau_m (1 + c sign(qd) sign(tau_m)), and what X is."""
    t, (q, qd, qdd), T = motion()
    names = list(model.BASE_PARAMETERS)
    X = np.array([TRUE.get(name, 3.0 if name[:2] in ("ZZ", "MX") else 0.4) for name in names])
    rest = [k for k, name in enumerate(names) if name != "LD2"]
    tau = model.regressor(q, qd, qdd, temperature=T)[..., rest] @ X[rest]
    tau[:, 1] += 0.15 * np.abs(tau[:, 1]) * np.sign(qd[:, 1])
    tau += noise * np.random.default_rng(seed).standard_normal(tau.shape)
    return runtime.Record(t, q, tau, rate=200.0, channels={"temperature": T}), dict(
        zip(names, X, strict=True)
    )


def test_columns_of_channels_are_those_of_casadi() -> None:
    """NumPy with one value a sample, over several blocks, and every target with one of a call."""
    arm = robot()
    assert arm.channels == {"temperature": ("FT1", "FT2", "FX2"), "tau_model2": ("LD2",)}
    module = symgen.model(arm)
    assert {*module.CHANNELS["temperature"]} == {"FT1", "FT2", "FX2"}
    rng = np.random.default_rng(1)
    q, qd, qdd = rng.uniform(-2, 2, (3, 9001, 2))
    T, load = rng.uniform(10, 60, 9001), rng.uniform(-5, 5, 9001)
    D = module.regressor(q, qd, qdd, temperature=T, tau_model2=load)
    v, x, f = ca.SX.sym("v"), ca.SX.sym("T"), ca.SX.sym("f")
    laws = {
        "FT2": ca.sign(v) * (x / 25 - 1),
        "FX2": ca.exp(-x / 20) * v,
        "LD2": ca.fabs(f) * ca.sign(v),
    }
    for name, law in laws.items():
        expected = ca.Function("f", [v, x, f], [law])(qd[:, 1], T, load).full()[:, 0]
        column = D[:, :, module.BASE_PARAMETERS.index(name)]
        np.testing.assert_allclose(column[:, 1], expected, atol=1e-12)
        assert not column[:, 0].any()
    X = rng.uniform(-1, 1, len(module.BASE_PARAMETERS))
    tau = module.inverse_dynamics(q, qd, qdd, X, temperature=T, tau_model2=load)
    np.testing.assert_allclose(tau, D @ X, atol=1e-10)
    with pytest.raises(ValueError, match="9001"):
        module.regressor(q, qd, qdd, temperature=T[:-1])
    files = certified_files(arm, targets=["numpy", "c"])
    assert len(files) == 3
    # implicit in the torque, so that no target has it
    assert not any(" forward_dynamics(" in text for text in files.values())
    assert not hasattr(module, "forward_dynamics")
    with pytest.raises(
        ModelError,
        match="friction laws depend on the torque tau_model and hence on the accelerations",
    ):
        require(module, "forward_dynamics")
    with pytest.raises(SymgenError, match="LD2 use tau_model, which depends on qdd"):
        str(symgen.symbolic(arm).formulas("forward_dynamics"))
    printed = str(symgen.symbolic(arm).formulas("friction"))
    assert "tau_model2*sign(QP2)*sign(tau_model2)*LD2" in printed and "temperature" in printed


@pytest.mark.parametrize(
    ("column", "message"),
    [
        ('torque: "channel.pressure*qd", unit: N', "channel.pressure' is unknown"),
        ('energy: "channel.temperature*q", unit: N', "positions only"),
        (
            'torque: "channel.temperature*temperature*qd", unit: N',
            "used as a constant and as the measured quantity channel.temperature",
        ),
    ],
)
def test_laws_that_no_record_can_give_are_refused(column: str, message: str) -> None:
    with pytest.raises(DescriptionError, match=message):
        robot(f"FT: {{along: 2, {column}}}")


def test_a_channel_is_no_length_and_a_load_that_of_one_joint() -> None:
    with pytest.raises(DescriptionError, match=r"the measured quantity channel\.temperature"):
        robot(d="temperature")
    with pytest.raises(DescriptionError, match="one actuated joint"):
        robot("LD: {kind: load_dependent, along: {2: q1 + q2}}")


def test_a_channel_is_independent_of_constants() -> None:
    """At one temperature FT is FS; as a function of time it is a parameter of its own, alone or
    beside a law that exact arithmetic does not know.
    """
    for law in ("sign(qd)*channel.temperature", "sign(qd)*exp(channel.temperature/20)"):
        names = symgen.regrouping(robot(f'FT: {{along: 2, torque: "{law}", unit: N}}')).names
        assert "FT2" in names and "FS2" in names
    twice = 'FT: {along: 2, torque: "sign(qd)*channel.temperature", unit: N}\n  FU: {along: 2, torque: "3*sign(qd)*channel.temperature", unit: N}'
    (base,) = (b for b in symgen.regrouping(robot(twice)).base if b.own in ("FT2", "FU2"))
    assert str(base.formula) == "FT2 + 3*FU2"


def test_parameters_come_back_from_a_file(model, tmp_path) -> None:
    """Without noise: the channel is a column of a CSV file, the load of the model's own torque."""
    record, X = record_of(model, 0.0)
    file = tmp_path / "run.csv"
    rows = np.column_stack([record.t, record.q, record.tau, record.channels["temperature"]])
    np.savetxt(file, rows, delimiter=",", header="t,q1,q2,tau1,tau2,T_motor", comments="")
    settings = {"files": [str(file)], "columns": {"channels": {"temperature": "T_motor"}}}
    study = study_from_mapping({"record": settings, **SETTINGS, **WEIGHTED})
    (read,) = read_records(study.record, model)
    result = runtime.identify(model, read, study, friction=True)
    assert result.estimate.relative_error < 0.5
    for name, value in zip(result.estimate.names, result.estimate.X, strict=True):
        assert value == pytest.approx(X[name], abs=0.02), name
    assert any(
        "tau_model is the torque of the other" in text for text in result.observation.findings
    )


def test_the_load_is_least_squares_on_everything(model) -> None:
    """The passes end near the minimum of all parameters at once, found by scipy: d'C^-1 d < 1, b
    would be the mean square of a whole deviation of each. They leave out that |tau_m| moves with X,
    an effect in proportion to c.
    """
    record, _ = record_of(model, 0.15)
    (own,) = problem(model, record, STUDY).prepared
    rows = own.observation(model)
    X = np.linalg.lstsq(rows.W, rows.Y, rcond=None)[0]
    k = rows.names.index("LD2")
    rest = [i for i in range(len(X)) if i != k]
    second = rows.joints == np.unique(rows.joints)[1]
    motor = np.sign(own.states.qd[own.selection.samples][own.selection.kept][:, 1])
    direction = np.zeros(len(rows.Y))
    direction[second] = motor[own.selection.mask[1]]

    def residual(x):
        transmitted_torque = rows.W[:, rest] @ x[rest]
        return rows.Y - transmitted_torque - x[k] * np.abs(transmitted_torque) * direction

    everything = least_squares(residual, np.where(np.arange(len(X)) == k, 0.0, X), xtol=1e-13)
    noise = np.sqrt(2 * everything.cost / len(rows.Y))
    sigma = noise * np.sqrt(np.diag(np.linalg.pinv(everything.jac.T @ everything.jac)))
    assert (np.sum(residual(X) ** 2) - 2 * everything.cost) / noise**2 < 1
    assert (np.abs(everything.x - X) < sigma).all()
    torque = np.abs(rows.W[:, rest] @ X[rest]) * direction
    np.testing.assert_allclose(rows.W[:, k], torque, atol=1e-4 * np.abs(torque).max())
    assert abs(X[k] - 0.15) < 4 * sigma[k]


def test_what_does_not_have_channels_refuses(model) -> None:
    record, _ = record_of(model, 0.1)
    bare = runtime.Record(record.t, record.q, record.tau, rate=200.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for ask in (
            lambda: runtime.identify(model, bare, STUDY),
            lambda: runtime.excite(model, record, STUDY),
        ):
            with pytest.raises(
                InputError,
                match=r"FT1, FT2.* need .*temperature|temperature.* need at every sample",
            ):
                ask()
