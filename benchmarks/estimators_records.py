"""Every estimator on the measured records: tables of benchmarks/estimators_measured.md.

    python benchmarks/estimators_records.py [-o benchmarks/estimators_measured.md]

EMPS: identified on one record, torque predicted on the other, and the position simulated with the
parameters found, with and without the tick of delay of the diagram. TX40: first half of the window
predicts the second. All methods of a table use the same rows. Records: `symgen datasets`.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import sys

import numpy as np
from scipy.io import loadmat
from simulation import LAW

from runtime import load_model
from runtime.compose import estimate_of
from runtime.core.model import GeneratedModel
from runtime.core.rows.observation import Observation
from runtime.core.study import EstimateSettings
from runtime.ground.errors import InputError
from runtime.ground.table import aligned
from runtime.loop.reference import Reference
from runtime.loop.simulation import Simulator
from runtime.reading.datasets import dataset_study, fetch
from runtime.reading.records import read_records
from runtime.study import Study, study_from_mapping

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
from problems import loop_of_records

GENERATED = Path(__file__).resolve().parents[1] / "generated"
TEXT = Path(__file__).with_name("estimators_records.md")


def predicted(seen: Observation, X: np.ndarray) -> float:
    """100 ||Y - W X||/||Y||."""
    return 100 * float(np.linalg.norm(seen.Y - seen.W @ X) / np.linalg.norm(seen.Y))


def emps() -> str:
    """Parameters by every method on each record, error on both, error of the simulated position
    without and with delay.
    """
    model, study = (
        load_model("emps", folder=GENERATED, trust=True),
        study_from_mapping(dataset_study("emps")),
    )
    records = read_records(study.record + study.validate.record, model)
    gain = (
        float(study.controller.law.gain)
        if not isinstance(study.controller.law.gain, tuple)
        else study.controller.law.gain[0]
    )
    pulses = gain * loadmat(fetch("emps", "DATA_EMPS_PULSES.mat"))["pulses_N"].astype(float)
    simulators = [Simulator(model, replace(study.controller, delay=delay)) for delay in (0, 1)]
    references = [
        Reference.sampled(record.q_r, 1000.0) for record in records if record.q_r is not None
    ]
    head = (
        "identified on",
        "method",
        *model.BASE_PARAMETERS,
        *(f"%sigma {n}" for n in model.BASE_PARAMETERS),
        "own %",
        "other %",
        "q %, delay 0",
        "delay 1",
    )
    lines: list[Sequence[str]] = [head]
    for k, record in enumerate(records):
        other = loop_of_records(model, [records[1 - k]], study, simulators[0]).measured()
        for label, delay, settings in EMPS_METHODS:
            if k == 1 and settings.method in ("iv", "didim"):
                # the pulses enter behind the controller: this loop is not simulated from its
                # reference alone
                continue
            seen = loop_of_records(model, [record], study, simulators[delay]).measured()
            found = estimate_of(seen, settings, model=model)
            errors = []
            for simulator in simulators:
                run = simulator.run(
                    found.X,
                    references[k],
                    start=record.q[0],
                    ideal=True,
                    disturbance=pulses if k else None,
                )
                errors.append(
                    100
                    * float(np.linalg.norm((run.q - record.q)[49:]) / np.linalg.norm(record.q[49:]))
                )
            cells = [*(f"{x:.3f}" for x in found.X), *(f"{s:.2f}" for s in found.relative_sigma)]
            lines.append(
                (
                    record.name,
                    label,
                    *cells,
                    f"{predicted(seen, found.X):.3f}",
                    f"{predicted(other, found.X):.3f}",
                    *(f"{e:.5f}" for e in errors),
                )
            )
    return aligned(lines)


IV = {"start": "values", "gains": "values", "reference": "measured"}
EMPS_METHODS: tuple[tuple[str, int, EstimateSettings], ...] = (
    ("ols", 0, EstimateSettings()),
    ("wls", 0, EstimateSettings("wls")),
    ("irls", 0, EstimateSettings("irls")),
    ("iv", 0, EstimateSettings("iv")),
    ("iv, delay", 1, EstimateSettings("iv")),
    ("didim", 0, EstimateSettings("didim")),
    ("didim, delay", 1, EstimateSettings("didim")),
)


def tx40_rows(low_speed: float, around: float) -> tuple[GeneratedModel, Study, Observation]:
    """Rows of the TX40 record in the loop that is assumed, without the median filter."""
    model, mapping = load_model("tx40", folder=GENERATED, trust=True), dict(dataset_study("tx40"))
    mapping["signals"] = {**mapping["signals"], "median": 1, "torque_median": 1}
    mapping["rows"] = {**mapping["rows"], "low_speed": low_speed}
    mapping["controller"] = {"law": LAW, "rate": 5000, "torque": {"saturation": None}}
    study = study_from_mapping(mapping)
    record = read_records(study.record, model)[0]
    until = int(np.searchsorted(record.t, 7.6))
    record = replace(record, t=record.t[:until], q=record.q[:until], tau=record.tau[:until])
    seen = loop_of_records(
        model,
        [record],
        study,
        Simulator(model, study.controller),
        reference="measured",
        around=around,
    ).measured()
    return model, study, seen


def agreement() -> str:
    """Largest difference of IV from WLS in corrected sigmas of IV, with every row and without slow
    ones.
    """
    lines: list[Sequence[str]] = [
        ("rows", "per joint", "largest |IV - WLS|/sigma", "of", "WLS", "IV")
    ]
    for label, low_speed, around in (
        ("all", 0.0, 0.0),
        ("without slower than 0.1 rad/s and 0.05 s around", 0.1, 0.05),
    ):
        model, _, seen = tx40_rows(low_speed, around)
        least, iv = (
            estimate_of(seen, EstimateSettings(m, options=IV if m == "iv" else {}), model=model)
            for m in ("wls", "iv")
        )
        z = np.abs(iv.X - least.X) / iv.sigma_corrected
        k = int(np.argmax(z))
        lines.append(
            (
                label,
                f"{min(seen.rows)} to {max(seen.rows)}",
                f"{z[k]:.1f}",
                seen.names[k],
                f"{least.X[k]:.4g}",
                f"{iv.X[k]:.4g}",
            )
        )
    return aligned(lines)


def tx40(methods: Sequence[str]) -> str:
    """Errors by joint and held out, on the window of the chapter."""
    model, study, seen = tx40_rows(0.0, 0.0)
    first, second = (seen.between(*window) for window in study.validate.split)
    options: Mapping[str, Mapping[str, Any]] = {
        "iv": IV,
        "feasible": {
            "prior": "none",
            "reach": None,
        },  # the conditions alone: the values of the robot file are from Table 2
    }
    lines: list[Sequence[str]] = [
        ("method", "status", *(f"joint {j} %" for j in model.JOINTS), "total %", "held out %")
    ]
    for method in methods:
        settings = EstimateSettings(method, options=options.get(method, {}))  # type: ignore[arg-type]
        try:
            e = estimate_of(seen, settings, model=model)
            held = predicted(second, estimate_of(first, settings, model=model).X)
        except InputError as error:
            lines.append((method, str(error)))
            continue
        lines.append(
            (
                method,
                e.status,
                *(f"{joint.relative_error:.2f}" for joint in e.per_joint),
                f"{e.relative_error:.3f}",
                f"{held:.2f}",
            )
        )
    return aligned(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("benchmarks/estimators_measured.md")
    )
    parser.add_argument("--methods", nargs="+", default=["ols", "wls", "irls", "iv", "feasible"])
    given = parser.parse_args()
    page = TEXT.read_text().format(
        emps=emps(),
        errors=tx40(given.methods),
        agreement=agreement(),
    )
    print(page)
    given.output.write_text(page)


if __name__ == "__main__":
    main()
