"""Headless Chromium for tests, driven by its DevTools protocol over a pipe: the standard library
only, no driver, no network port.

A page's uncaught errors, console errors, refused policies and requests are collected in
`complaints` and `requests`.
"""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest
from hang import HANG

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--mute-audio", "--remote-debugging-pipe",
)  # fmt: skip
PIPES = (  # Chromium reads commands on descriptor 3 and writes answers on 4
    "import fcntl, os, sys; r, w = (fcntl.fcntl(int(n), fcntl.F_DUPFD, 64) for n in "
    "sys.argv[1:3]); "
    "os.dup2(r, 3); os.dup2(w, 4); os.execvp(sys.argv[3], sys.argv[3:])"
)

FRAME = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"

WEAK_CONTRAST = """(() => {
  const rgb = (c) => c.match(/[\\d.]+/g).map(Number);
  const light = (c) => { const [r, g, b] = c.map((v) => v / 255).map((v) => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const ground = (n) => { for (; n; n = n.parentElement) { const c = rgb(getComputedStyle(n).backgroundColor); if (c[3] !== 0) return c.slice(0, 3); }
    return [255, 255, 255]; };
  return [...document.querySelectorAll('body *')].filter((n) => n.tagName !== 'SCRIPT' && [...n.childNodes].some((t) => t.nodeType === 3 && t.textContent.trim()))
    .map((n) => { const style = getComputedStyle(n), svg = n.closest('svg'); const a = light(rgb(svg ? style.fill : style.color).slice(0, 3)), b = light(ground(n));
      return [n.textContent.slice(0, 30), (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05)]; }).filter(([, ratio]) => ratio < 4.5);
})()"""  # texts with less than 4.5 to 1 (WCAG 2 AA) on their own background, as computed by the browser


class BrowserError(Exception):
    """There is no browser, or it does not do what it is told."""


