"""Loads and torque constants against simulated truth, jointly and by a second route."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from runtime import InputError, Record, observe
from runtime.compose import problem
from runtime.core.model import load_model
from runtime.ground.errors import SettingsError
from runtime.payload.gains import drive_gains
from runtime.payload.load import payload
from runtime.physical.inertia import INERTIAL, physical_model
from runtime.study import PayloadSettings, study_from_mapping

GENERATED = Path(__file__).resolve().parents[2] / "generated"
RATE = 500.0
STUDY = study_from_mapping({"signals": {"median": 1, "lowpass": None, "decimate": {"factor": 10}}})
BOX = {
    "XX": 0.02,
    "XY": 0.001,
    "XZ": -0.002,
    "YY": 0.03,
    "YZ": 0.001,
    "ZZ": 0.025,
    "MX": 0.2,
    "MY": -0.06,
    "MZ": 0.3,
    "M": 2.0,
}


def readings(model, without, loaded):
    """The records as the study reads them."""
    whole = problem(model, without, STUDY, unseen=loaded)
    return whole.prepared, whole.prepared_unseen


def emitted(name: str):
    return load_model(GENERATED / f"{name}.py")


def motion(n: int, seed: int, seconds: float = 12.0) -> np.ndarray:
    """Sums of slow sinusoids, (N, n), rad: differences are exact enough."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    phase = rng.uniform(0, 2 * np.pi, (n, 4, 1))
    w = 2 * np.pi * np.array([0.15, 0.4, 0.9, 1.7])[:, None] * rng.uniform(0.8, 1.2, (n, 4, 1))
    a = np.array([1.2, 0.8, 0.3, 0.12])[:, None] * rng.uniform(0.7, 1.3, (n, 4, 1))
    return (a * np.sin(w * t + phase)).sum(axis=1).T


def record(
    model,
    load: dict[str, float],
    seed: int,
    noise: float,
    gain=1.0,
    share: float = 1.0,
    link: int | None = None,
) -> Record:
    """Torques of the robot file's values with a load, over `gain`; noise in N m before that;
    `share` scales friction under load.
    """
    physical = physical_model(model)
    q = motion(len(model.JOINTS), seed)
    qd = np.gradient(q, 1 / RATE, axis=0)
    qdd = np.gradient(qd, 1 / RATE, axis=0)
    value = {name: model.VALUES.get(name, 0.0) for name in physical.standard}
    value |= {name: share * x for name, x in value.items() if name[:2] in ("FV", "FS")}
    for family, x in load.items():
        value[f"{family}{link or physical.links[-1]}"] += x
    chi = np.array([value[name] for name in physical.standard])
    tau = model.inverse_dynamics(q, qd, qdd, physical.K @ chi)
    rng = np.random.default_rng([seed, 9])
    tau = (tau + noise * rng.standard_normal(tau.shape)) / gain
    return Record(np.arange(len(q)) / RATE, q, tau, rate=RATE, name=f"record {seed}")


def pair(model, noise: float, **loaded) -> tuple[list, list]:
    """Observations without and with the load."""
    load = loaded.pop("load", BOX)
    return [observe(model, record(model, {}, 1, noise), STUDY)], [
        observe(model, record(model, load, 2, noise, **loaded), STUDY)
    ]


def test_unknown_load_of_the_tx40() -> None:
    """All ten parameters, jointly: within three stated deviations, mass to 1 %."""
    tx40 = emitted("tx40")
    without, loaded = pair(tx40, 0.3)
    found = payload(tx40, without, loaded, PayloadSettings())
    assert found.link == 6 and found.names == INERTIAL and found.estimate.status == "ok"
    assert (np.abs(found.value - np.array([BOX[f] for f in INERTIAL])) < 3.5 * found.sigma).all()
    assert found["M"] == pytest.approx(2.0, rel=0.01)
    assert "kg*m" in found.to_table() and found.estimate.units["ML"] == "kg"


def test_noise_free_load_is_exact_on_the_planar_arm() -> None:
    """2 kg on link 2; parameters of the load without effect on a planar arm are not asked."""
    arm = emitted("planar_2r")
    load = {"M": 2.0, "MX": 0.6, "ZZ": 0.2}
    found = payload(arm, *pair(arm, 0.0, load=load), PayloadSettings())
    assert found.names == ("ZZ", "MX", "MY", "M")
    np.testing.assert_allclose(
        [found[f] for f in found.names], [0.2, 0.6, 0.0, 2.0], atol=2e-4
    )  # decimated differences
    known = payload(arm, *pair(arm, 0.0, load=load), PayloadSettings(known={"M": 2.0}))
    assert known.names == ("ZZ", "MX", "MY") and known["M"] == 2.0
    np.testing.assert_allclose(known["MX"], 0.6, atol=2e-4)


def test_known_mass_sharpens_the_rest_and_a_wrong_one_shows() -> None:
    arm = emitted("planar_2r")
    without, loaded = pair(arm, 0.2, load={"M": 2.0, "MX": 0.6, "ZZ": 0.2})
    free, given = (
        payload(arm, without, loaded, PayloadSettings(known=k)) for k in ({}, {"M": 2.0})
    )
    wrong = payload(arm, without, loaded, PayloadSettings(known={"M": 3.0}))
    assert given.sigma[1] <= free.sigma[1] * 1.05
    assert wrong.estimate.sigma_rho > 1.5 * given.estimate.sigma_rho


