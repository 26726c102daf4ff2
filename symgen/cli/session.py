"""What the verbs on records share: the model of a ROBOT argument, the study of a RECORD argument, errors as one line and exit code 2."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NoReturn

import typer

if TYPE_CHECKING:
    from runtime.model.generated import GeneratedModel
    from runtime.records.record import Record
    from runtime.records.stream import Stream
    from runtime.settings.study import Study

BAD_INPUT, NEGATIVE = 2, 1
RECORDS = "Dataset, study file (.yaml) or measured file (t,q1..,tau1..; SI, joint side). Further measured files like the first: records of their own."
BROKEN_PIPE = 141  # as shells have it: 128 + SIGPIPE
SIMULATED = "SIMULATED"  # first word of the name of a record that was not measured
SIMULATED_WARNING = (
    "Everything here was computed on a SIMULATED record, made from the values of the robot file with encoder steps and torque noise. "
    "No figure in this report was measured."
)


def single_thread() -> None:
    """One BLAS thread unless the user set another number: matrices here are small and results then agree in every bit. Before numpy loads."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "BLIS_NUM_THREADS"):
        os.environ.setdefault(name, "1")


@contextmanager
def reported_errors() -> Iterator[None]:
    """Bad input as one message on the error stream and exit code 2, never a traceback."""
    from symgen.errors import SymgenError

    try:
        yield
    except (typer.Exit, typer.Abort):
        raise
    except BrokenPipeError:
        _stop_printing()
    except SymgenError as e:
        fail(str(e))
    except OSError as e:
        fail(f"{e.filename or 'cannot print, or write a temporary file'}: {e.strerror or e}")
    except Exception as e:
        from runtime.errors import DataUnavailableError, InputError  # not before it is needed: runtime takes most of a second to load

        if isinstance(e, InputError):
            fail(str(e), lines=isinstance(e, DataUnavailableError))
        raise


