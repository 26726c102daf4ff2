"""What the verbs share: the model of a ROBOT argument, the study of RECORD arguments, errors as one line and exit code 2."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

if TYPE_CHECKING:
    from runtime.model.generated import GeneratedModel
    from runtime.resolution.checkpoint import Checkpoint
    from runtime.settings.study import Study

BAD_INPUT, NEGATIVE = 2, 1
ROBOT = "Packaged robot, robot file (.yaml, .par, .urdf) or generated module (.py)."
RECORDS = "Dataset, study file (.yaml) or measured file (t,q1..,tau1..; SI, joint side). Further measured files like the first: records of their own."
BROKEN_PIPE, INTERRUPTED = 141, 130  # as shells have them: 128 + SIGPIPE, 128 + SIGINT


def single_thread() -> None:
    """One BLAS thread unless the user set another number: matrices here are small and results then agree in every bit. Before numpy loads."""
    from runtime.blas import BLAS_THREADS

    for name in BLAS_THREADS:
        os.environ.setdefault(name, "1")


@contextmanager
def reported_errors() -> Iterator[None]:
    """Bad input as one message on the error stream and exit code 2, a false certificate with exit code 1, never a traceback."""
    from runtime.errors import DataUnavailableError, InputError
    from symgen.errors import CertificateError, SymgenError

    try:
        yield
    except (typer.Exit, typer.Abort):
        raise
    except BrokenPipeError:
        _stop_printing()
    except CertificateError as e:
        fail(str(e), code=NEGATIVE)
    except (InputError, SymgenError) as e:
        fail(str(e), lines=isinstance(e, DataUnavailableError))
    except OSError as e:
        fail(f"{e.filename or 'cannot print, or write a temporary file'}: {e.strerror or e}")


def _stop_printing() -> NoReturn:
    """The reader has enough, as `head` has: what is left to print goes nowhere, the end is quiet."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
    raise typer.Exit(BROKEN_PIPE)


def fail(message: str, *, lines: bool = False, code: int = BAD_INPUT) -> NoReturn:
    """End with `message` and an exit code; on one line unless it is meant to have several: names in it may have any characters."""
    from symgen.errors import printable

    text = message if lines else message.replace("\n", "\\n")
    typer.echo(f"error: {printable(text)}", err=True)
    raise typer.Exit(code)


def say(text: str) -> None:
    """A line of progress on the error stream."""
    typer.echo(f"  {text}", err=True)


def show(text: str, output: Path | None, *, json: bool) -> None:
    """Print a result, and on the error stream where its report is."""
    typer.echo(text, nl=not json)
    if output is not None:
        typer.echo(f"report: {output / 'report.html'}", err=True)


def model_of(robot: str, target: str = "numpy") -> GeneratedModel:
    """The model of a ROBOT argument. target : "numpy", or "c" for the same in C; one line says why where NumPy serves instead."""
    from runtime.model.generated import load_model
    from runtime.records.formats.table import is_measured

    if target not in ("numpy", "c"):
        fail(f"--target {target}; expected numpy or c")
    if Path(robot).suffix == ".py":
        model = load_model(Path(robot))
        return model if target == "numpy" else _in_c(model, None)
    if Path(robot).is_file() and is_measured(Path(robot)):
        fail(f"{robot}: a measured file, where a robot is expected; the robot comes first, then the record")
    import symgen

    model = load_model(symgen.model(robot))
    return model if target == "numpy" else _in_c(model, robot)


def variants_of(robot: str) -> GeneratedModel | None:
    """The module of a ROBOT argument with its table of frames free; None of a generated module, which has no robot file."""
    if Path(robot).suffix == ".py":
        return None
    import symgen
    from runtime.model.generated import load_model

    return load_model(symgen.variants(robot))


def model_of_job(robot: str) -> GeneratedModel:
    """The model of a job of a fleet: what is wrong with its robot file is an error of that job alone."""
    from runtime.errors import InputError
    from symgen.errors import SymgenError

    try:
        return model_of(robot)
    except SymgenError as e:
        raise InputError(str(e)) from e


