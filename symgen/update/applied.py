"""Result of `symgen.apply`: the new text of a URDF or MJCF file, and the list of its changes."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from runtime.ground.documents import json_text
from runtime.ground.table import Table, notebook, number
from runtime.reporting.result_files import write_all

NOTHING = 1e-12  # SI; smaller numbers are rounding
SOURCES = {"record": "the record", "sum": "the record, in sums", "file": "feasibility"}


@dataclass(frozen=True)
class Change:
    """One change of a number in a URDF or MJCF file.

    Attributes
    ----------
    place, number, unit : str
        Link or joint, which of its numbers, and its unit.
    before, after : float
        Value in the file, and value in the new text.
    sigma : float
        Standard deviation of the part of the number that the record determines, without the
        conditions of a physical robot; nan if the record does not determine the number.
    told_by : str
        Source of the value. record: the record determines it. sum: the record determines only a sum
        with other numbers, and this is the value nearest to the file. file: no torque depends on
        the number, and it changes only if no physical robot is possible otherwise.
    """

    place: str
    number: str
    unit: str
    before: float
    after: float
    sigma: float
    told_by: str


@dataclass(frozen=True)
class Applied:
    """Text of a URDF or MJCF file with identified values, and the list of its changes.

    Attributes
    ----------
    file, format : str
        Name of the file, and URDF or MJCF.
    before, content : bytes
        The text before and after.
    changes : tuple of Change
        Numbers that changed.
    added : tuple of str
        Attributes and elements that the file did not have.
    placeless : mapping, SI
        Parameters for which the format has no attribute, by name.
    placeless_sigma : mapping, SI
        Standard deviations of these parameters.
    joints : mapping
        Name of the joint of each placeless parameter.
    spread : tuple of str
        Links on fixed joints that also changed, because no physical link was possible otherwise.
    undetermined : tuple of str
        Numbers of links that affect no torque and keep the value of the file. A number of this kind
        that had to change is listed in `changes`, with `told_by` "file".
    strange : tuple of str
        Links whose mass or centre is far from that of the file.
    lost : tuple of str
        Base parameters that are not in the estimate or not determined; they keep the values of the
        file.
    """

    file: str
    format: str
    before: bytes
    content: bytes
    changes: tuple[Change, ...]
    added: tuple[str, ...]
    placeless: Mapping[str, float]
    placeless_sigma: Mapping[str, float]
    joints: Mapping[str, str]
    spread: tuple[str, ...]
    undetermined: tuple[str, ...]
    strange: tuple[str, ...]
    lost: tuple[str, ...]

    def write(self, output: str | Path) -> Path:
        """Write the new text completely or not at all, and return the path of the file.

        An existing file is replaced.
        """
        path = Path(output).resolve()
        return write_all(path.parent, {path.name: self.content})[0]

    @property
    def names_files(self) -> bool:
        """Whether the text names other files, such as meshes."""
        return b"filename=" in self.content or b"file=" in self.content

    def diff(self) -> str:
        """Return the changed lines, in the format of `diff -u`."""
        old, new = (
            text.decode("utf-8", "replace").splitlines(keepends=True)
            for text in (self.before, self.content)
        )
        return "".join(difflib.unified_diff(old, new, self.file, f"{self.file} (identified)", n=0))

    def table(self) -> Table:
        """Return a table of the changed numbers."""
        rows = [
            (
                c.place,
                c.number,
                f"{c.before if abs(c.before) > NOTHING else 0:.6g}",
                f"{c.after:.6g}",
                _percent(c),
                number(c.sigma, ".2g"),
                c.unit,
                SOURCES[c.told_by],
            )
            for c in self.changes
        ]
        return Table(
            "changes",
            ("where", "number", "from", "to", "change %", "sigma", "unit", "source"),
            rows,
            wide=(1, 6, 7),
        )

    def notes(self) -> list[str]:
        """List remarks for the user, for instance on parameters that the format cannot store."""
        notes = [f"added: {'; '.join(self.added)}"] if self.added else []
        if self.placeless:
            listed = ", ".join(
                f"{name} = {x:.4g} ± {self.placeless_sigma[name]:.2g}"
                + (f" ({self.joints[name]})" if name in self.joints else "")
                for name, x in self.placeless.items()
            )
            notes.append(f"no place in a {self.format}, set these in your program: {listed}")
        if self.spread:
            notes.append(
                "links on fixed joints that changed too, no physical link was left otherwise: "
                f"{', '.join(self.spread)}"
            )
        if self.lost:
            notes.append(
                f"not in the estimate, or not shown by the record: {', '.join(self.lost)}; the "
                "values of the file stay"
            )
        if self.strange:
            notes.append(
                f"far from the file: {'; '.join(self.strange)}. The torques are right, but "
                "the values of single links need not be: weigh the links, or give known values "
                "and bounds to method feasible"
            )
        if decided := [c for c in self.changes if c.told_by == "file"]:
            notes.append(
                "on which no torque of this robot depends, changed since no physical link was left "
                f"otherwise: {_by_place([f'{c.place}: {c.number}' for c in decided])}"
            )
        if self.undetermined:
            notes.append(
                "on which no torque of this robot depends, hence of the file: "
                f"{_by_place(self.undetermined)}"
            )
        return notes

    def __str__(self) -> str:
        if not self.changes:
            return "\n".join(
                [f"{self.file}: no number changes", *(f"- {note}" for note in self.notes())]
            )
        head = f"{self.file}: {len(self.changes)} numbers change"
        return "\n".join(
            [head, "", self.table().to_text(), "", *(f"- {note}" for note in self.notes())]
        )

    def _repr_html_(self) -> str:
        return notebook(
            [f"{self.file}: {len(self.changes)} numbers change", *self.notes()], self.table()
        )

    def to_json(self) -> str:
        """Return a JSON text with the file name, the format, the changes and the remarks."""
        return json_text(
            {
                "schema": "symgen-apply/1",
                "file": self.file,
                "format": self.format,
                "changes": [asdict(change) for change in self.changes],
                "added": self.added,
                "placeless": dict(self.placeless),
                "placeless_sigma": dict(self.placeless_sigma),
                "spread": self.spread,
                "undetermined": self.undetermined,
                "strange": self.strange,
                "lost": self.lost,
            }
        )


def _percent(c: Change) -> str:
    return f"{100 * (c.after - c.before) / abs(c.before):+.2f}" if abs(c.before) > NOTHING else "-"


def _by_place(lines: Sequence[str]) -> str:
    """Group texts such as `link 2: mass` by link, and join them: `link 2: mass, centre`."""
    places: dict[str, list[str]] = {}
    for line in lines:
        place, _, what = line.partition(": ")
        places.setdefault(place, []).append(what)
    return "; ".join(f"{place}: {', '.join(whats)}" for place, whats in places.items())
