"""Memory of `symgen identify` on a long record: campaign."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign

import symgen

RATE, N, BLOCK = 1000.0, 3_600_000, 65536
NOISE = 0.3  # N m
MOST = 4e9  # bytes
IDENTIFY = "import sys; from symgen.cli.main import main; sys.argv[0] = 'symgen'; main()"


def states(k: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, qd, qdd, shape (B, n), of the samples k: four sines per joint."""
    rng = np.random.default_rng(1)
    q, qd, qdd = np.zeros((3, len(k), n))
    for f in (0.09, 0.17, 0.31, 0.43):
        w = 2 * np.pi * f * rng.uniform(0.9, 1.1, n)
        a = rng.uniform(0.1, 0.4, n)
        angle = k[:, None] / RATE * w + rng.uniform(0, 6, n)
        q += a * np.sin(angle)
        qd += a * w * np.cos(angle)
        qdd -= a * w**2 * np.sin(angle)
    return q, qd, qdd


@campaign
@pytest.mark.skipif(sys.platform != "linux", reason="peak memory of one child by wait4")
def test_an_hour_of_seven_joints_takes_less_than_4_gb(tmp_path: Path) -> None:
    """1 kHz, with random parameters; the largest resident set of the command, or that of this process
    where it is larger.
    """
    model, rng = symgen.model("panda"), np.random.default_rng(2)
    n = len(model.JOINTS)
    X = rng.uniform(0.2, 1.0, len(model.BASE_PARAMETERS))
    q, tau = np.empty((2, N, n))
    for begin in range(0, N, BLOCK):
        k = np.arange(begin, min(begin + BLOCK, N))
        motion = states(k, n)
        q[k] = motion[0]
        tau[k] = model.inverse_dynamics(*motion, X) + rng.normal(scale=NOISE, size=(len(k), n))
    columns = {f"q{j + 1}": q[:, j] for j in range(n)}
    columns |= {f"tau{j + 1}": tau[:, j] for j in range(n)}
    np.savez(tmp_path / "hour.npz", t=np.arange(N) / RATE, **columns)
    command = [sys.executable, "-c", IDENTIFY, "identify", "panda", str(tmp_path / "hour.npz")]
    with (tmp_path / "said.txt").open("w") as said:
        process = subprocess.Popen(command, stdout=said, stderr=said)
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode in (0, 1), (tmp_path / "said.txt").read_text()
    assert 1024 * usage.ru_maxrss < MOST
