"""The reader of counts on simulated records of known truth: which rows of uncertain direction to
leave out, and whether stated deviations hold.

    python benchmarks/counts_simulated.py [rows sigma gaps] [--records 100]

Motions of the TX40 with an exact encoder, quantised afterwards at a random phase of every joint and
record:

    smooth   five harmonics of some 0.3 to 2.6 Hz and a wobble of 0.2 mrad up to 25 Hz
    loop     the same followed by the simulated loop of `benchmarks/estimators.py`, whose dry friction sticks at reversals
    points   from point to point through that loop, joints at rest 5 % of the time

Torques are those of the values of the robot file with white noise of 0.05 N m and noise up to 5 Hz
of 3 % of the torque (`sigma`: 1 %); its dry friction is one of FRICTION. Parts: `rows`, errors
against the estimate from the exact positions of the same record, by what becomes of rows of
uncertain direction; `sigma`, errors against the truth over stated sigma; `gaps`, errors of the
filtered acceleration where samples are missing. Estimates are kept in counts_simulated_runs.jsonl;
the same command goes on from there.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import sys

import numpy as np
from counts import MAIN, STEPS, quantised
from estimators import TX40, bench
from scipy.ndimage import maximum_filter1d
from scipy.signal import butter, sosfiltfilt
from scipy.special import erf
from simulation import LAW

from runtime.compose import estimate_of
from runtime.core.essential import essential_of
from runtime.core.least_squares.wls import weighted_system
from runtime.core.record import Record
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import decimated_torque, observation_of
from runtime.core.rows.regressor import Columns
from runtime.core.rows.selection import certain_rows, select_rows
from runtime.core.rows.switches import switches
from runtime.core.signals.filters import States, filtered_states
from runtime.core.table import aligned
from runtime.counts.reading import read_counts
from runtime.loop.reference import Reference, reference_of
from runtime.loop.simulation import Simulator
from runtime.study import Study, study_from_mapping

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
from problems import observed_states

Array = np.ndarray
RATE, SECONDS = 5000, 7.5
FRICTION: Mapping[str, Callable[[Array], Array]] = {
    "sign": np.sign,
    "tanh 0.02": lambda s: np.tanh(s / 0.02),
    "tanh 0.05": lambda s: np.tanh(s / 0.05),
    "tanh 0.1": lambda s: np.tanh(s / 0.1),
    "Stribeck": lambda s: np.sign(s) * (1 + 0.3 * np.exp(-((s / 0.05) ** 2))),
}
SIGMA_CASES = ((5000, ""), (1000, ""), (250, ""), (1000, "random 0.03"), (1000, "random 0.1"))
POWERS = (0.5, 1)  # weights of rows by the certainty of their direction
THRESHOLDS = (0.0, 0.35, 0.5, 0.7, 1.0)  # deviations of a speed below which its rows are left out


class Motion(NamedTuple):
    """q, qd, qdd, shape (N, 6) each, rad, per s, per s^2."""

    q: Array
    qd: Array
    qdd: Array


def harmonics(seed: int) -> Motion:
    """Sum of five sinusoids of each joint, speeds up to 2.4 to 5 rad/s by joint."""
    rng = np.random.default_rng([seed, 5])
    t = np.arange(int(SECONDS * RATE)) / RATE
    f = np.array([1, 2, 3.3, 5, 8]) * 0.33 * rng.uniform(0.8, 1.2)
    q, qd, qdd = np.zeros((3, len(t), 6))
    for j in range(6):
        for size, w, shift in zip(
            rng.standard_normal(5) / f, 2 * np.pi * f, rng.uniform(0, 2 * np.pi, 5), strict=True
        ):
            q[:, j] += size * np.sin(w * t + shift)
            qd[:, j] += size * w * np.cos(w * t + shift)
            qdd[:, j] -= size * w**2 * np.sin(w * t + shift)
    scale = (
        rng.uniform(2.0, 4.5, 6) / np.abs(qd).max(axis=0) * np.array([0.8, 0.7, 0.9, 1.1, 1, 1.5])
    )
    scale = 1.2 * np.minimum(scale, 3.2 / np.ptp(q, axis=0))
    return Motion(q * scale, qd * scale, qdd * scale)


@cache
def motion(kind: str, seed: int) -> Motion:
    """The motion of one record, as the exact encoder tells it."""
    if kind == "smooth":
        q, qd, qdd = harmonics(seed)
        white = np.random.default_rng([seed, 6]).standard_normal(q.shape)
        wobble = sosfiltfilt(butter(3, 25, fs=RATE, output="sos"), white, axis=0)
        wobble *= 2e-4 / wobble.std(axis=0)
        rate = np.gradient(wobble, 1 / RATE, axis=0)
        return Motion(q + wobble, qd + rate, qdd + np.gradient(rate, 1 / RATE, axis=0))
    points = {"points": {"duration": 8, "seed": 100 + seed}}
    study = study_from_mapping(
        {**TX40, "controller": {**TX40["controller"], "law": LAW, "reference": points}}
    )
    model = bench("tx40").model
    reference = (
        reference_of(study.controller, model)
        if kind == "points"
        else Reference(RATE, *harmonics(seed))
    )
    run = Simulator(model, study.controller).run(bench("tx40").truth, reference, seed=seed)
    inside = slice(RATE // 10, int(SECONDS * RATE))
    return Motion(run.q[inside], run.qd[inside], run.qdd[inside])


def torque(moved: Motion, friction: str, rng: np.random.Generator, slow_noise: float) -> Array:
    """Joint torques, shape (N, 6), of the truth with that dry friction, and their noise; slow_noise
    : that up to 5 Hz, as a share of the torque.
    """
    model, truth = bench("tx40").model, bench("tx40").truth.copy()
    switching = switches(model, model.BASE_PARAMETERS)
    sizes = [truth[s.column] for s in switching]
    truth[[s.column for s in switching]] = 0
    functions: Any = model
    tau = np.asarray(functions.inverse_dynamics(*moved, truth))
    for s, size in zip(switching, sizes, strict=True):
        tau = tau + np.outer(size * FRICTION[friction](moved.qd @ s.G), s.G)
    slow = sosfiltfilt(butter(2, 5, fs=RATE, output="sos"), rng.standard_normal(tau.shape), axis=0)
    return np.asarray(
        tau
        + 0.05 * rng.standard_normal(tau.shape)
        + slow_noise * tau.std(axis=0) * slow / slow.std(axis=0)
    )


def settings(step: float | None = None) -> Study:
    """Those of the measured record, read by the low-pass, or as counts of that step."""
    signals = {
        "median": 5,
        "torque_median": 5,
        "lowpass": {"cutoff": 50},
        **({} if step is None else {"reader": "counts", "step": step}),
    }
    return study_from_mapping({"signals": signals, "rows": {"trim": 3}})


def observed(
    states: States, record: Record, names: Sequence[str], certain: Array | None = None
) -> Observation:
    """Y = W X + rho of the columns `names`; certain : rows that may be used, bool (n, N)."""
    study = settings()
    selection = select_rows(
        record, states.qd, study.signals, study.rows, keep=None if certain is None else certain.T
    )
    plain = States(states.q, states.qd, states.qdd)
    return observation_of(
        Columns(bench("tx40").model, names),
        plain,
        decimated_torque(record.tau, selection),
        selection,
    )


def solved(W: Array, Y: Array) -> Array:
    """Least squares, columns scaled."""
    norm = np.linalg.norm(W, axis=0)
    return np.asarray(np.linalg.lstsq(W / norm, Y, rcond=None)[0] / norm)


def rows_of(kind: str, seed: int) -> Iterator[dict[str, Any]]:
    """Main parameters of one motion by step, friction and treatment of uncertain rows, with those
    from the exact positions.
    """
    moved, b = motion(kind, seed), bench("tx40")
    t = np.arange(len(moved.q)) / RATE
    records = {
        name: Record(
            t, moved.q, torque(moved, name, np.random.default_rng([seed, 11]), 0.03), rate=RATE
        )
        for name in FRICTION
    }
    exact = filtered_states(moved.q, RATE, settings().signals)
    sign = observed(exact, records["sign"], b.model.BASE_PARAMETERS)
    essential = essential_of(weighted_system(sign), settings().essential).names
    names = [name for name in b.model.BASE_PARAMETERS if name in essential or name in MAIN]
    main = [names.index(name) for name in MAIN]
    W, Y = (
        sign.columns(names).W,
        {name: observed(exact, record, names[:1]).Y for name, record in records.items()},
    )
    reference = {name: solved(W, y)[main].tolist() for name, y in Y.items()}
    for per_turn in STEPS:
        step = 2 * np.pi / per_turn
        read = observed_states(quantised(moved.q, step, seed), RATE, settings(step).signals)
        W = observed(read, records["sign"], names).W
        selection = select_rows(records["sign"], read.qd, settings().signals, settings().rows)
        for label, (weight, columns) in treatments(
            read[selection.samples][selection.kept], selection.mask, names
        ).items():
            used = weight > 0
            rows = (W * columns)[used] * weight[used, None]
            for name, y in Y.items():
                X = solved(rows, y[used] * weight[used])[main].tolist()
                key = {
                    "part": "rows",
                    "kind": kind,
                    "seed": seed,
                    "per_turn": per_turn,
                    "friction": name,
                    "rows": label,
                }
                yield {**key, "X": X, "exact": reference[name], "left": float(1 - used.mean())}


def treatments(states: States, mask: Array, names: Sequence[str]) -> dict[str, tuple[Array, Array]]:
    """What becomes of rows of uncertain direction: weights of the rows, shape (r,), and factors of
    their columns, (r, b).

    E = |E sign(s)| of a column of dry friction; of a row the least of those that act on its joint.
    """
    assert states.errors is not None
    model, (n, K) = bench("tx40").model, mask.shape
    certainty, columns = np.ones((n, K)), np.ones((n, K, len(names)))
    for s in switches(model, names, passive="left out"):
        E = erf(np.abs(states.qd @ s.G) / (np.sqrt(2) * states.errors.along(s.G)))
        certainty[list(s.joints)] = np.minimum(certainty[list(s.joints)], E)
        columns[:, :, s.column] = E
    alike = np.ones(columns.shape)
    cases = {
        f"out below {least:g}": (1.0 * certain_rows(model, states, deviations=least), alike)
        for least in THRESHOLDS
    }
    cases |= {f"weight E^{p:g}": (certainty**p, alike) for p in POWERS}
    cases |= {f"E sign, weight E^{p:g}": (certainty**p, columns) for p in (0, *POWERS)}
    return {
        label: (weight[mask], of_columns[mask]) for label, (weight, of_columns) in cases.items()
    }


def sigma_of(kind: str, seed: int) -> Iterator[dict[str, Any]]:
    """Main parameters and stated deviations of one record, from the exact positions and read at
    every case; five records a motion.
    """
    moved, b = motion(kind, seed // 5), bench("tx40")
    record = Record(
        np.arange(len(moved.q)) / RATE,
        moved.q,
        torque(moved, "sign", np.random.default_rng([seed, 12]), 0.01),
        rate=RATE,
    )
    names = [name for name, x in zip(b.model.BASE_PARAMETERS, b.truth, strict=True) if x]

    def estimated(states: States, certain: Array | None = None) -> dict[str, Any]:
        e = estimate_of(observed(states, record, names, certain), settings().estimate)
        at = [e.names.index(name) for name in MAIN]
        return {
            "X": e.X[at].tolist(),
            "sigma": e.sigma_corrected[at].tolist(),
            "plain": e.sigma[at].tolist(),
        }

    key = {"part": "sigma", "kind": kind, "seed": seed}
    yield {
        **key,
        "per_turn": 0,
        "lines": "",
        **estimated(filtered_states(moved.q, RATE, settings().signals)),
    }
    for per_turn, lines in SIGMA_CASES:
        step = 2 * np.pi / per_turn
        read = observed_states(quantised(moved.q, step, seed, lines), RATE, settings(step).signals)
        yield {
            **key,
            "per_turn": per_turn,
            "lines": lines,
            **estimated(read, certain_rows(b.model, read)),
        }


def rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def rows_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Median over the motions of the rms error, %, geometric mean over frictions; a line for each
    kind of motion and treatment of its rows.
    """
    lines: list[Sequence[str]] = [
        (
            "motion",
            "rows",
            *(f"2 pi/{k}" for k in STEPS),
            "geometric mean",
            "pure Coulomb",
            "tanh 0.05",
        )
    ]
    for kind in dict.fromkeys(r["kind"] for r in rows):
        for label in dict.fromkeys(r["rows"] for r in rows):
            mine = [r for r in rows if r["kind"] == kind and r["rows"] == label]
            error = {
                (k, f): np.median(
                    [
                        rms(100 * (np.array(r["X"]) / r["exact"] - 1))
                        for r in mine
                        if (r["per_turn"], r["friction"]) == (k, f)
                    ]
                )
                for k in STEPS
                for f in FRICTION
            }
            mean = lambda keys, error=error: np.exp(np.mean([np.log(error[key]) for key in keys]))  # noqa: E731
            by_step = [mean([(k, f) for f in FRICTION]) for k in STEPS]
            by_friction = [mean([(k, f) for k in STEPS]) for f in ("sign", "tanh 0.05")]
            lines.append(
                (kind, label, *(f"{x:.2f}" for x in (*by_step, mean(list(error)), *by_friction)))
            )
    return aligned(lines)


