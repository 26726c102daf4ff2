"""What is said beside the parameters: physical consistency, a load, friction curves, encoder resolution; text, JSON, sections and files of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from runtime.estimators.estimate import Estimate
    from runtime.estimators.feasibility import Feasibility
    from runtime.identification.friction import FrictionCurve
    from runtime.identification.identification import Identification
    from runtime.identification.payload_study import Loads
    from runtime.model.generated import GeneratedModel
    from runtime.records.record import Record
    from runtime.records.stream import Stream
    from runtime.reporting.page import Section
    from runtime.resolution.advice import Advice
    from runtime.resolution.result import Cestac
    from runtime.settings.study import Study


@dataclass(frozen=True, eq=False)
class Beside:
    """fit : all parameters; a feasible one has its own eigenvalues.   judged : of another method, where asked.   unit : of torques.

    missing : parts that were asked for and could not be done, each with its reason.
    """

    fit: Estimate
    unit: str
    judged: Feasibility | None = None
    loads: Loads | None = None
    friction: tuple[FrictionCurve, ...] = ()
    advice: Advice | None = None
    resolution: Cestac | None = None
    missing: tuple[str, ...] = ()

    @property
    def feasible(self) -> bool:
        """Whether the estimate was made under the conditions of a physical robot."""
        return "standard" in self.fit.details

    def text(self) -> str:
        """Paragraphs of the console."""
        parts = []
        if self.feasible:
            from runtime.reporting.physical import eigenvalue_table

            parts.append(eigenvalue_table(self.fit))
        if self.judged is not None:
            parts.append(f"The parameters are {self.judged.text}.")
        if self.loads is not None:
            parts.append(self.loads.to_table())
        parts += [curve.to_table() for curve in self.friction]
        parts += [] if self.advice is None else [self.advice.verdict]
        parts += [] if self.resolution is None else [self.resolution.to_table()]
        return "\n\n".join([*parts, *self.missing])

    def summary(self) -> dict[str, Any]:
        """Entries of estimate.json."""
        found: dict[str, Any] = {}
        if self.judged is not None:
            blocking = [{"condition": name, "margin": t} for name, t in self.judged.blocking]
            found["feasibility"] = {"feasible": self.judged.feasible, "margin": self.judged.margin, "blocking": blocking}
        if self.loads is not None:
            found |= self.loads.summary()
        return {**found, **({"friction": [curve.summary() for curve in self.friction]} if self.friction else {})}

    def sections(self) -> list[Section]:
        """Sections of the report."""
        from runtime.reporting.friction import friction_section
        from runtime.reporting.page import Section
        from runtime.reporting.payload import loads_section
        from runtime.reporting.physical import physical_section
        from runtime.reporting.resolution_advice import advice_section
        from runtime.reporting.sections import resolution_section

        sections = [physical_section(self.fit)] if self.feasible else []
        if self.judged is not None:
            sections.append(Section("Physical consistency", (f"The parameters are {self.judged.text}.",)))
        sections += [] if self.loads is None else [loads_section(self.loads)]
        sections += [friction_section(self.friction, self.unit)] if self.friction else []
        sections += [] if self.advice is None else [advice_section(self.advice)]
        sections += [] if self.resolution is None else [resolution_section(self.resolution, "Resolution study")]
        return [*sections, *([Section("Not done", self.missing)] if self.missing else [])]

    def files(self) -> dict[str, str | bytes]:
        """Further files of the output folder."""
        from runtime.reporting import figures as plots
        from runtime.reporting.friction import friction_figure
        from runtime.reporting.physical import standard_csv
        from symgen.cli.resolution_files import advice_files, cestac_files

        found: dict[str, str | bytes] = {"standard_parameters.csv": standard_csv(self.fit)} if self.feasible else {}
        found |= {"friction.png": plots.png(friction_figure(self.friction, self.unit))} if self.friction else {}
        found |= {} if self.advice is None else advice_files(self.advice)
        return {**found, **({} if self.resolution is None else cestac_files(self.resolution))}


def beside(
    model: GeneratedModel,
    study: Study,
    folder: Path,
    records: Sequence[Record | Stream],
    found: Identification,
    provenance: dict[str, Any],
    *,
    physical: bool = False,
    friction: bool = False,
) -> Beside:
    """What the study and the options ask for; a load and friction curves need whole records."""
    from runtime.errors import InputError
    from runtime.records.record import Record
    from runtime.reporting.sections import torque_unit

    whole = [record for record in records if isinstance(record, Record)]
    if (friction or study.payload is not None) and len(whole) < len(records):
        raise InputError("a load and friction curves need whole records; set stream: off")
    judged, loaded = None, None
    curves: tuple[FrictionCurve, ...] = ()
    if physical and "standard" not in found.every.details:
        judged = judgement(model, found.every)
    if study.payload is not None:
        from runtime.identification.payload_study import loads
        from runtime.records.reading import read_records

        loaded = loads(model, study, whole, read_records(study.payload.record, model, folder=folder), provenance=provenance)
    if friction:
        from runtime.identification.friction import friction_curves

        curves = friction_curves(model, whole, study, found.every)
    return Beside(found.every, torque_unit(found), judged, loaded, curves)


def judgement(model: GeneratedModel, fit: Estimate) -> Feasibility:
    """Whether a physical robot can have the parameters of an estimate."""
    from runtime.estimators.feasibility import feasibility
    from runtime.model.inertia import physical_model

    return feasibility(physical_model(model), fit.names, fit.X)
