"""Call functions of a compiled C file in a separate process, so that a crash does no harm.

`python call_c.py` reads {"library": path, "calls": [[name, arguments, size, before]]} as JSON. The
argument null stands for the result. Its `size` numbers are all equal to `before` when the call
begins, or are copied from the array of the library that `before` names. The program prints [status,
numbers] of every call, with the numbers as doubles in base64, because large robots have millions of
them.
"""

from __future__ import annotations

import ctypes
import json
import sys
from base64 import b64encode
from typing import Any


def main() -> None:
    job = json.load(sys.stdin)
    library = ctypes.CDLL(job["library"])
    results: list[Any] = []
    for name, arguments, size, before in job["calls"]:
        numbers = ctypes.c_double * size
        named = isinstance(before, str)
        result = numbers(*(numbers.in_dll(library, before) if named else [before] * size))
        status = getattr(library, name)(*(_argument(a, result) for a in arguments))
        results.append([status, b64encode(bytes(result)).decode()])
    json.dump(results, sys.stdout)


def _argument(a: Any, result: Any) -> Any:
    if a is None:
        return result
    return ctypes.c_int64(a) if isinstance(a, int) else (ctypes.c_double * len(a))(*a)


if __name__ == "__main__":
    main()
