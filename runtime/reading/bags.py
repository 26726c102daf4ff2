"""Reading of ROS 1 bags (.bag), ROS 2 bags (a folder, or its .db3) and MCAP files as tables.

The library is rosbags (pip install symgen[bags]). The messages sensor_msgs/JointState of one topic
give the columns:

    t                        s from the first message that is read
    shoulder.position        of the joint `shoulder`; so velocity and effort

In `record.columns` the name of the joint is enough: q means position, tau effort. Each message
names its joints, so that their order may change from message to message. If several nodes publish
on a topic, such as those of an arm and of its gripper, messages without any of the requested joints
are skipped and counted; a message with only some of them is an error.

Messages are decoded by the definition of JointState in ROS, never by a definition in the bag,
because rosbags would convert that to code and run it. A bag with another JointState is refused.
Time is the stamp of the header, or the time of the log if every stamp is zero.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from runtime.documents.files import require_file
from runtime.ground.errors import InputError, RecordWarning, printable
from runtime.ground.limits import LIMIT
from runtime.reading.files import sha256, sha256_of
from runtime.reading.publishers import Sent, counted_senders, of_one_publisher
from runtime.reading.table import Array, Options, Table, damage_named

MESSAGE = "sensor_msgs/msg/JointState"
HASHES = (  # of this message: MD5 in ROS 1, RIHS01 in ROS 2 (nothing before Iron)
    *("", "3066dcd76a6cfaef579bd0f34173e9fd"),
    "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
)
FIELDS = [
    *("header", "string[]", "name"),
    *(word for x in ("position", "velocity", "effort") for word in ("float64[]", x)),
]
STORED_NAME = re.compile(r"[\w.+ -]{1,255}")
QUANTITIES = ("position", "velocity", "effort")
NANOSECONDS = 1_000_000_000  # per second


@dataclass(frozen=True)
class JointState:
    """One message JointState of a bag: its time, the names of the joints, and their values.

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
        What the bag says of the publisher.
    """

    number: int
    stamp: int
    joints: tuple[str, ...]
    position: Array
    velocity: Array
    effort: Array
    sender: str = ""

    def value(self, joint: str, quantity: str) -> float:
        """Return one value of a joint, nan if the message does not have exactly one."""
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
        notes = [
            f"{skipped} of {len(self.messages)} messages on {self.topic} have none of these joints and are skipped"
        ] * bool(skipped)
        messages = some or list(self.messages)
        kept, note = of_one_publisher(self._sent(messages, names))
        if note:
            warnings.warn(f"{self.file}: {note}", RecordWarning, stacklevel=2)
            notes.append(note)
        messages = [message for message, keep in zip(messages, kept, strict=True) if keep]
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
        """Return what the messages tell of their publishers, with the columns `names`."""
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


def read_bag(path: Path, options: Options) -> JointTable:
    """Read the messages of one topic of a bag as a table."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    with damage_named("a whole bag", path.name):
        if path.suffix == ".bag":
            reader: Any = rosbag1.Reader(path)
            decode: Any = get_typestore(Stores.ROS1_NOETIC).deserialize_ros1
        else:
            reader = rosbag2.Reader(path)
            decode = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr
        with reader:
            topic = _topic(reader.connections, options.topic, path.name)
            messages = tuple(_messages(reader, topic, decode))
    if not messages:
        raise InputError(
            f"no message on topic {topic}; give a bag with messages, or another record.topic",
            file=path.name,
        )
    names = {"t": None}
    joints: dict[str, None] = {}
    for message in messages:
        for joint in message.joints:
            if joint not in joints:
                joints[joint] = None
                held = [x for x in QUANTITIES if len(getattr(message, x))]
                names |= dict.fromkeys(f"{joint}.{x}" for x in held)
    return JointTable(
        file=path.name,
        columns=dict.fromkeys(names, np.empty(0)),
        joints=tuple(joints),
        topic=topic,
        what="a bag",
        messages=messages,
    )


def digest_of(path: Path) -> str:
    """Compute the SHA-256 of a ROS bag, which may be a file or a folder.

    For a folder, it is that of the list of the hashes and names of its files, which must be inside
    the folder.
    """
    if not path.is_dir():
        return sha256_of(path)
    return sha256(
        "".join(f"{sha256_of(file)}  {file.name}\n" for file in stored_files(path)).encode()
    )


