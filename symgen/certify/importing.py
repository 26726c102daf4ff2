"""Cache of certified source files, and import of emitted Python modules.

The folder of a file in the cache is named after the SHA-256 of the text without the lines of its
certificate, so that an entry is never out of date. A file with another text is replaced as a whole:
the new file is written under another name first. A second folder, named after the whole text, marks
the text as certified. If the cache cannot be written, a folder is used that exists only as long as
this process.
"""

from __future__ import annotations

import atexit
import importlib.util
import os
import re
import shutil
import sys
from functools import lru_cache
from hashlib import sha256
from importlib.machinery import SourceFileLoader
from pathlib import Path
from tempfile import NamedTemporaryFile, mkdtemp
from types import ModuleType

from symgen.errors import SymgenError

HEAD = "Certificate by symgen "
END = "sha256 of all but these lines: "
CERTIFICATE = re.compile(
    rf"\A(?P<mark>\S{{1,2}} ){HEAD}.*\n((?P=mark).*\n)*?(?P=mark){END}[0-9a-f]{{64}}\n"
    rf'|\n\n{HEAD}[^"\\]*\n{END}[0-9a-f]{{64}}(?=\n"""\n)'
    rf"|\n% {HEAD}.*\n(% .*\n)*?% {END}[0-9a-f]{{64}}\n\Z"
)
"""The lines of a certificate: comments at the head of a text, the end of a docstring, or comments at
the end of a MATLAB text.
"""


def cache_folder() -> Path:
    """Return the cache folder in which emitted modules are stored.

    The folder is SYMGEN_CACHE/modules, or else a folder in the cache folder of the platform.
    Symbolic links are followed, so that the folder which is judged is the folder which is used. As
    the XDG specification says, a relative XDG_CACHE_HOME is ignored.
    """
    if given := os.environ.get("SYMGEN_CACHE"):
        return (Path(given) / "modules").resolve()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", ""))
        base = base if base.is_absolute() else Path.home() / ".cache"
    return (base / "symgen" / "modules").resolve()


def cached_path(file: str, text: str) -> Path | None:
    """Return the path of the cached source file whose text, without its certificate, equals `text`.

    Return None if there is no such file, or if its whole text is not marked as certified.
    """
    folder = entry(text)
    if folder is None:
        return None
    try:
        whole = (folder / file).read_bytes().decode("utf-8")
    except (OSError, UnicodeError):
        return None
    right = is_certified(whole) and without_certificate(whole) == text
    return folder / file if right else None


def stored_path(file: str, text: str) -> Path:
    """Write `text` to a file in the cache, and return the path of the file.

    The folder of the file is named after the text without its certificate. A second folder, named
    after the whole text, marks the text as certified. If the cache cannot be written, the file is
    in a folder of this process. SymgenError is raised if no file can be written at all.
    """
    folder, whole = entry(without_certificate(text)), entry(text)
    if folder is not None and whole is not None:
        try:
            whole.mkdir(parents=True, exist_ok=True, mode=0o700)
            return _write(folder / file, text)
        except OSError:  # no right to write, full
            pass
    try:
        return _write(_folder_of_this_process() / key_of(text) / file, text)
    except OSError as e:
        raise SymgenError(
            f"{file}: neither the cache folder nor a temporary file can be written: "
            f"{e.strerror or e}; set SYMGEN_CACHE or TMPDIR"
        ) from e


def is_certified(text: str) -> bool:
    """Whether the cache marks a source text as certified."""
    whole = entry(text)
    return whole is not None and whole.is_dir()


def without_certificate(text: str) -> str:
    """Return the text of a source file without the lines of its certificate."""
    return CERTIFICATE.sub("", text, count=1)


def imported(path: Path) -> ModuleType:
    """Import an emitted file ROBOT.py as the module generated_ROBOT."""
    name = f"generated_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path, loader=_TextLoader(name, str(path)))
    if spec is None or spec.loader is None:
        raise SymgenError(f"{path} cannot be imported as a module; expected a file ROBOT.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class _TextLoader(SourceFileLoader):
    """Module loader that always compiles the source text; it neither reads nor writes bytecode."""

    text = ""

    def get_data(self, path: str) -> bytes:
        data = super().get_data(path)
        self.text = data.decode("utf-8")
        return data

    def path_stats(self, path: str | bytes) -> dict[str, float]:
        raise OSError(f"{path!r} has no bytecode")


def is_writable_by_others(folder: Path) -> bool:
    """Whether other users may write into the folder or replace it.

    Files in such a folder cannot be trusted.
    """
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


def key_of(text: str) -> str:
    """Return the name of a text in the cache: the first digits of its SHA-256."""
    return sha256(text.encode("utf-8")).hexdigest()[:32]


def entry(text: str) -> Path | None:
    """Return the cache folder of a source text; its name is a hash of the text.

    Return None if there is no home folder, or if other users may write to the cache. SymgenError is
    raised instead if SYMGEN_CACHE names such a folder.
    """
    try:
        folder = cache_folder()
        shared = is_writable_by_others(folder)
    except (OSError, RuntimeError):
        return None
    if shared and os.environ.get("SYMGEN_CACHE"):
        raise SymgenError(
            f"SYMGEN_CACHE: other users can write to {folder}, or to a folder above it, and could put "
            "code there that this program would run; choose a folder of your own (chmod 700)"
        )
    if shared:
        return None
    return folder / key_of(text)


def _write(path: Path, text: str) -> Path:
    """Write a file completely or not at all, and return its path."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    with NamedTemporaryFile(
        "w", encoding="utf-8", newline="\n", dir=path.parent, prefix=f".{path.stem}-", delete=False
    ) as file:
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
