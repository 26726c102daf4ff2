"""Removed or misplaced settings of a study file, each with a sentence on the replacement."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

RATIO = (
    "write gear ratios in the robot file, drives: {ratio: [100, 80]}; record.side: motor means that "
    "the columns are those of the motors"
)
WENT: Mapping[str, str] = {
    "estimate.options.prior: entropic": "the distance entropic went; set euclidean, or none",
    "estimate.method: tls": "total least squares went; set wls, and ask `symgen cestac --advise` what the encoder does to the estimate",
    "estimate.method: cloe": "output error of the closed loop went; set didim, which reads the same records of the same loop",
    "record.ratio": RATIO,
    "record.gear_ratio": RATIO,
    "signals.lines": "lines of uneven encoders are no longer estimated; leave the key out: bounds are widened by their deviation",
    "estimate.options.prior: pullback": "the distance pullback went; set euclidean, or none",
    "stream": "gone, every record is read whole; remove the key, and cut a record that memory does not hold into shorter ones",
}
"""Messages for settings that are gone, by key ("stream") or by key and value
("estimate.method: tls"); keys of lists have no numbers ("record.resample").
"""


def gone(path: tuple[str | int, ...], value: Any) -> str | None:
    """Return the sentence on a setting that is no longer used; None for any other setting.

    Parameters
    ----------
    path : tuple of str and int
        Keys that lead to the setting in a study.
    value : object
        Value of the setting.
    """
    key = ".".join(name for name in path if isinstance(name, str))
    return WENT.get(key) or WENT.get(f"{key}: {value}")
