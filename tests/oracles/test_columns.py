"""Columns of the user's own against CasADi: laws written a second time by hand and differentiated
there, every target on random robots, relations that the regrouping has to find, refusals.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from campaign import sampled

import symgen
from oracles.random_robots import random_robot
from symgen.certify.modules import certified_files
from symgen.description.element import KINDS, LawScalar
from symgen.description.expression import ONE
from symgen.description.grammar import LAWS, parse
from symgen.description.robot import Element, Robot
from symgen.description.yaml import parse_robot, write_yaml
from symgen.errors import DescriptionError
from symgen.regroup.regrouping import EXACT, regroup

ARM = """
symgen: 1
name: arm
gravity: [0, 0, -g]
constants: {{g: 9.81, L: 0.4, qs: 0.3}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: pi/2, d: 0, theta: q2, r: 0}}
  3: {{ant: 2, sigma: 1, alpha: pi/2, d: L, theta: 0, r: q3}}
elements:
  FV: {{kind: viscous, along: all}}
  FS: {{kind: coulomb, along: all}}
columns:
{columns}
"""


def arm(columns: str) -> Robot:
    """The arm with columns, one a line."""
    lines = "\n".join(f"  {line.strip()}" for line in columns.strip().splitlines())
    return parse_robot(ARM.format(columns=lines).encode(), "arm.yaml")


q, qd = ca.SX.sym("q", 3), ca.SX.sym("qd", 3)
ENERGIES = {  # of the file, and the same in CasADi
    "SPA": ("2", "sqrt(1.3 - 0.8*cos(q - qs))", ca.sqrt(1.3 - 0.8 * ca.cos(q[1] - 0.3))),
    "SPB": ("3", "exp(-q**2)*sin(q1 + 2*q2)", ca.exp(-(q[2] ** 2)) * ca.sin(q[0] + 2 * q[1])),
    "SPC": (
        "{1: q1 - 2*q2}",
        "tanh(q)/(2 + cos(3*q))",
        ca.tanh(q[0] - 2 * q[1]) / (2 + ca.cos(3 * (q[0] - 2 * q[1]))),
    ),
    "SPD": ("1", "max(q1, q2)**2 + min(q1, 0.3)", None),
}
ENERGIES["SPD"] = (
    *ENERGIES["SPD"][:2],
    ca.fmax(q[0], q[1]) ** 2 + ca.if_else(q[0] < 0.3, q[0], 0.3),
)
TORQUES = {  # along, law, the same in CasADi by joint
    "TA": ("{2: q1 + q2}", "abs(qd)*qd", {0: (0, 1), 1: (0, 1)}),
    "TB": ("3", "tanh(qd/0.2) + q1*qd2**3", {2: None}),
    "TC": ("[1, 2]", "sign(qd)*abs(qd)**1.5", {}),
}


def test_energies_are_differentiated_as_by_casadi() -> None:
    """Torque of joint i is dU/dq_i, of rows and of joints by name; 1e-10 of the largest."""
    robot = arm(
        "\n".join(
            f'{name}: {{along: {along}, energy: "{law}", unit: N*m}}'
            for name, (along, law, _) in ENERGIES.items()
        )
    )
    module = symgen.model(robot)
    states = np.random.default_rng(3).uniform(-1, 1, (60, 3))
    D = module.regressor(states, 0 * states, 0 * states)
    for name, (_, _, U) in ENERGIES.items():
        (column,) = (k for k, b in enumerate(module.BASE_PARAMETERS) if b[:3] == name)
        gradient = ca.Function("g", [q], [ca.gradient(U, q)])
        expected = np.array([gradient(x).full()[:, 0] for x in states])
        assert np.abs(D[:, :, column] - expected).max() < 1e-10 * np.abs(expected).max(), name


def test_torques_of_rates() -> None:
    """Rows along several joints, powers that are not whole, rates of other joints."""
    robot = arm(
        "\n".join(
            f'{name}: {{along: {along}, torque: "{law}", unit: N*m}}'
            for name, (along, law, _) in TORQUES.items()
        )
    )
    module = symgen.model(robot)
    x, xd = np.random.default_rng(4).uniform(-1, 1, (2, 60, 3))
    D = dict(
        zip(module.BASE_PARAMETERS, np.moveaxis(module.regressor(x, xd, 0 * x), 2, 0), strict=True)
    )
    s, zero = xd[:, 0] + xd[:, 1], 0 * x[:, 0]
    expected = {
        "TA2": [np.abs(s) * s, np.abs(s) * s, zero],
        "TB3": [zero, zero, np.tanh(xd[:, 2] / 0.2) + x[:, 0] * xd[:, 1] ** 3],
        "TC1": [np.sign(xd[:, 0]) * np.abs(xd[:, 0]) ** 1.5, zero, zero],
        "TC2": [zero, np.sign(xd[:, 1]) * np.abs(xd[:, 1]) ** 1.5, zero],
    }
    for name, columns in expected.items():
        np.testing.assert_allclose(D[name], np.stack(columns, axis=1), atol=1e-12)


LAWS_DRAWN = (
    ("torque", "tanh(qd/0.3)"),
    ("torque", "sin(7*q) + cos(0.37*q)"),
    ("torque", "exp(-abs(qd))*sign(qd)"),
    ("torque", "max(q, 0.2)*abs(qd)**0.7"),
    ("energy", "sqrt(2 + cos(q))"),
    ("energy", "sin(q)*exp(-q**2/3)"),
    ("energy", "1/(3 + sin(2*q))"),
)


@pytest.mark.parametrize("seed", sampled([1, 4, 9, 16, 25, 36], 0, always=(1, 9)))
def test_every_target_of_random_robots_with_laws(seed: int) -> None:
    """Certificates: each text against energies and laws by CasADi; graph, F_p and printers."""
    robot, rng = random_robot(seed), np.random.default_rng(seed)
    joints = [int(j) for j in rng.choice(robot.moving, 2, replace=False)]
    own = [
        Element(
            f"OW{chr(65 + k)}",
            "column",
            {j: {j: ONE}} if k % 2 else {j: dict.fromkeys(joints, ONE)},
            {},
            unit="N*m",
            **{part: parse(law, None, LAWS)},
        )
        for k, (part, law) in enumerate(LAWS_DRAWN)
        for j in [joints[k % 2]]
    ]
    packaged = [
        Element(f"KP{chr(65 + k)}", kind, {joints[0]: {joints[0]: ONE}}, {})
        for k, kind in enumerate(KINDS)
        if KINDS[kind].fit
    ]
    robot = replace(robot, elements=(*robot.elements, *own, *packaged))
    assert len(certified_files(robot, targets=["numpy", "c"])) == 3


def test_columns_in_the_span_of_others_are_found() -> None:
    """Exactly, with their coefficients: they add to the parameters that have the same torque."""
    robot = arm(
        """
        GR: {along: 2, torque: "g*(cos(q)*cos(q1)**2 + cos(q)*sin(q1)**2)", unit: kg*m}
        AS: {along: 1, torque: "abs(qd)*sign(qd)", unit: N*m*s}
        TH: {along: 1, torque: "3*max(qd, 0)", unit: N*m*s}
        TM: {along: 1, torque: "abs(qd)", unit: N*m*s}
        SQ: {along: 3, torque: "qd*sin(qs)", unit: N*s}
        """
    )
    regrouping = regroup(robot)
    formulas = {b.own: str(b.formula) for b in regrouping.base}
    assert regrouping.method == EXACT
    assert formulas["FV1"] == "FV1 + AS1 + 1.5*TH1" or formulas["FV1"] == "FV1 + AS1 - TM1"
    assert "SQ3" in formulas["FV3"] and "sin(qs)" in formulas["FV3"]
    assert not {"AS1", "SQ3"} & {*formulas}
    module = symgen.model(robot)  # certified with these formulas
    assert len(module.BASE_PARAMETERS) == len(regrouping)


def test_relations_that_only_numbers_show_are_found_and_said() -> None:
    """exp(q) exp(-q) = 1 is no identity of F_p: the offset takes it in, in numbers."""
    robot = arm(
        """
        OFF: {kind: offset, along: 2}
        EX: {along: 2, torque: "exp(q)*exp(-q)", unit: N*m}
        EY: {along: 2, torque: "exp(q)", unit: N*m}
        """
    )
    regrouping = regroup(robot)
    assert "EX" in regrouping.method and "numbers" in regrouping.method
    formulas = {b.own: b.combination for b in regrouping.base}
    assert float(formulas["OFF2"]["EX2"]) == pytest.approx(1.0, abs=1e-9)
    assert "EY2" in formulas and "EX2" not in formulas
    assert symgen.model(robot)


def test_scalars_are_constants_of_the_module() -> None:
    """One of each key, by keyword; a fixed one is a number of the text."""
    robot = arm("STR: {kind: stribeck, along: [1, 3], fit: {vs: {bounds: [0.01, 1]}, delta: 1}}")
    assert {"vs1": 0.1, "vs3": 0.1}.items() <= robot.constants.items()
    module = symgen.model(robot)
    x = np.random.default_rng(1).uniform(-1, 1, (9, 3))
    column = module.BASE_PARAMETERS.index("STR3")
    D = module.regressor(x, x, x, vs3=0.5)[:, 2, column]
    np.testing.assert_allclose(D, np.sign(x[:, 2]) * np.exp(-np.abs(x[:, 2]) / 0.5), rtol=1e-12)
    assert robot.elements[-1].scalars["vs"] == LawScalar((0.01, 1.0))


def test_robots_with_columns_are_written_as_they_are_read() -> None:
    robot = arm(
        """
        SPA: {along: 2, energy: "sqrt(1.3 - 0.8*cos(q - qs))", unit: N*m}
        STR: {kind: stribeck, along: all, fit: {vs: {bounds: [0.01, 1]}}}
        MM: {along: 1, torque: "min(q, 0.2)*tanh(qd)", unit: N*m}
        """
    )
    again = parse_robot(write_yaml(robot).encode(), "arm.yaml")
    assert [e.laws(j) for e in again.elements for j in e.along] == [
        e.laws(j) for e in robot.elements for j in e.along
    ]
    assert again.constants == robot.constants


@pytest.mark.parametrize(
    "column, sentence",
    [
        ("A: {along: 1, torque: tanh(qd/vs), unit: N*m}", "'vs' is unknown in this law"),
        ("A: {along: 1, torque: log(qd), unit: N*m}", "'log' is not a known function"),
        ("A: {along: 1, torque: qd}", "unit"),
        ("A: {along: 1, unit: N*m}", "torque"),
        ("A: {along: 1, torque: qd, energy: q, unit: N*m}", "one of `torque` and `energy`"),
        ("A: {along: 1, energy: qd, unit: N*m}", "positions only"),
        ("A: {along: 1, torque: 1/qd, unit: N*m}", "not finite"),
        ("A: {kind: tanh, along: 1, torque: qd}", "tanh already defines the law"),
        ("A: {along: 9, torque: qd, unit: N*m}", "frame 9 does not exist"),
        ("FV: {along: 1, torque: qd, unit: N*m}", "is already the name of an entry of `elements`"),
        ("A: {kind: tanh, along: 1, fit: {v: 1}}", "has no constant v to fit"),
        ("A: {kind: tanh, along: 1, fit: {vs: {bounds: [1, 2], start: 3}}}", "start 3"),
        ("A: {along: 1, torque: __import__('os'), unit: N*m}", "unexpected"),
    ],
)
def test_refusals_name_the_column(column: str, sentence: str) -> None:
    with pytest.raises(DescriptionError, match=sentence) as error:
        arm(column)
    assert "columns" in str(error.value) or "A" in str(error.value)


def test_cubic() -> None:
    module = symgen.model(arm("CU: {kind: cubic, along: 3}"))
    x = np.random.default_rng(8).uniform(-2, 2, (9, 3))
    D = module.regressor(x, x, x)[..., module.BASE_PARAMETERS.index("CU3")]
    np.testing.assert_allclose(D, np.stack([0 * x[:, 0], 0 * x[:, 0], x[:, 2] ** 3], axis=1))
    assert module.ELEMENTS["CU3"][0] == "dissipative" and module.UNITS["CU3"] == "N*s**3/m**3"
