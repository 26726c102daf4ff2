"""Compile the C code of CasADi functions on first use, and store it in a cache of checked files.

The system compiler (`CC`, else cc, gcc, clang) writes a shared object into a cache folder (compiled
in `SYMGEN_CACHE`, else in the cache folder of the platform). The file name holds the SHA-256 of
source, flags, compiler and processor, and the SHA-256 of the file itself, so that a damaged file is
not loaded. The file is written under another name and then moved, so that several processes may
compile at once.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from runtime.core.loading import is_writable_by_others
from runtime.core.provenance import cpuinfo
from runtime.ground.limits import limits

LIMIT = limits(__package__)

LIBRARIES = ("-lm",)
UNSAFE = (
    "-ffast-math",
    "-Ofast",
    "-funsafe-math-optimizations",
)  # set flush-to-zero in the process that loads the object


class FallbackWarning(UserWarning):
    """Warning that CasADi's interpreter runs instead of compiled C; the message says why."""


class NotCompiledError(Exception):
    """The C code could not be compiled; the message says why."""


def shared_object(
    path: Path,
    text: bytes,
    folder: Path,
    opened: Callable[[Path], ctypes.CDLL],
    flags: Sequence[str],
) -> ctypes.CDLL:
    """Load the compiled library of a C file from the cache, or compile the file first.

    A library that does not open is compiled once more.

    Parameters
    ----------
    path : Path
        Path of the C file; only its name is used.
    text : bytes
        Content of the C file.
    folder : Path
        Folder of the cache.
    opened : callable
        Function that loads and checks an object; it raises NotCompiledError or OSError if the
        object is not the expected one.
    flags : sequence of str
        Flags of the compiler.

    Raises
    ------
    NotCompiledError
        There is no compiler, the compiler fails, or the cache cannot be used.
    """
    command, version = compiler()
    parts = (
        text,
        " ".join((*flags, *LIBRARIES)).encode(),
        " ".join(command).encode(),
        version.encode(),
        (
            f"{platform.system()} {platform.machine()} {platform.architecture()[0]} "
            f"{cpuinfo('flags', 'Features')}"
        ).encode(),  # what the code may depend on
    )
    key = hashlib.sha256(b"\0".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        folder = folder.resolve()
        if is_writable_by_others(folder):
            raise NotCompiledError(
                f"anyone may write to the cache folder {folder}; choose another folder by the variable SYMGEN_CACHE"
            )
        return _cached(folder, key[:32], opened) or opened(
            _compiled(command, flags, path, text, folder, key[:32])
        )
    except OSError as e:  # no right to write, full, or mounted without the right to execute
        raise NotCompiledError(
            f"cache folder {folder}: {e.strerror or e}; choose another folder by the variable SYMGEN_CACHE"
        ) from e


def _cached(folder: Path, key: str, opened: Callable[[Path], ctypes.CDLL]) -> ctypes.CDLL | None:
    """Open the compiled library that the cache holds for the hash `key`; None if there is no such
    file.

    Files that are damaged or do not open are removed.
    """
    for path in sorted(folder.glob(f"{key}-*.so")):
        if hashlib.sha256(path.read_bytes()).hexdigest()[:32] == path.stem.partition("-")[2]:
            try:
                return opened(path)
            except (NotCompiledError, OSError):
                pass
        path.unlink(missing_ok=True)
    return None


def _compiled(
    command: Sequence[str], flags: Sequence[str], path: Path, text: bytes, folder: Path, key: str
) -> Path:
    with TemporaryDirectory(dir=folder, prefix=".compiling-") as scratch:
        source, target = Path(scratch) / path.name, Path(scratch) / f"{path.stem}.so"
        source.write_bytes(text)
        done = _ran([*command, *flags, source.name, "-o", target.name, *LIBRARIES], scratch)
        if done.returncode or not target.is_file():
            first = next(iter(done.stderr.strip().splitlines()), "no message")
            raise NotCompiledError(
                f"the compiler {' '.join(command)} failed with exit code {done.returncode}: {first}"
            )
        final = folder / f"{key}-{hashlib.sha256(target.read_bytes()).hexdigest()[:32]}.so"
        target.replace(final)
    return final


def compiler() -> tuple[tuple[str, ...], str]:
    """Find the C compiler; return its command and its version text.

    Raise NotCompiledError if there is no compiler, or if it cannot be used.
    """
    given = shlex.split(os.environ.get("CC", ""))
    program = (
        shutil.which(given[0])
        if given
        else next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    )
    if program is None:
        raise NotCompiledError(
            f"no C compiler {given[0]}, which the variable CC names"
            if given
            else "no C compiler cc, gcc or clang on PATH"
        )
    unsafe = [flag for flag in given[1:] if flag in UNSAFE]
    if unsafe:
        raise NotCompiledError(
            f"CC contains {', '.join(unsafe)}, which changes the arithmetic of the whole process; remove this flag"
        )
    command = (program, *given[1:])
    return command, _ran([*command, "--version"]).stdout


def _ran(words: Sequence[str], folder: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run the compiler in a folder; raise NotCompiledError if the compiler does not run or not end."""
    try:
        return subprocess.run(
            words,
            cwd=folder,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=LIMIT.COMPILE_TIME,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as e:
        raise NotCompiledError(f"the compiler {words[0]} did not run: {e}") from e
