"""Slips that the verdict has to name, and right studies that it has to leave alone: `python
benchmarks/slips.py ["kr300 values" ...] [FIRST-LAST]`.

Prints one line per slip, and the counts of slips.md. SYMGEN_DATA is the
folder of the records.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "support")]

import slip_cases  # noqa: E402
import slips_simulated  # noqa: E402


def main(which: list[str]) -> None:
    folder = Path(os.environ["SYMGEN_DATA"])
    numbers = next((word for word in which if word[0].isdigit()), "1-99").split("-")
    names = [word for word in which if not word[0].isdigit()]
    for name, case, listed in (*slip_cases.campaigns(folder), *slips_simulated.campaigns()):
        if names and not any(word in name for word in names):
            continue
        result = case.judged()
        usual = (
            set()
            if isinstance(result, str)
            else {c.question for c in result.checks() if c.state in ("no", "doubtful")}
        )
        print(f"== {name}: right study told of {sorted(usual) or 'nothing'}", flush=True)
        counts = dict.fromkeys(("named", "wrong", "silent", "equivalent"), 0)
        for slip in listed:
            if not int(numbers[0]) <= slip.number <= int(numbers[-1]):
                continue
            start = time.process_time()
            state, text = slip_cases.told(case, slip.change(case), slip, usual)
            counts[state] += 1
            print(
                (
                    f"{name} {slip.number:3d} {slip.name:45s} {state:10s} "
                    f"{time.process_time() - start:5.1f} s  {text}"
                ),
                flush=True,
            )
        print(f"== {name}: {counts}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
