"""Cases of binary formats, aware of their structure: NumPy headers, ZIP archives, MATLAB elements,
Parquet and gzip.
"""

from __future__ import annotations

import gzip
import io
import random
import struct
import zipfile
import zlib

import numpy as np

SHAPES = (
    *("()", "(0,)", "(1,)", "(12,)", "(12, 1)", "(1, 12)", "(12, 2)", "(2, 12)", "(3, 2, 2)", "(0, 5)", "(5, 0)", "(-1,)", "(-3, -4)", "(12.0,)", "(True,)", "12", "[12]", "None", "('a',)", "(1e3,)"),
    *("(10**9,)", "(1000000000,)", "(1000000000000,)", "(9223372036854775807,)", "(9223372036854775808,)", "(4294967296, 4294967296)", "(12, 1000000000)", "(1000000000, 0)", "(" + "1, " * 40 + ")", "(" + "1, " * 3000 + ")", "(" + "9" * 4000 + ",)"),
)  # fmt: skip
DTYPES = (
    *("'<f8'", "'>f8'", "'<f4'", "'<f2'", "'<f16'", "'<i8'", "'|b1'", "'<u8'", "'|u1'", "'|O'", "'O'", "'<c16'", "'<U10'", "'<U1000000000'", "'|S1000000000'", "'|S0'", "'|V0'", "'|V2000000000'", "'<M8[ns]'", "'<m8'", "'f8,O'", "''", "'zz'", "'3f8'", "'(2,)f8'"),
    *("[('q1', '<f8')]", "[('q1', '<f8', (2,))]", "[('q1', '|O')]", "[('a', [('b', '<f8')])]", "[('q1', '<f8', (100000, 100000))]", "{'names': ['a'], 'formats': ['f8'], 'offsets': [2000000000]}", "None", "0", "('<f8', (3,))", "('<f8', {'align': True})"),
)  # fmt: skip
HEADERS = (
    *("{}", "", "[", "None", "'x'", "{" * 3000, "(" * 9000, "[" * 9000 + "]" * 9000, "-" * 9000 + "1", "__import__('os').system('id')", "{'descr': '<f8', 'fortran_order': False, 'shape': (12,), 'x': 1}", "{'descr': '<f8'}", "9**9**9**9", "{'a': {'a': {'a': 1}}}", "\x00", "lambda: 0"),
)  # fmt: skip


def npy_header(text: str, version: tuple[int, int] = (1, 0), length: int | None = None) -> bytes:
    """Magic, version, declared length, text."""
    data = text.encode("latin-1", "replace")
    size = len(data) if length is None else length
    return (
        b"\x93NUMPY"
        + bytes(version)
        + (
            struct.pack("<H", size & 0xFFFF)
            if version == (1, 0)
            else struct.pack("<I", size & 0xFFFFFFFF)
        )
        + data
    )


def npy(rng: random.Random, rows: int = 12) -> bytes:
    """A .npy file, mostly with a hostile header."""
    dtype, shape, fortran = (
        rng.choice((*DTYPES, "'<f8'", "'<f8'")),
        rng.choice((*SHAPES, "(12,)", "(12, 5)")),
        rng.choice(("False", "True", "0", "'x'", "None")),
    )
    sound = ("'<f8'", "False", "(12, 5)")
    dtype, fortran, shape = (
        x if rng.random() < 0.5 else y for x, y in zip((dtype, fortran, shape), sound, strict=True)
    )
    text = (
        f"{{'descr': {dtype}, 'fortran_order': {fortran}, 'shape': {shape}}}"
        if rng.random() < 0.85
        else rng.choice(HEADERS)
    )
    text += rng.choice((" " * 20 + "\n",) * 9 + ("\n", "", " " * 60000))
    version = rng.choice(((1, 0),) * 20 + ((2, 0), (3, 0), (4, 0), (0, 0), (255, 255)))
    length = rng.choice((None,) * 20 + (0, 1, 65535, 2**31, 2**32 - 1))
    body = rng.choice(
        (
            *[np.arange(rows * 5, dtype=float).tobytes()] * 6,
            np.full(rows * 5, np.nan).tobytes(),
            b"",
            b"\x80\x04N.",
            bytes(range(200)),
        )
    )
    return npy_header(text, version, length) + body


def plain_npy(x: np.ndarray) -> bytes:
    """A sound .npy file."""
    stream = io.BytesIO()
    np.save(stream, x)
    return stream.getvalue()


ENTRIES = (
    "../../x.npy",
    "/etc/x.npy",
    "q1.npy",
    "q1.npy",
    "tau1.npy",
    "q1",
    "t.npy",
    "a/b.npy",
    "x.txt",
    "q\x1b[2J.npy",
    "é.npy",
    "q" + "9" * 5000 + ".npy",
    "CON.npy",
    "a" * 60000,
)