def _stop_printing() -> NoReturn:
    """The reader has enough, as `head` has: what is left to print goes nowhere, the end is quiet."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
    raise typer.Exit(BROKEN_PIPE)


def fail(message: str, *, lines: bool = False) -> NoReturn:
    """End with `message` and exit code 2; on one line unless it is meant to have several: what it names may have any characters."""
    from symgen.errors import printable

    said = message if lines else message.replace("\n", "\\n")
    typer.echo(f"error: {printable(said)}", err=True)
    raise typer.Exit(BAD_INPUT)


@contextmanager
def opened_model(robot: str) -> Iterator[GeneratedModel]:
    """The model of a packaged robot, a robot file (.yaml, .par, .urdf) or a generated module (.py).

    A robot is emitted into a folder that lives as long as the block, since other processes load the model from its file.
    """
    from runtime.model.generated import load_model

    if Path(robot).suffix == ".py":
        yield load_model(Path(robot))
        return
    from runtime.records.formats.table import is_measured
    from symgen.description import load_robot
    from symgen.emit.generate import generate_module

    if Path(robot).is_file() and is_measured(Path(robot)):
        fail(f"{robot}: a measured file, where a robot is expected; the robot comes first, then the record")
    description = load_robot(robot)
    text = generate_module(description)
    with TemporaryDirectory(prefix="symgen-") as folder:
        path = Path(folder) / f"{description.name}.py"
        path.write_text(text, encoding="utf-8")
        yield load_model(path)


def in_target(robot: str, model: GeneratedModel, target: str) -> GeneratedModel:
    """`model` or, for target "c", the same in C, inside the block of `opened_model`: one line says why where NumPy serves instead."""
    import warnings

    from runtime.model.compiled import compiled_model
    from runtime.resolution.c.workspace import usable

    if target not in ("numpy", "c"):
        fail(f"--target {target}; expected numpy or c")
    if target == "numpy":
        return model
    path = Path(str(getattr(model, "__file__", ""))).with_suffix(".c")
    if Path(robot).suffix != ".py":
        from symgen.description import load_robot
        from symgen.emit.generate import generate_files

        for text in generate_files(load_robot(robot), targets=("c",)).values():
            path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = usable(compiled_model(model))
    for warning in said:
        typer.echo(str(warning.message), err=True)
    return found


def symbolic_file(robot: str, model: GeneratedModel) -> Path:
    """The CasADi module of `robot`, inside the block of `opened_model`: beside a generated module, else emitted beside `model`."""
    from runtime.errors import ModelError

    here = Path(str(getattr(model, "__file__", "")))
    path = here.with_name(f"{here.stem}_casadi.py")
    if Path(robot).suffix != ".py" and not path.exists():
        from symgen.description import load_robot
        from symgen.emit.generate import generate_files

        files = generate_files(load_robot(robot), targets=("casadi",))
        if path.name not in files:
            raise ModelError(f"{model.NAME} has joints that only its closure equations tie; there is no CasADi model of it")
        path.write_text(files[path.name], encoding="utf-8")
    return path


def study_and_records(record: str | Sequence[str], model: GeneratedModel) -> tuple[Study, Path, list[Record]]:
    """The study that one RECORD argument means, or several, the folder of its files, and its records."""
    from runtime.records.reading import read_records

    study, folder = study_with_records([record] if isinstance(record, str) else record)
    return study, folder, read_records(study.record, model, folder=folder)


def study_with_records(records: Sequence[str]) -> tuple[Study, Path]:
    """The study that RECORD arguments mean, which names a record, and the folder of its files.

    The first says how they are read: a study file, a dataset or a measured file; each further one is a measured file like it, a record of its own.
    """
    from runtime.errors import InputError
    from runtime.records.formats.table import is_measured
    from runtime.records.named import study_of

    study, folder = study_of(records[0])
    if not study.record:
        raise InputError("the study names no record; set record.files, or record.dataset with record.files", file=records[0])
    like, further = study.record[-1], []
    for record in records[1:]:
        path = Path(record)
        if path.suffix.lower() in (".yaml", ".yml") or not is_measured(path):
            raise InputError(
                "expected a measured file after the first RECORD: its columns, units and side are those of the first", file=record
            )
        if len(like.files) > 1:
            raise InputError("the first RECORD has its positions and torques in two files; name further pairs in record.also", file=record)
        further.append(replace(like, files=(os.path.relpath(path, folder),), dataset=None, name=None))
    return replace(study, record=(*study.record, *further)), folder


def origin(records: Sequence[Record | Stream]) -> dict[str, Any]:
    """Provenance of the records: their names, and whether they were simulated."""
    simulated = any(record.name.startswith(SIMULATED) for record in records)
    note = {"note": "SIMULATED record: nothing was measured"} if simulated else {}
    stamps = {record.name: said for record in records if (said := getattr(record, "time", ""))}
    return {"records": [record.name for record in records], "simulated": simulated, **({"time": stamps} if stamps else {}), **note}


def study_text(study: Study, folder: Path, destination: Path) -> str:
    """study.yaml: every setting, defaults included; files relative to `destination`, where the study is written."""
    from runtime.settings.study import RecordSettings, to_mapping

    def moved(settings: RecordSettings) -> RecordSettings:
        if settings.dataset is not None:
            return settings
        files = tuple(Path(os.path.relpath(folder / file, destination)).as_posix() for file in settings.files)
        return replace(settings, files=files)

    record, further = tuple(moved(s) for s in study.record), tuple(moved(s) for s in study.validate.record)
    complete = replace(study, record=record, validate=replace(study.validate, record=further))
    if study.payload is not None:
        complete = replace(complete, payload=replace(study.payload, record=tuple(moved(s) for s in study.payload.record)))
    return yaml_text(to_mapping(complete))


def yaml_text(mapping: dict[str, Any]) -> str:
    """A mapping as YAML, keys in their order, lists of numbers on one line."""
    from ruamel.yaml import YAML

    yaml: Any = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False
    yaml.width = 140
    stream = StringIO()
    yaml.dump(mapping, stream)
    return stream.getvalue()


def progress_bar(what: str) -> Any:
    """A bar of `what` on the error stream; the context gives what long work calls with the number done and their total."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    @contextmanager
    def bar() -> Any:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
            task = progress.add_task(what, total=None)

            def advance(done: int, total: int) -> None:
                progress.update(task, completed=done, total=total)

            yield advance

    return bar()
