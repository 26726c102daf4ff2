"""How much a compressed file may hold: a file of a few kilobytes that unpacks to gigabytes is refused before its content is in memory."""

from __future__ import annotations

from typing import Protocol

from runtime.errors import InputError

ALWAYS = 2**28  # bytes, 256 MiB: what any file may unpack to
RATIO = 20  # times its size: what a larger one may unpack to; measured records reach 2 to 10
PART = 2**20  # bytes unpacked at a time


class Unpacker(Protocol):
    """What bz2, lz4 and zstandard call a decompressor."""

    @property
    def needs_input(self) -> bool:
        """Whether all that was given is unpacked."""

    @property
    def eof(self) -> bool:
        """Whether the end of the compressed data was reached."""

    def decompress(self, data: bytes, max_length: int = -1) -> bytes:
        """At most max_length bytes more."""


def allowed(packed: int) -> int:
    """Bytes that a file of `packed` bytes may unpack to."""
    return max(ALWAYS, RATIO * packed)


def require_size(unpacked: int, packed: int, file: str) -> None:
    """Raise InputError where a file of `packed` bytes would hold `unpacked` ones, more than a measured record ever does."""
    if unpacked > allowed(packed):
        raise InputError(
            f"unpacks to {unpacked / 2**20:.0f} MiB or more from {packed / 2**20:.3g} MiB; a record may be {ALWAYS // 2**20} MiB "
            f"or {RATIO} times the size of its file: store it without compression if it is genuine",
            file=file,
        )


def unpacked(unpacker: Unpacker, data: bytes, limit: int) -> bytes:
    """`data` unpacked, at most limit + 1 bytes of it."""
    parts, size = [], 0
    while size <= limit and not unpacker.eof and (data or not unpacker.needs_input):
        part = unpacker.decompress(data, min(PART, limit + 1 - size))
        data = b""
        parts.append(part)
        size += len(part)
    return b"".join(parts)
