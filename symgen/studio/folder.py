"""The work folder of the studio: ordinary files under names of our own, so that none comes from the
browser.

    robot.urdf, .xml, .par    the user's own file
    robot.yaml                the table of frames, once it has been edited; it then is the robot
    robot.draft.yaml          an edit that describes no robot yet
    record.csv, validation.csv, ...    measured files
    study.yaml                what the record means, and how it is evaluated
    proof.json, check.json    the certificate and the findings
    study-NN-name.yaml, runs/NN-name/    settings and results of one command
    history/robot/NNNN/, history/study/NNNN/    what a change has replaced, the last one highest
    history/undone/NNNN/      robots that undo has replaced
"""

from __future__ import annotations

import json
import shutil
import warnings
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any

from runtime.core.errors import InputError
from runtime.core.settings import to_mapping
from runtime.documents.yaml_text import yaml_text, yaml_values
from runtime.reading.bags import stored_files
from runtime.reading.datasets import DATASETS
from runtime.reading.formats import BAG, endings, is_measured
from runtime.reporting.result_files import write_all
from runtime.study import located, study_from_text, study_of, study_text
from symgen.description import packaged_robots
from symgen.description.files import content_of, load_robot

ROBOT_ENDINGS = (".yaml", ".urdf", ".xml", ".par")  # the first one that is there is the robot
OTHER_ENDINGS = {".yml": ".yaml", ".mjcf": ".xml"}
DRAFT = "robot.draft.yaml"
MOST_KEPT = 300  # robots and studies before the present one
RESULT_FILES = ("estimate.json", "cestac.json", "advice.json")  # of a run that is complete


