"""Arrays of numbers in MATLAB files of version 5 to 7, element by element, whatever the bytes.

    element   type and length, 4 bytes each, then the data, padded to 8 bytes; up to 4 bytes of data share the 8 with type and length
    15        a zlib stream that holds one element
    14        an array: elements with its class, its dimensions, its name, its numbers by columns, then imaginary parts, fields ...

Numbers may be stored in a narrower type than the class says; their values are the same. Nothing but numbers is looked into.

MathWorks, MAT-File Format, level 5.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod

import numpy as np

from runtime.errors import InputError
from runtime.limits import allowed, require_size
from runtime.records.formats.naming import WIDEST

Array = np.ndarray

HEADER = 128  # bytes ahead of the elements; the last four: version and byte order
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}  # types of data
ARRAY, COMPRESSED = 14, 15
CLASSES = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse matrix", 16: "function", 17: "object"}
NUMERIC = range(6, 16)  # classes of numbers, double to uint64
IMAGINARY = 0x800  # flag beside the class
DIMENSIONS = 32  # the most that numpy has room for


@dataclass(frozen=True)
class _Element:
    kind: int
    data: memoryview


def read_mat5(data: bytes, file: str) -> tuple[dict[str, Array], dict[str, str]]:
    """Arrays by name, and what the other variables are; InputError where the bytes are no such file."""
    order = "<" if data[126:128] == b"IM" else ">"
    arrays: dict[str, Array] = {}
    others: dict[str, str] = {}
    left = allowed(len(data))
    for count, element in enumerate(_elements(memoryview(data)[HEADER:], order, file)):
        if count >= WIDEST:
            raise InputError(f"more than {WIDEST} variables; store those you need in a file of their own", file=file)
        if element.kind == COMPRESSED:
            plain = _inflated(element.data, left, file)
            left -= len(plain)
            require_size(allowed(len(data)) - left, len(data), file)
            element = next(_elements(memoryview(plain), order, file), _Element(0, memoryview(b"")))
        if element.kind != ARRAY:
            raise InputError(f"not a MATLAB file (an element of type {element.kind})", file=file)
        name, found = _variable(element.data, order, file)
        if name:  # a nameless one is the workspace of functions
            arrays.pop(name, None)
            others.pop(name, None)
            if isinstance(found, str):
                others[name] = found
            else:
                arrays[name] = found
    return arrays, others


def _inflated(data: memoryview, limit: int, file: str) -> bytes:
    """The content of a zlib stream, at most limit + 1 bytes of it."""
    try:
        return zlib.decompressobj().decompress(data, max(limit, 0) + 1)
    except zlib.error as e:
        raise InputError(f"damaged MATLAB file ({e}); copy it again", file=file) from e


def _elements(data: memoryview, order: str, file: str) -> Iterator[_Element]:
    """The elements that follow each other in `data`."""
    place = 0
    while place + 8 <= len(data):
        kind, length = (int(x) for x in np.frombuffer(data, f"{order}u4", 2, place))
        start, step = place + 8, 8 + length + (-length % 8 if kind != COMPRESSED else 0)
        if kind > 0xFFFF:  # short: the length in the upper half, the data in the last four bytes
            kind, length, start, step = kind & 0xFFFF, kind >> 16, place + 4, 8
        if start + length > len(data) or (step == 8 and length > 4):
            raise InputError(f"damaged MATLAB file (an element of {length} bytes, {len(data) - start} are left); copy it again", file=file)
        yield _Element(kind, data[start : start + length])
        place += step


def _variable(data: memoryview, order: str, file: str) -> tuple[str, Array | str]:
    """Name of a variable, and its numbers or what else it is."""
    parts = _elements(data, order, file)
    flags = int(_numbers(next(parts, None), order, file, least=1)[0])
    kind = flags & 0xFF
    dimensions = () if kind == 17 else tuple(int(n) for n in _numbers(next(parts, None), order, file))
    title = next(parts, None)
    name = "" if title is None else bytes(title.data).decode("utf-8", "replace")
    if kind not in NUMERIC or flags & IMAGINARY:
        return name, f"a MATLAB {'complex array' if kind in NUMERIC else CLASSES.get(kind, f'class {kind}')}"
    x = _numbers(next(parts, None), order, file)
    if not 2 <= len(dimensions) <= DIMENSIONS or min(dimensions) < 0 or prod(dimensions) != len(x):
        raise InputError(f"damaged MATLAB file ({len(x)} numbers for dimensions {dimensions}); copy it again", file=file, column=name)
    return name, x.reshape(dimensions, order="F")


def _numbers(element: _Element | None, order: str, file: str, least: int = 0) -> Array:
    """The numbers of an element; a view on the bytes of the file."""
    kind = NUMBERS.get(0 if element is None else element.kind)
    if element is None or kind is None or len(element.data) % int(kind[1]) or len(element.data) < least * int(kind[1]):
        what = "missing" if element is None else f"of type {element.kind} and {len(element.data)} bytes"
        raise InputError(f"damaged MATLAB file (numbers {what}); copy it again", file=file)
    return np.frombuffer(element.data, order + kind)
