"""Columns of the messages sensor_msgs/JointState of ROS, of a bag or of the text of `ros2 topic echo`.

    t                        s from the first message that is read
    shoulder.position        of the joint `shoulder`; also .velocity and .effort

In `record.columns` the name of the joint is enough: q means position, tau effort. Each message
names its joints, so that their order may change from message to message. If several nodes publish
on a topic, such as those of an arm and of its gripper, messages without any of the requested joints
are skipped and counted. If the requested joints are those of several nodes, which publish different
joints, their messages are joined by their stamps:

    the same stamps          the values of both
    others                   straight lines, to the stamps of the messages with most of the joints

and a note reports it. Otherwise a message with only some of the requested joints is an error.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.ground.errors import InputError, RecordWarning
from runtime.reading.publishers import Sent, of_one_publisher
from runtime.reading.table import Array, Table

QUANTITIES = ("position", "velocity", "effort")
NANOSECONDS = 1_000_000_000  # per second
BRIDGED = 3.0  # periods of messages: no line goes over a longer pause


@dataclass(frozen=True)
class JointState:
    """One message JointState: its time, the names of the joints, and their values.

    Attributes
    ----------
    number : int
        Number of the message on its topic, from 1.
    stamp : int, ns
        Time.
    joints : tuple of str
        Names of the joints.
    position, velocity, effort : ndarray
        One value per joint (rad or m, rad/s or m/s, N m or N), or none.
    sender : str
        What the file says of the publisher.
    """

    number: int
    stamp: int
    joints: tuple[str, ...]
    position: Array
    velocity: Array
    effort: Array
    sender: str = ""

    def value(self, joint: str, quantity: str) -> float:
        """Return one value of a joint, or nan if the message does not have exactly one value."""
        values = getattr(self, quantity)
        if self.joints.count(joint) != 1 or len(values) != len(self.joints):
            return np.nan
        return float(values[self.joints.index(joint)])


@dataclass(frozen=True, eq=False, kw_only=True)
class JointTable(Table):
    """Table of the JointState messages of a ROS topic; `chosen` reads columns from the messages."""

    messages: tuple[JointState, ...]

    def chosen(self, names: Sequence[str]) -> Table:
        """Make a table of the named columns; messages without any of their joints are left out.

        If no message contains such a joint, all messages are used, so that the error names the
        missing joint.
        """
        joints = {name.rpartition(".")[0] for name in names} - {""}
        some = [message for message in self.messages if joints.intersection(message.joints)]
        skipped = len(self.messages) - len(some or self.messages)
        notes = [self.note] * bool(self.note)
        if skipped:
            notes.append(
                f"{skipped} of {len(self.messages)} messages on {self.topic} have none of these joints and are skipped"
            )
        groups = _by_joints(some or self.messages, joints.intersection(self.joints or ()))
        parts = []
        for own, group in groups.items():
            theirs = [x for x in names if len(groups) == 1 or x.rpartition(".")[0] in own]
            kept, note = of_one_publisher(self._sent(group, theirs))
            notes += [note] if note else []
            parts.append([message for message, keep in zip(group, kept, strict=True) if keep])
        messages = parts[0]
        if len(groups) > 1:
            messages, note = joined(dict(zip(groups, parts, strict=True)), self.file)
            notes.append(note)
        for note in notes[bool(self.note) + bool(skipped) :]:
            warnings.warn(f"{self.file}: {note}", RecordWarning, stacklevel=2)
        columns: dict[str, Array] = {}
        for name in names:
            joint, _, quantity = name.rpartition(".")
            if name == "t":
                first = messages[0].stamp
                stamps = np.array([message.stamp - first for message in messages], dtype=np.int64)
                columns[name] = stamps / NANOSECONDS
            elif joint and quantity in QUANTITIES:
                values = [self._value(message, joint, quantity) for message in messages]
                columns[name] = np.array(values)
        return Table(
            file=self.file,
            columns={**dict.fromkeys(self.columns, np.empty(0)), **columns},
            row=lambda i: self._row(messages[i]),
            joints=self.joints,
            topic=self.topic,
            note=". ".join(notes),
            what=self.what,
            digest=self.digest,
        )

    def _sent(self, messages: Sequence[JointState], names: Sequence[str]) -> Sent:
        """Collect the data of the messages on their publishers, with the columns `names`."""
        pairs = [name.rpartition(".")[::2] for name in dict.fromkeys(names)]
        asked = [(joint, word) for joint, word in pairs if joint and word in QUANTITIES]
        values = [message.value(*pair) for message in messages for pair in asked]
        return Sent(
            self.topic,
            self.file,
            tuple(message.sender for message in messages),
            np.array([message.stamp for message in messages], dtype=np.int64),
            np.array(values).reshape(len(messages), len(asked)),
            np.array([word == "effort" for _, word in asked], dtype=bool),
        )

    def _row(self, message: JointState) -> str:
        return f"message {message.number} of {self.topic}"

    def _value(self, message: JointState, joint: str, quantity: str) -> float:
        values = getattr(message, quantity)
        if joint not in message.joints:
            reason = f"no joint {joint} among the joints {', '.join(message.joints) or 'none'}"
        elif len(values) != len(message.joints):
            reason = f"{len(values)} values of {quantity} for {len(message.joints)} joints"
        elif message.joints.count(joint) > 1:
            reason = f"joint {joint} more than once"
        else:
            return float(values[message.joints.index(joint)])
        raise InputError(
            f"{reason}; every message must contain the joints and quantities of record.columns",
            file=self.file,
            row=self._row(message),
        )


def table_of(file: str, messages: tuple[JointState, ...], topic: str, what: str) -> JointTable:
    """Make the table of messages; `topic` and `what` name their place and the file in messages."""
    names = {"t": None}
    joints: dict[str, None] = {}
    for message in messages:
        for joint in message.joints:
            if joint not in joints:
                joints[joint] = None
                held = [x for x in QUANTITIES if len(getattr(message, x))]
                names |= dict.fromkeys(f"{joint}.{x}" for x in held)
    return JointTable(
        file=file,
        columns=dict.fromkeys(names, np.empty(0)),
        joints=tuple(joints),
        topic=topic,
        what=what,
        messages=messages,
    )


def joined(
    parts: Mapping[frozenset[str], Sequence[JointState]], file: str
) -> tuple[list[JointState], str]:
    """Join the messages of several publishers, each with joints of its own, by their stamps.

    parts : messages by their joints. Returns messages with all joints, at the stamps of the
      messages with most joints, and a sentence. Raise InputError if the messages do not overlap in
      time.
    """
    own, base = max(parts.items(), key=lambda part: (len(part[0]), len(part[1])))
    order, stamps = sorted(own), _stamps(base)
    values = {x: [_values(base, order, x)] for x in QUANTITIES}
    inside, apart = np.ones(len(stamps), dtype=bool), 0
    for others, messages in parts.items():
        if others == own:
            continue
        theirs = _stamps(messages)
        if len(theirs) < 2 or np.any(np.diff(theirs) <= 0):
            raise InputError(
                f"the messages of {', '.join(sorted(others))} have stamps that repeat or go back; "
                "they cannot be joined with those of other joints",
                file=file,
            )
        after = np.clip(np.searchsorted(theirs, stamps), 1, len(theirs) - 1)
        step = theirs[after] - theirs[after - 1]
        near = np.minimum(np.abs(theirs[after] - stamps), np.abs(stamps - theirs[after - 1]))
        inside &= (stamps >= theirs[0]) & (stamps <= theirs[-1])
        inside &= (near == 0) | (step <= BRIDGED * np.median(np.diff(theirs)))
        apart = max(apart, int(near[inside].max(initial=0)))
        order += sorted(others)
        t, at = theirs - theirs[0], stamps - theirs[0]
        for x in QUANTITIES:
            columns = _values(messages, sorted(others), x).T
            values[x].append(np.stack([np.interp(at, t, column) for column in columns], axis=1))
    if not inside.any():
        raise InputError("the messages of different joints do not overlap in time", file=file)
    position, velocity, effort = (np.hstack(values[x]) for x in QUANTITIES)
    messages = [
        JointState(m.number, m.stamp, tuple(order), position[k], velocity[k], effort[k], m.sender)
        for k, m in enumerate(base)
        if inside[k]
    ]
    how = (
        f"by straight lines, at the stamps of {', '.join(sorted(own))}; the nearest ones are up to "
        f"{apart / 1e6:.2g} ms away"
        if apart
        else "by equal stamps"
    )
    sets = " and ".join(f"the joints {', '.join(sorted(joints))}" for joints in {own: 0, **parts})
    lost = len(base) - len(messages)
    dropped = f". {lost} messages without a partner are left out" if lost else ""
    return (
        messages,
        f"the joints {sets} have messages of their own, which are joined {how}{dropped}",
    )


def _by_joints(
    messages: Sequence[JointState], joints: set[str]
) -> dict[frozenset[str], Sequence[JointState]]:
    """Group messages by the requested joints that they contain, if no message has all joints.

    All messages are one group if some message has all joints, or if groups share a joint.
    """
    groups: dict[frozenset[str], list[JointState]] = {}
    for message in messages:
        groups.setdefault(frozenset(joints.intersection(message.joints)), []).append(message)
    if sum(map(len, groups)) != len(joints) or frozenset() in groups:
        return {frozenset(joints): messages}
    return dict(groups)


def _stamps(messages: Sequence[JointState]) -> Array:
    return np.array([message.stamp for message in messages], dtype=np.int64)


def _values(messages: Sequence[JointState], joints: Sequence[str], quantity: str) -> Array:
    """Return one quantity of some joints by message, shape (N, k); nan where it is not given."""
    rows = [[message.value(joint, quantity) for joint in joints] for message in messages]
    return np.array(rows).reshape(len(messages), len(joints))
