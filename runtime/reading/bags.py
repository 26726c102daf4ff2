"""Reading of ROS 1 bags (.bag), ROS 2 bags (a folder, or its .db3) and MCAP files as tables.

The library is rosbags (pip install symgen[bags]). The messages sensor_msgs/JointState of one topic
give the columns:

    t                        s from the first message that is read
    shoulder.position        of the joint `shoulder`; also .velocity and .effort

`runtime.reading.joint_states` makes the columns of the messages.

Messages are decoded by the definition of JointState in ROS, never by a definition in the bag,
because rosbags would convert that to code and run it. A bag with another JointState is refused.
Time is the stamp of the header, or the time of the log if every stamp is zero.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from runtime.documents.files import require_file
from runtime.ground.errors import InputError, printable
from runtime.ground.limits import LIMIT
from runtime.reading.files import sha256, sha256_of
from runtime.reading.joint_states import NANOSECONDS, JointState, JointTable, table_of
from runtime.reading.publishers import counted_senders
from runtime.reading.table import Options, damage_named

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
    return table_of(path.name, messages, topic, "a bag")


def digest_of(path: Path) -> str:
    """Compute the SHA-256 of a ROS bag, which may be a file or a folder.

    For a folder, the result is the hash of the list of the hashes and names of its files, which
    must be inside the folder.
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
        with (folder / "metadata.yaml").open("rb") as stream:
            text = stream.read(4 * LIMIT.YAML_CHARACTERS + 1).decode()
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
    """Return the path of the file `name` of a ROS 2 bag; raise InputError if it is outside the
    folder.

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
    """Write the data of a bag on the publisher of a message: its node or channel, and its frame_id."""
    node = getattr(connection.ext, "callerid", None)
    if not node and several:
        node = f"channel {connection.id}"
    words = [str(node)] * bool(node) + [f"frame_id {frame}"] * bool(frame)
    return printable(" ".join(words)[:80].replace("\n", " "))
