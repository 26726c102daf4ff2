"""Names of files that are no UTF-8, which Linux allows and old archives hold."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign
from typer.testing import CliRunner

import symgen
from symgen.cli.main import app

NAME = b"caf\xe9.csv"  # Latin-1


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
@campaign
def test_a_record_with_a_latin_1_name(tmp_path: Path) -> None:
    """Every result is written, and study.yaml finds the file again: it had ended in a
    UnicodeEncodeError after the whole identification.
    """
    model, t = symgen.model("planar_2r"), np.arange(2000) / 500
    q = np.stack([np.sin(3 * t) + 0.4 * np.sin(8 * t), np.sin(4 * t) + np.cos(7 * t)], axis=1)
    qd = np.gradient(q, t, axis=0)
    X = np.linspace(1.0, 2.0, len(model.BASE_PARAMETERS))
    tau = model.inverse_dynamics(q, qd, np.gradient(qd, t, axis=0), X)
    tau += 0.05 * np.random.default_rng(1).standard_normal(tau.shape)
    file = os.fsdecode(os.fsencode(tmp_path) + b"/" + NAME)
    np.savetxt(
        file, np.column_stack([t, q, tau]), delimiter=",", header="t,q1,q2,tau1,tau2", comments=""
    )
    run = CliRunner().invoke
    done = run(app, ["identify", "planar_2r", file, "-o", str(tmp_path / "out")])
    assert done.exit_code == 1, done.output[-2000:]  # a No: five times the torques of the file
    text = (tmp_path / "out" / "estimate.json").read_text(encoding="utf-8")
    assert list(json.loads(text)["provenance"]["files"]) == [os.fsdecode(NAME)]
    again = run(app, ["identify", "planar_2r", str(tmp_path / "out" / "study.yaml"), "--json"])
    assert again.exit_code == 1 and json.loads(again.stdout)["X"] == json.loads(text)["X"]
