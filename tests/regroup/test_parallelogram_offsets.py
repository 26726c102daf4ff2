"""Constants of linear relations: q2 = c - q1 with c a sum of many fixed angles or lengths."""

from __future__ import annotations

import pytest

from symgen.derive.closure import Closure
from symgen.derive.loops import close
from symgen.description import Robot, parse_robot


def robot(constants: str, frames: str, cut: int, twin: int) -> Robot:
    text = (
        f"symgen: 1\nname: linkage\ngravity: [0, -g, 0]\nconstants: {{{constants}, g: 9.81}}\n"
        f"frames:\n{frames}loops: [{{cut: {cut}, twin: {twin}}}]\n"
    )
    return parse_robot(text.encode(), "linkage.yaml")


def parallelogram(constants: str, **angle: str) -> Closure:
    """Arm 1, coupler 2, rocker 3, pin 4 on the twin 5 of the coupler; `angle` beside theta1 to
    theta4, and gamma of the base and of the twin.
    """
    theta = [f"q{j} + {angle[f'theta{j}']}" if f"theta{j}" in angle else f"q{j}" for j in range(5)]
    base = angle.get("base", "0")
    frames = f"""\
  1: {{ant: 0, sigma: 0, gamma: {base}, alpha: 0, d: 0, theta: {theta[1]}, r: 0}}
  2: {{ant: 1, sigma: 0, mu: 0, alpha: 0, d: L, theta: {theta[2]}, r: 0}}
  3: {{ant: 0, sigma: 0, mu: 0, gamma: {base}, alpha: 0, d: K, theta: {theta[3]}, r: 0}}
  4: {{ant: 3, sigma: 0, mu: 0, alpha: 0, d: L, theta: {theta[4]}, r: 0}}
  5: {{ant: 2, sigma: 2, gamma: {angle.get("twin", "0")}, alpha: 0, d: K, theta: 0, r: 0}}
"""
    return close(robot(f"L: 0.5, K: 0.2, {constants}", frames, 4, 5))


def formulas(closure: Closure) -> dict[int, str]:
    return {j: str(closure.formula(j)) for j in closure.robot.passive}


def test_five_fixed_angles() -> None:
    """The coupler stays parallel to the ground: theta1 + theta2 + twin = 0."""
    closure = parallelogram(
        "TA: 0.31, TB: 0.17, TC: -0.23, TD: 0.41, TE: 0.53",
        **{f"theta{j}": f"T{'ABCD'[j - 1]}" for j in (1, 2, 3, 4)},
        twin="TE",
    )
    assert closure.tied == ()
    assert formulas(closure) == {
        2: "-TA - TB - TE - q1",
        3: "TA - TC + q1",
        4: "-TA - TD - q1",
    }


@pytest.mark.parametrize(("TA", "TB"), [("TA", "TB"), ("TB", "TA")])
def test_constants_of_equal_value(TA: str, TB: str) -> None:
    """The one of two equal constants that stands beside the joint, whichever comes first."""
    closure = parallelogram("TA: 0.3, TB: 0.3", theta1=TA, theta2=TA, theta3=TB, theta4=TA)
    assert formulas(closure)[3] == f"{TA} - {TB} + q1".replace("TB - TA", "-TA + TB")
    closure = parallelogram("TA: 0.3, TB: 0.3", base=TA, twin=TB)
    assert formulas(closure) == {2: f"-{TB} - q1", 3: "q1", 4: "-q1"}


def test_an_angle_that_is_zero_in_the_file() -> None:
    assert formulas(parallelogram("TA: 0, TB: 0.4", twin="TA", theta1="TB")) == {
        2: "-TA - TB - q1",
        3: "TB + q1",
        4: "-TB - q1",
    }


def test_angles_that_are_numbers() -> None:
    closure = parallelogram("TA: 0.4", theta1="0.25", theta2="pi/5", twin="1.1", theta4="2*TA")
    assert formulas(closure) == {
        2: "-0.2*pi - q1 - 1.35",
        3: "q1 + 0.25",
        4: "-2*TA - q1 - 0.25",
    }


def test_sum_of_five_lengths() -> None:
    """Two slides along one line: q2 + LB + LE = q1 + LA + LC + LD."""
    frames = """\
  1: {ant: 0, sigma: 1, alpha: 0, d: 0, theta: 0, r: q1 + LA}
  2: {ant: 0, sigma: 1, mu: 0, alpha: 0, d: K, theta: 0, r: q2 + LB}
  3: {ant: 1, sigma: 2, b: LC, alpha: 0, d: K, theta: 0, r: LD}
  4: {ant: 2, sigma: 0, mu: 0, b: LE, alpha: 0, d: 0, theta: q4, r: 0}
"""
    closure = close(robot("LA: 0.1, LB: 0.23, LC: 0.37, LD: 0.41, LE: 0.59, K: 0.2", frames, 4, 3))
    assert closure.tied == ()
    assert formulas(closure) == {2: "LA - LB + LC + LD - LE + q1", 4: "0"}


def test_a_length_without_a_value_beside_the_file() -> None:
    """sqrt(1 - C) at C = 1 - 1e-9 has none at constants a little larger."""
    frames = """\
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1 + TA, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: L, theta: q2, r: 0}
  3: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: 0.2 + sqrt(1 - C), theta: q3, r: 0}
  4: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: L, theta: q4, r: 0}
  5: {ant: 2, sigma: 2, gamma: TB, alpha: 0, d: 0.2 + sqrt(1 - C), theta: 0, r: 0}
"""
    closure = close(robot("L: 0.5, C: 0.999999999, TA: 0.3, TB: 0.4", frames, 4, 5))
    assert formulas(closure) == {2: "-TA - TB - q1", 3: "TA + q1", 4: "-TA - q1"}
