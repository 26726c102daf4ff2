"""ROS 1 bags (.bag), ROS 2 bags (a folder with metadata.yaml, or its .db3), and MCAP files: the only place where rosbags is used (extra `bags`).

    read_bag(path, topic)      the sensor_msgs/JointState messages of a topic, as columns by joint

Messages are read by the definition of JointState that ROS has, never by one that a bag brings along: rosbags would turn that into code and run it.
A bag whose JointState is another one is refused. Time is the stamp of the header, or the time of the log where every stamp is zero.
"""

from __future__ import annotations

import bz2
import re
import struct
import sys
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from runtime.errors import InputError
from runtime.files import require_file, sha256, sha256_of
from runtime.limits import Unpacker, allowed, require_size, unpacked
from runtime.records.formats.bag_contents import mcap_chunks, require_plain_tables, storage_files
from runtime.records.formats.joint_states import NANOSECONDS, JointState, JointTable

MESSAGE = "sensor_msgs/msg/JointState"
HASHES = (  # of this message: MD5 in ROS 1, RIHS01 in ROS 2 (nothing before Iron)
    *("", "3066dcd76a6cfaef579bd0f34173e9fd"),
    "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
)
FIELDS = [
    "header",
    "string[]",
    "name",
    "float64[]",
    "position",
    "float64[]",
    "velocity",
    "float64[]",
    "effort",
]  # after the type of the header
DAMAGED = (
    *(OSError, EOFError, struct.error, zlib.error, MemoryError, RuntimeError, ArithmeticError),
    *(ValueError, TypeError, KeyError, IndexError, AttributeError, AssertionError),
)  # what reading bytes that are no bag raises, beside the errors of the libraries


def read_bag(path: Path, topic: str | None = None) -> tuple[JointTable, str]:
    """The messages of a topic (default: the only one of JointState) and the SHA-256 of the bag: of its file, or of the list of those of a folder."""
    rosbags = _rosbags(path.name)
    broken: tuple[type[Exception], ...] = (*DAMAGED, *rosbags.errors)
    found: list[tuple[int, int, Any]] = []
    try:
        with TemporaryDirectory(prefix="symgen-bag-") as scratch:
            files, compression = storage_files(path) if path.is_dir() else ([path], "")
            size = sum(require_file(file) for file in files)
            stores = _uncompressed(rosbags, files, Path(scratch)) if compression == "file" else files
            with _opened(rosbags, stores) as readers:
                name = _topic(readers, topic, path.name)
                for reader in readers:
                    found += _messages(rosbags, reader, name, allowed(size) if compression == "message" else 0)
            digests = [(file.name, sha256_of(file)) for file in files]
    except InputError:
        raise
    except broken as e:
        raise InputError(f"not a whole bag ({str(e).splitlines()[0][:200] if str(e) else type(e).__name__})", file=path.name) from e
    if not found:
        raise InputError(f"no message on {name}", file=path.name)
    stamped = any(stamp for stamp, _, _ in found)
    messages = tuple(_state(stamp if stamped else logged, message) for stamp, logged, message in found)
    digest = digests[0][1] if path.is_file() else sha256("".join(f"{d}  {file}\n" for file, d in digests).encode())
    return JointTable(path.name, name, messages), digest


@dataclass(frozen=True)
class Rosbags:
    """What is used of rosbags and of the libraries that it brings along."""

    reader1: Any
    reader2: Any
    decode1: Callable[[bytes, str], Any]
    decode2: Callable[[bytes, str], Any]
    errors: tuple[type[Exception], ...]
    unpackers: dict[str, Callable[[], Unpacker]]
    unbounded: dict[Callable[[bytes], bytes], str]  # functions that unpack without a limit


def _rosbags(file: str) -> Rosbags:
    try:
        import apsw
        from lz4 import frame as lz4
        from rosbags import rosbag1, rosbag2
        from rosbags.serde import SerdeError
        from rosbags.typesys import Stores, get_typestore

        if sys.version_info >= (3, 14):
            from compression import zstd
        else:
            from backports import zstd
    except ImportError as e:
        raise InputError("bags need an optional library: pip install symgen[bags]", file=file) from e
    return Rosbags(
        rosbag1.Reader,
        rosbag2.Reader,
        get_typestore(Stores.ROS1_NOETIC).deserialize_ros1,
        get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr,
        (rosbag1.ReaderError, rosbag2.ReaderError, SerdeError, apsw.Error, zstd.ZstdError),
        {"zstd": zstd.ZstdDecompressor, "lz4": lz4.LZ4FrameDecompressor, "bz2": bz2.BZ2Decompressor},
        {bz2.decompress: "bz2", lz4.decompress: "lz4"},
    )


