"""Record files made to do harm: bombs, names that lead elsewhere, tables that compute, bytes that
are none of the format. All are refused by name.
"""

import gzip
import io
import os
import re
import shutil
import sqlite3
import struct
import sys
import tracemalloc
import zipfile

import numpy as np
import pytest
from bag_files import KINDS, joint_states, write_bag
from campaign import campaign, some
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.typesys import get_types_from_msg

from runtime import read_record
from runtime.ground.errors import InputError
from runtime.reading.formats import read_table
from runtime.study import study_from_mapping

ALWAYS = 2**24  # bytes that any file may unpack to, here
BEYOND = ALWAYS + 2**20
BOMB = 200 * 2**20  # bytes that a few kilobytes of a bag unpack to
N = 30
STAMPS = np.arange(1, N + 1) * 5_000_000
MESSAGES = {"/joint_states": joint_states(STAMPS, ("j1", "j2"), np.zeros((N, 2)), np.ones((N, 2)))}


@pytest.fixture(autouse=True)
def smaller(monkeypatch):
    """The limit of 256 MiB takes seconds to reach."""
    monkeypatch.setattr("runtime.reading.files.ALWAYS", ALWAYS)


def refused(read, said, peak=60e6):
    """`read` raises an InputError that says so, and never holds `peak` bytes."""
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=said):
            read()
        assert tracemalloc.get_traced_memory()[1] < peak
    finally:
        tracemalloc.stop()


def record(path, **others):
    return read_record(study_from_mapping({"record": {"files": str(path), **others}}).record[0])


ONE = {"rate": 1, "columns": {"q": ["q1"], "tau": ["q1"]}}


REFUSED = "damaged, or not a whole bag|needs more memory than available"


# --- bombs
# ------------------------------------------------------------------------------------------------------------


