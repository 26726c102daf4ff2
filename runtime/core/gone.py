"""Removed or misplaced settings of a study file, each with a sentence on the replacement."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

RATIO = (
    "write gear ratios in the robot file, drives: {ratio: [100, 80]}; record.side: motor means that "
    "the columns are those of the motors"
)
WENT: Mapping[str, str] = {
    "estimate.options.prior: entropic": "the distance entropic was removed; use euclidean or none",
    "estimate.method: tls": "total least squares was removed; use wls, and `symgen cestac --advise` to see the effect of the encoder on the estimate",
    "estimate.method: cloe": "output error of the closed loop was removed; use didim, which uses the same records of the same loop",
    "record.ratio": RATIO,
    "record.gear_ratio": RATIO,
    "signals.lines": "lines of uneven encoders are no longer estimated; remove this key: bounds are widened by the deviation of the lines",
    "estimate.options.prior: pullback": "the distance pullback was removed; use euclidean or none",
    "stream": "this setting was removed, every record is read whole; remove the key, and cut a record that is too large for the memory into shorter records",
}
"""Messages for settings that are gone, by key ("stream") or by key and value
("estimate.method: tls"); keys of lists have no numbers ("record.resample").
"""


def gone(path: tuple[str | int, ...], value: Any) -> str | None:
    """Return the message on a setting that was removed or moved; None for any other setting.

    Parameters
    ----------
    path : tuple of str and int
        Keys that lead to the setting in a study.
    value : object
        Value of the setting.
    """
    key = ".".join(name for name in path if isinstance(name, str))
    return WENT.get(key) or WENT.get(f"{key}: {value}")
