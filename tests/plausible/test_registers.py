"""Torques without their sign: registers with a bit for the sign, two's complement, magnitudes."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import planar_arm
import pytest

import runtime
import symgen
from runtime.plausible.registers import kinks_at_zero, register_bit

QUESTION = "Do the torques have their sign?"
DATA = os.environ.get("SYMGEN_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data"
CASE = Path(DATA).parent / "cases5" / "sign_bit"


@pytest.fixture(scope="module")
def arm():
    return planar_arm.arm()


def torques(arm, seed):
    t, q, qd, qdd = planar_arm.motion(seed, 20.0)
    tau = arm.inverse_dynamics(q, qd, qdd, planar_arm.parameters(arm))
    return t, q, tau + 0.03 * np.random.default_rng(seed).standard_normal(tau.shape)


def answer(arm, t, q, tau):
    found = runtime.plausibility(arm, runtime.Record(t, q, tau, rate=planar_arm.RATE))
    return next((c for c in found.checks() if c.question == QUESTION), None), found


@pytest.mark.parametrize("factor", [0.01, -0.004])
@pytest.mark.parametrize("complement", [False, True])
def test_a_bit_of_the_sign_is_told_with_its_decoding(arm, factor, complement) -> None:
    t, q, tau = torques(arm, 1)
    step = np.abs(tau).max(axis=0) / 900
    raw = np.round(tau / step)
    bit = 15 if complement else 10
    register = np.where(raw < 0, raw + 2**16 if complement else 2**bit - raw, raw)
    check, found = answer(arm, t, q, factor * register)
    assert check is not None and check.state == "no"
    said = f"raw - {2**16}" if complement else f"-(raw - {2**bit})"
    assert said in check.remedy and "joint 1, 2" in check.finding
    assert not found.named and "wrong sign" not in found.line


def test_magnitudes_are_told(arm) -> None:
    t, q, tau = torques(arm, 1)
    check, found = answer(arm, t, q, np.abs(tau))
    assert check is not None and check.state == "no" and "it is a magnitude" in check.finding
    assert not found.named


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("step", [0.0, 0.02])
def test_torques_above_zero_are_no_magnitudes(arm, seed, step) -> None:
    """Right torques, and those that a load keeps on one side of zero, down to touching it."""
    _, _, tau = torques(arm, seed)
    for above in (0.0, 1.0, 1.3):
        x = tau + above * np.abs(tau.min(axis=0))
        x = step * np.round(x / step) if step else x
        for own in x.T:
            assert register_bit(own) is None and kinks_at_zero(own, planar_arm.RATE) < 4


@pytest.mark.parametrize(
    ("file", "told"),
    [
        ("log.yaml", "-(raw - 1024)"),
        ("remedy.yaml", "-(raw - 1024)"),
        ("magnitudes.csv.gz", "it is a magnitude"),
    ],
)
def test_the_shared_case_is_told_and_right_once_it_is_decoded(file, told) -> None:
    if not CASE.is_dir() and not os.environ.get("SYMGEN_REQUIRE_DATA"):
        pytest.skip(f"{CASE} is not there")
    model = symgen.model(CASE / "two.urdf")
    study = runtime.load_study(CASE / file) if file.endswith(".yaml") else runtime.Study()
    record = runtime.read_record(CASE / file, model)
    found = runtime.identify(model, record, study, plausible=True)
    checklist = found.checklist
    assert found.negative or file == "remedy.yaml"
    assert "a sign of the joint is wrong" not in found.brief()  # one cause
    assert checklist.answer == "No"
    assert QUESTION in checklist.doubt and told in checklist.doubt
    if file != "log.yaml":
        return
    scale = np.array([0.009, 0.004])
    raw = np.round(record.tau / scale)
    decoded = replace(record, tau=scale * np.where(raw < 1024, raw, -(raw - 1024)))
    result = runtime.identify(model, decoded, study, plausible=True)
    assert result.checklist.answer.startswith("Yes"), result.checklist.doubt
    fit = result.model_estimate
    sigma = dict(zip(fit.names, fit.sigma_corrected, strict=True))
    for name, true in {"MX1R": 0.540, "MX2": 0.100, "OFFSET1": 0.0, "OFFSET2": 0.0}.items():
        assert abs(fit[name] - true) < 1.96 * sigma[name] + 0.01, name
