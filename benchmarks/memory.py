"""Peak memory and time per sample of `symgen identify` on a record larger than it should need:
TX40, 5 kHz, read by blocks.

    python benchmarks/memory.py [--samples 10000000] [--small 100000] [--format npz|csv|parquet]
    [--reader lowpass|counts] [--rounds 3] [--folder DIR]
        [--workers 2]

The record is made by blocks in a temporary folder: sums of sines about the arm's limits of speed,
torques of the parameters of the robot file with
0.5 N m of noise; for the reader of counts, positions of an encoder of 20,000 lines a turn. Each
identification is a process of its own (`symgen
identify tx40 study.yaml`): ru_maxrss of that process, its CPU time over the samples, start and
imports taken off by the same job on 5000 samples.
Rounds of the small record enclose the large one. The limit is 600 MB at 10 million samples; the
whole-record identification of the small record
(`stream: off`) stands beside it. Plain: what one writes by hand on an emitted module with records
that fit: filters of the whole record, W by blocks
of 65536 samples, each decimated by scipy column by column, lstsq of all rows; CPU time of the small
record, from an .npz.

With --workers instead: the large record by one process and by so many, in turn, on all cores: wall
time, CPU time and peak memory of the process that
asks, which is one of them, and of the others with those that read the file, and whether all results
agree in every byte. Wall time needs a quiet machine;
beside it stands what the CPU times allow at most: all of one over an equal share of all of several.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import numpy as np
import scipy.signal
from numpy.lib import format as npy

ROOT = Path(__file__).resolve().parent.parent

from runtime import load_model

RATE = 5000.0  # Hz
BLOCK = 65536
NOISE = 0.5  # N m
START = 5000  # samples of the job whose time is that of start and imports
LIMIT = 6e8  # bytes
CUTOFF, FACTOR = 50.0, 40  # Hz; of the plain way, those of the default study
STEP = 2 * np.pi / 20000  # rad, of the encoders for the reader of counts
Array = np.ndarray[Any, Any]

CHILD = """
import json, os, resource, sys
sys.argv[0] = "symgen"
from symgen.cli.main import main
try:
    main()
except SystemExit as e:
    code = e.code
def used(who):
    usage = resource.getrusage(who)
    return {"bytes": usage.ru_maxrss * 1024, "s": usage.ru_utime + usage.ru_stime}
