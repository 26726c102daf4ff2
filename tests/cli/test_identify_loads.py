"""`symgen identify` with a load, and by feasible least squares, on simulated records of the planar
arm with known truth.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from campaign import campaign
from typer.testing import CliRunner

import runtime
import symgen
from runtime.compose import payload
from runtime.core.model import load_model
from runtime.ground.errors import InputError
from runtime.reading.records import read_records
from symgen.cli.main import app
from symgen.description import load_robot
from symgen.emit.generate import generate_module

RATE, N = 200.0, 3000
STUDY = """
symgen: 1
record: {files: [empty.csv]}
signals: {median: 1, lowpass: {cutoff: 20}, decimate: {factor: 4}}
"""
LOAD = "payload: {record: {files: [loaded.csv]}, known: {M: 2.0}, gains: true}\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two records of the arm, 2 kg at (0.3, 0, 0) on link 2 in the second; the torques are told 20
    % too small.
    """
    place = tmp_path_factory.mktemp("loads")
    (place / "arm.py").write_text(generate_module(load_robot("planar_2r")), encoding="utf-8")
    arm = load_model(place / "arm.py", trust=True)
    t = np.arange(N) / RATE
    for k, (name, load) in enumerate(
        (("empty.csv", {}), ("loaded.csv", {"M2": 2.0, "MX2": 0.6, "ZZ2": 0.18, "YY2": 0.18}))
    ):
        w = np.array([[0.9, 2.3, 5.1], [1.1, 2.9, 6.3]])[:, :, None] + 0.1 * k
        a = np.array([1.2, 0.6, 0.2])[:, None]
        q, qd, qdd = (
            (a * f).sum(axis=1).T
            for f in (np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t))
        )
        value = {name: arm.VALUES[name] + load.get(name, 0.0) for name in arm.STANDARD_PARAMETERS}
        tau = arm.inverse_dynamics(q, qd, qdd, arm.base_parameters(value))
        tau = (tau + 0.1 * np.random.default_rng(k).standard_normal(tau.shape)) / 1.25
        np.savetxt(
            place / name,
            np.column_stack([t, q, tau]),
            delimiter=",",
            header="t,q1,q2,tau1,tau2",
            comments="",
        )
    return place


def run(folder, text: str, *options: str):
    (folder / "study.yaml").write_text(STUDY + text, encoding="utf-8")
    return CliRunner().invoke(app, ["identify", "planar_2r", str(folder / "study.yaml"), *options])


