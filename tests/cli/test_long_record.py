"""Memory of `symgen identify` on a long record: campaign."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from campaign import FULL, campaign

import symgen

RATE, BLOCK = 1000.0, 65536
N = 3_600_000 if FULL else 900_000
NOISE = 0.3  # N m
MOST = 4e9 if FULL else 1.3e9  # bytes; 0.4e9 of them for what any command loads
IDENTIFY = """
import sys
from pathlib import Path
from symgen.cli.main import main
sys.argv[0] = "symgen"
try:
    main()
finally:
    print(Path("/proc/self/status").read_text(), file=sys.stderr)
"""


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
@pytest.mark.skipif(sys.platform != "linux", reason="peak memory as Linux tells it")
def test_an_hour_of_seven_joints_takes_less_than_4_gb(tmp_path: Path) -> None:
    """1 kHz, with random parameters; a quarter of the hour, and of what its samples may take, unless
    SYMGEN_FULL=1. The command tells the largest resident set of its own process.
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
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    told = re.search(r"^VmHWM:\s*(\d+) kB", done.stderr, re.MULTILINE)
    assert told is not None
    assert 1024 * int(told[1]) < MOST
