"""The controller that authors copy: 10,000 steps of its loop against the equations of a textbook."""

from __future__ import annotations

import shutil
import subprocess
from math import copysign, cos, sin
from pathlib import Path

import numpy as np
import pytest

from symgen.description import load_robot
from symgen.emit.generate import generate_files

SOURCE = Path(__file__).resolve().parents[2] / "docs/examples/controller_c/controller.c"
CC = shutil.which("gcc") or shutil.which("cc")
STRICT = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O2"]
HEAP = ("malloc", "calloc", "realloc", "alloca", "free(")


def arm(q, qd, scale):
    """(A, H) of two bars in a vertical plane, joint 2 at 0.5 m, y up, with motors and friction."""
    m2, l1, s1, s2, g = 2.0, 0.5, 0.5, 0.5, 9.81  # s: first moments, kg m
    one, two = 0.1673 + 0.05, 0.1673  # kg m^2: bar and motor of joint 1, bar of joint 2
    c2 = l1 * s2 * cos(q[1])
    A = [[one + m2 * l1**2 + two + 2 * c2, two + c2], [two + c2, two + 0.02]]
    h = l1 * s2 * sin(q[1])
    outer = s2 * g * cos(q[0] + q[1])
    H = [
        -h * (2 * qd[0] * qd[1] + qd[1] ** 2)
        + (s1 + m2 * l1) * g * cos(q[0])
        + outer
        + 0.5 * qd[0]
        + copysign(0.8, qd[0])
        + 0.1,
        h * qd[0] ** 2 + outer + 0.3 * qd[1] + copysign(0.4, qd[1]) - 0.05,
    ]
    return scale * np.array(A), scale * np.array(H)


def expected():
    q, qd = np.array([0.0, 1.0]), np.array([1.0, 0.5])
    for step in range(10_000):
        t = step * 0.001
        target = np.array([sin(t), cos(2 * t)]), np.array([cos(t), -2 * sin(2 * t)])
        v = np.array([-sin(t), -4 * cos(2 * t)]) + 20 * (target[1] - qd) + 100 * (target[0] - q)
        A, H = arm(q, qd, 1.0)
        tau = A @ v + H
        A, H = arm(q, qd, 1.1)
        qd = qd + 0.001 * np.linalg.solve(A, tau - H)
        q = q + 0.001 * qd
        if step % 100 == 99:
            yield [*q, *tau, -0.5 * sin(q[0])]


@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("flags", "tolerance"),
    [([], 1e-8), (["-DTILE=1"], 1e-8), (["-DREAL=float"], 2e-2)],
    ids=["double", "portable", "float"],
)
def test_ten_thousand_steps(tmp_path: Path, flags: list[str], tolerance: float) -> None:
    """Positions, torques and a column of the Jacobian, every hundredth step."""
    source = SOURCE.read_text(encoding="utf-8")
    (tmp_path / "controller.c").write_text(source, encoding="utf-8")
    for name, text in generate_files(load_robot("planar_2r"), targets=("c",)).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
        assert not any(word in source + text for word in HEAP)
    command = [str(CC), *STRICT, *flags, "controller.c", "planar_2r.c", "-o", "controller", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    ran = subprocess.run([tmp_path / "controller"], capture_output=True, text=True, check=True)
    found = np.array([line.split() for line in ran.stdout.splitlines()], dtype=float)
    right = np.array(list(expected()))
    assert found.shape == right.shape == (100, 5)
    assert np.abs(found - right).max() < tolerance * np.abs(right).max()
