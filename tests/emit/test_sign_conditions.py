"""Frictions of dependent directions are one parameter, for the sign that their ratio has in the
robot file.
"""

from __future__ import annotations

import numpy as np
import pytest

import runtime
import symgen

MIMIC = """
symgen: 1
name: mimic
gravity: [0, 0, -g]
constants: {{KR: {KR}, g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 1, mu: 0, alpha: 0, d: 0.1, theta: 0, r: q2}}
constraints: {{q2: KR*q1}}
elements:
  FV: {{kind: viscous, along: {{1: q1, 2: q2}}}}
  FS: {{kind: coulomb, along: {{1: q1, 2: q2}}}}
"""


@pytest.mark.parametrize(("KR", "formula"), [(0.5, "FS1 + KR*FS2"), (-0.5, "FS1 - KR*FS2")])
def test_friction_of_a_mimic_joint_is_regrouped(KR: float, formula: str) -> None:
    robot = symgen.parse_robot(MIMIC.format(KR=KR).encode(), "mimic.yaml")
    found = symgen.regrouping(robot)
    assert symgen.certificate(found).valid
    assert {b.name: str(b.formula) for b in found.base}["FS1R"] == formula
    model = runtime.load_model(symgen.model(robot))
    chi = np.arange(1.0, len(model.STANDARD_PARAMETERS) + 1)
    assert np.isfinite(model.base_parameters(chi, KR=KR / 2)).all()
    with pytest.raises(
        ValueError, match=rf"FS1R holds where KR is {'positive' if KR > 0 else 'negative'}"
    ):
        model.base_parameters(chi, KR=-KR)
    function = symgen.model(robot).casadi("base_parameters")
    k = model.BASE_PARAMETERS.index("FS1R")
    for value in (KR / 2, KR, -KR):
        X = np.asarray(function(standard=chi, KR=value)["X"]).ravel()
        assert np.isnan(X[k]) == (value == -KR) and np.isfinite(np.delete(X, k)).all()
