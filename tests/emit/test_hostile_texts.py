"""Nothing a robot file holds is executed: every text field, with every text we could think of, is
refused or stays text in each format.

Emitted Python is compared by syntax tree with that of the same robot with plain texts (only string
constants may differ), C by the tokens that are left without comments, pages by their elements,
LaTeX by its commands; robot files, .par and URDF are read again.
"""

import ast
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.parsers import expat

import pytest
from campaign import campaign, some
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from symgen.cli.main import app
from symgen.description import load_robot, parse_robot, read_par, write_yaml
from symgen.description.tree_robot import read_tree
from symgen.description.urdf import write_urdf
from symgen.emit.generate import generate_files
from symgen.errors import SymgenError
from symgen.pages.page import robot_page
from symgen.regroup.regrouping import regroup

TARGETS = ("numpy", "c")
CONSTANT, FAMILY = "LA", "SPR"
TEMPLATE = """symgen: 1
name: {name}
title: {title}
source: {source}
gravity: [0, -g, 0]
constants: {{{constant}: 0.4, g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: 0, d: {constant}, theta: q2, r: 0}}
elements:
  Ia: {{kind: inertia, along: all}}
  {family}: {{kind: stiffness, along: all}}
values: {{XX1: 0.1}}
"""
PLAIN = {
    "name": "arm",
    "title": "A plain title",
    "source": "a plain source",
    "constant": CONSTANT,
    "family": FAMILY,
}
NASTY = [
    '"""\nimport os\nos.system("id")\n"""',
    '"""; __import__("os").system("id"); """',
    "''' + __import__('os').system('id') + '''",
    "__import__('os').system('id')",
    '"',
    'ends in a quote"',
    '" starts with a quote',
    '""" three',
    "\\",
    "ends in a backslash \\",
    "\\N{BELL} \\x22 \\u0022 \\042",
    "*/ int x = system(\"id\"); /*",
    "*/\n#include </etc/passwd>\n/*",
    "*??/\n/ #define double float",
    "comment ??/",
    "// comment ??/",
    "%:include <stdio.h> <: :> <% %>",
    "_Pragma(\"GCC poison double\")",
    "{{ 7*7 }} {% for x in y %} {# comment #}",
    "${7*7} #{7*7} <%= 7*7 %> %s %(x)s {0.__class__} {x!r}",
    "</script><script>alert(1)</script>",
    "</title></style><img src=x onerror=alert(1)>",
    "]]> <!-- --> <![CDATA[ &lt; &#60; &amp;",
    "\" onmouseover=\"alert(1)",
    "javascript:alert(1)",
    "\\input{/etc/passwd} \\write18{id} \\catcode`\\%=0",
    "$\\immediate$ ^^5cinput",
    "%\n",
    "% # & _ ^ ~ $ { }",
    "*) (* Robotname = 'x' *) NL = 3 (*",
    "'}: [1, 2] # comment",
    "- a: !!python/object/apply:os.system [id]",
    "&anchor *alias <<: | > ? @ `",
    "---\nsymgen: 1\n...",
    "line\rreturn",
    "line\nfeed",
    "nul\0byte",
    "tab\tbell\a escape\x1b[31m",
    "next\x85line",
    "line\u2028separator\u2029paragraph",
    "bidi \u202e txet \u2066 \u200f",
    "zero\u200bwidth \ufeff",
    "\ud800 surrogate",
    "\U000e0041 tag",
    "ｆｕｌｌ　ｗｉｄｔｈ",
    "../../../etc/passwd",
    "C:\\con\\..\\x",
    "x" * 5000,
]  # fmt: skip
WORDS = ["open", "eval", "__import__", "len", "float", "np", "ca", "xp", "array_namespace", "lambda", "None", "self", "os", "sys", "QP1", "QDP2", "q1",
         "C2", "XX1R", "main", "double", "restrict", "asm", "M_PI", "INT64_MAX", "system", "NULL", "SX", "store", "Store", "regressor", "VALUES", "e", "n",
         "block", "states", "result", "a-b", "a b", "a;b", "1a", "", "é", "ａ", "a\n", "a" * 41, "_a", "__a__", "Sin", "pi", "I"]  # fmt: skip
HIDING = {
    "open",
    "eval",
    "len",
    "float",
    "np",
    "lambda",
    "QP1",
    "q1",
}  # refused as names of constants


def robot(**texts):
    """The robot with these texts, or SymgenError; a file that YAML cannot carry is no robot file
    either.
    """
    quoted = {key: json.dumps(text, ensure_ascii=False) for key, text in {**PLAIN, **texts}.items()}
    return parse_robot(TEMPLATE.format(**quoted).encode("utf-8", "surrogatepass"), "arm.yaml")


