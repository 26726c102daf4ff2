"""Study files: YAML 1.2, read to plain values with the line of every key, so that an error names its line."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from runtime.errors import InputError, SettingsError
from runtime.io.datasets import DATASETS, dataset_study
from runtime.io.table import READERS
from runtime.mapping import structure
from runtime.study import RecordSettings, Study, study_from_mapping

T = TypeVar("T")

LONGEST = 1_000_000  # characters
DEEPEST = 50  # levels; also stops an alias that contains itself
LARGEST = 100_000  # values, aliases expanded


def study_of(record: str) -> tuple[Study, Path]:
    """The Study that a name on a command line means, and the folder its files are relative to.

    record : a dataset, a study file (.yaml, .yml), or a measured file whose columns are called t, q1 ..., tau1 ... (SI, joint side).
    """
    path = Path(record)
    if record in DATASETS:
        return study_from_mapping(dataset_study(record)), Path()
    if path.suffix.lower() in (".yaml", ".yml"):
        return load_study(path), path.parent
    if any(suffix.lower() in READERS for suffix in path.suffixes):
        return Study(record=(RecordSettings(files=(path.name,)),)), path.parent
    raise InputError(
        f"no record {record!r}; expected a dataset ({', '.join(DATASETS)}), a study file (.yaml) or a measured file ({', '.join(READERS)})"
    )


def load_study(path: Path) -> Study:
    """The Study of a study file; raises SettingsError with file, line and key."""
    return study_from_text(text_of(path), file=path.name)


def text_of(path: Path) -> str:
    """The text of a file of settings."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"cannot be read: {e}", file=str(path)) from e


def study_from_text(text: str, *, file: str = "study") -> Study:
    """The Study of the text of a study file."""
    return settings_from_text(Study, text, file=file)


def settings_from_text(kind: type[T], text: str, *, file: str) -> T:
    """The settings, a frozen dataclass, of a YAML text; raises SettingsError with file, line and key."""
    if len(text) > LONGEST:
        raise InputError(f"{len(text)} characters; such a file has at most {LONGEST}", file=file)
    try:
        tree = YAML(typ="rt", pure=True).load(text)
    except MarkedYAMLError as e:
        mark = e.problem_mark or e.context_mark
        raise SettingsError(f"not YAML: {e.problem or e.context}", file=file, line=None if mark is None else mark.line + 1) from None
    except (YAMLError, ValueError, RecursionError) as e:
        raise SettingsError(f"not YAML: {str(e).splitlines()[0] if str(e) else type(e).__name__}", file=file) from None
    values = _plain(tree, file, [0], 0)
    try:
        return structure(kind, {} if values is None else values)
    except SettingsError as e:
        raise SettingsError(e.reason, path=e.path, file=file, line=_line(tree, e.path)) from None


def _plain(node: Any, file: str, count: list[int], depth: int) -> Any:
    """Built-in dict, list, str, int, float, bool and None; keys as texts."""
    count[0] += 1
    if depth > DEEPEST or count[0] > LARGEST:
        raise SettingsError(f"nested deeper than {DEEPEST} levels or more than {LARGEST} values", file=file)
    if isinstance(node, Mapping):
        return {str(k): _plain(v, file, count, depth + 1) for k, v in node.items()}
    if isinstance(node, list):
        return [_plain(v, file, count, depth + 1) for v in node]
    if isinstance(node, bool) or node is None:
        return node
    for kind in (int, float, str):
        if isinstance(node, kind):
            return kind(node)
    raise SettingsError(f"{type(node).__name__} value {str(node)[:40]!r}; expected numbers, texts, lists and mappings", file=file)


def _line(node: Any, path: tuple[str | int, ...]) -> int | None:
    """Line, from 1, of the deepest key of the path that the file holds."""
    line: int | None = None
    for key in path:
        if isinstance(node, CommentedMap):
            found = next((k for k in node if str(k) == str(key)), None)
            if found is None:
                break
            line = int(node.lc.key(found)[0]) + 1
            node = node[found]
        elif isinstance(node, CommentedSeq) and isinstance(key, int) and key < len(node):
            line = int(node.lc.item(key)[0]) + 1
            node = node[key]
        else:
            break
    return line
