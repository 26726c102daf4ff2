"""Logs of 10 to 30 Hz, as of learning: the verdict names a rate that is slow for the motion."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from support.pair_urdf import URDF
from typer.testing import CliRunner

from runtime.core.record import Record
from runtime.plausible.sampling import lost_accelerations
from runtime.study import Signals
from symgen.cli.main import app

SLOW = "Is the motion slow enough for the sampling rate?"


def identified(folder: Path, rate: float, top: float) -> tuple[str, str]:
    """Verdict, and doubt with the next step, of a log of motions up to `top` Hz, torques by pinocchio."""
    robot = folder / "pair.urdf"
    robot.write_text(URDF)
    t, rng = np.arange(0, 40, 1 / rate), np.random.default_rng(5)
    f, phi = rng.uniform(0.1, top, (4, 2)), rng.uniform(0, 6, (4, 2))
    w, a = 2 * np.pi * f, 0.3 / (1 + (f / 0.4) ** 1.3)
    angle = w * t[:, None, None] + phi
    q, qd = (a * np.sin(angle)).sum(1), (a * w * np.cos(angle)).sum(1)
    qdd = -(a * w**2 * np.sin(angle)).sum(1)
    model = pinocchio.buildModelFromUrdf(str(robot))
    data = model.createData()
    tau = np.array([pinocchio.rnea(model, data, *x) for x in zip(q, qd, qdd, strict=True)])
    tau += np.array([0.8, 0.4]) * qd + np.array([0.5, 0.3]) * np.sign(qd)
    tau += rng.normal(0, [0.05, 0.02], tau.shape)
    rows = np.column_stack([t, np.round(q, 3), tau])
    head = "t,q1,q2,tau1,tau2"
    np.savetxt(folder / "log.csv", rows, fmt="%.6f", delimiter=",", header=head, comments="")
    done = CliRunner().invoke(app, ["identify", str(robot), str(folder / "log.csv")])
    doubt = re.search(r"Biggest doubt: (.*)", done.stdout)
    assert doubt is not None, done.output
    following = re.search(r"Next: (.*)", done.stdout)
    assert following is not None
    return done.stdout.split(".")[0], f"{doubt[1]} {following[1]}"


@pytest.mark.parametrize(("rate", "top"), [(10, 1.5), (15, 1.5), (30, 3.0), (10, 3.0)])
def test_a_slow_rate_is_the_first_doubt(rate: float, top: float, tmp_path: Path) -> None:
    """Before: "record a motion over the range and speeds ..., for a longer time"."""
    verdict, doubt = identified(tmp_path, rate, top)
    assert verdict in ("With care", "No") and doubt.startswith(SLOW)
    assert f"{rate} Hz are slow for this motion" in doubt
    wanted = re.search(r"record at (\d+) Hz or more, or move more slowly", doubt)
    assert wanted is not None and 2 * rate < int(wanted[1]) <= 20 * rate
    assert identified(tmp_path, float(wanted[1]), top)[0] == "Yes, as far as judged"


@pytest.mark.parametrize(("rate", "top"), [(10, 0.5), (30, 1.5), (200, 3.0)])
def test_a_slow_motion_keeps_its_yes(rate: float, top: float, tmp_path: Path) -> None:
    verdict, doubt = identified(tmp_path, rate, top)
    assert verdict == "Yes, as far as judged" and doubt.startswith("none")


def test_the_share_is_that_of_differences() -> None:
    """Of one sinusoid: differences of differences, compared with its second derivative."""
    rate, f = 30.0, 2.0
    t = np.arange(0, 60, 1 / rate)
    q = np.sin(2 * np.pi * f * t)
    twice = np.gradient(np.gradient(q, t), t)[10:-10]
    exact = -((2 * np.pi * f) ** 2) * q[10:-10]
    lost = np.linalg.norm(exact - twice) / np.linalg.norm(exact)
    record = Record(t=t, q=q, tau=0 * q, rate=rate)
    assert lost_accelerations(record, Signals())[0] == pytest.approx(lost, rel=0.02)
