"""An Extra and its Part, added from outside the package as one line of a list: printed, checked, exported and reported through the command line."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import pytest
from features import arm, record
from typer.testing import CliRunner

from runtime import compose
from runtime.core.identify import Identification, OnRequest
from runtime.ground.check import Check
from runtime.ground.errors import InputError
from runtime.ground.part import Figure, Part
from runtime.ground.table import Table
from symgen.cli.main import app


@dataclass(frozen=True)
class Energy(Part):
    """Work of each joint over the rows, J."""

    joints: tuple[str, ...]
    work: tuple[float, ...]

    name = "energy"
    title = "Work of the joints"

    def text(self):
        return f"The record puts {sum(self.work):.3g} J into the robot."

    def tables(self):
        rows = [(j, f"{w:.3g}") for j, w in zip(self.joints, self.work, strict=True)]
        return [Table("Work by joint", ("joint", "work, J"), rows)]

    def figures(self):
        def bars(ax):
            ax.bar(self.joints, self.work)
            ax.set(xlabel="joint", ylabel="work, J")

        return [Figure("Work by joint", "Bars of the work of every joint", [bars], name="energy")]

    def checks(self):
        return [Check("Is the robot a toy?", "doubtful", "It does little work", "", "play on")]

    def summary(self):
        return {"joints": self.joints, "work": self.work}


def energy(result: Identification) -> Energy:
    observation = result.observation
    n = observation.n
    work = [float(np.abs(observation.Y[observation.joint(j)]).mean()) for j in range(n)]
    return Energy(tuple(joint.joint for joint in result.estimate.per_joint), tuple(work))


@pytest.fixture
def log(tmp_path):
    """A CSV file of the planar arm of the package."""
    import symgen

    model = symgen.model("planar_2r")
    one = record(arm(), 0)
    qd = np.gradient(one.q, one.t, axis=0)
    qdd = np.gradient(qd, one.t, axis=0)
    tau = model.inverse_dynamics(one.q, qd, qdd, model.base_parameters(model.VALUES))
    path = tmp_path / "log.csv"
    table = np.column_stack([one.t, one.q, tau])
    np.savetxt(path, table, "%.12g", ",", header="t,q1,q2,tau1,tau2", comments="")
    (tmp_path / "study.yaml").write_text(
        "symgen: 1\nrecord: {files: log.csv, columns: {t: t, q: [q1, q2], tau: [tau1, tau2]}}\n"
    )
    return path


def ran(folder, *words):
    """What the verb prints, and the results."""
    path = folder / "study.yaml"
    words = [words[0], "planar_2r", path, "-o", folder / "out", *words[1:]]
    return CliRunner().invoke(app, [str(word) for word in words]), folder / "out"


def test_an_extra_is_one_line_of_a_list(tmp_path, log, monkeypatch):
    monkeypatch.setattr(compose, "EXTRAS", [*compose.EXTRAS, energy])
    done, out = ran(tmp_path, "identify", "--no-plausible", "--verbose")
    assert done.exit_code == 0, done.output
    printed = done.stdout
    assert "J into the robot." in printed and "work, J" in printed
    assert "Biggest doubt: Is the robot a toy? It does little work." in printed
    assert "Next: play on." in printed
    results = json.loads((out / "estimate.json").read_text())
    assert results["energy"]["joints"] == ["1", "2"]
    assert "Is the robot a toy?" in [c["question"] for c in results["checklist"]["checks"]]
    page = (out / "report.html").read_text()
    assert "Work of the joints" in page and "Work by joint" in page and "work, J" in page
    assert "Bars of the work of every joint" in page
    assert (out / "energy.png").read_bytes()[:4] == b"\x89PNG"


def test_an_extra_on_request_that_cannot_be_made_is_named(tmp_path, log, monkeypatch):
    """`symgen report` asks for all of them, `symgen identify` for none that it has no option of."""

    def refused(result: Identification) -> Energy:
        raise InputError("the toy is broken")

    asked = OnRequest("energy", "work of the joints", refused, otherwise=energy)
    monkeypatch.setattr(compose, "EXTRAS", [asked])
    done, out = ran(tmp_path, "report")
    assert done.exit_code == 0, done.output
    assert "not done: work of the joints: the toy is broken" in done.output
    page = (out / "report.html").read_text()
    assert "Not done" in page and "the toy is broken" in page and "Work of the joints" in page
