"""Proposal of the columns of time, positions and torques by their names, for the user to check.

    actual_q_0 ... actual_q_5    one family: a stem, and numbers in it
    A1 Ist-Position [Grad]       also before a unit in brackets, or within; in other languages
    elbow_pos, /joints/elbow/effort, elbow    or the names of the joints, in the order of the robot
    positions (N, n)             or an array, or a field of a structure

`WORDS` gives the meaning of the words in a name; a new word is an entry there. A family is a group
of columns with the same stem. A family with a word for "measured" is preferred to one without such
a word, and this one to a family of targets.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from typing import Any

from runtime.ground.errors import InputError
from runtime.reading.units import position_unit, time_unit, torque_unit

WORDS = {  # the first words of a quantity are taken before the others; parts of long words count
    "t": (
        *("t", "time", "times", "timestamp", "stamp", "seconds", "secs"),
        *("zeit", "zeitstempel", "temps", "horodatage", "tempo", "tiempo"),
    ),
    "q": (
        *("q", "qm", "pos", "position", "positions", "angle", "angles", "theta"),
        *("winkel", "stellung", "lage", "posizione", "posicion", "posición", "gelenkwinkel"),
    ),
    "tau": (
        *("tau", "torque", "torques", "effort", "efforts", "moment", "drehmoment", "trq", "tq"),
        *("couple", "couples", "coppia", "momento"),
        *(
            "current",
            "currents",
            "cur",
            "curr",
            "strom",
            "motorstrom",
            "courant",
            "corrente",
            "corriente",
        ),
    ),
    "qd": (
        *("qd", "dq", "vel", "velocity", "velocities", "speed", "speeds", "qdot"),
        *("geschwindigkeit", "drehzahl", "vitesse", "velocita", "velocidad"),
    ),
    "other": (
        *("qdd", "ddq", "acc", "accel", "acceleration", "accelerations", "beschleunigung"),
        *("temp", "temperature", "temperatur", "voltage", "spannung", "error", "fehler", "limit"),
    ),
}
CURRENTS = WORDS["tau"][WORDS["tau"].index("current") :]
MEASURED = {"actual", "act", "measured", "meas", "feedback", "ist", "mesure", "mesuré", "reel"}
TARGETS = {
    *("target", "desired", "des", "ref", "reference", "cmd", "command", "commanded", "setpoint"),
    *("set", "soll", "consigne", "window"),
}
SECONDARY = {"se", "secondary", "link"}  # encoders behind the gears
NAMED_UNITS = {
    "ms",
    "us",
    "ns",
    "rad",
    "deg",
    "counts",
    "Nm",
    "mA",
}  # words of a name; others stand in brackets
UNITS = {"grad": "deg", "gradi": "deg", "degrés": "deg", "degres": "deg", "sek": "s"}


@dataclass(frozen=True)
class Family:
    """Columns of one quantity, one per joint, whose names differ by the joint: q1, q2, q3.

    Attributes
    ----------
    quantity : "t", "q", "tau", "qd", "other" or ""
    word : int
        Place of the word in the names among the words of the quantity in `WORDS`.
    target : int
        0 measured, 1 without such a word, 2 a target.
    names : tuple of str
    stem : str
        Common part of the names.
    """

    quantity: str
    word: int
    target: int
    names: tuple[str, ...]
    stem: str

    @property
    def order(self) -> tuple[int, int, int, int, str]:
        """Sort key: the columns with the smallest key are the likeliest ones of their quantity.

        Preferred are, in this order, measured columns, a better word, more columns, and a shorter
        stem.
        """
        return self.target, self.word, -len(self.names), len(self.stem), self.stem


def likely_columns(names: Sequence[str], joints: Sequence[str] = ()) -> dict[str, Any]:
    """Propose settings of a record (columns t, q, tau and their units) from its column names.

    Currents are in A unless names say mA. The result is {} if the names do not show positions and
    as many torques. joints : names of the joints in the robot file.
    """
    found = known_columns(names, joints)
    return found if {"q", "tau"} <= {*found.get("columns", ())} else {}


def known_columns(names: Sequence[str], joints: Sequence[str] = ()) -> dict[str, Any]:
    """Propose record settings from column names, even if only some of t, q, tau are recognised.

    Torques are left out if their number differs from that of the positions.
    """
    families = sorted(families_of(names, joints), key=lambda family: family.order)
    of = {key: [f for f in families if f.quantity == key] for key in WORDS}
    whole = [f for f in of["q"] if len(f.names) == len(joints)] or of["q"]
    positions = next(iter(whole), None)
    torques = next(
        (f for f in of["tau"] if positions is None or len(f.names) == len(positions.names)), None
    )
    beside = positions.names[0].rpartition(".")[0] if positions else ""
    time = min(of["t"], key=lambda f: f.names[0].rpartition(".")[0] != beside, default=None)
    chosen = {"t": time, "q": positions, "tau": torques}
    columns: dict[str, Any] = {
        key: family.names[0] if key == "t" else list(family.names)
        for key, family in chosen.items()
        if family
    }
    units: dict[str, str] = {}
    if torques and WORDS["tau"][torques.word] in CURRENTS:
        units["tau"] = "A"
    for key, read in (("t", time_unit), ("q", position_unit), ("tau", torque_unit)):
        if (family := chosen[key]) is not None and (unit := _unit(family.names[0], read)):
            units[key] = unit
    return {**({"columns": columns} if columns else {}), **({"units": units} if units else {})}


def may_be_currents(names: Sequence[str]) -> bool:
    """Whether any column name contains a word for current or effort, so that its unit may be A."""
    words = {*CURRENTS, "effort", "efforts"}
    meanings = map(_quantity, names)
    return any(key == "tau" and WORDS["tau"][place] in words for key, place in meanings)


def candidates(names: Sequence[str], joints: Sequence[str] = ()) -> dict[str, list[str]]:
    """List the columns that may be t, q or tau, the likeliest first.

    A family of columns is listed by its first name.
    """
    families = sorted(families_of(names, joints), key=lambda family: family.order)
    return {
        key: [f.names[0] for f in families if f.quantity in (key, "")][:8]
        for key in ("t", "q", "tau")
    }


def families_of(names: Sequence[str], joints: Sequence[str] = ()) -> Iterator[Family]:
    """Yield groups of column names that differ only by the name or number of a joint.

    Another name with a known word is a family of one column.
    """
    stems: dict[str, list[str]] = {}
    for joint, name in product(joints, names):
        stem, found = re.subn(rf"(?<![^\W_]){re.escape(joint)}(?![^\W_])", "#", name)
        if found:
            stems.setdefault(stem, []).append(name)
    for name in sorted(names, key=lambda name: [int(x) for x in re.findall("[0-9]{1,9}", name)]):
        for number in re.finditer("[0-9]+", name):
            stems.setdefault(f"{name[: number.start()]}#{name[number.end() :]}", []).append(name)
    for stem, alike in stems.items():
        if stem == "#" and joints:  # the bare name of a joint
            yield Family("q", len(WORDS["q"]), 1, tuple(alike), stem)
        elif (quantity := _quantity(stem))[0] != "t":
            yield Family(*quantity, _target(stem), tuple(alike), stem)
    single = {name: (_quantity(name), _target(name)) for name in names}
    for name, (meaning, target) in single.items():
        numbered = any(name in alike for alike in stems.values())
        several = list(single.values()).count((meaning, target)) > 1 and "." not in name
        if meaning[0] == "t" or (meaning[0] and not numbered and not several):
            yield Family(*meaning, target, (name,), name)


def _quantity(stem: str) -> tuple[str, int]:
    """Find the quantity that the words of a column name mean, for instance "tau".

    Also return the place of the word in `WORDS`. Return ("", 0) if the words mean no quantity.
    """
    words = _words(stem)
    for exact in (True, False):
        for key in ("other", "qd", "tau", "q", "t"):
            for place, word in enumerate(WORDS[key]):
                inside = len(word) > 3 and any(word in other for other in words)
                if word in words if exact else inside:
                    return key, place
    return "", 0


def _target(stem: str) -> int:
    words = _words(stem)
    return 2 if words & TARGETS else 0 if words & MEASURED and not words & SECONDARY else 1


def _unit(name: str, read: Any) -> str:
    """Find the unit that a column name states in brackets or as a word; "" if there is none.

    read : function that raises InputError for a unit of another quantity.
    """
    words = re.split(r"[\W\d_]+", name.lower())
    stated = [*re.findall(r"[\[(]([^\])#]+)[\])]", name)]
    for unit in (*stated, *(unit for unit in NAMED_UNITS if unit.lower() in words)):
        unit = UNITS.get(unit.strip().lower(), unit)
        with suppress(InputError):  # of something else, or no unit
            read(unit)
            return str(unit)
    return ""


def _words(name: str) -> set[str]:
    bare = re.sub(r"[\[(][^\])]*[\])]", " ", name)
    return {word.lower() for word in re.findall(r"[A-Z]+(?![a-zà-ÿ])|[A-Z]?[a-zà-ÿ]+", bare)}
