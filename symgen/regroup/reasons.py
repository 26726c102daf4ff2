"""Why a standard parameter is part of a base parameter, and what an edit of the robot changes.

The regressor column of each standard parameter is a combination of the columns of the base
parameters, Gamma = sum_k D_k chi_k = sum_b D_b X_b, hence

    D_k = sum_b K[b, k] D_b ,

with K[b, k] the coefficient of chi_k in the formula of X_b. For instance, YY2 is subtracted in XX2R
because the columns of YY2 and XX2R are opposite. The rule behind a relation follows from the step
that moved the parameter: a general rule (`rules`), or a relation of this robot alone.
"""

from __future__ import annotations

import pathlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from symgen.derive.regressor import inertial_names
from symgen.description.expression import ONE, ZERO
from symgen.description.fields import Path, dotted
from symgen.description.robot import PRISMATIC, REVOLUTE, Robot
from symgen.description.yaml import flow, tables_of
from symgen.regroup.regrouping import Formula, Regrouping, regrouping_of
from symgen.regroup.rules import Transfer

OF_REVOLUTE = {  # family: the relation of `rules`, in words
    "YY": "link {j} turns about z{j} against {i}: equal XX{j} and YY{j} act as inertia of {i}",
    "MZ": "z{j} is fixed in {i}: first moment along z{j} acts as first moment and inertia of {i}",
    "M": "the origin of frame {j} is fixed in {i}: mass there acts as mass of {i}",
}
WITHOUT_EFFECT = ("symgen", "name", "title", "source", "drives", "limits", "values", "labels")


@dataclass(frozen=True)
class Absorption:
    """Reason why a standard parameter is part of the formula of a base parameter.

    Attributes
    ----------
    name : str
        The standard parameter.
    base : tuple of str
        Base parameters whose formulas contain the standard parameter.
    columns : str
        Regressor column of the standard parameter in terms of base columns, such as "the columns of
        YY2 and XX2R are opposite".
    rule : str
        The physical relation, in words.
    """

    name: str
    base: tuple[str, ...]
    columns: str
    rule: str


@dataclass(frozen=True)
class BaseDifference:
    """Effect of changes in a robot file on the base parameters of the robot.

    Attributes
    ----------
    edits : tuple of str
        Keys of the robot file with their values before and after.
    appeared, gone : tuple of str
        Base parameters that only the edited robot has, and base parameters that only the robot
        before the edit has. Each is named by its own standard parameter.
    changed : tuple of (str, str)
        Formulas before and after the edit of common base parameters, such as `XX2R = XX2 - YY2`.
    """

    edits: tuple[str, ...]
    appeared: tuple[str, ...]
    gone: tuple[str, ...]
    changed: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        effects = [
            *(
                f"{', '.join(names)} {verb}{'s' * (len(names) == 1)}"
                for verb, names in (("appear", self.appeared), ("disappear", self.gone))
                if names
            ),
            *(f"{after} (was {before})" for before, after in self.changed),
        ]
        edits = ", ".join(self.edits) or "no edit that matters"
        return f"{edits}: {'; '.join(effects) or 'the base parameters stay'}"


def absorptions(robot: str | pathlib.Path | Robot | Regrouping) -> tuple[Absorption, ...]:
    """Explain why each standard parameter is part of a base parameter named after another
    parameter.

    The reasons are in the order of eq. (4).

    Parameters
    ----------
    robot : str, Path, Robot or Regrouping
        A robot as for `symgen.model`, or its base parameters.

    Examples
    --------
    >>> import symgen
    >>> reason = symgen.absorptions("planar_2r")[1]
    >>> reason.name, reason.base
    ('M2', ('ZZ1R', 'MX1R'))
    >>> reason.rule
    'the origin of frame 2 is fixed in link 1: mass there acts as mass of link 1'
    """
    regrouping = regrouping_of(robot)
    own, particular = set(regrouping.own), set(Transfer(regrouping.robot).remaining)
    into = {
        name: {b.name: b.combination[name] for b in regrouping.base if name in b.combination}
        for name in regrouping.robot.parameters
        if name not in own
    }
    return tuple(
        Absorption(
            name,
            tuple(into[name]),
            _columns(name, into[name]),
            f"a relation of this robot ({regrouping.method})"
            if name in particular
            else _rule(regrouping.robot, name),
        )
        for name in into
        if into[name]
    )


