"""Closed loops: relations found, counts and formulas of parallelograms and general loops,
certificates, and mechanisms that cannot be.

Counts are those of an SVD of the regressor at random closed states; haptic branch: 21 inertial (Ia
included) and 9 of friction and offsets.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from campaign import campaign

from oracles.same_draw import same_draw
from symgen.certify.certificate import certify_formulas
from symgen.derive import loops
from symgen.derive.loops import close, find_relations
from symgen.description import Robot, load_robot, parse_robot
from symgen.description.expression import ONE
from symgen.description.grammar import parse
from symgen.description.robot import FIXED, Element, Frame
from symgen.errors import DescriptionError
from symgen.regroup.regrouping import BaseParameter, Regrouping, regroup

# chapter, Table 6: the names with an R, fC as FS
TABLE_6_R = {"ZZ1R", "MY1R", "XX2R", "ZZ2R", "MX2R", "FS2R", "XX3R", "ZZ3R", "MX3R", "MX5R", "FS5R"}
TABLE_6_PLAIN = {"FS1", "OFFSET2", "OFFSET5"}
# theory of the branch: what else absorbs others; MX4 only where the constant c of q4 is kept as a
# symbol
ALSO_R = {"XY2R", "XZ2R", "YZ2R", "XY3R", "XZ3R", "YZ3R", "MX4R", "FV2R", "FV5R"}


@cache
def regrouped(name: str) -> Regrouping:
    return regroup(load_robot(name))


def haptic(**changes: str) -> Robot:
    """The haptic branch with other constraints."""
    robot = load_robot("haptic")
    symbols = {*robot.constants, *(f"q{j}" for j in robot.moving)}
    return replace(
        robot, constraints={int(q[1:]): parse(text, symbols) for q, text in changes.items()}
    )


def changed(robot: Robot, j: int, **fields: object) -> Robot:
    """The robot with some entries of one row of the table changed; texts are expressions."""
    symbols = {*robot.constants, f"q{j}"}
    read = {
        key: parse(value, symbols) if isinstance(value, str) else value
        for key, value in fields.items()
    }
    frames = tuple(replace(f, **read) if f.j == j else f for f in robot.frames)  # type: ignore[arg-type]
    return replace(robot, frames=frames, drives=None, limits={})


def rubbed(robot: Robot, joints: tuple[int, ...]) -> Robot:
    """FV and FS on the given joints, nothing else of the file's friction."""
    each = {j: {j: ONE} for j in joints}
    friction = (Element("FV", "viscous", each, {}), Element("FS", "coulomb", each, {}))
    return replace(
        robot,
        elements=(*(e for e in robot.elements if e.kind in ("inertia", "offset")), *friction),
        values={},
    )


def relations(robot: Robot) -> dict[int, str]:
    closure = close(robot)
    found = {}
    for j in robot.passive:
        total = closure.offset[j]
        for i, n in closure.row[j].items():
            total = total + n * parse(f"q{i}", (f"q{i}",))
        found[j] = str(total)
    return found


# --- relations
# ---------------------------------------------------------------------------------------------------------


def test_relations_of_the_haptic_branch() -> None:
    """q3 = q5 - q2 + pi, q6 = q2 - q5, q7 = q3 from the table alone; q4 = c - q5 declared."""
    assert relations(load_robot("haptic")) == {
        3: "pi - q2 + q5",
        4: "c - q5",
        6: "q2 - q5",
        7: "pi - q2 + q5",
    }


def test_relations_of_the_sr400() -> None:
    """The angle between arm and forearm follows motor 7: q3 = pi/2 - q2 + q7, q8 = q2 - q7, q9 = pi
    - q2 + q7.
    """
    assert relations(load_robot("sr400")) == {3: "pi/2 - q2 + q7", 8: "q2 - q7", 9: "pi - q2 + q7"}


