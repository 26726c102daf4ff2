"""Columns of the messages sensor_msgs/JointState of one topic: time, and position, velocity and effort of every joint by its name.

The column `shoulder.position` is the position of the joint `shoulder`; in `record.columns` the name of the joint is enough: q means position, tau effort.
A message names its joints itself, so that their order may change from message to message.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from runtime.errors import InputError
from runtime.records.formats.naming import check_names

Array = np.ndarray

QUANTITIES = ("position", "velocity", "effort")
NANOSECONDS = 1_000_000_000  # per second


@dataclass(frozen=True)
class JointState:
    """One message: stamp in ns, names of the joints, and per quantity one value per joint (rad or m, rad/s or m/s, N m or N), or none."""

    stamp: int
    joints: tuple[str, ...]
    position: Array
    velocity: Array
    effort: Array


@dataclass(frozen=True, eq=False)
class JointTable:
    """The messages of a topic as columns `t`, `<joint>.position` ...; time in s from the first message on."""

    file: str
    topic: str
    messages: tuple[JointState, ...]

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, as the first message has them."""
        return self.messages[0].joints

    @cached_property
    def names(self) -> tuple[str, ...]:
        first = self.messages[0]
        return ("t", *(f"{joint}.{quantity}" for joint in self.joints for quantity in QUANTITIES if len(getattr(first, quantity))))

    def columns(self, quantity: str, names: Sequence[str]) -> tuple[str, ...]:
        """Columns that `names` mean where `quantity` is wanted: of a joint, or names of columns; none: the joints in the order of their numbers."""
        known = {joint: f"{joint}.{quantity}" for joint in self.joints}
        return tuple(known.get(name, name) for name in names or self._numbered())

    def stack(self, names: Sequence[str]) -> Array:
        """The named columns, shape (N, k)."""
        return np.column_stack([self._column(name) for name in names]) if names else np.empty((len(self.messages), 0))

    def scalar(self, name: str) -> float:
        """Messages hold columns only."""
        raise InputError(f"no single number {name!r} in a bag; write the number itself in the settings", file=self.file)

    def row(self, i: int) -> str:
        return f"message {i + 1} of {self.topic}"

    def _column(self, name: str) -> Array:
        if name == "t":
            first = self.messages[0].stamp
            return np.array([message.stamp - first for message in self.messages], dtype=np.int64) / NANOSECONDS
        joint, _, quantity = name.rpartition(".")
        if quantity not in QUANTITIES or not joint:
            check_names([name], self.names, f"{self.file}, {self.topic}")
        return np.array([self._value(i, joint, quantity) for i in range(len(self.messages))])

    def _value(self, i: int, joint: str, quantity: str) -> float:
        message = self.messages[i]
        values = getattr(message, quantity)
        if message.joints.count(joint) == 1 and len(values) == len(message.joints):
            return float(values[message.joints.index(joint)])
        if joint not in message.joints:
            reason = f"no joint {joint}; it has {', '.join(message.joints) or 'none'}"
        elif len(values) != len(message.joints):
            reason = f"{len(values)} values of {quantity} for {len(message.joints)} joints"
        else:
            reason = f"joint {joint} more than once"
        raise InputError(f"{reason}; expected every message to hold what the record names", file=self.file, row=self.row(i))

    def _numbered(self) -> tuple[str, ...]:
        """Joints called alike but for a number, 1, 2 ... or 0, 1 ..., in this order."""
        parts = [re.fullmatch(r"(.*?)(\d{1,3})", joint) for joint in self.joints]
        found = sorted((int(part[2]), part[0]) for part in parts if part)
        alike = len({part[1] for part in parts if part}) == 1 and len(found) == len(self.joints)
        if not alike or [k for k, _ in found] != list(range(found[0][0], found[0][0] + len(found))) or found[0][0] > 1:
            raise InputError(
                f"{self.topic} has the joints {', '.join(self.joints) or '(none)'}; "
                "name those of the robot, in its order, in record.columns: {q: [...], tau: [...]}",
                file=self.file,
            )
        return tuple(name for _, name in found)