def _columns(name: str, image: Mapping[str, Any]) -> str:
    first, *others = image
    if not others and image[first] in (ONE, -ONE):
        what = "equal" if image[first] == ONE else "opposite"
        return f"the columns of {name} and {first} are {what}"
    by_column = {f"D_{base}": c for base, c in image.items()}
    return f"of the columns, D_{name} = {Formula(by_column)}"


def _rule(robot: Robot, name: str) -> str:
    """Describe the general rule that moved an inertial parameter of a link to another link."""
    family, j = inertial_names(robot)[name]
    frame = robot.frame(j)
    i = f"link {frame.ant}" if frame.ant or robot.base_is_free else "the base"
    if frame.sigma == REVOLUTE:
        return OF_REVOLUTE[family].format(i=i, j=j)
    if frame.sigma == PRISMATIC:
        return f"link {j} does not turn against {i}: its inertia tensor acts as inertia of {i}"
    return f"frame {j} is fixed in {i}: its link is part of {i}"


def base_difference(
    before: str | pathlib.Path | Robot | Regrouping, after: str | pathlib.Path | Robot | Regrouping
) -> BaseDifference:
    """Compare two robots: the edits between their files, and the effect on the base parameters.

    `str` of the result is one line: alpha of frame 2: 0 -> pi/2: MX1R appears; ...

    Parameters
    ----------
    before, after : str, Path, Robot or Regrouping
        As for `absorptions`.

    Examples
    --------
    >>> import symgen
    >>> on_floor = symgen.corrected("planar_2r", {"gravity": [0, 0, 0]})
    >>> print(symgen.base_difference("planar_2r", on_floor))
    gravity: [0, -g, 0] -> [0, 0, 0]: MX1R, MY1 disappear
    """
    before, after = regrouping_of(before), regrouping_of(after)
    old, new = ({b.own: b for b in r.base} for r in (before, after))
    texts = [
        {own: own if b.name == own else f"{b.name} = {b.formula}" for own, b in base.items()}
        for base in (old, new)
    ]
    return BaseDifference(
        tuple(_edits(before.robot, after.robot)),
        tuple(b.name for own, b in new.items() if own not in old),
        tuple(b.name for own, b in old.items() if own not in new),
        tuple(
            (texts[0][own], texts[1][own])
            for own in old
            if own in new and texts[0][own] != texts[1][own]
        ),
    )


def _edits(before: Robot, after: Robot) -> Iterator[str]:
    old, new = (_leaves(_written(robot)) for robot in (before, after))
    for path in {**old, **new}:
        if old.get(path) != new.get(path) and path[0] not in WITHOUT_EFFECT:
            of_frame = path[0] == "frames" and len(path) == 3
            place = f"{path[2]} of frame {path[1]}" if of_frame else dotted(path)
            yield f"{place}: {old.get(path, 'none')} -> {new.get(path, 'none')}"


def _written(robot: Robot) -> dict[str, Any]:
    """Return the data of a robot file by key, with a classic (distal) table as in the file."""
    tables = tables_of(robot)
    if not robot.distal:
        return tables
    rows = {
        j: {**tables["frames"][j], "alpha": ZERO, "d": ZERO} for j in range(1, robot.distal + 1)
    }
    for f in robot.frames:
        if f.ant:
            rows[f.ant] |= {"alpha": f.alpha, "d": f.d}
    massless = [j for j in tables["massless"] if j in rows]
    return tables | {"convention": "distal", "frames": rows, "massless": massless}


def _leaves(table: Any, path: Path = ()) -> dict[Path, str]:
    """Flatten a nested mapping to {path of keys: value as text}."""
    if not isinstance(table, Mapping):
        return {path: flow(table)}
    parts = [_leaves(value, (*path, key)) for key, value in table.items()]
    return {at: text for part in parts for at, text in part.items()}
