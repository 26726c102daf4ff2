"""The report page: well-formed, escaping, one self-contained file whose policy names its one
script; tables that fit their header.
"""

import json
import re
from base64 import b64encode
from hashlib import sha256
from html import unescape

import numpy as np
import pytest
from strict_html import Strict

from runtime.ground.markup import element, formula, symbol
from runtime.ground.table import Table
from runtime.reporting.page import Image, Matrix, Number, Page, Section, embedded, render
from runtime.reporting.series import Series

HOSTILE = (
    "</style></script><script>alert('x')</script> & \"<img src=x onerror=alert(1)> {{ 7*7 }} "
    "<!-- ]]>"
)


def page(text, *, live=True):
    t = np.arange(3.0)
    table = Table(
        text,
        (text, "b"),
        [(text, element("details", element("summary", text), text))],
        text,
        sortable=live,
    )
    image = Image(text, b"<svg/>", text, Series(t, t, t, text, text, 3) if live else None)
    section = Section(
        text,
        (text,),
        [image],
        [table],
        text,
        [Matrix(text, (text, symbol(text)), ((1.0, -0.5), (-0.5, 1.0)))],
        folded=True,
    )
    return Page(
        text,
        text,
        [section],
        text,
        text,
        "no",
        text,
        text,
        [(text, text)],
        [Number(text, text, "doubtful")],
    )


def policy(html):
    return unescape(re.search(r'Content-Security-Policy" content="([^"]*)"', html)[1])


def test_hostile_texts_stay_text():
    """In every place of a page: the same elements as with harmless texts."""
    hostile, harmless = Strict(render(page(HOSTILE))), Strict(render(page("text")))
    assert hostile.tags == harmless.tags and hostile.tags.count("script") == 2
    assert [a[:2] for a in hostile.attributes] == [a[:2] for a in harmless.attributes]
    assert "{{ 7*7 }}" in render(page(HOSTILE))
    assert policy(render(page(HOSTILE))) == policy(render(page("text")))


def test_nothing_is_fetched():
    html = render(page("text"))
    addresses = re.findall(r'(?:src|href|action|srcset)="([^"]*)"', html)
    assert addresses and all(a.startswith("data:image/svg+xml;base64,") for a in addresses)
    assert not re.search(r"url\(|@import", html)


def test_policy_allows_this_script_and_this_style_alone():
    html = render(page("text"))
    script, style = (
        re.search(r"<script>(.*?)</script>", html, re.DOTALL)[1],
        re.search(r"<style>(.*?)</style>", html, re.DOTALL)[1],
    )
    digests = [
        f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in (style, script)
    ]
    assert policy(html) == (
        f"default-src 'none'; img-src data:; style-src {digests[0]}; script-src {digests[1]}; "
        "base-uri 'none'; form-action 'none'"
    )


def test_a_page_without_figures_to_zoom_has_no_script():
    plain = Page(
        "t",
        "v",
        [Section("s", images=[Image("c", b"<svg/>", "a")], tables=[Table("t", ("a",), [("1",)])])],
    )
    html = render(plain)
    assert "<script" not in html and "script-src" not in policy(html)


def test_same_page_same_bytes():
    assert render(page("text")) == render(page("text"))


def test_embedded_values_do_not_end_the_script():
    text = embedded({HOSTILE: [HOSTILE]})
    assert not set("<>&") & set(text) and json.loads(text) == {HOSTILE: [HOSTILE]}
    with pytest.raises(ValueError, match="JSON"):
        embedded(float("nan"))


def test_ragged_table_is_refused():
    with pytest.raises(ValueError, match="1 cells"):
        Table("t", ("a", "b"), [("1",)])


@pytest.mark.parametrize(("text", "expected"), [
    ("ZZ1 + Ia1 - D3**2*(M3 + M4)", "ZZ1 + Ia1 − D32\u2009(M3 + M4)"),
    ("-2*XX2*cos(A)", "−2\u2009XX2\u2009cos(A)"),
])  # fmt: skip
def test_formula_reads_as_the_text(text, expected):
    html = formula(text)
    Strict(html)
    assert unescape(re.sub(r"<[^>]*>", "", html)) == expected
    assert formula("D3**2") == '<span class="formula"><var>D<sub>3</sub></var><sup>2</sup></span>'


def test_names_and_formulas_cannot_bring_in_markup():
    for made in (symbol(HOSTILE), formula(HOSTILE)):
        assert set(Strict(made).tags) <= {"var", "sub", "sup", "span"}
