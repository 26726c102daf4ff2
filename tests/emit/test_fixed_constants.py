"""A module whose coefficients are numbers of the file answers at no other constants: in no target
does a function take one.
"""

from __future__ import annotations

import inspect
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from oracles.loop_robots import BENNETT
from oracles.test_random_loops import module_of
from symgen.certify.modules import certify
from symgen.description import load_robot, parse_robot
from symgen.emit.generate import generate_files, generate_module
from symgen.regroup.regrouping import EXACT, NUMERIC, regroup


def test_spatial_loop(tmp_path: Path) -> None:
    """By keyword, at another angle, it was up to 11 % off and said nothing."""
    robot = parse_robot(BENNETT.encode(), "bennett.yaml")
    regrouping = regroup(robot)
    assert regrouping.method.startswith(NUMERIC) and regrouping.constants == {}
    text = generate_module(robot)
    assert certify(regrouping, {"bennett.py": text}).valid
    module = module_of(text, tmp_path)
    assert module.CONSTANTS == {} and (module.a, module.AA, module.BB) == (0.3, 0.6, 1.1)
    for function in (module.base_parameters, module.regressor, module.passive_joints):
        assert "AA" not in inspect.signature(function).parameters
    with pytest.raises(TypeError, match="AA"):
        module.regressor(*np.zeros((3, 1)) + 1.0, AA=0.7)


def test_every_target() -> None:
    """Each text of a tree whose formulas are said to be numbers is that of its values, and agrees
    with CasADi there.
    """
    robot = load_robot("scara")
    exact = regroup(robot)
    assert exact.method == EXACT and exact.constants == robot.constants != {}
    numeric = replace(exact, method=NUMERIC)
    texts = generate_files(robot, targets=("numpy", "casadi", "c", "xp"), regrouping=numeric)
    assert texts.keys() == {"scara.py", "scara.c", "scara.h"}
    del texts["scara.h"]  # it names no constant
    certificate = certify(numeric, texts)
    assert certificate.valid, str(certificate)
    for file, text in texts.items():
        for name, x in robot.constants.items():
            assert f"{name}: float" not in text and f"{name} = {x!r}" in text, file
