"""The edits that make a file state what was found, the table of what changed, and the check that the new text is read as that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symgen.description.tree import Array
from symgen.errors import DescriptionError
from symgen.update.applied import Change
from symgen.update.nearest import FileLink, Nearest
from symgen.update.robot_text import RobotText
from symgen.update.xml_edits import Source, same

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

    def links(self, source: Source) -> list[Change]:
        """Edit the links that change; one row for each number of every link."""
        rows, moved = [], []
        for link in self.text.links:
            at = self.nearest.links[link.name]
            place, ten = self.text.link(link), self.nearest.chi[at]
            if np.allclose(ten, link.ten, rtol=1e-13, atol=1e-15):
                ten = link.ten
            else:
                moved.append((place, ten))
            rows += _link_rows(link, place, ten, self.nearest.gain[at], self.nearest.free[at], self.root)
        self.text.write_links(source, moved)
        return rows

    def joints(self, source: Source) -> list[Change]:
        """Edit the joints; one row for each number that the file has a place for."""
        rows = []
        for j, joint in self.text.table.joint.items():
            mine = {
                family: self.nearest.elements[name] for name, (family, i) in self.own.items() if i == j and self.text.attribute(family, j)
            }
            self.text.set_joint(source, j, {family: float(self.nearest.chi[k]) for family, k in mine.items()})
            before, units = self.text.joint_values(j), SLIDING if joint.kind == "prismatic" else UNITS
            for family, k in mine.items():
                told = "record" if np.abs(self.nearest.free[k]).max() < NO_SHARE else "sum"
                numbers = (before[family], float(self.nearest.chi[k]), self.sigma(k))
                rows.append(Change(f"joint {joint.name!a:.60}", str(self.text.attribute(family, j)), units[family], *numbers, told))
        return rows

    def sigma(self, k: int) -> float:
        """Deviation of parameter k."""
        return float(np.linalg.norm(self.nearest.gain[k] @ self.root))

    @property
    def placeless(self) -> dict[str, float]:
        """Parameters that change and that the file has no place for."""
        return {
            name: float(self.nearest.chi[k])
            for name, k in self.nearest.elements.items()
            if (name not in self.own or not self.text.attribute(*self.own[name])) and not same(self.nearest.chi[k], self.nearest.chi0[k])
        }

    def require_read_back(self, again: RobotText) -> None:
        """Raise DescriptionError unless the written text, read `again`, says what was to be written."""
        for link in again.links:
            wanted = self.nearest.chi[self.nearest.links[link.name]] if link.name in self.nearest.links else np.zeros(10)
            if np.abs(link.ten - wanted).max() > AGREE * max(float(np.abs(wanted).max()), AGREE):
                raise DescriptionError(
                    f"link {link.name!a:.60} would be read with other values than written (compiler settings that bound inertia?)"
                )
        for name, (family, j) in self.own.items():
            attribute, wanted = self.text.attribute(family, j), self.nearest.chi[self.nearest.elements[name]]
            if attribute and abs(again.joint_values(j)[family] - wanted) > AGREE * max(1.0, abs(wanted)):
                raise DescriptionError(f"joint {again.table.joint[j].name!a:.60} would be read with another {attribute} than written")
        if len(again.links) != len(self.nearest.links):
            raise DescriptionError("a link would be read without inertia; its mass becomes zero")


def _link_rows(link: FileLink, place: Any, ten: Array, gain: Array, free: Array, root: Array) -> list[Change]:
    """One row for each number of a link: from, to, deviation, and what tells it; gain (10, b) and free (10, p) as of Nearest."""
    labels = [(q.name, q.unit, label) for q in place.quantities(ten) for label in q.labels]
    stated: Sequence[float] = place.stated()

    def numbers(x: Array) -> Array:
        return np.array([value for q in place.quantities(x) for value in q.values])

    new = np.array([y if same(x, y) else x for x, y in zip(numbers(ten), stated, strict=True)])
    step = 1e-6 * np.maximum(np.abs(ten), 1e-3 * np.abs(ten).max())
    J = np.array([(numbers(ten + e) - numbers(ten - e)) / (2 * h) for h, e in zip(step, np.diag(step), strict=True)]).T
    rows = []
    for k, (name, unit, label) in enumerate(labels):
        share, left, size = (float(np.linalg.norm(x)) for x in (J[k] @ gain, J[k] @ free, J[k]))
        told = "file" if share <= SLOPE * size else "record" if left < SLOPE * size else "sum"
        deviation = float(np.linalg.norm(J[k] @ gain @ root))
        number = name if name == label else f"{name} {label}"
        rows.append(Change(f"link {link.name!a:.60}", number, unit, float(stated[k]), float(new[k]), deviation, told))
    return rows
