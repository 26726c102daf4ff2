"""Write identified values into the URDF or MJCF file of a robot; only numbers in the text change.

    applied = symgen.apply("results", "arm.urdf")        # or an Estimate, an Identification
    print(applied)                                       # numbers that change: from, to, sigma
    applied.write("arm_identified.urdf")

An estimate gives base parameters, which are sums of the parameters of several links. Of all
physical robots that have these sums, the robot nearest to the file is written
(`symgen.update.nearest`). Before the result is returned, the new text is read again, and its values
must agree with the intended values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.commands import require_torques
from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import load_model
from runtime.documents.estimates import load_whole_estimate
from runtime.physical.inertia import PhysicalModel, physical_model
from symgen.certify.requests import model as emitted
from symgen.description.files import content_of, on_base, robot_of, warn_not_read
from symgen.description.robot import Robot, one_joint_parameters, parameter
from symgen.description.tree import Array, TreePart
from symgen.errors import DescriptionError, require
from symgen.update.applied import Applied, Change
from symgen.update.nearest import NONE, Nearest, nearest, strange
from symgen.update.places import NUMBERS, FileLink, RobotText, read_text, require_same_frames
from symgen.update.xml_edits import XmlEdits, same

# --- edits that write identified values into a file, and a check of the new text ---

AGREE = 1e-9  # of the size of a parameter: the written file is read as what was to be written
UNITS = {"FV": "N*m*s/rad", "FS": "N*m", "Ia": "kg*m**2", "OFFSET": "N*m", "K": "N*m/rad"}
SLIDING = {"FV": "N*s/m", "FS": "N", "Ia": "kg", "OFFSET": "N", "K": "N/m"}


@dataclass(frozen=True, eq=False)
class Writing:
    """The values to be written into a URDF or MJCF file, and the text of this file.

    Attributes
    ----------
    text : RobotText
        The file.
    nearest : Nearest
        The values to be written.
    own : mapping
        Family and joint of each parameter of an element that acts along one joint, by its name.
    root : ndarray, shape (b, b)
        Square root of the covariance of the base parameters.
    """

    text: RobotText
    nearest: Nearest
    own: Mapping[str, tuple[str, int]]
    root: Array

    def links(self, edits: XmlEdits) -> list[Change]:
        """Edit the links in the file; return a Change for each mass, centre and inertia number."""
        rows, moved = [], []
        for link in self.text.links:
            x = self.nearest.u[self.nearest.links[link.name]]
            if np.any(x != link.numbers):
                moved.append((link.place, x))
            rows += self._link_rows(link)
        for place, x in moved:
            place.write(edits, x)
        if moved:
            self.text.places.heed_inertials(edits)
        return rows

    def _link_rows(self, link: FileLink) -> list[Change]:
        """Make a Change for each number of a link: old and new value, sigma, and source."""
        rows, at = [], self.nearest.links[link.name]
        for k in link.place.attributes.order:
            name, label, unit = NUMBERS[k]
            before, after = float(link.numbers[k]), float(self.nearest.u[at[k]])
            rows.append(
                Change(
                    f"link {link.name!a:.60}",
                    name if name == label else f"{name} {label}",
                    unit,
                    before,
                    before if same(after, before) else after,
                    self.sigma(at[k]),
                    self._told_by(at[k]),
                )
            )
        return rows

    def _told_by(self, k: int) -> str:
        if not self.nearest.seen[k]:
            return "file"
        return "record" if self.nearest.told[k] else "sum"

    def joints(self, edits: XmlEdits) -> list[Change]:
        """Edit joint parameters in the file; return a Change for each that the format can store."""
        rows = []
        for j, joint in self.text.table.joint.items():
            attributes = {
                name: attribute
                for name, (family, i) in self.own.items()
                if i == j and (attribute := self.text.attribute(family, j))
            }
            before = self.text.joint_values(j)
            values = {self.own[name][0]: self._value(name) for name in attributes}
            if attributes:  # a joint that closes a loop may have no element in the file
                self.text.places.set_joint(edits, joint, values, before)
            for name, attribute in attributes.items():
                family, k = self.own[name][0], self.nearest.elements[name]
                row = (before[family], values[family], self.sigma(k))
                place, unit = f"joint {joint.name!a:.60}", _unit(self.text, family, j)
                rows.append(Change(place, attribute, unit, *row, self._told_by(k)))
        return rows

    def _value(self, name: str) -> float:
        return float(self.nearest.u[self.nearest.elements[name]])

    def sigma(self, k: int) -> float:
        """Compute the standard deviation of number k in the list of all link and joint values.

        The result is nan if the record does not determine the number, or determines only sums with
        it.
        """
        if self._told_by(k) != "record":
            return np.nan
        return float(np.linalg.norm(self.nearest.gain[k] @ self.root))

    @property
    def placeless(self) -> dict[str, float]:
        """New values, by name, of parameters that the file format cannot store.

        The mapping has all motor inertias, including zero values, and the other parameters that
        changed.
        """
        return {
            name: float(self.nearest.u[k])
            for name, k in self.nearest.elements.items()
            if (name not in self.own or not self.text.attribute(*self.own[name]))
            and (name.startswith("Ia") or not same(self.nearest.u[k], self.nearest.u0[k]))
        }

    def require_read_back(self, again: RobotText) -> None:
        """Check that the written text, read again as `again`, gives the intended values.

        Raises DescriptionError if it does not.
        """
        for link in again.links:
            at = self.nearest.links.get(link.name)
            wanted = np.zeros(10) if at is None else self.nearest.chi[at]
            if np.abs(link.ten - wanted).max() > AGREE * max(float(np.abs(wanted).max()), AGREE):
                raise DescriptionError(
                    f"link {link.name!a:.60}: a program that reads the new file would change the written values of mass and inertia; "
                    "remove settings of <compiler> such as boundmass, boundinertia or balanceinertia"
                )
        for name, (family, j) in self.own.items():
            attribute, x = self.text.attribute(family, j), self._value(name)
            if attribute and abs(again.joint_values(j)[family] - x) > AGREE * max(1.0, abs(x)):
                raise DescriptionError(
                    f"joint {again.table.joint[j].name!a:.60}: a program that reads the new file would "
                    f"not use the written {attribute}, because another entry of the file sets {attribute} "
                    "too; remove this entry (springdamper, for instance, sets stiffness and damping)"
                )
        if len(again.links) != len(self.nearest.links):
            raise DescriptionError(
                "no file is written, because the mass of a link would be zero, and a program that "
                "reads the file would ignore the inertia of this link"
            )


def _unit(text: RobotText, family: str, j: int) -> str:
    return (SLIDING if text.table.joint[j].kind == "prismatic" else UNITS)[family]


# --- from an estimate to the text ---

FEASIBLE = (
    "; set estimate: {method: feasible} in the study (study.yaml lies among the results) "
    "and identify again"
)


def apply(
    estimate: Estimate | str | Path | Any,
    model: str | Path,
    *,
    robot: str | Path | Robot | None = None,
    lock: Mapping[str, float] | None = None,
    chain: tuple[str, str] | None = None,
    exact: bool = False,
    base: str | None = None,
) -> Applied:
    """Return the text of a URDF or MJCF file with identified values in it; no file is written yet.

    Parameters
    ----------
    estimate : Estimate, Identification, str or Path
        Result of an identification, its estimate.json, or the folder that `symgen identify -o`
        wrote. The values of an Identification are those of the parameter set in use or, if that is
        the essential set, of the physical set.
    model : str or Path
        The file: .urdf, or .xml and .mjcf (MJCF).
    robot : str, Path or Robot, optional
        Robot that was identified, if it is not `model` itself: a file converted from `model`,
        perhaps with other elements or drives.
    lock, chain, exact
        As in `read_robot`, with the same values as when the robot was identified or converted.
    base : str, optional
        As in `load_robot`, with the same value as when the robot was identified.

    Raises
    ------
    DescriptionError
        The estimate is of another robot, no physical robot has it, or the file has no place for it.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np, runtime, symgen
    >>> _ = Path("arm.urdf").write_text(
    ...     "<robot name='arm'><link name='base'/><link name='rod'><inertial><origin xyz='0.2 0 0'/>"
    ...     "<mass value='1'/><inertia ixx='.01' iyy='.02' izz='.02' ixy='0' ixz='0' iyz='0'/>"
    ...     "</inertial></link><joint name='lift' type='continuous'><parent link='base'/>"
    ...     "<child link='rod'/><axis xyz='0 1 0'/></joint></robot>"
    ... )
    >>> model = symgen.model("arm.urdf")
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = (x[:, None] for x in (np.sin(t), np.cos(t), -np.sin(t)))
    >>> X = model.base_parameters(model.VALUES | {"MX1": 0.25, "ZZ1": 0.09, "FV1": 2, "FS1": 1})
    >>> record = runtime.Record(t, q, model.inverse_dynamics(q, qd, qdd, X))
    >>> applied = symgen.apply(runtime.identify(model, record), "arm.urdf")
    >>> change = applied.changes[0]
    >>> change.place, change.number, change.before, round(change.after, 3)
    ("link 'rod'", 'centre x', 0.2, 0.25)
    """
    if not isinstance(model, str | Path):
        raise DescriptionError(
            f"model is a {type(model).__name__}; expected the path of a URDF or MJCF file, whose text "
            "gets the values"
        )
    require(exact, bool, "exact", "True or False")
    require(lock, (Mapping, type(None)), "lock", "{joint name: position}")
    require(chain, (tuple, list, type(None)), "chain", "the names of a base link and a tip link")
    path = Path(model)
    content = content_of(path)
    part = TreePart(lock or {}, chain)
    text = read_text(content, path, exact, part)
    described = on_base(text.robot if robot is None else robot_of(robot), base)
    of = text.file if robot is None else described.file or described.name
    text = text.on(described.base)
    require_same_frames(text, described, of)
    warn_not_read(text.robot)
    result = _estimate(estimate)
    require_torques(result)
    _require_own_robot(result, of)
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
    inertial = {physical.standard[k] for j in physical.links for k in physical.link(j)}
    elsewhere = {
        name: described.values.get(name, 0.0)
        for name in physical.standard
        if name not in own and name not in inertial
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
        writing.require_read_back(read_text(new, path, exact, part).on(described.base))
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
        error=np.nan if lost else result.relative_error,
        changes=tuple(row for row in rows if not same(row.before, row.after)),
        added=tuple(edits.added),
        placeless=placeless,
        placeless_sigma={name: writing.sigma(closest.elements[name]) for name in placeless},
        joints={name: text.table.joint[own[name][1]].name for name in placeless if name in own},
        units={name: _unit(text, *own[name]) for name in placeless if name in own},
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


def _require_own_robot(result: Estimate, of: str) -> None:
    """Raise DescriptionError if a study has corrected the robot of the estimate.

    The hash of a corrected robot ends with a digest of the corrections (`symgen.corrected`).
    """
    if "+" in str(result.provenance.get("robot_sha256", "")):
        raise DescriptionError(
            "the study has corrected the robot (section `robot`), so that the values are not those "
            f"of {of}; write the corrections into the robot file (of a URDF or MJCF: symgen convert "
            "it to .yaml, and name that file by --robot), and identify again without the section"
        )


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

    The corrected standard deviations are used if there are any. The result is zero if the
    covariance is unknown.
    """
    at = [result.names.index(name) for name in names]
    C = np.nan_to_num(result.covariance[np.ix_(at, at)])
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.nan_to_num(result.sigma_corrected[at] / result.sigma[at], nan=1.0, posinf=1.0)
    values, V = np.linalg.eigh(C * np.outer(factor, factor))
    return np.asarray(V * np.sqrt(np.maximum(values, 0.0)))
