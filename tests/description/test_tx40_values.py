"""The parameter set of `tx40`: physically consistent, and with the base parameters that Table 2 of
the chapter prints.
"""

from fractions import Fraction

import numpy as np
import pytest

from symgen.description import load_robot

# chapter, Table 2, column Value
TABLE_2 = {
    "ZZ1R": "1.230", "FV1": "8.070", "FS1": "5.780", "MX2R": "2.090", "FV2": "5.550",
    "FS2": "7.540", "XX3R": "0.127", "MX3": "0.045",
    "Ia3": "0.084", "FV3": "2.240", "FS3": "5.860", "Ia4": "0.027", "FV4": "1.130", "FS4": "2.310",
    "OFFSET4": "0.096", "Ia5": "0.053",
    "FV5": "2.010", "FS5": "3.780", "Ia6": "0.014", "FV6": "0.721", "OFFSET6": "0.166",
}  # fmt: skip
NAMES = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")


@pytest.fixture(scope="module")
def values():
    return dict(load_robot("tx40").values)


def test_base_parameters_are_those_of_table_2(values):
    """Eq. (27), typed from the chapter, in exact arithmetic: equal to every printed digit, without
    rounding.
    """
    v = {name: Fraction(repr(x)) for name, x in values.items()}
    d3 = RL4 = Fraction("0.225")
    base = dict(v)
    base["ZZ1R"] = (
        v["Ia1"] + d3**2 * (v["M3"] + v["M4"] + v["M5"] + v["M6"]) + v["YY2"] + v["YY3"] + v["ZZ1"]
    )
    base["MX2R"] = d3 * (v["M3"] + v["M4"] + v["M5"] + v["M6"]) + v["MX2"]
    base["XX3R"] = (
        2 * v["MZ4"] * RL4 + (v["M4"] + v["M5"] + v["M6"]) * RL4**2 + v["XX3"] - v["YY3"] + v["YY4"]
    )
    for name, printed in TABLE_2.items():
        assert base[name] == Fraction(printed), name


def test_complete(values):
    assert len(values) == 86
    assert set(values) == set(load_robot("tx40").parameters)


@pytest.mark.parametrize("j", range(1, 7))
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


def test_masses_and_centres_are_plausible(values):
    masses = [values[f"M{j}"] for j in range(1, 7)]
    assert masses == sorted(masses, reverse=True)
    assert 15 < sum(masses) < 27  # kg; the whole arm, base included, weighs 27
    for j in range(1, 7):
        assert (
            np.linalg.norm([values[f"{name}{j}"] for name in ("MX", "MY", "MZ")]) / values[f"M{j}"]
            < 0.15
        )  # m


def test_actuators_and_friction_dissipate(values):
    """With positive links, A(q) is positive definite if the forms of the actuators are."""
    v = values
    assert min(v[f"Ia{j}"] for j in range(1, 5)) > 0
    assert np.linalg.eigvalsh([[v["Ia5"], v["Ia6"]], [v["Ia6"], v["Ia6"]]]).min() > 0
    assert np.linalg.eigvalsh([[v["FV5"], v["FVM6"]], [v["FVM6"], v["FV6"]]]).min() > 0
    assert v["FVM6"] < min(v["FV5"], v["FV6"])  # what is left of joints 5 and 6 without motor 6
    assert min(v[f"{f}{j}"] for f in ("FV", "FS") for j in range(1, 7)) > 0
    assert v["FSM6"] > 0