def test_declared_relations_that_agree_change_nothing() -> None:
    declared = haptic(q4="c - q5", q3="q5 - q2 - pi", q6="q2 - q5", q7="q3")
    assert {j: text.replace("-pi", "pi") for j, text in relations(declared).items()} == relations(
        load_robot("haptic")
    )


@pytest.mark.parametrize(
    ("name", "tied", "angles"),
    [("four_bar", (2, 3), {4: "-q1 - q2 + q3"}), ("five_bar", (2, 4), {5: "-q1 - q2 + q3 + q4"})],
)
def test_general_loops_have_one_sum_of_angles(
    name: str, tied: tuple[int, ...], angles: dict[int, str]
) -> None:
    """The rest is tied, and they keep the assembly mode of the file: the configuration found is the
    one of `start`.
    """
    robot = load_robot(name)
    closure = close(robot)
    assert closure.tied == tied
    assert {j: text for j, text in relations(robot).items() if j not in tied} == angles
    assert {j: closure.start[j] for j in robot.loops[0].start} == pytest.approx(
        dict(robot.loops[0].start), abs=1e-3
    )


def test_equal_numbers_are_no_parallelogram() -> None:
    """0.2 in place of the symbol D3: closed for these lengths only, so nothing linear is claimed."""
    assert close(changed(load_robot("haptic"), 7, d="0.2")).tied


# --- counts
# ------------------------------------------------------------------------------------------------------------


def test_haptic_base_parameters() -> None:
    found = regrouped("haptic")
    assert (len(found.robot.parameters), len(found)) == (78, 30)
    assert sum(name[:2] not in ("FV", "FS", "OF") for name in found.names) == 21
    assert {name for name in found.names if name.endswith("R")} == TABLE_6_R | ALSO_R
    assert set(found.names) >= TABLE_6_R | TABLE_6_PLAIN


def test_haptic_with_c_a_right_angle() -> None:
    """q4 = -q5 as a number: MX4 absorbs nothing, the other names stay."""
    found = regroup(haptic(q4="-q5"))
    assert len(found) == 30
    assert {name for name in found.names if name.endswith("R")} == TABLE_6_R | ALSO_R - {"MX4R"}


@pytest.mark.parametrize(
    ("what", "robot", "parameters", "count"),
    [
        ("friction of the motors alone", lambda: rubbed(load_robot("haptic"), (1, 2, 5)), 72, 30),
        (
            "joint 4 too, which falls into joint 5",
            lambda: rubbed(load_robot("haptic"), (1, 2, 4, 5)),
            74,
            30,
        ),
        ("joint 3 too", lambda: rubbed(load_robot("haptic"), (1, 2, 3, 5)), 74, 32),
        ("every joint", lambda: rubbed(load_robot("haptic"), (1, 2, 3, 4, 5, 6, 7)), 80, 32),
        (
            "gravity along z1",
            lambda: replace(
                load_robot("haptic"), gravity=(parse("0"), parse("0"), parse("gx", ("gx",)))
            ),
            78,
            28,
        ),
        ("link 4 turning against the arm", lambda: rubbed(haptic(q4="c - q2"), (1, 2, 5)), 72, 36),
        (
            "link 4 turning with q5 - q2",
            lambda: rubbed(haptic(q4="c + q5 - q2"), (1, 2, 5)),
            72,
            36,
        ),
        (
            "SR400, friction of every joint",
            lambda: rubbed(load_robot("sr400"), (1, 2, 3, 4, 5, 6, 7, 8, 9)),
            110,
            62,
        ),
    ],
)
def test_counts_of_variants(what: str, robot, parameters: int, count: int) -> None:
    r = robot()
    assert (len(r.parameters), len(regroup(r))) == (parameters, count), what


def test_sr400_count() -> None:
    """Friction of the actuated joints: 42 inertial and 18."""
    assert (len(load_robot("sr400").parameters), len(regrouped("sr400"))) == (104, 60)


# --- formulas
# ----------------------------------------------------------------------------------------------------------


