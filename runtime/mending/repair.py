"""Repair of a study: find its wrong lines, and judge the corrections on rows that the search did
not use.

    blocks of the records set aside -> search on the others -> judge on those set aside -> lines

Errors are root mean squares over the joints. A repair is kept if it leaves less than REMAINS of all
torques of the unseen rows, and less than SHARE of the error of the study as given. It is also kept
if every change is a named cause (`runtime.plausible`) and the repair leaves less than
REMAINS_NAMED. Unless the change is a unit or a side, the error must fall, since a number that only
the values of the robot file support is a guess. A repair is kept as a whole or not at all: half of
a repair is another error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from runtime.core.model import drives_of, require_no_axes
from runtime.core.problem import Problem
from runtime.core.record import Record
from runtime.ground.check import Check
from runtime.ground.documents import Result
from runtime.ground.errors import InputError
from runtime.ground.limits import limits
from runtime.ground.progress import at
from runtime.ground.settings import structure, to_mapping
from runtime.mending.edits import Columns, Lines, Place, columns_in, differences
from runtime.mending.reading import Data, Reading, record_of, set_aside
from runtime.mending.search import BY_VALUES, Search
from runtime.plausible.case import Case
from runtime.plausible.friction import friction
from runtime.plausible.jumps import cut_torques, jumps
from runtime.plausible.plausibility import case_of
from runtime.plausible.samples import excerpts, samples_of
from runtime.reading.publishers import Sent, of_one_publisher

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True)
class Change(Result):
    """One line of a study that changes.

    Attributes
    ----------
    path : tuple of str and int
        Keys that lead to the line: ("record", 0, "scale", "tau").
    before, after : value
        The value in the given study, and its replacement.
    says : str
        Sentence on the error.
    error_without, error_with : float, %
        Error of the unseen rows with all other changes, and with this change too.
    """

    path: tuple[str | int, ...]
    before: Any
    after: Any
    says: str
    error_without: float
    error_with: float

    @property
    def line(self) -> str:
        """Key and new value on one line: record.scale.tau: [1, -1]."""
        keys = [str(key) for key in self.path if not isinstance(key, int)]
        return f"{'.'.join(keys)}: {_shown(self.after)}"

    @property
    def was(self) -> str:
        """The value before, on one line."""
        return _shown(self.before)

    @property
    def comment(self) -> str:
        """Comment on the line: the value before, the reason for the change, and the error that it
        explains.
        """
        return (
            f"was {self.was}: {self.says}; rows that were not used: "
            f"{self.error_without:.2g} % without this line, {self.error_with:.2g} % with it"
        )


@dataclass(frozen=True)
class Candidate(Result):
    """A set of changes that was not written: its lines, sentences on the errors, and the error that
    is left.

    Attributes
    ----------
    lines, says : tuple of str
    error : float, %
        Error of the unseen rows.
    """

    lines: tuple[str, ...]
    says: tuple[str, ...]
    error: float


@dataclass(frozen=True, eq=False)
class Repair(
    Result,
    keys="kept reason before after changes equivalent apart hidden candidates readings",
):
    """The lines of a study that change, or the candidates if none is certain enough.

    Attributes
    ----------
    kept : bool
        Whether the study changes.
    reason : str
        Reason why the study changes, or why it does not.
    changes : tuple of Change
        Empty if nothing is kept.
    before, after : float, %
        Error of the unseen rows with the study as given, and with the best changes found.
    study : Study
        The study with all changes; the given study if no change is kept.
    records : tuple of Record
        Records as this study reads them.
    equivalent : tuple of Candidate
        Other lines that this record cannot distinguish from the written lines.
    hidden : tuple of str
        Errors that no fit of this record can show, with or without a repair.
    candidates : tuple of Candidate
        Sets of changes that were not certain enough, the one that explains most first; empty if the
        study changes.
    readings : int
        Number of readings for which all causes were tried.
    """

    kept: bool
    reason: str
    changes: tuple[Change, ...]
    before: float
    after: float
    study: Any
    records: tuple[Record, ...]
    equivalent: tuple[Candidate, ...] = ()
    hidden: tuple[str, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    readings: int = 0

    @property
    def apart(self) -> str:
        """Sentence on a test that would distinguish the equivalent readings; "" without such
        readings.
        """
        if not self.equivalent:
            return ""
        return (
            "look at the robot: move one joint by hand, and see whether its position grows about "
            "the positive axis of its frame, and its torque against a push"
        )

    @property
    def comments(self) -> dict[tuple[str | int, ...], str]:
        """Comments of the changed lines, by path."""
        return {change.path: change.comment for change in self.changes}

    def to_text(self) -> str:
        """List the changed lines, their equivalents, or the candidates."""
        lines = [self.reason]
        lines += [f"  {change.line}    # {change.comment}" for change in self.changes]
        if self.equivalent:
            lines.append(f"This record cannot tell this from the following; {self.apart}:")
            lines += [f"  or {'; '.join(one.lines)}" for one in self.equivalent]
        lines += [
            f"  {one.error:.2g} % with {'; '.join(one.lines)} ({'; '.join(one.says)})"
            for one in self.candidates
        ]
        return "\n".join(lines)


def _shown(value: Any) -> str:
    """Write a value on one line, as in a study file."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_shown, value))}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {_shown(x)}' for key, x in value.items())}}}"
    if value is None:
        return "not given"
    return f"{value:g}" if isinstance(value, float) else str(value)


