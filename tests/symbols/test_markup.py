"""The models of a robot's page: closed where they can be read, else the recursion; MathML that is
well formed and says the same entries.
"""

from __future__ import annotations

from xml.etree import ElementTree

import symgen
from symgen.pages.page import robot_page
from symgen.symbols.documents import shown_models
from symgen.symbols.symbolic import symbolic


def test_closed_or_recursive() -> None:
    models = {m.title: m for m in shown_models(symgen.regrouping(symgen.load_robot("tx40")))[0]}
    assert models["gravity"].entries and not models["gravity"].steps
    bias = models["bias"]
    equations = [pair for _, own in bias.steps for pair in own]
    names = ["".join(ElementTree.fromstring(x).itertext()) for x, _ in equations]
    assert len(equations) > 100 and not bias.entries and "W13" in names
    assert bias.steps[-1][0] == "result" and len(bias.steps[-1][1]) == 6
    for label, terms in equations:
        assert all(ElementTree.fromstring(x).tag == "math" for x in (label, *terms))
    told = symbolic("tx40").model("gravity").closed
    assert (
        len(models["gravity"].entries) == len(told.entries)
        and models["gravity"].size == f"{told.size} terms"
    )
    for label, terms in models["gravity"].entries:
        assert all(ElementTree.fromstring(x).tag == "math" for x in (label, *terms))


def test_text_of_the_entries() -> None:
    shown = {
        m.title: m for m in shown_models(symgen.regrouping(symgen.load_robot("planar_2r")))[0]
    }["coriolis"]
    read = [
        "".join("".join(ElementTree.fromstring(x).itertext()) for x in (label, *terms))
        for label, terms in shown.entries
    ]
    assert [line.replace("\u2062", "") for line in read] == [
        "C1,1−D2S2q˙2MX2−D2C2q˙2MY2",
        "C1,2−D2S2(q˙1+q˙2)MX2−D2C2(q˙1+q˙2)MY2",
        "C2,1D2S2q˙1MX2+D2C2q˙1MY2",
    ]


def test_page_has_the_section() -> None:
    base = symgen.regrouping(symgen.load_robot("emps"))
    html = robot_page(base)
    assert '<h2 id="models">' in html and html.count("<details") == 9


def test_loops_say_which_joints_are_symbols() -> None:
    models, notes = shown_models(symgen.regrouping(symgen.load_robot("four_bar")))
    assert [m.title for m in models][
        -1
    ] == "closure" and "Passive joints q2, q3 are symbols" in notes[-1]
