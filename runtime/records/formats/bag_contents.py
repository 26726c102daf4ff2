"""What is checked before a bag is read: how much its chunks unpack to, that its tables hold what they say, which files its description names.

MCAP (mcap.dev/spec): after 8 bytes, records of a type (1 byte), a length (8) and a content; a chunk holds start, end, size unpacked (8 each), crc (4),
the compression (length 4, text) and the records (length 8). ROS 2 bags in SQLite are tables of topics and messages.
"""

from __future__ import annotations

import re
import sqlite3
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from runtime.errors import InputError
from runtime.limits import Unpacker, require_size, unpacked

CHANNEL, CHUNK, FOOTER = 0x04, 0x06, 0x02  # types of MCAP records
FOOTER_SIZE = 37  # bytes of that record and of the mark behind it
LONGEST_TOPICS = 250_000  # characters, all topics together
MOST_BRACKETS = 500  # open brackets, all topics together: recorders write none
RECORD = struct.Struct("<BQ")
SIZES = struct.Struct("<QQQII")  # start, end, size unpacked, crc, length of the name of the compression
MAGIC = 8  # bytes ahead of the first record
TABLES = ("messages", "topics", "schema", "message_definitions", "metadata")
STORED_NAME = re.compile(r"[\w.+ -]{1,255}")

Chunks = dict[int, tuple[str, int, int]]  # by place in the file: compression, size packed, size unpacked


def mcap_chunks(path: Path, unpackers: Mapping[str, Callable[[], Unpacker]]) -> Chunks:
    """The chunks of an MCAP file; raises InputError where one unpacks to another size than it says, or all to more than a record holds.

    Every record that a reader may come to is looked at: the summary that the last record, the footer, leads to has to begin with one of them.
    """
    size, total = path.stat().st_size, 0
    chunks: Chunks = {}
    channels: set[bytes] = set()
    places, footer = {0}, b""
    for place, kind, content in _records(path, size):
        places.add(place)
        if kind == CHANNEL:
            channels.add(content)
        elif kind == FOOTER:
            footer = content if place == size - FOOTER_SIZE else b""
        elif kind == CHUNK:
            _, _, said, _, letters = SIZES.unpack_from(content)
            start = SIZES.size + letters
            compression = content[SIZES.size : start].decode("ascii", "replace")
            (packed,) = struct.unpack_from("<Q", content, start)
            require_size(total + said, size, path.name)
            data = content[start + 8 : start + 8 + packed]
            if compression in unpackers:
                data = unpacked(unpackers[compression](), data, said)
            if len(data) != said:
                raise InputError(f"a chunk at byte {place} that does not unpack to the {said} bytes it says", file=path.name)
            total += said
            chunks[place] = (compression, packed, said)
            channels |= _channels(data)
    if not footer or struct.unpack_from("<Q", footer)[0] not in places:
        raise InputError("not a whole MCAP file: its last record does not lead to a summary; repair it with `mcap recover`", file=path.name)
    _require_descriptions(channels, path.name)
    return chunks


def _records(path: Path, size: int) -> Iterator[tuple[int, int, bytes]]:
    """Place, type and content of the records up to the footer; of messages, attachments and the like no content."""
    with path.open("rb") as stream:
        stream.seek(MAGIC)
        while len(head := stream.read(RECORD.size)) == RECORD.size:
            kind, length = RECORD.unpack(head)
            place = stream.tell() - RECORD.size
            if length > size - stream.tell():
                raise InputError(f"ends within a record at byte {place}; it was cut short, or recording was", file=path.name)
            if kind in (CHUNK, CHANNEL, FOOTER):
                yield place, kind, stream.read(length)
            else:
                stream.seek(length, 1)
                yield place, kind, b""
            if kind == FOOTER:
                return


