"""Edits that write identified values into a file, and a check of the new text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from symgen.description.tree import Array
from symgen.errors import DescriptionError
from symgen.update.applied import Change
from symgen.update.nearest import Nearest
from symgen.update.places import NUMBERS, FileLink, RobotText
from symgen.update.xml_edits import XmlEdits, same

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
        Family and joint of the parameters of elements that act along one joint, by name.
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
                    self.sigma(at[k]) if self.nearest.seen[at[k]] else np.nan,
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
            self.text.places.set_joint(edits, joint, values, before)
            units = SLIDING if joint.kind == "prismatic" else UNITS
            for name, attribute in attributes.items():
                family, k = self.own[name][0], self.nearest.elements[name]
                row = (before[family], values[family], self.sigma(k))
                place = f"joint {joint.name!a:.60}"
                rows.append(Change(place, attribute, units[family], *row, self._told_by(k)))
        return rows

    def _value(self, name: str) -> float:
        return float(self.nearest.u[self.nearest.elements[name]])

    def sigma(self, k: int) -> float:
        """Compute the standard deviation of number k in the list of all link and joint values."""
        return float(np.linalg.norm(self.nearest.gain[k] @ self.root))

    @property
    def placeless(self) -> dict[str, float]:
        """New values, by name, of changed parameters that the file format cannot store."""
        return {
            name: float(self.nearest.u[k])
            for name, k in self.nearest.elements.items()
            if (name not in self.own or not self.text.attribute(*self.own[name]))
            and not same(self.nearest.u[k], self.nearest.u0[k])
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
