"""python -m fuzz [FORMAT ...] [--cases N] [--seed S] [--out FOLDER]: counts by format; new faults,
minimised, in FOLDER/FORMAT/.
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path
from time import monotonic

from fuzz.formats import FORMATS
from fuzz.harness import Reader, report, run, smaller

parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
parser.add_argument("formats", nargs="*", default=list(FORMATS), help=", ".join(FORMATS))
parser.add_argument("--cases", type=int, default=20000, help="of all formats together")
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--first", type=int, default=0, help="number of the first case")
parser.add_argument("--out", type=Path, default=Path("found"))


def main() -> None:
    arguments = parser.parse_args()
    total = sum(FORMATS[name].share for name in arguments.formats)
    counts = {}
    for name in arguments.formats:
        reader = (
            Reader()
        )  # of its own: threads of one library must not count against the memory of the next
        cases, begun = arguments.cases * FORMATS[name].share // total, monotonic()
        found: dict[str, float] = {
            "ok": 0,
            "refused": 0,
            "fault": 0,
            "seconds": 0.0,
            "peak_MB": 0.0,
        }
        known: set[tuple[str, str]] = set()
        slowest = (0.0, 0)
        for number, content, outcome in run(
            reader, name, arguments.seed, range(arguments.first, arguments.first + cases)
        ):
            found["fault" if outcome.fault else outcome.kind] += 1
            slowest = max(slowest, (outcome.seconds, number))
            found["peak_MB"] = max(found["peak_MB"], round(outcome.peak / 1e6))
            if outcome.fault and (outcome.kind, outcome.where) not in known:
                known.add((outcome.kind, outcome.where))
                content = smaller(
                    reader, name, content, outcome, 12 if outcome.kind in ("hang", "death") else 300
                )
                folder = arguments.out / name
                folder.mkdir(parents=True, exist_ok=True)
                label = hashlib.sha256(content).hexdigest()[:12]
                (folder / label).write_bytes(content)
                (folder / f"{label}.txt").write_text(
                    (
                        f"seed {arguments.seed} number {number}\n{outcome.kind} "
                        f"{outcome.where}\n{outcome.text}\n"
                    ),
                    errors="replace",
                )
                print(
                    (
                        f"  {name} {number}: {outcome.kind} {outcome.where} -> {label}\n     "
                        f"{outcome.text.strip().splitlines()[-1][:200] if outcome.text.strip() else ''}"
                    ),
                    flush=True,
                )
        found["seconds"] = round(slowest[0], 2)
        counts[name] = found
        print(f"{name}: {cases} cases, {found['ok']} ok, {found['refused']} refused, {found['fault']} faults of {len(known)} kinds; "
              f"slowest {slowest[0]:.2f} s (number {slowest[1]}), {found['peak_MB']} MB; {monotonic() - begun:.0f} s", flush=True)  # fmt: skip
        reader.close()
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / f"counts-{arguments.seed}.json").write_text(report(counts))


if __name__ == "__main__":
    main()
