"""Conversion of an error of pydantic to one SettingsError: value, expected values and keys.

pydantic finds such errors in settings and in JSON results. For a removed or misplaced setting of a
study file, a sentence names the replacement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from runtime.ground.errors import InputError, SettingsError

Path = tuple[str | int, ...]

EXPECTED = {  # by the type of an error of pydantic
    "bool_type": "true or false",
    "finite_number": "a finite number",
    "float_type": "a number",
    "greater_than": "more than {gt}",
    "greater_than_equal": "at least {ge}",
    "int_type": "an integer",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "list_type": "a list",
    "mapping_type": "a mapping",
    "dict_type": "a mapping",
    "dataclass_type": "a mapping",
    "model_attributes_type": "a mapping",
    "union_tag_not_found": "a mapping with the key {discriminator}",
    "string_type": "a text",
    "tuple_type": "a list",
    "literal_error": "{expected}",
}


def shown(value: Any) -> str:
    """Write a value as Python prints it (repr), on one line of at most 80 characters."""
    return " ".join(repr(value).split())[:80]


def settings_error(error: ValidationError, given: Any, path: Path = ()) -> SettingsError:
    """Make a SettingsError from the first problem that pydantic found in the value `given`.

    path : keys that lead to `given`. Every member of a union of types has its own error. The member
    that accepts most of the value gives the message; members that accept equally much are named
    together.
    """
    problems = [_problem(details, given) for details in error.errors(include_url=False)]
    first = problems[0][0]
    alike = [problem for problem in problems if problem[0][: len(first)] == first]
    deepest = max((place for place, _ in alike), key=len)
    reasons = [reason for place, reason in alike if place == deepest]
    prefix = f"{reasons[0].partition('; expected ')[0]}; expected "
    expected = [reason.removeprefix(prefix) for reason in reasons if reason.startswith(prefix)]
    message = prefix + " or ".join(dict.fromkeys(expected)) if expected else reasons[0]
    return SettingsError(message, path=(*path, *deepest))


def _problem(details: ErrorDetails, given: Any) -> tuple[Path, str]:
    """Return the keys of the setting in which pydantic found an error, and the reason as text.

    The keys are those of pydantic's location `loc`, without its names of members of union types,
    which are no keys.
    """
    path: Path = ()
    for key in details["loc"]:
        try:
            holds_items = isinstance(given, Mapping | Sequence) and not isinstance(given, str)
            given = given[key] if holds_items else getattr(given, key)  # type: ignore[arg-type]
            path = (*path, key)
        except (LookupError, TypeError, AttributeError):
            continue
    kind = details["type"]
    context = details.get("ctx", {})
    cause = context.get("error")
    last = details["loc"][-1] if details["loc"] else ""
    if isinstance(cause, SettingsError):
        return (*path, *cause.path), cause.reason
    if isinstance(cause, InputError):
        return path, cause.message
    if kind == "union_tag_invalid":
        key = context["discriminator"].strip("'")
        names = context["expected_tags"].replace("'", "")
        return (*path, key), f"no {key} {context['tag']!r}; there are {names}"
    if kind == "missing" and isinstance(last, str):
        return path, f"no key {last}; add it"
    if kind == "missing":
        return path, f"{len(given)} values; expected at least {int(last) + 1}"
    if kind == "too_long":
        return path, f"{context['actual_length']} values; expected {context['max_length']}"
    if kind in EXPECTED:
        expected = EXPECTED[kind].format(**context).replace("'", "")
        return path, f"{shown(details['input'])}; expected {expected}"
    return path, details["msg"].removeprefix("Value error, ")


RATIO = (
    "write gear ratios in the robot file, drives: {ratio: [100, 80]}; record.side: motor means that "
    "the columns are those of the motors"
)
WENT: Mapping[str, str] = {
    "estimate.options.prior: entropic": "the distance entropic was removed; use euclidean or none",
    "estimate.options.around": "this setting moved to the section rows: write rows: {around: 0.1}, for every method",
    "estimate.method: tls": "total least squares was removed; use wls, and `symgen cestac --advise` to see the effect of the encoder on the estimate",
    "estimate.method: cloe": "output error of the closed loop was removed; use didim, which uses the same records of the same loop",
    "record.ratio": RATIO,
    "record.gear_ratio": RATIO,
    "record.columns.q_link": "the stiffness of gears with two encoders is no longer estimated; remove this key",
    "signals.torque_median: auto": "the automatic median of torques was removed; write a window such as 5, or remove this key: torques then have no median",
    "signals.lines": "lines of uneven encoders are no longer estimated; remove this key: bounds are widened by the deviation of the lines",
    "estimate.options.prior: pullback": "the distance pullback was removed; use euclidean or none",
    "stream": "this setting was removed, every record is read whole; remove the key, and cut a record that is too large for the memory into shorter records",
}
"""Messages for settings that are gone, by key ("stream") or by key and value
("estimate.method: tls"); keys of lists have no numbers ("record.resample").
"""


def gone(path: tuple[str | int, ...], value: Any) -> str | None:
    """Return the message on a setting that was removed or moved; None for any other setting.

    Parameters
    ----------
    path : tuple of str and int
        Keys that lead to the setting in a study.
    value : object
        Value of the setting.
    """
    key = ".".join(name for name in path if isinstance(name, str))
    return WENT.get(key) or WENT.get(f"{key}: {value}")
