"""Columns of the messages sensor_msgs/JointState of one topic: time, and position, velocity and
effort of every joint by its name.

The column `shoulder.position` is the position of the joint `shoulder`; in `record.columns` the name
of the joint is enough: q means position, tau effort.
A message names its joints itself, so that their order may change from message to message. Where
several nodes publish on a topic, such as those of an arm and
of its gripper, messages that hold none of the joints that are asked for are skipped and counted;
one that holds some of them is an error.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from runtime.errors import InputError
from runtime.records.formats.columns import Array, Groups, Table, check_names

QUANTITIES = ("position", "velocity", "effort")
WORDS = {
    "q": ("q", "pos", "position"),
    "tau": ("tau", "torque", "effort"),
    "qr": ("qr", "reference"),
}  # beside the name of a joint
NANOSECONDS = 1_000_000_000  # per second


@dataclass(frozen=True)
class JointState:
    """One message.

    Attributes
    ----------
    stamp : int, ns
        Time.
    joints : tuple of str
        Names of the joints.
    position, velocity, effort : ndarray
        One value by joint (rad or m, rad/s or m/s, N m or N), or none.
    """

    stamp: int
    joints: tuple[str, ...]
    position: Array
    velocity: Array
    effort: Array


@dataclass(eq=False, kw_only=True)
class JointTable(Table):
    """The messages of a topic as columns `t`, `<joint>.position` ...; time in s from the first
    message that is read.
    """

    what = "a bag"

    messages: tuple[JointState, ...]
    chosen: tuple[int, ...] = field(default=(), init=False)

    def __post_init__(self) -> None:
        first: dict[str, JointState] = {}
        for message in self.messages:
            for joint in message.joints:
                first.setdefault(joint, message)
        self.joints = tuple(first)
        self.names = (
            "t",
            *(
                f"{joint}.{x}"
                for joint, message in first.items()
                for x in QUANTITIES
                if len(getattr(message, x))
            ),
        )
        self.chosen = tuple(range(len(self.messages)))

    def samples(self, groups: Groups) -> int:
        self._choose([name for group in groups for name in group])
        return len(self.chosen)

    def note(self, groups: Groups) -> str:
        skipped = len(self.messages) - self.samples(groups)
        return (
            (
                f"{skipped} of {len(self.messages)} messages on {self.topic} have none of these "
                "joints "
                "and are skipped"
            )
            if skipped
            else ""
        )

    def require(self, names: Sequence[str]) -> None:
        """Any quantity of any joint may be asked for: a message that lacks it is named."""
        for name in names:
            joint, _, quantity = name.rpartition(".")
            if name != "t" and (quantity not in QUANTITIES or not joint):
                check_names([name], self.names, f"{self.file}, {self.topic}")

    def parts(
        self, names: Sequence[str], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[Sequence[Array]]:
        self._choose(names)
        chosen = self.chosen[:stop]
        for a in range(start, len(chosen), size):
            yield [self._column(name, chosen[a : a + size]) for name in names]

    def row(self, i: int) -> str:
        return f"message {self.chosen[i] + 1} of {self.topic}"

    def _choose(self, names: Sequence[str]) -> None:
        """Read the messages that hold a joint of these columns; all of them where none does, so
        that the first one tells what is missing.
        """
        asked = {name.rpartition(".")[0] for name in names} - {""}
        some = tuple(
            i for i, message in enumerate(self.messages) if asked.intersection(message.joints)
        )
        self.chosen = some or tuple(range(len(self.messages)))

    def _column(self, name: str, chosen: Sequence[int]) -> Array:
        if name == "t":
            first = self.messages[self.chosen[0]].stamp
            return (
                np.array([self.messages[i].stamp - first for i in chosen], dtype=np.int64)
                / NANOSECONDS
            )
        joint, _, quantity = name.rpartition(".")
        return np.array([self._value(i, joint, quantity) for i in chosen])

    def _value(self, i: int, joint: str, quantity: str) -> float:
        message = self.messages[i]
        values = getattr(message, quantity)
        if joint not in message.joints:
            reason = f"no joint {joint}; it has {', '.join(message.joints) or 'none'}"
        elif len(values) != len(message.joints):
            reason = f"{len(values)} values of {quantity} for {len(message.joints)} joints"
        elif message.joints.count(joint) > 1:
            reason = f"joint {joint} more than once"
        else:
            return float(values[message.joints.index(joint)])
        raise InputError(
            f"{reason}; expected every message to hold what the record names",
            file=self.file,
            row=f"message {i + 1} of {self.topic}",
        )


def joint_columns(table: Table, quantity: str, names: Sequence[str]) -> tuple[str, ...]:
    """Columns of a bag that `names` mean where `quantity` is wanted: of a joint, or names of
    columns; none: the joints in the order of their numbers.
    """
    known = {joint: f"{joint}.{quantity}" for joint in table.joints or ()}
    return tuple(known.get(name, name) for name in names or _numbered(table))


def named_columns(table: Table, key: str, joints: Sequence[str]) -> tuple[str, ...]:
    """The column of each joint by its name, alone or beside a word for the quantity: q_elbow,
    elbow.pos, effort/elbow.

    Parameters
    ----------
    table : Table
        Any table of a record.
    key : str
        q, tau or qr.
    joints : sequence of str
        Names of the joints.

    Raises
    ------
    InputError
        A joint without column, or with several.
    """
    columns = []
    for joint in joints:
        forms = {
            form
            for word in WORDS[key]
            for mark in "_./"
            for form in (f"{joint}{mark}{word}", f"{word}{mark}{joint}")
        }
        hits = [name for name in table.names if name in forms] or [
            name for name in table.names if name == joint
        ]
        if len(hits) != 1:
            what = (
                "columns " + ", ".join(hits)
                if hits
                else f"no column {joint}, {key}_{joint} or the like among {', '.join(table.names)}"
            )
            raise InputError(
                f"{what}; expected one for {joint}, name the columns in record.columns.{key}",
                file=table.file,
            )
        columns += hits
    return tuple(columns)


def _numbered(table: Table) -> tuple[str, ...]:
    """Joints called alike but for a number, 1, 2 ... or 0, 1 ..., in this order."""
    joints = table.joints or ()
    parts = [re.fullmatch(r"(.*?)(\d{1,3})", joint) for joint in joints]
    numbers = sorted((part[1], int(part[2]), part[0]) for part in parts if part)
    first = min(numbers, default=("", 2, ""))
    expected = [(first[0], k) for k in range(first[1], first[1] + len(joints))]
    if first[1] > 1 or [(stem, k) for stem, k, _ in numbers] != expected:
        raise InputError(
            (
                f"{table.topic} has the joints {', '.join(joints) or '(none)'}; name those of the "
                f"robot, in its order, in record.columns: {{q: [...], tau: [...]}}"
            ),
            file=table.file,
        )
    return tuple(joint for *_, joint in numbers)
