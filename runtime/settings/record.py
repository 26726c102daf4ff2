"""Settings of measured records: where they lie, what their columns mean, what is done about their time stamps. Part of a Study."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from runtime.errors import InputError, SettingsError
from runtime.settings.units import COMMANDS, position_unit, time_unit, torque_unit

SHORTEST = 10  # samples of a record, or of a block of one: fewer cannot be filtered nor differentiated twice

Number = float | tuple[float, ...]  # one for all joints, or one per joint


@dataclass(frozen=True)
class Columns:
    """Names of the columns of a record file, one per joint; `t` is None where the record has no time column; `qr`: the reference positions, where the file
    of the positions holds them, in the unit and on the side of q.

    A name may be the number of the column (from 1) in a file without header, or an (N, n) array of a .npz or .mat file, which stands for its n columns.
    """

    t: str | None = None
    q: tuple[str, ...] = ()
    tau: tuple[str, ...] = ()
    qr: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for key in ("q", "tau", "qr"):
            names = getattr(self, key)
            double = next((name for name in names if names.count(name) > 1), None)
            _require(double is None, (key,), f"{double!r} twice; expected one column per joint")


@dataclass(frozen=True)
class Units:
    """Units of the columns: one, or one per joint, by any name that `runtime.settings.units` knows: rad, deg, counts, mm; N*m, mA, ozf*inch; s, us.

    Counts need the counts per revolution; units of current and voltage are turned into torque by the torque constant.
    """

    t: str = "s"
    q: str | tuple[str, ...] = "rad"
    tau: str | tuple[str, ...] = "N*m"

    def __post_init__(self) -> None:
        for key, check in (("t", time_unit), ("q", position_unit), ("tau", torque_unit)):
            given = getattr(self, key)
            for i, unit in enumerate(given if isinstance(given, tuple) else (given,)):
                try:
                    check(unit)
                except InputError as e:
                    raise SettingsError(e.message, path=(key, i) if isinstance(given, tuple) else (key,)) from None


@dataclass(frozen=True)
class Scale:
    """Factors on the columns before their unit applies: a number, one per joint, or the name of a scalar in the file (EMPS: force = gtau*vir)."""

    q: float | tuple[float, ...] | str = 1.0
    tau: float | tuple[float, ...] | str = 1.0


@dataclass(frozen=True)
class Resample:
    """Time stamps that are not uniform, made so; nothing is resampled unless this is there.

    rate : Hz; default: record.rate, else the mean rate of the record.
    method : "cubic" or "linear": interpolated, the stamps being the instants of the samples; "count": the samples as they are, for a logger whose stamps
        jitter while the controller samples uniformly.
    gaps : "refuse" a record with gaps or with time that goes back, or "split" it there into records of their own.
    longest : steps up to so many sampling periods are bridged, longer ones are gaps.   shortest : s; pieces shorter than that are left out.
    """

    rate: float | None = None
    method: Literal["cubic", "linear", "count"] = "cubic"
    gaps: Literal["refuse", "split"] = "refuse"
    longest: float = 3.0
    shortest: float = 0.5

    def __post_init__(self) -> None:
        _require(self.rate is None or self.rate > 0, ("rate",), f"{self.rate} Hz; expected a positive rate")
        _require(self.longest > 1, ("longest",), f"{self.longest}; expected more than one sampling period")
        _require(self.shortest >= 0, ("shortest",), f"{self.shortest} s; expected 0 or more")


@dataclass(frozen=True)
class RecordSettings:
    """One measured record, or several alike: where they lie and what their columns mean.

    files : one file with everything, or two: positions (and time), then torques. Relative to the study file, or files of `dataset`.
    also : files of further records with the same settings, each a record of its own: [b.csv, c.csv], or pairs of files.
    side : "motor" (qm = R (q - offset), tau = R' u, by the drives of the robot) or "joint".
    torque_side : the same of tau alone, where it differs: "motor" for joint angles beside motor currents. Default: side.
    rate : sampling rate, Hz; may be left out where there is a time column.
    counts_per_revolution : where the unit of q is counts; of one turn of the encoder, on the side of q.
    torque_constant : N*m/A or N*m/V where the unit of tau is one of current or voltage (A, mA, V); default: that of the robot's drives.
        On the side of tau: of the motor, or with the gear in it where tau is of the joint.
    coupling : use the off-diagonal part of R for "both", for "position" or "torque" alone, or for "none".
    jitter : largest deviation of the time column from a uniform grid, in sampling periods.
    topic : of a bag, where it holds several of sensor_msgs/JointState.
    decimal : how a text file writes decimals, "." or "," (columns then separated by semicolons, tabs or blanks).
    resample : how a time column that is not uniform is made so; null: it is refused.
    """

    files: tuple[str, ...] = ()
    columns: Columns = field(default_factory=Columns)
    side: Literal["motor", "joint"] = "joint"
    torque_side: Literal["motor", "joint"] | None = None
    rate: float | None = None
    units: Units = field(default_factory=Units)
    scale: Scale = field(default_factory=Scale)
    counts_per_revolution: Number | None = None
    torque_constant: Number | None = None
    coupling: Literal["both", "position", "torque", "none"] = "both"
    jitter: float = 0.1
    dataset: str | None = None
    name: str | None = None
    topic: str | None = None
    decimal: Literal[".", ","] = "."
    resample: Resample | None = None
    also: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        for i, files in enumerate(self.also):
            _require(
                len(files) == len(self.files),
                ("also", i),
                f"{len(files)} files; expected {len(self.files)}, as in files: {list(self.files)}",
            )
        _require(len(self.files) <= 2, ("files",), f"{len(self.files)} files; expected one, or two (positions, then torques)")
        _require(self.rate is None or self.rate > 0, ("rate",), f"{self.rate} Hz; expected a positive rate")
        _require(0 < self.jitter < 0.5, ("jitter",), f"{self.jitter}; expected a fraction of a sampling period between 0 and 0.5")
        counts = any(position_unit(unit)[0] == "counts" for unit in _each(self.units.q))
        _require(self.counts_per_revolution is not None or not counts, ("counts_per_revolution",), "missing; positions in counts need it")
        _require(
            self.counts_per_revolution is None or counts,
            ("counts_per_revolution",),
            f"given, but units.q is {', '.join(_each(self.units.q))}; say counts there, or leave this out",
        )
        commands = any(torque_unit(unit)[0] in COMMANDS for unit in _each(self.units.tau))
        _require(
            self.torque_constant is None or commands,
            ("torque_constant",),
            f"given, but units.tau is {', '.join(_each(self.units.tau))}; say mA, A or V there, or leave this out",
        )

    @property
    def sides(self) -> tuple[str, str]:
        """Of the positions and of the torques."""
        return self.side, self.torque_side or self.side


def each_record(settings: tuple[RecordSettings, ...]) -> tuple[RecordSettings, ...]:
    """One RecordSettings per record: those of `also` in entries of their own, called by their files."""
    return tuple(
        single
        for record in settings
        for single in (replace(record, also=()), *(replace(record, files=files, also=(), name=None) for files in record.also))
    )


def _each(units: str | tuple[str, ...]) -> tuple[str, ...]:
    return units if isinstance(units, tuple) else (units,)


def _require(ok: bool, path: tuple[str | int, ...], message: str) -> None:
    if not ok:
        raise SettingsError(message, path=path)
