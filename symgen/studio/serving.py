"""Run the studio server: its application, its events and its end (pip install symgen[studio])."""

from __future__ import annotations

import asyncio
import json
import os
import re
import secrets
import socket
import webbrowser
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from importlib.resources import files
from pathlib import Path

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from symgen.studio.folder import WorkFolder, json_of
from symgen.studio.guard import Guard
from symgen.studio.pages import Pages
from symgen.studio.server import Server

ADDRESS = ".address.json"  # port and token of the last server, which bookmarks name
IDLE_TIME = 600.0  # s without a page after which the server ends
PULSE = 0.25  # s between two events of one page


def application(server: Server, port: int, end: Callable[[], None]) -> Guard:
    """Build the web application of the studio, with a secret token at the start of every path.

    The function `end` is called when no page has been open and no command has run for ten minutes
    (`IDLE_TIME`).
    """

    async def events(request: Request) -> Response:
        return StreamingResponse(told(server), media_type="text/event-stream")

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        tasks = [asyncio.create_task(work) for work in (server.jobs.work(), idle(server, end))]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            server.process.end()
            server.deriving.end()

    mounts = [
        Mount(f"/{name}", StaticFiles(directory=str(files("symgen").joinpath(place))))
        for name, place in {"static": "studio/static", "pages": "pages"}.items()
    ]

    async def chart(request: Request) -> Response:
        name = Path(request.url.path).name
        return FileResponse(str(files("runtime").joinpath("reporting", name)))

    inner = [
        Route("/events", events),
        *(Route(f"/{name}", chart) for name in ("chart.js", "chart.css")),
        *mounts,
        *Pages(server).routes(),
    ]
    app = Starlette(routes=[Mount(f"/{server.token}", routes=inner)], lifespan=lifespan)
    hosts = {f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]")}
    return Guard(app, server.token, hosts)


async def told(server: Server) -> AsyncIterator[str]:
    """Yield the events for one open page: version number and hash of the robot, after each change.

    An event is also sent after about 15 s without a change.
    """
    server.pages += 1
    try:
        while True:
            news, state = server.news, {"version": server.version, "robot": server.folder.digest}
            yield f"data: {json.dumps(state)}\n\n"
            with suppress(TimeoutError):  # news that came while it was sent counts
                await asyncio.wait_for(news.wait(), 15)
            await asyncio.sleep(PULSE)
    finally:
        server.pages -= 1


async def idle(server: Server, end: Callable[[], None]) -> None:
    """Call `end` when no page has been open, and no command has run, for IDLE_TIME seconds."""
    quiet, pause = 0.0, IDLE_TIME / 200
    while quiet < IDLE_TIME:
        await asyncio.sleep(pause)
        busy = server.pages or any(job.open for job in server.jobs.all)
        quiet = 0.0 if busy else quiet + pause
    end()


def listening_at(folder: Path, port: int, *, renew: bool) -> tuple[str, socket.socket]:
    """Return token and open port for the server of a work folder, the same as for its last server.

    Both are stored in a file that only its owner can read; a file that others can read is not used.
    If another program uses the port, a free port is used this time.
    """
    path = folder / ADDRESS
    owned = path.is_file() and (os.name == "nt" or not path.stat().st_mode & 0o077)
    kept = {} if renew or not owned else json_of(path)
    token, last = str(kept.get("token", "")), kept.get("port")
    if not re.fullmatch(r"[\w-]{22,}", token):
        token, last = secrets.token_urlsafe(16), None
    wanted = port or (last if isinstance(last, int) and 0 < last < 2**16 else 0)
    try:
        listening = socket.create_server(("127.0.0.1", wanted))
    except OSError:
        if port:
            raise
        listening = socket.create_server(("127.0.0.1", 0))
    own = listening.getsockname()[1]
    borrowed = bool(last) and own not in (last, port)  # the port of the file is another server's
    if not borrowed:
        path.unlink(missing_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            json.dump({"port": own, "token": token}, file)
    return token, listening


def serve(
    folder: Path,
    programs: dict[str, list[str]],
    say: Callable[[str], None],
    *,
    robot: str | None = None,
    record: str | None = None,
    port: int = 0,
    browser: bool = True,
    renew: bool = False,
) -> None:
    """Serve the page of a work folder until Ctrl-C, or until `idle` ends it.

    port : 0 for the port of the last server of the folder, or for a free port.
    renew : whether to use another port and token than the last server, so that old bookmarks do not
      work.

    Raises InputError or SymgenError if robot or record cannot be used.
    """
    work = WorkFolder(folder)
    if robot is not None:
        work.take_robot_of(robot)
    if record is not None:
        work.take_record_of(record)
    token, listening = listening_at(work.path, port, renew=renew)
    port = listening.getsockname()[1]
    server = Server(work, programs, token)
    server.process.start()
    own: list[uvicorn.Server] = []
    app = application(server, port, lambda: setattr(own[0], "should_exit", True))
    config = uvicorn.Config(
        app,
        timeout_graceful_shutdown=2,
        log_level="critical",
        access_log=False,
        server_header=False,
        ws="none",
    )
    own.append(uvicorn.Server(config))
    address = f"http://127.0.0.1:{port}/{server.token}/robot"
    say(f"symgen studio: {address}\nwork folder: {work.path}\nCtrl-C ends it.")
    if browser:
        webbrowser.open(address)
    own[0].run(sockets=[listening])
