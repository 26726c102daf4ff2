"""Every key of a robot file is written: what `write_yaml` gives reads as the same robot, whatever the
field.
"""

from __future__ import annotations

from dataclasses import MISSING, fields, replace

import pytest

import symgen
from symgen.description import load_robot, packaged_robots, parse_robot
from symgen.description.element import Element
from symgen.description.parts import Drives, Frame, Loop
from symgen.description.robot import Robot
from symgen.description.yaml import write_yaml

READ_FROM_OTHERS = (
    "angles",
    "impossible",
    "bodies",
    "not_read",
    "mounts",
    "of_base",
    "distal",
    "file",
    "sha256",
)  # of the file that was read, no keys of it
EVERY_KEY = b"""\
symgen: 1
name: every_key
title: 'A "title": with signs'
source: where it comes from
base: moving
gravity: [gx, gy, 0]
constants: {D3: 0.2, D4: 0.22, D6: 0.1, c: 0.1, gx: -9.81, gy: 0}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0.3}
  2: {ant: 1, sigma: 0, gamma: pi/2, b: 0.05, alpha: -pi/2, d: 0, theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: D3, theta: q3, r: 0}
  4: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: D4, theta: q4, r: 0}
  5: {ant: 1, sigma: 0, gamma: pi/2, b: 0.05, alpha: -pi/2, d: 0, theta: q5, r: 0}
  6: {ant: 5, sigma: 0, mu: 0, alpha: 0, d: D6, theta: q6, r: 0}
  7: {ant: 6, sigma: 0, mu: 0, alpha: 0, d: D3, theta: q7, r: 0}
  8: {ant: 3, sigma: 2, alpha: 0, d: -D6, theta: 0, r: 0}
loops:
  - {cut: 7, twin: 8, start: {q3: 3.1}}
constraints: {q4: c - q5}
massless: [4]
columns:
  Ia: {kind: inertia, along: all}
  FV: {kind: viscous, along: {1: q1, 2: q2 + 2*q5}}
  FVM: {kind: viscous, form: {5: 2*q2*q5}}
  FSP: {kind: coulomb, along: 1, when: positive}
  STR: {kind: stribeck, along: 2, fit: {vs: {bounds: [0.01, 1], start: 0.1, grid: 5}}}
  SPR: {along: 5, energy: 1 - cos(q), unit: N*m}
  DMP: {along: 1, torque: qd*abs(qd), unit: N*m*s**2/rad**2}
drives: {ratio: [[10, 0, 0], [0, 10, 0], [0, 1, 10]], offset: [0, pi/2, 0], torque_constant: [1, 2, 3]}
limits: {q: [1, [-1.7, 0.1], [-3.2, -1.5]], qd: [6, 6, 6], qdd: [60, 60, 60], tau: [1, 2, 3]}
values: {M1: 1.5, ZZ1: 0.01}
assume: {XY1: 0, link 2: symmetric xz}
labels: {1: 'shoulder: pan', 2: yes}
"""


def written_again(robot: Robot) -> Robot:
    return parse_robot(write_yaml(robot).encode(), "again.yaml")


def test_every_field_is_given_here() -> None:
    """A field that this robot leaves at its default would pass unseen below."""
    robot = parse_robot(EVERY_KEY, "every_key.yaml")
    for kind, holders in (
        (Robot, [robot]),
        (Frame, robot.frames),
        (Loop, robot.loops),
        (Drives, [robot.drives]),
        (Element, robot.elements),
    ):
        for f in fields(kind):
            if f.name not in READ_FROM_OTHERS:
                default = f.default if f.default is not MISSING else None
                given = [getattr(holder, f.name) for holder in holders]
                assert any(x and x != default for x in given), (kind.__name__, f.name)


@pytest.mark.parametrize("name", [f.name for f in fields(Robot) if f.name not in READ_FROM_OTHERS])
def test_every_field_is_written(name: str) -> None:
    robot = parse_robot(EVERY_KEY, "every_key.yaml")
    assert getattr(written_again(robot), name) == getattr(robot, name)


@pytest.mark.parametrize("name", packaged_robots())
def test_packaged_robots_are_written(name: str) -> None:
    robot = load_robot(name)
    again = written_again(robot)
    for f in fields(Robot):
        if f.name not in READ_FROM_OTHERS:
            assert getattr(again, f.name) == getattr(robot, f.name), f.name


def test_limits_as_numbers_are_to_either_side() -> None:
    """A robot made in Python: its limits in the module, the page, the URDF and the file."""
    from symgen.description.urdf import write_urdf
    from symgen.pages.page import robot_page

    robot = replace(load_robot("planar_2r"), limits={"q": (1.5, (-0.5, 2)), "qd": (3.0, 3.0)})
    assert robot.limits["q"] == ((-1.5, 1.5), (-0.5, 2.0)) == written_again(robot).limits["q"]
    assert symgen.model(robot).LIMITS["q"] == robot.limits["q"]
    assert 'lower="-1.5" upper="1.5"' in write_urdf(robot)[0]
    assert robot_page(symgen.regrouping(robot)).count('"low":-1.5') == 1
