"""Replace commands of the terminal in messages by the place of the page that does the same.

Messages of the library name commands and options; on a page, a reader looks for a button.
"""

from __future__ import annotations

import re

PLACES = {
    "; identify --suggest FILE writes a likely study": "",
    "`symgen identify` gives the reason": "Solve gives the reason",
    "symgen report, or symgen identify --physical": "physical consistency on Solve",
    "ask with symgen report --encoder STEP, or symgen cestac --advise": "ask for it on Solve",
    "--columns ZZ1R,MX2R of symgen report and cestac, or cestac: {columns: [ZZ1R, MX2R]} of the study": "cestac.columns of the study",
    "symgen report --encoder STEP (with --side motor for an encoder on the motor)": "CESTAC on Solve",
    "symgen cestac --rounding phase --delta STEP": "CESTAC on Solve, with this step",
    "symgen cestac without --advise": "CESTAC on Solve",
    "symgen cestac --advise": "the advisor on Solve",
    "(--friction)": "(friction curves on Solve)",
    "(--method feasible)": "(feasible on Solve)",
    " with --lock": " fixed",
    ": --verbose": ": in the report",
    "symgen identify then builds": "Solve then builds",
    " (symgen.model(ROBOT, base='moving'))": "",
    "; exact=True or --exact keeps them": "; --exact in a terminal keeps them",
}
"""What messages say, and what a page says instead."""
ELSEWHERE = re.compile(r"(?<!terminal: )symgen (?=excite|convert|show)")
"""Commands that no page has."""
BASE = re.compile(r"--base (\w+)")


def on_page(text: str) -> str:
    """Return a message as a page says it; other texts stay as they are."""
    for words, place in PLACES.items():
        text = text.replace(words, place)
    text = BASE.sub(r"base: \1 in the robot file", text)
    return ELSEWHERE.sub("in a terminal: symgen ", text)
