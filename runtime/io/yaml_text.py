"""YAML 1.2 to plain values, within limits: size, depth and number of values, aliases expanded, so that no text grows in memory."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import accumulate
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from runtime.errors import InputError, SettingsError

LONGEST = 1_000_000  # characters
DEEPEST = 50  # levels; also stops an alias that contains itself
LARGEST = 100_000  # values, aliases expanded
OPEN = 4 * DEEPEST  # brackets open at once, those in texts counted too; the time to read them grows with their square


def yaml_values(text: str, *, file: str) -> tuple[Any, Any]:
    """Built-in dict, list, str, int, float, bool and None of a text, and the tree with the lines of its keys; raises SettingsError with file and line."""
    if len(text) > LONGEST:
        raise InputError(f"{len(text)} characters; such a file has at most {LONGEST}", file=file)
    if _open_brackets(text) > OPEN:
        raise SettingsError(f"nested deeper than {DEEPEST} levels", file=file)
    try:
        tree = YAML(typ="rt", pure=True).load(text)
    except MarkedYAMLError as e:
        mark = e.problem_mark or e.context_mark
        raise SettingsError(f"not YAML: {e.problem or e.context}", file=file, line=None if mark is None else mark.line + 1) from None
    except (YAMLError, ValueError, RecursionError) as e:
        raise SettingsError(f"not YAML: {str(e).splitlines()[0] if str(e) else type(e).__name__}", file=file) from None
    return _plain(tree, file, [0], 0), tree


def _open_brackets(text: str) -> int:
    """The most brackets that are open at once."""
    steps = (1 if bracket in "[{" else -1 for bracket in re.findall(r"[\[\]{}]", text))
    return max(accumulate(steps), default=0)


def _plain(node: Any, file: str, count: list[int], depth: int) -> Any:
    """Built-in values; keys as texts."""
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