def _channels(data: bytes) -> set[bytes]:
    """Contents of the channel records of a chunk."""
    found, place = set(), 0
    while place + RECORD.size <= len(data):
        kind, length = RECORD.unpack_from(data, place)
        place += RECORD.size
        if kind == CHANNEL:
            found.add(data[place : place + length])
        place += length
    return found


def _require_descriptions(texts: Iterable[bytes], file: str) -> None:
    """Raise InputError where the topics are described at such length, or nested so deeply, that their quality of service takes long to read."""
    length = brackets = 0
    for text in texts:
        length += len(text)
        brackets += len(re.findall(rb"[\[{?]", text))
        if length > LONGEST_TOPICS or brackets > MOST_BRACKETS:
            raise InputError("topics described by more than a recorder writes; filter the bag for the topic of its joint states", file=file)


def require_plain_tables(path: Path) -> None:
    """Raise InputError unless the tables of a SQLite bag are stored ones: a view or a computed column could hold anything."""
    try:
        bag = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
        try:
            for name, kind, text in bag.execute("SELECT name, type, sql FROM sqlite_master").fetchall():
                if str(name).lower() not in TABLES:
                    continue
                computed = [column[1] for column in bag.execute(f'PRAGMA table_xinfo("{str(name).lower()}")') if column[6] != 0]
                if kind != "table" or computed or re.match(r"\s*create\s+virtual", str(text), re.IGNORECASE):
                    raise InputError(f"{name} is not a table of stored values; expected the database of a ROS 2 bag", file=path.name)
            if bag.execute("SELECT count(*) FROM pragma_table_info('topics') WHERE name = 'offered_qos_profiles'").fetchone()[0]:
                qos = bag.execute("SELECT substr(offered_qos_profiles, 1, ?) FROM topics", (LONGEST_TOPICS + 1,))
                _require_descriptions((str(text).encode() for (text,) in qos), path.name)
        finally:
            bag.close()
    except (sqlite3.Error, UnicodeDecodeError) as e:
        raise InputError(f"not the database of a ROS 2 bag ({e})", file=path.name) from e


def storage_files(folder: Path) -> tuple[list[Path], str]:
    """Files of a ROS 2 bag, a folder with metadata.yaml, and how they are compressed: "", "file" or "message"."""
    from runtime.settings.yaml import LONGEST, yaml_values

    description = folder / "metadata.yaml"
    where = f"{folder.name}/metadata.yaml"
    if not description.is_file():
        raise InputError("a folder without metadata.yaml; expected a ROS 2 bag", file=str(folder))
    try:
        text = description.open("rb").read(4 * LONGEST + 1).decode()
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"cannot be read: {e}", file=where) from e
    values, _ = yaml_values(text, file=where)
    bag = _mapping(_mapping(values, where).get("rosbag2_bagfile_information"), where)
    names = bag.get("relative_file_paths")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise InputError("relative_file_paths names no file; expected those of the bag", file=where)
    mode = str(bag.get("compression_mode") or "none").lower()
    if mode not in ("none", "file", "message") or (mode != "none" and bag.get("compression_format") != "zstd"):
        raise InputError(
            f"compression {bag.get('compression_format')!r} by {mode!r}; expected zstd by file or by message, or none", file=where
        )
    return [_inside(folder, name, where) for name in names], "" if mode == "none" else mode


def _inside(folder: Path, name: str, where: str) -> Path:
    """The file `name` of the folder; bags of the first ROS 2 versions write it behind the name of the folder."""
    stored = name.removeprefix(f"{folder.name}/")
    path = folder / stored
    if not STORED_NAME.fullmatch(stored) or stored.startswith(".") or not path.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"relative_file_paths names {name[:80]!r}; expected a file of this folder", file=where)
    if not path.is_file():
        raise InputError(f"relative_file_paths names {name!r}; there is no such file in the folder", file=where)
    return path


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError("no mapping rosbag2_bagfile_information; expected the description of a ROS 2 bag", file=where)
    return value