@contextmanager
def _opened(rosbags: Rosbags, stores: Sequence[Path]) -> Iterator[list[Any]]:
    """Readers of these files, each checked before its content is unpacked."""
    readers: list[Any] = []
    try:
        for store in stores:
            reader = (rosbags.reader1 if store.suffix == ".bag" else rosbags.reader2)(store)
            chunks = mcap_chunks(store, rosbags.unpackers) if store.suffix == ".mcap" else {}
            if store.suffix == ".db3":
                require_plain_tables(store)
            reader.open()
            readers.append(reader)
            if store.suffix == ".mcap":
                index = [(c.chunk_start_offset, (c.compression, c.compressed_size, c.uncompressed_size)) for c in reader.storage.chunks]
                if any(chunks.get(place) != what for place, what in index) or len(dict(index)) < len(index):
                    raise InputError(
                        "an index that does not lead to the chunks of the file; repair it with `mcap recover`", file=store.name
                    )
            if store.suffix == ".bag":
                _bound(rosbags, reader, store)
        yield readers
    finally:
        for reader in readers:
            reader.close()


def _bound(rosbags: Rosbags, reader: Any, store: Path) -> None:
    """Bounds what the chunks of a ROS 1 bag unpack to, all together: their decompressors are replaced by ones that stop."""
    size = store.stat().st_size
    done = [0]

    def bounded(compression: str, data: bytes) -> bytes:
        found = unpacked(rosbags.unpackers[compression](), data, allowed(size) - done[0])
        done[0] += len(found)
        require_size(done[0], size, store.name)
        return found

    for place, chunk in reader.chunks.items():
        if chunk.decompressor in rosbags.unbounded:
            reader.chunks[place] = chunk._replace(decompressor=partial(bounded, rosbags.unbounded[chunk.decompressor]))


def _uncompressed(rosbags: Rosbags, files: Sequence[Path], scratch: Path) -> list[Path]:
    """Files of a bag that is compressed by file, such as bag_0.db3.zstd, unpacked into `scratch`."""
    stores = []
    for file in files:
        size = file.stat().st_size
        data = unpacked(rosbags.unpackers["zstd"](), file.read_bytes(), allowed(size))
        require_size(len(data), size, file.name)
        stores.append(scratch / file.stem)
        stores[-1].write_bytes(data)
    return stores


def _topic(readers: Sequence[Any], wanted: str | None, file: str) -> str:
    """The topic that is read; it is one of JointState, as ROS defines it."""
    connections = [connection for reader in readers for connection in reader.connections]
    topics = sorted({c.topic for c in connections if c.msgtype == MESSAGE})
    others = sorted({f"{c.topic} ({c.msgtype})" for c in connections if c.msgtype != MESSAGE})
    if wanted is None and len(topics) > 1:
        raise InputError(f"several topics of {MESSAGE}: {', '.join(topics)}; choose one by record.topic", file=file)
    if not topics or (wanted is not None and wanted not in topics):
        what = f"no topic {wanted} of {MESSAGE}" if wanted else f"no topic of {MESSAGE}"
        raise InputError(f"{what}; the bag has {', '.join([*topics, *others][:20]) or 'none'}", file=file)
    name = wanted or topics[0]
    for c in connections:
        if c.topic == name and (c.digest not in HASHES or not _as_defined(c.msgdef)):
            raise InputError(f"{name} holds messages that are called {MESSAGE} and defined otherwise", file=file)
    return name


def _as_defined(definition: Any) -> bool:
    """Whether a definition that a bag brings along, where it is in .msg text, has the fields of JointState; other languages go by their hash."""
    if definition.format.name != "MSG":
        return True
    return re.sub(r"#[^\n]*", " ", definition.data.split("=" * 80)[0]).split()[1:] == FIELDS


def _messages(rosbags: Rosbags, reader: Any, topic: str, limit: int) -> Iterator[tuple[int, int, Any]]:
    """Stamp and time of the log, ns, and message, in the order of the log; limit : bytes all may unpack to where each is compressed, else 0."""
    ours = [connection for connection in reader.connections if connection.topic == topic]
    decode = rosbags.decode1 if isinstance(reader, rosbags.reader1) else rosbags.decode2
    total = 0
    for _, logged, raw in reader.messages(connections=ours) if ours else ():
        data = unpacked(rosbags.unpackers["zstd"](), raw, limit - total) if limit else raw
        total += len(data)
        if limit and total > limit:
            require_size(total, 0, topic)
        message = decode(data, MESSAGE)
        yield int(message.header.stamp.sec) * NANOSECONDS + int(message.header.stamp.nanosec), int(logged), message


def _state(stamp: int, message: Any) -> JointState:
    return JointState(stamp, tuple(message.name), message.position, message.velocity, message.effort)
