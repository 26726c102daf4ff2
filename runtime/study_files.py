"""Study files: YAML 1.2, read to plain values with the line of every key, so that an error names
its line.
"""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from runtime.core.errors import InputError, SettingsError
from runtime.core.limits import LIMIT
from runtime.core.settings import structure
from runtime.core.study import Study
from runtime.reading.files import require_file
from runtime.yaml_text import yaml_values

T = TypeVar("T")


def load_study(path: str | Path) -> Study:
    """The Study of a study file; raises SettingsError with file, line and key."""
    return study_from_text(text_of(path), file=Path(path).name)


def text_of(path: str | Path) -> str:
    """The text of a file of settings."""
    path = Path(path)
    if require_file(path) > 4 * LIMIT.YAML_CHARACTERS:  # bytes of so many characters
        raise InputError(
            f"more than {4 * LIMIT.YAML_CHARACTERS} bytes; a file of settings has a few thousand",
            file=str(path),
        )
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as e:
        raise InputError(
            f"byte {e.start} is not UTF-8; save the file as UTF-8", file=str(path)
        ) from e
    except OSError as e:
        raise InputError(f"cannot be read: {e.strerror or e}", file=str(path)) from e


def study_from_text(text: str, *, file: str = "study") -> Study:
    """The Study of the text of a study file."""
    return settings_from_text(Study, text, file=file)


def settings_from_text(kind: type[T], text: str, *, file: str) -> T:
    """The settings of a YAML text.

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
        known = (e.path[:k] for k in range(len(e.path), -1, -1) if e.path[:k] in lines)
        raise SettingsError(
            e.reason, path=e.path, file=file, line=lines.get(next(known, ()))
        ) from None
