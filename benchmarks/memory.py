"""Peak memory and time per sample of `symgen identify` on a record larger than it should need: TX40, 5 kHz, read by blocks.

    python benchmarks/memory.py [--samples 10000000] [--small 100000] [--format npz] [--rounds 3] [--folder DIR]

The record is made by blocks in a temporary folder: sums of sines about the arm's limits of speed, torques of the parameters of the robot file with
0.5 N m of noise. Each identification is a process of its own (`symgen identify tx40 record --block 65536`): ru_maxrss of that process, its CPU time over
the samples, start and imports taken off by the same job on 5000 samples. Rounds of the small record enclose the large one.
The limit is 1 GB at 10 million samples; the whole-record identification of the small record (`stream: off`) stands beside it.
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
import zipfile
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import numpy as np
from numpy.lib import format as npy

ROOT = Path(__file__).resolve().parent.parent

from runtime import load_model

RATE = 5000.0  # Hz
BLOCK = 65536
NOISE = 0.5  # N m
START = 5000  # samples of the job whose time is that of start and imports
LIMIT = 1e9  # bytes
Array = np.ndarray[Any, Any]

CHILD = """
import json, resource, sys
sys.argv[0] = "symgen"
from symgen.cli.main import main
try:
    main()
except SystemExit as e:
    code = e.code
usage = resource.getrusage(resource.RUSAGE_SELF)
print(json.dumps({"code": code, "bytes": usage.ru_maxrss * 1024, "s": usage.ru_utime + usage.ru_stime}), file=sys.stderr)
"""


def states(k: Array) -> tuple[Array, Array, Array]:
    """q, qd, qdd, shape (B, 6), of the samples k: five sines per joint, periods from 1.5 s to 11 s."""
    rng = np.random.default_rng(1)
    q, qd, qdd = np.zeros((3, len(k), 6))
    for f in (0.09, 0.17, 0.31, 0.43, 0.67):
        w, a, phase = 2 * np.pi * f * rng.uniform(0.9, 1.1, 6), rng.uniform(0.2, 0.5, 6), rng.uniform(0, 6, 6)
        angle = np.mod(k[:, None] / RATE * w + phase, 2 * np.pi)
        q, qd, qdd = q + a * np.sin(angle), qd + a * w * np.cos(angle), qdd - a * w**2 * np.sin(angle)
    return q, qd, qdd


def blocks(model: Any, samples: int) -> Any:
    """t, q, tau by blocks."""
    X = model.base_parameters(model.VALUES)
    rng = np.random.default_rng(2)
    for a in range(0, samples, BLOCK):
        k = np.arange(a, min(a + BLOCK, samples))
        q, qd, qdd = states(k)
        yield k / RATE, q, model.inverse_dynamics(q, qd, qdd, X) + rng.normal(scale=NOISE, size=q.shape)


def write_npz(model: Any, samples: int, folder: Path) -> Path:
    """An archive of uncompressed arrays q, tau; one pass for each, nothing but a block in memory."""
    path = folder / f"record{samples}.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, part in (("q", 1), ("tau", 2)):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                npy.write_array_header_1_0(member, {"descr": "<f8", "fortran_order": False, "shape": (samples, 6)})
                for block in blocks(model, samples):
                    member.write(np.ascontiguousarray(block[part]).tobytes())
    return path


def write_csv(model: Any, samples: int, folder: Path) -> Path:
    """A text file, 9 digits."""
    path = folder / f"record{samples}.csv"
    with path.open("w") as file:
        file.write(",".join([*(f"q{j}" for j in range(1, 7)), *(f"tau{j}" for j in range(1, 7))]) + "\n")
        for _, q, tau in blocks(model, samples):
            np.savetxt(file, np.hstack([q, tau]), fmt="%.9g", delimiter=",")
    return path


def write_parquet(model: Any, samples: int, folder: Path) -> Path:
    """A Parquet file of row groups, from a text file."""
    import polars

    text, path = write_csv(model, samples, folder), folder / f"record{samples}.parquet"
    polars.scan_csv(text).sink_parquet(path, row_group_size=BLOCK)
    text.unlink()
    return path


WRITERS: dict[str, Callable[[Any, int, Path], Path]] = {"npz": write_npz, "csv": write_csv, "parquet": write_parquet}


def identified(record: Path, stream: int | str) -> dict[str, Any]:
    """Peak bytes and CPU seconds of an identification in a process of its own, and its estimate."""
    columns = {"columns": {"q": ["q"], "tau": ["tau"]}} if record.suffix == ".npz" else {}
    study = record.with_suffix(".yaml")
    study.write_text(json.dumps({"record": {"files": [record.name], "rate": RATE, **columns}, "stream": stream}))  # JSON is YAML
    done = subprocess.run(
        [sys.executable, "-c", CHILD, "identify", "tx40", str(study), "--json"], capture_output=True, text=True, check=False
    )
    lines = done.stderr.strip().splitlines()
    if done.returncode or not lines or not lines[-1].startswith("{"):
        raise SystemExit(f"identification failed:\n{done.stderr[-2000:]}")
    return {**json.loads(lines[-1]), "estimate": json.loads(done.stdout)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--small", type=int, default=100_000)
    parser.add_argument("--format", choices=WRITERS, default="npz")
    parser.add_argument("--rounds", type=int, default=3, help="of the small record")
    parser.add_argument("--folder", type=Path, help="where the temporary folder is made")
    arguments = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    model: Any = load_model(ROOT / "generated" / "tx40.py")
    print(f"{platform.platform()}, numpy {np.__version__}, load {os.getloadavg()[0]:.1f}, one core, {arguments.format}")
    with TemporaryDirectory(dir=arguments.folder) as folder:
        write = WRITERS[arguments.format]
        start, small, large = (write(model, samples, Path(folder)) for samples in (START, arguments.small, arguments.samples))
        print(f"record of {arguments.samples} samples: {large.stat().st_size / 1e6:.0f} MB in {large.suffix}")
        rest = statistics.median(identified(start, BLOCK)["s"] for _ in range(arguments.rounds))
        by_blocks = [identified(small, BLOCK) for _ in range(arguments.rounds)]
        whole = identified(small, "off")
        found = identified(large, BLOCK)
        by_blocks += [identified(small, BLOCK) for _ in range(arguments.rounds)]
    per_small = [1e9 * (run["s"] - rest) / arguments.small for run in by_blocks]
    per_large = 1e9 * (found["s"] - rest) / arguments.samples
    print(
        f"peak memory at {arguments.samples} samples {found['bytes'] / 1e6:.0f} MB (limit {LIMIT / 1e6:.0f}): {'ok' if found['bytes'] < LIMIT else 'TOO MUCH'}"
    )
    print(f"peak memory at {arguments.small} samples {by_blocks[0]['bytes'] / 1e6:.0f} MB by blocks, {whole['bytes'] / 1e6:.0f} MB whole")
    print(
        f"time per sample {per_large:.0f} ns; at {arguments.small} samples {statistics.median(per_small):.0f} [{min(per_small):.0f}, {max(per_small):.0f}]"
    )
    ratios = [per_large / x for x in per_small]
    print(f"ratio {statistics.median(ratios):.2f} [{min(ratios):.2f}, {max(ratios):.2f}]")
    X = found["estimate"]
    exact = model.base_parameters(model.VALUES)
    worst = max(abs(np.array(X["X"]) - exact) / np.array(X["sigma_corrected"]))
    print(f"largest error of a parameter: {worst:.1f} of its deviation; read {X['settings']['stream']}")


if __name__ == "__main__":
    main()
