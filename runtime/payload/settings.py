"""Settings of a load: where it is fixed, and what is known of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from runtime.core.settings import Flag, Real, Settings, Text, Whole, require

LOAD = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
"""Standard parameters of a load."""


class PayloadSettings(Settings):
    """Records with a load fixed to a link; the records of the study are those without it.

    Attributes
    ----------
    link : int or None
        Number of the link with the load; default: the last, or that of the frame.
    frame : int or None
        Frame fixed to that link, such as a tool frame (sigma 2), at which the parameters of the
        load are meant; default: that of the link.
    known : mapping of float, SI
        Those of XX XY XZ YY YZ ZZ MX MY MZ M of the load, at that frame, that were weighed or
        computed.
    friction : bool
        The records with the load have friction of their own.
    gains : bool
        Also estimate the torque constants of the drives from the load; its M must be known.
    """

    link: Whole | None = None
    frame: Whole | None = None
    known: Mapping[Text, Real] = field(default_factory=dict)
    friction: Flag = False
    gains: Flag = False

    def __post_init__(self) -> None:
        for family in self.known:
            require(
                family in LOAD, f"unknown parameter; a load has {', '.join(LOAD)}", "known", family
            )
        require(
            self.known.get("M", 1.0) > 0,
            f"{self.known.get('M')} kg; expected a positive mass",
            "known",
            "M",
        )
        require(
            not self.gains or "M" in self.known,
            "torque constants need a weighed load: set known: {M: ...}",
            "gains",
        )
