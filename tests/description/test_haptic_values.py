"""The parameter set of `haptic`: physically consistent, and with the base parameters that Table 6
of the chapter prints.
"""

from fractions import Fraction

import numpy as np
import pytest

from symgen.description import load_robot
from symgen.regroup.regrouping import regroup

# chapter, Table 6, column LS Identified Value; fC = FS
TABLE_6 = {
    "ZZ1R": "0.051", "MY1R": "0.024", "FS1": "0.12", "XX2R": "-0.023", "ZZ2R": "0.029",
    "MX2R": "-0.019", "FS2R": "0.11", "OFFSET2": "0.020",
    "XX3R": "-0.011", "ZZ3R": "0.014", "MX3R": "0.039", "MX5R": "0.068", "FS5R": "0.11",
    "OFFSET5": "0.030",
}  # fmt: skip
NAMES = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
LINKS = range(1, 7)


@pytest.fixture(scope="module")
def robot():
    return load_robot("haptic")


@pytest.fixture(scope="module")
def values(robot):
    return dict(robot.values)


@pytest.fixture(scope="module")
def base(robot, values):
    """All 30, in exact arithmetic: the formulas of the engine at c = 0 (cos 1, sin 0)."""
    exact = {name: Fraction(repr(x)) for name, x in values.items()}
    constants = {name: Fraction(repr(x)) for name, x in robot.constants.items()}
    assert constants["c"] == 0
    return {
        b.name: sum(
            Fraction(round(coefficient.value(robot.constants) * 10**9), 10**9) * exact[name]
            for name, coefficient in b.combination.items()
        )
        for b in regroup(robot).base
    }


def test_base_parameters_are_those_of_table_6(base):
    """Equal to every printed digit, without rounding: coefficients have at most four decimals."""
    for name, printed in TABLE_6.items():
        assert base[name] == Fraction(printed), name


def test_what_table_6_leaves_out_is_small(base):
    """Below 1e-4 N m of gravity torque, and friction below 1e-3 N m at 4 rad/s: less than a
    hundredth of FS1.
    """
    assert len(base) == 30
    limit = {"FV": 2.01e-4, "OF": 2e-4}
    for name in base.keys() - TABLE_6.keys():
        assert abs(base[name]) <= limit.get(name[:2], 1.3e-5), name


def test_complete(robot, values):
    assert len(values) == 78
    assert set(values) == set(robot.parameters)


@pytest.mark.parametrize("j", LINKS)
def test_pseudo_inertia_is_positive_definite(values, j):
    """P = [[tr(I)/2 1 - I, l], [l', M]]; the margin is that of P scaled to a unit diagonal, free of
    units.
    """
    XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = (values[f"{name}{j}"] for name in NAMES)
    tensor = np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])
    P = np.empty((4, 4))
    P[:3, :3] = np.trace(tensor) / 2 * np.eye(3) - tensor
    P[:3, 3] = P[3, :3] = MX, MY, MZ
    P[3, 3] = M
    scale = np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > 0.02


def test_plausible(values):
    """A desk-top device: masses in kg, centres of mass in m; friction and actuators dissipate and
    store.
    """
    assert 3 < sum(values[f"M{j}"] for j in LINKS) < 5
    for j in LINKS:
        assert (
            np.linalg.norm([values[f"{name}{j}"] for name in ("MX", "MY", "MZ")]) / values[f"M{j}"]
            < 0.15
        )
    assert min(values[f"Ia{j}"] for j in (1, 2, 5)) > 0
    assert min(x for name, x in values.items() if name[:2] in ("FV", "FS")) > 0
