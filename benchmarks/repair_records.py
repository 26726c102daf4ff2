"""`--repair` on measured records: right studies stay, planted errors are taken back.

    SYMGEN_DATA=... python benchmarks/repair_records.py --studies 10

Records and robots are those of the comparison (`benchmarks/tools/records.py`). Each record is read
right, then with one and with two planted errors (`benchmarks/repair.py`), which the program sees as
arrays. A repair is right if the records that it reads are those before the errors, and if it leaves
the robot as it is; a zero is corrected in the robot.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import json
import sys
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE / "tools")]

import numpy as np
import records as measured
import repair as simulated
from truth_shared import markdown
from truth_simulator import Joint, Robot

import runtime
import symgen
from runtime.core.model import joint_units

CASES = (measured.tx40, measured.emps, measured.kr300, measured.go2)
LABELS = (
    "sign of a torque", "sign of a position", "torques exchanged", "positions exchanged", "degrees",
    "torque factor", "gear ratio", "zero", "rate", "delay",
)  # fmt: skip
SEED = 70_000


def chain(units: list[str]) -> Robot:
    """A stand-in that tells the errors which joints turn."""
    flat = ((0.0, 0.0, 0.0),) * 3
    return Robot("", tuple(Joint(*flat, 1, flat[0], flat[0], 1, 1, u == "m") for u in units))


def studies(case: Any, count: int) -> list[dict[str, Any]]:
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{case.name}.{case.suffix}"
        file.write_text(case.robot, encoding="utf-8")
        model, variants = symgen.model(file), symgen.variants(file)
    robot = chain(list(joint_units(model)))
    worlds = [
        simulated.World(robot, p.t, p.q, 0 * p.q, 0 * p.q, p.tau, robot, {}) for p in case.train
    ]
    rows = []
    for k in range(count + 1):
        rng = np.random.default_rng([SEED + k, len(case.name)])
        known = {e.label: e for e in simulated.ERRORS}
        suited = [x for x in LABELS if robot.n > 1 or "exchanged" not in x]
        wrong = [] if k == 0 else [str(x) for x in rng.permutation(suited)[: 1 + (k - 1) % 2]]
        planted, joints = worlds, []
        for label in wrong:
            can = [j for j in range(robot.n) if known[label].suits(robot, j)]
            if not can:
                continue
            j = int(rng.choice(can))
            state, made = rng.bit_generator.state, []
            for w in planted:
                rng.bit_generator.state = state
                made.append(known[label].plant(w, j, rng))
            planted, joints = made, [*joints, f"{label} {j + 1}"]
        records = [runtime.Record(w.t, w.q, w.tau, name=f"{i}") for i, w in enumerate(planted)]
        began = process_time()
        row: dict[str, Any] = {"record": case.name, "errors": joints}
        try:
            repair = runtime.repair(model, records, variants=variants)
        except runtime.InputError as e:
            rows.append(row | {"outcome": "refused", "lines": [str(e)], "before": 0.0, "after": 0.0, "s": process_time() - began})  # fmt: skip
            print(rows[-1], flush=True)
            continue
        lines = [c.line for c in repair.changes] or [
            x for c in repair.candidates[:1] for x in c.lines
        ]
        zero = any(x.startswith("zero") for x in joints)
        right = repair.kept and all(
            taken_back(w, one, zero) for w, one in zip(worlds, repair.records, strict=True)
        )
        frames = {} if repair.study.robot is None else repair.study.robot.frames
        right = right and bool(frames) == zero
        also = any("scale.q" in x for one in repair.equivalent for x in one.lines)
        outcome = "unchanged" if not repair.kept else "right" if right else "other"
        rows.append(row | {"outcome": outcome, "lines": lines, "equivalents": [list(x.lines) for x in repair.equivalent], "before": repair.before, "after": repair.after, "s": process_time() - began})  # fmt: skip
        del also
        print(rows[-1], flush=True)
    return rows


def taken_back(w: simulated.World, record: Any, zero: bool) -> bool:
    """Whether a repaired record is the record before the errors, a zero aside."""
    N = len(record)
    k = int(np.argmin(np.abs(w.t - record.t[0] - (w.t[0] - record.t[0] > 1e9))))
    if k + N > len(w.t) or abs((w.t[1] - w.t[0]) * record.rate - 1) > 0.02:
        return False
    q, tau = w.q[k : k + N], w.tau[k : k + N]
    off = record.q - q
    if zero:
        off = off - off.mean(axis=0)
    still = np.sqrt((off**2).mean(axis=0)) < 0.05 * (np.ptp(q, axis=0) + 1e-9)
    size = np.sqrt((tau**2).mean(axis=0)) + 1e-12
    return bool(
        still.all() and (np.sqrt(((record.tau - tau) ** 2).mean(axis=0)) < 0.1 * size).all()
    )


def main() -> None:
    warnings.filterwarnings("ignore")
    parser = argparse.ArgumentParser()
    parser.add_argument("--studies", type=int, default=10, help="wrong ones of each record")
    parser.add_argument("--only", default="")
    asked = parser.parse_args()
    rows = []
    for case in CASES:
        if asked.only in case.__name__:
            rows += studies(case(), asked.studies)
    Path("repair_records.json").write_text(json.dumps(rows, indent=1))
    head = ("record", "errors", "outcome", "unseen rows before, %", "after, %", "lines", "s")
    lines = [
        (r["record"], "; ".join(r["errors"]) or "none", r["outcome"], f"{r['before']:.1f}", f"{r['after']:.1f}", "; ".join(r["lines"])[:160], f"{r['s']:.0f}")
        for r in rows
    ]  # fmt: skip
    print(markdown(head, lines))


if __name__ == "__main__":
    main()
