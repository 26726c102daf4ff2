"""A robot with the corrections of a study: other gravity, entries of the table, or drives.

    robot = symgen.corrected("arm.urdf", study)      # study.robot, or a mapping
    model = symgen.model(robot)

The file of the robot stays as it is. The hash of the corrected robot is that of the file, followed
by a digest of the corrections, so that both models cannot be confused.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from symgen.description.files import robot_of
from symgen.description.robot import Robot
from symgen.description.yaml import data_of, described
from symgen.errors import DescriptionError, SymgenError


def corrected(robot: str | Path | Robot, study: Any) -> Robot:
    """Replace entries of a robot by those of a study, and check the new robot.

    Parameters
    ----------
    robot : str, Path or Robot
        As for `load_robot`.
    study : Study or mapping
        A study with a section `robot`, or this section: {"gravity": [gx, gy, gz], "frames": {3:
        {"alpha": "pi/2"}}, "drives": {"ratio": [...]}}.

    Returns
    -------
    Robot
        The same robot if the study corrects nothing.

    Raises
    ------
    DescriptionError
        The study has an entry that no robot file may have; the message names this entry.

    Examples
    --------
    >>> import symgen
    >>> on_floor = symgen.corrected("planar_2r", {"gravity": [0, 0, 0]})
    >>> len(symgen.regrouping("planar_2r")), len(symgen.regrouping(on_floor))
    (13, 11)
    """
    robot = robot_of(robot)
    if not (study is None or isinstance(study, Mapping) or hasattr(study, "robot")):
        raise SymgenError(
            f"study is a {type(study).__name__}; expected a Study, or a mapping such as "
            '{"gravity": [0, 0, -9.81]}'
        )
    given = _plain(study if isinstance(study, Mapping) else getattr(study, "robot", None))
    given = {key: x for key, x in (given or {}).items() if x}
    if not given:
        return robot
    data = data_of(robot)
    for key, entries in given.items():
        if key == "frames":
            _correct_frames(data["frames"], entries)
        elif key == "drives":
            data["drives"] = {**(data.get("drives") or {}), **entries}
        elif key == "gravity":
            data["gravity"] = entries
        else:
            raise DescriptionError(
                f"robot.{key}: a study corrects gravity, frames or drives", file=robot.file
            )
    text = json.dumps(given, sort_keys=True)
    end = hashlib.sha256(text.encode()).hexdigest()[:12]
    try:
        new = described(data, robot.file, f"{robot.sha256}+{end}")
    except DescriptionError as error:
        message = f"the section `robot` of the study: {error.message}"
        raise DescriptionError(message, path=error.path, file=robot.file) from error
    return replace(new, angles=robot.angles, impossible=robot.impossible, bodies=robot.bodies)


def _correct_frames(frames: dict[Any, Any], entries: Mapping[Any, Mapping[str, Any]]) -> None:
    """Replace entries of the rows of a table of frames."""
    for number, row in entries.items():
        if int(number) not in frames:
            raise DescriptionError(
                f"robot.frames.{number}: the robot has no such frame; its frames are "
                f"{', '.join(map(str, frames))}"
            )
        frames[int(number)] = {**frames[int(number)], **row}


def _plain(value: Any) -> Any:
    """Convert settings to mappings, lists, numbers and texts of JSON."""
    if isinstance(value, Mapping):
        return {str(key): _plain(x) for key, x in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(x) for x in value]
    if hasattr(value, "__dataclass_fields__"):
        return {key: _plain(getattr(value, key)) for key in value.__dataclass_fields__}
    return value
