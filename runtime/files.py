"""Bytes of a measured file, plain or compressed by gzip, and their hash."""

from __future__ import annotations

import gzip
import hashlib
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import BinaryIO, cast

from runtime.errors import InputError
from runtime.limits import PART, require_size

WHOLE = 2**31  # bytes of a file that is read into memory; larger ones are read by blocks


def is_file(path: Path) -> bool:
    """Whether there is a file of that name; False for names that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def require_file(path: Path) -> int:
    """Bytes of a file on disk; InputError for folders, and for pipes and devices, which may never answer or never end."""
    try:
        found = path.stat()
    except (OSError, ValueError) as e:
        raise InputError(f"cannot be read: {getattr(e, 'strerror', None) or e}", file=str(path)) from e
    if not S_ISREG(found.st_mode):
        what = "a folder" if S_ISDIR(found.st_mode) else "a pipe or a device"
        raise InputError(f"cannot be read: {what}; expected a file, copy its content into one", file=str(path))
    return found.st_size


def read_bytes(path: Path) -> bytes:
    """The uncompressed bytes of a file, recognised by its first two bytes, not by its name."""
    if require_file(path) > WHOLE:
        raise InputError(f"more than {WHOLE // 2**30} GiB; read it by blocks (stream: 65536 in the study file, or --block)", file=str(path))
    try:
        data = path.read_bytes()
    except OSError as e:
        raise InputError(f"cannot be read: {e.strerror or e}", file=str(path)) from e
    if data[:2] != b"\x1f\x8b":
        return data
    try:
        parts, size = [], 0
        with gzip.GzipFile(fileobj=BytesIO(data)) as packed:
            while part := packed.read(PART):
                parts.append(part)
                size += len(part)
                require_size(size, len(data), str(path))
        return b"".join(parts)
    except InputError:
        raise
    except (OSError, EOFError, zlib.error) as e:
        raise InputError(f"damaged gzip file ({e}); copy it again", file=str(path)) from e


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """The uncompressed bytes of a file as a stream; what goes wrong while it is read names the file."""
    require_file(path)
    try:
        with path.open("rb") as plain:
            if plain.peek(2)[:2] != b"\x1f\x8b":
                yield plain
                return
            with gzip.GzipFile(fileobj=plain) as unpacked:
                yield cast(BinaryIO, unpacked)
    except (gzip.BadGzipFile, EOFError, zlib.error) as e:
        raise InputError(f"damaged gzip file ({e}); copy it again", file=str(path)) from e
    except OSError as e:
        raise InputError(f"cannot be read: {e.strerror or e}", file=str(path)) from e


def sha256_of(path: Path) -> str:
    """SHA-256 of the uncompressed bytes of a file of any size, 64 hexadecimal digits."""
    with opened(path) as stream:
        digest = hashlib.sha256()
        while part := stream.read(2**20):
            digest.update(part)
        return digest.hexdigest()


def sha256(data: bytes) -> str:
    """SHA-256 of bytes, 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()
