"""Wrenches that a study gives at named places of a robot, in the frames of the links that hold them.

A place on link j, such as a link or a site of the user's file, has the pose R, P in frame j. A
force F and a moment N in the axes of the place about its origin become, in the axes of frame j
about the origin of frame j,

    R F   and   R N + P x R F .
"""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

import numpy as np

from runtime.core.record import WRENCH
from runtime.ground.errors import SettingsError
from runtime.reading.settings import Columns

Array = np.ndarray
LISTED = 8  # names in a message


def wrench_places(columns: Columns, model: Any) -> dict[str, tuple[int, Any]]:
    """Find link and pose (4, 4) of each place that the columns of wrenches name, by signal.

    Raises
    ------
    SettingsError
        The robot lacks a name, or the model knows no places, or its base is fixed, so that a wrench
        has to be that of a sensor before a whole link.
    """
    wrench = {} if isinstance(columns.wrench, str) else columns.wrench
    names = [key for key in wrench if not str(key).isdecimal()]
    known: Mapping[str, tuple[int, Any]] = getattr(model, "MOUNTS", {})
    for name in names:
        if getattr(model, "BASE", "fixed") == "fixed" or not known or name not in known:
            raise SettingsError(
                f"{name!a:.60} {_why(str(name), model, known)}",
                path=("record", "columns", "wrench"),
            )
    return {f"{WRENCH}{name}": known[str(name)] for name in names}


def _why(name: str, model: Any, known: Mapping[str, tuple[int, Any]]) -> str:
    """Return why the wrench of a place cannot be used, and what to do."""
    if model is not None and getattr(model, "BASE", "fixed") == "fixed":
        return (
            f"is the name of a place, but the base of {model.NAME} is fixed, where a force sensor is "
            "before a whole link; give the number of its frame"
        )
    if not known:
        return (
            "is the name of a place, but only a robot file with links, sites or fixed frames has "
            "places; give that file in place of a generated module, or the number of a frame"
        )
    near = get_close_matches(name, known, LISTED) or sorted(known)[:LISTED]
    return (
        f"is no link, site or fixed frame of {model.NAME}; near names are "
        f"{', '.join(f'{other!a:.60}' for other in near)}"
    )


def in_frames(
    samples: Mapping[str, Array], places: Mapping[str, tuple[int, Any]]
) -> dict[str, Array]:
    """Move the wrenches of named places, (N, 6), to the frames of their links.

    Wrenches on one link are added.
    """
    moved = {key: x for key, x in samples.items() if key not in places}
    for key, (j, pose) in places.items():
        if samples[key].shape[1] != 6:
            raise SettingsError(
                f"{samples[key].shape[1]} columns; expected 6: force (N), moment (N m)",
                path=("record", "columns", "wrench", key.removeprefix(WRENCH)),
            )
        T = np.array(pose)
        F, N = (x @ T[:3, :3].T for x in np.hsplit(samples[key], 2))
        own = np.hstack([F, N + np.cross(T[:3, 3], F)])
        moved[f"{WRENCH}{j}"] = moved.get(f"{WRENCH}{j}", 0.0) + own
    return moved
