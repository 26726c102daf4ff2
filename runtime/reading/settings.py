"""Settings of measured records: their files, their columns, and treatment of their time stamps.

The settings are a part of a Study. For the sections of the chapter, the module adds units of
speeds, and records that are predicted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, field_validator

from runtime.core import study as chapter
from runtime.core.quaternions import rotation_of
from runtime.core.record import BASE_IMU, BASE_MOTION, BASE_POSITION, BASE_QUATERNION, WRENCH
from runtime.ground.settings import (
    Flag,
    Many,
    NotNegative,
    PerJoint,
    Positive,
    Real,
    Settings,
    Text,
    require,
)
from runtime.loop.settings import Controller
from runtime.reading.units import COMMANDS, position_unit, speed, time_unit, torque_unit


def _one_by_one(names: Any) -> Any:
    if isinstance(names, Mapping):
        raise ValueError(
            f"a mapping of {', '.join(map(str, names))}; expected a list, one column per joint in "
            "the order of the robot file"
        )
    return names


def _distinct(names: tuple[str, ...]) -> tuple[str, ...]:
    double = next((name for name in names if names.count(name) > 1 and name != NONE), None)
    if double is not None:
        raise ValueError(f"column {double!r} is given twice; expected one column per joint")
    return names


def _known(read: Callable[[str], Any]) -> AfterValidator:
    def check(unit: str) -> str:
        read(unit)
        return unit

    return AfterValidator(check)


Array = np.ndarray
NONE = "0"  # in place of a column: no such torque on this joint
Names = Annotated[Many[Text], BeforeValidator(_one_by_one), AfterValidator(_distinct)]
TimeUnit = Annotated[Text, _known(time_unit)]
PositionUnit = Annotated[Text, _known(position_unit)]
TorqueUnit = Annotated[Text, _known(torque_unit)]
Factor = Annotated[PerJoint[Real] | Text, Field(union_mode="left_to_right")]


QUANTITIES = ("t", "q", "tau", "q_r", "qd", "qd_ref", "tau_ff", "tau_known", "law_v")
BY_NAME = ("names",)  # columns found by the names of the joints


class Columns(Settings):
    """Names of the columns of a record file, one per joint.

    A name may be the number of the column (from 1) in a file without header, or an (N, n) array of
    a .npz or .mat file, which has n columns. `names` means the labels of the joints in the robot
    file: a column has the name of the joint, or q_ and the joint, joint.position, tau_joint,
    joint/effort ...; `names` for q also applies to tau, if tau is left out.

    Attributes
    ----------
    t : str or None
        Time; null for a record without time column.
    q : tuple of str
        Positions.
    tau : tuple of str
        Torques. The number 0 in place of a name means that this joint has no motor, so that its
        torque is zero.
    q_ref : tuple of str
        Reference positions, if the file of the positions holds them; unit and side are those of q.
    qr : tuple of str
        Earlier name of q_ref.
    qd : tuple of str
        Velocities that were recorded with the positions, in the same file; unit and side of q, per
        s. Velocities replace differences of q at the frequencies at which they are more accurate.
    qd_ref : tuple of str
        Reference velocities, in the same file and unit as qd, for the law of a controller.
    tau_ff : tuple of str
        Feed-forward torques that the controller added, in the file of the torques; unit and side
        are those of tau. Methods that simulate the controller need them, and the torque of a law.
    tau_known : tuple of str
        Torques of the drives that do not come from the model (a counterbalance, a cable), computed
        elsewhere; N m or N, joint side. Known torques are subtracted from tau. The number 0 in
        place of a name means that this joint has none.
    channels : mapping of str to str
        Column of each channel.NAME in the laws of the robot file, without conversion, in the file of
        the positions: {temperature: T_motor}.
    wrench : mapping of int or str to six str
        Three forces and three moments of a sensor in the axes of a frame, about its origin, by the
        number of the frame, in the file of the positions, N and N m: {0: [fx, fy, fz, mx, my, mz]}
        below the robot, {7: [...]} ahead of link 7. A wrench may be given in addition to tau, or in
        place of tau. For a robot whose base moves or is free, it is the force and the moment by
        which the world acts on the link of the frame, in the axes of the frame about its origin. A
        name of a link or site of the robot file may then replace the number, {foot: [...]}. "none"
        means that nothing acts: the robot flies.
    """

    t: Text | None = None
    q: Names = ()
    tau: Names = ()
    q_ref: Names = ()
    qr: Names = ()
    qd: Names = ()
    qd_ref: Names = ()
    tau_ff: Names = ()
    tau_known: Names = ()
    channels: Mapping[Text, Text] = field(default_factory=dict)
    wrench: Literal["none"] | Mapping[Annotated[int, Field(ge=0)] | Text, Names] = field(
        default_factory=dict
    )

    @property
    def flies(self) -> bool:
        """Whether no wrench acts on the robot from outside."""
        return self.wrench == "none"

    @property
    def further(self) -> dict[str, tuple[str, ...]]:
        """Columns of signals that belong to no joint: channels (temperature ...) and sensor
        wrenches.

        The columns are listed by the name of the channel or wrench.
        """
        own = {name: (column,) for name, column in self.channels.items()}
        wrench = {} if isinstance(self.wrench, str) else self.wrench
        return own | {f"{WRENCH}{frame}": names for frame, names in wrench.items()}

    def __post_init__(self) -> None:
        require(
            not {*self.channels} & {*QUANTITIES},
            "a channel must not have the name of another signal of a record; rename the channel",
            "channels",
        )
        require(
            not (self.qr and self.q_ref),
            "given together with q_ref, which means the same; remove qr",
            "qr",
        )
        object.__setattr__(self, "q_ref", self.q_ref or self.qr)
        object.__setattr__(self, "qr", ())


class Mounting(Settings):
    """Place of a sensor on the base.

    Attributes
    ----------
    position : tuple of three float, m
        Place of the sensor in frame 0.
    rotation : tuple of three float, rad
        Roll, pitch and yaw of its axes in frame 0, R = Rz(yaw) Ry(pitch) Rx(roll).
    """

    position: tuple[Real, Real, Real] = (0.0, 0.0, 0.0)
    rotation: tuple[Real, Real, Real] = (0.0, 0.0, 0.0)


class BaseColumns(Settings):
    """Columns of the motion of a base that moves, in the file of the positions, SI.

    The motion has one of three forms: nine signals; the pose of frame 0 in the world, in whose axes
    the robot file gives gravity; or a gyroscope and an accelerometer. The filters are those of the
    joints.

    Attributes
    ----------
    motion : tuple of nine str
        Angular velocity w0 (rad/s), angular acceleration wd0 (rad/s**2), and acceleration a0 of the
        origin of frame 0 minus gravity (m/s**2), in the axes of frame 0.
    position : tuple of three str
        Origin of frame 0 in the world, m.
    quaternion : tuple of four str
        Orientation of frame 0 in the world.
    order : str
        Order of the columns of the quaternion: wxyz or xyzw.
    gyroscope : tuple of three str
        Angular velocity of the base, in the axes of the sensor.
    accelerometer : tuple of three str
        Acceleration of the place of the sensor minus gravity, in its axes.
    mounting : Mounting
        Place and axes of the sensor in frame 0.
    gyroscope_unit : str
        rad/s or deg/s.
    accelerometer_unit : str
        m/s**2 or g (9.80665 m/s**2).
    specific_force : bool
        Whether the accelerometer reads + g along the upward axis at rest; false: - g.
    biases : str or None
        fit: constant biases of gyroscope and accelerometer are fitted together with the parameters,
        one set for all records. Default: the sensor has none.
    delay : float, s
        Time by which the signals of the base were recorded later than the positions of the joints.
    """

    motion: Names = ()
    position: Names = ()
    quaternion: Names = ()
    order: Literal["wxyz", "xyzw"] = "wxyz"
    gyroscope: Names = ()
    accelerometer: Names = ()
    mounting: Mounting = field(default_factory=Mounting)
    gyroscope_unit: Literal["rad/s", "deg/s"] = "rad/s"
    accelerometer_unit: Literal["m/s**2", "g"] = "m/s**2"
    specific_force: Flag = True
    biases: Literal["fit"] | None = None
    delay: Real = 0.0

    def __post_init__(self) -> None:
        require(
            len(self.columns) <= 1 or {*self.columns} == {BASE_POSITION, BASE_QUATERNION},
            "more than one form is given; give motion, or position and quaternion, or gyroscope and "
            "accelerometer",
            "motion",
        )
        require(
            bool(self.gyroscope) == bool(self.accelerometer),
            "gyroscope and accelerometer belong together; give both",
            "gyroscope",
        )
        require(
            self.biases is None or bool(self.gyroscope),
            "only gyroscope and accelerometer have biases; give their columns, or remove biases",
            "biases",
        )
        require(
            bool(self.position) == bool(self.quaternion),
            "position and quaternion belong together; give both",
            "position",
        )
        for key, count in COUNTS_OF_BASE.items():
            names = getattr(self, key)
            require(
                len(names) in (0, count), f"{len(names)} columns; expected {count} columns", key
            )

    @property
    def columns(self) -> dict[str, tuple[str, ...]]:
        """Columns by channel of the record; those of the quaternion with the scalar first."""
        Q = (
            self.quaternion
            if self.order == "wxyz"
            else (*self.quaternion[3:], *self.quaternion[:3])
        )
        imu = (*self.gyroscope, *self.accelerometer)
        found = {
            BASE_MOTION: self.motion,
            BASE_POSITION: self.position,
            BASE_QUATERNION: Q,
            BASE_IMU: imu,
        }
        return {channel: names for channel, names in found.items() if names}

    def of_sensor(self, values: Array) -> Array:
        """Convert readings of gyroscope and accelerometer, (N, 6), to w0, f and r, (N, 9).

        The results are in SI, in the axes of frame 0; r is the place of the sensor.
        """
        w, f = np.hsplit(values, 2)
        w = np.deg2rad(w) if self.gyroscope_unit == "deg/s" else w
        f = f * (STANDARD_GRAVITY if self.accelerometer_unit == "g" else 1.0)
        f = f if self.specific_force else -f
        R = rotation_of(self.mounting.rotation)
        r = np.broadcast_to(np.array(self.mounting.position), f.shape)
        return np.hstack([w @ R.T, f @ R.T, r])


COUNTS_OF_BASE = {"motion": 9, "position": 3, "quaternion": 4, "gyroscope": 3, "accelerometer": 3}
STANDARD_GRAVITY = 9.80665  # m/s**2


class Units(Settings):
    """Units of the columns of a record: one unit, such as deg, for all joints, or one per joint.

    Counts need the counts per revolution; the torque constant converts currents and voltages to
    torque.

    Attributes
    ----------
    t : str
        Unit of the time: s, ms, us, ns.
    q : str or tuple of str
        Unit of the positions: rad, deg, rev, counts, m, mm.
    tau : str or tuple of str
        Unit of the torques: N*m, mN*m, N, A, mA, V.
    """

    t: TimeUnit = "s"
    q: PositionUnit | Many[PositionUnit] = "rad"
    tau: TorqueUnit | Many[TorqueUnit] = "N*m"


class Scale(Settings):
    """Factors that multiply the columns of a record before their units are converted.

    A factor is a number, one number per joint, or the name of a scalar in the file.

    Attributes
    ----------
    q : float or tuple of float or str
        Factor on the positions.
    tau : float or tuple of float or str
        Factor on the torques; for instance gtau, if the file contains the scalar gtau with force =
        gtau*vir.
    wrench : float
        Factor on wrenches. A wrench acts from the sensor on the links ahead of it; set -1 if the
        sensor reports the opposite wrench, of the links on the sensor.
    """

    q: Factor = 1.0
    tau: Factor = 1.0
    wrench: Real = 1.0


class Resample(Settings):
    """Settings to resample a record with irregular time stamps; if absent, nothing is resampled.

    Attributes
    ----------
    rate : float or None, Hz
        New sampling rate; default: record.rate, else the mean rate of the record.
    method : str
        cubic and linear interpolate between the stamps; count uses the samples as they are, for a
        logger whose stamps jitter while the controller samples uniformly.
    gaps : str
        Treatment of a record with gaps or with time that goes back: refuse, or split it at these
        places into separate records.
    longest : float, sampling periods
        Steps up to this length are bridged; longer steps are gaps.
    shortest : float, s
        Pieces shorter than this are left out.
    """

    rate: Positive | None = None
    method: Literal["cubic", "linear", "count"] = "cubic"
    gaps: Literal["refuse", "split"] = "refuse"
    longest: Annotated[Real, Field(gt=1)] = 3.0
    shortest: NotNegative = 0.5


class RecordSettings(Settings):
    """Settings of one measured record, or of several records with equal settings: their files,
    columns and units.

    Attributes
    ----------
    files : tuple of str
        One file with all columns, or two files: positions (and time), then torques; a third file
        may contain the known torques. The names are relative to the study file, or name files of
        `dataset`.
    columns : Columns
        Names of the columns.
    base : BaseColumns
        Columns of the motion of the base, for a robot whose base moves.
    side : str
        Place of measurement. motor: qm = R (q - offset) and tau = R' u, by the drives of the robot.
        joint: positions and torques at the joints. link: joint torques of sensors behind the gears,
        which contain nothing of the drives; inertia, viscous and dry friction of drives (Ia, FV,
        FS) are then left out of the columns, and Ia of the base parameters.
    torque_side : str or None
        The side of tau if it differs from that of q: motor for joint angles recorded with motor
        currents. Default: side.
    rate : float or None, Hz
        Sampling rate; may be left out if a time column gives it.
    units : Units
        Units of the columns.
    scale : Scale
        Factors on the columns.
    counts_per_revolution : float or tuple of float or None
        Counts in one turn of the encoder, on the side of q; needed if the unit of q is counts.
    torque_constant : float or tuple of float or "none" or None, N*m/A or N*m/V
        Torque per unit of tau in A, mA or V, on the side of tau: that of the motor, or for the
        joint with the gear included. Default: the constants of the robot's drives. "none": the
        constants are unknown; the model is fitted in A or V, and all values are in this unit.
    coupling : str
        Quantities for which the off-diagonal elements of the matrix R of gear ratios are used:
        both, position, torque or none.
    delay : float or tuple of float, s
        Time by which the torques are late relative to the positions; torques are read later by this
        time.
    jitter : float, sampling periods
        Largest difference of the time column from a uniform grid.
    dataset : str or None
        Public dataset that holds the files.
    name : str or None
        Name of the record in results; default: that of its first file.
    simulated : bool
        Whether the record was simulated, not measured; results then say so.
    topic : str or None
        Topic of a bag with several topics of the type sensor_msgs/JointState.
    decimal : str
        Decimal sign of a text file, "." or "," (columns then separated by semicolons, tabs or
        blanks).
    unwrap : bool
        Whether angles that jump back after a full turn of the side on which they were recorded (180
        to -180 degrees) are made continuous, from the first sample on. The first sample has to be
        in the right turn.
    resample : Resample or None
        Conversion of a time column that is not uniform; null: such a column is refused.
    controller : Controller or None
        Controller whose law gives the torque, if q_ref is named and tau is not; default: that of the
        study.
    also : tuple of tuple of str
        Files of further records with the same settings, each a separate record: [b.csv, c.csv],
        or pairs of files.
    """

    files: Many[Text] = ()
    columns: Columns = field(default_factory=Columns)
    base: BaseColumns = field(default_factory=BaseColumns)
    side: Literal["motor", "joint", "link"] = "joint"
    torque_side: Literal["motor", "joint", "link"] | None = None
    rate: Positive | None = None
    units: Units = field(default_factory=Units)
    scale: Scale = field(default_factory=Scale)
    counts_per_revolution: PerJoint[Real] | None = None
    torque_constant: PerJoint[Real] | Literal["none"] | None = None
    coupling: Literal["both", "position", "torque", "none"] = "both"
    delay: PerJoint[Real] = 0.0
    jitter: Annotated[Positive, Field(lt=0.5)] = 0.1
    dataset: Text | None = None
    name: Text | None = None
    simulated: Flag = False
    topic: Text | None = None
    decimal: Literal[".", ","] = "."
    unwrap: Flag = False
    resample: Resample | None = None
    controller: Controller | None = None
    also: Many[Many[Text]] = ()

    def __post_init__(self) -> None:
        no_law = self.controller is not None and not self.by_law
        require(
            not no_law,
            "given, but the torque needs no control law; remove controller, or give columns.q_ref and no columns.tau",
            "controller",
        )
        most = 3 if self.columns.tau_known else 2
        message = f"{len(self.files)} files; expected one, or two (positions, then torques)"
        require(
            len(self.files) <= most,
            message + (", and one of known torques" if most > 2 else ""),
            "files",
        )
        for i, files in enumerate(self.also):
            message = (
                f"{len(files)} files; expected {len(self.files)}, as in files: {list(self.files)}"
            )
            require(len(files) == len(self.files), message, "also", i)
        counts = any(position_unit(unit)[0] == "counts" for unit in _each(self.units.q))
        commands = any(torque_unit(unit)[0] in COMMANDS for unit in _each(self.units.tau))
        require(
            self.counts_per_revolution is not None or not counts,
            "missing; positions in counts need this key",
            "counts_per_revolution",
        )
        for key, used, unit, units in (
            ("counts_per_revolution", counts, "q", "counts"),
            ("torque_constant", commands, "tau", "mA, A or V"),
        ):
            message = (
                f"given, but units.{unit} is {', '.join(_each(getattr(self.units, unit)))}; "
                f"set units.{unit} to {units}, or remove this key"
            )
            require(getattr(self, key) is None or used, message, key)

    @property
    def by_law(self) -> bool:
        """Whether a control law computes the torque: the settings name q_ref, but no column tau."""
        return bool(self.columns.q_ref) and not self.columns.tau

    @property
    def sides(self) -> tuple[str, str]:
        """Sides at which positions and torques were measured, each "motor", "joint" or "link"."""
        return self.side, self.torque_side or self.side


def with_law(
    records: Sequence[RecordSettings], controller: Controller | None
) -> tuple[RecordSettings, ...]:
    """Set the control law `controller` in each record whose torque that law has to compute.

    A record that names its own controller is not changed.
    """
    return tuple(
        replace(record, controller=record.controller or controller) if record.by_law else record
        for record in records
    )


def each_record(settings: Sequence[RecordSettings]) -> tuple[RecordSettings, ...]:
    """Return one RecordSettings per record: the files in `also` become separate records.

    The further records have no name.
    """
    return tuple(
        single
        for record in settings
        for single in (
            replace(record, also=()),
            *(replace(record, files=files, also=(), name=None) for files in record.also),
        )
    )


INHERITED = (  # keys that belong together: all are those of another record, or none
    ("columns",),
    ("side", "torque_side", "coupling"),
    ("units", "scale", "counts_per_revolution", "torque_constant"),
    ("rate", "jitter", "resample"),
    ("unwrap",),
    ("topic",),
    ("decimal",),
)
"""Keys of a record with a load that are those of the records without it, if left out."""


def inherited(record: Any, others: Any) -> Any:
    """Add to the mapping of a record the settings of the first of `others` that it leaves out.

    Both are settings as in a file, or RecordSettings; anything else is returned as it is, and
    refused later.
    """
    first = others[0] if isinstance(others, list | tuple) and others else others
    if not (isinstance(record, Mapping) and isinstance(first, Mapping | RecordSettings)):
        return record
    like = first if isinstance(first, Mapping) else {k: getattr(first, k) for k in vars(first)}
    free = [keys for keys in INHERITED if not any(key in record for key in keys)]
    return {**{key: like[key] for keys in free for key in keys if key in like}, **record}


Records = Annotated[Many[RecordSettings], AfterValidator(each_record)]
"""Settings of one record or of several, one entry each."""


def _each(units: str | tuple[str, ...]) -> tuple[str, ...]:
    return units if isinstance(units, tuple) else (units,)


class Rows(chapter.Rows):
    """Settings that select the rows of W and Y that are used.

    Attributes
    ----------
    low_speed : float or tuple of float or str, rad/s or m/s
        Rows of joint j with |qd_j| below this speed are left out, because sign(qd) is noise in
        them. A text may have another unit: 2 rpm. auto: the speed is found from the record for
        joints with dry friction in the model whose torques at rest differ from the model, and is
        zero for other joints.
    """

    _with_unit = field_validator("low_speed", mode="before")(speed)


class ValidateSettings(chapter.ValidateSettings):
    """Settings for validation: data to which parameters are fitted, and data that they predict.

    Attributes
    ----------
    record : tuple of RecordSettings
        Further records, predicted with the parameters of the study.
    """

    record: Records = ()
