"""The page of a robot: well-formed, self-contained, complete, and nothing in a robot file can bring
in markup.
"""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from campaign import sampled, some
from strict_html import Strict
from typer.testing import CliRunner

from oracles.named_robots import planar_2r
from runtime.core.model import load_model
from symgen.cli.main import app
from symgen.derive.regressor import inertial_names
from symgen.description import load_robot
from symgen.description.expression import Call, Expression
from symgen.description.grammar import parse
from symgen.emit.spec import module_spec
from symgen.errors import SymgenError
from symgen.pages.effects import effects
from symgen.pages.page import embedded, robot_page
from symgen.regroup.regrouping import Formula, regroup
from symgen.symbols import expressions
from symgen.symbols.printers import math, math_terms

GENERATED = Path(__file__).resolve().parents[2] / "generated"
ROBOTS = sampled(("tx40", "haptic", "scara", "four_bar"), 0, always=("haptic", "scara", "four_bar"))
HOSTILE = (
    "</script></title><script>alert('x')</script><img src=x onerror=alert(1)> {{ 7*7 }} & ' "
    "<!-- ]]> </style><b>"
)


@pytest.fixture(scope="module")
def pages():
    """Regrouping and page of a robot, made once."""

    @cache
    def made(name):
        regrouping = regroup(load_robot(name))
        return regrouping, robot_page(regrouping)

    return made


def maths(html):
    return [ElementTree.fromstring(m) for m in re.findall(r"<math>.*?</math>", html, re.DOTALL)]


def data(html):
    return json.loads(Strict(html).text["script"].partition('"use strict"')[0])


@pytest.mark.parametrize("name", ROBOTS)
@some(2)
def test_page_is_well_formed_and_asks_nobody(pages, name):
    html = pages(name)[1]
    page = Strict(html)
    assert (
        page.tags.count("script") == 2
        and page.tags.count("style") == 1
        and page.tags.count("h1") == 1
    )
    assert not {"img", "link", "iframe", "object", "embed", "form", "base"} & set(page.tags)
    addresses = [
        value
        for _, attribute, value in page.attributes
        if attribute in ("src", "href", "action", "data", "srcset")
    ]
    assert addresses and all(a.startswith("#") for a in addresses)
    assert not re.search(
        r"https?://(?!www\.w3\.org/2000/svg\")|url\(|@import|fetch\(|XMLHttp|import\(", html
    )
    assert not [a for _, a, _ in page.attributes if a.startswith("on") or a == "style"]
    ids = [value for _, attribute, value in page.attributes if attribute == "id"]
    assert len(ids) == len(set(ids)) and {a[1:] for a in addresses} <= set(ids)
    assert {
        value
        for tag, attribute, value in page.attributes
        if attribute in ("for", "aria-labelledby", "aria-describedby")
    } <= set(ids)


@pytest.mark.parametrize("name", ROBOTS)
def test_formulas_are_complete(pages, name):
    """Each formula names the parameters of its combination, in MathML that parses as XML."""
    regrouping, html = pages(name)
    assert len(maths(html)) > len(regrouping)
    items = re.findall(r'<li data-p="(\w+)">(.*?)</li>', html, re.DOTALL)
    assert sorted(n for n, _ in items) == sorted(regrouping.names)
    folded = html.partition("identified as they are</summary>")[2].partition("</details>")[0]
    by_name = dict(items)
    for b in regrouping.base:
        item = by_name[b.name]
        assert (f'<li data-p="{b.name}">' in folded) == (b.name == b.own)
        pointed = [
            node.get("data-p")
            for m in maths(item.partition("<span")[2])
            for node in m.iter()
            if node.get("data-p")
        ]
        assert set(pointed) == (set(b.combination) if b.name != b.own else set())
        assert item.count("aria-hidden") == item.count('class="off"')


def test_formula_reads_as_the_text():
    """ZZ1R of the TX40, eq. (27), with the invisible operators and spaces taken away."""
    b = regroup(load_robot("tx40")).base[0]
    text = "".join(
        "".join(ElementTree.fromstring(m).itertext())
        for m in math_terms(expressions.formula(b.formula))
    )
    assert text.replace("\u2062", "") == "ZZ1+Ia1+YY2+YY3+D32(M3+M4+M5+M6)"


@pytest.mark.parametrize(("text", "expected"), [
    ("-pi/2", "<mrow><mo form=\"prefix\">−</mo><mfrac><mi>π</mi><mn>2</mn></mfrac></mrow>"),
    ("0.225", "<mn>0.225</mn>"),
    ("0", "<mn>0</mn>"),
    ("D2**2", "<msubsup><mi>D</mi><mn>2</mn><mn>2</mn></msubsup>"),
    ("sqrt(L1)", "<msqrt><msub><mi>L</mi><mn>1</mn></msub></msqrt>"),
])  # fmt: skip
def test_expressions(text, expected):
    assert math(expressions.expression(parse(text))) == f"<math>{expected}</math>"


