"""Filters and resolution studies on arrays of several packages against the NumPy path."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.errors import InputError, SettingsError
from runtime.model.array_model import load_arrays
from runtime.model.generated import load_model
from runtime.observation.decimation import decimate as decimated
from runtime.observation.decimation import plan
from runtime.observation.filters import butterworth, lowpass_filtered
from runtime.observation.filters import derivative as differentiated
from runtime.records.record import Record
from runtime.resolution.array_filters import decimate, derivative, lowpass_modes, scan, zero_phase
from runtime.resolution.cestac import cestac
from runtime.resolution.device import Device, arrays_like, to_host
from runtime.settings.study import CestacSettings, Decimate, EstimateSettings, Lowpass, Signals, Study
from symgen.description import load_robot
from symgen.emit import generate_files

pytest.importorskip("array_api_compat")

GENERATED = Path(__file__).resolve().parents[2] / "generated"
PACKAGES = ("numpy", "array_api_strict", "torch")  # operation by operation; JAX below, compiled


def like(package: str) -> Any:
    """An array of the package."""
    if package == "numpy":
        return np.zeros(1)
    found = pytest.importorskip(package)
    if package == "jax":
        found.config.update("jax_enable_x64", True)
        return importlib.import_module("jax.numpy").zeros(1)
    return found.zeros(1, dtype=found.float64)


@pytest.fixture(scope="module")
def planar(tmp_path_factory) -> tuple[Any, Any]:
    """(NumPy, array) modules of the packaged planar arm."""
    folder = tmp_path_factory.mktemp("planar")
    for name, text in generate_files(load_robot("planar_2r"), targets=("numpy", "xp")).items():
        (folder / name).write_text(text, encoding="utf-8")
    model = load_model("planar_2r", folder=folder)
    return model, load_arrays("planar_2r", of=model, folder=folder)


def record(model: Any, N: int = 2500, rate: float = 1000.0, seed: int = 3) -> Record:
    """A motion of several sines per joint, exact positions, white noise on the torques."""
    rng, n = np.random.default_rng(seed), len(model.JOINTS)
    t = np.arange(N) / rate
    w = 2 * np.pi * rng.uniform(0.3, 3.0, (5, n))
    phase = w * t[:, None, None] + rng.uniform(0, 6, (5, n))
    a = rng.uniform(-0.5, 0.5, (5, n))
    q, qd, qdd = ((a * x).sum(1) for x in (np.sin(phase), w * np.cos(phase), -(w**2) * np.sin(phase)))
    X = rng.uniform(0.5, 2.0, len(model.BASE_PARAMETERS))
    return Record(t=t, q=q, tau=model.inverse_dynamics(q, qd, qdd, X) + 0.02 * rng.standard_normal((N, n)), rate=rate, name="motion")


def study(**cestac_settings: Any) -> Study:
    signals = Signals(lowpass=Lowpass(cutoff=25.0), decimate=Decimate(factor=10))
    given = {"delta": (1e-3, 1e-2), "runs": 3, "columns": "all", **cestac_settings}
    return Study(signals=signals, cestac=CestacSettings(**given))


def agree(found: Any, expected: Any, tolerance: float = 1e-9) -> None:
    """The same runs, X within `tolerance` of the largest parameter and the residual as closely."""
    for a, b in zip(found.levels, expected.levels, strict=True):
        assert a.level == b.level and len(a.runs) == len(b.runs)
        for run, reference in zip(a.runs, b.runs, strict=True):
            assert (run.level, run.run, run.method) == (reference.level, reference.run, reference.method)
            np.testing.assert_allclose(run.X, reference.X, rtol=0, atol=tolerance * np.abs(reference.X).max())
            assert run.residual_norm == pytest.approx(reference.residual_norm, rel=tolerance)


@pytest.mark.parametrize("package", PACKAGES)
def test_filters_are_those_of_the_host(package):
    arrays = arrays_like(like(package))
    rate = 1000.0
    x = np.random.default_rng(2).standard_normal((3, 517)).cumsum(axis=1)
    for low in (Lowpass(cutoff=30.0), Lowpass(cutoff=30.0, order=7, padding="scipy")):
        expected = lowpass_filtered(x.T, rate, low).T
        found = to_host(zero_phase(arrays, lowpass_modes(low, rate), arrays.put(x), butterworth(rate, low)[1]))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(x).max())
    for ends in ("one-sided", "second-order"):
        found = to_host(derivative(arrays, arrays.put(x), rate, ends))
        np.testing.assert_allclose(found.T, differentiated(x.T, rate, ends), rtol=0, atol=1e-12 * rate * np.abs(x).max())
    for factor, phase, pad in ((2, 1, 27), (20, 0, 24), (400, 3, 27)):
        how = plan(x.shape[1], factor, phase, pad)
        found = to_host(decimate(arrays, arrays.put(x), how))
        np.testing.assert_allclose(found, decimated(x, how), rtol=0, atol=1e-13 * np.abs(x).max())


def test_scan_is_the_recursion_step_by_step():
    arrays, rng = arrays_like(like("numpy")), np.random.default_rng(4)
    for K in (0, 1, 31, 32, 33, 1100):
        a = 0.99 * np.exp(1j * rng.uniform(0, 3, 2))
        start, drive = (rng.standard_normal((2, 3, *shape, 2)) @ [1, 1j] for shape in ((), (K,)))
        x = [start]
        for k in range(K):
            x.append(a[:, None] * x[-1] + drive[..., k])
        np.testing.assert_allclose(scan(arrays, a, start, drive), np.stack(x, axis=-1), rtol=0, atol=1e-12)


@pytest.mark.parametrize("package", PACKAGES)
def test_study_of_the_planar_arm(planar, package):
    model, arrays = planar
    device = Device(arrays, like(package), batch=2)
    found = cestac(model, record(model), study(), device=device)
    agree(found, cestac(model, record(model), study()))
    assert found.settings["target"].startswith("xp, ") and package.split("_")[0] in found.settings["target"]
    assert {run.method for level in found.levels for run in level.runs} == {"normal equations"}


def test_jax_compiles_a_batch(planar):
    model, arrays = planar
    empty = like("jax")
    import jax

    found = cestac(model, record(model), study(), device=Device(arrays, empty, batch=3, compiled=jax.jit))
    agree(found, cestac(model, record(model), study()))


@pytest.mark.parametrize("settings", [
    {"rounding": "gaussian", "side": "motor"},
    {"rounding": "quantise", "median": 5},
    {"rounding": "uniform", "torque": (0.01,), "common": True},
])  # fmt: skip
def test_settings_of_the_tx40(settings):
    model = load_model("tx40", folder=GENERATED)
    arrays = load_arrays("tx40", of=model, folder=GENERATED)
    both = [record(model), record(model, N=1800, seed=4)]
    asked = study(**{"runs": 2, "delta": (1e-3,), **settings})
    agree(cestac(model, both, asked, device=Device(arrays, like("numpy"))), cestac(model, both, asked))


def test_no_lowpass_no_decimation_constants_and_columns(planar):
    model, arrays = planar
    asked = replace(study(columns=("ZZ1R", "MX2", "FV1", "OFFSET2")), signals=Signals(lowpass=None, decimate=None))
    results = [cestac(model, record(model), asked, constants={"D2": 0.4}, device=d) for d in (Device(arrays, np.zeros(1)), None)]
    agree(*results)


def test_runs_that_need_the_triangular_factor_are_solved_on_the_host(planar):
    model, arrays = planar
    weightless = {"g": 0.0}  # the columns of MX1 and MY1 are zero
    results = [cestac(model, record(model), study(), constants=weightless, device=d) for d in (Device(arrays, np.zeros(1)), None)]
    agree(*results)
    assert {run.method for result in results for level in result.levels for run in level.runs} == {"triangular factor"}


def test_what_a_device_refuses(planar):
    model, arrays = planar
    device = Device(arrays, np.zeros(1))
    with pytest.raises(SettingsError, match="'wls' on a device"):
        cestac(model, record(model), replace(study(), estimate=EstimateSettings(method="wls")), device=device)
    with pytest.raises(InputError, match="leave out workers"):
        cestac(model, record(model), study(), workers=2, device=device)
    other = load_arrays("tx40", folder=GENERATED)
    with pytest.raises(InputError, match="different robot files"):
        cestac(model, record(model), study(), device=Device(other, np.zeros(1)))


def test_single_precision_is_refused():
    empty = like("jax")
    import jax

    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(InputError, match="jax_enable_x64"):
            arrays_like(empty)
    finally:
        jax.config.update("jax_enable_x64", True)


def test_without_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "array_api_compat", None)
    with pytest.raises(InputError, match=r"pip install symgen\[gpu\]"):
        arrays_like(np.zeros(1))
