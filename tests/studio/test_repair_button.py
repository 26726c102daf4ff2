"""The button that repairs a study, its list, its undo, and what the page says in place of options."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import WEAK_CONTRAST, Browser
from test_browser import COPIED, go, until
from test_mishaps import lever
from test_slow import LATE

from runtime.documents.yaml_text import yaml_values
from symgen.cli.main import VERBS
from symgen.studio.words import on_page

ROOT = Path(__file__).parents[2]

TERMINAL = re.compile(rf"(?<!Can )symgen (?:{'|'.join(VERBS)})\b|(?<![\w-])--[a-z]+")
OF_MODULES = ("core/model.py", "core/loading.py", "wrench.py", "documents/estimates.py")
"""They speak of generated modules and of edited results, which the page reads never."""
OF_TEXTS = ("core/result.py", "ground/settings_errors.py", "loop/compile_cache.py")
"""The printed result, settings of earlier versions, and a compiler's option."""


def doubly_wrong(folder: Path) -> tuple[str, str]:
    """A lever whose study has degrees for radians and the torque of the elbow reversed."""
    robot, study = lever(folder, units={"q": "rad"})
    header, *rows = (folder / "run.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    turned = [",".join([*row[:4], str(-float(row[4]))]) for row in cells]
    (folder / "run.csv").write_text("\n".join([header, *turned]))
    return robot, study


@pytest.mark.campaign
def test_a_study_is_repaired_and_undone_by_one_click_each(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Two errors at once, with late requests; the lines are those of the command."""
    robot, study = doubly_wrong(tmp_path)
    studio = running(robot, study)
    file = studio.work / "study.yaml"
    before = file.read_text()
    go(page, studio.address + "check")
    page.run(LATE.format(seed=5))
    page.click("[hx-post='do/repair']")
    until(page, "document.querySelectorAll('#repaired li').length === 2")
    shown = page.run(
        "[...document.querySelectorAll('#repaired li code')].map((node) => node.textContent)"
    )
    assert sorted(shown) == ["record.scale.tau: [1, -1]", "record.units.q: deg"]
    said = page.run("document.querySelector('#repaired').textContent")
    assert "has the wrong sign" in said and "% with it" in said
    by_hand = tmp_path / "repaired.yaml"
    command = "from symgen.cli.main import main; main()"
    subprocess.run(
        [sys.executable, "-c", command, "identify", robot, study, "--repair", str(by_hand)],
        check=True, capture_output=True,
    )  # fmt: skip
    ours, theirs = (yaml_values(path.read_text(), file="")[0] for path in (file, by_hand))
    for part in (ours, theirs):
        part["record"][0].pop("files")  # relative to another folder
    assert ours == theirs
    assert page.run(WEAK_CONTRAST) == []
    page.click("[hx-post='do/unrepair']")
    until(page, "!document.querySelector('#repaired')")
    assert file.read_text() == before


@pytest.mark.campaign
def test_a_repair_that_finds_nothing_changes_nothing_and_says_so(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    studio = running(*lever(tmp_path))
    before = (studio.work / "study.yaml").read_text()
    go(page, studio.address + "check")
    page.click("[hx-post='do/repair']")
    assert "Nothing changes" in until(page, "document.querySelector('#repaired')?.textContent")
    assert (studio.work / "study.yaml").read_text() == before
    assert page.run("!document.querySelector('[hx-post=\"do/unrepair\"]')")


def test_an_edit_after_a_repair_is_not_undone(studio: Any) -> None:
    """The list leaves with the study that it is of."""
    studio.server.folder.take_robot_of("planar_2r")
    for name, text in {"study.yaml": "symgen: 1\n# mine\n", "repair.json": "{}"}.items():
        (studio.path / name).write_text(text)
    told = {"of": "another", "kept": True, "before": "symgen: 1\n", "changes": []}
    (studio.path / "repair.json").write_text(json.dumps(told))
    answer = studio.post("unrepair")
    assert answer.status_code == 422 and "has been changed since the repair" in answer.text
    assert (studio.path / "study.yaml").read_text() == "symgen: 1\n# mine\n"


def texts(path: Path) -> Iterator[str]:
    """The texts of a module, f-strings as one, without docstrings."""
    inside = set()
    for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(n, ast.Expr):
            inside.add(n.value)
        elif isinstance(n, ast.JoinedStr):
            inside.update(n.values)
            yield "".join(v.value if isinstance(v, ast.Constant) else "{}" for v in n.values)
        elif isinstance(n, ast.Constant) and isinstance(n.value, str) and n not in inside:
            yield n.value


def test_messages_on_the_page_name_no_option_of_the_terminal() -> None:
    """Of all messages of runtime: a command that the page has is a place of the page."""
    left = [
        (path.name, text)
        for path in (ROOT / "runtime").rglob("*.py")
        if not path.as_posix().endswith(OF_MODULES + OF_TEXTS)
        for text in map(on_page, texts(path))
        if TERMINAL.search(text) and "in a terminal" not in text and text != "--lock {}={}"
    ]
    assert left == []
    assert on_page("then friction (--friction)") == "then friction (friction curves on Solve)"


@pytest.mark.campaign
def test_the_command_of_a_run_is_copied_and_reproduces_it(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """In a shell, anywhere; the details stay open when the list of runs comes anew."""
    studio = running(*lever(tmp_path))
    go(page, studio.address + "solve")
    page.run("document.querySelector('#solve button[name=anyway]').click()")
    until(page, "document.querySelectorAll('#jobs tbody tr').length === 1")
    page.run("document.querySelector('#same-run').open = true")
    page.run("fetch('do/cancel', {method: 'POST', body: ''})")  # news: the list loads again
    until(page, "document.querySelector('#same-run')?.open")
    go(page, studio.address + "results")
    page.run("document.querySelector('#same-run').open = true")
    page.run(COPIED)
    page.click("#same-run button")
    command = until(page, "window.copied")
    found = (studio.work / "runs/01-ols/estimate.json").read_bytes()
    (studio.work / "runs/01-ols/estimate.json").unlink()
    own = f"symgen() {{ {sys.executable} -c 'from symgen.cli.main import main; main()' \"$@\"; }}\n"
    subprocess.run(["bash", "-c", own + command], cwd=tmp_path, check=True, capture_output=True)
    assert (studio.work / "runs/01-ols/estimate.json").read_bytes() == found