def test_friction_of_the_haptic_branch() -> None:
    """The pivots at +-qd2 and joint 4 with the pivots at +-qd5 are why fC2 and fC5 carry an R in
    Table 6, and fC1 none.
    """
    formulas = {b.name: str(b.formula) for b in regrouped("haptic").base}
    assert formulas["FS2R"] == "FS2 + FSP2"
    assert formulas["FS5R"] == "FS5 + FS4 + FSP5"
    assert formulas["FS1"] == "FS1"


def test_four_bar() -> None:
    """D_MX3 = (L1**2 D_ZZ1 + L1 D_MX1 + L2**2 D_ZZ2 + L2 D_MX2)/L3 - L3 D_ZZ3, x axes along the
    bars; M2 falls into the crank, M3 has no effect.
    """
    found = regrouped("four_bar")
    assert (len(found.robot.parameters), len(found)) == (34, 11)
    expected = {
        "ZZ1R": "L1**2/L3",
        "MX1R": "L1/L3",
        "ZZ2R": "L2**2/L3",
        "MX2R": "L2/L3",
        "ZZ3R": "-L3",
    }
    assert {
        b.name: str(b.combination["MX3"]) for b in found.base if "MX3" in b.combination
    } == expected
    assert {b.name: str(b.combination["M2"]) for b in found.base if "M2" in b.combination} == {
        "ZZ1R": "L1**2",
        "MX1R": "L1",
    }
    assert "M3" in found.no_effect and "MX3" not in found.own
    k = found.names.index("MX2R")
    wrong = BaseParameter(
        "MX2R", "MX2", {**found.base[k].combination, "MX3": -found.base[k].combination["MX3"]}
    )
    assert certify_formulas(found).valid
    assert not certify_formulas(
        replace(found, base=(*found.base[:k], wrong, *found.base[k + 1 :]))
    ).valid


ON_A_TURRET = """\
symgen: 1
name: turret
gravity: [0, 0, -g]
constants: {L1: 0.2, L2: 0.5, L3: 0.4, L4: 0.45, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: 0, theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: L1, theta: q3, r: 0}
  4: {ant: 1, sigma: 0, mu: 0, alpha: pi/2, d: L4, theta: q4, r: 0}
  5: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: L2, theta: q5, r: 0}
  6: {ant: 4, sigma: 2, alpha: 0, d: L3, theta: 0, r: 0}
loops: [{cut: 5, twin: 6, start: {q2: 1, q3: -0.5518, q4: 1.2956, q5: 0.8475}}]
massless: [3, 4]
"""


def test_column_that_rounding_alone_fills_is_zero() -> None:
    """A right angle is not exact in floats: MZ2 has no effect, and its column is rounding."""
    found = regroup(parse_robot(ON_A_TURRET.encode(), "turret.yaml"))
    assert "MZ2" in found.no_effect
    assert certify_formulas(found).valid


def test_five_bar() -> None:
    """MX4 goes round the loop: both rods and both cranks, with the signs of the closure."""
    found = regrouped("five_bar")
    assert (len(found.robot.parameters), len(found)) == (48, 17)
    expected = {
        "ZZ1R": "L1**2/L4",
        "MX1R": "L1/L4",
        "ZZ2R": "L2**2/L4",
        "MX2R": "L2/L4",
        "ZZ3R": "-L3**2/L4",
        "MX3R": "-L3/L4",
        "ZZ4R": "-L4",
    }
    assert {
        b.name: str(b.combination["MX4"]) for b in found.base if "MX4" in b.combination
    } == expected


EXCAVATOR = b"""
symgen: 1
name: excavator
gravity: [0, 0, -g]
constants: {D2: 0.4, D3: 5.2, D4: 3.0, D7: 0.7, g: 9.81}
frames:
  1: {ant: 0, sigma: 0,        alpha: 0,     d: 0,   theta: q1, r: 0}
  2: {ant: 1, sigma: 0,        alpha: pi/2,  d: D2,  theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: 0,     d: D3,  theta: q3, r: 0}
  4: {ant: 2, sigma: 0, mu: 0, alpha: 0,     d: D4,  theta: q4, r: 0}
  5: {ant: 4, sigma: 1,        alpha: pi/2,  d: 0,   theta: 0,  r: q5}
  6: {ant: 5, sigma: 0, mu: 0, alpha: -pi/2, d: 0,   theta: q6, r: 0}
  7: {ant: 3, sigma: 2,        alpha: 0,     d: -D7, theta: 0,  r: 0}
loops: [{cut: 6, twin: 7, start: {q3: -1.2, q5: 2.0}}]
"""


