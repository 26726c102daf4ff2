"""Shared state of all requests of the studio: work folder, command queue and view processes.

The module needs the extra: pip install symgen[studio].
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from starlette.responses import HTMLResponse, Response

from symgen.studio import child, views
from symgen.studio.folder import DRAFT, WorkFolder
from symgen.studio.jobs import Jobs
from symgen.studio.words import on_page

VIEW_PATIENCE = 60.0  # s that a page waits for a view
REMEMBERED = 30  # views
LARGE = ("preview", "series")  # have all samples: the last of each is remembered
DERIVING = (views.formulas, views.model, views.module)  # pages do not wait for these
PAGE_TEMPLATES = Environment(
    loader=ChoiceLoader(
        [PackageLoader("symgen.studio", "templates"), PackageLoader("symgen.pages", "")]
    ),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
PAGE_TEMPLATES.filters["on_page"] = on_page


class Server:
    """Shared state of all requests of the studio: work folder, command queue and computed data.

    Parameters
    ----------
    folder : WorkFolder
    programs : dict of str to list of str
        As for `Jobs`.
    token : str
        The secret at the start of every path.
    """

    def __init__(self, folder: WorkFolder, programs: dict[str, list[str]], token: str) -> None:
        self.folder, self.token = folder, token
        self.jobs = Jobs(folder.path, programs, self.changed)
        self.version, self.pages = 0, 0
        self.before, self.left_out = "", list[str]()
        self.news = asyncio.Event()
        self.process, self.deriving = child.ViewProcess(), child.ViewProcess()
        self.viewing = asyncio.Lock(), asyncio.Lock()
        self.views: dict[Any, dict[str, Any]] = {}

    def changed(self) -> None:
        """Notify every open page that the work folder or the command queue has changed."""
        self.version += 1
        self.news.set()
        self.news = asyncio.Event()

    async def view(self, view: Callable[..., dict[str, Any]], *args: Any) -> dict[str, Any]:
        """Compute data that a page shows about a file (a view), in a child process.

        If robot, file and arguments are the same as before, the stored value is returned. A view
        that takes too long ends its process and gives an error. Views that derive models have a
        process of their own, so that pages do not wait for them.
        """
        file = Path(args[0])
        written = file.stat().st_mtime_ns if file.exists() else 0
        key = (view.__name__, self.folder.digest, written, str(args))
        derives = view in DERIVING
        process = self.deriving if derives else self.process
        async with self.viewing[derives]:
            if key in self.views:
                return self.views[key]
            try:
                future = asyncio.wrap_future(process.submit(view, *args))
                value: dict[str, Any] = await asyncio.wait_for(future, VIEW_PATIENCE)
            except (TimeoutError, BrokenProcessPool):
                await asyncio.to_thread(process.end)
                return {
                    "error": f"takes more than {VIEW_PATIENCE:g} s, or than the memory that there "
                    "is; the terminal has no such limit"
                }
            large = [own for own in self.views if own[0] == view.__name__ in LARGE]
            others = [*self.views][: max(len(self.views) - REMEMBERED + 1, 0)]
            for old in {*large, *others}:
                del self.views[old]
            self.views[key] = value
            return value

    async def robot(self) -> dict[str, Any]:
        """Return the data that pages show of the robot file, or of its draft."""
        path, draft = self.folder.robot, self.folder.read(DRAFT)
        if path is None and not draft:
            return {}
        shown = await self.view(views.robot, str(path), draft)
        if draft and path is not None and "figure" not in shown:  # the last whole robot is drawn
            last = await self.view(views.robot, str(path), "")
            shown = shown | ({"figure": last["figure"]} if "figure" in last else {})
        own = "" if path is None or path.suffix != ".yaml" else self.folder.read(path.name)
        return {**shown, "text": draft or own or shown.get("text", "")}


def page(name: str, status: int = 200, **context: Any) -> Response:
    """Render an HTML template as the answer to a request; inserted texts are escaped."""
    text = PAGE_TEMPLATES.get_template(f"{name}.html.jinja").render(step=name, **context)
    return HTMLResponse(text, status)
