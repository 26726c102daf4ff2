"""Bytes of a measured file, plain or compressed by gzip: reading, hash and limit of size."""

from __future__ import annotations

import gzip
import hashlib
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, cast

from runtime.documents.files import require_file
from runtime.ground.errors import InputError

WHOLE = 2**31  # bytes of a file that is read into memory as it is
ALWAYS = 2**28  # bytes, 256 MiB: what any file may unpack to
RATIO = 20  # times its size: what a larger one may unpack to; measured records reach 2 to 10
PART = 2**20  # bytes read at a time
GZIP = b"\x1f\x8b"  # first bytes


def is_file(path: Path) -> bool:
    """Whether `path` is an existing file; False also for a path that the system does not allow."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def require_size(unpacked: int, size: int, file: str) -> None:
    """Raise InputError if a compressed file unpacks to more bytes than a record may have."""
    if unpacked > max(ALWAYS, RATIO * size):
        raise InputError(
            f"the file unpacks to {unpacked / 2**20:.0f} MiB or more from {size / 2**20:.3g} MiB; "
            f"the limit is the larger of {ALWAYS // 2**20} MiB and {RATIO} times the file size: "
            "store the record without compression if the file is genuine",
            file=file,
        )


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """Yield the uncompressed bytes of a file as a stream; error messages then name the file."""
    require_file(path)
    try:
        with path.open("rb") as plain:
            if plain.peek(len(GZIP))[: len(GZIP)] != GZIP:
                yield plain
                return
            with gzip.GzipFile(fileobj=plain) as stream:
                yield cast(BinaryIO, stream)
    except (gzip.BadGzipFile, EOFError, zlib.error) as e:
        raise InputError(f"damaged gzip file ({e}); copy the file again", file=str(path)) from e
    except OSError as e:
        raise InputError(f"the file cannot be read: {e.strerror or e}", file=str(path)) from e


def unpacked(path: Path) -> Path | BytesIO:
    """Return the path of a plain file, or the uncompressed bytes of a compressed file.

    Both forms suit libraries that read paths or files.
    """
    with opened(path) as stream:
        packed = isinstance(stream, gzip.GzipFile)
    return BytesIO(read_bytes(path)) if packed else path


def read_bytes(path: Path) -> bytes:
    """Read the uncompressed bytes of a file."""
    if require_file(path) > WHOLE:
        raise InputError(
            f"the file has more than {WHOLE // 2**30} GiB; cut the file into shorter records",
            file=str(path),
        )
    return b"".join(_parts(path))


def sha256_of(path: Path) -> str:
    """Compute the SHA-256 of the uncompressed bytes of a file, as 64 hexadecimal digits.

    A file that unpacks to more bytes than a record has is refused while it is read.
    """
    digest = hashlib.sha256()
    for part in _parts(path):
        digest.update(part)
    return digest.hexdigest()


def sha256(data: bytes) -> str:
    """Compute the SHA-256 of bytes, as 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def _parts(path: Path) -> Iterator[bytes]:
    """Yield the uncompressed bytes of a file, part by part; raise InputError if they exceed the
    limit.
    """
    size = require_file(path)
    total = 0
    with opened(path) as stream:
        while part := stream.read(PART):
            total += len(part)
            require_size(total, size, str(path))
            yield part