def test_excavator() -> None:
    """Swing, boom, stick on a jack: the mass of the rod acts at its eye on the stick."""
    found = regroup(parse_robot(EXCAVATOR, "excavator.yaml"))
    expected = {
        "ZZ1R": "D2**2 + D3**2 + D7**2",
        "XX2R": "-D3**2",
        "ZZ2R": "D3**2",
        "MX2R": "D3",
        "XX3R": "-D7**2",
        "ZZ3R": "D7**2",
        "MX3R": "-D7",
    }
    assert {
        b.name: str(b.combination["M5"]) for b in found.base if "M5" in b.combination
    } == expected


# --- certificates
# ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["haptic", pytest.param("sr400", marks=campaign)])
def test_certified_and_every_perturbed_coefficient_caught(name: str) -> None:
    regrouping, once = regrouped(name), same_draw()
    assert certify_formulas(regrouping, sampler=once).valid
    for k, b in enumerate(regrouping.base):
        for parameter, c in b.combination.items():
            if parameter != b.own:
                wrong = BaseParameter(b.name, b.own, {**b.combination, parameter: c * 2})
                doubled = replace(
                    regrouping, base=(*regrouping.base[:k], wrong, *regrouping.base[k + 1 :])
                )
                assert not certify_formulas(doubled, sampler=once).valid, (b.name, parameter)


# --- mechanisms that cannot be
# -----------------------------------------------------------------------------------------


@pytest.fixture
def few_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """What cannot close is given up after few starts: the message is the same, the time a tenth."""
    monkeypatch.setattr(loops, "STARTS", 5)


JACK = b"""
symgen: 1
name: jack
gravity: [0, -g, 0]
constants: {g: 9.81, D2: 0.003, D4: 0.002}
frames:
  1: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: D2, theta: q2, r: 0}
  3: {ant: 2, sigma: 1, mu: 1, alpha: pi/2, d: 0, theta: 0, r: q3}
  4: {ant: 3, sigma: 0, mu: 0, alpha: -pi/2, d: 0, theta: q4, r: 0}
  5: {ant: 1, sigma: 2, mu: 0, alpha: 0, d: D4, theta: 0, r: 0}
loops:
  - {cut: 4, twin: 5}
"""


@campaign
def test_jack_that_fits_no_stroke_drawn_at_random() -> None:
    """A boom of 2 mm on a jack of 1 to 5 mm closes, and is the mechanism that it is in metres."""
    small, large = (
        find_relations(parse_robot(text, "jack.yaml"))
        for text in (JACK, JACK.replace(b"0.00", b""))
    )
    assert small.tied == large.tied and small.row == large.row
    assert 1e-3 <= abs(small.start[3]) <= 5e-3


def test_frames_that_cannot_coincide(few_starts: None) -> None:
    """alpha5 = +pi/2 in Table 5: the two planes are turned against each other."""
    with pytest.raises(
        DescriptionError,
        match=r"frame 7 \(cut\) and frame 8 \(twin\) cannot coincide; their smallest difference is 2 ",
    ):
        close(changed(load_robot("haptic"), 5, alpha="pi/2"))


def test_sides_too_long(few_starts: None) -> None:
    robot = load_robot("four_bar")
    with pytest.raises(
        DescriptionError,
        match=r"frame 4 \(cut\) and frame 5 \(twin\) cannot coincide; their smallest difference is 0\.\d+",
    ):
        close(replace(robot, constants=dict(robot.constants) | {"L0": 1.5}))


