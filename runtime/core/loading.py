"""Loading of emitted (generated) files as Python modules, only if they can be trusted.

    generated/tx40.py

A module is code, and runs with all rights of its user. An emitted file therefore runs only if this
installation has emitted and certified it, or if the user trusts it.

symgen caches each text that it emits and certifies, by content: `cache_folder("modules")` holds a
folder whose name is the first 32 digits of the SHA-256 of the text. The file is read once, so that
the text which runs is the text that was checked; no compiled copy is stored.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
import os
import sys
from hashlib import sha256
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

from runtime.ground.errors import ModelError

KEY = 32  # digits of the SHA-256 that name a text in the cache
UNTRUSTED = "is code that this installation has not generated and certified; pass trust=True (--trust) if you trust the author of this file, or generate the model here with `symgen generate`"


def cache_folder(of: str) -> Path:
    """Return the path of one of the cache folders of symgen, for instance "modules" or "compiled".

    The folder is in SYMGEN_CACHE, if set, or in the cache folder of the platform. Symbolic links are
    followed, so that the folder which is judged is the folder which is used. As the XDG
    specification says, a relative XDG_CACHE_HOME is ignored.
    """
    if given := os.environ.get("SYMGEN_CACHE"):
        return (Path(given) / of).resolve()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", ""))
        base = base if base.is_absolute() else Path.home() / ".cache"
    return (base / "symgen" / of).resolve()


def is_writable_by_others(folder: Path) -> bool:
    """Whether another user can change or replace the folder, so that its content is not safe."""
    if os.name != "posix":
        return False
    folder = folder.resolve()
    for place in (folder, *folder.parents):
        if not place.exists():
            continue
        found = place.stat()
        others = found.st_mode & 0o002 or (
            found.st_mode & 0o020 and found.st_gid not in (0, os.getgid())
        )
        sticky = place != folder and found.st_mode & 0o1000  # names there belong to their makers
        if (others and not sticky) or found.st_uid not in (0, os.getuid()):
            return True
    return False


def is_emitted(text: bytes) -> bool:
    """Whether this installation has generated a module with this text and has stored its hash."""
    try:
        folder = cache_folder("modules")
        return (folder / sha256(text).hexdigest()[:KEY]).is_dir() and not is_writable_by_others(
            folder
        )
    except (OSError, RuntimeError):  # no home folder
        return False


class _Text(importlib.abc.InspectLoader):
    """Import loader of a module whose source text is given, not read from a file."""

    def __init__(self, text: str) -> None:
        self.text = text

    def get_source(self, fullname: str) -> str:
        return self.text


def module_of(path: Path, *, trust: bool = False) -> ModuleType:
    """Load an emitted (generated) file as a Python module, if it can be trusted.

    Raise ModelError if this installation has not emitted the file, unless `trust` is true.
    """
    try:
        data = path.read_bytes()
        text = data.decode("utf-8")
    except (OSError, UnicodeDecodeError) as e:
        raise ModelError(f"the module cannot be read: {e}", file=str(path)) from e
    if not (trust or is_emitted(data)):
        raise ModelError(UNTRUSTED, file=str(path))
    return run(text, path)


def run(text: str, path: Path) -> ModuleType:
    """Execute the text of a module and return the module; `path` is the name of its file."""
    name = f"generated_{path.stem}"
    loader = _Text(text)
    module = importlib.util.module_from_spec(ModuleSpec(name, loader, origin=str(path)))
    module.__file__ = str(path)
    try:
        loader.exec_module(module)
    except ModuleNotFoundError as e:
        raise ModelError(
            f"the module needs the package {e.name}, which is not installed; install this package",
            file=str(path),
        ) from e
    except Exception as e:  # whatever a broken file raises becomes one kind of error
        raise ModelError(
            f"the import of the module fails with {type(e).__name__}: {e}; generate the module "
            "again (symgen generate)",
            file=str(path),
        ) from e
    return module