def test_names_cannot_bring_in_markup():
    """Names are identifiers already; were they not, they would still be escaped."""
    bad = Expression(
        {((HOSTILE, 1), (Call("sin", Expression.symbol(HOSTILE)), 2)): parse("3").constant}
    )
    for made in (
        math(expressions.expression(bad)),
        *math_terms(expressions.formula(Formula({HOSTILE: parse("1"), HOSTILE + "2": bad}))),
    ):
        root = ElementTree.fromstring(made)
        assert {node.tag for node in root.iter()} <= {
            "math",
            "mrow",
            "msub",
            "msup",
            "msubsup",
            "mi",
            "mn",
            "mo",
            "mspace",
        }


def test_hostile_texts_stay_text():
    robot = replace(planar_2r(), title=HOSTILE, source=HOSTILE, file=HOSTILE, sha256=HOSTILE)
    html, plain = robot_page(regroup(robot)), robot_page(regroup(planar_2r()))
    page, harmless = Strict(html), Strict(plain)
    assert page.text["title"] == page.text["h1"] == HOSTILE
    assert "{{ 7*7 }}" in html and "49" not in page.text["h1"]
    assert [t for t in page.tags if t not in ("p",)] == [
        t for t in harmless.tags if t not in ("p",)
    ]
    assert re.findall(r'content="(default-src[^"]*)"', html) == re.findall(
        r'content="(default-src[^"]*)"', plain
    )


def test_embedded_values_do_not_end_the_script():
    text = embedded({HOSTILE: [HOSTILE]})
    assert not set("<>&") & set(text) and json.loads(text) == {HOSTILE: [HOSTILE]}
    with pytest.raises(ValueError, match="JSON"):
        embedded(float("nan"))


@pytest.mark.parametrize("name", ROBOTS)
def test_parameters_say_where_they_act(pages, name):
    """The rows a base parameter enters are those where the emitted regressor is not zero; what has
    no effect has a reason.
    """
    regrouping, html = pages(name)
    robot, parameters = regrouping.robot, data(html)["parameters"]
    assert set(parameters) == {*regrouping.names, *robot.parameters}
    model = load_model(GENERATED / f"{name}.py")
    rng = np.random.default_rng(3)
    middle = np.array([j["start"] for j in data(html)["joints"]])
    q, qd, qdd = (rng.uniform(-0.3, 0.3, (20, len(middle))) for _ in range(3))
    D = model.regressor(middle + q, qd, qdd)
    for k, b in enumerate(regrouping.names):
        assert parameters[b]["joints"] == [
            j for row, j in enumerate(robot.joints) if np.abs(D[:, row, k]).max() > 1e-9
        ], b
    for standard in robot.parameters:
        assert bool(parameters[standard]["why"]) == (standard in regrouping.no_effect), standard
        if standard in inertial_names(robot):
            assert parameters[standard]["place"] == f"link {inertial_names(robot)[standard][1]}"


def test_reasons():
    """Axis 1 of the TX40 is vertical, axis 2 horizontal through the same point."""
    parameters = {e.name: e for e in effects(module_spec(regroup(load_robot("tx40"))))}
    assert (
        parameters["XX1"].why
        == "link 1 never turns about x1, and the energy has its rate as a factor"
    )
    assert parameters["M2"].why.startswith("the origin of frame 2 does not move")
    assert "z2 keeps its angle to gravity" in parameters["MZ2"].why
    assert parameters["MX2"].why == "" and parameters["MX2"].base == ("MX2R",)


def test_same_robot_same_bytes(pages):
    assert robot_page(regroup(load_robot("scara"))) == pages("scara")[1]


def test_length_without_a_value_is_told():
    robot = replace(planar_2r(), constants={"L1": 1e300, "g": 9.81})
    frame = replace(robot.frames[1], d=parse("L1*L1*L1"))
    with pytest.raises(SymgenError, match=r"frames\.2\.d"):
        robot_page(regroup(replace(robot, frames=(robot.frames[0], frame))))


def test_command_writes_one_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["show", "planar_2r", "--html"])
    assert (result.exit_code, result.stdout) == (0, "planar_2r.html\n")
    result = CliRunner().invoke(
        app, ["show", "planar_2r", "--html", "-o", str(tmp_path / "pages" / "arm.html")]
    )
    assert (tmp_path / "pages" / "arm.html").read_bytes() == (
        tmp_path / "planar_2r.html"
    ).read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["pages", "planar_2r.html"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("--html", "--json"),
        ("--html", "--only", "XX2R"),
        ("-o", "x.html"),
        ("--html", "--recursive"),
    ],
)
def test_options_that_do_not_go_together(arguments):
    result = CliRunner().invoke(app, ["show", "planar_2r", *arguments])
    assert result.exit_code == 2 and "--html" in result.stderr and result.stdout == ""
