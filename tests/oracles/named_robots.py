"""Hand-built robots for tests that must not depend on the robot files."""

from __future__ import annotations

from symgen.description.expression import ONE, ZERO
from symgen.description.grammar import parse
from symgen.description.robot import FIXED, JOINT_FAMILIES, REVOLUTE, Element, Frame, Loop, Robot

Row = tuple[int, int, str, str, str, str]  # ant, sigma, alpha, d, theta, r


def robot(
    name: str,
    rows: list[Row],
    gravity: tuple[str, str, str],
    constants: dict[str, float],
    **more: object,
) -> Robot:
    """A Robot from table rows; joint friction, motor inertia and offset on every actuated joint."""
    passive = more.pop("passive", ())
    frames = []
    for j, (ant, sigma, *texts) in enumerate(rows, start=1):
        alpha, d, theta, r = (parse(text) for text in texts)
        frames.append(
            Frame(
                j,
                ant,
                sigma,
                int(sigma != FIXED and j not in passive),
                ZERO,
                ZERO,
                alpha,
                d,
                theta,
                r,
            )
        )  # type: ignore[operator]
    each = {f.j: {f.j: ONE} for f in frames if f.mu}
    kinds = ("inertia", "viscous", "coulomb", "offset")
    elements = tuple(
        Element(family, kind, each, {}) for family, kind in zip(JOINT_FAMILIES, kinds, strict=True)
    )
    g = tuple(parse(text) for text in gravity)
    return Robot(name, tuple(frames), g, constants=constants, elements=elements, **more)  # type: ignore[arg-type]


def planar_2r() -> Robot:
    """Two revolute joints with parallel horizontal axes; gravity along -y."""
    rows: list[Row] = [(0, REVOLUTE, "0", "0", "q1", "0"), (1, REVOLUTE, "0", "L1", "q2", "0")]
    return robot("planar_2r", rows, ("0", "-g", "0"), {"L1": 0.4, "g": 9.81})


def six_r() -> Robot:
    """Six revolute joints, anthropomorphic with spherical wrist."""
    rows: list[Row] = [
        (0, REVOLUTE, "0", "0", "q1", "0"),
        (1, REVOLUTE, "-pi/2", "0", "q2", "0"),
        (2, REVOLUTE, "0", "D3", "q3", "0"),
        (3, REVOLUTE, "pi/2", "0", "q4", "RL4"),
        (4, REVOLUTE, "-pi/2", "0", "q5", "0"),
        (5, REVOLUTE, "pi/2", "0", "q6", "0"),
    ]
    return robot("six_r", rows, ("0", "0", "-g"), {"D3": 0.225, "RL4": 0.31, "g": 9.81})


def four_bar(rocker: float = 0.3, start: dict[int, float] | None = None) -> Robot:
    """Four-bar linkage in the plane: crank q1 actuated; coupler q2, rocker q3 passive, 4 cut; frame
    5 on link 3 coincides with frame 4.

    A parallelogram when the rocker is as long as the crank, 0.3 m.
    """
    rows: list[Row] = [
        (0, REVOLUTE, "0", "0", "q1", "0"),
        (1, REVOLUTE, "0", "L1", "q2", "0"),
        (0, REVOLUTE, "0", "L2", "q3", "0"),
        (2, REVOLUTE, "0", "L2", "q4", "0"),
        (3, FIXED, "0", "L3", "0", "0"),
    ]
    constants = {"L1": 0.3, "L2": 0.5, "L3": rocker, "g": 9.81}
    return robot(
        "four_bar",
        rows,
        ("0", "-g", "0"),
        constants,
        passive=(2, 3, 4),
        loops=(Loop(4, 5, start or {}),),
    )
