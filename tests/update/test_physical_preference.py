"""Where the nearest numbers are no physical robot, the physical ones are found in the same order of
preference: rotors first, then links; masses and numbers without effect stay.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign

import runtime
import symgen
from oracles.applying import exact, motion, other_values, torques_of
from symgen.description.files import read_robot
from symgen.update import nearest as of_update

DATA = os.environ.get("SYMGEN_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data"
CASES = Path(DATA).parent / "cases5"
ARM = """\
<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.1 0 -0.02" rpy="0.1 -0.2 0.3"/><mass value="2.5"/>
  <inertia ixx="0.03" ixy="0" ixz="1e-3" iyy="0.05" iyz="0" izz="0.04"/></inertial></link>
<link name="fore"><inertial><mass value="2"/>
  <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="3" effort="90"/></joint>
<joint name="j2" type="revolute"><parent link="upper"/><child link="fore"/>
  <origin xyz="0.4 0 0.05" rpy="0.3 0 0"/><axis xyz="0.2 1 0"/>
  <limit lower="-2" upper="2" velocity="3" effort="30"/></joint>
</robot>
"""


def require_torques(applied, path: Path, model, X: np.ndarray) -> None:
    """Pinocchio computes the torques of X from the written file and what has no place in it."""
    states = motion(len(model.JOINTS), 2, 0.4, 10)[1:]
    ours = model.inverse_dynamics(*states, X)
    theirs = torques_of(applied.write(path), model, states, dict(applied.placeless), {})
    assert np.abs(theirs - ours).max() < 1e-9 * np.abs(ours).max()


@pytest.mark.parametrize("seed", [1, 3])
def test_rotor_inertia_stays_out_of_links_that_are_not_physical(
    seed, tmp_path, monkeypatch
) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    model = symgen.model(path)
    estimate = exact(model, other_values(model, seed) | {"Ia1": 1.2, "Ia2": 0.3})
    used = []
    physical = of_update._physical
    monkeypatch.setattr(of_update, "_physical", lambda *args: used.append(args) or physical(*args))
    applied = symgen.apply(estimate, path)
    assert used  # the links of `_solve` are not physical
    assert applied.placeless["Ia1"] == pytest.approx(1.2, rel=0.1)
    assert applied.placeless["Ia2"] == pytest.approx(0.3, rel=0.01)
    assert "link 'upper': mass" in applied.undetermined
    assert not [c for c in applied.changes if c.told_by == "file"]
    require_torques(applied, tmp_path / "new.urdf", model, estimate.X)


def test_every_rotor_is_printed(tmp_path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    model = symgen.model(path)
    applied = symgen.apply(exact(model, dict(model.VALUES) | {"Ia2": 0.3}), path)
    assert applied.placeless == pytest.approx({"Ia1": 0.0, "Ia2": 0.3}, abs=1e-12)
    assert "Ia1 = 0 kg*m**2 (j1), determined only in sums\n" in str(applied)
    assert "Ia2 = 0.3000 kg*m**2 (j2), sigma 0.0010\n" in str(applied)


@campaign
@pytest.mark.parametrize(("window", "near"), [(1, 0.5), (5, 0.25)])
def test_identified_arm_with_heavy_rotors(window, near, tmp_path) -> None:
    """Rotors of 1.2 and 1.4 kg m^2, and links unlike those of the file.

    The record tells Ia1 within some 0.8 kg m^2, by the median filter of the torques too.
    """
    path = CASES / "apply_rotors" / "lab6.urdf"
    if not path.exists():
        pytest.skip("needs the shared cases")
    model = symgen.model(path)
    log = path.parent / "log.yaml"
    study = runtime.load_study(log)
    study = replace(study, signals=replace(study.signals, torque_median=window))
    result = runtime.identify(model, runtime.read_record(log, model), study)
    applied = symgen.apply(result, path)
    assert applied.placeless["Ia1"] == pytest.approx(1.2, rel=near)
    assert applied.placeless["Ia2"] == pytest.approx(1.4, rel=0.05)
    out = applied.write(tmp_path / "new.urdf")
    ours, true = (read_robot(x)[0] for x in (out, path.parent / "truth.urdf"))
    for name in ("XX2", "YY2", "ZZ2"):
        assert 0.5 < ours.values[name] / true.values[name] < 2
    require_torques(applied, out, model, result.whole_estimate.X)