def repair(
    problem: Problem,
    study: Any,
    *,
    records: Sequence[Record],
    variants: Any,
    folder: str | Path | None = None,
) -> Repair:
    """Search for the lines of a study that are wrong, and write the study in which they are right.

    Parameters
    ----------
    problem : Problem
        Prepared.
    study : Study
        The given study, with at least one entry in `record`.
    records : sequence of Record
        Records as they were read, before any preparation step.
    variants : GeneratedModel or None
        The module of `symgen.variants`; without it, no entry of the robot file is corrected.
    folder : str, Path or None
        Folder of the files of the study.

    Raises
    ------
    InputError
        The records are broken (gaps, jumps, cut torques, two publishers), or do not suit the study.
    """
    case = _case(problem, variants)
    lines = to_mapping(study)
    columns = columns_in(problem.model, folder)
    data = data_of(case, problem, lines, columns, records[0].rate)
    start = Reading.given(data, lines)
    if start.baseline is None:
        raise InputError(
            "the rows of the study cannot be fitted; `symgen identify` gives the reason"
        )
    began = process_time()
    found = Search(start, lambda: process_time() - began)
    found.from_start()
    best = found.settled(found.best)
    same = found.hidden(best)
    best, others = _simplest(best, start, found)
    at("repair: the rows that were set aside")
    kept, reason = _judged(best, start)
    hidden = tuple(dict.fromkeys(cause.subject for cause in same))
    if not kept:
        ranked = sorted(found.readings.values(), key=lambda one: one.score(found.N))
        listed = [one for one in ranked if one.steps and best.steps][: LIMIT.BEAM]
        return Repair(
            False,
            reason,
            (),
            start.unseen_error,
            best.unseen_error,
            study,
            tuple(records),
            hidden=hidden,
            candidates=tuple(_candidate(one, start) for one in listed),
            readings=len(found.tried),
        )
    return Repair(
        True,
        reason,
        tuple(_changes(best, start)),
        start.unseen_error,
        best.unseen_error,
        structure(type(study), best.study),
        tuple(record_of(best, one) for one in records),
        equivalent=tuple(_candidate(one, start) for one in others),
        hidden=hidden,
        readings=len(found.tried),
    )


def _case(problem: Problem, variants: Any) -> Case:
    """Prepare the data of a repair; raise InputError for records that are broken or do not suit."""
    problem.require_motion("a repair")
    require_no_axes(problem.model, "the repair of a study")
    for record in (*problem.records, *problem.unseen):
        if record.origin.whole:
            raise InputError(
                f"the record {record.origin.whole} has gaps and is read in pieces; a study is "
                "repaired on whole records only",
                file=record.file,
            )
        _require_one_publisher(record)
    case = case_of(problem, variants)
    if isinstance(case, Check):
        raise InputError(f"the study is not repaired: {case.finding}")
    for check in (jumps, cut_torques, friction):
        answer = check(case)
        if answer is not None and answer.state in ("no", "doubtful"):
            raise InputError(f"the study is not repaired: {answer.finding}")
    if case.silent:
        raise InputError(f"the study is not repaired: {case.silent}")
    return case


def _require_one_publisher(record: Record) -> None:
    """Raise InputError if some samples of a record seem to be those of a second publisher."""
    sent = Sent(
        topic=record.name,
        file=record.file,
        senders=("",) * len(record),
        stamps=np.round(1e9 * (record.t - record.t[0])).astype(np.int64),
        values=np.hstack([record.q, record.tau]),
        efforts=np.arange(2 * record.n) >= record.n,
    )
    kept, note = of_one_publisher(sent)
    if note or not kept.all():
        raise sent.refused(note)


def data_of(case: Case, problem: Problem, study: Lines, columns: Columns, rate: float) -> Data:
    """Set blocks of the records aside, before anything is searched."""
    samples = case.samples
    seen, aside = set_aside(samples, 1 / samples.cutoff)
    unseen = None
    if case.unseen:
        unseen = samples_of([part for one in case.unseen for part in excerpts(one)], case.study)
        unseen = replace(unseen, record=unseen.record + len(case.through))
    place = Place(
        joints=tuple(int(j) for j in problem.model.JOINTS),
        turning=case.turning,
        drives=drives_of(problem.model),
        rate=rate,
        timed=study["record"][0]["rate"] is None,
        columns=columns,
    )
    return Data(case, samples, seen, aside, unseen, place)


