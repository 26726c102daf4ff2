"""Every estimator against Delta on simulated records of known truth: the encoder inside the loop,
and recorded positions alone rounded.

    python benchmarks/cestac_estimators.py [--runs 5] [-o docs]

Everything goes through the verb: `symgen cestac ROBOT study.yaml --json`, with `cestac: {place:
loop, rounding: phase}`, or `place: record` on a record that `symgen simulate` makes with an exact
encoder. Robots, gains, noise, steps and determined parameters are those of
benchmarks/estimators.py. Answers are kept in cestac_estimators_runs/; the same command goes on from
there. Written: cestac_estimators.png, and a table on the screen. Above: the estimates of the runs
against the truth, noise and disturbance of each run included. Below: %e (21) as the verb prints it,
mean of the runs against those of the same seeds with an exact encoder (against the record, where
recorded positions alone are rounded). Both: rms over the determined parameters.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from estimators import AROUND, AWAY, METHODS, STEPS, UNIT, bench, determined
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from runtime.documents.yaml_text import yaml_text
from runtime.ground.settings import to_mapping
from runtime.ground.table import aligned

Array = np.ndarray
RECORDED = ("ols", "iv", "didim")  # also with recorded positions alone rounded


def verb(*arguments: object) -> str:
    """What the verb prints; exit code 1 only says that the estimate is biased."""
    done = subprocess.run(
        [Path(sys.executable).with_name("symgen"), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode > 1:
        raise SystemExit(done.stderr)
    return done.stdout


def study_of(robot: str, method: str, place: str, runs: int) -> dict[str, Any]:
    """The study file of one curve; simulating methods start AWAY from the truth."""
    b = bench(robot)
    signs = np.sign(np.random.default_rng(1).uniform(-1, 1, len(b.truth)))
    start = dict(zip(b.model.BASE_PARAMETERS, (b.truth * (1 + AWAY * signs)).tolist(), strict=True))
    simulates = method in ("iv", "didim")
    options: dict[str, Any] = {"start": start, "gains": "one"} if simulates else {}
    mapping = to_mapping(b.study)
    if place == "loop" or simulates:
        mapping["rows"] = {**mapping["rows"], "around": AROUND[robot]}
    cestac = {
        "columns": "all",
        "runs": runs,
        "rounding": "phase",
        "place": place,
        "delta": STEPS[robot],
    }
    return {**mapping, "estimate": {"method": method, "options": options}, "cestac": cestac}


def answer(folder: Path, robot: str, method: str, place: str, runs: int) -> dict[str, Any]:
    """cestac.json of one curve."""
    kept = folder / f"{robot}-{method}-{place}-{runs}.json"
    if not kept.exists():
        study = folder / "study.yaml"
        mapping = study_of(robot, method, place, runs)
        if place == "record":
            mapping |= simulated(folder, robot)
        study.write_text(yaml_text(mapping))
        text = verb("cestac", robot, study, "--json")
        kept.write_text(text)
    found: dict[str, Any] = json.loads(kept.read_text())
    return found


def simulated(folder: Path, robot: str) -> dict[str, Any]:
    """The settings of a record with an exact encoder, made once."""
    file = folder / f"{robot}.csv"
    if not file.exists():
        b = bench(robot)
        file.write_text(b.simulator.run(b.truth, b.reference, seed=0).to_csv())
    n = len(bench(robot).model.JOINTS)
    columns = {
        "t": "t",
        **{kind: [f"{kind}{j + 1}" for j in range(n)] for kind in ("q", "tau")},
        "qr": [f"qr{j + 1}" for j in range(n)],
    }
    return {"record": [{"files": [file.name], "columns": columns}]}


def errors(found: dict[str, Any], truth: Array, kept: list[int]) -> list[float]:
    """Errors of the estimates in % of the truth, root mean square over runs and determined
    parameters, of every step.
    """
    return [
        float(100 * np.sqrt(np.nanmean((_X(level)[:, kept] / truth[kept] - 1) ** 2)))
        for level in found["levels"]
    ]


def printed(found: dict[str, Any], kept: list[int]) -> list[float]:
    """%e (21) of the verb, root mean square over the determined parameters, of every step."""
    return [float(np.sqrt(np.mean(np.array(level["e"])[kept] ** 2))) for level in found["levels"]]


def _X(level: dict[str, Any]) -> Array:
    return np.array([[np.nan if x is None else x for x in run["X"]] for run in level["runs"]])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("-o", "--output", type=Path, default=Path("docs"))
    given = parser.parse_args()
    folder = Path("cestac_estimators_runs")
    folder.mkdir(exist_ok=True)
    figure = Figure(figsize=(11, 7.6), layout="constrained")
    lines: list[tuple[str, ...]] = [("robot", "method", "rounded", "", *("step",) * 4)]
    for (above, below), robot in zip(figure.subplots(2, 2, sharex="col").T, STEPS, strict=True):
        kept = determined(robot)
        truth = bench(robot).truth
        for k, method in enumerate(METHODS):
            for place, style in (("loop", "-"), ("record", "--")):
                if place == "record" and method not in RECORDED:
                    continue
                found = answer(folder, robot, method, place, given.runs)
                label = method.upper() + (", recorded positions alone" if place == "record" else "")
                for axes, what, e in (
                    (above, "truth", errors(found, truth, kept)),
                    (below, "%e", printed(found, kept)),
                ):
                    lines.append((robot, method, place, what, *(f"{x:.2f}" for x in e)))
                    axes.loglog(
                        STEPS[robot], e, style, marker="o", ms=3, lw=1.2, color=f"C{k}", label=label
                    )
                    print(*lines[-1], flush=True)
        above.set(ylabel="error against the truth, %", title=f"{robot}, encoder inside the loop")
        below.set(xlabel=f"Delta, {UNIT[robot]}, joint side", ylabel="%e of the verb")
        above.legend(fontsize=6.5)
        for axes in (above, below):
            axes.set_xticks(STEPS[robot], [f"{step:.3g}" for step in STEPS[robot]])
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.grid(True, which="major", lw=0.4, alpha=0.6)
    print(aligned(lines))
    figure.savefig(given.output / "cestac_estimators.png", dpi=110)


if __name__ == "__main__":
    main()
