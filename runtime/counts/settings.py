"""Settings of encoders whose counts are read: a part of the section `signals` of a study."""

from __future__ import annotations

from typing import Literal

from runtime.core import study as chapter
from runtime.ground.settings import PerJoint, Positive


class Signals(chapter.Signals):
    """Settings of the filters that compute q, qd, qdd from measured positions.

    Attributes
    ----------
    step : float or tuple of float or None, rad or m
        Step of the encoders, for the reader counts; null: found from the record.
    side : str
        Side of the encoders, for the reader counts: joint, or motor (converted by the drives of the
        robot).
    """

    step: PerJoint[Positive] | None = None
    side: Literal["joint", "motor"] = "joint"