def _weight(reading: Reading, start: Reading) -> tuple[int, int]:
    """Count the values that differ from the given study, and how many of these describe the robot."""
    count = of_robot = 0
    for line in differences(start.study, reading.study):
        path, before, after = line["path"], line["before"], line["after"]
        if path[0] in ("validate", "payload") or (path[0] == "record" and path[1] != 0):
            continue
        number = 1
        if isinstance(after, list) and path[-1] != "gravity":
            other = before if isinstance(before, list) else [before] * len(after)
            number = sum(a != b for a, b in zip(other, after, strict=False)) or 1
        count += number
        of_robot += number * (path[0] == "robot")
    return count, of_robot


def _simplest(best: Reading, start: Reading, found: Search) -> tuple[Reading, list[Reading]]:
    """Choose the simplest of the readings that this record cannot distinguish from the best.

    Return this reading, and the others that are as simple as the best.
    """
    if not best.steps:
        return best, []
    weight = _weight(best, start)
    N = found.N
    level = best.score(N) - best.price(N)
    hidden = [best.changed(cause, named=True) for cause in found.hidden(best)]
    others = [
        one
        for one in sorted(found.readings.values(), key=lambda one: one.score(N))
        if one.steps and one.score(N) - one.price(N) < level + LIMIT.SAME
    ]
    alike: dict[str, Reading] = {}
    for one in (best, *hidden, *others):  # other amounts of the same numbers are no other reading
        if one is not None and all(one.subjects != x.subjects for x in alike.values()):
            alike.setdefault(one.key, one)
    simple = [one for one in alike.values() if _weight(one, start)[0] <= weight[0] and one.steps]
    chosen = min(simple, key=lambda one: (_weight(one, start), one is not best))
    return chosen, [one for one in simple if one is not chosen and one.key != start.key]


def _judged(best: Reading, start: Reading) -> tuple[bool, str]:
    """Judge the best reading on the rows that were set aside: whether it is kept, and why."""
    if not best.steps:
        return False, (
            f"Nothing changes: no change of the study explains the record better; rows that were "
            f"not used: {start.unseen_error:.2g} % unexplained."
        )
    before, after = start.unseen_error, best.unseen_error
    told = f"rows that were not used: {before:.2g} % unexplained as given, {after:.2g} % with"
    fitted = sum(step.numbers for step in best.steps if step.kind not in ("gravity", "delay"))
    if fitted > LIMIT.MOST_NUMBERS:
        return False, (
            f"Nothing changes: {told} changes that fit {fitted} numbers, which may hide another error."
        )
    if best.unseen_total < LIMIT.REMAINS and after < LIMIT.SHARE * before:
        return True, f"{len(best.steps)} changed; {told} all changes."
    shown = after < before / LIMIT.SHOWN or {step.kind for step in best.steps} <= {*BY_VALUES}
    if best.named and shown and best.unseen_total < LIMIT.REMAINS_NAMED:
        return True, f"{len(best.steps)} changed, each a decisive cause; {told} all changes."
    return False, (
        f"Nothing changes: the best changes found are not certain enough; {told} them "
        f"({best.unseen_total:.2g} % of all torques); less than {LIMIT.REMAINS:g} % of all torques, "
        f"and less than {LIMIT.SHARE:g} of the given error, is asked."
    )


def lines_of(start: Reading, end: Reading) -> list[Lines]:
    """List the lines that differ between two readings: path, value before, value after.

    If the study does not give an entry of the robot, the value is that of the robot file.
    """
    told = []
    for line in differences(start.study, end.study):
        path = line["path"]
        if line["before"] is None and path[0] == "robot":
            line["before"] = start.of_robot(path[1:])
        told.append(line)
    return told


def _candidate(reading: Reading, start: Reading) -> Candidate:
    """Write a reading as its lines."""
    lines = [
        Change(**line, says="", error_without=0.0, error_with=0.0)
        for line in lines_of(start, reading)
    ]
    texts = dict.fromkeys(one.line for one in lines)
    says = tuple(step.says for step in reading.steps)
    return Candidate(tuple(texts), says, reading.unseen_error)


def _changes(best: Reading, start: Reading) -> list[Change]:
    """Write each changed line, with the steps that change it.

    A line belongs to the steps without which it would have another value.
    """
    after = best.unseen_error
    told: dict[tuple[str | int, ...], list[tuple[str, float]]] = {}
    for step in best.steps:
        others = start.again([one for one in best.steps if one is not step])
        if others is None:
            continue
        for line in lines_of(others, best):
            told.setdefault(line["path"], []).append((step.says, others.unseen_error))
    every = "; ".join(step.says for step in best.steps)
    changes = []
    for line in lines_of(start, best):
        own = told.get(line["path"], [(every, start.unseen_error)])
        says = ", and ".join(dict.fromkeys(text for text, _ in own))
        without = max(error for _, error in own)
        changes.append(Change(**line, says=says, error_without=without, error_with=after))
    return changes
