"""Handlers of the studio pages Robot, Record, Check, Solve and Results.

Each handler changes files of the work folder, or queues a command, and answers with a page or a
part of a page (pip install symgen[studio]).
"""

from __future__ import annotations

import json
import re
import secrets
import shlex
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from runtime.ground.errors import InputError, SettingsError
from runtime.reading.datasets import DATASETS
from runtime.reading.formats import file_extensions
from symgen.derive.models import SYMBOLIC
from symgen.description import packaged_robots
from symgen.description.files import TREES, content_of
from symgen.description.yaml import skeleton
from symgen.emit.targets import TARGETS
from symgen.errors import SymgenError
from symgen.studio import table, views
from symgen.studio.folder import DRAFT, LOOPS, json_of, measured_name, remove, robot_file
from symgen.studio.server import Server, page

PAGE_STEPS = ("robot", "record", "check", "solve", "results")
PAGE_PARTS = ("table", "certificate", "study", "findings", "jobs", "applied")
SANDBOX = "sandbox allow-scripts allow-downloads allow-popups"
SHOWN_FILES = {".html": "text/html", ".png": "image/png", ".svg": "image/svg+xml"}
VIEWS = ("formulas", "model", "module", "preview", "recorded", "series", "changes")
RUN_COMMANDS = {  # what each writes, its verb and options
    "identify": ("estimate.json", "identify"),
    "cestac": ("cestac.json", "cestac"),
    "advise": ("advice.json", "cestac", "--advise"),
}
MOST_FIELDS = 100  # of a form
Handler = Callable[[Any], Awaitable[Any]]
ESTIMATORS = {
    "ols": "ordinary least squares",
    "wls": "least squares, weighted by joint",
    "irls": "weighted, outliers count less",
    "iv": "instrumental variables, needs the controller",
    "didim": "simulated closed loop, torques; needs the controller",
    "feasible": "masses and inertias that bodies can have",
}


