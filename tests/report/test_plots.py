"""Figures: made without a window or global state, deterministic, broken lines where rows are missing."""

import sys

import numpy as np
import pytest

from runtime.identification.validation import Comparison, JointComparison
from runtime.reporting import figures as plots


@pytest.fixture
def comparison():
    t = np.r_[np.linspace(0, 1, 50), np.linspace(2, 3, 50)]
    y = np.sin(5 * t)
    return Comparison(tuple(JointComparison(str(j), t, y, 0.9 * y) for j in (1, 2, 3)))


def test_formats(comparison):
    figure = plots.torque_overlay(comparison)
    assert plots.png(figure).startswith(b"\x89PNG") and b"<svg" in plots.svg(figure)
    assert plots.svg(plots.residual_histogram(comparison)).startswith(b"<?xml")
    assert "matplotlib.pyplot" not in sys.modules


def test_same_data_same_bytes(comparison):
    first, second = (plots.svg(plots.joint_overlay(comparison.joints[0])) for _ in range(2))
    assert first == second


def test_lines_break_at_gaps(comparison):
    upper, lower = plots.joint_overlay(comparison.joints[0]).axes
    for y in (upper.lines[0].get_ydata(), upper.lines[1].get_ydata(), lower.lines[0].get_ydata()):
        assert np.isnan(y).sum() == 1 and np.isnan(y[50])
