"""The work folder of the studio: ordinary files, whose names never come from the browser.

    robot.urdf, .xml, .par    the user's own file
    robot.loops.yaml          the loops of a URDF or MJCF, as they stood beside it
    robot.yaml                the table of frames after an edit or with these loops, which then describes the robot
    robot.draft.yaml          an edit that does not describe a robot yet
    record/run.csv, validation/other.csv    measured files, with their original names
    study.yaml                meaning of the record, and settings of its evaluation
    proof.json, check.json    the certificate and the findings
    repair.json               changes of the study by the last repair, and the study before it
    times.json                duration of the last run of each kind, s
    robot-NN-name.urdf, study-NN-name.yaml, runs/NN-name/    robot, settings, results of one command
    history/robot/NNNN/, history/study/NNNN/, history/record/NNNN/    versions that a change has replaced
    history/undone/NNNN/      robots that an undo has replaced
    .address.json             port and token of the server, which only the owner can read

In a history, the newest folder has the largest number NNNN.
"""

from __future__ import annotations

import json
import re
import shutil
import warnings
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any

from runtime.documents.yaml_text import yaml_text, yaml_values
from runtime.ground.errors import InputError
from runtime.ground.settings import to_mapping
from runtime.reading.bags import stored_files
from runtime.reading.datasets import DATASETS
from runtime.reading.formats import file_extensions, is_measured
from runtime.reporting.result_files import write_all
from runtime.study import located, study_from_text, study_of, study_text
from symgen.description import packaged_robots
from symgen.description.files import (
    TREES,
    content_of,
    is_loops_file,
    load_robot,
    loops_beside,
    write_robot,
)

ROBOT_ENDINGS = (".yaml", ".urdf", ".xml", ".par")  # the first one that is there is the robot
OTHER_ENDINGS = {".yml": ".yaml", ".mjcf": ".xml"}
LOOPS = "robot.loops.yaml"
DRAFT = "robot.draft.yaml"
MOST_KEPT = 300  # robots and studies before the present one
RECORDS_KEPT = 3  # before the present one
RESULT_FILES = ("estimate.json", "cestac.json", "advice.json")  # of a run that is complete


