"""Results of one command in one folder: every file whole, or none at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory


def write_all(folder: Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Write every file into a folder beside its place first, then move them; when writing fails, `folder` is as it was."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=folder, prefix=".writing-") as scratch:
        for name, content in contents.items():
            (Path(scratch) / name).write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
        for name in contents:
            (Path(scratch) / name).replace(folder / name)
    return [folder / name for name in contents]
