"""Python module of a robot whose frame table and gravity are constants that can be changed.

The module shows how the robot would behave with another angle, length or gravity, without another
derivation.

    free = symgen.variants("arm.yaml")
    free.regressor(q, qd, qdd, free_alpha4=pi/2)       frame 4 turned the other way
    free.observation_matrix(q, qd, qdd, free_gx=9.81, free_gz=0.0)

The columns of its regressor are those of all standard parameters, because the base parameters
depend on the geometry. `runtime.identify` accepts it as `variants` and tests whether another frame
table explains a record better.

A robot with closed loops has a fixed frame table, because the loops must close; only gravity is
free. Frames between joints that a constraint ties are fixed too, because the constraint holds for
this geometry.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

from symgen.certify.requests import module_of
from symgen.description.expression import Expression
from symgen.description.files import on_base, robot_of
from symgen.description.robot import PRISMATIC, REVOLUTE, Frame, Robot

FREE = "free_"
"""Prefix of the names of freed entries: free_alpha4, free_d3, free_gx."""


def variants(robot: str | Path | Robot, *, base: str | None = None) -> ModuleType:
    """Make the module of a robot whose frame table and gravity are constants that can be changed.

    The columns of its regressor are all standard parameters.

    Parameters
    ----------
    robot : str, Path or Robot
        As for `symgen.model`.
    base : str, optional
        `fixed`, `moving` or `free`, as for `load_robot`. Default: that of the file.

    Returns
    -------
    module
        The constants of the robot file, and free_alpha1, free_d1, free_theta1, free_r1 ... (gamma
        and b if a frame has them), free_gx, free_gy, free_gz. Their defaults are the values in the
        robot file. On a base that moves, no function reads gravity, because a0 contains it.

    Examples
    --------
    >>> import symgen
    >>> free = symgen.variants("planar_2r")
    >>> X = free.base_parameters(free.VALUES)
    >>> free.gravity([0.5, 0.2], X).round(3)
    array([16.765,  3.702])
    >>> free.gravity([0.5, 0.2], X, free_gy=0.0).round(3)  # the offsets are left
    array([ 0.1 , -0.05])
    """

    def derived(robot: Robot) -> Path:
        from symgen.certify.modules import ungrouped_path  # slow to load

        return ungrouped_path(robot)

    robot = freed(on_base(robot_of(robot), base))
    return module_of(robot, "standard parameters", derived)


def freed(robot: Robot) -> Robot:
    """Replace the angles, lengths and gravity of a robot by constants that can be changed.

    If the robot has loops, only gravity is replaced.
    """
    constants = dict(robot.constants)
    tied = {  # frames on the paths between the joints that constraints tie to each other
        frame
        for j, e in robot.constraints.items()
        for i in robot.joints
        if f"q{i}" in e.symbols
        for frame in {*robot.path(j)} ^ {*robot.path(i)}
    }

    def symbol(name: str, entry: Expression) -> Expression:
        constants[f"{FREE}{name}"] = float(entry.value(robot.constants))
        return Expression.symbol(f"{FREE}{name}")

    def free(f: Frame) -> Frame:
        entries: dict[str, Any] = {
            key: symbol(f"{key}{f.j}", getattr(f, key)) for key in ("gamma", "b") if getattr(f, key)
        }
        entries |= {"alpha": symbol(f"alpha{f.j}", f.alpha), "d": symbol(f"d{f.j}", f.d)}
        q = Expression.symbol(f.q)
        theta, r = symbol(f"theta{f.j}", f.theta0), symbol(f"r{f.j}", f.r0)
        entries |= {
            "theta": q + theta if f.sigma == REVOLUTE else theta,
            "r": q + r if f.sigma == PRISMATIC else r,
        }
        return replace(f, **entries)

    frames = tuple(f if robot.loops or f.j in tied else free(f) for f in robot.frames)
    gx, gy, gz = (
        symbol(f"g{axis}", entry) for axis, entry in zip("xyz", robot.gravity, strict=True)
    )
    return replace(robot, frames=frames, gravity=(gx, gy, gz), constants=constants)