def test_friction_that_grows_with_the_load() -> None:
    """Twice the friction under load: own columns find it, without them it spoils the fit."""
    arm = emitted("planar_2r")
    without, loaded = pair(arm, 0.05, load={"M": 2.0}, share=2.0)
    plain, own = (payload(arm, without, loaded, PayloadSettings(friction=f)) for f in (False, True))
    assert own["M"] == pytest.approx(2.0, abs=0.02) and own.estimate["FV1L"] == pytest.approx(
        arm.VALUES["FV1"], abs=0.03
    )
    assert plain.estimate.sigma_rho > 2 * own.estimate.sigma_rho


def test_load_on_another_link() -> None:
    tx40 = emitted("tx40")
    found = payload(
        tx40,
        *pair(tx40, 0.1, load={"M": 1.5}, link=3),
        PayloadSettings(link=3, known=dict.fromkeys(INERTIAL[:9], 0.0)),
    )
    assert found.names == ("M",) and found["M"] == pytest.approx(1.5, rel=0.02)


def test_drive_gains_of_the_planar_arm() -> None:
    """v = torque/(30, 12), mass known alone: gains within one per cent and three deviations,
    jointly and motor by motor.
    """
    arm, true = emitted("planar_2r"), np.array([30.0, 12.0])
    load = {"M": 2.0, "MX": 0.6, "ZZ": 0.2}
    without, loaded = record(arm, {}, 1, 0.3, true), record(arm, load, 2, 0.3, true)
    found = drive_gains(arm, *readings(arm, [without], [loaded]), PayloadSettings(known={"M": 2.0}))
    np.testing.assert_allclose(found.together, true, rtol=0.01)
    assert (np.abs(found.together - true) < 3.5 * found.sigma).all()
    assert abs(found.alone[0] - 30) < 3.5 * found.sigma_alone[0] and np.isnan(
        found.alone[1]
    )  # the mass alone does not act on joint 2
    assert found.refused == () and "every gain" in found.text
    full = PayloadSettings(
        known=load | dict.fromkeys(("XX", "XY", "XZ", "YY", "YZ", "MY", "MZ"), 0.0)
    )
    exact = drive_gains(
        arm,
        *readings(arm, [record(arm, {}, 1, 0.0, true)], [record(arm, load, 2, 0.0, true)]),
        full,
    )
    np.testing.assert_allclose(exact.together, true, rtol=1e-3)
    np.testing.assert_allclose(exact.alone, true, rtol=1e-3)


def test_gains_over_runs_are_unbiased_and_have_the_stated_sigma() -> None:
    arm, true = emitted("planar_2r"), np.array([3.0, 0.5])
    runs = []
    for seed in range(12):
        without, loaded = (
            record(arm, {}, 2 * seed, 0.5, true),
            record(arm, {"M": 1.0}, 2 * seed + 1, 0.5, true),
        )
        runs.append(
            drive_gains(
                arm,
                *readings(arm, [without], [loaded]),
                PayloadSettings(known={"M": 1.0}),
                seed=seed,
            )
        )
    z = np.array([(r.together - true) / r.sigma for r in runs])
    assert (
        np.abs(z.mean(axis=0)).max() < 1.0 and 0.5 < np.sqrt((z**2).mean()) < 1.6
    )  # 12 runs, two gains


def test_motors_the_load_does_not_change_are_refused() -> None:
    """A point mass at the wrist centre of the TX40, everything of it known: motors 4, 5 and 6 feel
    nothing; wrist motors are coupled.
    """
    tx40 = emitted("tx40")
    point = dict.fromkeys(INERTIAL, 0.0) | {"M": 4.0}
    without, loaded = record(tx40, {}, 1, 0.3), record(tx40, point, 2, 0.3)
    found = drive_gains(tx40, *readings(tx40, [without], [loaded]), PayloadSettings(known=point))
    np.testing.assert_allclose(found.together[[1, 2]], 1.0, atol=0.03)
    assert np.isnan(found.alone[4]) and np.isnan(found.alone[5])
    assert not 100 * found.sigma_alone[3] < 20 * abs(found.alone[3])
    assert (
        found.refused == ("5", "6")
        and "REFUSED" in found.text
        and found.sigma[3] > 20 * found.sigma[2]
    )


def test_bad_input() -> None:
    arm = emitted("planar_2r")
    without, loaded = pair(arm, 0.1)
    with pytest.raises(SettingsError, match=r"payload\.link: no link 7"):
        payload(arm, without, loaded, PayloadSettings(link=7))
    with pytest.raises(
        InputError, match=r"a record without the load \(record\) and a record with the load"
    ):
        payload(arm, without, [], PayloadSettings())
    with pytest.raises(SettingsError, match=r"payload\.known\.mass"):
        study_from_mapping({"payload": {"known": {"mass": 2}}})
    with pytest.raises(SettingsError, match="weighed load"):
        study_from_mapping({"payload": {"gains": True}})
    with pytest.raises(InputError, match="weighed mass"):
        drive_gains(
            arm,
            *readings(arm, [record(arm, {}, 1, 0.1)], [record(arm, {}, 2, 0.1)]),
            PayloadSettings(),
        )
