"""Search for the errors of a study with the model of a robot, and write the mended study as text."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.update.models import corrected, model_of, variants_of

if TYPE_CHECKING:
    from runtime.core.model import GeneratedModel
    from runtime.core.record import Record
    from runtime.mending.repair import Repair
    from runtime.study import Study
    from symgen.description import Robot

AGREE = 1e-6
"""Of the size of a signal: the written study reads the records as the search did."""


def mended(
    described: Robot | GeneratedModel, study: Study, records: Sequence[Record], folder: Path
) -> tuple[Repair, str]:
    """Repair a study (`runtime.repair`); return the repair, and the text of the mended study.

    described : the robot, as its file describes it.
    records : records of the study.
    folder : folder of the mended study, to which the names of its files are relative.

    The text is "" if nothing changes. Raise InputError if records or study cannot be repaired.
    """
    import runtime
    from runtime.compose import records_of
    from runtime.ground.errors import InputError
    from runtime.study import study_text

    robot = corrected(described, study)
    model = model_of(robot, study=study)
    repair = runtime.repair(model, records, study, variants=variants_of(robot))
    if not repair.kept:
        return repair, ""
    model = model_of(corrected(described, repair.study), study=repair.study)
    for read, meant in zip(
        records_of(repair.study.record, model, repair.study), repair.records, strict=True
    ):
        if not (same(read.q, meant.q) and same(read.tau, meant.tau)):
            raise InputError(
                "the mended study would not have the effect of the changes that were found, so that "
                "nothing is written; make these changes by hand: "
                + "; ".join(change.line for change in repair.changes)
            )
    return repair, study_text(repair.study, folder, defaults=False, comments=repair.comments)


def same(a: Any, b: Any) -> bool:
    """Whether two signals agree, up to rounding."""
    import numpy as np

    return a.shape == b.shape and bool(np.abs(a - b).max() <= AGREE * max(np.abs(b).max(), 1e-300))
