"""What goes wrong while one works, in a browser: each is told where one looks, and nothing is lost."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from browser import Browser
from test_browser import URDF, go, record, until

pytestmark = pytest.mark.campaign


def lever(folder: Path, **more: Any) -> tuple[str, str]:
    """A robot of two joints and a study of its record, as arguments of the command line."""
    (folder / "lever.urdf").write_text(URDF)
    names = record(folder / "run.csv").read_text().partition("\n")[0].split(",")
    columns = {"t": names[0], "q": names[1:3], "tau": names[3:]}
    settings = {"files": ["run.csv"], "columns": columns, "units": {"q": "deg"}, "side": "joint"}
    (folder / "study.yaml").write_text(json.dumps({"symgen": 1, "record": settings | more}))
    return str(folder / "lever.urdf"), str(folder / "study.yaml")


def test_a_check_that_fails_says_why(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Where it refuses its input, and where it breaks (exit code 1, as a verdict of no)."""
    studio = running(*lever(tmp_path, columns={"q": ["no", "such"], "tau": ["no", "such"]}))
    alert = "document.querySelector('#findings [role=alert]')?.textContent"
    go(page, studio.address + "check")
    page.click("#findings button.main")
    assert "no such" in until(page, alert, 30) or "column" in page.run(alert)
    studio.end()
    again = running(*lever(tmp_path))
    (again.work / "check.json").mkdir()
    go(page, again.address + "check")
    page.click("#findings button.main")
    assert "check.json" in until(page, alert, 30)
