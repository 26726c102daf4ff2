"""Which columns of a file are likely to be time, positions and torques, by their names: a proposal,
for a study that a person looks at.

    actual_q_0 ... actual_q_5    one quantity: a stem, and the numbers behind it
    elbow_pos, wrist_pos         or the names of the joints, in the order of the robot
    actual, q                    words of the stem
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import product
from typing import Any

QUANTITY_WORDS = {  # the first words are taken before the others
    "q": ("q", "pos", "position", "positions", "angle", "angles"),
    "tau": ("tau", "torque", "torques", "effort", "moment", "current", "currents", "cur"),
}
TIME = {"t", "time", "timestamp", "stamp", "seconds"}
NAMED_UNITS = {"t": "ms", "q": "deg", "tau": "mA"}
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
    for name in names:
        if match := re.fullmatch(r"(.*?)[\s_.(\[-]*\d+[)\]]?", name):
            stems.setdefault(match[1], []).append(name)

    def ranked(key: str) -> list[tuple[bool, int, str]]:
        return sorted(
            (bool(NOT_MEASURED & _words(stem)), QUANTITY_WORDS[key].index(word), stem)
            for stem in stems
            for word in _words(stem) & {*QUANTITY_WORDS[key]}
        )

    positions = [stem for *_, stem in ranked("q")][:1]
    alike = [one for one in ranked("tau") if positions and _same(stems, one[2], positions[0])]
    if not alike:
        return {}
    torques = stems[alike[0][2]]
    columns: dict[str, Any] = {"q": stems[positions[0]], "tau": torques}
    if time := next((name for name in names if _words(name) & TIME), None):
        columns["t"] = time
    units = {"tau": "A"} if QUANTITY_WORDS["tau"][alike[0][1]].startswith("cur") else {}
    stated = {"t": time or "", "q": positions[0], "tau": alike[0][2]}
    for key, name in stated.items():
        if NAMED_UNITS[key].lower() in re.split(r"[\W\d_]+", name.lower()):
            units[key] = NAMED_UNITS[key]
    return {"columns": columns, **({"units": units} if units else {})}


def _words(name: str) -> set[str]:
    return {word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)}


def _same(stems: dict[str, list[str]], one: str, other: str) -> bool:
    return one != other and len(stems[one]) == len(stems[other])
