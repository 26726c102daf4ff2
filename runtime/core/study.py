"""Settings of an experiment for the methods of the chapter, as frozen dataclasses.

    Study(signals=Signals(lowpass=Lowpass(cutoff=100)))
    to_mapping(study)                  # complete, defaults filled: written into every result

Defaults are those of the chapter (sections 2.2.2, 2.2.3 and 4.1.1), with two exceptions: the
cut-off follows from the record, and torques have no median filter. The defaults are: Butterworth of
order 4 forward and backward on q and qd, central differences, parallel decimation by eq. (13),
ordinary least squares, essential parameters by the threshold 1.04, five CESTAC runs. Units: SI,
rad, Hz. Values are checked when a Study is made, so every Study is valid.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from math import pi
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from runtime.ground.settings import (
    MOST,
    Count,
    Flag,
    Interval,
    Many,
    NotNegative,
    OddWindow,
    PerJoint,
    Positive,
    Real,
    Seed,
    Settings,
    Text,
    Whole,
    not_tiny,
    require,
)

SCHEMA = 1


def version(number: int) -> int:
    """Return the version of a study file; raise SettingsError for a version that cannot be read."""
    require(number == SCHEMA, f"schema {number}; this version of symgen reads schema {SCHEMA}")
    return number


Version = Annotated[Whole, AfterValidator(version)]
Step = Annotated[Real, Field(gt=0, le=1000), AfterValidator(not_tiny)]
"""A step of an encoder, rad or m."""
CHAPTER_CUTOFF = 50.0
"""Cut-off of the low-pass in the chapter, Hz."""


class Lowpass(Settings):
    """Butterworth low-pass filter, forward and backward, in second-order sections.

    Attributes
    ----------
    cutoff : float or str, Hz
        Cut-off frequency. auto: symgen derives it from the motion and the noise of each record
        (`runtime.core.signals.cutoff`), doubles it for counts, and limits it to 50 Hz, the value of
        the chapter, which is also used if there is no record.
    order : int
        Order of the filter.
    on : tuple of str
        Signals that are filtered before they are differentiated, of q and qd.
    padding : str
        Samples added at each end: matlab, 3*order, or scipy, 3*(order + 1) for an even order.
    """

    cutoff: Annotated[Positive, Field(ge=1e-4)] | Literal["auto"] = "auto"
    order: Annotated[Whole, Field(ge=1, le=20)] = 4
    on: Many[Literal["q", "qd"]] = ("q", "qd")
    padding: Literal["matlab", "scipy"] = "matlab"

    @property
    def hertz(self) -> float:
        """Cut-off frequency as a number, Hz; "auto" gives 50 Hz, the value of the chapter."""
        return CHAPTER_CUTOFF if self.cutoff == "auto" else float(self.cutoff)


class Decimate(Settings):
    """Decimation of Y and of every column of W: low-pass filter, then every `factor`-th sample.

    The filter is Chebyshev I of order 8, 0.05 dB, 0.8/factor, zero phase.

    Attributes
    ----------
    factor : int or str
        Number of samples of which one is kept; auto is eq. (13), n_d = 0.8 ws/(2 wf), rounded down.
    phase : str
        Sample kept: the first (scipy) or the last (MATLAB's decimate).
    padding : str
        Samples added at each end: scipy, 27, or matlab, 24.
    """

    factor: Count | Literal["auto"] = "auto"
    phase: Literal["first", "last"] = "first"
    padding: Literal["scipy", "matlab"] = "scipy"


class Signals(Settings):
    """Settings of the filters that compute q, qd, qdd from measured positions.

    Attributes
    ----------
    median : int
        Window of the median filter on positions, odd number of samples; 1 switches it off.
    lowpass : Lowpass or None
        Low-pass filter; null switches it off.
    ends : str
        Derivative at the two ends: a one-sided difference, or one of second order.
    decimate : Decimate or None
        Decimation; null switches it off.
    reader : str
        Treatment of positions before the low-pass. lowpass: positions are used as they are. counts:
        positions are counts of an encoder, which bound the motion; no median is needed. static:
        each row is a pose at rest, with the mean of its torques; then there is no filter, no
        decimation and no trim, whatever their settings are.
    velocity : str or float or tuple of float, Hz
        Use of recorded velocities (record.columns.qd), for reader lowpass: the frequency from which
        they replace differences of q. auto: the frequency at which both have the same noise;
        recorded velocities that disagree with the positions are not used. differences: recorded
        velocities are never used.
    torque_median : int
        Window of the median filter on torques, odd number of samples; 1 switches it off. A median
        removes the pulses of a controller that answers every count of its encoder
        (`runtime.median`).
    options : mapping
        Options of the reader.
    """

    median: OddWindow = 5
    lowpass: Lowpass | None = field(default_factory=Lowpass)
    ends: Literal["one-sided", "second-order"] = "one-sided"
    decimate: Decimate | None = field(default_factory=Decimate)
    reader: Text = "lowpass"
    velocity: Literal["auto", "differences"] | PerJoint[Positive] = "auto"
    torque_median: OddWindow = 1
    options: Mapping[str, Any] = field(default_factory=dict)


class Rows(Settings):
    """Settings that select the rows of W and Y.

    Attributes
    ----------
    window : pair of float or None, s
        [t0, t1], applied before the regressor is evaluated; null leaves an end open.
    trim : int or str
        Decimated samples left out at each end of the window, where the filters start. auto: 3, and
        before the decimation also the samples within 3/cutoff of an end of the record, at most a
        tenth of it.
    low_speed : float or tuple of float or str, rad/s or m/s
        Rows of joint j with |qd_j| below this speed are left out, because sign(qd) is noise there.
        auto: the speed is found from the record for joints with dry friction in the model whose
        torques at rest differ from the model, and is zero for other joints.
    around : float, s
        Rows within this time of a row left out by low_speed are left out too; low_speed: auto sets
        it to the reach of the decimation.
    """

    window: Interval = (None, None)
    trim: Annotated[Whole, Field(ge=0)] | Literal["auto"] = "auto"
    low_speed: PerJoint[NotNegative] | Literal["auto"] = "auto"
    around: NotNegative = 0.0

    @property
    def slow(self) -> PerJoint[float]:
        """Speeds `low_speed` as numbers, rad/s or m/s; "auto" gives 0 until a record is known."""
        return 0.0 if isinstance(self.low_speed, str) else self.low_speed


Weights = Literal["none", "joint", "iterated", "covariance"]


class EstimateSettings(Settings):
    """Method of estimation, weights of the rows, and columns of W that are fitted.

    Attributes
    ----------
    method : str
        Method of estimation.
    weights : str
        Weights of the rows by joint.
    columns : str or tuple of str
        all, or the names of the columns kept.
    options : mapping
        Options of the method.
    """

    method: Text = "ols"
    weights: Weights = "none"
    columns: Literal["all"] | Many[Text] = "all"
    options: Mapping[str, Any] = field(default_factory=dict)


class EssentialSettings(Settings):
    """Settings of the elimination: parameters are removed while sigma_rho is below a threshold.

    Attributes
    ----------
    threshold : float
        Largest ratio of sigma_rho to its first value.
    first : bool
        Whether the essential parameters may be used, as in the chapter; their standard deviations
        assume that the removed parameters are zero. Default: physical or all parameters.
    """

    threshold: Annotated[Real, Field(gt=1)] = 1.04
    first: Flag = False


class ValidateSettings(Settings):
    """Split of the data into a fitted part and predicted parts.

    Attributes
    ----------
    split : tuple of pairs of float or None, s
        Windows: the first is fitted, the others are predicted.
    values : bool
        Whether parameters are to be used one by one: the verdict then needs small standard
        deviations, and parameters that can be separated.
    """

    split: tuple[Interval, ...] = ()
    values: Flag = False

    def __post_init__(self) -> None:
        require(
            len(self.split) != 1,
            "one window; expected at least two, the first to fit, the others to predict",
            "split",
        )


class CestacSettings(Settings):
    """Settings of the CESTAC study of encoder resolution, eqs. (15)-(22), (28) of the chapter.

    Attributes
    ----------
    side : str
        Side of the encoder: joint or motor.
    rounding : str
        Law of the perturbations; phase is the law of a real encoder: counts of steps, whose phase
        is random for each joint and run.
    uneven : float
        Standard deviation of the lines of law phase from even spacing, in steps.
    delta : tuple of float, rad or m
        Steps of the perturbed position.
    runs : int
        Runs for each step; eq. (19) divides by runs - 1.
    seed : int
        Seed of the random numbers.
    columns : str or tuple of str
        Parameters that are judged: essential; all; or names, which are fitted together with the
        essential ones.
    torque : tuple of float or None, N m or N
        Steps of the perturbed motor torque (Table 4); null: none.
    common : bool
        Whether every delta uses the same random numbers.
    median : int
        Window of the median filter on the rounded positions, 1 for none: a median enlarges the
        bias. The estimate with which runs are compared uses the median of `signals`.
    """

    side: Literal["joint", "motor"] = "joint"
    rounding: Literal["two-point", "uniform", "gaussian", "quantise", "phase"] = "two-point"
    uneven: Annotated[Real, Field(ge=0, le=0.5)] = 0.0
    delta: Many[Step] = (2 * pi / 10000, 2 * pi / 5000, 2 * pi / 2000, 2 * pi / 1000)
    runs: Annotated[Whole, Field(ge=2, le=MOST)] = 5
    seed: Seed = 1
    columns: Literal["essential", "all"] | Many[Text] = "essential"
    torque: Many[Real] | None = None
    common: Flag = False
    median: OddWindow = 1

    def __post_init__(self) -> None:
        phase = self.rounding == "phase"
        require(
            not self.uneven or phase,
            f"{self.uneven} with rounding: {self.rounding}; uneven lines need rounding: phase",
            "uneven",
        )
        require(
            not (self.common and phase),
            "rounding: phase draws a new phase for every step; set common: false",
            "common",
        )


class Study(Settings):
    """Settings of the chapter's methods; other modules add sections (`runtime.study`).

    Attributes
    ----------
    symgen : int
        Version of the study file.
    signals : Signals
        Filters of the measured signals.
    rows : Rows
        Rows of W and Y that are used.
    estimate : EstimateSettings
        Estimator.
    essential : EssentialSettings
        Choice of the essential parameters.
    validate : ValidateSettings
        Validation.
    cestac : CestacSettings
        Encoder-resolution study.
    """

    symgen: Version = SCHEMA
    signals: Signals = field(default_factory=Signals)
    rows: Rows = field(default_factory=Rows)
    estimate: EstimateSettings = field(default_factory=EstimateSettings)
    essential: EssentialSettings = field(default_factory=EssentialSettings)
    validate: ValidateSettings = field(default_factory=ValidateSettings)
    cestac: CestacSettings = field(default_factory=CestacSettings)
