"""Exciting motion of the TX40 against that of its record, and whether identification finds the
precision that was predicted.

    python benchmarks/excitation.py [--starts 10] [--workers 2] [--records 40] [-o motion.yaml]

1. Parameters, torque deviations and essential columns of the record; search within the limits of
the robot file. Printed: weighted cond(W) of
   the record's motion and of the one found, wall time, share of the limits used at 5 kHz. Goal: at
   most half, in less than 5 minutes of two cores.
2. The motion as the reference of a simulated closed loop with known parameters (values of the robot
file), white torque noise of the deviations
   of the record; least squares weighted by joint on so many records. Printed: scatter over
   predicted %sigma, root mean square over the parameters of predicted %sigma below 30, and its
   range. Goal: within 20 %.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML
from simulation import LAW

from runtime import load_model
from runtime.compose import estimate_of, excite, observe
from runtime.core.rows.predicted import kept_correlation
from runtime.core.signals.filters import decimated, decimation_factor
from runtime.excitation.criteria import excesses, plan_rows, weights_of
from runtime.excitation.settings import ExcitationSettings
from runtime.ground.settings import structure
from runtime.loop.control_law import parameters_of
from runtime.loop.reference import Reference
from runtime.loop.settings import Controller
from runtime.loop.simulation import Simulator
from runtime.parallel.processes import processes
from runtime.reading.records import read_records
from runtime.study import study_of

GENERATED = Path(__file__).resolve().parents[1] / "generated"
RATE = 5000.0


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--starts", type=int, default=10)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--records", type=int, default=40)
    parser.add_argument("--criterion", default="cond")
    parser.add_argument("--columns", default="essential")
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args()
    model = load_model("tx40", folder=GENERATED, trust=True)
    study, folder = study_of("tx40")
    (record,) = read_records(study.record, model, folder=folder)
    settings = ExcitationSettings(
        columns=given.columns, starts=given.starts, criterion=given.criterion, rate=RATE
    )
    begin = time.perf_counter()
    with processes(given.workers) as several:
        found = excite(
            model,
            record,
            replace(study, excitation=settings),
            map=several,
            progress=lambda done, total: print(f"  {done} of {total} starts", flush=True),
        )
    wall, known = time.perf_counter() - begin, found.known
    ratio = found.condition / known.condition
    print(
        f"{len(known.weights.names)} columns, weighted cond(W): record {known.condition:.1f}, "
        f"found {found.condition:.1f}, ratio {ratio:.2f}"
    )
    print(
        f"largest predicted %sigma: record {max(known.relative_sigma.values()):.1f}, found "
        f"{max(found.relative_sigma.values()):.1f}"
    )
    print(
        f"motion of {found.motion.duration:.1f} s in {wall:.0f} s of {max(given.workers, 1)} "
        f"processes, margin {found.margin:.2f}"
    )
    print(
        f"limits exceeded at {RATE:g} Hz: "
        f"{len(excesses(model, found.motion, found.limits, settings, known.X))}"
    )
    for what, shares in found.usage.items():
        print(
            f"  {what:<14}"
            + "".join(f"{100 * x:7.1f}" for x in shares)
            + " % of the limit, by joint"
        )
    if given.output is not None:
        with given.output.open("w", encoding="utf-8") as stream:
            YAML(typ="safe").dump({"motion": found.motion.to_mapping()}, stream)
    confirm(model, study, found.motion, known.weights.s, given.records)


def confirm(model: object, study: object, motion: object, s: np.ndarray, records: int) -> None:
    """Scatter of simulated identifications against the prediction, all parameters."""
    controller = structure(Controller, {"law": LAW, "rate": RATE})
    X = parameters_of(model, controller)
    everything = weights_of(
        model,
        ExcitationSettings(columns="all"),
        dict(zip(model.BASE_PARAMETERS, X, strict=True)),
        s=s,
    )
    asked = replace(
        study,
        rows=replace(study.rows, window=(None, None)),
        signals=replace(study.signals, median=1, torque_median=1),
        estimate=replace(study.estimate, method="wls"),
    )
    _, *states = motion.sampled(RATE)
    run = Simulator(model, controller).run(X, Reference(RATE, *states), ideal=True)
    factor = decimation_factor(asked.signals, RATE)
    rng = np.random.default_rng(7)
    left = float(
        np.std(decimated(rng.standard_normal((1, 1_000_000)), factor, asked.signals.decimate))
    )
    clean = run.record()
    predicted = everything.relative_sigma(
        observe(model, clean, asked), kept_correlation(asked.signals, RATE)
    )
    promised = everything.relative_sigma(
        plan_rows(model, motion, asked, RATE), kept_correlation(asked.signals, RATE)
    )
    estimates = []
    for _ in range(records):
        tau = clean.tau + (s / left) * rng.standard_normal(clean.tau.shape)
        noisy = replace(clean, tau=tau)
        estimates.append(estimate_of(observe(model, noisy, asked), asked.estimate, model=model).X)
    scatter = 100 * np.std(estimates, axis=0, ddof=1) / everything.size
    used = promised < 30
    for label, sigma in (("planned motion", promised), ("simulated motion", predicted)):
        ratio = (scatter / sigma)[used]
        print(
            f"{records} simulated records, {np.count_nonzero(used)} parameters, scatter / "
            f"predicted %sigma of the {label}: "
            f"rms {np.sqrt(np.mean(ratio**2)):.2f} [{ratio.min():.2f}, {ratio.max():.2f}]"
        )


if __name__ == "__main__":
    main()