own = used(resource.RUSAGE_SELF)
if os.path.exists("/proc/self/status"):  # ru_maxrss begins with that of the process that started this one
    own["bytes"] = next(1024 * int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(json.dumps({"code": code, **own, "others": used(resource.RUSAGE_CHILDREN)}), file=sys.stderr)
"""


def states(k: Array) -> tuple[Array, Array, Array]:
    """q, qd, qdd, shape (B, 6), of the samples k: five sines per joint, periods from 1.5 s to 11 s."""
    rng = np.random.default_rng(1)
    q, qd, qdd = np.zeros((3, len(k), 6))
    for f in (0.09, 0.17, 0.31, 0.43, 0.67):
        w, a, phase = (
            2 * np.pi * f * rng.uniform(0.9, 1.1, 6),
            rng.uniform(0.2, 0.5, 6),
            rng.uniform(0, 6, 6),
        )
        angle = np.mod(k[:, None] / RATE * w + phase, 2 * np.pi)
        q, qd, qdd = (
            q + a * np.sin(angle),
            qd + a * w * np.cos(angle),
            qdd - a * w**2 * np.sin(angle),
        )
    return q, qd, qdd


def blocks(model: Any, samples: int, reader: str) -> Any:
    """t, q, tau by blocks."""
    X = model.base_parameters(model.VALUES)
    rng = np.random.default_rng(2)
    for a in range(0, samples, BLOCK):
        k = np.arange(a, min(a + BLOCK, samples))
        q, qd, qdd = states(k)
        shown = q if reader == "lowpass" else STEP * np.floor(q / STEP + 0.5)
        yield (
            k / RATE,
            shown,
            model.inverse_dynamics(q, qd, qdd, X) + rng.normal(scale=NOISE, size=q.shape),
        )


def write_npz(model: Any, samples: int, folder: Path, reader: str) -> Path:
    """An archive of uncompressed arrays q, tau; one pass for each, nothing but a block in memory."""
    path = folder / f"record{samples}.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, part in (("q", 1), ("tau", 2)):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                npy.write_array_header_1_0(
                    member, {"descr": "<f8", "fortran_order": False, "shape": (samples, 6)}
                )
                for block in blocks(model, samples, reader):
                    member.write(np.ascontiguousarray(block[part]).tobytes())
    return path


def write_csv(model: Any, samples: int, folder: Path, reader: str) -> Path:
    """A text file, as many digits as the numbers need."""
    import polars

    path = folder / f"record{samples}.csv"
    names = [*(f"q{j}" for j in range(1, 7)), *(f"tau{j}" for j in range(1, 7))]
    with path.open("wb") as file:
        for number, (_, q, tau) in enumerate(blocks(model, samples, reader)):
            polars.DataFrame(np.hstack([q, tau]), schema=names).write_csv(
                file, include_header=not number
            )
    return path


def write_parquet(model: Any, samples: int, folder: Path, reader: str) -> Path:
    """A Parquet file of row groups, from a text file."""
    import polars

    text, path = write_csv(model, samples, folder, reader), folder / f"record{samples}.parquet"
    polars.scan_csv(text).sink_parquet(path, row_group_size=BLOCK)
    text.unlink()
    return path


WRITERS: dict[str, Callable[[Any, int, Path, str], Path]] = {
    "npz": write_npz,
    "csv": write_csv,
    "parquet": write_parquet,
}


def plain(model: Any, record: Path) -> tuple[float, Array]:
    """CPU seconds and all base parameters of a record in an .npz by hand."""
    start, steps = time.process_time(), range(0, 10**9, BLOCK)
    with np.load(record) as file:
        q, tau = file["q"], file["tau"]
    q = scipy.signal.sosfiltfilt(scipy.signal.butter(4, CUTOFF, fs=RATE, output="sos"), q, axis=0)
    qd = np.gradient(q, 1 / RATE, axis=0)
    qdd = np.gradient(qd, 1 / RATE, axis=0)
    W, Y = [], []
    for part in (slice(a, a + BLOCK) for a in steps[: -(-len(q) // BLOCK)]):
        for j, D in enumerate(model.regressor(q[part], qd[part], qdd[part]).transpose(1, 0, 2)):
            W.append(
                np.column_stack(
                    [scipy.signal.decimate(column, FACTOR, zero_phase=True) for column in D.T]
                )
            )
            Y.append(scipy.signal.decimate(tau[part, j], FACTOR, zero_phase=True))
    X = np.linalg.lstsq(np.vstack(W), np.concatenate(Y), rcond=None)[0]
    return time.process_time() - start, X


def identified(
    record: Path, stream: int | str, reader: str = "lowpass", workers: int = 1
) -> dict[str, Any]:
    """Peak bytes, CPU and wall seconds of an identification in a process of its own, and its
    estimate.
    """
    columns = {"columns": {"q": ["q"], "tau": ["tau"]}} if record.suffix == ".npz" else {}
    study = record.with_suffix(".yaml")
    signals = (
        {}
        if reader == "lowpass"
        else {"signals": {"reader": reader, "step": STEP, "side": "joint"}}
    )
    settings = {
        "record": {"files": [record.name], "rate": RATE, **columns},
        "stream": stream,
        **signals,
    }
    study.write_text(json.dumps(settings))  # JSON is YAML
    start, command = (
        time.perf_counter(),
        ["identify", "tx40", str(study), "--json", "--workers", str(workers)],
    )
    done = subprocess.run(
        [sys.executable, "-c", CHILD, *command], capture_output=True, text=True, check=False
    )
    wall = time.perf_counter() - start
    lines = done.stderr.strip().splitlines()
    if done.returncode or not lines or not lines[-1].startswith("{"):
        raise SystemExit(f"identification failed:\n{done.stderr[-2000:]}")
    return {
        **json.loads(lines[-1]),
        "wall": wall,
        "text": done.stdout,
        "estimate": json.loads(done.stdout),
    }


def by_workers(record: Path, reader: str, workers: int, rounds: int) -> None:
    """Wall time of one process over that of several, and their memory."""
    done = [
        (identified(record, BLOCK, reader), identified(record, BLOCK, reader, workers))
        for _ in range(rounds)
    ]
    for count, runs in zip((1, workers), zip(*done, strict=True), strict=True):
        wall, cpu, others = (
            ", ".join(f"{x:.1f}" for x in row)
            for row in zip(*((r["wall"], r["s"], r["others"]["s"]) for r in runs), strict=True)
        )
        memory = max(r["bytes"] for r in runs) / 1e6, max(r["others"]["bytes"] for r in runs) / 1e6
        print(
            f"workers {count}: wall {wall} s, CPU {cpu} s, others {others} s; peak {memory[0]:.0f} "
            f"MB, largest other process {memory[1]:.0f} MB"
        )
    ratios = [one["wall"] / several["wall"] for one, several in done]
    most = [workers * (a["s"] + a["others"]["s"]) / (b["s"] + b["others"]["s"]) for a, b in done]
    for name, row in (("wall", ratios), ("at most, by CPU time", most)):
        print(
            f"one over {workers}, {name}: {statistics.median(row):.2f} [{min(row):.2f}, "
            f"{max(row):.2f}]"
        )
    print(
        f"same bytes: {len({run['text'] for pair in done for run in pair}) == 1}, load at the end "
        f"{os.getloadavg()[0]:.1f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--small", type=int, default=100_000)
    parser.add_argument("--format", choices=WRITERS, default="npz")
    parser.add_argument("--reader", choices=("lowpass", "counts"), default="lowpass")
    parser.add_argument("--rounds", type=int, default=3, help="of the small record")
    parser.add_argument("--workers", type=int, default=1, help="compare so many processes with one")
    parser.add_argument("--folder", type=Path, help="where the temporary folder is made")
    arguments = parser.parse_args()
    if hasattr(os, "sched_setaffinity") and arguments.workers == 1:
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    model: Any = load_model(ROOT / "generated" / "tx40.py", trust=True)
    print(
        f"{platform.platform()}, numpy {np.__version__}, load {os.getloadavg()[0]:.1f}, "
        f"{arguments.format}, {arguments.reader}"
    )
    reader = arguments.reader
    with TemporaryDirectory(dir=arguments.folder) as folder:
        write = WRITERS[arguments.format]
        if arguments.workers > 1:
            by_workers(
                write(model, arguments.samples, Path(folder), reader),
                reader,
                arguments.workers,
                arguments.rounds,
            )
            return
        start, small, large = (
            write(model, samples, Path(folder), reader)
            for samples in (START, arguments.small, arguments.samples)
        )
        print(
            f"record of {arguments.samples} samples: {large.stat().st_size / 1e6:.0f} MB in "
            f"{large.suffix}"
        )
        rest = statistics.median(
            identified(start, BLOCK, reader)["s"] for _ in range(arguments.rounds)
        )
        by_blocks = [identified(small, BLOCK, reader) for _ in range(arguments.rounds)]
        whole = identified(small, "off", reader)
        found = identified(large, BLOCK, reader)
        by_blocks += [identified(small, BLOCK, reader) for _ in range(arguments.rounds)]
        by_hand = (
            [plain(model, small)[0] for _ in range(arguments.rounds)]
            if small.suffix == ".npz" and reader == "lowpass"
            else []
        )
    per_small = [1e9 * (run["s"] - rest) / arguments.small for run in by_blocks]
    per_large = 1e9 * (found["s"] - rest) / arguments.samples
    print(
        f"peak memory at {arguments.samples} samples {found['bytes'] / 1e6:.0f} MB (limit "
        f"{LIMIT / 1e6:.0f}): {'ok' if found['bytes'] < LIMIT else 'TOO MUCH'}"
    )
    print(
        f"peak memory at {arguments.small} samples {by_blocks[0]['bytes'] / 1e6:.0f} MB by blocks, "
        f"{whole['bytes'] / 1e6:.0f} MB whole"
    )
    print(
        f"time per sample {per_large:.0f} ns; at {arguments.small} samples "
        f"{statistics.median(per_small):.0f} [{min(per_small):.0f}, {max(per_small):.0f}]"
    )
    ratios = [per_large / x for x in per_small]
    print(f"ratio {statistics.median(ratios):.2f} [{min(ratios):.2f}, {max(ratios):.2f}]")
    if by_hand:
        per_plain = [1e9 * seconds / arguments.small for seconds in by_hand]
        print(
            f"plain {statistics.median(per_plain):.0f} ns a sample; over ours at "
            f"{arguments.samples} samples {statistics.median(per_plain) / per_large:.1f}"
        )
    X = found["estimate"]
    exact = model.base_parameters(model.VALUES)
    worst = max(abs(np.array(X["X"]) - exact) / np.array(X["sigma_corrected"]))
    print(
        f"largest error of a parameter: {worst:.1f} of its deviation; read "
        f"{X['settings']['stream']}"
    )


if __name__ == "__main__":
    main()
