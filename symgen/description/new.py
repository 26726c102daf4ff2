"""Template of a robot file, from which a user starts the description of a new robot."""

from __future__ import annotations

from pathlib import Path

from symgen.description.naming import check_identifier
from symgen.description.schema import SCHEMA
from symgen.errors import DescriptionError

EDITORS = """\
# yaml-language-server: $schema=robot.schema.json
# Editors complete and check this file once you run: symgen schema > robot.schema.json
"""

_SKELETON = """\
# {name}: a robot file. Replace the two joints below by yours; what follows `frames` may go.
symgen: {schema}                          # version of this format
name: {name}
title: Two revolute joints in a vertical plane
source: where the table below comes from
gravity: [0, -g, 0]                # acceleration of gravity in frame 0, m/s^2: here y0 is up
constants: {{D2: 0.5, g: 9.81}}      # SI and rad; they stay symbols in all formulas

# One row per frame, modified Denavit-Hartenberg (Khalil and Kleinfinger 1986), from `ant` to j:
#     Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)
# gamma and b are 0 if left out. With `convention: distal`, classic Denavit-Hartenberg instead:
#     Rot(z, theta) Trans(z, r) Trans(x, d) Rot(x, alpha)
# sigma: 0 revolute (theta: q1, or q1 + constant), 1 prismatic (r: q1), 2 fixed.
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0,  theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}}

# What acts on the joints besides the links. kind: inertia, viscous, coulomb, offset or stiffness.
# along: all, or {{2: q1 + q2}} for a motor that turns with two joints; viscous and coulomb also
# take `when: positive` or `negative`.
elements:
  Ia:     {{kind: inertia, along: all}}
  FV:     {{kind: viscous, along: all}}
  FS:     {{kind: coulomb, along: all}}
  OFFSET: {{kind: offset,  along: all}}

# Motors to joints, for measured records:
# qm = ratio (q - offset), tau = ratio' (torque_constant * u).
# drives: {{ratio: [[100, 0], [0, 100]], offset: [0, 0], torque_constant: [1, 1]}}

# For exciting trajectories: q as [lower, upper] or one number for +-; qd, qdd, tau: largest values.
# SI, of the joint: a motor of 3000 rpm behind a ratio of 100 allows 3000*2*pi/60/100 rad/s.
# limits: {{q: [pi, [-pi/2, pi/2]], qd: [3, 3], qdd: [10, 10], tau: [50, 20]}}

# Standard parameters you know, for simulation; inertia about the origin of the link frame.
# values: {{M1: 2.0, MX1: 0.5, ZZ1: 0.17}}
"""


def skeleton(name: str) -> str:
    """Return the text of a commented robot file for a two-joint robot called `name`.

    Raises DescriptionError if `name` is not an identifier.
    """
    check_identifier(name, ("name",))
    return _SKELETON.format(name=name, schema=SCHEMA)


def skeleton_for(file: Path) -> str:
    """Return the text of a commented template for the robot file `file`.

    Its first lines name the JSON Schema for editors. Raises DescriptionError if `file` does not end
    in .yaml or .yml, or if its name is not an identifier.
    """
    if file.suffix not in (".yaml", ".yml"):
        raise DescriptionError(f"{file}: a robot file ends in .yaml")
    return EDITORS + skeleton(file.stem)
