"""The page of the TX40: least squares, resolution, treatments of the record, beside the tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from runtime import Cestac, Estimate, Identification
from runtime.markup import number
from runtime.reporting.files import Files, identification_files, resolution_files
from runtime.reporting.page import Section
from runtime.reporting.resolution import resolution_section
from runtime.resolution.result import LevelResult
from runtime.settings.location import located
from runtime.table import Table
from symgen.demo import tx40_tables as chapter
from symgen.demo.simulated_record import Prepared

COLOURED = ("ZZ1R", "MX2R", "FV1", "FS1", "Ia3", "FS5")


@dataclass(frozen=True, eq=False)
class Demonstration:
    """Everything the report shows.

    Attributes
    ----------
    prepared : Prepared
    result : Identification
    resolution : Cestac
        At the steps of Table 3.
    curve, torque : Cestac or None
        At more position steps, and with the torque steps of Table 4; None in the quick form.
    """

    prepared: Prepared
    result: Identification
    resolution: Cestac
    curve: Cestac | None
    torque: Cestac | None

    @property
    def verdict(self) -> str:
        """One sentence."""
        result, names = self.result, self.result.essential.names
        words = {
            "unbiased": "leave them as they are",
            "doubtful": "make them doubtful",
            "biased": "bias them",
        }
        levels = {
            verdict: [
                r.level.label for r in self.resolution.levels if r.residual_verdict == verdict
            ]
            for verdict in words
        }
        steps = ", ".join(
            f"encoder steps of {' and '.join(labels)} {words[verdict]}"
            for verdict, labels in levels.items()
            if labels
        )
        return (
            f"{'SIMULATED record: ' if self.prepared.note else ''}{len(names)} of "
            f"{len(result.estimate.names)} parameters leave "
            f"{result.essential.estimate.relative_error:.1f} % of the torques of "
            f"{result.model.NAME} unexplained, {result.prediction_error:.1f} % on a half of the "
            "record that the fit has not seen. As to the torques (residual of least squares), "
            f"{steps}.{self.resolution.finer_for_values}"
        )

    def files(self, folder: Path) -> Files:
        """Contents of the output folder, by file name."""
        simulated = bool(self.prepared.note)
        kind = "SIMULATED record, nothing measured" if simulated else "public measured record"
        result = replace(
            self.result,
            problem=self.result.problem.changed(settings=located(self.result.study, folder)),
        )
        files = identification_files(
            result,
            folder,
            title=f"{result.model.NAME}: identification and encoder resolution, {kind}",
            verdict=self.verdict,
            warning="The measured record was not available." if simulated else "",
            sections=sections(self),
        )
        return {**files, **resolution_files(self.resolution), **self.prepared.files}


def sections(demo: Demonstration) -> list[Section]:
    """Table 2, Table 3 with the curve, Table 4, contradictions."""
    sections = [_table_2(demo), _table_3(demo)]
    title = "Encoder resolution: %e, residual and verdict"
    sections.append(resolution_section(demo.resolution, title, curve=demo.curve, names=COLOURED))
    if demo.torque is not None:
        sections.append(_table_4(demo.torque))
    title = "Where the chapter contradicts itself, and what is done here"
    return [*sections, Section(title, chapter.CONTRADICTIONS)]


def differences(demo: Demonstration) -> dict[str, float]:
    """Difference from Table 2 in %, of the parameters of Table 2 that stay essential."""
    fit = demo.result.essential.estimate
    return {n: percent(fit[n], value) for n, value in chapter.TABLE_2.items() if n in fit.names}


def percent(value: float, reference: float) -> float:
    """100 (value/reference - 1)."""
    return 100 * (value / reference - 1)


def _fitted(fit: Estimate, name: str) -> tuple[str, str, str]:
    """Value, difference from Table 2 in % and %sigma; of a parameter that was removed, so."""
    if name not in fit.names:
        return "removed", "-", "-"
    x, sigma = fit[name], fit.relative_sigma[fit.names.index(name)]
    return number(x), f"{percent(x, chapter.TABLE_2[name]):+.1f}", number(sigma, ".2f")


def _table_2(demo: Demonstration) -> Section:
    """Least squares: the chapter's values, ours from the essential and from all parameters."""
    fits = (demo.result.essential.estimate, demo.result.estimate)
    rows = [
        (
            name,
            number(value),
            number(chapter.TABLE_2_SIGMA[name], ".2f"),
            *(cell for fit in fits for cell in _fitted(fit, name)),
        )
        for name, value in chapter.TABLE_2.items()
    ]
    ours = ("ours, essential", "difference %", "%sigma", "ours, all", "difference % ", "%sigma ")
    off = differences(demo)
    within = {limit: sum(abs(d) <= limit for d in off.values()) for limit in (10, 20, 40)}
    text = [
        "Settings were fixed before the tables were compared and are the same for every number in "
        "this report: motor side with coupled drives, median window 5, Butterworth of order 4 at "
        "50 Hz forward and backward on q and qd, decimation by eq. (13), motion only (t < 7.5 s), "
        "ordinary least squares, threshold 1.04. No row is left out for low speed. The resolution "
        "study alone has no median window, which would enlarge the bias. The complete list is at "
        "the end.",
        f"Of the {len(chapter.TABLE_2)} parameters of Table 2, {len(off)} stay essential: "
        f"{within[10]} agree within 10 %, {within[20]} within 20 %, {within[40]} within 40 %. The "
        "record is not that of the chapter (5592 rows of W against 42620), so per cents are what "
        "can be expected.",
        "More than 10 % off: "
        + (", ".join(f"{name} {d:+.0f} %" for name, d in off.items() if abs(d) > 10) or "none")
        + ".",
    ]
    if demo.prepared.note:
        text = [
            "This record is simulated from a parameter set that has the values of Table 2: "
            "agreement here says that the software returns what was put in, not that it agrees "
            "with a measured robot."
        ]
    table = Table("Values in SI units", ("parameter", "Table 2", "its %sigma", *ours), rows)
    return Section("Table 2: least squares, chapter and ours", text, tables=[table])