class Pages:
    """The request handlers of one studio server.

    Handlers of GET answer with a page. Handlers of POST change data and return the name of the part
    of the page to show again, the name of another page, or "" for the whole page.
    """

    def __init__(self, server: Server) -> None:
        self.server, self.folder, self.jobs = server, server.folder, server.jobs

    def routes(self) -> list[Route]:
        """Return the URL routes of all pages; routes under /do/ accept POST only."""
        gets = {
            "/{name}": self._show,
            "/view/{name}": self._view,
            "/file/{name}": self._file,
            "/runs/{run}/{name}": self._file,
            "/do/upload": self._upload,
        }
        acts: tuple[Handler, ...] = (
            *(self._packaged, self._edit, self._undo, self._prove, self._study, self._check),
            *(self._solve, self._cancel, self._dismiss, self._apply, self._earlier_record),
            *(self._repair, self._unrepair),
        )
        posts = {f"/do/{act.__name__[1:]}": self._posted(act) for act in acts}
        return [
            Route(path, answering(handler), methods=["POST" if "/do/" in path else "GET"])
            for path, handler in (gets | posts).items()
        ]

    def _posted(self, act: Handler) -> Handler:
        async def posted(request: Request) -> Response:
            fields = parse_qsl(
                (await request.body()).decode("utf-8", "replace"),
                keep_blank_values=True,
                max_num_fields=MOST_FIELDS,
            )
            form = dict(fields)
            return await self._changed(await act(form), form.get("run"))

        return posted

    async def _changed(self, name: str, run: str | None = None) -> Response:
        self.server.changed()
        if name in PAGE_STEPS:
            return PlainTextResponse("", headers={"hx-redirect": name})
        if name:
            return await self._part(name, run)
        self.server.before, self.server.left_out = "", []
        return PlainTextResponse("taken", headers={"hx-refresh": "true"})

    async def _show(self, request: Request) -> Response:
        name = request.path_params["name"]
        if name not in (*PAGE_STEPS, *PAGE_PARTS):
            raise InputError("no such page")
        return await self._part(name, request.query_params.get("run"))

    async def _part(self, name: str, asked: str | None = None) -> Response:
        """Render a page or a part of a page from the present state of the work folder.

        Data that `_view` computes are not included.
        """
        folder, version, shown = self.folder, self.server.version, await self.server.robot()
        runs = [folder.about(run) for run in folder.results()]
        findings = json_of(folder.path / "check.json")
        own = folder.first(TREES)
        run = next((r for r in runs if r["name"] == asked), runs[-1] if runs else None)
        cells, values, wrong = None, {}, ""
        robot_of = folder.robot_of(run["name"]) if name == "results" and run else None
        changed = robot_of is not None and folder.digest != views.digest_of(robot_of)
        if changed:  # drawing and figures of the run
            shown = await self.server.view(views.robot, str(robot_of), "")
        try:
            cells, values = table.cells_of(shown.get("text", "")), folder.study()
        except InputError as e:
            wrong = str(e)
        cells = cells if shown.get("text") else None
        place = ".".join(shown.get("path", [])[:3])
        alone = [{"text": shown["error"], "place": place}] if "error" in shown else []
        told = shown.get("errors", alone)
        return page(
            name,
            steps=PAGE_STEPS,
            version=version,
            shown=shown,
            told=[(e["text"], e["place"]) for e in told if table.beside(e["place"], cells)],
            above=[e["text"] for e in told if not table.beside(e["place"], cells)],
            cells=cells,
            columns=table.columns_of(cells) if cells else [],
            units=table.UNITS_OF_CELLS,
            meanings=table.MEANINGS,
            left_out=self.server.left_out,
            digest=folder.digest,
            work=shlex.quote(str(folder.path)),
            undo=bool(folder.kept("robot")),
            redo=bool(folder.kept("undone")),
            file=folder.robot.name if folder.robot else "",
            packaged=packaged_robots(),
            models=sorted(SYMBOLIC),
            targets=list(TARGETS),
            proof=self._proof(),
            record=folder.measured("record"),
            validation=folder.measured("validation"),
            study=folder.read("study.yaml"),
            study_digest=folder.study_digest,
            values=values,
            wrong=wrong,
            findings=findings,
            stale=not self._is_checked(),
            checked=self.jobs.last("check of the record"),
            repair=self._repaired(),
            repairing=self.jobs.last("repair"),
            methods=ESTIMATORS,
            jobs=self.jobs.shown,
            now=time.monotonic(),
            left=self.jobs.left,
            times=self.jobs.times,
            runs=runs,
            run=run,
            own=own.name if own else "",
            changed=changed,
            record_before=folder.record_before,
            applied=self.jobs.last(f"apply {run['name']}") if run else None,
        )

    def _proof(self) -> dict[str, Any]:
        """Return the certificate of the robot's formulas and its state, such as valid.

        The state is none, stale, running, failed, valid, invalid or draft.
        """
        claim, job = json_of(self.folder.path / "proof.json"), self.jobs.last("certificate")
        state = "valid" if claim.get("valid") else "invalid"
        if claim.get("source_sha256") != self.folder.digest:
            state = "stale" if claim else "none"
            if job is not None and (job.open or job.state == "failed"):
                state = "running" if job.open else "failed"
        draft = bool(self.folder.read(DRAFT))
        return {**claim, "state": "draft" if draft else state, "error": job.last if job else ""}

    def _source(self) -> Path:
        if self.folder.robot is None or self.folder.read(DRAFT):
            raise InputError(
                "the table describes no robot yet; complete the table on the page Robot"
            )
        return self.folder.robot

    def _is_checked(self) -> bool:
        """Whether check.json holds the findings for the present robot and study."""
        now = views.digest_of(self.folder.robot or Path(), self.folder.path / "study.yaml")
        return bool(json_of(self.folder.path / "check.json").get("of") == now)

    async def _view(self, request: Request) -> Response:
        """Answer a request with data computed from the robot, record or run, as HTML or JSON."""
        name, asked = request.path_params["name"], dict(request.query_params)
        if name == "formulas" and self.folder.read(DRAFT):  # those of the last robot stay
            return PlainTextResponse("", headers={"hx-reswap": "none"})
        record = self.folder.measured("record")
        if name not in VIEWS or (name == "preview" and not record):
            raise InputError("no such view")
        given: Any = self.server.before if name == "formulas" else asked
        if name == "preview":
            path = self.folder.path / record
            shown = await self.server.robot()
            (settings, *_) = self.folder.study().get("record") or [{}]
            n, labels = len(shown.get("joints", ())), tuple(filter(None, shown.get("labels", ())))
            joints = labels if len(labels) == n else ("",) * n
            given = asked | {"joints": joints, "topic": settings.get("topic")}
        elif name in ("series", "changes"):
            run = self.folder.run(asked.get("run", ""))
            path = self.folder.robot_of(run.name) or self._source()
            given = {"run": str(run), "record": asked.get("record", "")}
        else:
            path = self._source()
        if name == "recorded":
            study = str(self.folder.path / "study.yaml")
            given = {"study": study, "of": self.folder.study_digest}
        value = await self.server.view(getattr(views, name), str(path), given)
        if name in ("preview", "recorded", "series", "changes"):
            return JSONResponse(value)
        return page(
            name, value=value, asked=asked, file=path.name, work=shlex.quote(str(self.folder.path))
        )

    async def _file(self, request: Request) -> Response:
        """Answer with a file of the work folder or of one run; HTML pages open in a sandbox."""
        name, run = request.path_params["name"], request.path_params.get("run")
        folder, robot = self.folder, self.folder.robot or Path()
        own = [folder.path / "study.yaml", *folder.path.glob("applied-*.*"), robot]
        own += [folder.path / "proof.json"]
        places = folder.run(run).iterdir() if run else own
        path = next((p for p in places if p.name == name and p.is_file()), None)
        if path is None:
            raise InputError("no such file")
        kind = SHOWN_FILES.get(path.suffix) if run and "keep" not in request.query_params else None
        kind = "text/plain" if "read" in request.query_params else kind
        keep = safe(f"{(await self.server.robot()).get('name')}_{path.name}")
        attached = {"content-disposition": f'attachment; filename="{keep}"'}
        headers = {"content-security-policy": SANDBOX} | ({} if kind else attached)
        return FileResponse(path, media_type=kind or "application/octet-stream", headers=headers)

    async def _upload(self, request: Request) -> Response:
        """Receive a file from the browser: a robot, a record or a validation record.

        The address has the kind and the original name of the file, the body has its content. A
        robot is read for errors before it replaces the present robot.
        """
        kind, name = (request.query_params.get(key, "") for key in ("kind", "name"))
        if kind not in ("robot", "record", "validation"):
            raise InputError("expected a robot, a record or a validation record")
        folder = self.folder.path / f"{secrets.token_hex(8)}.part"
        part = folder / (robot_file(name) if kind == "robot" else measured_name(name) or kind)
        folder.mkdir()
        try:
            with part.open("xb") as file:
                async for piece in request.stream():
                    file.write(piece)
            if kind != "robot":
                await self._readable(part)
                self.folder.take_measured(kind, name, part)
            else:
                await self._take_robot(name, part)
        finally:
            remove(folder)
        if kind == "validation":  # the page stays
            self.server.changed()
            return PlainTextResponse(self.folder.measured(kind))
        return await self._changed("")

    async def _take_robot(self, name: str, part: Path) -> None:
        """A robot, or the loops of the robot that is there, beside a copy of its own file."""
        robot, loops = part, part.name == LOOPS
        if loops:
            if (own := self.folder.first(TREES)) is None:
                raise InputError(
                    f"{name[:80]}: loops belong to a URDF or MJCF file; drop that first"
                )
            robot = part.with_name(own.name)
            robot.write_bytes(own.read_bytes())
        shown = await self.server.view(views.robot, str(robot), "")
        if "error" in shown:
            raise InputError(f"{name[:80]}: {shown['error']}")
        if loops:
            self.folder.take_loops(content_of(part), shown["text"])
        else:
            self.folder.take_robot(name, content_of(part))

    async def _readable(self, part: Path) -> None:
        """Refuse a file that is no table, before it replaces one; which topic of a bag counts is asked later."""
        if not part.name.lower().removesuffix(".gz").endswith(file_extensions(packed=True)):
            return
        value = await self.server.view(views.preview, str(part), {"topic": None, "joints": ()})
        if "error" in value:
            raise InputError(f"{part.name[:80]}: {value['error']}; the earlier record stays in use")

    async def _earlier_record(self, form: dict[str, str]) -> str:
        self.folder.exchange_record()
        return ""

    async def _packaged(self, form: dict[str, str]) -> str:
        name = form.get("name", "")
        if name == "new":
            self.folder.take_robot("arm.yaml", skeleton("arm").encode())
        elif name in packaged_robots():
            self.folder.take_robot_of(name)
            if form.get("record") in DATASETS and not self.folder.read("study.yaml"):
                self.folder.take_record_of(form["record"])
                return "record"
        return ""

    async def _edit(self, form: dict[str, str]) -> str:
        """Change the robot by an edit of its table, given as cells or as a text."""
        text = (await self.server.robot()).get("text", "")
        self._of_this_robot(form)
        if not self.folder.read(DRAFT):
            self.server.before = text
        text = form["text"].replace("\r\n", "\n") if "text" in form else text
        text = table.with_cells(text, form["cells"]) if "cells" in form else text
        text, self.server.left_out = table.fitted(text) if "resized" in form else (text, [])
        self.folder.edit_robot(text, draft=table.wrong(text) is not None)
        return "table"

    async def _undo(self, form: dict[str, str]) -> str:
        """Restore the robot before the last change; with `redo`, the robot before the last undo."""
        self._of_this_robot(form)
        self.folder.bring_back(*(("undone", "robot") if "redo" in form else ()))
        self.server.before, self.server.left_out = "", []
        return "table"

    def _of_this_robot(self, form: dict[str, str]) -> None:
        if form.get("digest") != self.folder.digest:
            raise InputError("another page has changed the robot; reload this page")

    async def _prove(self, form: dict[str, str]) -> str:
        # The page asks by itself; the draft may be newer than its question.
        if self.folder.read(DRAFT):
            return "certificate"
        self.jobs.add(
            "certificate",
            ("symgen", "check", self._source().name, "--certificate", "proof.json"),
            "proof.json",
        )
        return "certificate"

    async def _study(self, form: dict[str, str]) -> str:
        """Replace the content of study.yaml by the text, or the values in JSON, of a web form."""
        if form.get("digest", "") != self.folder.study_digest:
            raise InputError("another page has changed the study; reload this page")
        text = form.get("text", "").replace("\r\n", "\n")
        values = json.loads(form["values"]) if "values" in form else text
        self.folder.write("study.yaml", self.folder.checked_study(values))
        return "study"

    def _command(self) -> tuple[str, str]:
        """Return the names of the robot file and of the study file, for a command line."""
        if not self.folder.read("study.yaml"):
            raise InputError("there is no study yet; answer the questions on the page Record first")
        return self._source().name, "study.yaml"

    async def _check(self, form: dict[str, str]) -> str:
        self._of_the_study("check of the record", "check")
        return "findings"

    async def _repair(self, form: dict[str, str]) -> str:
        self._of_the_study("repair", "repair", "--repair", "repaired.yaml")
        return "findings"

    def _of_the_study(self, title: str, program: str, *options: str) -> None:
        """Queue a program of the studio that reads robot and study, and writes a file named after
        the program.
        """
        robot, study = self._command()
        terminal = shlex.join(("symgen", "identify", robot, study, *options))
        result = f"{program}.json"
        self.jobs.add(title, (program, robot, study, result), result, terminal=terminal)

    def _repaired(self) -> dict[str, Any]:
        """Return the changes that the last repair has made or tried; {} if robot or study have
        changed since.
        """
        told = json_of(self.folder.path / "repair.json")
        now = views.digest_of(self.folder.robot or Path(), self.folder.path / "study.yaml")
        return told if told.get("of") == now else {}

    async def _unrepair(self, form: dict[str, str]) -> str:
        """Write the study before the last repair again."""
        if not (told := self._repaired()).get("kept"):
            raise InputError("the study has been changed since the repair; edit it on Record")
        self.folder.write("study.yaml", told["before"])
        return "findings"

    async def _solve(self, form: dict[str, str]) -> str:
        """Queue a run: an identification, or a study of the encoder resolution.

        The settings are those of the study, values of a form in JSON, or those of the run `again`. The command line is the
        first line of the settings file of the run.
        """
        self._command()
        if "anyway" not in form and not self._is_checked():
            raise InputError("check record, study and robot first, or solve anyway")
        kind = form.get("kind", "identify")
        if kind not in RUN_COMMANDS:
            raise InputError(f"expected one of {', '.join(RUN_COMMANDS)}")
        values = json.loads(form.get("values", "{}")) or self.folder.study()
        if "again" in form:  # the study of a run, with other runs at each step
            values = self.folder.study(f"study-{self.folder.run(form['again']).name}.yaml")
            values["cestac"] = {**(values.get("cestac") or {}), "runs": int(form.get("runs", ""))}
        text = self.folder.checked_study(values)
        options = [f"--{name}" for name in ("physical", "friction") if form.get(name)] + [
            f"--delta={' '.join(part.split())[:60]}"
            for part in form.get("delta", "").split(",")
            if part.strip()
        ]
        taken = [job.run for job in self.jobs.all] + [p.name for p in self.folder.results()]
        number = max((int(run[:2]) for run in taken if run[:2].isdigit()), default=0) + 1
        run = f"{number:02d}-{safe(form.get('name', '') or kind)}"
        result, verb, *own = RUN_COMMANDS[kind]
        robot = f"robot-{run}{self._source().suffix}"  # a run keeps its own
        words = ("symgen", verb, robot, f"study-{run}.yaml", *own, *options, "-o", f"runs/{run}")
        self.jobs.add(run, words, f"runs/{run}/{result}", run=run)
        self.folder.write(robot, self._source().read_bytes())
        self.folder.write(f"study-{run}.yaml", f"# {shlex.join(words)}\n{text}")
        return "jobs"

    async def _cancel(self, form: dict[str, str]) -> str:
        for job in (job for job in self.jobs.all if str(job.number) == form.get("number")):
            self.jobs.cancel(job)
        return "jobs"

    async def _dismiss(self, form: dict[str, str]) -> str:
        for job in (job for job in self.jobs.all if str(job.number) == form.get("number")):
            job.dismissed = True
        return "jobs"

    async def _apply(self, form: dict[str, str]) -> str:
        """Queue the command that writes identified values into the user's URDF or MJCF.

        It writes a new file and shows the changed lines.
        """
        run = self.folder.run(form.get("run", ""))
        own, robot = self.folder.first(TREES), self._source()
        if own is None:
            raise InputError(
                "the robot was not read from a URDF or MJCF file; drop your file on the page Robot"
            )
        target = f"applied-{run.name}{own.suffix}"
        options = ("-o", target, "--force", "--diff")
        edited = () if robot == own else ("--robot", robot.name)
        words = ("symgen", "apply", f"runs/{run.name}", own.name, *options, *edited)
        self.jobs.add(f"apply {run.name}", words, target)
        return "applied"


def answering(handler: Handler) -> Handler:
    """Wrap a handler so that, for bad input, the page shows one sentence and the status is 422."""

    async def answer(request: Request) -> Response:
        try:
            return await handler(request)  # type: ignore[no-any-return]
        except RecursionError:
            return page("message", 422, text="nested too deeply; expected a plain table or study")
        except SettingsError as e:  # of a field, if the page has it
            wrong = {"keys": [str(k) for k in e.path if isinstance(k, str)], "text": e.reason}
            events = {"wrong": {**wrong, "line": e.line}}
            answered = page("message", 422, text=e.message)
            answered.headers["hx-trigger-after-swap"] = json.dumps(events)
            return answered
        except (InputError, SymgenError, ValueError, OSError) as e:
            return page("message", 422, text=str(e) or type(e).__name__)

    return answer


def safe(text: str) -> str:
    """Make a file name from a text: only letters, digits, _ . and -, at most 60 characters."""
    return re.sub(r"[^A-Za-z0-9_.-]", "", text).lstrip(".-")[:60]
