"""The section `robot` of a study: entries of the robot file that this study replaces.

    robot:
      gravity: [1.70, 0, -9.66]              # acceleration of gravity in frame 0, m/s^2
      frames: {3: {theta: q3 + pi/2}}        # entries of the table, Khalil's convention, rad and m
      drives: {ratio: [100, -80, 50]}        # as in the robot file

The file of the robot stays as it is. `symgen.corrected` applies the section to a robot, and the
model is that of the corrected robot: its base parameters depend on table and gravity. The hash of
such a model ends with the digest of the section, so that a study cannot be used with another model.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal

from pydantic import Field

from runtime.ground.settings import Real, Settings, Text, to_mapping

Entry = Annotated[Text | Real, Field(union_mode="left_to_right")]
"""A number, or an expression as in a robot file."""
Place = Literal["gamma", "b", "alpha", "d", "theta", "r"]


class Corrections(Settings):
    """Entries that replace those of the robot file.

    Attributes
    ----------
    gravity : tuple of 3 float or None, m/s^2
        Acceleration of gravity in frame 0.
    frames : mapping of int to mapping
        Entries of the table of frames, by number of the frame: gamma, b, alpha, d, theta, r.
    drives : mapping
        Entries of the drives: ratio, offset, torque_constant.
    """

    gravity: tuple[Real, Real, Real] | None = None
    frames: Mapping[int, Mapping[Place, Entry]] = field(default_factory=dict)
    drives: Mapping[Literal["ratio", "offset", "torque_constant"], Any] = field(
        default_factory=dict
    )


def digest(corrections: Any) -> str:
    """Return the end of the hash of a model with these corrections; "" without corrections.

    `symgen.description.corrected` computes the same text.
    """
    given = {key: x for key, x in (to_mapping(corrections) or {}).items() if x}
    if not given:
        return ""
    text = json.dumps(given, sort_keys=True)
    return f"+{hashlib.sha256(text.encode()).hexdigest()[:12]}"