def stored_files(folder: Path) -> list[Path]:
    """Return the paths of the files of a ROS 2 bag, which is a folder with metadata.yaml."""
    from runtime.documents.yaml_text import yaml_values

    where = f"{folder.name}/metadata.yaml"
    require_file(folder / "metadata.yaml")
    try:
        text = (folder / "metadata.yaml").open("rb").read(4 * LIMIT.YAML_CHARACTERS + 1).decode()
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"the bag cannot be read: {e}", file=where) from e
    values, _ = yaml_values(text, file=where)
    bag = values.get("rosbag2_bagfile_information") if isinstance(values, Mapping) else None
    if not isinstance(bag, Mapping):
        raise InputError(
            "the key rosbag2_bagfile_information is missing; expected the description of a "
            "ROS 2 bag",
            file=where,
        )
    names = bag.get("relative_file_paths")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise InputError(
            "relative_file_paths lists no file; expected a list of the files of the bag", file=where
        )
    return [_inside(folder, name, where) for name in names]


def _inside(folder: Path, name: str, where: str) -> Path:
    """Return the path of the file `name` of a ROS 2 bag; InputError if it is outside the folder.

    Bags of the first ROS 2 versions write the name of the folder before the name of the file.
    """
    stored = name.removeprefix(f"{folder.name}/")
    path = folder / stored
    if (
        not STORED_NAME.fullmatch(stored)
        or stored.startswith(".")
        or not path.resolve().is_relative_to(folder.resolve())
    ):
        raise InputError(
            f"relative_file_paths contains {name[:80]!r}; expected a file of this folder",
            file=where,
        )
    if not path.is_file():
        raise InputError(
            f"relative_file_paths contains {name!r}, but the folder of the bag has no such file; "
            "copy it there",
            file=where,
        )
    return path


def _topic(connections: list[Any], wanted: str | None, file: str) -> str:
    """Return the name of the ROS topic to read: `wanted`, or the only topic of type JointState.

    Raise InputError if there is no such topic, or if its messages are not defined as in ROS.
    """
    topics = sorted({c.topic for c in connections if c.msgtype == MESSAGE})
    others = sorted({f"{c.topic} ({c.msgtype})" for c in connections if c.msgtype != MESSAGE})
    if wanted is None and len(topics) > 1:
        raise InputError(
            f"several topics have the type {MESSAGE}: {', '.join(topics)}; choose "
            "one by record.topic",
            file=file,
        )
    if not topics or (wanted is not None and wanted not in topics):
        what = (
            f"the bag has no topic {wanted} of type {MESSAGE}"
            if wanted
            else (f"the bag has no topic of type {MESSAGE}")
        )
        raise InputError(
            f"{what}; set record.topic to one of the topics of the bag: "
            f"{', '.join([*topics, *others][:20]) or 'none'}",
            file=file,
        )
    name = wanted or topics[0]
    for c in connections:
        if c.topic == name and (c.digest not in HASHES or not _as_defined(c.msgdef)):
            raise InputError(
                f"the messages on {name} have the type {MESSAGE}, but not the definition of this "
                "type in ROS; record messages with this definition",
                file=file,
            )
    return name


def _as_defined(definition: Any) -> bool:
    """Whether a bag defines the message JointState with the same fields as ROS.

    Only .msg text is compared. A definition in another language is checked by its hash instead.
    """
    if definition.format.name != "MSG":
        return True
    return re.sub(r"#[^\n]*", " ", definition.data.split("=" * 80)[0]).split()[1:] == FIELDS


def _messages(reader: Any, topic: str, decode: Any) -> list[JointState]:
    """Read the messages JointState of one ROS topic of a bag, in the order of the log.

    Their time is the stamp of the header, or the time of the log if every stamp is zero.
    """
    connections = [c for c in reader.connections if c.topic == topic]
    states = []
    logs = []
    counters = []
    for number, (c, logged, raw) in enumerate(reader.messages(connections=connections), start=1):
        m = decode(raw, MESSAGE)
        stamp = int(m.header.stamp.sec) * NANOSECONDS + int(m.header.stamp.nanosec)
        sender = _sender(c, str(m.header.frame_id), several=len(connections) > 1)
        values = (m.position, m.velocity, m.effort)
        states.append(JointState(number, stamp, tuple(m.name), *values, sender))
        logs.append(int(logged))
        counters.append(int(getattr(m.header, "seq", 0)))
    if len({state.sender for state in states}) == 1:
        senders = counted_senders(counters)
        states = [replace(x, sender=name) for x, name in zip(states, senders, strict=True)]
    if any(state.stamp for state in states):
        return states
    return [replace(state, stamp=log) for state, log in zip(states, logs, strict=True)]


def _sender(connection: Any, frame: str, *, several: bool) -> str:
    """Write what a bag says of the publisher of a message: its node or channel, and its frame_id."""
    node = getattr(connection.ext, "callerid", None)
    if not node and several:
        node = f"channel {connection.id}"
    words = [str(node)] * bool(node) + [f"frame_id {frame}"] * bool(frame)
    return printable(" ".join(words)[:80].replace("\n", " "))
