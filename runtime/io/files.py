"""Bytes of a measured file, plain or compressed by gzip, and their hash."""

from __future__ import annotations

import gzip
import hashlib
import zlib
from pathlib import Path

from runtime.errors import InputError


def read_bytes(path: Path) -> bytes:
    """The uncompressed bytes of a file, recognised by its first two bytes, not by its name."""
    try:
        data = path.read_bytes()
    except OSError as e:
        raise InputError(f"cannot be read: {e.strerror or e}", file=str(path)) from e
    if data[:2] != b"\x1f\x8b":
        return data
    try:
        return gzip.decompress(data)
    except (OSError, EOFError, zlib.error) as e:
        raise InputError(f"damaged gzip file ({e}); copy it again", file=str(path)) from e


def sha256(data: bytes) -> str:
    """SHA-256 of bytes, 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()
