"""The option --repair of `symgen identify`: write a mended study, or, without the option, offer to
do so.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from shlex import join
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from runtime.core.model import GeneratedModel
    from runtime.core.record import Record
    from runtime.core.result import Identification
    from runtime.mending.repair import Repair
    from runtime.study import Study
    from symgen.description import Robot


def mended_study(
    described: Robot | GeneratedModel,
    study: Study,
    records: Sequence[Record],
    path: Path,
) -> tuple[Repair, Study]:
    """Repair a study, and write it to `path` if it changes; return the repair and the study.

    described : the robot, as its file describes it.
    """
    from runtime.ground.errors import InputError
    from runtime.reporting.result_files import write_all
    from symgen.update.mended import mended

    if path.exists():
        raise InputError(
            "the file for --repair exists already; choose another name", file=str(path)
        )
    folder = path.resolve().parent
    repair, text = mended(described, study, records, folder)
    if text:
        write_all(folder, {path.name: text})
    return repair, repair.study


def with_repair(
    text: str,
    result: Identification,
    repair: Repair | None,
    arguments: Sequence[str],
    path: Path | None,
) -> str:
    """Print a repair before the verdict, or offer a repair after the verdict.

    text : the printed result, which has the verdict.
    repair : None if no repair was requested.
    arguments : robot and records of the command.
    """
    if repair is None:
        verdict = result.checklist.to_text()
        offer = offered(result, arguments)
        return text.replace(verdict, f"{verdict}\n{offer}", 1) if offer else text
    written = f"written to {path}" if repair.kept else "no study is written"
    return f"{repair.to_text()}\n({written})\n\n{text}"


def offered(result: Identification, arguments: Sequence[str]) -> str:
    """Write the line that offers to repair the first cause; "" if no cause is named."""
    part: Any = result.part("plausibility")
    first = None if part is None else next(iter(part.named), None)
    if first is None or first.fit is None:
        return ""
    command = join(["symgen", "identify", *arguments, "--repair", "repaired.yaml"])
    return f"Repair: {first.cause.says} (computed gain {first.gain:.0f} nats): {command}"


def json_of(result: Identification, repair: Repair | None) -> str:
    """Write the result as JSON, with the entry `repair` if a repair was requested."""
    from runtime.ground.documents import json_text

    if repair is None:
        return result.to_json()
    return json_text({**result.summary(), "repair": repair.summary()})