def npz(members: dict[str, bytes], rng: random.Random) -> bytes:
    """An archive with hostile members or hostile tables."""
    members = dict(members)
    for _ in range(rng.choice((0, 1, 1, 2))):
        key = rng.choice((*sorted(members), *ENTRIES))
        members[key] = npy(rng)
    if rng.random() < 0.2:
        members.pop(rng.choice(sorted(members)))
    stream = io.BytesIO()
    method = rng.choice(
        (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    )
    with zipfile.ZipFile(stream, "w", method, allowZip64=True) as archive:
        for name, data in members.items():
            archive.writestr(name or "q1.npy", data)
    data = bytearray(stream.getvalue())
    for _ in range(
        rng.choice((0, 0, 1, 2))
    ):  # fields of the local and central headers and of the end
        found = [
            k
            for mark in (b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06")
            for k in positions(data, mark)
        ]
        if not found:
            break
        at = rng.choice(found) + rng.randrange(4, 46)
        value = rng.choice(
            (
                b"\xff\xff\xff\xff",
                b"\x00\x00\x00\x00",
                b"\x01\x00",
                b"\xff\xff",
                b"\x63\x00",
                b"\xff\xff\xff\x7f",
                bytes([rng.randrange(256)]),
            )
        )
        data[at : at + len(value)] = value
    return bytes(data)


def stored(members: dict[str, bytes]) -> bytes:
    """A sound archive without compression."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    return stream.getvalue()


def positions(data: bytes | bytearray, mark: bytes) -> list[int]:
    """Where `mark` stands."""
    found, at = [], data.find(mark)
    while at >= 0:
        found.append(at)
        at = data.find(mark, at + 1)
    return found


COUNTS = (0, 1, 2, 7, 8, 12, 255, 2**16, 2**28, 2**31 - 1, 2**31, 2**32 - 8, 2**32 - 1)


def element(kind: int, data: bytes, declared: int | None = None) -> bytes:
    """A data element of MATLAB's level 5."""
    return (
        struct.pack(
            "<II", kind & 0xFFFFFFFF, (len(data) if declared is None else declared) & 0xFFFFFFFF
        )
        + data
        + b"\x00" * (-len(data) % 8)
    )


def mat5(rng: random.Random, depth: int = 3) -> bytes:
    """A .mat file of level 5 with declared sizes, classes and types that may be wrong."""
    parts = [
        matrix(rng, name, depth)
        for name in rng.sample(("t", "q1", "q2", "tau1", "tau2", "x", ""), rng.randrange(1, 7))
    ]
    parts = [
        element(15, zlib.compress(part), rng.choice((None,) * 6 + COUNTS))
        if rng.random() < 0.3
        else part
        for part in parts
    ]
    head = (
        rng.choice((b"MATLAB 5.0 MAT-file", b"", b"x" * 200)).ljust(116)[:116]
        + b"\x00" * 8
        + rng.choice(
            (b"\x00\x01IM",) * 8
            + (b"\x01\x00MI", b"\x00\x02IM", b"\x00\x00\x00\x00", b"\x00\x03IM")
        )
    )
    return head + b"".join(parts)


def matrix(rng: random.Random, name: str, depth: int) -> bytes:
    """One array; cells and structures hold others."""
    kind = rng.choice((6, 6, 6, 6, 7, 9, 12, 14, 4, 1, 2, 3, 5, 16, 17, 18, 0, 255))
    sizes = rng.choice(
        ((12, 1),) * 6
        + (
            (1, 12),
            (12, 2),
            (3, 2, 2),
            (0, 0),
            (-1, 12),
            (2**31 - 1, 1),
            (2**30, 4),
            (2**31 - 1, 2**31 - 1),
            (1,) * 40,
            (),
            (12,),
        )
    )
    head = element(
        6,
        struct.pack("<II", kind | rng.choice((0, 0, 0, 0x800, 0x200)), 0),
        rng.choice((None,) * 9 + COUNTS),
    )
    head += element(5, struct.pack(f"<{len(sizes)}i", *sizes), rng.choice((None,) * 9 + COUNTS))
    head += element(rng.choice((1, 1, 1, 1, 9, 0)), name.encode(), rng.choice((None,) * 9 + COUNTS))
    if kind in (1, 2) and depth:
        if kind == 2:
            head += element(5, struct.pack("<i", rng.choice((32, 0, -1, 2**31 - 1)))) + element(
                1, b"a".ljust(32, b"\x00"), rng.choice((None, None, *COUNTS))
            )
        body = b"".join(
            matrix(rng, rng.choice(("", "q1")), depth - 1) for _ in range(rng.choice((0, 1, 12)))
        )
    else:
        data = np.arange(12, dtype=float).tobytes()
        body = element(
            rng.choice((9, 9, 9, 7, 2, 12, 14, 15, 16, 99, 0)),
            data,
            rng.choice((None,) * 6 + COUNTS),
        )
    return element(14, head + body, rng.choice((None,) * 9 + COUNTS))


def mat4(rng: random.Random) -> bytes:
    """A .mat file of level 4."""
    parts = []
    for name in rng.sample(("t", "q1", "tau1", "x"), rng.randrange(1, 5)):
        mopt, rows, columns, imaginary = (
            rng.choice((0, 0, 0, 10, 20, 50, 1, 2, 1000, 9999)),
            rng.choice((12, 12, *COUNTS)),
            rng.choice((1, 1, *COUNTS)),
            rng.choice((0, 0, 1, 2**31)),
        )
        length = rng.choice((len(name) + 1, len(name) + 1, *COUNTS))
        parts.append(
            struct.pack("<5I", mopt, rows, columns, imaginary, length)
            + name.encode()
            + b"\x00"
            + np.arange(12, dtype=float).tobytes()
        )
    return b"".join(parts)


def gzipped(content: bytes, rng: random.Random) -> bytes:
    """The content compressed, its header or end damaged now and then."""
    data = bytearray(gzip.compress(content, 1, mtime=0))
    for _ in range(rng.choice((0, 0, 1, 2))):
        data[rng.choice((*range(2, 12), -1, -4, -8, len(data) // 2)) % len(data)] = rng.randrange(
            256
        )
    return bytes(data if rng.random() < 0.9 else data[: rng.randrange(2, len(data))]) + rng.choice(
        (b"",) * 8 + (b"\x00" * 20, b"\x1f\x8b", b"junk", bytes(data))
    )
