"""Looking up columns by name, with an error that lists what there is."""

from __future__ import annotations

from collections.abc import Sequence

from runtime.errors import InputError

WIDEST = 10_000  # columns of a file; a wider one is no table of samples


def check_names(wanted: Sequence[str], present: Sequence[str], file: str) -> Sequence[str]:
    """`wanted` itself if every name is present; InputError naming the missing and the present ones otherwise."""
    missing = [name for name in wanted if name not in present]
    if missing:
        raise InputError(f"no column {', '.join(missing)}; the file has {', '.join(present) or 'none'}", file=file)
    return wanted
