"""The example of the haptic interface: motion, record and report labelled as simulated, figures of
the order of Tables 6 and 7.
"""

import json
import re
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO

import haptic
import haptic_motion
import numpy as np
import pytest
from campaign import campaign

from symgen import demo as simulated
from symgen.description import load_robot

# chapter, Tables 6 and 7: the fourteen parameters in the order printed, fC as FS
FOURTEEN = [
    "ZZ1R",
    "MY1R",
    "FS1",
    "XX2R",
    "ZZ2R",
    "MX2R",
    "FS2R",
    "OFFSET2",
    "XX3R",
    "ZZ3R",
    "MX3R",
    "MX5R",
    "FS5R",
    "OFFSET5",
]


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """What the quick form prints, and its folder: a quarter of the record, two runs."""
    out = tmp_path_factory.mktemp("haptic") / "out"
    stdout, stderr = StringIO(), StringIO()
    with redirect_stdout(stdout), redirect_stderr(stderr):
        haptic.main(out, quick=True)
    return stdout.getvalue(), stderr.getvalue(), out


@campaign
def test_labelled_as_simulated_everywhere(quick):
    stdout, stderr, out = quick
    assert stdout.startswith("SIMULATED record") and "nothing below was measured" in stderr
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
    assert "SIMULATED" in (out / "study.yaml").read_text() and (out / simulated.FILE).is_file()
    assert "http://" not in html and "https://" not in html and html.count("<script") == 2


@campaign
def test_report_has_its_tables_and_figures(quick):
    stdout, _, out = quick
    html = (out / "report.html").read_text(encoding="utf-8")
    for words in (
        "What is given and what is assumed",
        "Table 6, LS",
        "Table 7, 2*pi/80",
        "configurations are singular",
        "largest apparent mass",
    ):
        assert words in stdout
    assert html.count("data:image/svg+xml") >= 6
    assert (out / "handle.png").read_bytes()[:4] == b"\x89PNG"


@campaign
def test_table_6_comes_back(quick):
    """All fourteen, no other, within 3.5 standard deviations (10) of what was put in: fourteen
    draws, sigma of equal noise on all joints.
    """
    *_, out = quick
    essential = json.loads((out / "estimate.json").read_text())["essential"]
    assert essential["names"] == FOURTEEN
    for name, x, sigma in zip(FOURTEEN, essential["X"], essential["sigma"], strict=True):
        assert abs(x - float(haptic.TABLE[name][1])) < 3.5 * sigma, name


@campaign
def test_table_7_has_the_order_of_the_chapter(quick):
    """%e below 1 % at the real step; small variations, then biased, among main inertia and gravity
    parameters; dry friction stays.
    """
    stdout, _, out = quick
    levels = {
        round(2 * np.pi / level["level"]["delta"]): level["e"]
        for level in json.loads((out / "cestac.json").read_text())["levels"]
    }
    assert set(levels) == {4000, 200, 100, 80}
    names = FOURTEEN
    main = [i for i, name in enumerate(names) if name[:2] in ("ZZ", "XX", "MX", "MY")]
    friction = [i for i, name in enumerate(names) if name.startswith("FS")]
    assert max(levels[4000]) < 1
    assert 1 < max(levels[100][i] for i in main) < 5 < max(levels[80][i] for i in main) < 10
    assert max(levels[80][i] for i in friction) < 1.5
    growth = [levels[80][i] / levels[100][i] for i in main if levels[100][i] > 1]
    assert 1.2 < np.median(growth) < 2  # Delta**2 gives 1.56
    assert re.search(
        r"practically unbiased at 2\*pi/4000 .*small variations at 2\*pi/100 .*biased at 2\*pi/80",
        stdout,
    )


def test_motion():
    """Derivatives by central differences at 1 kHz; constant speed on the triangles; inside the
    limits of the robot file.
    """
    path = haptic_motion.motion()
    for x, dx in ((path.q, path.qd), (path.qd, path.qdd)):
        assert np.abs(np.gradient(x, path.t, axis=0) - dx)[1:-1].max() < 1e-4 * np.abs(dx).max()
    slow = path.t < haptic_motion.LOW - haptic_motion.CHANGE
    assert ((np.abs(path.qdd[slow]) == 0).mean(axis=0) > 0.85).all()
    for (_, periods, _), speed in zip(
        haptic_motion.TRIANGLES, np.abs(path.qd[slow]).max(axis=0), strict=True
    ):
        assert speed < 0.3 and periods >= 5
    limits = load_robot("haptic").limits
    low, high = np.array(limits["q"]).T
    assert (path.q >= low).all() and (path.q <= high).all()
    assert (np.abs(path.qd) <= limits["qd"]).all() and (np.abs(path.qdd) <= limits["qdd"]).all()
    elbow = path.q[:, 2] - path.q[:, 1] + np.pi  # the parallelogram is singular at 0 and pi
    assert elbow.min() > 0.3 and elbow.max() < np.pi - 0.3
