"""A resolution study: its text, its sections and its page."""

from __future__ import annotations

from collections.abc import Sequence

from runtime.reporting import figures as plots
from runtime.reporting.page import Number, Section, State
from runtime.resolution.result import Cestac


def resolution_section(
    result: Cestac,
    title: str = "Encoder resolution",
    *,
    curve: Cestac | None = None,
    names: Sequence[str] = (),
) -> Section:
    """Table 3 of the chapter with %e and %sigma, both readings of %e(rho), and the curve of %e
    against Delta.
    """
    shown = curve or result
    several = sum(1 for r in shown.levels if r.level.delta and not r.level.torque) > 0
    image = (
        plots.drawn(
            "%e against resolution; dotted: the limits of the verdict, 1 % and 5 %; dashed: "
            "increase of the residual norm in % of |Y|; grey: the "
            "other parameters that decide",
            plots.error_against_resolution(shown, names),
            "Change of the estimates in per cent against encoder resolution, logarithmic axes",
            "resolution",
        )
        if several
        else None
    )
    text = (
        "Two verdicts stand below. The printed rule asks every parameter that decides, and "
        "%e(rho), to stay below 1 % (practically unbiased) and calls "
        "5 % biased. The chapter's section 4.1.4 calls the residual the best single indicator, as "
        "it sees the whole model: the last verdict applies "
        "the same limits to the increase of its norm alone.",
        *(f"{r.level.label}: {r.message}" for r in result.levels),
        *result.notes,
    )
    return Section(
        title,
        text,
        [image] if image else [],
        [result.mean_table(), result.error_table(), result.residual_table()],
    )


def level_numbers(result: Cestac) -> list[Number]:
    """The verdict of every step, for the head of a page."""
    states: dict[str, State] = {"unbiased": "good", "doubtful": "doubtful", "biased": "no"}
    return [Number(r.level.label, r.verdict, states[r.verdict]) for r in result.levels]