def test_twin_must_be_fixed() -> None:
    with pytest.raises(DescriptionError, match="twin frame 8 has sigma 0; expected 2"):
        changed(load_robot("haptic"), 8, sigma=0, theta="q8")


def test_too_many_actuators(few_starts: None) -> None:
    with pytest.raises(
        DescriptionError,
        match=(
            r"mobility is 3, but 4 joints are actuated \(\[1, 2, 3, 5\]\); the mechanism is "
            r"over-constrained"
        ),
    ):
        close(changed(load_robot("haptic"), 3, mu=1))


def test_too_few_actuators() -> None:
    with pytest.raises(
        DescriptionError,
        match=r"mobility is 3, but 2 joints are actuated .* 1 degrees of freedom remain; .* under-constrained",
    ):
        close(changed(load_robot("haptic"), 5, mu=0))


@campaign
def test_over_constrained_mechanism(few_starts: None) -> None:
    """A diagonal bar between arm 2 and crank 5 freezes the parallelogram: it turns as a whole, no
    more.
    """
    robot = load_robot("haptic")
    zero = parse("0")
    bar = Frame(9, 2, 0, 0, zero, zero, zero, parse("0.07"), parse("q9", ("q9",)), zero)
    end = Frame(10, 9, 0, 0, zero, zero, zero, parse("0.1"), parse("q10", ("q10",)), zero)
    twin = Frame(11, 5, FIXED, 0, zero, zero, zero, parse("0.05"), zero, zero)
    loops = (*robot.loops, replace(robot.loops[0], cut=10, twin=11))
    with pytest.raises(DescriptionError, match="mobility is 2, but 3 joints are actuated"):
        close(replace(robot, frames=(*robot.frames, bar, end, twin), loops=loops))


def test_passive_joint_without_relation() -> None:
    with pytest.raises(
        DescriptionError,
        match="passive joint 4 is in no loop, so no equation gives its position; declare q4 under constraints",
    ):
        close(haptic())


@pytest.mark.parametrize("wrong", ["q5 - q2", "q5 + q2 + pi"])
def test_declared_relation_that_contradicts_the_closure(wrong: str, few_starts: None) -> None:
    """Both sides, and how far frames 7 and 8 are apart with the declared one."""
    with pytest.raises(
        DescriptionError,
        match=(
            r"q3: declared .*, the closure gives pi - q2 \+ q5; .* frame 7 \(cut\) and frame 8 "
            r".* are 1\.\d+ apart"
        ),
    ):
        close(haptic(q4="c - q5", q3=wrong))


def test_only_the_wrong_one_is_named(few_starts: None) -> None:
    with pytest.raises(DescriptionError, match="closure; q7: declared") as error:
        close(haptic(q4="c - q5", q3="q5 - q2 + pi", q6="q2 - q5", q7="q3 + pi"))
    assert "q3: declared" not in str(error.value) and "q6: declared" not in str(error.value)


def test_lengths_that_make_a_declared_parallelogram_impossible(few_starts: None) -> None:
    unequal = changed(haptic(q4="c - q5", q3="q5 - q2 + pi"), 7, d="0.25")
    with pytest.raises(
        DescriptionError,
        match=(
            r"q3: declared pi - q2 \+ q5, the closure gives no linear relation \(these lengths "
            r"make no parallelogram\)"
        ),
    ):
        close(unequal)
    with pytest.raises(
        DescriptionError,
        match=(
            r"cannot coincide, with or without the declared relations; their smallest "
            r"difference is 0\.61"
        ),
    ):
        close(changed(unequal, 7, d="0.9"))


def test_parallelogram_is_never_the_crossed_one() -> None:
    """Starts of Newton near the other branch do not change what is found: G is whole and constant."""
    closure = close(load_robot("sr400"))
    assert closure.tied == ()
    assert all(n.constant in (1, -1) for j in (3, 8, 9) for n in closure.row[j].values())
    assert np.isfinite(list(closure.start.values())).all()
