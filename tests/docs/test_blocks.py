"""README and docs: the default run checks what every block names and runs most examples and the
README; the campaign runs every block of every page.

A page becomes one script in an empty folder: its Python blocks share a namespace, its commands run
with `symgen` on PATH, a YAML block whose first line is `# NAME.yaml` is written to that file. `#
exit code 1` at the end of a block of commands says what its last command ends with. ```text is not
run; those of README are, by test_readme_commands.
"""

from __future__ import annotations

import ast
import json
import os
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from campaign import campaign, some
from hang import HANG
from ruamel.yaml import YAML
from typer.main import get_command

from runtime.study import study_from_text
from symgen.cli.main import app
from symgen.description.loops_file import LoopsText, with_loops
from symgen.description.tree import Joint, Tree
from symgen.description.yaml import json_schema

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("[0-9]*.py"))
FENCE = re.compile(r"^```(?P<kind>python|sh|yaml)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
SOON = ("README",)  # pages that the default run runs
LONG = (
    "03_encoder_resolution",
    "04_closed_loop",
    "05_exciting_motion",
)  # examples that a campaign runs
BY_CI = "python3 -m venv"  # blocks that .ci/run takes from the README and runs itself
RUN = """
def sh(text, code):
    ended = subprocess.run(["bash", "-e", "-o", "pipefail", "-c", text]).returncode
    if ended != code:
        sys.exit(f"{text}\\nended with {ended}; expected {code}")
"""


@dataclass(frozen=True)
class Block:
    kind: str
    text: str
    line: int

    @property
    def file(self) -> str | None:
        named = re.match(r"# (\w[\w.-]*\.(?:yaml|py))\b", self.text)
        return named[1] if named else None

    @property
    def ends_with(self) -> int:
        said = re.search(r"# exit code (\d)", self.text.rstrip().split("\n")[-1])
        return int(said[1]) if said else 0


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    found = [
        Block(m["kind"], m["text"], text[: m.start()].count("\n") + 1) for m in FENCE.finditer(text)
    ]
    return [block for block in found if not block.text.startswith(BY_CI)]


def script(page: Path) -> str:
    """The page as one Python file; a traceback names the line of the page."""
    lines = ["import subprocess, sys", "from pathlib import Path", RUN]
    for block in blocks(page):
        place = f"{page.name}, line {block.line}"
        if block.kind == "python" and block.file is None:
            lines.append(f"exec(compile({block.text!r}, {place!r}, 'exec'))")
        elif block.kind == "sh":
            lines.append(f"sh({block.text!r}, {block.ends_with})  # {place}")
        elif block.file is not None:
            lines.append(
                f"Path({block.file!r}).write_text({block.text!r}, encoding='utf-8')  # {place}"
            )
    return "\n".join(lines)


def run(command: list[str], folder: Path) -> None:
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}",
        "MPLBACKEND": "Agg",
        # no page needs the network where the records are at hand
        "HTTPS_PROXY": "http://127.0.0.1:9",
    }
    ended = subprocess.run(
        command,
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=HANG,
        check=False,
    )
    assert ended.returncode == 0, (ended.stdout[-2000:] + ended.stderr[-4000:]).strip()


def needs_record(text: str) -> list[str]:
    """Names of the measured records that a text works on."""
    return [
        name
        for name in ("tx40", "emps")
        if re.search(rf"{name} {name}\b|record: {name}|record_of\(\"{name}|symgen demo", text)
    ]


RUNNING = [p for p in PAGES if any(b.kind != "yaml" for b in blocks(p))]


