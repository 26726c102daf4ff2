"""Checks of the names in a robot file, and renaming of names that collide in a generated file.

`check_names` refuses unsuitable names of constants, families and parameters before anything is
derived, so that generated files can use these names. A name that is a reserved word of the target language,
or an intermediate variable or array whose name is already used, gets an underscore at the end, and
the header of the file says so.
"""

from __future__ import annotations

import builtins
import keyword
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from symgen.description.element import Element
from symgen.description.fields import Path, Problem, dotted
from symgen.description.parts import INERTIAL
from symgen.errors import DescriptionError

IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}\Z")
STATES = re.compile(r"(q|QP|QDP|GAM)\d+(_\d+)?\Z")
"""Positions, velocities, accelerations and torques of the joints."""
LAYOUT = frozenset(
    [
        "q",
        "qd",
        "qdd",
        "tau",
        "X",
        "standard",
        "out",
        "frame",
        "np",
        "xp",
        "pi",
        "self",
        "GAM",
        "STANDARD_PARAMETERS",
        "NO_EFFECT",
        "inertia_matrix",
        "bias",
        "inverse_dynamics",
        "Store",
        "asked",
        "filled",
        "given",
        "inertia",
        "rest",
        "result",
        "results",
        "rows",
        "rates",
        "origin",
        "shape",
        "state",
        "states",
        "store",
    ]
)
"""Arguments, functions and local words of the layouts of all targets, in functions of constants."""
MARKS = (
    "\\",
    '"""',
    "*/",
    "/*",
    "??/",
)  # which end a docstring or comment of Python or C, or LaTeX
LONGEST_LABEL = 60
DEVICES = {
    *["CON", "PRN", "AUX", "NUL"],
    *(f"{port}{k}" for port in ("COM", "LPT") for k in range(10)),
}


def check_identifier(name: str, path: Path) -> None:
    """Refuse a name that is not a valid identifier in generated code."""
    if not IDENTIFIER.match(name) or keyword.iskeyword(name):
        what = "is a keyword of Python; choose another name"
        if not keyword.iskeyword(name):
            what = "is not a valid name; use a letter followed by letters, digits or _ (at most 40)"
        raise DescriptionError(f"{dotted(path[:-1] or path)}: {name!r} {what}", path=path)


def check_names(robot: Any) -> Iterator[Problem]:
    """Check that robot, element families, constants and parameters have distinct, allowed names.

    Title, source and file name must not contain characters that end a docstring or comment.
    """
    check_identifier(robot.name, ("name",))
    yield (
        robot.name.upper() in DEVICES,
        f"{robot.name!r} is the name of a device on Windows, where no file can have this name; choose "
        "another name",
        ("name",),
    )
    for key, text in (("title", robot.title), ("source", robot.source), ("file", robot.file)):
        long = not text.isprintable() or len(text) > 1000
        yield (
            long or text.endswith('"') or any(mark in text for mark in MARKS),
            f"{key} {text[:60]!r}: expected one line of printable text, at most 1000 "
            "characters, without \\, triple or final quotes, /*, */ or ??/",
            (key,),
        )
    yield from _check_labels(robot.labels, len(robot.frames))
    yield from check_families(robot.elements)
    taken = {*robot.parameters, *(f"{name}R" for name in robot.parameters)}
    for name in robot.constants:
        check_identifier(name, ("constants", name))
        what = "a parameter" if name in taken else _of_others(name)
        yield (
            what,
            f"constant {name!r} is the name of {what}; choose another name, such as {name}c",
            ("constants", name),
        )
    double = sorted({n for n in robot.parameters if robot.parameters.count(n) > 1})
    yield (
        double,
        f"several parameters would have the same name: {double}; rename an element family",
        ("elements",),
    )


def check_families(elements: Sequence[Element]) -> Iterator[Problem]:
    """Check that names of element families, such as FV, and of their parameters are unique."""
    families = [e.family for e in elements]
    for e in elements:
        family, path = e.family, ("elements", e.family)
        check_identifier(family, path)
        taken = family in INERTIAL or families.count(family) > 1
        yield (
            taken or family[-1].isdigit() or family.endswith("_"),
            f"element {family!r}: give each family a unique name; it must not be the name of an "
            "inertial parameter, nor end in a digit or _",
            path,
        )
        for name in (f"{family}{j}" for j in e.keys):
            what = _of_others(name)
            yield (
                what,
                f"element {family!r}: its parameter would be named {name}, which is already the "
                f"name of {what}; choose another family name, such as K{family}",
                path,
            )


def _of_others(name: str) -> str:
    """Describe what `name` already means in generated code or Python; "" if it is free."""
    if STATES.match(name):
        return "a joint position, rate or torque (q, QP, QDP, GAM and a number)"
    if name in LAYOUT:
        return (
            f"a reserved word of the generated functions (reserved are {', '.join(sorted(LAYOUT))})"
        )
    return "a builtin of Python" if hasattr(builtins, name) else ""


def _check_labels(labels: Mapping[int, str], frames: int) -> Iterator[Problem]:
    """Check that each joint label belongs to an existing frame and that labels are different."""
    used: dict[str, int] = {}
    for j, text in labels.items():
        path = ("labels", j)
        yield (
            not 0 < j <= frames,
            f"labels: frame {j} does not exist; frames are 1 to {frames}",
            path,
        )
        yield (
            not is_label(text),
            f"labels.{j}: found {text[:LONGEST_LABEL]!r}; expected 1 to {LONGEST_LABEL} printable "
            "characters without \\, quotes, /* or */",
            path,
        )
        yield (
            text in used,
            f"labels.{j}: {text!r} names frame {used.get(text)} already; give each frame a different label",
            path,
        )
        used[text] = j


def is_label(text: str) -> bool:
    """Whether `text` is allowed as a joint label: short, printable, without quotes."""
    return (
        0 < len(text) <= LONGEST_LABEL
        and text.isprintable()
        and not any(mark in text for mark in (*MARKS, '"', "'"))
    )


class Namespace:
    """The table of names used in one generated file, by which no two quantities get the same name.

    Parameters
    ----------
    names : iterable of str
        Constants, parameters and base parameters of the robot.
    is_word : callable
        Function that returns whether a name is a reserved word in the language of the file.
    """

    def __init__(self, names: Iterable[str], is_word: Callable[[str], bool] = lambda name: False):
        self._is_word, self._taken = is_word, {*names}
        self._written = {name: name for name in self._taken}
        self.renamed: dict[str, str] = {}
        for name in sorted(filter(is_word, self._taken)):
            self._written[name] = self.own(name)

    def of_file(self, name: str) -> str:
        """Return the name in the generated file for a constant or parameter of the robot."""
        return self._written.get(name, name)

    def has(self, name: str) -> bool:
        """Whether `name` is already used in the file, or is a reserved word of its language."""
        return name in self._taken or self._is_word(name)

    def own(self, name: str) -> str:
        """Reserve a name for an internal variable: `name`, with underscores added if needed."""
        free = f"{name}_" if self._is_word(name) else name
        while free in self._taken:
            free += "_"
        self._taken.add(free)
        if free != name:
            self.renamed[free] = name
        return free

    def inner(self) -> Namespace:
        """Make the namespace of one function in the file, starting with all names used so far.

        Names that the function reserves stay local. Its renamed variables are also listed for the
        file.
        """
        scope = Namespace((), self._is_word)
        scope._taken, scope._written, scope.renamed = {*self._taken}, self._written, self.renamed
        return scope
