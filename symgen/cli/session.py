"""Functions that the commands share: model and study from the arguments, error messages, output.

Errors become one line and exit code 2.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import timedelta
from itertools import groupby, pairwise
from pathlib import Path
from shlex import join
from shutil import get_terminal_size
from textwrap import wrap
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from symgen.cli.told import as_json, counter, error_data, lines_of, tell, time_left

if TYPE_CHECKING:
    from runtime.core.model import GeneratedModel
    from runtime.reporting.result_files import Results
    from runtime.study import Study
    from symgen.description import Robot

BAD_INPUT, NEGATIVE = 2, 1
COLOURS = {"good": "green", "doubtful": "yellow", "no": "red"}
BROKEN_PIPE, INTERRUPTED = 141, 130  # as shells have them: 128 + SIGPIPE, 128 + SIGINT


def single_thread() -> None:
    """Set the number of BLAS threads to one, unless the user has set a number.

    The matrices are small, and with one thread the results agree in every bit. Call this function
    before numpy is imported.
    """
    from runtime.threads import BLAS_THREADS

    for name in BLAS_THREADS:
        os.environ.setdefault(name, "1")


@contextmanager
def reported_errors() -> Iterator[None]:
    """Report errors inside the block as messages of the command line, and run the block with one
    BLAS thread.

    Bad input gives one message on the error stream and exit code 2; a false certificate gives exit
    code 1. There is never a traceback. Warnings on the robot file and the record are printed as
    notes, after the answer.
    """
    from runtime.ground.errors import DataUnavailableError, InputError
    from symgen.errors import CertificateError, SymgenError

    single_thread()
    try:
        with _noted_warnings():
            yield
    except BrokenPipeError as e:  # the reader has enough, as `head` has: the end is quiet
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
        raise typer.Exit(BROKEN_PIPE) from e
    except (InputError, SymgenError) as e:
        code = NEGATIVE if isinstance(e, CertificateError) else BAD_INPUT
        likely = "; identify --suggest FILE writes a likely study"
        likely = "" if getattr(e, "remedy", None) is None else likely
        lines = isinstance(e, DataUnavailableError)
        fail(f"{e}{likely}", lines=lines, code=code, data=error_data(e))
    except OSError as e:
        fail(f"{e.filename or 'cannot print, or write a temporary file'}: {e.strerror or e}")


@contextmanager
def _noted_warnings() -> Iterator[None]:
    import warnings

    from runtime.ground.errors import RecordWarning
    from symgen.description.angles import RobotFileWarning

    noted = (RobotFileWarning, RecordWarning)
    notes: dict[str, None] = {}  # each once: a verb may regroup its robot twice
    with warnings.catch_warnings():
        show = warnings.showwarning

        def note(message: Warning | str, category: type[Warning], *place: Any) -> None:
            if issubclass(category, noted):
                notes.setdefault(str(message))
            else:
                show(message, category, *place)

        warnings.showwarning = note  # type: ignore[assignment]
        for kind in noted:
            warnings.simplefilter("always", kind)
        try:
            yield
        finally:
            width = get_terminal_size().columns
            for text in notes:
                tell(_wrapped(f"note: {text}", width), note=text)


@contextmanager
def results_in(output: Path | None) -> Iterator[Any]:
    """Yield the output folder as a Results object; None if no folder is given.

    Errors inside the block become messages, as in `reported_errors`.
    """
    with reported_errors():
        from runtime.reporting import result_files

        with result_files.results_in(output) as results:
            yield results


def fail(
    message: str,
    *,
    lines: bool = False,
    code: int = BAD_INPUT,
    data: Mapping[str, Any] | None = None,
) -> NoReturn:
    """End the command with `message` on the error stream and an exit code.

    lines : whether line ends of the message are kept. Otherwise they are printed as backslash n,
        because a name in the message may contain any character.
    data : data that a program reads in place of the message (`symgen.cli.told`).
    """
    from symgen.errors import printable

    text = message if lines else message.replace("\n", "\\n")
    tell(f"error: {printable(text)}", **(data or {"error": printable(text)}))
    raise typer.Exit(code)


def say(text: str) -> None:
    """Print a line of progress on the error stream."""
    tell(f"  {text}", stage=text)


def show(
    text: str, results: Results | None = None, *, json: bool = False, verdict: Any = None
) -> None:
    """Print a result, and the path of its report on the error stream.

    On a terminal, lines are wrapped at its width, and the answer of `verdict` (a checklist) has a
    colour.
    """
    from runtime.ground.errors import encodable

    text = encodable(text)
    if sys.stdout.isatty() and not json:
        text = on_terminal(text, get_terminal_size().columns, verdict)
    typer.echo(text, nl=not json)
    if results is not None:
        report = str(results.folder / "report.html")
        tell(f"report: {report}", report=report)


def on_terminal(text: str, width: int, verdict: Any = None) -> str:
    """Wrap a text to the width of the terminal, and colour the verdict (Yes, With care, No).

    A table that is wider than the terminal and than a line is printed in parts, each with the first
    column.
    """
    from runtime.ground.table import LINE

    lines: list[str] = []
    for tabular, group in groupby(text.split("\n"), lambda line: bool(re.search(r"\S  +\S", line))):
        block = list(group)
        wide = tabular and max(map(len, block)) > max(width, LINE)
        lines += _in_parts(block, width) if wide else block
    text = "\n".join(_wrapped(line, width) for line in lines)
    if verdict is None:
        return text
    answer = typer.style(verdict.answer, fg=COLOURS.get(verdict.state), bold=True)
    return re.sub(rf"^{verdict.answer}(?=\.)", answer, text, count=1, flags=re.MULTILINE)


def _in_parts(table: list[str], width: int) -> list[str]:
    """Split a table of aligned columns into tables of at most `width`, if it has a first column.

    Columns are separated by at least two blanks at the same place of all lines.
    """
    full = max(map(len, table))
    padded = [line.ljust(full) for line in table]
    blank = "".join(" " if all(line[k] == " " for line in padded) else "x" for k in range(full))
    ends = [match.end() for match in re.finditer(r"x  +", blank)]
    if len(ends) < 2 or len(table) < 2:
        return table
    first, *rest = pairwise([0, *ends, full])
    parts: list[list[tuple[int, int]]] = []
    for column in rest:
        used = first[1] + sum(b - a for a, b in parts[-1]) if parts else width
        fits = used + len(blank[slice(*column)].rstrip()) <= width
        if parts and fits:
            parts[-1].append(column)
        else:
            parts.append([column])
    lines: list[str] = []
    for part in parts:
        lines += [""] if lines else []
        lines += ["".join(row[a:b] for a, b in [first, *part]).rstrip() for row in padded]
    return lines


def _wrapped(line: str, width: int) -> str:
    """Wrap a line between words if it is longer than the terminal is wide."""
    lines = wrap(
        line, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    )
    return "\n".join(lines) if len(line) > width else line


def end(*, good: bool) -> None:
    """End the command with exit code 1 if its answer is negative, for instance the verdict No."""
    if not good:
        raise typer.Exit(NEGATIVE)


def robot_of(
    source: str, *, trust: bool = False, exact: bool = False, base: str | None = None
) -> Robot | GeneratedModel:
    """Load the argument ROBOT of a command: a robot, or a generated module.

    trust : whether to run a module that was not emitted on this machine.
    exact, base : as in `load_robot`.
    """
    from runtime.core.model import load_model
    from runtime.reading.formats import is_measured

    path = Path(source)
    if path.suffix == ".py":
        if base is not None:
            fail(
                f"{source} is a generated module, whose base is that of its robot file; leave out --base"
            )
        return load_model(path, trust=trust)
    if path.is_file() and is_measured(path):
        fail(f"{source} is a measured file; the robot comes first, then the record")
    return described_robot(source, exact=exact, base=base)


def described_robot(
    source: str, at_values: bool = False, exact: bool = False, base: str | None = None
) -> Robot:
    """Load a robot by its name or from a file; doubts about the robot are printed as notes.

    at_values : whether to replace its constants by their values.
    """
    import warnings

    from symgen.derive.doubts import doubts
    from symgen.description import load_robot
    from symgen.description.angles import RobotFileWarning
    from symgen.description.distal import frames_text
    from symgen.description.values import at_values as with_values

    robot = load_robot(source, exact=exact, base=base)
    for sentence in filter(None, (*doubts(robot), frames_text(robot))):
        warnings.warn(sentence, RobotFileWarning, stacklevel=1)
    return with_values(robot) if at_values else robot


def assumptions_of(robot: Robot | GeneratedModel, records: Any, study: Study) -> list[str]:
    """Write a sentence on each parameter that the robot file assumes to be zero.

    It says whether the records contradict the assumption.
    """
    from symgen.description import Robot

    if not isinstance(robot, Robot) or not robot.assume:
        return []
    import runtime
    import symgen
    from runtime.assumptions import assumptions_asked
    from runtime.core.model import load_model

    free = load_model(symgen.model(replace(robot, assume=frozenset())))
    fit = runtime.estimate(free, records, study)
    if fit.status != "ok":
        return ["the record does not determine the model without the assumptions"]
    return [a.text for a in assumptions_asked(free, fit, sorted(robot.assume))]


def study_of_arguments(records: Sequence[str], *, recorded: bool = True) -> Study:
    """Build the study (settings of an identification) from the arguments RECORD of a command.

    File names are relative to the current folder. The first argument is a study file, a dataset or
    a measured file. Each further argument is a measured file with the same columns, units and side,
    and is a separate record.

    recorded : whether the study must name a record.
    """
    from runtime import compose
    from runtime.documents.files import locating_errors
    from runtime.ground.errors import InputError
    from runtime.reading.formats import is_measured
    from runtime.study import located, study_of

    stated, folder = study_of(records[0])
    if Path(records[0]).suffix.lower() in (".yaml", ".yml"):
        with locating_errors(records[0]):
            stated = compose.complete_study(stated)
    study = located(stated, folder)
    if recorded:
        require_record(study, records[0])
    for record in records[1:]:
        if Path(record).suffix.lower() in (".yaml", ".yml") or not is_measured(Path(record)):
            raise InputError(
                "this is no measured file; every RECORD after the first must be a measured file with "
                "the same columns, units and side (joint or motor) as the first",
                file=record,
            )
        like = study.record[-1]
        if len(like.files) > 1:
            raise InputError(
                "the first RECORD has its positions and torques in two files; give further pairs "
                "of files in record.also of a study file",
                file=record,
            )
        further = replace(like, files=(record,), dataset=None, name=None)
        study = replace(study, record=(*study.record, further))
    return study


def suggested_study(
    study: Study, model: GeneratedModel, path: Path, robot: str, *, json: bool = False
) -> Study:
    """Write a study with the settings that the records need to `path`, and say what it sets.

    Settings that names and values do not show are marked `# ?` in the file. The command then ends
    with exit code 0, and says what to fill in and how to go on.

    robot : argument ROBOT, for the next command.
    json : whether the output is JSON only; the sentences then go to the error stream.
    """
    from runtime.compose import reader_of
    from runtime.ground.documents import json_text
    from runtime.ground.errors import InputError
    from runtime.reporting.result_files import write_all
    from runtime.study import suggested

    if path.exists():
        raise InputError(
            "the file for --suggest exists already; choose another name", file=str(path)
        )
    folder = path.resolve().parent
    found = suggested(study, model, missing=reader_of(study.signals).missing)
    write_all(folder, {path.name: found.text(folder)})
    said = [f"{path} is written.", *(f"- {text}" for text in found.sentences)]
    if found.unrecognised:
        said += [
            f"Fill in what the record does not show, marked # ? in {path}:",
            *(f"- {text}" for text in found.unrecognised.values()),
            f"Next: {join(['symgen', 'identify', robot, str(path)])}",
        ]
    else:
        said += ["Check this file before you trust the values."]
    if json:
        for line in said:
            say(line)
    else:
        show("\n".join([*said, *([] if found.unrecognised else [""])]))
    if found.unrecognised:
        if json:
            show(json_text({"study": str(path), "fill_in": found.unrecognised}), json=True)
        raise typer.Exit(0)
    return found.study


def require_record(study: Study, file: str) -> None:
    """Raise InputError if the study of `file` names no record."""
    from runtime.ground.errors import InputError

    if not study.record:
        raise InputError(
            "the study names no record; set record.files, or record.dataset with record.files",
            file=file,
        )


def changed(study: Study, **sections: Mapping[str, Any]) -> Study:
    """Replace settings of a study and check them like a study file; None leaves a setting as is."""
    from runtime.ground.settings import to_mapping
    from runtime.study import study_from_mapping

    mapping = to_mapping(study)
    for section, given in sections.items():
        own = {key: value for key, value in given.items() if value is not None}
        mapping[section] = {**(mapping[section] or {}), **own}
    return study_from_mapping(mapping)


def names_of(text: str | None) -> str | list[str] | None:
    """Split a text of names at its commas; the texts "essential" and "all" stay as they are."""
    return text if text in (None, "essential", "all") else text.split(",")


def stopped(kept: str) -> NoReturn:
    """End the command after Ctrl-C with exit code 130; say what is kept, "" for nothing."""
    rest = f"{kept}: repeat the command to continue" if kept else "nothing is kept"
    typer.echo(f"stopped; {rest}", err=True)
    raise typer.Exit(INTERRUPTED)


@contextmanager
def progress_lines() -> Iterator[None]:
    """Print one line for each stage of long work for the duration of the block.

    Lines are printed on the error stream, after the first two seconds, and equal lines only once.
    """
    import logging
    from time import monotonic

    from runtime.ground.progress import LOGGER

    class Stages(logging.Handler):
        last = ""

        def emit(self, record: logging.LogRecord) -> None:
            if record.getMessage() != self.last:
                self.last = record.getMessage()
                say(self.last)

    start, level = monotonic(), LOGGER.level
    handler = Stages()
    handler.addFilter(lambda record: monotonic() - start > 2.0)
    LOGGER.addHandler(handler)
    LOGGER.setLevel(logging.INFO)
    try:
        yield
    finally:
        LOGGER.removeHandler(handler)
        LOGGER.setLevel(level)


@contextmanager
def progress_bar(what: str) -> Iterator[Any]:
    """Show a progress bar of `what` on the error stream for the duration of the block.

    Yield a function of the number of finished steps and the number of all steps, which updates the
    bar. Where the error stream is no terminal, a line every ten seconds takes its place.
    """
    if as_json():
        yield counter()
        return
    if not sys.stderr.isatty():
        yield lines_of(what)
        return
    from rich import progress as rich
    from rich.console import Console

    columns = (
        rich.TextColumn("{task.description}"),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TextColumn("{task.fields[left]}"),
    )
    left = time_left()
    with rich.Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(what, total=None, left="")

        def update(done: int, total: int) -> None:
            seconds = left(done, total)
            text = "" if seconds is None else f"{timedelta(seconds=round(seconds))} left"
            progress.update(task, completed=done, total=total, left=text)

        yield update
