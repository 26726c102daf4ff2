"""Bags of JointState messages for tests, written by rosbags."""

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.typesys import Stores, get_typestore

MESSAGE = "sensor_msgs/msg/JointState"
KINDS = (
    "ros1",
    "ros1 bz2",
    "ros1 lz4",
    "sqlite3",
    "sqlite3 message",
    "sqlite3 file",
    "mcap",
    "mcap storage",
    "bare mcap",
    "bare db3",
)


def joint_states(stamps, joints, q, tau, qd=None):
    """(stamp in ns, names, position, velocity, effort) by message."""
    qd = np.zeros((len(q), 0)) if qd is None else qd
    return [(int(s), tuple(joints), *x) for s, *x in zip(stamps, q, qd, tau, strict=True)]


def write_bag(kind, path, topics, *, logged=None, frames=None, nodes=None, counts=None):
    """A bag of the kind at `path`, without its ending; topics : messages by topic. Returns its
    path. By message: logged, ns, default the stamps; frames, its frame_id; and in ROS 1 nodes, the
    publisher, and counts, its counter seq.
    """
    if kind.startswith("ros1"):
        path = path.with_suffix(".bag")
        store = get_typestore(Stores.ROS1_NOETIC)
        writer = rosbag1.Writer(path)
        if " " in kind:
            writer.set_compression(rosbag1.Writer.CompressionFormat[kind.split()[1].upper()])
        encode, header = store.serialize_ros1, ("seq",)
    else:
        store = get_typestore(Stores.ROS2_HUMBLE)
        plugin = StoragePlugin.MCAP if "mcap" in kind else StoragePlugin.SQLITE3
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
        mode = kind.split()[1].upper() if " " in kind and "bare" not in kind else ""
        if mode:
            writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
        encode, header = store.serialize_cdr, ()
    Header, Time, State = (
        store.types[name]
        for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", MESSAGE)
    )
    with writer:
        for topic, messages in topics.items():
            named = [
                {} if node is None else {"callerid": node}
                for node in dict.fromkeys(nodes or [None])
            ]
            connections = [
                writer.add_connection(topic, MESSAGE, typestore=store, **n) for n in named
            ]
            of = dict(zip(dict.fromkeys(nodes or [None]), connections, strict=True))
            for i, (stamp, joints, *values) in enumerate(messages):
                time = Time(sec=int(stamp) // 10**9, nanosec=int(stamp) % 10**9)
                state = State(
                    Header(
                        stamp=time,
                        frame_id=frames[i] if frames else "",
                        **dict.fromkeys(header, counts[i] if counts else 0),
                    ),
                    list(joints),
                    *(np.array(x, dtype=float) for x in values),
                )
                writer.write(
                    of[nodes[i] if nodes else None],
                    int(stamp) if logged is None else logged[i],
                    encode(state, MESSAGE),
                )
    if kind.startswith("bare"):
        return next(path.glob("*.mcap" if "mcap" in kind else "*.db3"))
    return path