@campaign
def test_load_and_torque_constants(folder, tmp_path) -> None:
    result = run(folder, LOAD, "-o", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    assert "load on link 2" in result.output and "the load determines every gain" in result.output
    found = json.loads((tmp_path / "out" / "estimate.json").read_text())
    np.testing.assert_allclose(found["drive_gains"]["together"], 1.25, rtol=0.01)
    assert found["payload"]["known"] == {"M": 2.0} and set(found["payload"]["parameters"]) == {
        "ZZ",
        "MX",
        "MY",
    }
    report = (tmp_path / "out" / "report.html").read_text()
    assert "Load on link 2" in report and "Factors on the torque constants" in report
    again = CliRunner().invoke(
        app, ["identify", "planar_2r", str(tmp_path / "out" / "study.yaml"), "--json"]
    )
    assert again.exit_code == 0 and json.loads(again.stdout)["payload"] == found["payload"]


def test_gains_correct_the_constants_of_the_record_and_the_load(folder, tmp_path) -> None:
    """Currents of 9.91 and 4 N m/A where the study says 1 and 5: constants and load come out as in
    N m, with deviations that hold those of the gains; both stand on the page.
    """
    true, told = np.array([9.91, 4.0]), np.array([1.0, 5.0])
    for name in ("empty.csv", "loaded.csv"):
        columns = np.loadtxt(folder / name, delimiter=",", skiprows=1)
        columns[:, 3:] *= 1.25 / true
        header = "t,q1,q2,tau1,tau2"
        np.savetxt(tmp_path / name, columns, delimiter=",", header=header, comments="")
    amperes = "], units: {tau: A}, torque_constant: [1, 5]}"
    text = (STUDY + LOAD).replace("M: 2.0", "M: 2.0, MX: 0.6").replace("]}", amperes)
    (tmp_path / "study.yaml").write_text(text, encoding="utf-8")
    study = runtime.load_study(tmp_path / "study.yaml")
    model = symgen.model("planar_2r")
    records, loaded = (
        read_records(settings, model, folder=tmp_path)
        for settings in (study.record, study.payload.record)
    )
    found = payload(model, records, study, loaded=loaded)
    gains, carried = found.gains, found.payload
    np.testing.assert_allclose(gains.constant, told)
    np.testing.assert_allclose(gains.together * gains.constant, true, rtol=0.01)
    printed = [float(row[-1]) for row in gains.table().rows]
    np.testing.assert_allclose(printed, true, rtol=0.01)
    error = [carried["ZZ"] - 0.18, carried["MY"]]
    assert carried.names == ("ZZ", "MY") and (np.abs(error) < 3 * carried.sigma).all()
    assert carried.sigma[0] > np.abs(0.18 * gains.sigma / gains.together).min() / 3
    other = replace(study.payload.record[0], torque_constant=(2.0, 5.0))
    mixed = read_records((other,), model, folder=tmp_path)
    with pytest.raises(InputError, match="different torque constants"):
        payload(model, records, study, loaded=mixed)


def test_feasible(folder, tmp_path) -> None:
    text = "estimate: {method: feasible, options: {total_mass: 4.0}}\n"
    result = run(folder, text, "--verbose", "-o", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    assert "smallest eigenvalue" in result.output and "physically feasible" in result.output
    found = json.loads((tmp_path / "out" / "estimate.json").read_text())
    assert (
        found["method"] == "feasible" and min(found["details"]["smallest_eigenvalues"].values()) > 0
    )
    standard = dict(
        line.split(",")[:2]
        for line in (tmp_path / "out" / "standard_parameters.csv").read_text().splitlines()[1:]
    )
    assert float(standard["M1"]) + float(standard["M2"]) == pytest.approx(4.0)
    assert "Physical consistency" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("payload: {known: {M: 2.0}}\n", "no record with the load"),
        ("payload: {record: {files: [loaded.csv]}, known: {mass: 2.0}}\n", "payload.known.mass"),
        ("estimate: {method: feasible, options: {total_mass: -3}}\n", "total_mass"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(folder, text: str, said: str) -> None:
    result = run(folder, text)
    assert result.exit_code == 2 and said in result.output and "Traceback" not in result.output


@campaign
def test_friction_and_physical_options(folder, tmp_path) -> None:
    result = run(folder, "", "-o", str(tmp_path / "out"), "--friction", "--physical", "--verbose")
    assert result.exit_code == 0, result.output
    assert (
        "Least squares (ols) is physically feasible" in result.output
        and "held-out error %" in result.output
    )
    found = json.loads((tmp_path / "out" / "estimate.json").read_text())
    assert found["feasibility"]["feasible"] and found["feasibility"]["margin"] > 0
    assert [curve["joint"] for curve in found["friction"]] == ["1", "2"] and len(
        found["friction"][0]["laws"]
    ) == 5
    assert (tmp_path / "out" / "friction.png").read_bytes()[:4] == b"\x89PNG"
    report = (tmp_path / "out" / "report.html").read_text()
    assert "Friction curves" in report and "Physical consistency" in report


@campaign
def test_least_squares_that_is_feasible_within_its_noise_alone_is_told(tx40_data) -> None:
    result = CliRunner().invoke(app, ["identify", "tx40", "tx40", "--physical", "--json"])
    assert result.exit_code == 0
    told = json.loads(result.stdout)["feasibility"]
    assert told["feasible"] and told["margin"] == 0
    blocking = {one["condition"]: one["margin"] for one in told["blocking"]}
    assert "link 3" in blocking and max(blocking.values()) < 0