@pytest.fixture(scope="module")
def plain():
    return robot()


def tree(text, names=()):
    """The syntax tree without the values of its texts, and with `names` (old, new) made equal."""
    parsed = ast.parse(text)
    for node in ast.walk(parsed):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = ""
    dumped = ast.dump(parsed)
    for old, new in names:
        dumped = dumped.replace(f"'{old}", f"'{new}")
    return dumped


def tokens(text, folder):
    """C without comments, texts emptied, directives as they stand: the compiler's own reading,
    trigraphs included.
    """
    file = folder / "a.c"
    file.write_text(text, encoding="utf-8")
    command = ["gcc", "-std=c11", "-fpreprocessed", "-dD", "-E", "-P", str(file)]
    said = subprocess.run(command, capture_output=True, text=True, check=True, timeout=20).stdout
    return re.sub(r'"(\\.|[^"\\])*"', '""', said)


class Elements(HTMLParser):
    """Start and end tags with the names of their attributes."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, *(name for name, _ in attrs)))

    def handle_endtag(self, tag):
        self.found.append(("/", tag))


@pytest.fixture(scope="module")
def expected(plain, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain")
    files = generate_files(plain, targets=TARGETS)
    return {
        "python": {name: tree(text) for name, text in files.items() if name.endswith(".py")},
        "c": {name: tokens(text, folder) for name, text in files.items() if name.endswith(".c")}
        if shutil.which("gcc")
        else {},
        "page": Elements(robot_page(regroup(plain))).found,
        "latex": CliRunner().invoke(app, ["show", "planar_2r", "--format", "latex"]).stdout,
        "urdf": write_urdf(plain, values_of(plain))[0],
    }


def values_of(given):
    return {**dict.fromkeys(given.parameters, 0.0), "M1": 1.0, "M2": 1.0}


def check(given, expected, folder):
    """Everything made of `given` is what is made of the plain robot, texts aside."""
    files = generate_files(given, targets=TARGETS)
    for name, text in files.items():
        if name.endswith(".py"):
            assert tree(text) == expected["python"][name], name
        elif name in expected["c"]:
            assert tokens(text, folder) == expected["c"][name], name
    page = Elements(robot_page(regroup(given)))
    assert page.found == expected["page"]
    assert write_urdf(given, values_of(given))[0] == expected["urdf"]
    again = parse_robot(
        write_yaml(given, comments=[f"Converted from {given.file}."]).encode(), "again.yaml"
    )
    assert (again.title, again.source, again.frames) == (given.title, given.source, given.frames)


PAR = Path(__file__).parents[1] / "description" / "par_files" / "planar_2r.par"
FIELDS = ("title", "source", "file")


@pytest.mark.parametrize("every", [6, pytest.param(1, marks=campaign)])
@pytest.mark.parametrize("field", FIELDS)
@some(1)
def test_texts_stay_texts(field, every, plain, expected, tmp_path):
    """Every text in every field; by default every second of those that are not refused is read
    back, in one of the three fields.
    """
    refused = []
    for k, text in enumerate(NASTY):
        try:
            given = replace(plain, file=text) if field == "file" else robot(**{field: text})
        except SymgenError as error:
            assert "\n" not in str(error) and len(str(error)) < 1000, text
            refused.append(text)
        else:
            if (k + FIELDS.index(field)) % every == 0:
                check(given, expected, tmp_path)
    assert (
        20 < len(refused) < len(NASTY) - 10
    )  # both happen: markup and templates are texts, what could end a comment is not


def test_two_texts_do_not_add_up(plain, expected, tmp_path):
    """What opens in the title may not close in the source."""
    for title, source in [
        ("/", "*"),
        ("'''", "'''"),
        ("{{", "}}"),
        ("<script>", "</script>"),
        ("(*", "*)"),
        ("'", "'"),
        ('"a', 'b" c'),
        ("?" * 2, "/"),
    ]:
        check(robot(title=title, source=source), expected, tmp_path)


@settings(max_examples=15, deadline=None)
@given(
    st.text(
        alphabet=st.sampled_from("\"'\\/*?%{}<>&;:#-!|$_^~ \n\t\u2028\u202e\x00ax0"), max_size=30
    )
)
def test_any_text(text):
    """As above for the two texts whose comments are the hardest to keep closed."""
    try:
        given = robot(title=text, source=text)
    except SymgenError:
        return
    files = generate_files(given, targets=("numpy", "c"))
    plain = generate_files(robot(), targets=("numpy", "c"))
    assert tree(files["arm.py"]) == tree(plain["arm.py"])
    code = [re.sub(r"/\*.*?\*/", "", found["arm.c"], flags=re.DOTALL) for found in (files, plain)]
    first, second = (re.sub(r'"[^"]*"', "", text) for text in code)
    assert first == second
    assert "??/" not in files["arm.c"]


@campaign
@pytest.mark.parametrize("every", [8, pytest.param(1, marks=campaign)])
@pytest.mark.parametrize("field", ["constant", "family", "name"])
def test_names_are_identifiers_that_hide_nothing(field, every, expected, tmp_path):
    """A name is refused, or every model with it says the same as with another name, and is Python."""
    refused = []
    words = [word for k, word in enumerate(WORDS) if k % every == 0 or word in HIDING]
    for word in [*words, *(text for text in NASTY if len(text) < 100)]:
        try:
            files = generate_files(robot(**{field: word}), targets=TARGETS)
        except SymgenError as error:
            assert "\n" not in str(error), word
            refused.append(word)
            continue
        assert re.fullmatch(r"[A-Za-z]\w*", word, re.ASCII)
        assert {Path(name).parent for name in files} == {Path()}
        for name, text in files.items():
            if name.endswith(".py"):
                ast.parse(text)
                if field == "name":
                    assert tree(text) == next(
                        v
                        for k, v in expected["python"].items()
                        if k.removeprefix("arm") == name.removeprefix(word)
                    )
            elif shutil.which("gcc"):
                (tmp_path / "a.c").write_text(text)
                done = subprocess.run(
                    ["gcc", "-std=c11", "-fsyntax-only", str(tmp_path / "a.c")],
                    capture_output=True,
                    text=True,
                    check=False,
                )
                assert done.returncode == 0, (word, done.stderr[:300])
    assert set(NASTY) - {text for text in NASTY if len(text) >= 100} <= set(refused)
    if field == "constant":
        assert set(refused) >= HIDING


def test_latex_has_the_commands_of_any_robot(tmp_path):
    """Names with underscores and Greek letters, and hostile titles: LaTeX of the formulas has
    commands of ours only.
    """
    text = TEMPLATE.format(
        **{
            key: json.dumps(value)
            for key, value in {
                **PLAIN,
                "constant": "my_len_a",
                "title": "% $ # & _ ^ ~ { }",
            }.items()
        }
    )
    (tmp_path / "arm.yaml").write_text(text)
    shown = CliRunner().invoke(app, ["show", str(tmp_path / "arm.yaml"), "--format", "latex"])
    assert shown.exit_code == 0
    assert set(re.findall(r"\\([A-Za-z]+)", shown.stdout)) <= {
        "begin",
        "end",
        "left",
        "right",
        "frac",
        "sqrt",
        "sin",
        "cos",
        "pi",
        "mathit",
        "mathrm",
        "text",
        "quad",
    }
    assert "my\\_len\\_a" in shown.stdout and not re.search(r"(?<!\\)[#%~]", shown.stdout)


URDF = '<robot name={name}><link name={base}/><link name={link}><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>' \
       '<joint name={joint} type="revolute"><parent link={base}/><child link={link}/><axis xyz="0 0 1"/></joint></robot>'  # fmt: skip


@pytest.mark.parametrize("text", NASTY)
def test_names_of_a_urdf_and_a_par_file(text):
    """They reach identifiers, notes and comments of the robot file written from them: read again,
    it is the same robot.
    """
    from xml.sax.saxutils import quoteattr

    names = {key: quoteattr(f"{text} {key}") for key in ("name", "base", "link", "joint")}
    content = URDF.format(**names).encode("utf-8", "surrogatepass")
    try:
        expat.ParserCreate().Parse(content, True)
    except expat.ExpatError:
        with pytest.raises(SymgenError):
            read_tree(content, "a.urdf")
    else:
        for keep in (False, True):
            given, notes = read_tree(content, "a.urdf", keep_fixed=keep)
            assert all("\n" not in note and note.isprintable() for note in notes)
            assert (
                parse_robot(write_yaml(given, comments=notes).encode(), "a.urdf").frames
                == given.frames
            )
    par = (
        PAR.read_text(encoding="utf-8")
        .replace("'planar_2r'", f"'{text}'")
        .encode("utf-8", "surrogatepass")
    )
    try:
        given, notes = read_par(par, "a.par")
    except SymgenError as error:
        assert "\n" not in str(error)
    else:
        assert (
            parse_robot(write_yaml(given, comments=notes).encode(), "a.yaml").frames
            == load_robot("planar_2r").frames
        )
