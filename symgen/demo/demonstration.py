"""The computations of the demo: identification, resolution study, and what other choices would have given.

Settings are those of the dataset and of design defaults, chosen before looking at the published tables; nothing is tuned to them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi
from typing import Any

from runtime.estimators.essential import essential
from runtime.estimators.estimate import Estimate
from runtime.identification.identification import Identification, identification, recoupled
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel
from runtime.observation.observation import observe
from runtime.records.record import Record
from runtime.resolution.cestac import cestac
from runtime.resolution.result import Cestac
from runtime.settings.study import CestacSettings, EstimateSettings, Lowpass, Signals, Study
from symgen.cli.session import origin
from symgen.demo.chapter_tables import DELTA, PHI

SWEEP = tuple(2 * pi / counts for counts in (50000, 20000, 10000, 5000, 2000, 1000, 500))  # rad
FASTER = 100.0  # Hz, the other cut-off
SLOW = 0.01  # of the top speed of each joint: rows below it are left out in a variant
Step = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Demonstration:
    """combinations, variants : by label; empty in the quick form, as are curve and torque."""

    found: Identification
    resolution: Cestac
    curve: Cestac | None
    torque: Cestac | None
    combinations: Mapping[str, Cestac]
    variants: Mapping[str, tuple[Estimate, Estimate]]

    @property
    def simulated(self) -> bool:
        """Whether nothing was measured."""
        return self.found.source == "simulated"


def demonstrate(model: GeneratedModel, study: Study, record: Record, *, quick: bool, step: Step) -> Demonstration:
    """Everything the report of the demo shows. step : told what begins."""
    study = replace(study, cestac=CestacSettings(delta=DELTA, runs=2 if quick else study.cestac.runs))
    step("identification")
    provenance = origin([record])
    found = identification(model, study, [record], provenance=provenance)
    names = found.found.names

    def resolution(changed: Study, **settings: Any) -> Cestac:
        changed = replace(changed, cestac=replace(changed.cestac, **settings))
        columns = None if changed.cestac.columns != "essential" else names
        return cestac(model, record, changed, columns=columns, provenance=provenance)

    step("encoder resolution")
    main = resolution(study)
    if quick:
        return Demonstration(found, main, None, None, {}, {})
    step("curve of %e against resolution")
    curve = resolution(study, delta=SWEEP)
    step("torque resolution")
    torque = resolution(study, delta=DELTA[:1], torque=PHI)
    combinations = {"essential, two-point, joint side, no median, 50 Hz (the defaults)": main}
    for label, changed, settings in _combinations(study, len(model.BASE_PARAMETERS)):
        step(label)
        combinations[label] = resolution(changed, **settings)
    step("other treatments of the record")
    return Demonstration(found, main, curve, torque, combinations, variants(model, study, record))


def _combinations(study: Study, b: int) -> list[tuple[str, Study, dict[str, Any]]]:
    """One choice changed at a time."""
    return [
        (f"all {b} columns", study, {"columns": "all"}),
        ("motor side", study, {"side": "motor"}),
        ("uniform", study, {"rounding": "uniform"}),
        ("gaussian", study, {"rounding": "gaussian"}),
        ("true quantisation", study, {"rounding": "quantise"}),
        (f"median window {Signals().median}", study, {"median": Signals().median}),
        (f"{FASTER:g} Hz", _faster(study), {}),
    ]


def variants(model: GeneratedModel, study: Study, record: Record) -> dict[str, tuple[Estimate, Estimate]]:
    """(all, essential) estimates under other treatments of the same record, one changed at a time."""
    slow = tuple(SLOW * float(limit) for limit in model.LIMITS["qd"])
    slower = tuple(3 * limit for limit in slow)
    t1 = float(record.t[-1])
    choices: dict[str, tuple[Study, Record]] = {
        "as in this report": (study, record),
        f"rows below {SLOW:.0%} of top speed left out": (replace(study, rows=replace(study.rows, low_speed=slow)), record),
        f"rows below {3 * SLOW:.0%} of top speed left out": (replace(study, rows=replace(study.rows, low_speed=slower)), record),
        "whole record, rest included": (replace(study, rows=replace(study.rows, window=(0.0, t1))), record),
        "no median filter": (replace(study, signals=replace(study.signals, median=1)), record),
        f"{FASTER:g} Hz": (_faster(study), record),
        "rows weighted by joint": (replace(study, estimate=EstimateSettings(method="wls")), record),
        "torque 2 ms later": (study, _delayed(record, 2e-3)),
    }
    if model.DRIVES is not None:
        drives = Drives.from_mapping(model.DRIVES)
        choices["drives without coupling"] = (study, recoupled(record, drives, drives.decoupled("none")))
    fits = {}
    for label, (changed, seen) in choices.items():
        both = essential(observe(model, seen, changed), changed.essential, changed.estimate, model=model)
        fits[label] = (both.all_parameters, both.estimate)
    return fits


def _faster(study: Study) -> Study:
    lowpass = replace(study.signals.lowpass or Lowpass(), cutoff=FASTER)
    return replace(study, signals=replace(study.signals, lowpass=lowpass))


def _delayed(record: Record, delay: float) -> Record:
    """The record with every torque moved to a later instant, s."""
    k = round(delay * record.rate)
    return replace(record, t=record.t[k:], q=record.q[k:], tau=record.tau[:-k])