def test_gzip_bomb(tmp_path):
    with gzip.open(tmp_path / "a.csv.gz", "wb", compresslevel=9) as packed:
        for _ in range(BEYOND // 2**20):
            packed.write(b"1\n" * 2**19)
    refused(lambda: record(tmp_path / "a.csv.gz"), "unpacks to 1[67] MiB or more")


def test_zip_bomb_in_npz(tmp_path):
    with (
        zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as packed,
        packed.open("q1.npy", "w", force_zip64=True) as member,
    ):
        np.lib.format.write_array_header_1_0(
            member, {"descr": "<f8", "fortran_order": False, "shape": (BEYOND // 8,)}
        )
        for _ in range(BEYOND // 2**20):
            member.write(bytes(2**20))
    refused(lambda: record(tmp_path / "a.npz", **ONE), "unpacks to 17 MiB or more")


def test_npz_that_declares_more_than_it_holds(tmp_path):
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        content, {"descr": "<f8", "fortran_order": False, "shape": (10**15,)}
    )
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as packed:
        packed.writestr("q1.npy", content.getvalue())
    with pytest.raises(InputError, match="archive of plain arrays"):
        record(tmp_path / "a.npz", **ONE)


def packed(kind):
    """BOMB zeros, compressed."""
    import bz2

    import lz4.frame

    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd

    if kind == "bz2":
        return (BOMB // 2**20) * bz2.compress(bytes(2**20))  # streams may follow each other
    return {"lz4": lz4.frame.compress, "zstd": zstd.compress}[kind](bytes(BOMB))


@pytest.mark.parametrize("kind", ["bz2", "lz4"])
def test_ros1_chunk_bomb(tmp_path, kind):
    """A chunk that unpacks to what its messages do not need."""
    path = write_bag(f"ros1 {kind}", tmp_path / "run", MESSAGES)
    data, bomb = path.read_bytes(), packed(kind)
    start = data.index(b"compression=") + len(b"compression=" + kind.encode())
    start += len(b"\x08\x00\x00\x00size=....") if data[start + 4 : start + 8] == b"size" else 0
    (length,) = struct.unpack_from("<I", data, start)
    path.write_bytes(
        data[:start] + struct.pack("<I", len(bomb)) + bomb + data[start + 4 + length :]
    )
    shift = len(bomb) - length
    data = bytearray(path.read_bytes())
    place = data.index(b"index_pos=") + len(b"index_pos=")
    struct.pack_into("<Q", data, place, struct.unpack_from("<Q", data, place)[0] + shift)
    path.write_bytes(data)
    refused(lambda: read_table(path), REFUSED, peak=3 * BOMB)


@pytest.mark.parametrize("kind", ["sqlite3 message", "sqlite3 file"])
def test_zstd_bomb_in_a_ros2_bag(tmp_path, kind):
    path = write_bag(kind, tmp_path / "run", MESSAGES)
    if kind.endswith("file"):
        next(path.glob("*.zstd")).write_bytes(packed("zstd"))
    else:
        with sqlite3.connect(next(path.glob("*.db3"))) as bag:
            bag.execute("UPDATE messages SET data = ?", (packed("zstd"),))
        bag.close()
    refused(lambda: read_table(path), REFUSED, peak=3 * BOMB)


# --- tables that compute, definitions that a bag brings along
# -----------------------------------------------------------


@pytest.mark.parametrize(
    "script",
    [
        (
            "ALTER TABLE messages RENAME TO m; CREATE VIEW messages AS SELECT id, topic_id, "
            "timestamp, zeroblob(1000000000) AS data FROM m;"
        ),
        "DROP TABLE messages; CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, "
        "timestamp INTEGER, data BLOB GENERATED ALWAYS AS (zeroblob(1000000000)));",
        "DROP TABLE message_definitions; CREATE VIEW Message_Definitions AS SELECT 1 AS id;",
    ],
)
def test_sqlite_tables_that_compute(tmp_path, script):
    path = write_bag("bare db3", tmp_path / "run", MESSAGES)
    bag = sqlite3.connect(path)
    bag.executescript(script)
    bag.close()
    refused(
        lambda: read_table(path).chosen(["t", "j1.position"]).read(["t", "j1.position"]),
        f"{REFUSED}|no message",
    )


def test_a_definition_of_its_own_is_refused(tmp_path):
    """And never becomes code."""
    path = write_bag("bare mcap", tmp_path / "run", MESSAGES)
    data = path.read_bytes()
    assert get_types_from_msg("float64[] velocity", "a/msg/b")  # what would become code
    path.write_bytes(data.replace(b"float64[] velocity", b"float32[] velocity"))
    refused(lambda: read_table(path), "but not the definition of this type")


def test_mcap_summary_that_begins_nowhere(tmp_path):
    """Within an attachment, say, where records would never have been looked at."""
    path = write_bag("bare mcap", tmp_path / "run", MESSAGES)
    data = bytearray(path.read_bytes())
    struct.pack_into("<Q", data, len(data) - 28, 60)
    path.write_bytes(data)
    refused(lambda: read_table(path), REFUSED)


# --- names that lead elsewhere
# ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "../secret.db3",
        "/etc/passwd",
        "run/../../secret.db3",
        "..",
        ".",
        "",
        "a\\..\\b",
        "run_0.db3?mode=rwc",
        ".hidden",
    ],
)
def test_files_of_a_bag_stay_in_its_folder(tmp_path, name):
    path = write_bag("sqlite3", tmp_path / "run", MESSAGES)
    shutil.copy(next(path.glob("*.db3")), tmp_path / "secret.db3")
    text = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text(
        re.sub(r"(relative_file_paths:\s*\n\s*- ).*", lambda m: m[1] + repr(name), text)
    )
    refused(lambda: read_table(path), "expected a file of this folder")


def test_links_out_of_the_folder(tmp_path):
    path = write_bag("sqlite3", tmp_path / "run", MESSAGES)
    store = next(path.glob("*.db3"))
    store.rename(tmp_path / "secret.db3")
    store.symlink_to(tmp_path / "secret.db3")
    refused(lambda: read_table(path), "expected a file of this folder")


LAUGHS = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join(['*' + a] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (LAUGHS, "anchors and aliases"),
        ("[" * 500_000, "nested deeper"),
        ("[a, " * 199, "nested deeper"),
        ("- " * 2000, "nested deeper"),
        ("x: " + "1" * 2_000_000, "at most 500000"),
        ("!!python/object/apply:os.system [true]", "tags"),
        ("rosbag2_bagfile_information: 1", "the key rosbag2_bagfile_information is missing"),
        ("rosbag2_bagfile_information: {relative_file_paths: 5}", "lists no file"),
        (
            (
                "rosbag2_bagfile_information: {relative_file_paths: [x], compression_mode: file, "
                "compression_format: rar}"
            ),
            "but the folder of the bag has no such file",
        ),
        ("\x00", "not YAML"),
    ],
)
@some(4)
def test_descriptions_of_bags(tmp_path, text, said):
    path = write_bag("sqlite3", tmp_path / "run", MESSAGES)
    (path / "metadata.yaml").write_text(text)
    refused(lambda: read_table(path), said)


def test_a_pipe_is_no_bag(tmp_path):
    """It would never answer."""
    for name in ("a.bag", "a.mcap", "a.db3"):
        os.mkfifo(tmp_path / name)
        refused(lambda name=name: read_table(tmp_path / name), "a pipe or a device")


# --- damaged files
# ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Bytes of one file of every kind that is a single file."""
    folder = tmp_path_factory.mktemp("bags")
    paths = [write_bag(kind, folder / kind.replace(" ", "_"), MESSAGES) for kind in KINDS]
    paths = [
        path if path.is_file() else next(p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))
        for path in paths
        if "file" not in path.name
    ]
    return [(path.suffix, path.read_bytes()) for path in paths]


@campaign
def test_truncated_bags(tmp_path, whole):
    for k, (suffix, data) in enumerate(whole):
        path = tmp_path / f"a{suffix}"
        path.write_bytes(data[: int((0, 0.01, 0.3, 0.7, 0.99)[k % 5] * len(data))])
        with pytest.raises(InputError, match=path.name):
            read_table(path)


@campaign  # by default: tests/fuzz, formats bag, mcap, db3
@settings(
    max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_spoiled_bags(tmp_path, whole, data):
    """8 bytes anywhere: numbers or an InputError, nothing else."""
    suffix, content = data.draw(st.sampled_from(whole))
    spoiled = bytearray(content)
    place = data.draw(st.integers(0, len(spoiled) - 8))
    spoiled[place : place + 8] = data.draw(st.binary(min_size=8, max_size=8))
    path = tmp_path / f"a{suffix}"
    path.write_bytes(spoiled)
    try:
        read_table(path).chosen(["t", "j1.position"]).read(["t", "j1.position"])
    except InputError as e:
        assert path.name in str(e) or "/joint_states" in str(e)