@pytest.mark.parametrize(
    "page",
    [p if p.stem in SOON else pytest.param(p, marks=campaign) for p in RUNNING],
    ids=lambda p: p.stem,
)
def test_blocks_of_a_page_run(page: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    text = script(page)
    for name in needs_record(text):
        request.getfixturevalue(f"{name}_data")
    if "go2.xml" in text and not Path(os.environ.get("SYMGEN_DATA", ""), "go2").is_dir():
        pytest.skip("SYMGEN_DATA names no folder with the record of the Go2, go2")
    (tmp_path / "page").mkdir()
    (tmp_path / "page.py").write_text(text, encoding="utf-8")
    run([sys.executable, str(tmp_path / "page.py")], tmp_path / "page")


@pytest.mark.parametrize(
    "example",
    [pytest.param(p, marks=campaign) if p.stem in LONG else p for p in EXAMPLES],
    ids=lambda p: p.stem,
)
@some(3)
def test_examples_run(
    example: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """In this process: what an example imports is there already."""
    assert example.read_text(encoding="utf-8").count("\n") < 60
    monkeypatch.chdir(tmp_path)
    before = {*sys.modules}
    runpy.run_path(str(example), run_name="__main__")
    if "matplotlib.pyplot" not in before:  # other tests ask that reports do without it
        sys.modules.pop("matplotlib.pyplot", None)
    assert capsys.readouterr().out


def python_texts() -> Iterator[tuple[str, str]]:
    """(place, text) of every Python block and of every example."""
    for page in PAGES:
        yield from (
            (f"{page.name}, line {b.line}", b.text) for b in blocks(page) if b.kind == "python"
        )
    yield from ((path.name, path.read_text(encoding="utf-8")) for path in EXAMPLES)


def test_python_blocks_import_what_exists() -> None:
    for place, text in python_texts():
        for node in ast.walk(ast.parse(text, place)):
            if (
                isinstance(node, ast.ImportFrom)
                and node.module
                and node.module.partition(".")[0] in ("symgen", "runtime")
            ):
                for alias in node.names:
                    known = hasattr(import_module(node.module), alias.name) or find_spec(
                        f"{node.module}.{alias.name}"
                    )
                    assert known, f"{place}: {node.module} has no {alias.name}"
            elif isinstance(node, ast.Import):
                for alias in node.names:
                    assert alias.name.partition(".")[0] not in ("symgen", "runtime") or find_spec(
                        alias.name
                    ), f"{place}: {alias.name}"


def test_commands_of_blocks_are_those_of_the_program() -> None:
    """Verb, arguments and options of every `symgen` command are what its parser takes; nothing
    runs.
    """
    group = get_command(app)
    seen = 0
    for page in PAGES:
        for block in (b for b in blocks(page) if b.kind == "sh"):
            for words in (
                shlex.split(line, comments=True)
                for line in block.text.splitlines()
                if line.startswith("symgen ")
            ):
                verb, arguments = words[1], [word for word in words[2:] if word not in ("&&", "||")]
                command = group.get_command(None, verb)  # type: ignore[attr-defined, arg-type]
                assert command is not None, f"{page.name}, line {block.line}: no verb {verb}"
                try:
                    command.make_context(verb, arguments)
                except Exception as e:
                    raise AssertionError(
                        f"{page.name}, line {block.line}: symgen {verb}: {e}"
                    ) from e
                seen += 1
    assert seen > 30


def test_yaml_blocks_are_what_the_program_reads() -> None:
    for page in PAGES:
        for block in blocks(page):
            if block.kind == "yaml":
                try:
                    read(block.text, page.name)
                except Exception as e:
                    raise AssertionError(f"{page.name}, line {block.line}: {e}") from e


def read(text: str, name: str) -> None:
    """A robot file, some sections of one, the loops of a URDF, or a study."""
    keys = set(YAML(typ="safe", pure=True).load(text))
    if "actuated" in keys:
        data = YAML(typ="safe", pure=True).load(text)
        links = dict.fromkeys(["base", *(x for row in data["loops"] for x in row["links"])])
        z = np.array([0.0, 0.0, 1.0])
        names = iter(data["actuated"])
        joints = tuple(
            Joint(next(names, f"to {x}"), "revolute", "base", x, np.eye(4), z, 1)
            for x in links
            if x != "base"
        )
        tree = with_loops(Tree("arm", links, joints, "base"), LoopsText(name, text.encode()))
        assert len(tree.loops) == len(data["loops"]) and tree.driven == {*data["actuated"]}
    elif "frames" in keys or keys <= set(json_schema()["properties"]) - {"symgen"}:
        sections = json.loads(json.dumps(YAML(typ="safe", pure=True).load(text)))
        jsonschema.validate(
            {"symgen": 1, "name": "arm", "gravity": [0, 0, 0], "frames": {}} | sections,
            json_schema(),
        )
    else:
        study_from_text(text, file=name)


def test_install_blocks_are_left_to_ci() -> None:
    assert [
        b
        for b in (m["text"] for m in FENCE.finditer(PAGES[0].read_text(encoding="utf-8")))
        if b.startswith(BY_CI)
    ]
