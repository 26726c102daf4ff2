"""Positions read as counts, beside positions as they are: the measured TX40 at coarser steps, other
rates, uneven lines; a haptic device.

    python benchmarks/counts.py [steps tuned rates lines time haptic kr300] [--seeds 20]

Positions of the record are rounded to steps of 2 pi/5000 ... 2 pi/100 at a random phase of every
joint and seed, torques stay as recorded. Errors are those of the main parameters against the
estimate from the record itself. Estimates are kept in counts_runs.jsonl as they come; the same
command goes on from there. The record comes from `symgen datasets`. `tuned`: the low-pass at the
best of a grid of cut-offs, phase by phase, and at cutoff: auto. `haptic`: change of its essential
parameters by CESTAC of law phase, encoders at the motors. `kr300`: what the detector says of two
records of degrees, A.mat and B.mat in SYMGEN_DATA/kr300.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Literal

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import numpy as np
from scipy.io import loadmat

import symgen
from runtime import InputError, load_model
from runtime.compose import cestac, essential, estimate_of, observe
from runtime.core.record import Record
from runtime.core.rows.prepared import decimated_torque, observation_of
from runtime.core.rows.regressor import Columns
from runtime.core.rows.selection import certain_rows, select_rows
from runtime.core.signals.filters import filtered_states
from runtime.counts.lattice import lattice
from runtime.counts.reading import read_counts
from runtime.ground.table import aligned
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.study import Study, study_from_mapping
from symgen.demo import MAIN

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "docs" / "examples" / "chapter"))

import haptic_motion

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
from problems import observed_states

Array = np.ndarray
GENERATED = Path(__file__).resolve().parents[1] / "generated"
STEPS = (5000, 2000, 1000, 500, 250, 100)  # counts per turn of the joint
RATES = (5000, 1000, 500, 250)
PROTOTYPE = {
    5000: 1.4,
    2000: 1.7,
    1000: 3.3,
    500: 4.7,
    250: 7.3,
    100: 9.3,
}  # rms %, mean of three phases, of the design note
HAPTIC_STEPS = (0.03, 0.06, 0.12, 0.25, 0.5)  # rad at the motors
LINES = {
    "quadrature 0.1": (0.1, "quadrature"),
    "random 0.1": (0.1, "random"),
    "random 0.03": (0.03, "random"),
}


@cache
def measured() -> tuple[Any, Study, Record, tuple[str, ...], Array]:
    """Model, settings, record, the essential columns with the main parameters, and the main
    parameters from the record itself.
    """
    model, study = (
        load_model("tx40", folder=GENERATED, trust=True),
        study_from_mapping(dataset_study("tx40")),
    )
    record = read_records(study.record, model)[0]
    full = observe(model, record, study)
    kept = essential(model, record, study).names
    names = tuple(name for name in model.BASE_PARAMETERS if name in kept or name in MAIN)
    reference = estimate_of(full.columns(names), study.estimate)
    return model, study, record, names, np.array([reference[name] for name in MAIN])


def quantised(q: Array, step: float, seed: int, lines: str = "") -> Array:
    """Positions of an encoder of that step with a random phase of every joint; its lines even, or
    displaced by a pattern that repeats.
    """
    rng = np.random.default_rng([seed, 7])
    phase = rng.random(q.shape[1]) * step
    if not lines:
        return np.round((q - phase) / step) * step + phase
    size, kind = LINES[lines]
    counts = np.empty_like(q)
    for j in range(q.shape[1]):
        cell = (q[:, j] - phase[j]) / step
        first, last = int(np.floor(cell.min())) - 2, int(np.ceil(cell.max())) + 2
        number = np.arange(first, last)
        shift = (
            rng.standard_normal(4)[number % 4]
            if kind == "quadrature"
            else rng.standard_normal(len(number))
        )
        shift = (
            size * shift if kind == "random" else size * (shift - shift.mean()) / np.std(shift[:4])
        )
        edges = np.sort(number + 0.5 + shift)  # between count number and number + 1
        counts[:, j] = first + np.searchsorted(edges, cell[:], side="right")
    return counts * step + phase


def estimated(record: Record, q: Array, step: float, reader: str) -> dict[str, Any]:
    """Main parameters and their stated deviations of the record with other positions; for counts,
    those of the record itself on the same rows too.
    """
    model, study, _, names, _ = measured()
    by_counts = reader != "lowpass"
    signals = study.signals if not by_counts else replace(study.signals, reader="counts", step=step)
    begun = time.process_time()
    states = observed_states(q, record.rate, signals)
    spent = time.process_time() - begun
    keep = certain_rows(model, states).T
    selection = select_rows(record, states.qd, signals, study.rows, keep=keep)
    torque = decimated_torque(record.tau, selection)
    row: dict[str, Any] = {f"{reader}_s": round(spent, 3)}
    several = {reader: states}
    if by_counts:
        several[f"{reader}_alike"] = filtered_states(record.q, record.rate, study.signals)
    for label, x in several.items():
        e = estimate_of(observation_of(Columns(model, names), x, torque, selection), study.estimate)
        row |= {
            label: [e[name] for name in MAIN],
            f"{label}_sigma": e.sigma_corrected[[e.names.index(name) for name in MAIN]].tolist(),
        }
    return row


def every(record: Record, rate: float) -> Record:
    """The record as a logger of that rate would have taken it."""
    k = round(record.rate / rate)
    return Record(record.t[::k], record.q[::k], record.tau[::k], rate=rate)


def wanted(part: str, seeds: int) -> Iterator[dict[str, Any]]:
    """Keys of all runs, seed by seed."""
    for seed in range(seeds):
        if part == "steps":
            yield from ({"per_turn": k, "rate": 5000, "lines": "", "seed": seed} for k in STEPS)
        if part == "rates":
            yield from (
                {"per_turn": k, "rate": rate, "lines": "", "seed": seed}
                for rate in RATES[1:]
                for k in (5000, 1000, 250)
            )
        if part == "lines":
            yield from (
                {"per_turn": 1000, "rate": 5000, "lines": lines, "seed": seed} for lines in LINES
            )


def run(key: Mapping[str, Any]) -> dict[str, Any]:
    """Estimates of one run by both readers."""
    record = every(measured()[2], key["rate"])
    step = 2 * np.pi / key["per_turn"]
    q = quantised(record.q, step, key["seed"], key["lines"])
    row: dict[str, Any] = dict(key)
    for reader in ("lowpass", "counts"):
        row |= estimated(record, q, step, reader)
    return row


def computed(
    file: Path, keys: Sequence[dict[str, Any]], make: Callable[[dict[str, Any]], dict[str, Any]]
) -> list[dict[str, Any]]:
    """Rows of the keys, those in the file not computed again."""
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    names = ("per_turn", "rate", "lines", "seed")
    there = {tuple(r[name] for name in names): r for r in rows}
    for key in keys:
        at = tuple(key[name] for name in names)
        if at not in there:
            there[at] = make(key)
            with file.open("a") as out:
                out.write(json.dumps(there[at]) + "\n")
    return [there[tuple(key[name] for name in names)] for key in keys]


def percent(rows: Sequence[Mapping[str, Any]], reader: str, against: str = "") -> Array:
    """%e of the main parameters, shape (runs, 19), against the record itself, or against the record
    itself on the same rows.
    """
    reference = np.array([r[against] for r in rows]) if against else measured()[4]
    return 100 * (np.array([r[reader] for r in rows]) - reference) / np.abs(reference)


def line(e: Array) -> tuple[str, ...]:
    """rms: median and range; largest %e: median; parameter with the largest mean."""
    rms, largest = np.sqrt((e**2).mean(axis=1)), np.abs(e).max(axis=1)
    worst = int(np.argmax(np.abs(e.mean(axis=0))))
    return (
        f"{np.median(rms):.2f}",
        f"{rms.min():.2f} ... {rms.max():.2f}",
        f"{np.median(largest):.1f}",
        f"{MAIN[worst]} {e[:, worst].mean():+.1f}",
    )


HEAD = (
    "runs",
    *(
        f"{label}{column}"
        for label in ("low-pass ", "counts ", "same rows ")
        for column in ("rms %", "range", "largest", "mean worst")
    ),
)


def table(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> str:
    """One line for each combination of the keys `names`."""
    groups: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for r in rows:
        groups.setdefault(tuple(r[name] for name in names), []).append(r)
    lines: list[Sequence[str]] = [(*names, *HEAD)]
    for key, group in groups.items():
        errors = (
            percent(group, "lowpass"),
            percent(group, "counts"),
            percent(group, "counts", "counts_alike"),
        )
        lines.append((*map(str, key), str(len(group)), *(text for e in errors for text in line(e))))
    return aligned(lines)


def times() -> str:
    """Time of the reader alone, s of one core, best of three; 45,000 samples of six joints, and
    longer records made of copies.
    """
    _, _, record, _, _ = measured()
    lines: list[Sequence[str]] = [("step 2 pi/", "samples", "s")]
    for k in STEPS:
        q = quantised(record.q, 2 * np.pi / k, 0)
        spent = []
        for _ in range(3):
            begun = time.process_time()
            read_counts(q, record.rate, 2 * np.pi / k)
            spent.append(time.process_time() - begun)
        lines.append((str(k), str(len(q)), f"{min(spent):.2f}"))
    there_and_back = np.concatenate([record.q, record.q[::-1]])
    for repeat in (2, 11):
        q = quantised(np.concatenate([there_and_back] * repeat), 2 * np.pi / 1000, 0)
        begun = time.process_time()
        read_counts(q, record.rate, 2 * np.pi / 1000)
        lines.append(("1000", str(len(q)), f"{time.process_time() - begun:.2f}"))
    return aligned(lines)


CUTOFFS = (4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0)


def tuned(seeds: int) -> str:
    """rms error of the main parameters in %, medians over phases: low-pass at the best of CUTOFFS,
    chosen by that error, and at cutoff: auto.
    """
    model, study, record, names, reference = measured()

    def error(q: Array, cutoff: float | Literal["auto"]) -> float:
        low = replace(study.signals.lowpass, cutoff=cutoff)
        one = replace(study, signals=replace(study.signals, lowpass=low))
        e = estimate_of(observe(model, replace(record, q=q), one, columns=names), one.estimate)
        off = np.array([e[name] for name in MAIN]) / reference - 1
        return float(100 * np.sqrt(np.mean(off**2)))

    lines: list[Sequence[str]] = [
        ("step 2 pi/", "best, Hz", "rms %", "auto: rms %", "50 Hz: rms %")
    ]
    for k in STEPS:
        rows = []
        for seed in range(seeds):
            q = quantised(record.q, 2 * np.pi / k, seed)
            errors = {cutoff: error(q, cutoff) for cutoff in CUTOFFS}
            best = min(errors, key=lambda cutoff: errors[cutoff])
            rows.append((best, errors[best], error(q, "auto"), errors[50.0]))
        lines.append((str(k), *(f"{x:.3g}" for x in np.median(rows, axis=0))))
    return aligned(lines)


def haptic(runs: int) -> str:
    """%e (21) of the essential parameters of the haptic device, rms and largest, by both readers."""
    model = symgen.model("haptic")
    prepared = haptic_motion.prepare(model, runs=runs)
    study, record = prepared.study, prepared.record
    lines: list[Sequence[str]] = [
        ("step, rad", "positions: rms %", "largest", "counts: rms %", "largest")
    ]
    found = []
    names = essential(model, record, study).names
    study = replace(study, cestac=replace(study.cestac, rounding="phase", delta=HAPTIC_STEPS))
    for reader in ("lowpass", "counts"):
        found.append(
            cestac(
                model,
                record,
                replace(study, signals=replace(study.signals, reader=reader)),
                columns=names,
            )
        )
    for levels in zip(*(f.levels for f in found), strict=True):
        lines.append(
            (
                f"{levels[0].level.delta:g}",
                *(
                    f"{x:.2f}"
                    for level in levels
                    for x in (np.sqrt(np.mean(level.e**2)), level.e.max())
                ),
            )
        )
    return aligned(lines)


def degrees(folder: Path) -> str:
    """Smallest step of every axis that moves, and the distance from its lattice that the detector
    refuses.
    """
    lines = [("record", "encoder", "axis", "what is said")]
    for file, field in product(("A.mat", "B.mat"), ("act_pos_mot_deg", "act_pos_se_deg")):
        record = loadmat(folder / file, squeeze_me=True, struct_as_record=False)["rec"]
        for axis, x in enumerate(np.radians(getattr(record, field)), start=1):
            if np.ptp(x):
                try:
                    said = f"{lattice(x[:, None]).step[0]:.3g}"
                except InputError as error:
                    said = str(error)
                lines.append((file, field, str(axis), said))
    return aligned(lines)


def main() -> None:
    """Compute what is missing, write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", default=["steps", "rates", "lines", "time"])
    parser.add_argument("--seeds", type=int, default=20)
    given = parser.parse_args()
    file = Path("counts_runs.jsonl")
    for part in given.parts:
        if part == "time":
            print(times())
            continue
        if part == "tuned":
            print(tuned(given.seeds))
            continue
        if part == "haptic":
            print(haptic(given.seeds))
            continue
        if part == "kr300":
            print(degrees(Path(os.environ["SYMGEN_DATA"], "kr300")))
            continue
        rows = computed(file, list(wanted(part, given.seeds)), run)
        text = table(
            rows, {"steps": ("per_turn",), "rates": ("rate", "per_turn"), "lines": ("lines",)}[part]
        )
        print(text)
        if part == "steps":
            gains = [
                np.median(
                    np.sqrt(
                        (percent([r for r in rows if r["per_turn"] == k], "counts") ** 2).mean(
                            axis=1
                        )
                    )
                )
                / PROTOTYPE[k]
                for k in STEPS
            ]
            print(
                "geometric mean over the prototype of the note: "
                f"{np.exp(np.mean(np.log(gains))):.2f}"
            )


if __name__ == "__main__":
    main()
