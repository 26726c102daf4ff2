"""Reading of the text of `ros2 topic echo /joint_states --csv`, which has no names of columns.

    1700000000,123456789,base_link,shoulder,elbow,0.1,0.2,0.0,0.0,5.1,-2.3

A line is a message sensor_msgs/JointState: seconds and nanoseconds of the stamp, frame_id, the names
of n joints, then n positions, n velocities and n efforts. An array without values is one empty field.
The lines are read as the messages of a bag (`runtime.reading.joint_states`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from runtime.ground.errors import InputError, printable
from runtime.reading.joint_states import NANOSECONDS, QUANTITIES, JointState, JointTable, table_of
from runtime.reading.table import Array

SECONDS, FRACTION = re.compile(r"[0-9]{1,10}"), re.compile(r"[0-9]{1,9}")
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf)")
LOST = re.compile(r"A message was lost|total count")  # lines between the messages
FIRST = 3  # field of the first joint


def is_echo(line: str) -> bool:
    """Whether a line is a message JointState in the text of `ros2 topic echo --csv`."""
    message = _message(1, line)
    return message is not None and bool(message.joints)


def read_echo(file: str, lines: Iterator[tuple[int, str]]) -> JointTable:
    """Read the lines of `ros2 topic echo --csv` as a table of messages; `lines` have their numbers.

    A last line that is cut is left out.
    """
    messages: list[JointState] = []
    lost, cut = 0, None
    for number, line in lines:
        if cut is not None:
            raise InputError(
                f"no message sensor_msgs/JointState: {printable(cut[1][:60])!r}; expected seconds, "
                "nanoseconds, frame_id, names, positions, velocities, efforts, as in the first line",
                file=file,
                row=f"line {cut[0]}",
            )
        if LOST.match(line):
            lost += line.startswith("A message")
            continue
        message = _message(number, line)
        if message is None:
            cut = number, line
        else:
            messages.append(message)
    table = table_of(file, tuple(messages), "the topic", "the text of ros2 topic echo")
    note = f"ros2 topic echo lost messages {lost} times" if lost else ""
    return replace(table, note=note)


def _message(number: int, line: str) -> JointState | None:
    """Read a line as a message; return None if the line is no message."""
    fields = [field.strip() for field in line.split(",")]
    if len(fields) < FIRST + len(QUANTITIES):
        return None
    if not (SECONDS.fullmatch(fields[0]) and FRACTION.fullmatch(fields[1])):
        return None
    joints = []
    for field in fields[FIRST:]:
        if not field or NUMBER.fullmatch(field):
            break
        joints.append(field)
    rest, values = fields[FIRST + len(joints) :], []
    for _ in QUANTITIES:
        width = 1 if rest and not rest[0] else len(joints)
        own, rest = rest[:width], rest[width:]
        if own == [""]:
            own = []
        if len(own) not in (0, len(joints)) or not all(map(NUMBER.fullmatch, own)):
            return None
        values.append(_array(own))
    if rest:
        return None
    stamp = int(fields[0]) * NANOSECONDS + int(fields[1])
    sender = printable(f"frame_id {fields[2]}"[:80]) if fields[2] else ""
    position, velocity, effort = values
    return JointState(number, stamp, tuple(joints), position, velocity, effort, sender)


def _array(fields: list[str]) -> Array:
    return np.array([float(field) for field in fields])