def find_browser() -> str:
    """Path of a Chromium on this machine. Raises BrowserError."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        raise BrowserError(f"none of {', '.join(NAMES)} is on PATH")
    return found


def started_browser() -> Browser:
    """A browser; without one the test is skipped, or fails where SYMGEN_REQUIRE_BROWSER=1 says that
    it must run.
    """
    try:
        return Browser(find_browser())
    except BrowserError as e:
        if os.environ.get("SYMGEN_REQUIRE_BROWSER") == "1":
            pytest.fail(f"SYMGEN_REQUIRE_BROWSER=1 but {e}")
        pytest.skip(f"{e}; install chromium to run the tests in a browser")


class Browser:
    """One Chromium with one page. A context manager; `timeout` in seconds holds for each step."""

    def __init__(self, executable: str, *, timeout: float = HANG) -> None:
        self.timeout = timeout
        self.profile = tempfile.TemporaryDirectory(prefix="chromium-", ignore_cleanup_errors=True)
        commands, self._send = os.pipe()
        self._receive, answers = os.pipe()
        self.process = subprocess.Popen(
            [sys.executable, "-c", PIPES, str(commands), str(answers), executable, *FLAGS, f"--user-data-dir={self.profile.name}", "about:blank"],
            pass_fds=(commands, answers), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(commands)
        os.close(answers)
        self._buffer, self._id, self._session = b"", 0, ""
        self.events: list[dict[str, Any]] = []
        try:
            self._attach()
        except BrowserError:
            self.__exit__()
            raise

    def _attach(self) -> None:
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)[
            "sessionId"
        ]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._send)
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        os.close(self._receive)
        self.profile.cleanup()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and wait for its answer; events on the way are kept."""
        self._id += 1
        message = {"id": self._id, "method": method, "params": parameters} | (
            {"sessionId": self._session} if self._session else {}
        )
        try:
            os.write(self._send, json.dumps(message).encode() + b"\0")
        except BrokenPipeError as e:
            raise BrowserError("the browser ended") from e
        while True:
            answer = self._next()
            if answer.get("id") == self._id:
                if "error" in answer:
                    raise BrowserError(f"{method}: {answer['error']}")
                return answer["result"]
            self.events.append(answer)

    def _next(self) -> dict[str, Any]:
        end = time.monotonic() + self.timeout
        while b"\0" not in self._buffer:
            if not select.select([self._receive], [], [], max(0.0, end - time.monotonic()))[0]:
                raise BrowserError(f"the browser said nothing for {self.timeout} s")
            part = os.read(self._receive, 1 << 20)
            if not part:
                raise BrowserError("the browser ended")
            self._buffer += part
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)

    def open(self, path: Path, width: int = 1280, height: int = 800) -> None:
        """Show a file in a window of that size; returns when it has loaded."""
        self.resize(width, height)
        self.events.clear()
        self.call("Page.navigate", url=path.resolve().as_uri())
        while not any(e.get("method") == "Page.loadEventFired" for e in self.events):
            self.events.append(self._next())

    def resize(self, width: int, height: int) -> None:
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )

    def run(self, script: str) -> Any:
        """Value of a JavaScript expression, as JSON."""
        result = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in result:
            raise BrowserError(result["exceptionDetails"])
        return result["result"].get("value")

    def centre(self, selector: str) -> tuple[float, float]:
        """Middle of an element, scrolled into view and drawn there: a finger meets what was drawn
        last.
        """
        self.run(
            f"document.querySelector({json.dumps(selector)}).scrollIntoView({{block: 'center', "
            f"behavior: 'instant'}})"
        )
        self.run(FRAME)
        box = f"document.querySelector({json.dumps(selector)}).getBoundingClientRect()"
        return tuple(
            self.run(
                f"(() => {{ const b = {box}; return [b.x + b.width / 2, b.y + b.height / 2]; }})()"
            )
        )

    def hover(self, selector: str) -> None:
        x, y = self.centre(selector)
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def drag(self, selector: str, dx: float, dy: float) -> None:
        x, y = self.centre(selector)
        self.call(
            "Input.dispatchMouseEvent",
            type="mousePressed",
            x=x,
            y=y,
            button="left",
            buttons=1,
            clickCount=1,
        )
        self.call(
            "Input.dispatchMouseEvent",
            type="mouseMoved",
            x=x + dx,
            y=y + dy,
            button="left",
            buttons=1,
        )
        self.call(
            "Input.dispatchMouseEvent",
            type="mouseReleased",
            x=x + dx,
            y=y + dy,
            button="left",
            clickCount=1,
        )

    def click(self, selector: str) -> None:
        x, y = self.centre(selector)
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press(self, key: str) -> None:
        """A key to whatever has the focus."""
        codes = {
            "Tab": 9,
            "End": 35,
            "Home": 36,
            "ArrowLeft": 37,
            "ArrowUp": 38,
            "ArrowRight": 39,
            "ArrowDown": 40,
            "Escape": 27,
            "Enter": 13,
        }
        text = {"text": key} if len(key) == 1 else {"text": "\r"} if key == "Enter" else {}
        self.call(
            "Input.dispatchKeyEvent",
            type="keyDown",
            key=key,
            windowsVirtualKeyCode=codes.get(key, ord(key[0])),
            **text,
        )
        self.call(
            "Input.dispatchKeyEvent",
            type="keyUp",
            key=key,
            windowsVirtualKeyCode=codes.get(key, ord(key[0])),
        )

    def screenshot(self, *, whole: bool = False) -> bytes:
        """PNG of the window, or of the whole page."""
        return base64.b64decode(
            self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        )

    @property
    def complaints(self) -> list[str]:
        """Uncaught errors, console errors and warnings, entries of the log."""
        self.run("0")
        found = []
        for e in self.events:
            method, p = e.get("method"), e.get("params", {})
            if method == "Runtime.exceptionThrown":
                found.append(json.dumps(p["exceptionDetails"]))
            elif method == "Log.entryAdded" and p["entry"]["level"] in ("error", "warning"):
                found.append(f"{p['entry']['text']} {p['entry'].get('url', '')}".strip())
            elif method == "Runtime.consoleAPICalled" and p["type"] in (
                "error",
                "warning",
                "assert",
            ):
                found.append(json.dumps(p["args"]))
        return found

    @property
    def requests(self) -> list[str]:
        """Addresses that the page asked for."""
        return [
            e["params"]["request"]["url"]
            for e in self.events
            if e.get("method") == "Network.requestWillBeSent"
        ]
