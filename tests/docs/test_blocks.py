"""Every ```python and ```sh block of README and docs runs as it stands, page by page, in one empty folder per page; ```yaml blocks are read.

A page becomes one script: its Python blocks share a namespace, its commands run with `symgen` on PATH, a YAML block whose first line is
`# NAME.yaml` is written to that file. `# exit code 1` at the end of a block of commands says what its last command ends with. ```text is not run.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from runtime.settings.files import settings_from_text, study_from_text
from symgen.cli.fleet_jobs import FleetSettings
from symgen.description.schema import RobotFile

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.py"))
FENCE = re.compile(r"^```(?P<kind>python|sh|yaml)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
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
    found = [Block(m["kind"], m["text"], text[: m.start()].count("\n") + 1) for m in FENCE.finditer(text)]
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
            lines.append(f"Path({block.file!r}).write_text({block.text!r}, encoding='utf-8')  # {place}")
    return "\n".join(lines)


def run(command: list[str], folder: Path) -> None:
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(folder),
        "MPLBACKEND": "Agg",
        "HTTPS_PROXY": "http://127.0.0.1:9",  # no page needs the network where the records are at hand
    }
    ended = subprocess.run(
        command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300, check=False
    )
    assert ended.returncode == 0, (ended.stdout[-2000:] + ended.stderr[-4000:]).strip()


def needs_record(text: str) -> list[str]:
    """Names of the measured records that a text works on."""
    return [name for name in ("tx40", "emps") if re.search(rf"{name} {name}\b|record: {name}|record_of\(\"{name}|symgen demo", text)]


@pytest.mark.parametrize("page", [p for p in PAGES if any(b.kind != "yaml" for b in blocks(p))], ids=lambda p: p.stem)
def test_blocks_of_a_page_run(page: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    text = script(page)
    for name in needs_record(text):
        request.getfixturevalue(f"{name}_data")
    (tmp_path / "page").mkdir()
    (tmp_path / "page.py").write_text(text, encoding="utf-8")
    run([sys.executable, str(tmp_path / "page.py")], tmp_path / "page")


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda p: p.stem)
def test_examples_run(example: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    text = example.read_text(encoding="utf-8")
    assert text.count("\n") < 50
    for name in needs_record(text):
        request.getfixturevalue(f"{name}_data")
    run([sys.executable, str(example)], tmp_path)


def test_yaml_blocks_are_what_the_program_reads() -> None:
    for page in PAGES:
        for block in blocks(page):
            if block.kind == "yaml":
                try:
                    read(block.text, page.name)
                except Exception as e:
                    raise AssertionError(f"{page.name}, line {block.line}: {e}") from e


def read(text: str, name: str) -> None:
    """A robot file, some sections of one, a fleet, or a study."""
    keys = set(YAML(typ="safe", pure=True).load(text))
    if "jobs" in keys:
        settings_from_text(FleetSettings, text, file=name)
    elif "frames" in keys or keys <= set(RobotFile.model_fields) - {"symgen"}:
        sections = YAML(typ="safe", pure=True).load(text)
        RobotFile.model_validate({"symgen": 1, "name": "arm", "gravity": [0, 0, 0], "frames": {}} | sections)
    else:
        study_from_text(text, file=name)


def test_install_blocks_are_left_to_ci() -> None:
    assert [b for b in (m["text"] for m in FENCE.finditer(PAGES[0].read_text(encoding="utf-8"))) if b.startswith(BY_CI)]
