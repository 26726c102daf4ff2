"""Emitted text as a Python module, imported from a file that other processes can load too.

The file lies in a cache by content: the name of its folder is the SHA-256 of the text, so that an entry never gets old, and an entry whose
bytes are not the text is written anew, whole, under another name first. Where the cache cannot be written, a folder that lives as long as
this process serves.
"""

from __future__ import annotations

import atexit
import importlib.util
import os
import shutil
import sys
from functools import lru_cache
from hashlib import sha256
from importlib.machinery import SourceFileLoader
from pathlib import Path
from tempfile import NamedTemporaryFile, mkdtemp
from types import ModuleType

from symgen.errors import SymgenError


def cache_folder() -> Path:
    """Folder of the emitted modules: SYMGEN_CACHE/modules, or that of the platform for files that can be made again."""
    if given := os.environ.get("SYMGEN_CACHE"):
        return Path(given) / "modules"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "symgen" / "modules"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "symgen" / "modules"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "symgen" / "modules"


def cached_path(file: str, text: str) -> Path | None:
    """Path of the cache entry of a file that holds `text`; None where there is none, or another text."""
    path = _entry(file, text)
    try:
        return path if path is not None and path.read_bytes() == text.encode("utf-8") else None
    except OSError:
        return None


def stored_path(file: str, text: str) -> Path:
    """Path of a file that holds `text`, in the cache or, where that cannot be written, in a folder of this process.

    Raises SymgenError where no file can be written at all.
    """
    if (path := _entry(file, text)) is not None:
        try:
            return _write(path, text)
        except OSError:  # no right to write, full
            pass
    try:
        return _write(_folder_of_this_process() / _key(text) / file, text)
    except OSError as e:
        raise SymgenError(
            f"{file}: neither the cache folder nor a temporary file can be written: {e.strerror or e}; set SYMGEN_CACHE or TMPDIR"
        ) from e


def imported(path: Path) -> ModuleType:
    """The module of an emitted file, called generated_ROBOT."""
    name = f"generated_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path, loader=_TextLoader(name, str(path)))
    if spec is None or spec.loader is None:
        raise SymgenError(f"{path} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class _TextLoader(SourceFileLoader):
    """Loader of the text alone: bytecode of an earlier text that lies beside is neither read nor written."""

    def path_stats(self, path: str | bytes) -> dict[str, float]:
        raise OSError(f"{path!r} has no bytecode")


def _key(text: str) -> str:
    return sha256(text.encode("utf-8")).hexdigest()[:32]


def _entry(file: str, text: str) -> Path | None:
    """Where the cache holds the file; None where there is no home folder, or anyone may write to the cache."""
    try:
        folder = cache_folder().absolute()
        if os.name == "posix" and folder.is_dir() and folder.stat().st_mode & 0o002:
            return None
    except (OSError, RuntimeError):
        return None
    return folder / _key(text) / file


def _write(path: Path, text: str) -> Path:
    """Write the file whole, or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    with NamedTemporaryFile("w", encoding="utf-8", newline="\n", dir=path.parent, prefix=f".{path.stem}-", delete=False) as file:
        file.write(text)
    try:
        Path(file.name).replace(path)
    except OSError:
        Path(file.name).unlink(missing_ok=True)
        raise
    return path


@lru_cache(maxsize=1)
def _folder_of_this_process() -> Path:
    folder = mkdtemp(prefix="symgen-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
