"""Result of `symgen.apply`: the new text of a URDF or MJCF file, and the list of its changes."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from textwrap import wrap

from runtime.ground.documents import json_text
from runtime.ground.table import LINE, Table, aligned, interval, notebook, number
from runtime.reporting.result_files import write_all

NOTHING = 1e-12  # SI; smaller numbers are rounding
SOURCES = {"record": "record", "sum": "sums", "file": "physics"}
LEGEND = {
    "record": "record: the record determines the number; sigma is its standard deviation",
    "sum": "sums: the record determines only sums with other numbers; this number is the one nearest to the file, so it has no sigma. standard_parameters.csv of the results has other numbers: another robot with the same torques, which did not put motor inertia first",
    "file": "physics: no joint torque depends on the number; changed only to keep the link physical",
}
PRODUCTS = ("inertia xy", "inertia xz", "inertia yz")
SIGN = "inertia xy is -sum m x y about the centre of mass, an entry of the inertia matrix as both formats have it; XY of symgen has the same sign, about the origin of its link frame"


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
        Standard deviation of the number, without the conditions of a physical robot; nan if the
        record does not determine it alone.
    told_by : str
        Source of the value. record: the record determines it. sum: the record determines only a sum
        with other numbers, and the new value is the one nearest to the file. file: no torque
        depends on the number, and it changes only if no physical robot is possible otherwise.
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
    error : float, %
        Share of the torques of the record that the new file with the placeless parameters leaves
        unexplained; nan if it is not known.
    changes : tuple of Change
        Numbers that changed.
    added : tuple of str
        Attributes and elements that the file did not have.
    placeless : mapping, SI
        Parameters for which the format has no attribute, by name.
    placeless_sigma : mapping, SI
        Standard deviations of these parameters; nan where the record determines only sums.
    joints, units : mapping
        Name of the joint, and unit, of each placeless parameter that acts on one joint.
    spread : tuple of str
        Links on fixed joints that also changed, because no physical link was possible otherwise.
    undetermined : tuple of str
        Numbers of links that affect no torque and keep the value of the file. A number of this kind
        that had to change is listed in `changes`, with `told_by` "file".
    strange : tuple of str
        Links whose mass or centre is far from the value in the file.
    lost : tuple of str
        Base parameters that are not in the estimate or not determined; they keep the values of the
        file.
    """

    file: str
    format: str
    before: bytes
    content: bytes
    error: float
    changes: tuple[Change, ...]
    added: tuple[str, ...]
    placeless: Mapping[str, float]
    placeless_sigma: Mapping[str, float]
    joints: Mapping[str, str]
    units: Mapping[str, str]
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
        """Return a table of the changed numbers, rounded to two digits of their deviations."""
        rows = [
            (
                c.place,
                c.number,
                f"{c.before if abs(c.before) > NOTHING else 0:.6g}",
                interval(c.after, c.sigma)[0],
                _percent(c),
                number(c.sigma, ".2g"),
                c.unit,
                SOURCES[c.told_by],
            )
            for c in self.changes
        ]
        header = ("where", "number", "from", "to", "change %", "sigma", "unit", "source")
        return Table("changes", header, rows, wide=(1, 6, 7))

    def answer(self) -> list[str]:
        """Say in sentences what the new file explains, what is far from the file, and what is left.

        The parameters that the format cannot store follow, one per line.
        """
        count, rest = len(self.changes), len(self.placeless)
        head = f"{self.file}: {count or 'no'} number{'s' * (count > 1)} change{'s' * (count < 2)}"
        if rest:
            head += (
                f" in the file; {rest} more value{'s' * (rest > 1)} {'have' if rest > 1 else 'has'} no "
                f"place in {self.format} and {'are' if rest > 1 else 'is'} not written"
            )
        whole = "Both together leave" if rest else "The new file leaves"
        explained = (
            f". {whole} {self.error:.1f} % of the torques of the record unexplained"
            if isfinite(self.error)
            else ""
        )
        none = "no mass by a factor of 2, no centre by the size of its link"
        far = f"Far from the file: {'; '.join(self.strange) or none}."
        lines = [f"{head}{explained}.", far]
        if self.strange:
            lines[-1] += (
                " The torques are right, but the values of single links need not be: weigh the links, or give known values and bounds to method feasible."
            )
        if not self.placeless:
            return [*lines, f"Everything identified has a place in the {self.format}."]
        lines.append("Not written; set these in your program:")
        return lines + [f"  {line}" for line in self._rest()]

    def _rest(self) -> list[str]:
        """Write each parameter without a place: value, deviation, unit and joint."""
        lines = []
        for name, x in self.placeless.items():
            sigma = self.placeless_sigma[name]
            value, deviation = interval(x, sigma)
            lines.append(
                f"{name} = {value} {self.units.get(name, '')}".rstrip()
                + (f" ({self.joints[name]})" if name in self.joints else "")
                + (f", sigma {deviation}" if isfinite(sigma) else ", determined only in sums")
            )
        return lines

    def notes(self) -> list[str]:
        """List further remarks for the user, for instance on numbers that no torque determines."""
        sources = {c.told_by for c in self.changes}
        notes = [text for told_by, text in LEGEND.items() if told_by in sources]
        if any(c.number in PRODUCTS for c in self.changes):
            notes.append(SIGN)
        notes += [f"added: {'; '.join(self.added)}"] if self.added else []
        if self.spread:
            notes.append(
                "changed only to keep the robot physical, links on fixed joints: "
                f"{', '.join(self.spread)}"
            )
        if self.lost:
            notes.append(
                "kept from your file (not in the estimate, or not shown by the record): "
                f"{', '.join(self.lost)}"
            )
        if self.undetermined:
            notes.append(
                "kept from your file (no joint torque depends on them): "
                f"{_by_place(self.undetermined)}"
            )
        return notes

    def __str__(self) -> str:
        lines = [piece for line in self.answer() for piece in _wrapped(line, "  ")]
        if self.changes:
            lines += ["", *self._by_link()]
        notes = [piece for note in self.notes() for piece in _wrapped(f"- {note}", "  ")]
        return "\n".join([*lines, *([""] if notes else []), *notes])

    def _by_link(self) -> list[str]:
        """Write the table of changes with a heading for each link and joint."""
        table = self.table()
        head, *rows = aligned([row[1:] for row in (table.header, *table.rows)]).split("\n")
        lines, place = [f"  {head}"], ""
        for change, row in zip(self.changes, rows, strict=True):
            if change.place != place:
                place = change.place
                lines.append(place)
            lines.append(f"  {row}")
        return lines

    def _repr_html_(self) -> str:
        return notebook([*self.answer(), *self.notes()], self.table())

    def to_json(self) -> str:
        """Return a JSON text with the file name, the format, the changes and the remarks."""
        return json_text(
            {
                "schema": "symgen-apply/1",
                "file": self.file,
                "format": self.format,
                "error": self.error,
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
    """Write the change in % of the old number; "-" if the old number is zero."""
    return f"{100 * (c.after - c.before) / abs(c.before):+.3g}" if abs(c.before) > NOTHING else "-"


def _wrapped(line: str, indent: str) -> list[str]:
    """Wrap a line at the width of the table, between words."""
    return wrap(
        line,
        LINE,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
        replace_whitespace=False,
        drop_whitespace=True,
    )


def _by_place(lines: Sequence[str]) -> str:
    """Group texts such as `link 2: mass` by link, and join them: `link 2: mass, centre`."""
    places: dict[str, list[str]] = {}
    for line in lines:
        place, _, what = line.partition(": ")
        places.setdefault(place, []).append(what)
    return "; ".join(f"{place}: {', '.join(whats)}" for place, whats in places.items())