class WorkFolder:
    """The folder that holds one robot, its records and its results.

    Parameters
    ----------
    folder : Path
        Made where it is missing; what it holds is opened again.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder.resolve()
        (self.path / "runs").mkdir(parents=True, exist_ok=True)
        killed = [run for run in (self.path / "runs").iterdir() if not result_of(run)]
        for left in (*killed, *self.path.glob("*.part"), self.path / ".tmp"):
            remove(left)

    def write(self, name: str, content: str | bytes) -> None:
        """Write a file of the folder, whole or not at all."""
        write_all(self.path, {name: content})

    def read(self, name: str) -> str:
        """Text of a file of the folder; "" if it does not exist."""
        path = self.path / name
        return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""

    @property
    def robot(self) -> Path | None:
        """The robot file that commands use."""
        return self.first(ROBOT_ENDINGS)

    def first(self, endings: tuple[str, ...]) -> Path | None:
        """The first existing robot file with one of these endings; with those of TREES it is the user's own."""
        found = (self.path / f"robot{ending}" for ending in endings)
        return next((path for path in found if path.is_file()), None)

    @property
    def digest(self) -> str:
        """SHA-256 of the robot file, or of its draft; "" without robot."""
        path = self.path / DRAFT if self.read(DRAFT) else self.robot
        return sha256(path.read_bytes()).hexdigest() if path else ""

    def kept(self, history: str) -> list[Path]:
        """Folders of one history, the oldest first."""
        return sorted((self.path / "history" / history).glob("[0-9]*"), key=lambda p: int(p.name))

    def keep(self, kind: str, history: str = "") -> None:
        """Copy robot or study as they are to the end of a history."""
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
        """Swap the present robot with the last one of a history.

        The present one goes to the other history; InputError if the history is empty.
        """
        if not (before := self.kept(history)):
            raise InputError("nothing to undo; reload the page")
        self.keep("robot", other)
        self._remove_robot()
        for path in before[-1].iterdir():
            path.replace(self.path / path.name)
        remove(before[-1])

    def _remove_robot(self) -> None:
        for name in (DRAFT, *(f"robot{ending}" for ending in ROBOT_ENDINGS)):
            (self.path / name).unlink(missing_ok=True)

    def take_robot(self, name: str, content: bytes) -> None:
        """Make a file the robot; the robot before goes to its history, results and record stay."""
        self._keep_robot()
        self._remove_robot()
        self.write(robot_file(name), content)

    def _keep_robot(self) -> None:
        self.keep("robot")
        remove(self.path / "history" / "undone")

    def take_robot_of(self, source: str) -> None:
        """A packaged robot, or the path of the command line; SymgenError where it is none."""
        with warnings.catch_warnings(action="ignore"):  # the page tells them
            load_robot(source)
        packaged = files("symgen.description") / "robots" / f"{source}.yaml"
        if source in packaged_robots():
            self.take_robot("robot.yaml", packaged.read_bytes())
        else:
            self.take_robot(source, content_of(Path(source)))

    def edit_robot(self, text: str, *, draft: bool) -> None:
        """Save a text of the table: as a draft if it describes no robot, otherwise as the robot file.

        The history holds whole robots only.
        """
        if not self.read(DRAFT):
            self._keep_robot()
        self.write(DRAFT if draft else "robot.yaml", text)
        if not draft:
            (self.path / DRAFT).unlink(missing_ok=True)

    def measured(self, kind: str) -> Path | None:
        """The file of the record, or of its validation."""
        return next((p for p in sorted(self.path.glob(f"{kind}.*")) if is_measured(p)), None)

    def take_measured(self, kind: str, name: str, part: Path) -> None:
        """Make a file that has arrived, called `name` by its owner, the record or the validation.

        A record starts a new study.
        """
        ending = "".join(s for s in map(str.lower, Path(name).suffixes) if s in (*endings(), ".gz"))
        if not name.lower().endswith(ending) or ending.removesuffix(".gz") not in endings():
            raise InputError(
                f"{name[:80]}: expected a measured file: {', '.join(endings())}, or .gz"
            )
        if (old := self.measured(kind)) is not None:
            remove(old)
        part.replace(self.path / f"{kind}{ending}")
        if kind == "record":
            self.keep("study")
            (self.path / "study.yaml").unlink(missing_ok=True)

    def take_record_of(self, source: str) -> None:
        """A dataset, a study file or a measured file of the command line."""
        study, base = study_of(source)
        path, part = Path(source), self.path / "command.part"
        if source in DATASETS or not is_measured(path):
            self.write("study.yaml", study_text(located(study, base.resolve()), self.path))
        elif path.is_dir():
            bag = {file.name for file in stored_files(path)} | {"metadata.yaml"}
            shutil.copytree(path, part, ignore=lambda _, names: {*names} - bag)
            self.take_measured("record", f"bag{BAG}", part)
        else:
            shutil.copyfile(path, part)
            self.take_measured("record", source, part)

    @property
    def study_digest(self) -> str:
        """SHA-256 of study.yaml; "" where there is none."""
        text = self.read("study.yaml")
        return sha256(text.encode()).hexdigest() if text else ""

    def study(self) -> dict[str, Any]:
        """The plain values of study.yaml with a list of records, {} where it holds none; InputError
        where it is no YAML.
        """
        values = yaml_values(self.read("study.yaml"), file="study.yaml")[0]
        values = values if isinstance(values, dict) else {}
        single = isinstance(values.get("record"), dict)
        return values | {"record": [values["record"]]} if single else values

    def checked_study(self, given: Any) -> str:
        """Text of a study by its text or its values; InputError where it is none, or names a file
        of another folder that study.yaml did not name before.
        """
        text = given if isinstance(given, str) else yaml_text(given)
        study = to_mapping(study_from_text(text, file="study.yaml"))
        outside = {file for file in files_named(study) if Path(file).name != file}
        if alien := sorted(outside - {*files_named(self.study())}):
            raise InputError(
                f"{', '.join(alien)[:200]}: a study of the studio names files of its work folder; "
                "drop the file on the page, or name it on the command line"
            )
        return text

    def results(self) -> list[Path]:
        """Folders of complete results, in their order."""
        return sorted(path for path in (self.path / "runs").iterdir() if result_of(path))

    def run(self, name: str) -> Path:
        """The folder of that run; InputError where there is none."""
        found = {path.name: path for path in self.results()}
        if name not in found:
            raise InputError("no such run; reload the page")
        return found[name]

    def about(self, run: Path) -> dict[str, Any]:
        """Summary of one run for the pages."""
        kind = result_of(run)
        data = json_of(run / kind)
        parts = [p for part in data.get("validation") or [] for p in part.get("predictions", [])]
        unseen = [p.get("relative_error") or 0.0 for p in parts if not p.get("fitted")]
        return {
            "name": run.name,
            "kind": kind.removesuffix(".json"),
            "method": data.get("method", "resolution"),
            "error": data.get("relative_error"),
            "unseen": max(unseen, default=None),
            "checklist": data.get("checklist") or {},
            "verdict": data.get("verdict", ""),
            "enough": data.get("enough"),
            "levels": data.get("levels") or [],
            "command": self.read(f"study-{run.name}.yaml").partition("\n")[0].partition("# ")[2],
            "files": sorted(p.name for p in run.iterdir() if p.is_file() and p.name[0] != "."),
        }


def robot_file(name: str) -> str:
    """Our name of a robot file that its owner calls `name`; InputError where it is none."""
    ending = OTHER_ENDINGS.get(suffix := Path(name).suffix.lower(), suffix)
    if ending not in ROBOT_ENDINGS:
        raise InputError(
            f"{name[:80]}: expected a robot file that ends in {', '.join(ROBOT_ENDINGS)}"
        )
    return f"robot{ending}"


def result_of(run: Path) -> str:
    """Name of the result of a run; "" where it has not ended with one."""
    return next((name for name in RESULT_FILES if (run / name).is_file()), "")


def remove(path: Path) -> None:
    """Remove a file or folder of that name, if there is one."""
    shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)


def json_of(path: Path) -> dict[str, Any]:
    """Read a mapping from a JSON file; empty if it does not exist."""
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return {}


def files_named(settings: Any, key: str = "") -> list[str]:
    """Measured files that the settings of a study name, whatever their section."""
    if isinstance(settings, str):
        return [settings] if key in ("files", "also", "file") else []
    parts = settings.items() if isinstance(settings, dict) else ()
    items = [(key, x) for x in settings] if isinstance(settings, list | tuple) else parts
    return [file for inner, x in items for file in files_named(x, inner)]