def _table_3(demo: Demonstration) -> Section:
    """Mean values by resolution: chapter, ours, difference."""
    levels = demo.resolution.levels
    labels = [(f"Table 3, {level.level.label}", "ours") for level in levels]
    table = _compared(
        demo.resolution,
        chapter.TABLE_3,
        levels,
        labels,
        "Values in SI units; %: difference",
        [
            (text, f"{r.increase:.2f}")
            for text, r in zip(chapter.TABLE_3_RESIDUAL, levels, strict=True)
        ],
    )
    text = (
        f"Means of {len(levels[0].runs)} runs. %e(rho) is set beside the increase of the residual "
        "norm in per cent of |Y|, the reading with the printed order; all four readings are "
        "below. Parameters that do not stay essential here have no column in the study and are "
        "left out.",
    )
    return Section("Table 3: encoder resolution, chapter and ours", text, tables=[table])


def _table_4(result: Cestac) -> Section:
    """Torque steps alone, and with the first position step."""
    torque = [r for r in result.levels if r.level.torque]
    alone, both = (
        [r for r in torque if bool(r.level.delta) is rounded] for rounded in (False, True)
    )
    positions = both[0].level.label.split(" + ")[0]
    tables = [
        _compared(
            result,
            chapter.TABLE_4,
            levels,
            [
                (f"Table 4, Phi {k}", f"ours, {r.level.torque:g} N m")
                for k, r in enumerate(levels, start=1)
            ],
            caption,
            [
                (text, f"{r.increase:.3f}")
                for text, r in zip(chapter.TABLE_4_RESIDUAL, levels, strict=True)
            ],
        )
        for caption, levels in (
            ("Torque steps alone", alone),
            (f"Torque steps with position steps of {positions}", both),
        )
    ]
    text = (
        "The chapter does not give Phi. Here the motor torque is rounded in steps of "
        f"{', '.join(f'{phi:g}' for phi in chapter.PHI)} N m on the motor side, each five times "
        "the one before. As in the chapter there is no lower limit for the torque resolution in "
        "this range.",
    )
    return Section("Table 4: torque resolution, chapter and ours", text, tables=tables)


def _compared(
    result: Cestac,
    published: Mapping[str, Sequence[float]],
    levels: Sequence[LevelResult],
    labels: Sequence[tuple[str, str]],
    caption: str,
    residual: Sequence[tuple[str, str]],
) -> Table:
    """Published mean, ours and their difference in % at every level; the residual at the end."""
    rows: list[tuple[str, ...]] = []
    for name in (n for n in published if n in result.names):
        means = [float(level.mean[result.names.index(name)]) for level in levels]
        cells = [
            (number(value), number(mean), f"{percent(mean, value):+.1f}")
            for value, mean in zip(published[name], means, strict=True)
        ]
        rows.append((name, *(cell for triple in cells for cell in triple)))
    rows.append(("%e(rho)", *(cell for pair in residual for cell in (*pair, "-"))))
    header = ("parameter", *(cell for pair in labels for cell in (*pair, "%")))
    return Table(caption, header, rows)
