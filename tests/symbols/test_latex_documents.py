r"""LaTeX documents compile whatever the title, and stay on the page; what the fonts of pdfLaTeX do
not have stands in \other with its number.
"""

import re
import shutil
import subprocess

import pytest

import symgen
from symgen.symbols.documents import escaped

TITLES = (
    "机械臂 with ロボット, 로봇",
    "Βραχίονας αβγ ΓΔ, λ = 2",
    "Робот Ħ ſ ½ °, Stäubli łódź",
    "100 % & #1_{a} ~ ^ “x” – …",
    "رجل 🤖",
)
TEXT = """
symgen: 1
name: arm
title: 'TITLE'
gravity: [0, 0, -g]
constants: {length_of_the_upper_arm: 0.3, offset_of_the_shoulder: 0.2, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: length_of_the_upper_arm, theta: q2, r: 0.15}
  3: {ant: 2, sigma: 0, alpha: 0, d: offset_of_the_shoulder, theta: q3, r: 0.35}
"""


def document(title: str, model: str = "inertia_matrix", form: str = "recursive") -> str:
    robot = symgen.parse_robot(TEXT.replace("TITLE", title).encode(), "arm.yaml")
    return symgen.symbolic(robot).show(model, form=form, format="latex")


@pytest.mark.parametrize("title", TITLES)
def test_letters_that_a_font_lacks_are_marked(title):
    text = escaped(title)
    rest = re.sub(r"\\other\{[0-9A-F]{4,5}\}\{.\}", "", text)
    assert all(c < "\u0180" or c in "–—‘’“”„…•€" for c in rest)
    assert not set(rest) & set("Ħſ") and not set(rest) & set("αβγλΓΔ")
    assert all(f"{ord(c):04X}" in text for c in "机ロ로Рر🤖" if c in title)


def compiled(engine: str, text: str, folder) -> str:
    """The log. Skips where the engine, or a package of the preamble, is not installed."""
    if shutil.which(engine) is None:
        pytest.skip(f"no {engine}")
    (folder / "d.tex").write_text(text, encoding="utf-8")
    command = [engine, "-interaction=nonstopmode", "-halt-on-error", "d.tex"]
    status = subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode
    log = (folder / "d.log").read_text(encoding="utf-8", errors="replace")
    if missing := re.search(r"File `([\w.]+)' not found", log):
        pytest.skip(f"{engine} without {missing[1]}")
    assert status == 0, re.findall(r"^! .*", log, re.MULTILINE)
    return log


@pytest.mark.parametrize("engine", ["pdflatex", "xelatex"])
@pytest.mark.parametrize("title", TITLES)
def test_documents_of_any_title_compile(title, engine, tmp_path):
    log = compiled(engine, document(title), tmp_path)
    assert "Missing character" not in log and "Output written" in log


@pytest.mark.parametrize("robot", ["tx40", "four_bar", "puma560", "long names"])
def test_recursions_stay_on_the_page(robot, tmp_path):
    if robot == "long names":
        length, angle = "length_of_the_upper_arm_of_this_machine", "beta_of_the_second_joint_of_it"
        text = TEXT.replace("TITLE", "").replace("length_of_the_upper_arm", length)
        text = text.replace("{length", f"{{{angle}: 0.3, length").replace("pi/2", angle)
        robot = symgen.parse_robot(text.replace("r: 0.15", f"r: {length}").encode(), "arm.yaml")
    text = symgen.symbolic(robot).show("inverse_dynamics", form="recursive", format="latex")
    log = compiled("pdflatex", text, tmp_path)
    assert not re.findall(r"Overfull \\hbox \(([\d.]+)pt", log)
