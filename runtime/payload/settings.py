"""Settings of a load: where it is fixed, and which of its parameters are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from runtime.ground.settings import Flag, Real, Settings, Text, Whole, require
from runtime.reading.settings import Records

LOAD = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
"""Standard parameters of a load."""


LOADED = "loaded"
"""Kind of the note that holds the records with the load, prepared."""


class PayloadSettings(Settings):
    """Settings of a load fixed to a link in some records: the link, and known load parameters.

    All other records of the study are without the load.

    Attributes
    ----------
    link : int or None
        Number of the link with the load; default: the link of `frame` or, without it, the last
        link.
    frame : int or None
        Frame fixed to that link, such as a tool frame (sigma 2), to which the parameters of the
        load refer; default: the frame of the link.
    at : str or None
        Name of a link of the robot file, or a site of an MJCF, at which mass, centre and inertia of
        the load are given; default: tool0, flange or the last named place on that link.
    known : mapping of float, SI
        Known parameters of the load (weighed or computed), among XX XY XZ YY YZ ZZ MX MY MZ M at
        that frame.
    friction : bool
        Whether the records with the load have friction parameters of their own.
    gains : bool
        Whether the torque constants of the drives are also estimated from the load; its M must
        be known.
    record : tuple of RecordSettings
        Records with the load.
    """

    link: Whole | None = None
    frame: Whole | None = None
    at: Text | None = None
    known: Mapping[Text, Real] = field(default_factory=dict)
    friction: Flag = False
    gains: Flag = False
    record: Records = ()

    def __post_init__(self) -> None:
        for family in self.known:
            require(
                family in LOAD,
                f"unknown parameter of a load; expected some of {', '.join(LOAD)}",
                "known",
                family,
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
