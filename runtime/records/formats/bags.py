"""ROS 1 bags (.bag), ROS 2 bags (a folder with metadata.yaml, or its .db3), and MCAP files, by
rosbags (pip install symgen[bags]).

Messages are read by the definition of JointState that ROS has, never by one that a bag brings
along: rosbags would turn that into code and run it.
A bag whose JointState is another one is refused. Time is the stamp of the header, or the time of
the log where every stamp is zero.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from runtime.errors import InputError
from runtime.files import require_file, sha256, sha256_of
from runtime.limits import LIMIT
from runtime.records.formats.columns import Source
from runtime.records.formats.joint_states import NANOSECONDS, JointState, JointTable

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


def open_bag(source: Source) -> JointTable:
    """Table of the messages of a topic."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    reader: Any = (rosbag1 if source.path.suffix == ".bag" else rosbag2).Reader(source.path)
    decode: Any = (
        get_typestore(Stores.ROS1_NOETIC).deserialize_ros1
        if source.path.suffix == ".bag"
        else get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr
    )
    with reader:
        topic = _topic(reader.connections, source.topic, source.file)
        messages = list(_messages(reader, topic, decode))
    if not messages:
        raise InputError(f"no message on {topic}", file=source.file)
    stamped = any(stamp for stamp, _, _ in messages)
    states = tuple(
        JointState(stamp if stamped else logged, tuple(m.name), m.position, m.velocity, m.effort)
        for stamp, logged, m in messages
    )
    return JointTable(file=source.file, size=source.size, topic=topic, messages=states)


def digest_of(path: Path) -> str:
    """SHA-256 of a bag: of its file, or of the list of those of a folder, each of which has to lie
    in it.
    """
    if not path.is_dir():
        return sha256_of(path)
    return sha256(
        "".join(f"{sha256_of(file)}  {file.name}\n" for file in stored_files(path)).encode()
    )


def stored_files(folder: Path) -> list[Path]:
    """Files of a ROS 2 bag, a folder with metadata.yaml."""
    from runtime.settings.yaml import yaml_values

    where = f"{folder.name}/metadata.yaml"
    require_file(folder / "metadata.yaml")
    try:
        text = (folder / "metadata.yaml").open("rb").read(4 * LIMIT.YAML_CHARACTERS + 1).decode()
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"cannot be read: {e}", file=where) from e
    values, _ = yaml_values(text, file=where)
    bag = values.get("rosbag2_bagfile_information") if isinstance(values, Mapping) else None
    if not isinstance(bag, Mapping):
        raise InputError(
            "no mapping rosbag2_bagfile_information; expected the description of a ROS 2 bag",
            file=where,
        )
    names = bag.get("relative_file_paths")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise InputError("relative_file_paths names no file; expected those of the bag", file=where)
    return [_inside(folder, name, where) for name in names]


def _inside(folder: Path, name: str, where: str) -> Path:
    """The file `name` of the folder; bags of the first ROS 2 versions write it behind the name of
    the folder.
    """
    stored = name.removeprefix(f"{folder.name}/")
    path = folder / stored
    if (
        not STORED_NAME.fullmatch(stored)
        or stored.startswith(".")
        or not path.resolve().is_relative_to(folder.resolve())
    ):
        raise InputError(
            f"relative_file_paths names {name[:80]!r}; expected a file of this folder", file=where
        )
    if not path.is_file():
        raise InputError(
            f"relative_file_paths names {name!r}; there is no such file in the folder", file=where
        )
    return path


def _topic(connections: list[Any], wanted: str | None, file: str) -> str:
    """The topic that is read; it is one of JointState, as ROS defines it."""
    topics = sorted({c.topic for c in connections if c.msgtype == MESSAGE})
    others = sorted({f"{c.topic} ({c.msgtype})" for c in connections if c.msgtype != MESSAGE})
    if wanted is None and len(topics) > 1:
        raise InputError(
            f"several topics of {MESSAGE}: {', '.join(topics)}; choose one by record.topic",
            file=file,
        )
    if not topics or (wanted is not None and wanted not in topics):
        what = f"no topic {wanted} of {MESSAGE}" if wanted else f"no topic of {MESSAGE}"
        raise InputError(
            f"{what}; the bag has {', '.join([*topics, *others][:20]) or 'none'}", file=file
        )
    name = wanted or topics[0]
    for c in connections:
        if c.topic == name and (c.digest not in HASHES or not _as_defined(c.msgdef)):
            raise InputError(
                f"{name} holds messages that are called {MESSAGE} and defined otherwise", file=file
            )
    return name


def _as_defined(definition: Any) -> bool:
    """Whether a definition that a bag brings along, where it is in .msg text, has the fields of
    JointState; other languages go by their hash.
    """
    if definition.format.name != "MSG":
        return True
    return re.sub(r"#[^\n]*", " ", definition.data.split("=" * 80)[0]).split()[1:] == FIELDS


def _messages(reader: Any, topic: str, decode: Any) -> Iterator[tuple[int, int, Any]]:
    """Stamp and time of the log, ns, and message, in the order of the log."""
    for _, logged, raw in reader.messages(
        connections=[c for c in reader.connections if c.topic == topic]
    ):
        message = decode(raw, MESSAGE)
        yield (
            int(message.header.stamp.sec) * NANOSECONDS + int(message.header.stamp.nanosec),
            int(logged),
            message,
        )
