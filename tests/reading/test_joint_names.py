"""Names of joints, from a URDF to columns, tables, JSON and the page of a report; symbols in
formulas stay q1, q2.
"""

import json

import numpy as np
from campaign import campaign

import runtime
import symgen
from oracles.urdf_robots import joint, link, robot
from symgen.description import parse_robot
from symgen.description.files import write_robot

NAMES = ("shoulder_$pan", "elbow <2> $é")  # as files may have them


def arm(folder):
    """A URDF of two joints with these names, and its model."""
    parts = [
        link("base"),
        joint(NAMES[0], "revolute", "base", "a", "0 0 0.1", axis="0 1 0"),
        link("a", 3.0, "0.1 0 0.02"),
    ]
    parts += [
        joint(NAMES[1].replace("<", "&lt;"), "revolute", "a", "b", "0.4 0 0", axis="0 1 0"),
        link("b", 1.0, "0.1 0 0"),
    ]
    (folder / "arm.urdf").write_text(robot("arm", *parts), encoding="utf-8")
    return symgen.model(folder / "arm.urdf")


def identified(folder):
    """What a record with these names as columns gives."""
    model = arm(folder)
    t = np.arange(1500)[:, None] / 200
    w = 2 * np.pi * np.array([[0.3, 0.4], [0.9, 1.1]])[:, None]
    q, qd, qdd = np.sin(w * t).sum(0), (w * np.cos(w * t)).sum(0), (-(w**2) * np.sin(w * t)).sum(0)
    tau = model.inverse_dynamics(
        q, qd, qdd, model.base_parameters(model.VALUES)
    ) + 0.02 * np.random.default_rng(0).standard_normal(q.shape)
    header = ",".join(
        ["time", *(f"{name}.pos" for name in NAMES), *(f"tau_{name}" for name in NAMES)]
    )
    np.savetxt(
        folder / "log.csv",
        np.column_stack([t, q, tau]),
        delimiter=",",
        header=header,
        comments="",
        encoding="utf-8",
    )
    study = runtime.Study(
        record={"files": str(folder / "log.csv"), "columns": {"t": "time", "q": "names"}}
    )
    return model, runtime.identify(
        model, runtime.read_record(study.record[0], model), study, friction=True
    )


def test_names_of_a_urdf_reach_every_result(tmp_path):
    model, result = identified(tmp_path)
    assert tuple(model.LABELS.values()) == NAMES
    text, _ = write_robot(symgen.load_robot(tmp_path / "arm.urdf"), "arm.yaml")
    assert dict(parse_robot(text.encode(), "arm.yaml").labels) == model.LABELS
    said, told = f"1 {NAMES[0]}", f"2 {NAMES[1]}"
    assert [joint.joint for joint in result.estimate.per_joint] == [
        said,
        told,
    ] and f"\n{told} " in result.to_text()
    written = json.loads(result.to_json())
    assert written["per_joint"][1]["joint"] == told and written["provenance"]["labels"] == {
        "q1": NAMES[0],
        "q2": NAMES[1],
    }
    assert [curve.joint for curve in result.part("friction").curves] == [said, told]


@campaign
def test_names_are_shown_as_they_are_on_a_page(tmp_path):
    runtime.report(identified(tmp_path)[1], tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "elbow &lt;2&gt; $é" in page and "elbow <2>" not in page and "FV2" in page
