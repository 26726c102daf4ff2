"""Write identified values into the URDF or MJCF file of a robot; only numbers in the text change.

    applied = symgen.apply("results", "arm.urdf")        # or an Estimate, an Identification
    print(applied)                                       # numbers that change: from, to, sigma
    applied.write("arm_identified.urdf")

An estimate gives base parameters, which are sums of the parameters of several links. Of all
physical robots that have these sums, the robot nearest to the file is written
(`symgen.update.nearest`). Before the result is returned, the new text is read again, and its values
must be those that were to be written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runtime.commands import require_torques
from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import load_model
from runtime.documents.estimates import load_whole_estimate
from runtime.physical.inertia import PhysicalModel, physical_model
from symgen.certify.modules import model as emitted
from symgen.description.files import content_of, read_robot
from symgen.description.robot import Robot, one_joint_parameters, parameter
from symgen.description.tree import Array, TreePart
from symgen.errors import DescriptionError
from symgen.update.applied import Applied
from symgen.update.nearest import NONE, nearest, strange
from symgen.update.places import read_text, require_same_frames
from symgen.update.writing import UNITS, Writing
from symgen.update.xml_edits import XmlEdits, same

FEASIBLE = (
    "; set estimate: {method: feasible} in the study (study.yaml lies among the results) "
    "and identify again"
)


def apply(
    estimate: Estimate | str | Path | Any,
    model: str | Path,
    *,
    robot: str | Path | None = None,
    lock: Mapping[str, float] | None = None,
    chain: tuple[str, str] | None = None,
    exact: bool = False,
) -> Applied:
    """Return the text of a URDF or MJCF file with identified values in it; no file is written yet.

    Parameters
    ----------
    estimate : Estimate, Identification, str or Path
        Result of an identification, its estimate.json, or the folder that `symgen identify -o`
        wrote. Of an Identification, the parameter set in use is taken, or the physical set if the
        essential set is in use (`Identification.whole_estimate`).
    model : str or Path
        The file: .urdf, or .xml and .mjcf (MJCF).
    robot : str or Path, optional
        Robot file that was identified, if it is not `model` itself: a file converted from `model`,
        perhaps with other elements or drives.
    lock, chain, exact
        As in `read_robot`, with the same values as when the robot was identified or converted.

    Raises
    ------
    DescriptionError
        The estimate is of another robot, no physical robot has it, or the file has no place for it.
    """
    path = Path(model)
    content = content_of(path)
    part = TreePart(lock or {}, chain)
    text = read_text(content, path, exact, part)
    described, of = (
        (text.robot, text.file) if robot is None else (read_robot(robot)[0], Path(robot).name)
    )
    require_same_frames(text, described, of)
    result = _estimate(estimate)
    require_torques(result)
    _require_same_joints(result, described, of)
    physical = physical_model(load_model(emitted(described)))
    names, X, lost = _determined_names(result, physical, of)
    links = text.links
    if not links:
        raise DescriptionError(
            "no moving link has an <inertial>; add <inertial> to a moving link",
            file=path.name,
        )
    families = one_joint_parameters(described, UNITS)
    own = {
        parameter(family, j): (family, j)
        for j in text.table.joint
        for family in UNITS
        if parameter(family, j) in families
    }
    stated = {name: text.joint_values(j)[family] for name, (family, j) in own.items()}
    elsewhere = {
        name: described.values.get(name, 0.0)
        for name in physical.standard
        if name not in own and name not in _inertial(physical)
    }
    try:
        values = elsewhere | stated
        absent = [
            name
            for name, x in values.items()
            if not x and (name not in own or own[name][0] != "Ia")
        ]
        closest = nearest(physical, links, values, names, X, absent)
        writing, edits = Writing(text, closest, own, _root(result, names)), XmlEdits(content)
        rows = [*writing.links(edits), *writing.joints(edits)]
        new = edits.edited()
        writing.require_read_back(read_text(new, path, exact, part))
    except DescriptionError as error:
        again = FEASIBLE if error.message.startswith(NONE) and result.method != "feasible" else ""
        raise DescriptionError(
            error.message + again, file=error.file or path.name, line=error.line
        ) from error
    placeless = writing.placeless
    return Applied(
        file=path.name,
        format=text.places.attributes.format,
        before=content,
        content=new,
        changes=tuple(row for row in rows if not same(row.before, row.after)),
        added=tuple(edits.added),
        placeless=placeless,
        placeless_sigma={name: writing.sigma(closest.elements[name]) for name in placeless},
        joints={name: text.table.joint[own[name][1]].name for name in placeless if name in own},
        spread=closest.spread,
        undetermined=tuple(
            f"{row.place}: {row.number}"
            for row in rows
            if row.told_by == "file" and same(row.before, row.after)
        ),
        strange=tuple(filter(None, (strange(link, closest) for link in links))),
        lost=tuple(lost),
    )


def _estimate(given: Any) -> Estimate:
    if isinstance(given, str | Path):
        path = Path(given)
        return load_whole_estimate(path / "estimate.json" if path.is_dir() else path)
    given = getattr(given, "whole_estimate", given)
    if not isinstance(given, Estimate):
        raise DescriptionError(
            f"{type(given).__name__} given as estimate; expected an Estimate, an Identification, "
            "or the path of estimate.json"
        )
    return given


def _require_same_joints(result: Estimate, robot: Robot, of: str) -> None:
    """Check that the joint names in the estimate, if there are any, are those of the robot.

    Raises DescriptionError if they are not.
    """
    theirs = result.provenance.get("labels")
    if not isinstance(theirs, Mapping):
        return
    numbers = {f"q{j}" for j in robot.moving} | {
        q for q in theirs if q not in {f"q{f.j}" for f in robot.frames}
    }
    different = sorted(
        q
        for q in numbers
        if theirs.get(q) != robot.labels.get(int(q[1:]) if q[1:].isdigit() else 0)
    )
    if different:
        q = different[0]
        ours = robot.labels.get(int(q[1:])) if q[1:].isdigit() else None
        raise DescriptionError(
            f"joint {q} is {theirs.get(q, 'no joint with a name')!s:.60} in the estimate, but "
            f"{ours or 'no joint with a name'} in {of}; give the same --chain and --lock as in the conversion of the robot, or give the robot file that was identified (--robot)"
        )


def _inertial(physical: PhysicalModel) -> set[str]:
    return {physical.standard[k] for j in physical.links for k in physical.link(j)}


def _determined_names(
    result: Estimate, physical: PhysicalModel, of: str
) -> tuple[list[str], Array, list[str]]:
    """Separate the base parameters that the record determines from the other base parameters.

    Return the names and values of the determined parameters, and the names of the others.
    """
    if unknown := [name for name in result.names if name not in physical.base]:
        raise DescriptionError(
            f"{', '.join(unknown[:8])} of the estimate are no base parameters of {of}; give the robot file that was identified (--robot), and the same --chain and --lock options with which it was converted"
        )
    silent = {group[0] for group in result.groups if len(group) == 1}
    places = [
        k for k, name in enumerate(result.names) if np.isfinite(result.X[k]) and name not in silent
    ]
    if not places:
        raise DescriptionError(
            "the record determines no parameter of the estimate, so there is nothing to write"
        )
    names = [result.names[k] for k in places]
    return names, result.X[places], [name for name in physical.base if name not in names]


def _root(result: Estimate, names: Sequence[str]) -> Array:
    """Compute a matrix square root (b, b) of the covariance of the determined base parameters.

    Corrected standard deviations are used if they are larger. The result is zero if the covariance
    is unknown.
    """
    at = [result.names.index(name) for name in names]
    C = np.nan_to_num(result.covariance[np.ix_(at, at)])
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.nan_to_num(
            np.fmax(result.sigma_corrected[at] / result.sigma[at], 1.0), nan=1.0, posinf=1.0
        )
    values, V = np.linalg.eigh(C * np.outer(factor, factor))
    return np.asarray(V * np.sqrt(np.maximum(values, 0.0)))
