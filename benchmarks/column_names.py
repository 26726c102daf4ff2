"""Columns and units that `identify --suggest` proposes for the lists of tests/reading/column_lists.py.

python benchmarks/column_names.py --before FILE    # in an earlier tree: write what it proposes
python benchmarks/column_names.py FILE             # write column_names.md, before and after
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "reading"))

from column_lists import LISTS

from runtime.reading.likely_columns import known_columns

PAGE = Path(__file__).with_suffix(".md")


def right() -> dict[str, bool]:
    """Whether the proposal for each list has its columns and units."""
    return {one.title: one.agrees(known_columns(one.names, one.joints)) for one in LISTS}


def main() -> None:
    if sys.argv[1] == "--before":
        Path(sys.argv[2]).write_text(json.dumps(right()))
        return
    before, after = json.loads(Path(sys.argv[1]).read_text()), right()
    lines = [
        "# Columns and units by their names",
        "",
        "Written by `column_names.py`: the proposal of `identify --suggest` for the column lists of "
        "`tests/reading/column_lists.py`, six joints each.",
        "A list is right if time, positions, torques and all units are right.",
        f"Before: commit 1aab4314, {sum(before.values())} of {len(before)} right; "
        f"now {sum(after.values())} of {len(after)}.",
        "",
        "| list | time | positions | torques | before | now |",
        "|---|---|---|---|---|---|",
    ]
    for one in LISTS:
        marks = ["right" if found[one.title] else "wrong" for found in (before, after)]
        forms = [f"`{form}`" if form else "" for form in (one.t, one.q, one.tau)]
        cells = [one.title, *(form.replace("|", "\\|") for form in forms), *marks]
        lines.append(f"| {' | '.join(cells)} |")
    PAGE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
