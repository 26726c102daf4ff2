"""The report page: escaping, one self-contained file, tables that fit their header."""

import re

import pytest

from runtime.report.html import Image, Page, Section, Table, render

HOSTILE = '<script>alert("x")</script> & \'"><img src=x onerror=alert(1)>'


def page():
    table = Table(HOSTILE, (HOSTILE, "b"), [(HOSTILE, "1")], note=HOSTILE)
    section = Section(HOSTILE, (HOSTILE,), [Image(HOSTILE, b"<svg/>", HOSTILE)], [table], HOSTILE)
    return Page(HOSTILE, HOSTILE, [section], warning=HOSTILE, footer=HOSTILE)


def test_everything_is_escaped():
    html = render(page())
    assert "<script" not in html and "<img src=x" not in html
    assert html.count("&lt;script&gt;") == 15  # every place of a page, the heading and its link apart
    assert len(re.findall(r"<img ", html)) == 1


def test_nothing_is_fetched():
    html = render(page())
    assert "default-src 'none'" in html
    addresses = re.findall(r'(?:src|href)="([^"]*)"', html)
    assert addresses and all(a.startswith(("data:image/svg+xml;base64,", "#")) for a in addresses)


def test_same_page_same_bytes():
    assert render(page()) == render(page())


def test_ragged_table_is_refused():
    with pytest.raises(ValueError, match="1 cells"):
        Table("t", ("a", "b"), [("1",)])
