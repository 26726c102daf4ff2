"""Conversion of the columns of a file to joint positions and torques in SI units.

First the columns are found by name, then scale, units and drives are applied. Units and side (joint
or motor) are explicit in the settings, never guessed. A file whose columns are called t, q1 ... qn,
tau1 ... taun needs no column names.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.core.drives import Drives
from runtime.ground.errors import InputError
from runtime.reading.likely_columns import likely_columns
from runtime.reading.settings import BY_NAME, NONE, Columns, RecordSettings
from runtime.reading.table import Array, Table
from runtime.reading.units import COMMANDS, likely_time_unit, position_unit, torque_unit

TIMES = ("t", "time")  # names of a time that the settings do not name
WORDS = {
    "q": ("q", "pos", "position"),
    "tau": ("tau", "torque", "effort"),
    "qr": ("qr", "reference"),
}  # beside the name of a joint


def column_names(
    settings: RecordSettings,
    first: Table,
    last: Table,
    joints: Sequence[str] = (),
    motors: Sequence[bool] = (),
) -> Columns:
    """Find the names of the columns of a record: the names in the settings, or else default names.

    Default names are t or time, q1 ... qn, tau1 ... taun; in a bag, the joints of its messages.

    Parameters
    ----------
    first, last : Table
        Files of the positions and of the torques.
    joints : sequence of str
        Names of the joints of the robot, in its order. The names are used for `names` in the
        settings, and for a bag without names in the settings.
    motors : sequence of bool
        Whether each joint of the robot has a motor; empty: all joints have a motor.
    """
    given = settings.columns
    t = given.t
    if t is None and settings.rate is None:
        t = next((name for name in TIMES if name in first.names), None)
        if t == "time" and settings.units.t == "s":
            _require_seconds(first, t)
    q_ref: tuple[str, ...] = ()
    if given.q_ref:
        q_ref = _meant(first, "qr", "", given.q_ref, joints)
    elif "qr1" in first.names:
        q_ref = _numbered("qr", first, joints)
    if first.joints is not None and settings.units.t != "s":
        raise InputError(
            f"record.units.t is {settings.units.t}, but time stamps of bags are in s; remove record.units.t",
            file=first.file,
        )
    q = _meant(first, "q", "position", given.q, joints)
    tau: tuple[str, ...] = ()
    by_wrench = given.wrench and not given.flies and not given.tau and "tau1" not in last.names
    if settings.by_law and settings.controller is None:
        raise InputError(
            "record.columns has q_ref but no tau; set record.columns.tau, or controller: {kp: ..., kd: ...} to compute the torque from this law",
            file=last.file,
        )
    if not by_wrench and not settings.by_law:
        as_q = last.joints is not None or given.q == BY_NAME
        tau = _meant(last, "tau", "effort", given.tau or (given.q if as_q else ()), joints)
    if given.q == BY_NAME and first is last and set(q) & set(tau):
        raise InputError(
            f"the columns {', '.join(q)} would be read as both positions and torques; give the "
            "columns of the torques in record.columns.tau",
            file=first.file,
        )
    if not {*q} <= {*first.names} and {*q} <= {*last.names} and {*tau} <= {*first.names}:
        raise InputError(
            f"{first.file} contains the torques and {last.file} the positions; in record.files, list the file of positions first"
        )
    return replace(given, t=t, q=q, tau=_of_motors(tau, motors), q_ref=q_ref)


def _require_seconds(table: Table, name: str) -> None:
    """Raise InputError if the steps of a time that the settings do not name are no seconds."""
    unit = likely_time_unit(table.columns[name])
    if unit != "s":
        raise InputError(
            f"the steps of this time are too long for seconds; set record.units.t: {unit}, or {name} in record.columns.t if they are seconds",
            file=table.file,
            column=name,
            remedy={"columns": {"t": name}, "units": {"t": unit}},
        )


def _of_motors(names: tuple[str, ...], motors: Sequence[bool]) -> tuple[str, ...]:
    """Insert the mark for "no column" into the list of torque columns, for each joint without a
    motor.

    names : columns of all joints, or of the joints with a motor only. Other names are returned
    unchanged.
    """
    if len(names) == len(motors):
        names = tuple(name for name, motor in zip(names, motors, strict=True) if motor)
    if len(names) != sum(motors):
        return names
    given = iter(names)
    return tuple(next(given) if motor else NONE for motor in motors)


def _meant(
    table: Table, key: str, quantity: str, names: Sequence[str], joints: Sequence[str]
) -> tuple[str, ...]:
    """Find the columns of positions, torques or references by their names in the settings.

    key : "q", "tau" or "qr". quantity : name of the same quantity in bags, such as "effort".
    """
    if names == BY_NAME and not joints:
        raise InputError(
            f"record.columns.{key} is {BY_NAME[0]}, but some joints of the robot have no name; add labels to the robot file",
            file=table.file,
        )
    if table.joints is not None and quantity:
        ours = names == BY_NAME or (not names and joints and {*joints} <= {*table.joints})
        chosen = joints if ours else names or _numbered_joints(table)
        return tuple(f"{name}.{quantity}" if name in table.joints else name for name in chosen)
    if names == BY_NAME:
        return tuple(_of_joint(table, key, joint) for joint in joints)
    return tuple(names) or _numbered(key, table, joints)


def _numbered(quantity: str, table: Table, joints: Sequence[str]) -> tuple[str, ...]:
    """Find the columns q1, q2 ... (or tau1, tau2 ...), in the order of their numbers."""
    matches = [re.fullmatch(rf"{quantity}([0-9]{{1,4}})", name) for name in table.names]
    numbered = sorted((int(match[1]), match[0]) for match in matches if match)
    if not numbered:
        raise InputError(
            f"no columns {quantity}1, {quantity}2 ... among {', '.join(table.names)}; give the column names in a study file, record.columns.{quantity}",
            file=table.file,
            remedy=likely_columns(table.columns, joints),
        )
    return tuple(name for _, name in numbered)


def _numbered_joints(table: Table) -> tuple[str, ...]:
    """Return the names of the joints of a bag, sorted by the number in each name.

    The names must differ in a number only, 1, 2 ... or 0, 1 ...; otherwise an InputError is raised.
    """
    joints = table.joints or ()
    matches = [re.fullmatch(r"(.*?)(\d{1,3})", joint) for joint in joints]
    numbers = sorted((match[1], int(match[2]), match[0]) for match in matches if match)
    stem, start, _ = min(numbers, default=("", 2, ""))
    expected = [(stem, start + k) for k in range(len(joints))]
    if start > 1 or [(other, k) for other, k, _ in numbers] != expected:
        raise InputError(
            f"{table.topic} has the joints {', '.join(joints) or '(none)'}; list the joints of the robot, in the order of the robot file, in record.columns: {{q: [...], tau: [...]}}",
            file=table.file,
        )
    return tuple(joint for *_, joint in numbers)


def _of_joint(table: Table, key: str, joint: str) -> str:
    """Find the column of one joint by its name, for instance q_elbow, elbow.pos or effort/elbow.

    The column has the name of the joint, alone or with a word like pos or tau; a name with such a
    word is preferred.
    """
    forms = {
        form
        for word in WORDS[key]
        for mark in "_./"
        for form in (f"{joint}{mark}{word}", f"{word}{mark}{joint}")
    }
    hits = [name for name in table.names if name in forms]
    if not hits:
        hits = [name for name in table.names if name == joint]
    if len(hits) == 1:
        return hits[0]
    what = f"no column {joint}, {key}_{joint} or the like among {', '.join(table.names)}"
    if hits:
        what = f"found the columns {', '.join(hits)}"
    raise InputError(
        f"{what}; expected one column for joint {joint}, give the columns in record.columns.{key}",
        file=table.file,
    )


@dataclass(frozen=True, eq=False)
class Conversion:
    """Conversion of measured positions and torques to the joint side and SI units.

    Attributes
    ----------
    positions, commands : ndarray, shape (n,)
        Factors on the columns of positions (to rad or m) and of commands.
    of_positions, of_torques : Drives or None
        Drives between the joints and the place of measurement; None: measured at the joints.
    drives : Drives or None
        Drives of the robot, with the coupling of the settings of the record.
    constant : ndarray, shape (n,), N m/A or N m/V, or None
        Torque constants, of commands that are currents or voltages.
    command : str
        A or V, if the commands stay in this unit; else "".
    turns : ndarray of bool, shape (n,)
        Which columns of positions are angles that jump back after a full turn.
    """

    positions: Array
    commands: Array
    of_positions: Drives | None
    of_torques: Drives | None
    drives: Drives | None
    constant: Array | None = None
    turns: Array | None = None
    command: str = ""

    def position(self, q: Array) -> Array:
        """Convert positions q of the file, shape (N, n), to joint positions, rad or m."""
        q = q * self.positions
        if self.turns is not None:  # without jumps of a full turn
            q = np.where(self.turns, np.unwrap(q, axis=0), q)
        return self._at_joints(q)

    def _at_joints(self, q: Array) -> Array:
        return q if self.of_positions is None else self.of_positions.joint_position(q)

    @property
    def follows(self) -> Array | None:
        """Whether the position of joint j depends on position column i of the file, shape (n, n).

        None means that the columns are joints.
        """
        if self.of_positions is None:
            return None
        root = np.linalg.inv(self.of_positions.motion)
        return np.asarray(np.abs(root) > 1e-12 * np.abs(root).max(axis=1, keepdims=True))

    def velocity(self, qd: Array) -> Array:
        """Convert velocities qd of the file, shape (N, n), to joint velocities, rad/s or m/s."""
        qd = qd * self.positions
        return np.asarray(self._at_joints(qd) - self._at_joints(np.zeros_like(qd[:1])))

    def torque(self, tau: Array) -> Array:
        """Convert torques or commands tau of the file, shape (N, n), to joint torques, N m or N."""
        tau = tau * self.commands
        return tau if self.of_torques is None else self.of_torques.joint_torque(tau)


def conversion(
    settings: RecordSettings, drives: Drives | None, first: Table, last: Table, n: int
) -> Conversion:
    """Make the Conversion of measured positions and torques to the joint side and SI units.

    Parameters
    ----------
    drives : Drives or None
        Drives of the robot.
    first, last : Table
        Files of the positions and of the torques.
    n : int
        Number of joints.
    """
    units_of_positions, angles = _position_units(settings, n)
    positions = _scale(settings.scale.q, first, n, "scale.q") * units_of_positions
    turns = angles if settings.unwrap else None
    scale = _scale(settings.scale.tau, last, n, "scale.tau")
    if "motor" in settings.sides and drives is None:
        key = "side" if settings.side == "motor" else "torque_side"
        raise InputError(
            f"record.{key} is motor but the robot file has no drives; give drives (ratio, torque_constant) in the robot file. For a URDF or MJCF, set {key}: joint and record.scale: {{q: 1/ratio, tau: ratio}} as numbers, for instance {{q: 0.01, tau: 100}}",
            file=first.file,
        )
    units, constant = _torque_constant(settings, drives, n)
    command = _command(settings, n) if settings.torque_constant == "none" else ""
    factors = units if constant is None else units * constant
    if "motor" not in settings.sides:
        return Conversion(positions, scale * factors, None, None, drives, constant, turns, command)
    assert drives is not None
    motors = replace(drives, torque_constant=factors, coupling=settings.coupling)
    side_of_positions, side_of_torques = settings.sides
    at_motors = side_of_torques == "motor"
    return Conversion(
        positions,
        commands=scale if at_motors else scale * factors,
        of_positions=motors if side_of_positions == "motor" else None,
        of_torques=motors if at_motors else None,
        drives=drives.decoupled(settings.coupling),
        constant=constant,
        turns=turns,
        command=command,
    )


def require_alike(
    names: Columns, first: Table, last: Table, q: tuple[int, ...], tau: tuple[int, ...]
) -> None:
    """Raise InputError unless positions and torques have the same shape and belong to one record.

    q, tau : shapes of the positions and of the torques.
    """
    if (
        first is not last
        and not set(names.q) & set(names.tau)
        and {*names.tau} <= {*first.names}
        and {*names.q} <= {*last.names}
    ):
        raise InputError(
            f"{first.file} and {last.file} both contain positions and torques, but two files in "
            "record.files must be the positions and the torques of one record; give a further "
            f"record as `also: [{last.file}]`"
        )
    if q[1:] != tau[1:]:
        raise InputError(
            f"{q[1]} columns of positions ({', '.join(names.q)}), {tau[1]} of torques ({', '.join(names.tau)}); expected one column of positions and one of torques per joint",
            file=first.file,
        )
    if q != tau:
        raise InputError(
            f"{q[0]} samples of positions in {first.file}, {tau[0]} of torques in {last.file}; cut "
            "both files to the same time"
        )


def _per_joint(
    value: float | Sequence[float], n: int, key: str, table: Table | None = None
) -> Array:
    x = np.atleast_1d(np.asarray(value, dtype=float))
    if len(x) not in (1, n):
        raise InputError(
            f"record.{key} has {len(x)} values; expected one value, or {n} values (one per joint)",
            file=None if table is None else table.file,
        )
    return np.broadcast_to(x, (n,))


def _scale(scale: float | tuple[float, ...] | str, table: Table, n: int, key: str) -> Array:
    return _per_joint(table.scalar(scale) if isinstance(scale, str) else scale, n, key, table)


def _units(units: str | tuple[str, ...], n: int, key: str) -> tuple[str, ...]:
    each = units if isinstance(units, tuple) else (units,) * n
    if len(each) != n:
        raise InputError(
            f"record.{key} has {len(each)} units; expected one unit, or {n} units (one per joint)"
        )
    return each


def _position_units(settings: RecordSettings, n: int) -> tuple[Array, Array]:
    """Return the factors from the units of q to rad or m, and which positions are angles.

    Both have shape (n,).
    """
    units = [position_unit(unit) for unit in _units(settings.units.q, n, "units.q")]
    counts = np.ones(n)
    if settings.counts_per_revolution is not None:
        counts = _per_joint(settings.counts_per_revolution, n, "counts_per_revolution")
    factors = np.array([factor for _, factor in units])
    factors = factors / np.where([kind == "counts" for kind, _ in units], counts, 1.0)
    return factors, np.array([kind != "length" for kind, _ in units])


def _command(settings: RecordSettings, n: int) -> str:
    """Return the unit A or V of all torque columns; raise InputError if they have several units."""
    units = {torque_unit(name)[0] for name in _units(settings.units.tau, n, "units.tau")}
    if len(units) > 1 or settings.columns.tau_known:
        raise InputError(
            "record.torque_constant: none needs torque columns that are all currents or all voltages, "
            "and no record.columns.tau_known; otherwise give the torque constant (N*m/A) of each "
            "joint, 1 for a column in N*m"
        )
    return {"current": "A", "voltage": "V"}[units.pop()]


def _torque_constant(
    settings: RecordSettings, drives: Drives | None, n: int
) -> tuple[Array, Array | None]:
    """Return the factors from the units of tau to SI, shape (n,), and the torque constants.

    The torque constant is 1 for a joint whose unit is a unit of torque or force. If all joints have
    such units, None replaces the constants.
    """
    names = _units(settings.units.tau, n, "units.tau")
    units = [torque_unit(name) for name in names]
    factors = np.array([factor for _, factor in units])
    commands = [kind in COMMANDS for kind, _ in units]
    if not any(commands):
        return factors, None
    unknown = "If the constants are unknown, set record.torque_constant: none; the values are then per A or V"
    if settings.torque_constant == "none":
        constant = np.ones(n)
    elif settings.torque_constant is not None:
        constant = _per_joint(settings.torque_constant, n, "torque_constant")
    elif drives is not None and settings.sides[1] == "motor":
        if not drives.declared:
            raise InputError(
                f"tau is in {', '.join(dict.fromkeys(names))} but the robot file has no drives.torque_constant (N*m/A); set this constant in the robot file or as record.torque_constant, from the data sheet of the motors. {unknown}"
            )
        constant = drives.torque_constant
    else:
        by_drives = "for currents of the motors set record.torque_side: motor, to use the gears and torque constants of the robot file; else "
        raise InputError(
            f"tau is in {', '.join(dict.fromkeys(names))} but there is no torque constant; {by_drives if drives is not None else ''}set record.torque_constant (N*m/A) of every joint, including the gear. {unknown}",
            remedy={"torque_side": "motor"} if drives is not None and drives.declared else None,
        )
    return factors, np.where(commands, constant, 1.0)