class WorkFolder:
    """A folder on disk with the files of one robot: robot file, study, records and results.

    Parameters
    ----------
    folder : Path
        Made if it is missing; existing files are used again.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder.resolve()
        (self.path / "runs").mkdir(parents=True, exist_ok=True)
        killed = [run for run in (self.path / "runs").iterdir() if not result_of(run)]
        for left in (*killed, *self.path.glob("*.part"), self.path / ".tmp"):
            remove(left)

    def write(self, name: str, content: str | bytes) -> None:
        """Write a file into the work folder, completely or not at all."""
        write_all(self.path, {name: content})

    def read(self, name: str) -> str:
        """Return the text of a file of the folder; "" if it does not exist."""
        path = self.path / name
        return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""

    @property
    def robot(self) -> Path | None:
        """Path of the robot file that commands use; None if there is none."""
        return self.first(ROBOT_ENDINGS)

    def first(self, endings: tuple[str, ...]) -> Path | None:
        """Return the first existing robot file with one of the given endings; None if there is no
        such file.

        A URDF or MJCF file is the user's own file.
        """
        found = (self.path / f"robot{ending}" for ending in endings)
        return next((path for path in found if path.is_file()), None)

    @property
    def digest(self) -> str:
        """SHA-256 of the robot file, or of its draft; "" if there is no robot."""
        path = self.path / DRAFT if self.read(DRAFT) else self.robot
        return sha256(path.read_bytes()).hexdigest() if path else ""

    def kept(self, history: str) -> list[Path]:
        """List the folders with earlier versions of the robot or the study, the oldest first."""
        return sorted((self.path / "history" / history).glob("[0-9]*"), key=lambda p: int(p.name))

    def keep(self, kind: str, history: str = "") -> None:
        """Copy the present robot or study into the history, as its latest version."""
        place, before = self.path / "history" / (history or kind), self.kept(history or kind)
        own = [path for path in self.path.glob(f"{kind}.*") if path.is_file()]
        if own:
            folder = place / f"{int(before[-1].name) + 1 if before else 1:04d}"
            folder.mkdir(parents=True)
            for path in own:
                shutil.copy2(path, folder)
        for old in before[: -MOST_KEPT + 1]:
            remove(old)

    def bring_back(self, history: str = "robot", other: str = "undone") -> None:
        """Replace the present robot by the last robot of a history, for undo and redo.

        The present robot is added to the history `other`. Raise InputError if the history is empty.
        """
        if not (before := self.kept(history)):
            raise InputError("nothing to undo; reload the page")
        self.keep("robot", other)
        self._remove_robot()
        for path in before[-1].iterdir():
            path.replace(self.path / path.name)
        remove(before[-1])

    def _remove_robot(self) -> None:
        for name in (DRAFT, LOOPS, *(f"robot{ending}" for ending in ROBOT_ENDINGS)):
            (self.path / name).unlink(missing_ok=True)

    def take_robot(self, name: str, content: bytes) -> None:
        """Use the content of a file as the new robot; results and record stay.

        The present robot is added to the history. name : original name of the file.
        """
        self._keep_robot()
        self._remove_robot()
        self.write(robot_file(name), content)

    def take_loops(self, content: bytes, table: str) -> None:
        """Use the content of a file with loops beside the user's own URDF or MJCF.

        table : text of the robot file (.yaml) of both.
        """
        self._keep_robot()
        (self.path / DRAFT).unlink(missing_ok=True)
        write_all(self.path, {LOOPS: content, "robot.yaml": table})

    def _keep_robot(self) -> None:
        self.keep("robot")
        remove(self.path / "history" / "undone")

    def take_robot_of(self, source: str) -> None:
        """Use a packaged robot or a robot file as the new robot.

        source : name or path from the command line. Raise SymgenError if it describes no robot.
        """
        with warnings.catch_warnings(action="ignore"):  # the page tells them
            robot = load_robot(source)
        packaged = files("symgen.description") / "robots" / f"{source}.yaml"
        if source in packaged_robots():
            self.take_robot("robot.yaml", packaged.read_bytes())
        else:
            self.take_robot(source, content_of(Path(source)))
            if Path(source).suffix.lower() in TREES and (beside := loops_beside(Path(source))):
                self.take_loops(beside.content, write_robot(robot, "robot.yaml")[0])

    def edit_robot(self, text: str, *, draft: bool) -> None:
        """Save an edited robot table: as the robot file if it is valid, else as a draft.

        Drafts do not enter the history.
        """
        if not self.read(DRAFT):
            self._keep_robot()
        self.write(DRAFT if draft else "robot.yaml", text)
        if not draft:
            (self.path / DRAFT).unlink(missing_ok=True)

    def measured(self, kind: str) -> str:
        """Return the name of the measured file, such as record/run.csv; "" if there is none.

        kind : "record" or "validation".
        """
        return next((f"{kind}/{path.name}" for path in (self.path / kind).glob("*")), "")

    def take_measured(self, kind: str, name: str, part: Path) -> None:
        """Use an uploaded file, or the folder of a bag, as the record or the validation record.

        The file replaces the earlier record, which `exchange_record` brings back. A new record
        starts a new study.

        name : original name of the file.
        part : the uploaded file.
        """
        name = measured_name(name)
        if not (part.is_dir() or name.lower().removesuffix(".gz").endswith(file_extensions())):
            raise InputError(
                f"{name}: expected a measured file: {', '.join(file_extensions())}, or .gz"
            )
        if kind == "record":
            self.keep("study")
            self._keep_record()
        remove(self.path / kind)
        (self.path / kind).mkdir()
        part.replace(self.path / kind / name)

    def _keep_record(self) -> None:
        """Move the record and its study into the history, if there is a record."""
        if not self.measured("record"):
            (self.path / "study.yaml").unlink(missing_ok=True)
            return
        before = self.kept("record")
        place = self.path / "history/record" / f"{int(before[-1].name) + 1 if before else 1:04d}"
        place.mkdir(parents=True)
        for own in ("record", "study.yaml"):
            if (path := self.path / own).exists():
                path.replace(place / own)
        for old in before[: -RECORDS_KEPT + 1]:
            remove(old)

    @property
    def record_before(self) -> str:
        """Name of the record that the present record has replaced; "" if there was none."""
        before = [path.name for old in self.kept("record")[-1:] for path in old.glob("record/*")]
        return next(iter(before), "")

    def exchange_record(self) -> None:
        """Exchange the record and its study with the earlier record and study; a second call
        reverses the first.

        Raise InputError if there is no earlier record.
        """
        if not self.record_before:
            raise InputError("there is no earlier record; reload the page")
        earlier = self.kept("record")[-1]
        self._keep_record()
        for path in earlier.iterdir():
            path.replace(self.path / path.name)
        remove(earlier)

    def take_record_of(self, source: str) -> None:
        """Use a dataset, a study file or a measured file as the record.

        source : name or path from the command line.
        """
        study, base = study_of(source)
        path, part = Path(source), self.path / "command.part"
        if source in DATASETS or not is_measured(path):
            self.write("study.yaml", study_text(located(study, base.resolve()), self.path))
        elif path.is_dir():
            bag = {file.name for file in stored_files(path)} | {"metadata.yaml"}
            shutil.copytree(path, part, ignore=lambda _, names: {*names} - bag)
            self.take_measured("record", path.resolve().name, part)
        else:
            shutil.copyfile(path, part)
            self.take_measured("record", source, part)

    @property
    def study_digest(self) -> str:
        """SHA-256 of study.yaml; "" if there is no study."""
        text = self.read("study.yaml")
        return sha256(text.encode()).hexdigest() if text else ""

    def study(self, name: str = "study.yaml") -> dict[str, Any]:
        """Read a study file as plain values, with the records as a list; {} if it is empty.

        Raise InputError if the file is not valid YAML.
        """
        values = yaml_values(self.read(name), file=name)[0]
        values = values if isinstance(values, dict) else {}
        single = isinstance(values.get("record"), dict)
        return values | {"record": [values["record"]]} if single else values

    def checked_study(self, given: Any) -> str:
        """Check the settings of a study, given as text or as values, and return them as text.

        Raise InputError if the study is not valid, or if it names a file outside the folder that is
        no measured file of the studio and that study.yaml did not name before.
        """
        text = given if isinstance(given, str) else yaml_text(given)
        study = to_mapping(study_from_text(text, file="study.yaml"))
        outside = {file for file in files_named(study) if Path(file).name != file}
        own = {self.measured("record"), self.measured("validation")}
        if alien := sorted(outside - own - {*files_named(self.study())}):
            raise InputError(
                f"{', '.join(alien)[:200]}: a study in the studio may only name files of its work "
                "folder; drop these files on the page, or give them on the command line"
            )
        return text

    def results(self) -> list[Path]:
        """List the results folders of all complete runs, in the order of their names."""
        return sorted(path for path in (self.path / "runs").iterdir() if result_of(path))

    def run(self, name: str) -> Path:
        """Return the results folder of the run `name`; raise InputError if there is none."""
        found = {path.name: path for path in self.results()}
        if name not in found:
            raise InputError("no such run; reload the page")
        return found[name]

    def robot_of(self, run: str) -> Path | None:
        """Return the robot file with which a run was made, or the present robot file if none was
        kept.
        """
        return next(self.path.glob(f"robot-{run}.*"), self.robot)

    def about(self, run: Path) -> dict[str, Any]:
        """Summarise one run of an identification or resolution study for the pages."""
        kind = result_of(run)
        data = json_of(run / kind)
        parts = [p for part in data.get("validation") or [] for p in part.get("predictions", [])]
        unseen = [p.get("relative_error") or 0.0 for p in parts if not p.get("fitted")]
        return {
            "name": run.name,
            "kind": kind.removesuffix(".json"),
            "robot": getattr(self.robot_of(run.name), "name", ""),
            "method": data.get("method", "resolution"),
            "error": data.get("relative_error"),
            "unseen": max(unseen, default=None),
            "checklist": data.get("checklist") or {},
            "verdict": data.get("verdict", ""),
            "enough": data.get("enough"),
            "levels": data.get("levels") or [],
            "asked": bool(data.get("asked")),
            "few": few_runs(data.get("levels") or []),
            "command": self.read(f"study-{run.name}.yaml").partition("\n")[0].partition("# ")[2],
            "files": sorted(p.name for p in run.iterdir() if p.is_file() and p.name[0] != "."),
        }


def robot_file(name: str) -> str:
    """Return the file name in the work folder for a robot file, such as robot.urdf for arm.urdf, or
    for a file with loops.

    Raise InputError if `name` has no ending of a robot file.
    """
    if is_loops_file(name):
        return LOOPS
    ending = OTHER_ENDINGS.get(suffix := Path(name).suffix.lower(), suffix)
    if ending not in ROBOT_ENDINGS:
        raise InputError(
            f"{name[:80]}: expected a robot file that ends in {', '.join(ROBOT_ENDINGS)}"
        )
    return f"robot{ending}"


def measured_name(name: str) -> str:
    """Return a safe name for a measured file: the end of its own name, without folders.

    Spaces and signs become _; the name does not begin with a dot or a hyphen.
    """
    return re.sub(r"[^\w.-]+", "_", re.split(r"[/\\]", name)[-1])[-60:].lstrip(".-")


def result_of(run: Path) -> str:
    """Return the name of the result file of a run; "" if the run is not complete."""
    return next((name for name in RESULT_FILES if (run / name).is_file()), "")


def few_runs(levels: list[dict[str, Any]]) -> dict[str, int]:
    """Number of runs of a resolution study, and number that it needs; {} if the intervals of its
    means are narrow enough.
    """
    short = [level for level in levels if level["run_count"] < level["runs_needed"]]
    keys = {"runs": "run_count", "needed": "runs_needed"}
    return {key: max(level[of] for level in short) for key, of in keys.items()} if short else {}


def remove(path: Path) -> None:
    """Remove a file or a folder, if it exists."""
    shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)


def json_of(path: Path) -> dict[str, Any]:
    """Read a mapping from a JSON file; {} if it is missing or not valid."""
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return {}


def files_named(settings: Any, key: str = "") -> list[str]:
    """List the measured files that the settings of a study name, in all sections."""
    if isinstance(settings, str):
        return [settings] if key in ("files", "also", "file") else []
    parts = settings.items() if isinstance(settings, dict) else ()
    items = [(key, x) for x in settings] if isinstance(settings, list | tuple) else parts
    return [file for inner, x in items for file in files_named(x, inner)]
