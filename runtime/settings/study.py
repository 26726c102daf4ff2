"""Everything about an experiment that is not the robot: the study file as frozen settings.

    study = study_from_mapping({"signals": {"lowpass": {"cutoff": 100}}})
    study.signals.lowpass.order        # 4, the default
    to_mapping(study)                  # complete, defaults filled: written into every result

Defaults are those of the chapter (sections 2.2.2, 2.2.3 and 4.1.1): Butterworth of order 4 at 50 Hz forward and backward on q and qd, central
differences, parallel decimation by eq. (13), ordinary least squares, essential parameters by the threshold 1.04, five CESTAC runs.
Units: SI, rad, Hz. Values are checked where they are made, so a Study that exists is a valid one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from math import pi
from typing import Any, Literal

from runtime.errors import SettingsError
from runtime.settings.controller import Controller
from runtime.settings.excitation import ExcitationSettings
from runtime.settings.record import SHORTEST, Columns, Number, RecordSettings, Resample, Scale, Units, each_record
from runtime.settings.schema import plain, structure
from runtime.settings.units import speed

SCHEMA = 1


@dataclass(frozen=True)
class Lowpass:
    """Butterworth, forward and backward, in second-order sections; cutoff in Hz.

    on : the signals filtered before they are differentiated.   padding : "matlab", 3*order samples at each end, or "scipy", 3*(order + 1) for an even order.
    """

    cutoff: float = 50.0
    order: int = 4
    on: tuple[Literal["q", "qd"], ...] = ("q", "qd")
    padding: Literal["matlab", "scipy"] = "matlab"

    def __post_init__(self) -> None:
        _require(self.cutoff > 0, ("cutoff",), f"{self.cutoff} Hz; expected a positive frequency")
        _require(1 <= self.order <= 20, ("order",), f"{self.order}; expected 1 to 20")


@dataclass(frozen=True)
class Decimate:
    """Parallel decimation of Y and of every column of W: Chebyshev I of order 8, 0.05 dB, 0.8/factor, zero phase, then one sample in `factor`.

    factor : "auto" is eq. (13), n_d = 0.8 ws/(2 wf), rounded down.   phase : keep the "first" sample (scipy) or the "last" (MATLAB's decimate).
    padding : 27 samples at each end ("scipy") or 24 ("matlab").
    """

    factor: int | Literal["auto"] = "auto"
    phase: Literal["first", "last"] = "first"
    padding: Literal["scipy", "matlab"] = "scipy"

    def __post_init__(self) -> None:
        _require(self.factor == "auto" or self.factor >= 1, ("factor",), f"{self.factor}; expected auto or an integer from 1")


@dataclass(frozen=True)
class Signals:
    """From measured positions to q, qd, qdd. median: window in samples, 1 switches it off. lowpass, decimate: null switches them off.

    ends : the derivative at the two ends by a "one-sided" difference, or by one of "second-order".
    """

    median: int = 5
    lowpass: Lowpass | None = field(default_factory=Lowpass)
    ends: Literal["one-sided", "second-order"] = "one-sided"
    decimate: Decimate | None = field(default_factory=Decimate)

    def __post_init__(self) -> None:
        _require(self.median >= 1 and self.median % 2 == 1, ("median",), f"{self.median}; expected an odd window, 1 for no median filter")


@dataclass(frozen=True)
class Rows:
    """Which rows of W and Y are used.

    window : [t0, t1] in s, applied before the regressor is evaluated; null leaves an end open.
    trim : decimated samples left out at each end of the window, where the filters start.
    low_speed : rows of joint j with |qd_j| below it are left out: there sign(qd) is noise. rad/s or m/s; a text may have another unit, "2 rpm".
    """

    window: tuple[float | None, float | None] = (None, None)
    trim: int = 3
    low_speed: Number = field(default=0.0, metadata={"read": speed})

    def __post_init__(self) -> None:
        t0, t1 = self.window
        _require(t0 is None or t1 is None or t0 < t1, ("window",), f"[{t0}, {t1}]; expected the earlier time first")
        _require(self.trim >= 0, ("trim",), f"{self.trim}; expected 0 or more")
        speeds = self.low_speed if isinstance(self.low_speed, tuple) else (self.low_speed,)
        _require(all(v >= 0 for v in speeds), ("low_speed",), f"{self.low_speed}; expected 0 or more")


@dataclass(frozen=True)
class EstimateSettings:
    """method: the estimator. weights: per-joint weights of the rows. columns: "all" or the names kept. options: passed to the estimator."""

    method: Literal["ols", "wls", "irls", "tls", "iv", "didim", "cloe", "feasible"] = "ols"
    weights: Literal["none", "joint", "iterated", "covariance"] = "none"
    columns: Literal["all"] | tuple[str, ...] = "all"
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class EssentialSettings:
    """Parameters are removed while sigma_rho stays below threshold times its first value (chapter 4.1.1)."""

    threshold: float = 1.04

    def __post_init__(self) -> None:
        _require(self.threshold > 1, ("threshold",), f"{self.threshold}; expected a ratio above 1")


@dataclass(frozen=True)
class ValidateSettings:
    """split: windows in s, fit on the first and predict the others. record: further records, predicted with the parameters of the study."""

    split: tuple[tuple[float | None, float | None], ...] = ()
    record: tuple[RecordSettings, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "record", each_record(self.record))
        for i, (t0, t1) in enumerate(self.split):
            _require(t0 is None or t1 is None or t0 < t1, ("split", i), f"[{t0}, {t1}]; expected the earlier time first")
        _require(len(self.split) != 1, ("split",), "one window; expected at least two, the first to fit, the others to predict")


@dataclass(frozen=True)
class PayloadSettings:
    """Records with a load fixed to a link, beside those of the study without it.

    link : number of the link that carries it; default: the last, or the one that carries the frame.   frame : any frame fixed to that link,
    such as a tool frame (sigma 2), at which its parameters are meant; default: that of the link.   known : of XX XY XZ YY YZ ZZ MX MY MZ M
    of the load, at that frame, what was weighed or computed, SI.   friction : the loaded records have friction of their own.
    gains : also estimate the torque constants of the drives from the load; its M must be known.
    """

    record: tuple[RecordSettings, ...] = ()
    link: int | None = None
    frame: int | None = None
    known: Mapping[str, float] = field(default_factory=dict)
    friction: bool = False
    gains: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "record", each_record(self.record))
        families = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
        for family in self.known:
            _require(family in families, ("known", family), f"unknown parameter; a load has {', '.join(families)}")
        _require(self.known.get("M", 1.0) > 0, ("known", "M"), f"{self.known.get('M')} kg; expected a positive mass")
        _require(not self.gains or "M" in self.known, ("gains",), "torque constants need a weighed load: set known: {M: ...}")


@dataclass(frozen=True)
class CestacSettings:
    """Encoder-resolution study, eqs. (15)-(22), (28).

    delta : steps of the perturbed position, rad or m.   torque : steps of the perturbed motor torque (Table 4), or null.
    common : the same random numbers for every delta.   median : window ahead of the filter in this study, 1 for none: a median enlarges the bias.
    """

    side: Literal["joint", "motor"] = "joint"
    rounding: Literal["two-point", "uniform", "gaussian", "quantise"] = "two-point"
    delta: tuple[float, ...] = (2 * pi / 10000, 2 * pi / 5000, 2 * pi / 2000, 2 * pi / 1000)
    runs: int = 5
    seed: int = 1
    columns: Literal["essential", "all"] | tuple[str, ...] = "essential"
    torque: tuple[float, ...] | None = None
    common: bool = False
    median: int = 1

    def __post_init__(self) -> None:
        _require(all(d > 0 for d in self.delta), ("delta",), f"{self.delta}; expected positive steps")
        _require(self.runs >= 2, ("runs",), f"{self.runs}; expected at least 2, eq. (19) divides by runs - 1")
        _require(self.seed >= 0, ("seed",), f"{self.seed}; expected 0 or more")
        _require(self.median >= 1 and self.median % 2 == 1, ("median",), f"{self.median}; expected an odd window, 1 for no median filter")


@dataclass(frozen=True)
class Study:
    """All settings. `record` holds one or several records of one robot; `controller`: the closed loop of simulation, IV,
    DIDIM and CLOE; `payload`: records with a load; `excitation`: the search for a motion.

    stream : samples of the blocks by which `identify` reads the records; "auto": blocks for large files, "off": whole records.
    """

    symgen: int = SCHEMA
    record: tuple[RecordSettings, ...] = ()
    signals: Signals = field(default_factory=Signals)
    rows: Rows = field(default_factory=Rows)
    estimate: EstimateSettings = field(default_factory=EstimateSettings)
    essential: EssentialSettings = field(default_factory=EssentialSettings)
    validate: ValidateSettings = field(default_factory=ValidateSettings)
    cestac: CestacSettings = field(default_factory=CestacSettings)
    payload: PayloadSettings | None = None
    controller: Controller | None = None
    excitation: ExcitationSettings | None = None
    stream: Literal["auto", "off"] | int = "auto"

    def __post_init__(self) -> None:
        object.__setattr__(self, "record", each_record(self.record))
        _require(self.symgen == SCHEMA, ("symgen",), f"schema {self.symgen}; this version reads {SCHEMA}")
        blocks = self.stream if isinstance(self.stream, int) else SHORTEST
        _require(blocks >= SHORTEST, ("stream",), f"{blocks}; expected auto, off, or samples of a block, {SHORTEST} or more")


def study_from_mapping(mapping: Mapping[str, Any]) -> Study:
    """The Study of a mapping as read from a study file; raises SettingsError with the path of the offending key.

    Numbers may be texts such as "2*pi/10000"; one value stands for a list of one (files, delta, record).
    """
    return structure(Study, mapping)


def to_mapping(settings: Any) -> dict[str, Any]:
    """Complete plain mapping (dicts, lists, numbers, texts) of a Study or of one of its sections; study_from_mapping(to_mapping(s)) == s."""
    return plain(asdict(settings))  # type: ignore[no-any-return]


def _require(ok: bool, path: tuple[str | int, ...], message: str) -> None:
    if not ok:
        raise SettingsError(message, path=path)


__all__ = [
    "SCHEMA",
    "SHORTEST",
    "CestacSettings",
    "Columns",
    "Decimate",
    "EssentialSettings",
    "EstimateSettings",
    "Lowpass",
    "PayloadSettings",
    "RecordSettings",
    "Resample",
    "Rows",
    "Scale",
    "Signals",
    "Study",
    "Units",
    "ValidateSettings",
    "study_from_mapping",
    "to_mapping",
]
