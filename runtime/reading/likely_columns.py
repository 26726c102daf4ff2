"""Proposal of the columns of time, positions and torques by their names, for the user to check.

    actual_q_0 ... actual_q_5    one family: a stem, and numbers in it
    A1 Ist-Position [Grad]       also before a unit in brackets, or within; in other languages
    elbow_pos_deg, roll_pos_rad  a unit is no part of the stem: one family, a unit per joint
    elbow_pos, /joints/elbow/effort, elbow    or the names of the joints, in the order of the robot
    positions (N, n)             or an array, or a field of a structure

`runtime.reading.words` gives the meaning of the words in a name, by language. A unit in a name
decides what its column is: shoulder_load_Nm is a torque. A family is a group of columns with the
same stem. A family with a word for "measured" is preferred to one without such a word, and the
latter is preferred to a family of commanded values, which is used only if there is no other.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.reading.units import likely_time_unit
from runtime.reading.words import (
    COMMANDED,
    CURRENTS,
    MEASURED,
    SECONDARY,
    WORDS,
    has_word,
    stated_unit,
    words_of,
)

Array = np.ndarray
Names = Sequence[str] | Mapping[str, Array]
"""Names of columns, with their values where they are known."""

ARRAYS = ("state", "states")  # words of a position only where the column is an array of joints
QUANTITIES = {"q": "positions", "tau": "torques"}


@dataclass(frozen=True)
class Family:
    """Columns of one quantity, one per joint, whose names differ by the joint: q1, q2, q3.

    Attributes
    ----------
    quantity : "t", "q", "tau", "qd", "other" or ""
    word : int
        Position of the word that the names contain in the list of words of the quantity.
    target : int
        0 measured, 1 without such a word, 2 commanded.
    names : tuple of str
    stem : str
        Common part of the names.
    units : tuple of str
        Unit that each name states, or "".
    width : int
        Number of joints: the number of names, or that of the columns of an array.
    joints : tuple of int
        Places of the joints in the robot file, if the names of the joints are in the names.
    """

    quantity: str
    word: int
    target: int
    names: tuple[str, ...]
    stem: str
    units: tuple[str, ...] = ()
    width: int = 1
    joints: tuple[int, ...] = ()

    @property
    def order(self) -> tuple[int, int, int, int, str]:
        """Sort key: the columns with the smallest key are the likeliest columns of their quantity.

        The key prefers, in this order, measured columns, a better word, more columns, and a shorter
        stem.
        """
        return self.target, self.word, -len(self.names), len(self.stem), self.stem

    @property
    def is_current(self) -> bool:
        """Whether the word of this family means a current."""
        return self.quantity == "tau" and _word("tau", self.word) in CURRENTS


def likely_columns(names: Names, joints: Sequence[str] = ()) -> dict[str, Any]:
    """Propose settings of a record (columns t, q, tau and their units) from its column names.

    Currents are in A unless names say mA. The result is {} if the names do not show positions and
    as many torques.

    Parameters
    ----------
    names : sequence of str, or mapping of str to ndarray
        Names of the columns; the values of the time then show its unit, s, ms, us or ns.
    joints : sequence of str
        Names of the joints in the robot file.
    """
    found = known_columns(names, joints)
    if not {"q", "tau"} <= {*found.get("columns", ())}:
        return {}
    return {} if any(missing_joints(names, joints, len(joints)).values()) else found


def known_columns(names: Names, joints: Sequence[str] = ()) -> dict[str, Any]:
    """Propose record settings from column names, even if only some of t, q, tau are recognised.

    Torques are left out if their number differs from that of the positions.
    """
    chosen = _chosen(names, joints)
    columns: dict[str, Any] = {
        key: family.names[0] if key == "t" else list(family.names) for key, family in chosen.items()
    }
    units: dict[str, Any] = {}
    for key, family in chosen.items():
        each = [unit or ("A" if family.is_current else "") for unit in family.units]
        if len({*each}) == 1 and each[0]:
            units[key] = each[0]
        elif any(each):
            units[key] = [unit or {"q": "rad", "tau": "N*m"}[key] for unit in each]
    if "t" in chosen and "t" not in units and isinstance(names, Mapping):
        unit = likely_time_unit(names[columns["t"]])
        units = ({"t": unit} if unit != "s" else {}) | units
    return {**({"columns": columns} if columns else {}), **({"units": units} if units else {})}


def joint_counts(names: Names, joints: Sequence[str] = ()) -> dict[str, int]:
    """Count the joints whose positions ("q") and torques ("tau") are recognised by column names; 0
    if there are none.

    Commanded columns do not count if there are measured columns.
    """
    families = [*families_of(names, joints)]
    counts = {}
    for key in QUANTITIES:
        own = [f for f in families if f.quantity == key]
        measured = [f for f in own if f.target < 2] or own
        counts[key] = max((f.width for f in measured), default=0)
    return counts


def missing_joints(names: Names, joints: Sequence[str], n: int) -> dict[str, list[int]]:
    """List the joints whose positions ("q") or torques ("tau") are not recognised.

    A joint is a number from 1, in the order of the robot file. n : number of joints.
    """
    chosen = _chosen(names, joints)
    missing = {}
    for key in QUANTITIES:
        family = chosen.get(key)
        width = 0 if family is None else family.width
        have = {*(family.joints if family and family.joints else range(width))}
        missing[key] = [j + 1 for j in range(n) if j not in have]
    return missing


def _chosen(names: Names, joints: Sequence[str]) -> dict[str, Family]:
    """Choose the likeliest families of t, q and tau; positions and torques are of as many joints."""
    families = sorted(families_of(names, joints), key=lambda family: family.order)
    of = {key: [f for f in families if f.quantity == key] for key in WORDS}
    n = len(joints)
    pairs = [(q, tau) for q in of["q"] for tau in of["tau"] if q.width == tau.width]
    whole = [pair for pair in pairs if pair[0].width == n]
    chosen: dict[str, Family] = {}

    def better(pair: tuple[Family, Family]) -> tuple[Any, ...]:
        q, tau = pair
        apart = _parent(q) != _parent(tau)
        return q.target, tau.target, q.word, apart, q.order, tau.order

    if whole or (pairs and not n):
        chosen["q"], chosen["tau"] = min(whole or pairs, key=better)
    else:
        for key in QUANTITIES:
            fits = [f for f in of[key] if f.width == n] or [
                f for f in of[key] if f.width < n or not n
            ]
            measured = [f for f in fits if f.target < 2] or fits
            if measured:
                best = min(
                    measured, key=lambda f: (f.width != n, f.target, -f.width * bool(n), f.order)
                )
                chosen[key] = best
        if not n and len(chosen) == 2 and chosen["q"].width != chosen["tau"].width:
            del chosen["tau"]
    beside = _parent(chosen["q"]) if "q" in chosen else ""
    times = [f for f in of["t"] if not isinstance(names, Mapping) or _runs(names[f.names[0]])]
    if times:
        chosen = {"t": min(times, key=lambda f: _parent(f) != beside)} | chosen
    return chosen


def _parent(family: Family) -> str:
    return family.names[0].rpartition(".")[0]


def _runs(t: Array) -> bool:
    """Whether the values of a column increase, as time stamps do; True if the values are unknown."""
    t = np.asarray(t, dtype=float).reshape(-1)
    step = np.diff(t[np.isfinite(t)])
    return not len(step) or bool(np.sum(step > 0) > np.sum(step < 0))


def may_be_currents(names: Sequence[str]) -> bool:
    """Whether any column name contains a word for current or effort, so that its unit may be A."""
    words = {*CURRENTS, "effort", "efforts"}
    meanings = map(_quantity, names)
    return any(key == "tau" and _word(key, place) in words for key, place in meanings)


def candidates(names: Names, joints: Sequence[str] = ()) -> dict[str, list[str]]:
    """List the columns that may be t, q or tau, the likeliest first.

    A family of columns is listed by its first name.
    """
    families = sorted(families_of(names, joints), key=lambda family: family.order)
    return {
        key: [f.names[0] for f in families if f.quantity in (key, "")][:8]
        for key in ("t", "q", "tau")
    }


def families_of(names: Names, joints: Sequence[str] = ()) -> Iterator[Family]:
    """Yield groups of column names that differ only by the name or number of a joint, or its unit.

    Another name with a known word is a family of one column.
    """
    values = names if isinstance(names, Mapping) else {}
    widths = {name: min(x.shape) for name, x in values.items() if x.ndim == 2}
    arrays = {name for name, width in widths.items() if width > 1}
    stems: dict[str, dict[str, int]] = {}  # stem: {name: place of the joint}
    singles = [name for name in names if name not in arrays]
    for aliases in _aliases(joints):
        places = sorted(enumerate(aliases), key=lambda item: -len(item[1]))
        for name in singles:
            for j, alias in places:
                stem, found = re.subn(
                    rf"(?<![^\W_]){re.escape(alias)}(?![^\W_])", "#", name, flags=re.IGNORECASE
                )
                if found:
                    stems.setdefault(stem, {})[name] = j
                    break
    of_joints = {
        stem: dict(sorted(alike.items(), key=lambda item: item[1])) for stem, alike in stems.items()
    }
    of_numbers: dict[str, dict[str, int]] = {}
    for name in sorted(singles, key=lambda name: [int(x) for x in re.findall("[0-9]{1,9}", name)]):
        for number in re.finditer("[0-9]+", name):
            stem = f"{name[: number.start()]}#{name[number.end() :]}"
            of_numbers.setdefault(stem, {})[name] = int(number[0][:9])
    numbered = {name for alike in (of_joints | of_numbers).values() for name in alike}
    for stem, alike in _of_any_unit(of_joints).items():
        if stem == "#":  # the bare name of a joint
            yield _family(("q", len(WORDS["q"])), 1, alike, stem, joints=True)
        elif (quantity := _quantity(next(iter(alike)), stem))[0] != "t":
            yield _family(quantity, _target(stem), alike, stem, joints=True)
    for stem, alike in _of_any_unit(of_numbers).items():
        quantity = _quantity(next(iter(alike)), stem)
        if quantity[0] != "t":
            yield _family(quantity, _target(stem), alike, stem)
    single = {name: (_quantity(name), _target(name)) for name in names}
    for name, (meaning, target) in single.items():
        several = list(single.values()).count((meaning, target)) > 1 and "." not in name
        alone = name not in numbered and not (several and name not in arrays)
        if _word(*meaning) in ARRAYS:
            alone = alone and name in arrays
        if meaning[0] == "t" or (meaning[0] and alone):
            width = widths.get(name, 1)
            unit = stated_unit(name, meaning[0])
            yield Family(*meaning, target, (name,), name, (unit,), width)


def _family(
    quantity: tuple[str, int],
    target: int,
    alike: Mapping[str, int],
    stem: str,
    joints: bool = False,
) -> Family:
    units = tuple(stated_unit(name, quantity[0]) for name in alike)
    places = tuple(alike.values()) if joints else ()
    return Family(*quantity, target, tuple(alike), stem, units, len(alike), places)


def _of_any_unit(stems: Mapping[str, Mapping[str, int]]) -> dict[str, dict[str, int]]:
    """Join the families whose stems differ in the unit alone, if they belong to different joints."""
    bare: dict[str, list[str]] = {}
    for stem in stems:
        bare.setdefault(_without_unit(stem), []).append(stem)
    joined: dict[str, dict[str, int]] = {}
    for stem, variants in bare.items():
        places = [place for variant in variants for place in stems[variant].values()]
        if len(variants) > 1 and len({*places}) == len(places):
            alike = {name: j for variant in variants for name, j in stems[variant].items()}
            joined[stem] = dict(sorted(alike.items(), key=lambda item: item[1]))
        else:
            joined |= {variant: dict(stems[variant]) for variant in variants}
    return joined


def _without_unit(stem: str) -> str:
    unit = next((x for key in ("q", "tau") if (x := stated_unit(stem, key, written=True))), "")
    return stem.replace(unit, "") if unit else stem


def _aliases(joints: Sequence[str]) -> list[list[str]]:
    """Names of the joints in columns: as in the robot file, and without the words of all joints.

    shoulder_pan_joint, elbow_joint are also shoulder_pan, elbow.
    """
    if not joints or not all(joints):
        return []
    words = [re.split(r"[\W_]+", joint) for joint in joints]
    common = set.intersection(*map(set, words))
    bare = ["_".join(word for word in own if word not in common) for own in words]
    usable = all(re.search(r"[^\W\d_]{2}", name) for name in bare) and len({*bare}) == len(bare)
    return [list(joints), *([bare] if common and usable and len(joints) > 1 else [])]


def _quantity(name: str, stem: str = "") -> tuple[str, int]:
    """Find the quantity that the words of a column name mean, for instance "tau".

    Also return the position of the word in the list of words of the quantity. The unit decides
    between positions, speeds and torques. Return ("", 0) if the name means no quantity.
    """
    words = words_of(stem or name)
    meanings: dict[str, int] = {}
    for exact in (True, False):
        for key in ("other", "qd", "tau", "q", "t"):
            for place, word in enumerate(WORDS[key]):
                if word == "t" and not words <= {"t", "s", "ms", "us", "ns", "sec", "с"}:
                    continue  # t_ms, but not O_T_EE
                if has_word(words, word, exact):
                    meanings.setdefault(key, place)
                    break
        if meanings:
            break
    first = next((key for key in ("other", "qd", "tau", "q", "t") if key in meanings), "")
    if first in ("other", "qd"):
        return first, meanings[first]
    for key in ("qd", "tau", "q"):
        if stated_unit(stem or name, key):
            return key, meanings.get(key, len(WORDS[key]))
    return (first, meanings[first]) if first else ("", 0)


def _word(quantity: str, place: int) -> str:
    """Return the word at a position in the list of words of a quantity; "" if a unit, not a word,
    shows the quantity.
    """
    words = WORDS.get(quantity, ())
    return words[place] if place < len(words) else ""


def _target(stem: str) -> int:
    words = words_of(stem)
    if any(has_word(words, word, exact) for word in COMMANDED for exact in (True, False)):
        return 2
    measured = any(has_word(words, word, exact) for word in MEASURED for exact in (True, False))
    return 0 if measured and not words & SECONDARY else 1