def _in_c(model: GeneratedModel, robot: str | None) -> GeneratedModel:
    """The model with its functions in C. robot : whose C file is emitted; None: the file beside that of the model."""
    import warnings

    from runtime.model.compiled import compiled_model
    from runtime.resolution.c.workspace import usable

    source = None
    if robot is not None:
        from symgen.emit.certified import c_file

        source = c_file(robot)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        compiled = usable(compiled_model(model, source=source))
    for warning in caught:
        typer.echo(str(warning.message), err=True)
    return compiled


def model_of_runs(model: GeneratedModel, robot: str) -> GeneratedModel:
    """The model for the runs of a resolution study: with its signals in C where there is a compiler."""
    from runtime.resolution.c import workspace
    from symgen.emit.certified import c_file

    return workspace.model_of_runs(model, Path(robot).with_suffix(".c") if Path(robot).suffix == ".py" else c_file(robot))


def study_of_arguments(records: Sequence[str], *, recorded: bool = True) -> Study:
    """The study that RECORD arguments mean, files relative to the current folder.

    The first says how they are read: a study file, a dataset or a measured file; each further one is a measured file like it, a record of its own.
    recorded : whether the study has to name a record.
    """
    from runtime.errors import InputError
    from runtime.records.formats.table import is_measured
    from runtime.records.named import study_of
    from runtime.settings.location import located

    study = located(*study_of(records[0]))
    if recorded:
        require_record(study, records[0])
    further = []
    for record in records[1:]:
        path = Path(record)
        if path.suffix.lower() in (".yaml", ".yml") or not is_measured(path):
            raise InputError(
                "expected a measured file after the first RECORD: its columns, units and side are those of the first", file=record
            )
        if len(study.record[-1].files) > 1:
            raise InputError("the first RECORD has its positions and torques in two files; name further pairs in record.also", file=record)
        further.append(replace(study.record[-1], files=(record,), dataset=None, name=None))
    return replace(study, record=(*study.record, *further))


def require_record(study: Study, file: str) -> None:
    """InputError where the study of that file names no record."""
    from runtime.errors import InputError

    if not study.record:
        raise InputError("the study names no record; set record.files, or record.dataset with record.files", file=file)


def changed(study: Study, section: str, **given: Any) -> Study:
    """The study with some settings of a section replaced, checked like those of a file; None: as in the study."""
    from runtime.settings.study import study_from_mapping, to_mapping

    mapping = to_mapping(study)
    own = {**(mapping[section] or {}), **{key: value for key, value in given.items() if value is not None}}
    return study_from_mapping({**mapping, section: own})


def names_of(text: str | None) -> str | list[str] | None:
    """Names separated by commas as a list; essential and all as they are."""
    return text if text in (None, "essential", "all") else text.split(",")


def stopped(checkpoint: Checkpoint | None) -> NoReturn:
    """Ctrl-C says what is left of a study and ends with code 130."""
    kept = f"{checkpoint.written} runs are in {checkpoint.folder}: the same command goes on" if checkpoint and checkpoint.written else ""
    typer.echo(f"stopped; {kept or 'nothing is kept'}", err=True)
    raise typer.Exit(INTERRUPTED)


@contextmanager
def progress_lines(after: float = 2.0) -> Iterator[None]:
    """What long work is at, one line each on the error stream, from `after` seconds on."""
    import logging
    from time import monotonic

    from runtime.progress import LOGGER

    start = monotonic()

    class Lines(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if monotonic() - start > after:
                say(record.getMessage())

    handler, level = Lines(), LOGGER.level
    LOGGER.addHandler(handler)
    LOGGER.setLevel(logging.INFO)
    try:
        yield
    finally:
        LOGGER.removeHandler(handler)
        LOGGER.setLevel(level)


@contextmanager
def progress_bar(what: str) -> Iterator[Any]:
    """A bar of `what` on the error stream; the context gives what long work calls with the number done and their total."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(what, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)
