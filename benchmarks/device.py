"""The array module and the resolution study on a device: bytes moved per second against what a copy on that device moves.

    python benchmarks/device.py [--package torch] [--samples 1000000] [--rounds 7]        packages: cupy, jax, torch, numpy

The first GPU that one of the packages finds is used. `signals` must at least read q, qd, qdd and write its result once; those bytes over its time,
relative to a copy of an array of the size of the result on the same device, are the fraction of the bandwidth reached: 1 is the limit. Then runs of a
resolution study of 45000 samples, per second, and their agreement with the NumPy path. Rounds are interleaved, ratios are median [range].

Where there is no GPU this is said, and the same is run on the processor: that shows that it works and what operation-by-operation arrays cost
there; it says nothing about a GPU. No GPU was at hand when this was written: its fraction of the bandwidth has not been measured.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import importlib.util
import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import numpy as np

from runtime.model.array_model import ArrayModel, load_arrays
from runtime.model.generated import GeneratedModel, load_model
from runtime.records.record import Record
from runtime.resolution.cestac import cestac
from runtime.resolution.device import Device, arrays_like, to_host
from runtime.settings.study import CestacSettings, Study
from symgen.description import load_robot
from symgen.emit import generate_files

Array = Any


@dataclass(frozen=True)
class Place:
    """like : an array on the device.   wait : until the device has finished with an array.   compiled : the compiler of the package."""

    package: str
    gpu: bool
    like: Array
    wait: Callable[[Array], object]
    compiled: Callable[[Callable[..., Any]], Callable[..., Any]] | None = None


def place(package: str) -> Place | None:
    """The device of a package that is installed, a GPU if it sees one."""
    if importlib.util.find_spec(package) is None:
        return None
    if package == "cupy":
        import cupy

        if not cupy.cuda.runtime.getDeviceCount():
            return None
        return Place(package, True, cupy.zeros(1), lambda x: cupy.cuda.Device().synchronize())
    if package == "torch":
        import torch

        gpu = torch.cuda.is_available()
        like = torch.zeros(1, dtype=torch.float64, device="cuda" if gpu else "cpu")
        return Place(package, gpu, like, lambda x: torch.cuda.synchronize() if gpu else None)
    if package == "jax":
        import jax

        jax.config.update("jax_enable_x64", True)
        like = jax.numpy.zeros(1)
        return Place(package, jax.default_backend() == "gpu", like, lambda x: x.block_until_ready(), jax.jit)
    return Place("numpy", False, np.zeros(1), lambda x: None)


def interleaved(contenders: dict[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Wall seconds of every contender in every round, in rotated order, after one call of each."""
    for run in contenders.values():
        run()
    times: dict[str, list[float]] = {name: [] for name in contenders}
    names = list(contenders)
    for r in range(rounds):
        for k in range(len(names)):
            name = names[(k + r) % len(names)]
            start = time.perf_counter()
            contenders[name]()
            times[name].append(time.perf_counter() - start)
    return times


def spread(values: list[float]) -> str:
    return f"{statistics.median(values):.3f} [{min(values):.3f}, {max(values):.3f}]"


def bandwidth(where: Place, model: GeneratedModel, arrays: ArrayModel, N: int, rounds: int) -> None:
    put, n = arrays_like(where.like).put, len(model.JOINTS)
    states = np.random.default_rng(1).uniform(-2, 2, (3, N, n))
    q, qd, qdd = (put(x) for x in states)
    result = put(np.ones((arrays.SIGNALS, N)))
    signals = arrays.signals if where.compiled is None else where.compiled(arrays.signals)
    copy: Callable[[Array], Array] = lambda x: x + 0.0  # noqa: E731
    copy = copy if where.compiled is None else where.compiled(copy)
    few = slice(0, 1000)
    expected = model.regressor(*(x[few] for x in states))
    scale = np.abs(expected).max(axis=(0, 1))
    found = to_host(signals(q[few, :], qd[few, :], qdd[few, :]))
    worst = max(float(np.abs(c * found[s] - expected[:, j, k]).max() / scale[k]) for k, j, s, c in arrays.ENTRIES)
    times = interleaved({"signals": lambda: where.wait(signals(q, qd, qdd)), "copy": lambda: where.wait(copy(result))}, rounds)
    moved, copied = 8 * N * (3 * n + arrays.SIGNALS), 2 * 8 * N * arrays.SIGNALS
    fractions = [(moved / a) / (copied / b) for a, b in zip(times["signals"], times["copy"], strict=True)]
    print(
        f"  signals, {N} samples: {1e9 * statistics.median(times['signals']) / N:.1f} ns a sample, largest deviation from NumPy {worst:.1e}"
    )
    print(f"  copy {copied / statistics.median(times['copy']) / 1e9:.1f} GB/s; fraction of it that signals reaches {spread(fractions)}")


