"""Show the frame table of a robot file as cells, and write edited cells back into the file.

Other parts of the text stay as they are.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from runtime.documents.yaml_text import yaml_values
from runtime.ground.errors import InputError
from symgen.description import parse_robot
from symgen.description.grammar import parse
from symgen.errors import DescriptionError

TABLE_COLUMNS = {  # keys of a row in the order of the page, by convention
    "proximal": ("ant", "sigma", "mu", "gamma", "b", "alpha", "d", "theta", "r"),
    "distal": ("ant", "sigma", "mu", "d", "alpha", "r", "theta", "gamma", "b"),
}
UNITS_OF_CELLS = {"gamma": "rad", "alpha": "rad", "theta": "rad", "b": "m", "d": "m", "r": "m"}
MEANINGS = {
    "ant": "the frame on which frame j stands",
    "sigma": "0 revolute, 1 prismatic, 2 fixed",
    "mu": "1 driven, 0 passive",
    "gamma": "angle about z of the frame before, from its x to the common normal",
    "b": "distance along z of the frame before, to the common normal",
    "alpha": "angle between the two z axes, about the common normal",
    "d": "distance between the two z axes, along the common normal",
    "theta": "angle about z of frame j, from the common normal to its x",
    "r": "distance along z of frame j, from the common normal to its origin",
}
"""Meaning of the columns of the table."""
EDITED: dict[str, Any] = {
    "name": "",
    "title": "",
    "convention": "proximal",
    "frames": {},
    "constants": {},
    "gravity": ["0", "0", "-g"],
    "loops": [],
}
SIZED = ("limits", "drives", "values", "labels", "elements", "constraints", "massless")
"""Parts whose size is that of the robot: they go where a frame is added or removed."""
PLAIN_CELL = re.compile(r"(?!- )[A-Za-z0-9_.+/(-][A-Za-z0-9_.+*/() -]*(?<! )\Z|[0-9]\Z")
TOP_LEVEL = re.compile(r"^(?=[A-Za-z_]+\s*:)", re.M)
CELL = 200  # characters of a cell
MOST_ERRORS = 30  # that are told at once
PRINTED = ((r"(?<=\d)\s*°", "*pi/180"), (r"(?<=[\d)])\s*π", "*pi"), ("π", "pi"), ("−", "-"))
"""Signs that textbooks print, as patterns, and the text of a robot file for each."""


def cells_of(text: str) -> dict[str, Any]:
    """Return name, title, convention, frames, constants, gravity and loops of a robot file as texts.

    Values that are not valid for a robot are accepted too.

    Returns
    -------
    dict
        name, title, convention : text; frames : {number: {column: text}}; constants : {name: text};
        gravity : list of text; loops : list of {cut, twin}.
    """
    values = yaml_values(text, file="robot.yaml")[0]
    values = values if isinstance(values, dict) else {}
    given = {key: values.get(key) or empty for key, empty in EDITED.items()}
    return {
        key: _texts(x) if isinstance(x, type(EDITED[key])) else EDITED[key]
        for key, x in given.items()
    }


def _texts(x: Any) -> Any:
    """Convert every number or text inside the nested tables and lists of x to a text."""
    if isinstance(x, dict):
        return {str(key): _texts(value) for key, value in x.items()}
    if isinstance(x, list):
        return [_texts(value) for value in x]
    return "" if x is None else str(x)


def columns_of(cells: Mapping[str, Any]) -> list[str]:
    """Return the columns of a table; a classic (distal) table has gamma and b only if the user has
    entered them.
    """
    convention = cells["convention"]
    typed = {column for row in cells["frames"].values() for column in row}
    return [
        column
        for column in TABLE_COLUMNS.get(convention, TABLE_COLUMNS["proximal"])
        if convention != "distal" or column not in ("gamma", "b") or column in typed
    ]


def degrees(
    frames: Mapping[str, Mapping[str, str]], constants: Mapping[str, float]
) -> dict[str, dict[str, str]]:
    """Return the angles of a valid frame table at q = 0 in degrees: {frame: {column: text}}."""
    values = {f"q{j}": 0.0 for j in frames} | dict(constants)
    angles = [c for c, unit in UNITS_OF_CELLS.items() if unit == "rad"]
    return {
        j: {c: f"{np.degrees(parse(row[c]).value(values)):.6g}°" for c in angles if c in row}
        for j, row in frames.items()
    }


def with_cells(text: str, asked: str) -> str:
    """Write edited cells into the text of a robot file.

    asked : the cells, in JSON with the form of `cells_of`. Other parts stay, with their comments. A
      cell may contain the signs of a textbook: 90° is written as 90*pi/180, π/2 as pi/2.

    Raises DescriptionError if `asked` is no such table.
    """
    try:
        cells = {key: type(empty)(json.loads(asked)[key]) for key, empty in EDITED.items()}
        for row in cells["frames"].values():
            row.update({column: _as_in_files(cell) for column, cell in row.items()})
        frames = [f"  {int(j)}: {_flow(row.items())}" for j, row in cells["frames"].items()]
        loops = [f"  - {_flow(loop.items())}" for loop in cells["loops"]]
        gravity = ", ".join(map(_scalar, cells["gravity"]))
        constants = _flow(cells["constants"].items())
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise DescriptionError("the page sent no table; reload the page") from error
    new = {
        **{
            key: f"{key}: {_quoted(cells[key])}\n" if cells[key] else ""
            for key in ("name", "title")
        },
        "convention": "convention: distal\n" * (cells["convention"] == "distal"),
        "gravity": f"gravity: [{gravity}]\n",
        "constants": f"constants: {constants}\n",
        "frames": "\n".join(["frames:", *frames, ""]),
        "loops": "\n".join(["loops:", *loops, ""]) if loops else "",
    }
    now = cells_of(text)
    kept = {key for key, cell in cells.items() if cell == now[key]}
    parts = [
        new.pop(key) + _comments(part) if key in new and key not in kept else part
        for key, part in blocks(text)
    ]
    return "".join([*parts, *(x for key, x in new.items() if key not in kept)])


def blocks(text: str) -> list[tuple[str, str]]:
    """Split a robot file into its top-level parts, as pairs of key and lines, in order.

    Lines before the first part have the key "".
    """
    parts = [part if part.endswith("\n") else f"{part}\n" for part in TOP_LEVEL.split(text) if part]
    return [(re.match(r"[A-Za-z_]*", part)[0], part) for part in parts]  # type: ignore[index]


def wrong(text: str) -> DescriptionError | None:
    """Return the error in the text of a robot file; None if it has no error."""
    try:
        parse_robot(text.encode(), "robot.yaml")
    except DescriptionError as error:
        return error
    return None


def errors(text: str) -> list[DescriptionError]:
    """List the errors in the text of a robot file, each once.

    After each error, the robot is read again with a usual value in place of the wrong value. An
    error in a value that was replaced, or in a part that the table does not show, ends the search.
    """
    found: list[DescriptionError] = []
    while (error := wrong(text)) is not None:
        if error.path[:3] in {other.path[:3] for other in found}:
            break
        found.append(error)
        try:
            shorter = _without(text, error.path)
        except (DescriptionError, InputError):
            break
        if len(found) == MOST_ERRORS or shorter == text:
            break
        text = shorter
    return found


def _without(text: str, path: tuple[str | int, ...]) -> str:
    """Replace the value that a path names by a usual value, or leave out a part that is no cell."""
    cells = cells_of(text)
    part, *keys = (*map(str, path), "")
    if part in SIZED:
        return "".join(block for key, block in blocks(text) if key != part)
    if part == "frames" and keys[0] in cells["frames"]:
        row, j = cells["frames"][keys[0]], int(keys[0])
        own = {"0": ("0", f"q{j}", "0"), "1": ("1", "0", f"q{j}"), "2": ("2", "0", "0")}
        turned = ("sigma", "theta", "r")  # the joint variable stands where sigma says
        new = dict(zip(turned, own.get(row.get("sigma", ""), own["0"]), strict=True))
        new = {**dict.fromkeys(("gamma", "b", "alpha", "d"), "0"), "ant": str(j - 1), **new}
        columns = turned if keys[1] == "sigma" else keys[1:2] if keys[1] else [*new]
        for column in columns:
            row[column] = new.get(column, "0")
        if keys[1] not in ("", *new):
            del row[keys[1]]
    elif part == "constants" and keys[0] in cells["constants"]:
        cells["constants"][keys[0]] = "1"
    elif part == "gravity" and keys[0].isdigit():
        cells["gravity"][int(keys[0])] = "0"
    elif part == "loops" and keys[0].isdigit():
        del cells["loops"][int(keys[0])]
    elif part in ("name", "title", "convention"):
        cells[part] = "arm" if part == "name" else EDITED[part]
    return with_cells(text, json.dumps(cells))


def beside(place: str, cells: Mapping[str, Any] | None) -> bool:
    """Whether the page has a cell, a row or a pair for a place such as frames.2.alpha."""
    part, key, *_ = f"{place}..".split(".")
    if not cells:
        return False
    if part in ("frames", "constants"):
        return key in cells[part]
    if part in ("loops", "gravity"):
        return key.isdigit() and int(key) < len(cells[part])
    return part in ("name", "title", "convention")


def fitted(text: str) -> tuple[str, list[str]]:
    """Remove the parts of a robot file that no longer fit after frames were added or removed.

    For instance, `limits` must have one entry per joint. Return the new text and the names of the
    removed parts.
    """
    left_out: list[str] = []
    while (error := wrong(text)) is not None and error.path and error.path[0] in SIZED:
        left_out.append(str(error.path[0]))
        shorter = "".join(part for key, part in blocks(text) if key != left_out[-1])
        if shorter == text:
            break
        text = shorter
    return text, left_out


def _comments(part: str) -> str:
    """Keep only the lines after the first of a part that are comments or empty."""
    lines = part.splitlines(keepends=True)[1:]
    return "".join(line for line in lines if line.lstrip()[:1] in ("", "#"))


def _as_in_files(cell: str) -> str:
    """Replace the signs π, ° and − of a cell by the text that a robot file has for them."""
    for sign, text in PRINTED:
        cell = re.sub(sign, text, cell)
    return cell


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=not text.isprintable())


def _flow(items: Iterable[tuple[str, Any]]) -> str:
    return f"{{{', '.join(f'{_scalar(key)}: {_scalar(x)}' for key, x in items)}}}"


def _scalar(x: Any) -> str:
    """Write a text as YAML, in quotes unless it is plain; other values as JSON."""
    if not isinstance(x, str):
        return json.dumps(x)
    return x if PLAIN_CELL.match(x) and len(x) <= CELL else json.dumps(x[: CELL + 1])
