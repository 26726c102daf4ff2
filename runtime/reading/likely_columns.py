"""Which columns of a file are likely to be time, positions and torques, by their names: a proposal,
for a study that a person looks at.

    actual_q_0 ... actual_q_5    one quantity: a stem, and numbers in it
    q_J_1 [deg], axis2.pos       also before a unit in brackets, or within
    elbow_pos, wrist_pos         or the names of the joints, in the order of the robot
    actual, q                    words of the stem
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import product
from typing import Any

from runtime.core.errors import InputError
from runtime.reading.units import position_unit, time_unit, torque_unit

QUANTITY_WORDS = {  # the first words are taken before the others
    "q": ("q", "pos", "position", "positions", "angle", "angles", "winkel"),
    "tau": (
        *("tau", "torque", "torques", "effort", "moment", "drehmoment", "trq", "tq"),
        *("current", "currents", "cur"),
    ),
}
TIME = {"t", "time", "timestamp", "stamp", "seconds", "zeit", "temps"}
NAMED_UNITS = {"ms", "deg", "mA"}  # words of a name; others stand in brackets
NOT_MEASURED = {"target", "desired", "ref", "reference", "cmd", "command", "setpoint", "window"}


def likely_columns(names: Sequence[str], joints: Sequence[str] = ()) -> dict[str, Any]:
    """Settings of a record: columns t, q, tau, and units that names tell (currents are in A unless
    they say mA); {} where names do not tell positions and as many torques. joints : their names in
    the robot file.
    """
    stems: dict[str, list[str]] = {}
    for joint, name in product(joints, names):
        stem, found = re.subn(rf"(?<![^\W_]){re.escape(joint)}(?![^\W_])", "", name)
        if found:
            stems.setdefault(stem, []).append(name)
    for name in sorted(names, key=lambda name: [int(x) for x in re.findall("[0-9]+", name)]):
        for number in re.finditer("[0-9]+", name):
            stems.setdefault(f"{name[: number.start()]}#{name[number.end() :]}", []).append(name)

    def ranked(key: str) -> list[tuple[bool, int, int, str]]:
        return sorted(
            (bool(NOT_MEASURED & _words(stem)), QUANTITY_WORDS[key].index(word), -len(alike), stem)
            for stem, alike in stems.items()
            for word in _words(stem) & {*QUANTITY_WORDS[key]}
        )

    positions = next((stem for *_, stem in ranked("q")), None)
    if positions is None:
        return {}
    n = len(stems[positions])
    torques, word = next(
        (
            (stem, word)
            for _, word, count, stem in ranked("tau")
            if stem != positions and count == -n
        ),
        ("", 0),
    )
    if not torques:
        return {}
    time = next((name for name in names if _words(name) & TIME), "")
    columns = {"q": stems[positions], "tau": stems[torques], **({"t": time} if time else {})}
    units = {"tau": "A"} if QUANTITY_WORDS["tau"][word].startswith("cur") else {}
    for key, name, read in (
        ("t", time, time_unit),
        ("q", positions, position_unit),
        ("tau", torques, torque_unit),
    ):
        words = re.split(r"[\W\d_]+", name.lower())
        for unit in (
            *re.findall(r"[\[(]([^\])#]+)[\])]", name),
            *(unit for unit in NAMED_UNITS if unit.lower() in words),
        ):
            with suppress(InputError):  # of something else, or no unit
                read(unit)
                units[key] = unit
    return {"columns": columns, **({"units": units} if units else {})}


def _words(name: str) -> set[str]:
    return {word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)}
