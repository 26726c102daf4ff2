"""A studio in this process for the server's own tests, and one as a command for those in a browser."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import Browser, started_browser
from hang import HANG
from starlette.testclient import TestClient

from symgen.cli.studio import PROGRAMS as TEXTS
from symgen.cli.studio import WATCHED
from symgen.studio import folder, server, serving
from symgen.studio.child import ViewProcess

PROGRAMS = {name: [sys.executable, "-P", "-c", WATCHED + text] for name, text in TEXTS.items()}
COMMAND = TEXTS["symgen"]
PATIENT = f"from symgen.studio import server; server.VIEW_PATIENCE = {HANG}; "  # on a busy machine
PORT = 8123
OWN = f"http://127.0.0.1:{PORT}"


class Studio:
    """A client that asks as the pages do: own Host, own Origin, the token."""

    def __init__(self, path: Path) -> None:
        self.server = server.Server(folder.WorkFolder(path), PROGRAMS, "a" * 22)
        self.app = serving.application(self.server, PORT, lambda: None)
        self.client = TestClient(self.app, base_url=OWN, raise_server_exceptions=False)
        self.path = path

    def get(self, name: str, **more: Any) -> Any:
        return self.client.get(f"/{self.server.token}/{name}", follow_redirects=False, **more)

    def post(self, name: str, form: dict[str, str] | None = None, **more: Any) -> Any:
        headers = {"origin": OWN} | more.pop("headers", {})
        return self.client.post(
            f"/{self.server.token}/do/{name}", data=form, headers=headers, **more
        )

    def upload(self, kind: str, name: str, content: bytes) -> Any:
        return self.post("upload", params={"kind": kind, "name": name}, content=content)


@pytest.fixture(scope="module")
def process() -> Iterator[ViewProcess]:
    """The process of views, one for all tests of a file."""
    own = ViewProcess()
    yield own
    own.end()


@pytest.fixture
def studio(
    tmp_path: Path, process: ViewProcess, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Studio]:
    monkeypatch.setattr(server, "VIEW_PATIENCE", HANG)
    own = Studio(tmp_path / "work")
    own.server.process = own.server.deriving = process
    with own.client:
        yield own
        own.server.process, own.server.deriving = ViewProcess(), ViewProcess()


@pytest.fixture(scope="module")
def page() -> Iterator[Browser]:
    with started_browser() as browser:
        yield browser


class Running:
    """`symgen studio` as a process."""

    def __init__(self, *arguments: str, work: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", PATIENT + COMMAND, "studio", *arguments, "-o", str(work), "--no-browser"],
            stderr=subprocess.PIPE, text=True, env={**os.environ},
        )  # fmt: skip
        line = self.process.stderr.readline()  # type: ignore[union-attr]
        found = re.search(r"(http://127\.0\.0\.1:\d+/[\w-]+/)robot", line)
        assert found, line
        self.address, self.work = found[1], work

    def end(self, number: int = signal.SIGINT) -> int:
        self.process.send_signal(number)
        return self.process.wait(HANG)


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Callable[..., Running]]:
    started: list[Running] = []

    def start(*arguments: str, work: Path | None = None) -> Running:
        started.append(Running(*arguments, work=work or tmp_path / "work"))
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            one.end(signal.SIGKILL)