def sigma_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Error over stated deviation of the main parameters, over all records, and of what reading
    adds alone.
    """
    truth = bench("tx40").truth[[bench("tx40").model.BASE_PARAMETERS.index(name) for name in MAIN]]
    exact = {(r["kind"], r["seed"]): np.array(r["X"]) for r in rows if not r["per_turn"]}
    head = (
        "motion",
        "case",
        "records",
        "error/corrected",
        "largest by parameter",
        "beyond 2, %",
        "error/sigma",
        "reading/corrected",
        "rms error %",
    )
    lines: list[Sequence[str]] = [head]
    for kind, per_turn, pattern in dict.fromkeys(
        (r["kind"], r["per_turn"], r["lines"]) for r in rows
    ):
        mine = [
            r for r in rows if (r["kind"], r["per_turn"], r["lines"]) == (kind, per_turn, pattern)
        ]
        X, sigma, plain = (np.array([r[name] for r in mine]) for name in ("X", "sigma", "plain"))
        z = (X - truth) / sigma
        worst = int(np.argmax((z**2).mean(axis=0)))
        added = rms((X - np.array([exact[r["kind"], r["seed"]] for r in mine])) / sigma)
        case = f"2 pi/{per_turn} {pattern}" if per_turn else "exact positions"
        cells = (
            f"{rms(z):.2f}",
            f"{rms(z[:, worst]):.2f} {MAIN[worst]}",
            f"{100 * np.mean(np.abs(z) > 2):.1f}",
            f"{rms((X - truth) / plain):.2f}",
        )
        lines.append(
            (
                kind,
                case,
                str(len(mine)),
                *cells,
                f"{added:.2f}",
                f"{rms(100 * (X / truth - 1)):.2f}",
            )
        )
    return aligned(lines)


def gaps_table(motions: int) -> str:
    """Errors of the filtered acceleration of smooth motions with a gap every half second: away from
    gaps, near gaps in rows that stay, in rows left out.
    """
    lines: list[Sequence[str]] = [
        (
            "step",
            "gap, ms",
            "away, rad/s^2",
            "rows that stay near gaps",
            "rows left out",
            "left out by gap, ms",
        )
    ]
    study, inner = settings(), slice(RATE // 10, -RATE // 10)
    for per_turn in (100_000, *STEPS[::2]):
        step = 2 * np.pi / per_turn
        for gap in (1, 10, 50, 100, 250, 1000):
            found = []
            for seed in range(motions):
                moved = motion("smooth", seed)
                starts = np.arange(RATE // 4, len(moved.q) - RATE // 4 - gap, RATE // 2)
                missing = np.zeros(len(moved.q), dtype=bool)
                missing[(starts[:, None] + np.arange(gap)).ravel()] = True
                counts = np.where(missing[:, None], np.nan, quantised(moved.q, step, seed))
                reading = read_counts(counts, RATE, step)
                read = filtered_states(reading.q, RATE, replace(study.signals, median=1))
                error = np.abs(read.qdd - filtered_states(moved.q, RATE, study.signals).qdd)[inner]
                unknown = reading.unknown.any(axis=1)[inner]
                near, beside = (
                    maximum_filter1d(missing, 2 * round(x * RATE) + 1)[inner] for x in (0.02, 0.08)
                )
                cases = (~beside, near & ~unknown, unknown)
                found.append(
                    [
                        *(rms(error[case]) if case.any() else np.nan for case in cases),
                        1e3 * unknown.sum() / RATE / len(starts),
                    ]
                )
            away, stay, left, lost = np.median(found, axis=0)
            lines.append(
                (
                    f"2 pi/{per_turn}",
                    f"{1e3 * gap / RATE:g}",
                    f"{away:.3g}",
                    f"{stay:.3g}",
                    f"{left:.3g}",
                    f"{lost:.0f}",
                )
            )
    return aligned(lines)


def main() -> None:
    """Compute what is missing, print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", default=["rows", "sigma"])
    parser.add_argument("--records", type=int, default=100)
    parser.add_argument("--motions", type=int, default=6)
    parser.add_argument("--kinds", nargs="*", default=["smooth", "loop", "points"])
    given = parser.parse_args()
    file = Path("counts_simulated_runs.jsonl")
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    if "gaps" in given.parts:
        print(gaps_table(given.motions))
    for part, make, count in (("rows", rows_of, given.motions), ("sigma", sigma_of, given.records)):
        if part not in given.parts:
            continue
        there = {(r["kind"], r["seed"]) for r in rows if r["part"] == part}
        for seed in range(count):
            for kind in given.kinds if part == "rows" else given.kinds[:1]:
                if (kind, seed) not in there:
                    new = list(make(kind, seed))
                    rows += new
                    with file.open("a") as out:
                        out.writelines(json.dumps(row) + "\n" for row in new)
        print(
            {"rows": rows_table, "sigma": sigma_table}[part]([r for r in rows if r["part"] == part])
        )


if __name__ == "__main__":
    main()
