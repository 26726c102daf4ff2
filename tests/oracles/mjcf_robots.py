"""MJCF texts written here, each for what the format has beside a plain chain, and random trees."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]

# An arm whose second body has two joints about points of their own, with positions of reference,
# springs, motors' inertia, oblique gravity; its masses come from geoms, defaults of classes and an
# <inertial>; a mount that never moves, a flange, a site, a mesh that only is seen.
ARM = """\
<mujoco model="bent arm">
  <compiler angle="degree" eulerseq="zyx"/>
  <option gravity="0.5 -1 -9.6"/>
  <default>
    <joint damping="0.4" armature="0.02"/>
    <default class="light"><geom density="300"/><joint armature="0.001"/></default>
  </default>
  <asset><mesh name="shell" file="../../etc/shell.stl"/></asset>
  <visual><headlight ambient="1 1 1"/></visual>
  <worldbody>
    <light pos="0 0 3"/> <geom type="plane" size="2 2 0.1"/>
    <body name="mount" pos="0.1 0.2 0.3" euler="20 -10 5">
      <geom type="mesh" mesh="shell"/>
      <body name="shoulder" pos="0 0 0.2">
        <joint name="pan" axis="0 0 1" ref="15" frictionloss="0.3" range="-90 120"/>
        <geom type="capsule" fromto="0 0 0 0.3 0.05 0" size="0.04"/> <geom class="light" type="box"
          size="0.05 0.06 0.07" pos="0.1 0 0.1" euler="10 20 30"/>
        <body name="elbow" pos="0.3 0 0" quat="0.9 0.1 0.3 -0.2">
          <joint name="lift" axis="0 1 0.2" pos="0.05 0 0" stiffness="3" springref="10"/>
          <joint name="roll" axis="1 0 0" pos="0 0.02 0.01" class="light"/>
          <inertial pos="0.1 0.01 -0.02" mass="1.3"
            fullinertia="0.02 0.03 0.04 0.001 -0.002 0.003"/>
          <geom type="mesh" mesh="shell" mass="100"/>
          <frame pos="0.25 0 0.1" axisangle="1 1 0 40">
            <body name="quill">
              <joint name="push" type="slide" axis="0.1 0 1" ref="0.1" range="-0.2 0.2"/>
              <inertial pos="0 0 0.05" mass="0.6" diaginertia="0.003 0.004 0.002" euler="5 6 7"/>
              <body name="flange" pos="0 0 0.1" xyaxes="0 1 0 -1 0 0">
                <geom type="sphere" size="0.03" mass="0.2"/><site name="tip" pos="0.01 0.02 0.03"/>
                  </body>
            </body>
          </frame>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="pan"/><position name="lifter" joint="lift" kp="100"/></actuator>
  <sensor><jointpos joint="pan"/></sensor>
</mujoco>
"""

# A gripper: one finger follows the other, a tendon couples two joints of the wrist, and only what
# is driven stays.
GRIPPER = """\
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body pos="0 0 0.5"><joint name="wrist1" axis="0 1 0" damping="0.1"/>
      <geom type="box" size="0.05 0.05 0.1" mass="1"/>
      <body pos="0 0 0.2">
        <joint name="wrist2" axis="1 0 0" ref="0.2" damping="0.2" armature="0.01"/>
          <geom type="sphere" size="0.06" mass="0.8" pos="0 0.02 0"/>
        <body name="left" pos="0 0.05 0.1"><joint name="left" type="slide" axis="0 1 0"/>
          <geom type="box" size="0.01 0.01 0.04" mass="0.1" pos="0 0 0.05"/></body>
        <body name="right" pos="0 -0.05 0.1">
          <joint name="right" type="slide" axis="0 -1 0" ref="0.01" damping="0.5"/>
            <geom type="box" size="0.01 0.01 0.04" mass="0.1" pos="0.01 0 0.05"/></body>
      </body>
    </body>
  </worldbody>
  <tendon><fixed name="belt"><joint joint="wrist1" coef="2"/><joint joint="wrist2" coef="-0.5"/>
    </fixed></tendon>
  <equality><joint joint1="right" joint2="left" polycoef="0.002 1.5 0 0 0"/>
    <tendon tendon1="belt" polycoef="0.1 0 0 0 0"/>
    <connect body1="left" anchor="0 0 0" active="false"/></equality>
  <actuator><motor joint="left"/><motor joint="wrist1"/></actuator>
