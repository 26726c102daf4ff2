"""The demo: labelled as simulated without data; with it, within the stated tolerances of the
chapter's Tables 2 and 3.
"""

import json

import numpy as np
import pytest
import typer
from campaign import campaign
from typer.testing import CliRunner

import symgen
from runtime.loop.reference import point_to_point
from runtime.loop.settings import Points
from symgen import demo as simulated
from symgen import demo as tx40
from symgen.cli.demo import demo
from symgen.demo import differences


def run(*arguments):
    app = typer.Typer()
    app.command()(demo)
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def offline(tmp_path_factory):
    """The quick demo where no place holds the record and none can be reached."""
    folder = tmp_path_factory.mktemp("demo")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("SYMGEN_DATA", raising=False)
        patch.setattr("pooch.os_cache", lambda name: folder / "cache")
        patch.setattr("pooch.HTTPDownloader", lambda timeout: _refused)
        result = run("-o", folder / "out", "--quick")
    return result, folder / "out"


def _refused(url, output_file, pooch):
    raise OSError("no network in this test")


@campaign
def test_offline_is_labelled_everywhere(offline):
    result, out = offline
    assert result.exit_code == 0, result.output
    assert "SIMULATED" in result.stdout and "No measured record" in result.stderr
    html = (out / "report.html").read_text(encoding="utf-8")
    assert (
        "SIMULATED" in html[html.index("<h1>") : html.index("</h1>")] and 'class="warning"' in html
    )
    assert {
        "estimate.mat",
        "cestac.csv",
        "cestac.mat",
        "cestac.npz",
        "resolution.png",
    } <= {p.name for p in out.iterdir()}
    for name in ("estimate.json", "cestac.json"):
        provenance = json.loads((out / name).read_text())["provenance"]
        assert provenance["simulated"] is True and "SIMULATED" in provenance["note"]
    assert "measured, predicted by" not in html
    study = (out / "study.yaml").read_text()
    assert "SIMULATED" in study and simulated.FILE in study and (out / simulated.FILE).is_file()
    assert "http://" not in html and "https://" not in html and html.count("<script") == 2


@campaign
def test_offline_recovers_what_was_put_in(offline):
    """The large parameters of the robot file, from a noisy record of 4 s."""
    _, out = offline
    estimate = json.loads((out / "estimate.json").read_text())
    found = dict(zip(estimate["names"], estimate["X"], strict=True))
    for name in ("ZZ1R", "FV1", "MX2R", "FV2", "FS2", "FS3"):
        assert found[name] == pytest.approx(tx40.TABLE_2[name], rel=0.1)


def test_simulated_trajectory_keeps_the_limits():
    model = symgen.model("tx40")
    path = point_to_point(model, Points(9.0, 1), 5000.0)
    again = point_to_point(model, Points(9.0, 1), 5000.0)
    low, high = np.array(model.LIMITS["q"]).T
    assert (path.q >= low).all() and (path.q <= high).all()
    assert (np.abs(path.qd) <= np.array(model.LIMITS["qd"])).all()
    assert (np.abs(path.qdd) <= np.array(model.LIMITS["qdd"])).all()
    assert np.array_equal(path.q, again.q)
    for x, dx in ((path.q, path.qd), (path.qd, path.qdd)):  # central differences at 5 kHz
        assert np.abs(np.gradient(x, path.t, axis=0) - dx)[1:-1].max() < 5e-3 * np.abs(dx).max()
    steady = np.abs(path.qdd).max(axis=1) == 0
    assert 0.2 < steady.mean() < 0.5  # constant velocity in the middle of every piece


@campaign
def test_measured_record(tx40_data, tmp_path):
    """Tables 2 and 3 within their tolerances, and every table of the report; one test, since the
    demo runs once.
    """
    shown = tx40.demonstrate(tx40.prepare(quick=False), quick=False)
    check_table_2(shown)
    check_table_3(shown)
    check_report(shown, tmp_path)


def check_table_2(shown):
    off = differences(shown)
    assert shown.result.essential.estimate.relative_error < 8
    assert len(off) == 17
    assert sum(abs(d) <= 10 for d in off.values()) >= 11
    assert sum(abs(d) <= 20 for d in off.values()) >= 14
    assert all(abs(d) <= 40 for d in off.values())


def check_table_3(shown):
    i = shown.resolution.names.index("ZZ1R")
    assert [level.mean[i] for level in shown.resolution.levels] == pytest.approx(
        tx40.TABLE_3["ZZ1R"], abs=0.07
    )
    assert len(shown.torque.levels) == 1 + 2 * len(tx40.PHI)


def check_report(shown, folder):
    html = shown.files(folder)["report.html"]
    for words in (
        "Table 2",
        "Table 3",
        "Table 4",
        "Gaussian rounding is called pessimistic",
    ):
        assert words in html
    assert html.count("data:image/svg+xml") >= 8
