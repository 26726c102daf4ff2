"""Reading of text files, and of settings in YAML with the line number of every key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import TypeVar

from runtime.documents.yaml_text import yaml_values
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import LIMIT
from runtime.ground.settings import structure

T = TypeVar("T")

LARGEST = 200_000_000  # bytes of a JSON result; that of 1000 parameters has 30 million


def require_file(path: Path) -> int:
    """Return the size of a file, bytes; raise InputError for a folder, a pipe or a device.

    A pipe or a device might never answer or never end.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as e:
        raise InputError(
            f"the file cannot be read: {getattr(e, 'strerror', None) or e}", file=str(path)
        ) from e
    if not S_ISREG(status.st_mode):
        what = "a folder" if S_ISDIR(status.st_mode) else "a pipe or a device"
        raise InputError(f"{what} cannot be read here; give an ordinary file", file=str(path))
    return status.st_size


def result_text(path: str | Path) -> str:
    """Read the text of a file with a JSON result; raise InputError if the file is too large."""
    path = Path(path)
    try:
        if require_file(path) > LARGEST:
            raise InputError(
                f"the file has more than {LARGEST} bytes; expected a result of symgen",
                file=str(path),
            )
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(
            f"the file cannot be read: {getattr(e, 'strerror', None) or e}", file=str(path)
        ) from e


def text_of(path: str | Path) -> str:
    """Read the text of a settings file; raise InputError if the file is too large."""
    path = Path(path)
    if require_file(path) > 4 * LIMIT.YAML_CHARACTERS:  # bytes of so many characters
        raise InputError(
            f"the file has more than {4 * LIMIT.YAML_CHARACTERS} bytes; a settings file has a "
            "few thousand bytes",
            file=str(path),
        )
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as e:
        raise InputError(
            f"byte {e.start} is not UTF-8; save the file as UTF-8", file=str(path)
        ) from e
    except OSError as e:
        raise InputError(f"the file cannot be read: {e.strerror or e}", file=str(path)) from e


def settings_from_text(kind: type[T], text: str, *, file: str) -> T:
    """Convert a YAML text to settings of the class `kind`.

    Parameters
    ----------
    kind : type
        A subclass of Settings.
    file : str
        Name of the file in messages.

    Raises
    ------
    SettingsError
        With file, line and key.
    """
    values, lines = yaml_values(text, file=file)
    try:
        return structure(kind, {} if values is None else values)
    except SettingsError as e:
        raise _at_line(e, lines, file) from None


@contextmanager
def locating_errors(path: str | Path) -> Iterator[None]:
    """Add file name and line to a SettingsError that is raised in the block, and raise it again.

    path : the study file whose setting is wrong.
    """
    try:
        yield
    except SettingsError as e:
        _, lines = yaml_values(text_of(path), file=Path(path).name)
        raise _at_line(e, lines, Path(path).name) from None


def _at_line(
    error: SettingsError, lines: Mapping[tuple[str | int, ...], int], file: str
) -> SettingsError:
    """Add to a settings error the line of its key, or of the section where this key is missing."""
    places = (error.path[:k] for k in range(len(error.path), -1, -1) if error.path[:k] in lines)
    return SettingsError(error.reason, path=error.path, file=file, line=lines.get(next(places, ())))