</mujoco>
"""  # fmt: skip

# Two branches on a slide, in SI, nothing special.
BRANCHES = """\
<mujoco model="branches">
  <compiler angle="radian"/>
  <worldbody>
    <body name="cart"><joint name="rail" type="slide" axis="1 0 0" armature="0.5"/>
      <inertial pos="0 0 0" mass="4" diaginertia="0.1 0.1 0.1"/>
      <body name="a" pos="0.2 0 0.1"><joint name="a" axis="0 1 0"/>
        <inertial pos="0 0 -0.3" mass="1" diaginertia="0.02 0.02 0.001"/>
        <body name="a2" pos="0 0 -0.6"><joint name="a2" axis="0 1 0" damping="0.05"/>
          <inertial pos="0 0.1 -0.2" mass="0.5" diaginertia="0.01 0.01 0.002"/></body></body>
      <body name="b" pos="-0.2 0 0.1" zaxis="0 1 1"><joint name="b" axis="0 0 1"/>
        <inertial pos="0.1 0 0" mass="0.7" diaginertia="0.01 0.02 0.02"/></body>
    </body>
  </worldbody>
</mujoco>
"""

NAMED = {"arm": ARM, "gripper": GRIPPER, "branches": BRANCHES}


def random_tree(seed: int) -> str:
    """2 to 7 bodies of up to three joints each, any axes, points, references; some are fixed."""
    rng = np.random.default_rng([47, seed])

    def words(v: Array) -> str:
        return " ".join(repr(float(x)) for x in v)

    count = int(rng.integers(2, 8))
    children: dict[int, list[int]] = {k: [] for k in range(count + 1)}
    for k in range(1, count + 1):
        children[int(rng.integers(0, k)) if rng.random() < 0.4 else k - 1].append(k)

    def body(k: int) -> str:
        joints = "".join(
            f'<joint name="j{k}_{i}" type="{rng.choice(["hinge", "slide"], p=[0.75, 0.25])}" '
            f'axis="{words(axis(rng))}" '
            f'pos="{words(rng.uniform(-0.1, 0.1, 3))}" ref="{rng.uniform(-1, 1)!r}" '
            f'armature="{rng.uniform(0, 0.1)!r}" '
            f'damping="{rng.uniform(0, 1)!r}" stiffness="{rng.choice([0.0, 2.0])}" '
            f'springref="{rng.uniform(-1, 1)!r}"/>'
            for i in range(int(rng.choice([0, 1, 2, 3], p=[0.2, 0.5, 0.2, 0.1])) if k > 1 else 1)
        )
        d = rng.uniform(0.01, 0.1, 3)
        inertia = words(np.array([d[1] + d[2], d[0] + d[2], d[0] + d[1]]))
        placed = f'pos="{words(rng.uniform(-0.3, 0.3, 3))}" quat="{words(rng.standard_normal(4))}"'
        own = f'<inertial {placed} mass="{rng.uniform(0.2, 2)!r}" diaginertia="{inertia}"/>'
        here = (
            f'pos="{words(rng.choice([0, 0.3, -0.2], 3))}" '
            'quat="'
            f'{words(rng.choice([0, 1], 4) if rng.random() < 0.5 else rng.standard_normal(4))}"'
        )
        here = here.replace('quat="0.0 0.0 0.0 0.0"', 'quat="1 0 0 0"')
        return f'<body name="b{k}" {here}>{joints}{own}{"".join(map(body, children[k]))}</body>'

    gravity = words(rng.uniform(-10, 10, 3))
    inside = "".join(map(body, children[0]))
    return (
        '<mujoco><compiler angle="radian"/><option '
        f'gravity="{gravity}"/><worldbody>{inside}</worldbody></mujoco>'
    )


def axis(rng: np.random.Generator) -> Array:
    """Any direction, or one along the axes."""
    v = rng.choice([-1.0, 0.0, 1.0], 3) if rng.random() < 0.5 else rng.standard_normal(3)
    return v if v.any() else np.array([0.0, 0.0, 1.0])