def runs(where: Place, model: GeneratedModel, arrays: ArrayModel, batch: int, rounds: int) -> None:
    rng, N, n = np.random.default_rng(2), 45000, len(model.JOINTS)
    t = np.arange(N) / 5000
    w = 2 * np.pi * rng.uniform(0.2, 2.0, (5, n))
    q = (rng.uniform(-0.4, 0.4, (5, n)) * np.sin(w * t[:, None, None] + rng.uniform(0, 6, (5, n)))).sum(1)
    qd = np.gradient(q, t, axis=0)
    tau = model.observation_matrix(q, qd, np.gradient(qd, t, axis=0)) @ rng.uniform(0.5, 2, len(model.BASE_PARAMETERS))
    record = Record(t=t, q=q, tau=tau.reshape(n, N).T + 0.05 * rng.standard_normal((N, n)), rate=5000.0, name="motion")
    study = Study(cestac=CestacSettings(delta=(1e-4,), runs=max(2, batch), columns="all"))
    device = Device(arrays, where.like, batch=batch, compiled=where.compiled)
    empty = replace(study, cestac=replace(study.cestac, delta=()))
    found, expected = cestac(model, record, study, device=device), cestac(model, record, study)
    X, Y = (np.array([run.X for run in result.levels[0].runs]) for result in (found, expected))
    print(f"  runs of a study, {N} samples: largest deviation of X from the NumPy path {np.abs(X - Y).max() / np.abs(Y).max():.1e}")
    times = interleaved({"device": lambda: cestac(model, record, study, device=device), "NumPy": lambda: cestac(model, record, study),
                         "rest": lambda: cestac(model, record, empty)}, rounds)  # fmt: skip
    ratios = [(b - c) / (a - c) for a, b, c in zip(times["device"], times["NumPy"], times["rest"], strict=True)]
    print(
        f"  one NumPy run / one on the device, batches of {batch}: {spread(ratios)}{'; each study compiles anew' if where.compiled else ''}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--package", choices=["cupy", "torch", "jax", "numpy"])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--batch", type=int, default=8)
    arguments = parser.parse_args()
    found = [p for p in map(place, [arguments.package] if arguments.package else ["cupy", "torch", "jax", "numpy"]) if p]
    if not found:
        sys.exit(f"{arguments.package} is not installed, or sees no device")
    gpus = [p for p in found if p.gpu]
    if not gpus:
        print("no GPU found: its bandwidth is not measured; what follows is this processor, one core")
        arguments.samples = min(arguments.samples, 100_000)
    with TemporaryDirectory() as folder:
        for name, text in generate_files(load_robot("tx40"), targets=("numpy", "xp"), command="tx40").items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        model = load_model("tx40", folder=Path(folder))
        arrays = load_arrays("tx40", of=model, folder=Path(folder))
        for where in gpus[:1] or found:
            print(f"{where.package}, {Device(arrays, where.like).name}")
            bandwidth(where, model, arrays, arguments.samples, arguments.rounds)
            runs(where, model, arrays, arguments.batch if where.gpu else 2, arguments.rounds)


if __name__ == "__main__":
    main()
