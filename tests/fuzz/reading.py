"""What reading a file of each format means: the functions that the library and the command line
call.
"""

from __future__ import annotations

import ast
import os
import signal
import zipfile
import zlib
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runtime.reading.settings import Columns


def read_robot(path: Path) -> object:
    """A tree of links is read again with the links that fixed joints hold as frames."""
    from symgen.description.files import read_robot as read

    robot, _ = read(path)
    if path.suffix in (".urdf", ".xml"):
        read(path, keep_fixed=True)
    return robot


def read_and_derive(path: Path) -> object:
    """Small robots are derived and emitted as well; the module is Python."""
    from symgen.description import load_robot
    from symgen.emit.generate import generate_module

    robot = load_robot(path)
    if len(robot.frames) <= 5 and not robot.loops:
        ast.parse(generate_module(robot), path.name)
    return robot


def read_study(path: Path) -> object:
    from runtime.core.settings import to_mapping
    from runtime.study import load_study, located, study_text

    study = load_study(path)
    to_mapping(study)
    return study_text(located(study, path.parent), path.parent)


def read_motion(path: Path) -> object:
    from runtime.loop.reference import reference_of
    from runtime.study import load_study

    study = load_study(path)
    if study.controller is not None and study.controller.reference.motion is not None:
        return reference_of(study.controller, two_joints(), folder=path.parent)
    return study


@cache
def two_joints() -> object:
    from types import SimpleNamespace

    return SimpleNamespace(
        NAME="two",
        JOINTS=(1, 2),
        LIMITS={"q": ((-1e6, 1e6),) * 2, "qd": (1e6,) * 2, "qdd": (1e6,) * 2},
        DRIVES=None,
    )


def read_record(path: Path) -> object:
    from runtime.compose import read_record as read
    from runtime.reading.settings import RecordSettings

    settings = RecordSettings(files=(path.name,), columns=columns_of(path))
    return read(settings, folder=path.parent)


def columns_of(path: Path) -> Columns:
    from runtime.reading.settings import Columns

    if path.suffix == ".npy":
        return Columns(t="1", q=("2", "3"), tau=("4", "5"))
    return (
        Columns(q=("a", "b"), tau=("a", "b"))
        if path.suffix in ("", ".bag", ".db3", ".mcap")
        else Columns()
    )


def read_folder(path: Path) -> object:
    """The archive is unpacked by us; what is read is the folder."""
    folder = path.with_suffix("")
    folder.mkdir()
    with suppress(zipfile.BadZipFile, zlib.error, EOFError), zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            (folder / Path(name).name).write_bytes(archive.read(name))
    return read_record(folder)


def read_model(path: Path) -> object:
    from runtime.core.model import load_model

    return load_model(path)


def read_checkpoint(path: Path) -> object:
    from runtime.parallel.checkpoint import Checkpoint

    folder = path.parent / "runs"
    folder.mkdir(exist_ok=True)
    (folder / "study.json").write_text("{}")
    path.replace(folder / "000000.npz")
    return Checkpoint(path.parent).resume({}, 2)


def read_settings(path: Path) -> object:
    from runtime.parallel.checkpoint import Checkpoint

    folder = path.parent / "runs"
    folder.mkdir(exist_ok=True)
    path.replace(folder / "study.json")
    return Checkpoint(path.parent).resume({"runs": 7}, 2)


def read_estimate(path: Path) -> object:
    """What is read can be shown and written, and is read again with the same bits."""
    from runtime.core.least_squares.estimate import Estimate
    from runtime.documents.estimates import load_estimate

    found = load_estimate(path)
    text = found.to_json()
    if Estimate.from_json(text).to_json() != text:
        raise AssertionError("written and read again it differs")
    return found.to_table(), found.to_latex()


def read_faulty(path: Path) -> object:
    """Does what its first line says: the harness is tested by it."""
    from runtime.core.errors import InputError

    match path.read_text():
        case "hang":
            while True:
                pass
        case "death":
            os.kill(os.getpid(), signal.SIGSEGV)
        case "memory":
            return bytearray(2**33)
        case "traceback":
            return {}["x"]
        case "unclear":
            raise InputError("wrong")
        case "control":
            error = InputError("", file="case")
            error.args = ("case: \x1b[2J",)
            raise error
    return None
