"""What a notebook shows of formulas, an Estimate and a resolution study: well-formed, complete,
escaped; and a notebook that is run.
"""

import re
from html.parser import HTMLParser
from xml.etree import ElementTree

import nbformat
import numpy as np
from hang import HANG
from nbclient import NotebookClient

from runtime.core.cestac.result import Cestac, level_result
from runtime.core.cestac.runs import Level, Run, Runs
from runtime.core.least_squares.estimate import Estimate, JointFit
from runtime.core.rows.observation import Observation

HOSTILE = "<script>alert(1)</script>\"'&"


class Elements(HTMLParser):
    """Tags, and the text of each."""

    def __init__(self, markup):
        super().__init__()
        self.tags, self.text = [], ""
        self.feed(markup)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_data(self, data):
        self.text += data


def fit(names=("ZZ1R", "FV1"), **changes):
    b = len(names)
    values = {
        "names": names,
        "X": np.arange(1.0, b + 1),
        "sigma": np.full(b, 0.1),
        "covariance": 0.01 * np.eye(b),
        "sigma_corrected": np.full(b, np.nan),
        "sigma_rho": 0.5,
        "cond": 10.0,
        "cond_unit": 5.0,
        "rank": b,
        "residual_norm": 3.0,
        "relative_error": 2.5,
        "per_joint": (JointFit("1", 100, 3.0, 2.5, 0.5),),
        "method": "ols",
        "units": {"ZZ1R": "kg*m**2"},
    }
    return Estimate(**values | changes)


def test_estimate_is_a_table():
    shown = fit()._repr_html_()
    ElementTree.fromstring(shown)
    page = Elements(shown)
    assert (
        "<var>ZZ<sub>1R</sub></var>" in shown
        and "kg\xa0m²" in page.text
        and "10.000" in page.text
        and "relative error 2.500 %" in page.text
    )
    assert {tag for tag, _ in page.tags} <= {
        "div",
        "p",
        "b",
        "table",
        "thead",
        "tbody",
        "tr",
        "th",
        "td",
        "var",
        "sub",
        "details",
        "summary",
    }
    assert "booktabs" not in shown and fit()._repr_latex_() == fit().to_latex()


def test_nothing_in_a_result_is_markup():
    bad = fit(
        (HOSTILE, "FV1"),
        units={HOSTILE: HOSTILE},
        message=HOSTILE,
        method=HOSTILE,
        per_joint=(JointFit(HOSTILE, 1, 1.0, 1.0, 1.0),),
    )
    page = Elements(bad._repr_html_())
    ElementTree.fromstring(bad._repr_html_())
    assert "script" not in {tag for tag, _ in page.tags} and page.text.count("<script>") == 5


def test_resolution_study_is_a_table():
    rng = np.random.default_rng(0)
    W = rng.standard_normal((50, 2))
    Y = W @ [1.0, 2.0] + 0.01 * rng.standard_normal(50)
    seen = Observation(
        np.asfortranarray(W), Y, (50,), ("ZZ1R", "FV1"), np.arange(50.0), np.zeros(50, int), 1.0
    )
    reference = fit(X=np.linalg.lstsq(W, Y, rcond=None)[0], residual_norm=0.07)
    runs = Runs.of([Run(0, k, (0.99, 2.0 + 0.001 * k), 0.08) for k in range(3)], 2)
    shown = Cestac(
        ("ZZ1R", "FV1"), reference, (level_result(Level(2 * np.pi / 5000), runs, seen, reference),)
    )
    page = Elements(shown._repr_html_())
    assert "2*pi/5000" in page.text and "%e(rho)" in page.text and shown.verdict in page.text
    assert ElementTree.fromstring(shown._repr_html_()).find("table") is not None


def test_a_notebook_shows_them():
    """Run in a kernel: formulas come as LaTeX beside the text."""
    book = nbformat.v4.new_notebook()
    book.cells = [
        nbformat.v4.new_code_cell(
            "import symgen\nsymgen.symbolic('planar_2r').formulas('base_parameters')"
        ),
        nbformat.v4.new_code_cell(
            "from runtime.ground.markup import symbol\nprint(symbol('ZZ1R'))"
        ),
    ]
    NotebookClient(book, timeout=int(HANG), kernel_name="python3").execute()
    data = book.cells[0].outputs[0]["data"]
    assert {"text/latex", "text/plain"} <= set(data)
    assert re.search(r"ZZ_\{1R\}", data["text/latex"])
