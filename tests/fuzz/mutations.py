"""Mutations of bytes that know nothing of a format."""

from __future__ import annotations

import random

BYTES = (
    *(b"\x00", b"\xff", b"\xef\xbb\xbf", b"\xff\xfe", b"\xc3", b"\xe2\x80\xa8", b"\xe2\x80\xae", b"\xc2\x85", b"\xed\xa0\x80", b"\x1b[31m", b"\t", b"\r", b"\n", b"\x7f"),
    *(b"\x7f\xff\xff\xff", b"\xff\xff\xff\xff", b"\x00\x00\x00\x80", b"\xff" * 8, b"\x00" * 8, b"\x01\x00\x00\x00\x00\x00\x00\x00"),
    *(b"0", b"-0", b"-1", b"1e999", b"1e-999", b"nan", b"inf", b"-inf", b"0x10", b"1_0", b"9" * 30, b"9" * 5000, b"1e308", b"3.7", "٣".encode(), "é".encode()),
    *(b"../../etc/passwd", b"/dev/zero", b"C:\\NUL", b"{{7*7}}", b"%n%s", b"__import__('os')", b"</script>", b"$(id)", b"';--"),
)  # fmt: skip


def mutated(
    content: bytes,
    rng: random.Random,
    others: tuple[bytes, ...] = (),
    tokens: tuple[bytes, ...] = BYTES,
) -> bytes:
    """One to four changes: bits, cuts, repeats, tokens, parts of other files."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 2, 4))):
        at, length = rng.randrange(len(data) + 1), rng.choice((0, 1, 1, 2, 4, 8, 40, 200))
        match rng.randrange(8):
            case 0 if data:
                data[at % len(data)] ^= 1 << rng.randrange(8)
            case 1 if data:
                data[at % len(data)] = rng.randrange(256)
            case 2:
                del data[at : at + length]
            case 3:
                data[at : at + length] = data[at : at + length] * rng.choice((2, 3, 50))
            case 4 | 5:
                data[at : at + length] = rng.choice(tokens)
            case 6 if others:
                other = rng.choice(others)
                start = rng.randrange(len(other) + 1)
                data[at : at + length] = other[start : start + rng.choice((4, 40, 400))]
            case 7:
                del data[at if rng.random() < 0.3 else len(data) :]
    return bytes(data[:2_000_000])
