"""The edits that make a file state what was found, the table of what changed, and the check that
the new text is read as that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from symgen.description.tree import Array
from symgen.errors import DescriptionError
from symgen.update.applied import Change
from symgen.update.nearest import FileLink, Nearest
from symgen.update.places import NUMBERS, LinkPlace
from symgen.update.robot_text import RobotText
from symgen.update.xml_edits import XmlEdits, same

AGREE = 1e-9  # of the size of a parameter: the written file is read as what was to be written
NO_SHARE = 1e-9  # of the projection on what the record leaves open: less is determined
SLOPE = 1e-6  # of the gradient of a number of a link: less does not depend
UNITS = {"FV": "N*m*s/rad", "FS": "N*m", "Ia": "kg*m**2", "OFFSET": "N*m", "K": "N*m/rad"}
SLIDING = {"FV": "N*s/m", "FS": "N", "Ia": "kg", "OFFSET": "N", "K": "N/m"}


@dataclass(frozen=True, eq=False)
class Writing:
    """What goes into a file.

    Attributes
    ----------
    text : RobotText
        The file.
    nearest : Nearest
        What it is to say.
    own : mapping
        Family and joint of the elements that act along one joint, by name.
    root : ndarray, shape (b, b)
        Root of the covariance of the base parameters.
    """

    text: RobotText
    nearest: Nearest
    own: Mapping[str, tuple[str, int]]
    root: Array

    def links(self, edits: XmlEdits) -> list[Change]:
        """Edit the links that change; one row for each number of every link."""
        rows, moved = [], []
        for link in self.text.links:
            at = self.nearest.links[link.name]
            place, ten = self.text.link(link), self.nearest.chi[at]
            if np.allclose(ten, link.ten, rtol=1e-13, atol=1e-15):
                ten = link.ten
            else:
                moved.append((place, ten))
            rows += _link_rows(
                link, place, ten, self.nearest.gain[at], self.nearest.free[at], self.root
            )
        for place, ten in moved:
            place.write(edits, ten)
        if moved:
            self.text.places.heed_inertials(edits)
        return rows

    def joints(self, edits: XmlEdits) -> list[Change]:
        """Edit the joints; one row for each number that the file has a place for."""
        rows = []
        for j, joint in self.text.table.joint.items():
            attributes = {
                name: attribute
                for name, (family, i) in self.own.items()
                if i == j and (attribute := self.text.attribute(family, j))
            }
            before = self.text.joint_values(j)
            values = {self.own[name][0]: self._value(name) for name in attributes}
            self.text.places.set_joint(edits, joint, values, before)
            units = SLIDING if joint.kind == "prismatic" else UNITS
            for name, attribute in attributes.items():
                family, k = self.own[name][0], self.nearest.elements[name]
                determined = np.abs(self.nearest.free[k]).max() < NO_SHARE
                row = (before[family], values[family], self.sigma(k))
                source = "record" if determined else "sum"
                place = f"joint {joint.name!a:.60}"
                rows.append(Change(place, attribute, units[family], *row, source))
        return rows

    def _value(self, name: str) -> float:
        return float(self.nearest.chi[self.nearest.elements[name]])

    def sigma(self, k: int) -> float:
        """Deviation of parameter k."""
        return float(np.linalg.norm(self.nearest.gain[k] @ self.root))

    @property
    def placeless(self) -> dict[str, float]:
        """Parameters that change and that the file has no place for."""
        return {
            name: float(self.nearest.chi[k])
            for name, k in self.nearest.elements.items()
            if (name not in self.own or not self.text.attribute(*self.own[name]))
            and not same(self.nearest.chi[k], self.nearest.chi0[k])
        }

    def require_read_back(self, again: RobotText) -> None:
        """Raise DescriptionError unless the written text, read `again`, says what was to be
        written.
        """
        for link in again.links:
            at = self.nearest.links.get(link.name)
            wanted = np.zeros(10) if at is None else self.nearest.chi[at]
            if np.abs(link.ten - wanted).max() > AGREE * max(float(np.abs(wanted).max()), AGREE):
                raise DescriptionError(
                    f"link {link.name!a:.60} would be read with other values than written "
                    "(compiler settings that bound inertia?)"
                )
        for name, (family, j) in self.own.items():
            attribute, x = self.text.attribute(family, j), self._value(name)
            if attribute and abs(again.joint_values(j)[family] - x) > AGREE * max(1.0, abs(x)):
                raise DescriptionError(
                    f"joint {again.table.joint[j].name!a:.60} would be read with another "
                    f"{attribute} than written"
                )
        if len(again.links) != len(self.nearest.links):
            raise DescriptionError("a link would be read without inertia; its mass becomes zero")


def _link_rows(
    link: FileLink, place: LinkPlace, ten: Array, gain: Array, free: Array, root: Array
) -> list[Change]:
    """One row for each number of a link: from, to, deviation, and what tells it; gain (10, b) and
    free (10, p) as of Nearest.
    """
    stated = place.numbers(link.ten) if place.stated is None else place.stated
    new = place.numbers(ten)
    steps = np.diag(1e-6 * np.maximum(np.abs(ten), 1e-3 * np.abs(ten).max()))
    J = np.array([place.numbers(ten + e) - place.numbers(ten - e) for e in steps]).T
    J /= 2 * np.diag(steps)
    rows = []
    for k in place.attributes.order:
        name, label, unit = NUMBERS[k]
        share, left, size = (float(np.linalg.norm(x)) for x in (J[k] @ gain, J[k] @ free, J[k]))
        source = "file" if share <= SLOPE * size else "record" if left < SLOPE * size else "sum"
        before, after = float(stated[k]), float(stated[k] if same(new[k], stated[k]) else new[k])
        deviation = float(np.linalg.norm(J[k] @ gain @ root)) if source != "file" else np.nan
        number = name if name == label else f"{name} {label}"
        place_name = f"link {link.name!a:.60}"
        rows.append(Change(place_name, number, unit, before, after, deviation, source))
    return rows
