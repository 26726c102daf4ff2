"""Coarse encoders made fine: the TX40 record at steps of 2 pi/5000 to 2 pi/100, read as positions and read as counts; measured, or else simulated.

    prepared = prepare(quick=False)                 # model, study, record: those of the TX40 demonstration
    demo = demonstrate(prepared, quick=False)       # two resolution studies by law phase
    demo.verdict, demo.files(folder)

Both readers get the same rounded positions: counts of a real encoder, the phase of every encoder random. Nothing of the fine record is told to either.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path
from typing import Literal

import runtime
from runtime import Cestac, Study
from runtime.reporting.files import Files, page_files, resolution_files
from runtime.reporting.page import Page
from runtime.reporting.pages import settings_section
from runtime.reporting.resolution import resolution_section
from runtime.reporting.resolution_readers import errors, readers_section, readers_table
from runtime.settings.location import located, study_text
from runtime.settings.study import CestacSettings
from symgen.demo.simulated_record import Prepared
from symgen.demo.tx40 import prepare

STEPS = tuple(2 * pi / counts for counts in (5000, 2000, 1000, 500, 250, 100))  # rad, at the joints
FEW = (STEPS[0], STEPS[2], STEPS[4])
SHOWN = 2  # of STEPS, told in the verdict
KEY = "ZZ1R"
MAIN = (
    "ZZ1R",
    "FV1",
    "FS1",
    "XX2R",
    "ZZ2R",
    "MX2R",
    "FV2",
    "FS2",
    "MY3R",
    "Ia3",
    "FV3",
    "FS3",
    "Ia4",
    "FV4",
    "FS4",
    "Ia5",
    "FV5",
    "FS5",
    "FV6",
)
TEXT = (
    "The encoders are those of the record made coarser: every position becomes the nearest of the points phi + k Delta, phi random for each joint and run, as a "
    "real encoder has it. Torques are as recorded. Then both ways of reading:",
    "As positions, the usual way: counts times step, low-pass, two differences, least squares. The error of a count is taken for white noise.",
    "As counts: at every sample the joint is within its interval, and it passed a known position when the count changed. The smoothest motion "
    "between these bounds goes through the same filters; dry friction is told how sure the sign of a slow speed is.",
    "%e is the change of a parameter from the estimate of the record as it is, the positions of which are far finer than any of these steps.",
)

__all__ = ["Demonstration", "demonstrate", "prepare"]


@dataclass(frozen=True, eq=False)
class Demonstration:
    """Everything the report shows.

    Attributes
    ----------
    prepared : Prepared
    study : Study
        Of the reader of counts.
    by_positions, by_counts : Cestac
        The same steps and draws, by both readers.
    """

    prepared: Prepared
    study: Study
    by_positions: Cestac
    by_counts: Cestac

    @property
    def names(self) -> tuple[str, ...]:
        """The main parameters that stay essential."""
        return tuple(name for name in MAIN if name in self.by_counts.names)

    @property
    def verdict(self) -> str:
        """One sentence."""
        found = [errors(result, self.names)[1] for result in (self.by_positions, self.by_counts)]
        k = min(SHOWN, len(self.by_counts.levels) - 1)
        i = self.by_counts.names.index(KEY)
        means = [result.levels[k].mean[i] for result in (self.by_positions, self.by_counts)]
        return (
            f"{'SIMULATED record: ' if self.prepared.note else ''}with encoder steps of {self.by_counts.levels[k].level.label} at the joints of "
            f"{self.prepared.model.NAME}, {len(self.names)} main parameters change by {found[0][k]:.1f} % rms read as positions and by {found[1][k]:.1f} % "
            f"read as counts; {KEY} is {means[0]:.3f} and {means[1]:.3f}, {self.by_counts.reference.X[i]:.3f} from the record as it is."
        )

    def files(self, folder: Path) -> Files:
        """Contents of the output folder, by file name."""
        text = study_text(located(self.study, folder), folder)
        page = Page(
            title=f"{self.prepared.model.NAME}: coarse encoders, read as positions and as counts",
            verdict=self.verdict,
            warning="The measured record was not available." if self.prepared.note else "",
            sections=[
                readers_section(self.by_positions, self.by_counts, self.names, KEY, TEXT),
                resolution_section(self.by_counts, "Read as counts, parameter by parameter"),
                settings_section(text),
            ],
        )
        return {
            **page_files(page),
            "study.yaml": text,
            **resolution_files(self.by_counts),
            "positions.json": self.by_positions.to_json(),
            "readers.txt": readers_table(self.by_positions, self.by_counts, self.names, KEY).to_text() + "\n",
            **self.prepared.files,
        }


def demonstrate(prepared: Prepared, *, quick: bool, progress: Callable[[str], None] = lambda step: None) -> Demonstration:
    """The computations. progress : called with the name of each before it begins."""
    model, record = prepared.model, prepared.record
    progress("essential parameters of the record as it is")
    names = runtime.essential(model, record, prepared.study).names
    steps, runs = (FEW, 2) if quick else (STEPS, 3)

    def read(reader: Literal["lowpass", "counts"]) -> tuple[Study, Cestac]:
        signals = replace(prepared.study.signals, reader=reader)
        study = replace(prepared.study, signals=signals, cestac=CestacSettings(delta=steps, runs=runs, rounding="phase"))
        return study, runtime.cestac(model, record, study, columns=names)

    progress("coarse encoders read as positions")
    by_positions = read("lowpass")[1]
    progress("the same read as counts")
    study, by_counts = read("counts")
    return Demonstration(prepared, study, by_positions, by_counts)
