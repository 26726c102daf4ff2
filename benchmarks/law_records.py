"""Records without torques: tables of law_records.md; `calf`: armature of the calves.

    SYMGEN_DATA=... python benchmarks/law_records.py [go2] [calf]

Go2: runs 0 to 7 under one PD law; torque of the law, weights by joint.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import symgen
from runtime.compose import estimate_of, problem
from runtime.core.model import GeneratedModel
from runtime.core.rows.observation import Observation, stack
from runtime.core.study import EstimateSettings
from runtime.reading.records import read_records
from runtime.study import Study, study_from_mapping

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
DATA = Path(os.environ.get("SYMGEN_DATA", "."))
RUNS = range(8)
WEIGHTED = EstimateSettings("wls", "joint")
CALVES = (3, 6, 9, 12)
KP, KD = (20, 20, 40), (1, 1, 2)


def go2_model() -> GeneratedModel:
    """The twelve joints, base fixed in the air."""
    text = (DATA / "go2" / "go2.xml").read_text().replace("<freejoint/>", "")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "go2.xml"
        path.write_text(text)
        return symgen.model(path)


def go2_study(
    runs: Sequence[int] = RUNS,
    *,
    kd: Sequence[float] | str = KD,
    kp: Sequence[float] = KP,
    delay: float | str = 0.0,
    cutoff: float | str = 10,
    median: int = 1,
    velocity: str = "auto",
) -> Study:
    """The runs, torque by the law with gains of one leg."""
    files = [[str(DATA / "go2" / f"run{k}.npz")] for k in runs]
    columns = {key: key for key in ("t", "q", "qd", "q_ref", "qd_ref")}
    law = {"kp": [*kp] * 4, "kd": kd if isinstance(kd, str) else [*kd] * 4, "delay": delay}
    return study_from_mapping(
        {
            "record": {"files": files[0], "also": files[1:], "columns": columns, "rate": 200},
            "controller": {"law": law, "torque": {"saturation": None}},
            "signals": {
                "median": median,
                "torque_median": median,
                "lowpass": {"cutoff": cutoff},
                "velocity": velocity,
            },
        }
    )


def observed(model: GeneratedModel, study: Study) -> list[Observation]:
    """Rows of each run, one cut-off for all."""
    records = read_records(study.record, model)
    return [reading.observation(model) for reading in problem(model, records, study).prepared]


def left_out(model: GeneratedModel, runs: Sequence[Observation]) -> np.ndarray:
    """Error on each run, %, of a fit of the others."""
    errors = []
    for k, own in enumerate(runs):
        others = stack([one for i, one in enumerate(runs) if i != k])
        fit = estimate_of(others, WEIGHTED, model=model)
        r, y = own.norms(fit.names, fit.X)
        errors.append(100 * np.linalg.norm(r) / np.linalg.norm(y))
    return np.array(errors)


def spread(
    model: GeneratedModel, runs: Sequence[Observation], names: Sequence[str]
) -> list[tuple[str, float, float, float]]:
    """Mean over fits of single runs, their scatter, and the stated deviation, by name."""
    fits = [estimate_of(one, WEIGHTED, model=model) for one in runs]
    rows = []
    for name in names:
        k = fits[0].names.index(name)
        X, s = (
            np.array([x[k] for x in (getattr(fit, key) for fit in fits)])
            for key in ("X", "sigma_corrected")
        )
        rows.append((name, float(X.mean()), float(X.std(ddof=1)), float(np.sqrt(np.mean(s**2)))))
    return rows


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print(flush=True)


def go2() -> None:
    model = go2_model()
    plain = observed(model, go2_study())
    print("Eight fits, each of one run: scatter against stated deviations\n")
    names = [f"{family}{j}" for family in ("Ia", "FS", "FV") for j in CALVES]
    table(
        ("parameter", "mean", "scatter of 8", "stated", "scatter / stated"),
        [
            (n, f"{m:.4f}", f"{s:.4f}", f"{d:.4f}", f"{s / d:.1f}")
            for n, m, s, d in spread(model, plain, names)
        ],
    )
    print("FV by the gains that the law is given (all runs)\n")
    rows = []
    for kp, kd, delay in (
        (KP, KD, 0.0),
        (KP, KD, 0.005),
        (KP, KD, 0.01),
        (KP, (1.5, 1.5, 1.5), 0.0),
        ((20, 20, 20), (1.5, 1.5, 1.5), 0.0),
        (KP, (0, 0, 0), 0.0),
    ):
        fit = estimate_of(
            stack(observed(model, go2_study(kp=kp, kd=kd, delay=delay))), WEIGHTED, model=model
        )
        rows.append(
            (str(kp), str(kd), f"{1e3 * delay:g}", *(f"{fit[f'FV{j}']:+.3f}" for j in (1, 2, 3)))
        )
    table(("kp", "kd", "delay, ms", "FV1", "FV2", "FV3"), rows)
    for settings in ({"kd": "fit"}, {"delay": "fit"}):
        study = go2_study(**settings)  # type: ignore[arg-type]
        records = read_records(study.record, model)
        print(problem(model, records, study).noted("law").text, "\n")
    print("Error on each run, %, of a fit of the other seven\n")
    cases: list[tuple[str, Study]] = [
        ("median 5, cut-off auto", go2_study(cutoff="auto", median=5)),
        (
            "the same, differences of q alone",
            go2_study(cutoff="auto", median=5, velocity="differences"),
        ),
        ("median off, auto", go2_study(cutoff="auto")),
        *(
            (f"median off, {f} Hz, {1e3 * d:g} ms", go2_study(cutoff=f, delay=d))
            for f in (5, 10, 20)
            for d in (0.0, 0.005, 0.01)
        ),
        (
            "20 Hz, 10 ms, differences of q alone",
            go2_study(cutoff=20, delay=0.01, velocity="differences"),
        ),
    ]
    rows = []
    for title, one in cases:
        errors = left_out(model, observed(model, one))
        rows.append((title, *(f"{e:.1f}" for e in errors), f"{errors.mean():.2f}"))
    table(("treatment", *map(str, RUNS), "mean"), rows)


def calf() -> None:
    """Armature of the calves by treatment: mean of eight fits, scatter, stated deviation."""
    model = go2_model()
    rows = []
    for title, study in (
        ("median off, low-pass 10 Hz", go2_study()),
        ("the same, torques 10 ms later", go2_study(delay=0.01)),
        ("median 5, cut-off auto", go2_study(cutoff="auto", median=5)),
    ):
        values = spread(model, observed(model, study), [f"Ia{j}" for j in CALVES])
        rows.append((title, *(f"{m:.4f}, {s:.4f} ({d:.4f})" for _, m, s, d in values)))
    table(("treatment", "FL, `Ia3`", "FR, `Ia6`", "RL, `Ia9`", "RR, `Ia12`"), rows)


if __name__ == "__main__":
    asked = sys.argv[1:] or ["go2"]
    for name in asked:
        {"go2": go2, "calf": calf}[name]()
