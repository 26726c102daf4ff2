"""Resolution advisor against sampling: the steps it predicts for 1 % and 5 %, and what both ways
cost.

    python benchmarks/advisor.py [emps tx40 haptic]          needs the records: set SYMGEN_DATA, or be on line
    python benchmarks/advisor.py --real [emps tx40 haptic]   real encoders, read as positions and as counts, in place of the chapter's law

Steps: CESTAC at steps in the ratio 1.3, RUNS runs each, all encoders alike; where |change of the
mean| first reaches a limit between two of them, on logarithmic axes. The interval is that of
|change| +- the half width of Student's. Predicted over sampled should be within 15 %.

Cost: CPU time of one advice without runs (every choice of encoders, both limits, the curve) over
that of the sampling it stands for: for every choice of encoders, LEVELS steps (to bracket two
limits within 15 %) of five runs, as the chapter has it; or of as many as bring the Student interval
of every parameter that matters below 30 % of the limit at the step where it reaches it, since the
advice gives those steps too. One core, BLAS on one thread, medians of interleaved rounds.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from symgen.cli.session import single_thread

single_thread()

import numpy as np  # noqa: E402  (numpy reads the number of threads when it loads)
from scipy.special import stdtrit  # noqa: E402

import symgen  # noqa: E402
from runtime.advisor.advice import LIMITS, crossing  # noqa: E402
from runtime.advisor.coarse_encoders import CoarseEncoders  # noqa: E402
from runtime.advisor.position_errors import value_reader  # noqa: E402
from runtime.compose import READERS, advise, cestac, essential, problem  # noqa: E402
from runtime.core.model import drives_of  # noqa: E402
from runtime.reading.datasets import dataset_study  # noqa: E402
from runtime.reading.records import read_records  # noqa: E402
from runtime.study import study_from_mapping  # noqa: E402
from symgen.demo import MAIN  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "docs" / "examples" / "chapter"))

from haptic_motion import DURATION, prepare  # noqa: E402

RUNS = {"emps": 100, "tx40": 60, "haptic": 30}
LEVELS = 8
ROUNDS = 5
RATIO = 1.3
REAL_RUNS = {"emps": 60, "tx40": 12, "haptic": 12}
HAPTIC_SHARE = 4  # of the motion of the haptic device, where real encoders are judged


def opened(name, model, folder, share=1):
    """Study, without median filter ahead of the rounding, and record."""
    if name == "haptic":
        haptic = prepare(model, DURATION / share)
        return haptic.study, haptic.record
    study = study_from_mapping(dataset_study(name))
    return study, read_records(study.record, model, folder=folder)[0]


def steps_table(name, model, study, record, names):
    """Predicted and sampled steps of every parameter that matters."""
    advice = advise(model, record, study, columns=names, encoders=("all",), confirm=False)
    first = advice.encoders[0]
    law, whole = study.cestac.rounding, problem(model, record, study)
    level = CoarseEncoders(whole, names, drives_of(model), law, value_reader(whole.reader)).sampled
    low, high = first.limits[0].delta / RATIO**2, first.delta[-1] / RATIO
    grid = np.geomspace(low, high, round(np.log(high / low) / np.log(RATIO)) + 1)
    points = [level(range(record.n), delta, RUNS[name]) for delta in grid]
    e, half = np.array([np.abs(p.change) for p in points]), np.array([p.half_width for p in points])
    print(
        f"\n{name}: {RUNS[name]} runs at {len(grid)} steps; predicted / sampled step, and the "
        "sampled interval over the sampled step"
    )
    within = compared = 0
    for percent in LIMITS:
        predicted = first.reached(percent)
        for i in (names.index(n) for n in advice.deciding):
            sampled = crossing(grid, e[:, i], percent)
            least, most = (
                crossing(grid, e[:, i] + half[:, i], percent),
                crossing(grid, np.clip(e[:, i] - half[:, i], 0, None), percent),
            )
            if not np.isfinite([predicted[i], sampled]).all():
                continue
            compared, within = compared + 1, within + (abs(predicted[i] / sampled - 1) <= 0.15)
            mark = (
                " <- advised" if names[i] == first.limits[LIMITS.index(percent)].parameter else ""
            )
            print(
                f"  {percent:g} %  {names[i]:8s} {predicted[i]:.3e} {sampled:.3e}  "
                f"{predicted[i] / sampled:.3f}  [{least / sampled:.2f}, {most / sampled:.2f}]{mark}"
            )
    print(f"  within 15 %: {within} of {compared}")
    return advice, level


def cost(name, model, study, record, names, advice, level):
    """CPU times, interleaved."""
    predicting, sampling = [], []
    limit = advice.encoders[0].limits[0]
    few = replace(study, cestac=replace(study.cestac, delta=(limit.delta,), runs=5, torque=None))
    for _ in range(ROUNDS):
        start = time.process_time()
        whole = advise(model, record, study, columns=names, confirm=False)
        middle = time.process_time()
        cestac(model, record, few, columns=names)
        predicting.append(middle - start)
        sampling.append((time.process_time() - middle) / few.cestac.runs)
    runs = {
        "five runs": len(whole.encoders) * LEVELS * 5,
        "runs for every parameter": LEVELS / 2 * needed_runs(whole, model, record, names, level),
    }
    one, all_of_it = median(sampling), median(predicting)
    print(
        f"{name}: prediction {1e3 * all_of_it:.0f} ms ({1e3 * min(predicting):.0f} to "
        f"{1e3 * max(predicting):.0f}), one CESTAC run {1e3 * one:.1f} ms"
    )
    for label, count in runs.items():
        print(
            f"  {label}, {len(whole.encoders)} choices of encoders, {count:.0f} runs: sampling "
            f"costs {count * one / all_of_it:.0f} times the prediction"
        )


def needed_runs(whole, model, record, names, level):
    """Runs at one step, summed over choices of encoders and limits."""
    total = 0
    for encoder in whole.encoders:
        chosen = (
            range(record.n) if encoder.label == "all" else (model.JOINTS.index(int(encoder.label)),)
        )
        for limit in encoder.limits:
            needed = 5
            if np.isfinite(limit.delta):
                point = level(chosen, limit.delta, 10)
                reached = encoder.reached(limit.percent)
                for i in (
                    names.index(n) for n in whole.deciding if np.isfinite(reached[names.index(n)])
                ):
                    spread = (
                        point.half_width[i]
                        * np.sqrt(10)
                        / stdtrit(9, 0.975)
                        * reached[i]
                        / limit.delta
                    )
                    needed = max(needed, np.ceil((1.96 * spread / (0.3 * limit.percent)) ** 2))
            total += needed
    return total


def real_table(name, model, study, record, names):
    """Steps predicted by the quadrature over the phase, and steps at which runs of random phase
    cross the limits, by reader and parameter.
    """
    law = replace(study, cestac=replace(study.cestac, rounding="phase", delta=()))
    start = time.process_time()
    advice = advise(model, record, law, columns=names, encoders=("all",), confirm=False)
    print(
        (
            f"\n{name}: predicted in {time.process_time() - start:.0f} s of CPU; sampled by "
            f"{REAL_RUNS[name]} runs"
        ),
        flush=True,
    )
    for reader in advice.real:
        whole, read = problem(model, record, law), READERS[reader.reader]
        real = CoarseEncoders(whole, names, drives_of(model), "phase", read)
        first, ratios = reader.encoders[0], []
        for limit in first.limits:
            if not np.isfinite(limit.delta):
                print(
                    f"  {reader.reader:8} {limit.percent:g} %: "
                    f"{'none' if np.isnan(limit.delta) else 'every step'} ({limit.parameter}), "
                    f"{first.delta[0]:.3g} to {first.delta[-1]:.3g}"
                )
                continue
            near = first.delta[np.abs(np.log(first.delta / limit.delta)) < 2 * np.log(RATIO)]
            grid = (
                near if len(near) > 5 else limit.delta * RATIO ** np.arange(-2, 3.0)
            )  # where steps lock, those of the curve
            points = [real.sampled(range(record.n), delta, REAL_RUNS[name]) for delta in grid]
            e, half = np.abs([p.change for p in points]), np.array([p.half_width for p in points])
            steps = {
                n: crossing(grid, e[:, names.index(n)], limit.percent) for n in advice.deciding
            }
            reached = first.reached(limit.percent)
            ratios += [
                reached[names.index(n)] / s
                for n, s in steps.items()
                if np.isfinite([reached[names.index(n)], s]).all()
            ]
            sampled = min((s for s in steps.values() if np.isfinite(s)), default=np.nan)
            which = min(steps, key=lambda n: steps[n] if np.isfinite(steps[n]) else np.inf)
            i, nearest = (
                names.index(limit.parameter),
                int(np.argmin(np.abs(np.log(grid / limit.delta)))),
            )
            least, most = (
                crossing(grid, e[:, i] + half[:, i], limit.percent),
                crossing(grid, np.clip(e[:, i] - half[:, i], 0, None), limit.percent),
            )
            print(f"  {reader.reader:8} {limit.percent:g} %: predicted {limit.delta:.3e} ({limit.parameter}), sampled {sampled:.3e} ({which}), "
                  f"ratio {limit.delta / sampled:.2f}; {limit.parameter}: predicted over sampled {limit.delta / steps[limit.parameter]:.2f} "
                  f"[{limit.delta / most:.2f}, {limit.delta / least:.2f}], runs near the predicted step {e[nearest, i]:.2f} +- {half[nearest, i]:.2f} %", flush=True)  # fmt: skip
        print(*reader.notes, sep="\n")
        print(
            f"  {reader.reader:8} by parameter: {sum(abs(r - 1) <= 0.2 for r in ratios)} of "
            f"{len(ratios)} predicted steps within 20 % of the sampled ones"
        )


def main():
    """Print the tables of the robots named."""
    real = "--real" in sys.argv
    for name in [n for n in sys.argv[1:] if n != "--real"] or RUNS:
        with TemporaryDirectory() as folder:
            model = symgen.model(name)
            study, record = opened(name, model, Path(folder), HAPTIC_SHARE if real else 1)
            found = essential(model, record, study)
            if real:
                real_table(name, model, study, record, MAIN if name == "tx40" else found.names)
                continue
            advice, level = steps_table(name, model, study, record, found.names)
            cost(name, model, study, record, found.names, advice, level)


if __name__ == "__main__":
    main()
