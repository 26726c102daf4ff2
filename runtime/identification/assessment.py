"""Everything that the records of a robot say about it: the identification, friction, physical
consistency, encoder resolution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from runtime.errors import InputError
from runtime.identification.friction import friction_curves
from runtime.identification.identification import feasibility_of, identify
from runtime.identification.result import Identification
from runtime.limits import LIMIT
from runtime.model.generated import GeneratedModel
from runtime.records.record import Record
from runtime.records.stream import Stream
from runtime.resolution.advisor import advise
from runtime.resolution.cestac import cestac
from runtime.rows.prepared import Prepared
from runtime.settings.study import Study

if TYPE_CHECKING:
    from runtime.loop.simulation import Simulator

T = TypeVar("T")


def assess(
    model: GeneratedModel,
    records: Record | Stream | Sequence[Record | Stream],
    study: Study | None = None,
    *,
    encoder: Sequence[float] = (),
    simulator: Simulator | None = None,
    variants: GeneratedModel | None = None,
    runs: Callable[[], GeneratedModel] | None = None,
    provenance: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] = lambda part: None,
) -> Identification:
    """The identification with friction, physical consistency and encoder resolution, as far as
    records, study and installed extras allow.

    Parameters
    ----------
    model, records, study, simulator, variants, provenance : as for `identify`
    encoder : sequence of float
        Steps of the encoders in use, rad or m; judged like every other check.
    runs : function, optional
        Gives the same model for the runs of the resolution study, such as one in C; asked for
        records of LIMIT.LONG_RECORD samples and more. Default: `model`.
    progress : function of str
        Called with the name of each part before it is computed.

    Returns
    -------
    Identification
        `missing` holds the parts that cannot be computed, each with its reason.
    """
    progress("identification")
    result = identify(
        model,
        records,
        study,
        simulator=simulator,
        variants=variants,
        plausible=True,
        provenance=provenance,
    )
    if not result.determined:
        reason = (
            "friction, physical consistency, encoder resolution: the record does not "
            "determine the parameters"
        )
        return replace(result, missing=(*result.missing, reason))
    missing = list(result.missing)

    def attempt(part: str, compute: Callable[[], T]) -> T | None:
        progress(part)
        try:
            return compute()
        except InputError as e:  # an extra is missing, or the study does not suit the part
            missing.append(f"{part}: {e}")
            return None

    if not result.feasible:
        result = replace(
            result, feasibility=attempt("physical consistency", lambda: feasibility_of(result))
        )
    whole = [own for own in result.prepared if isinstance(own, Prepared)]
    if len(whole) < len(result.prepared):
        missing.append("friction and encoder resolution: they need whole records; set stream: off")
        return replace(result, missing=tuple(missing))
    study, names = result.study, result.essential.names
    columns = names if study.cestac.columns == "essential" else None
    sampled = (
        runs()
        if runs is not None and sum(len(own.record) for own in whole) >= LIMIT.LONG_RECORD
        else model
    )
    curves = attempt("friction", lambda: friction_curves(model, whole, study, result.estimate))
    advice = attempt(
        "resolution advice",
        lambda: advise(sampled, whole, study, columns=names, asked=tuple(encoder)),
    )
    resolution = attempt("resolution study", lambda: cestac(sampled, whole, study, columns=columns))
    return replace(
        result, friction=curves or (), advice=advice, resolution=resolution, missing=tuple(missing)
    )
