"""Figures: made without a window or global state, deterministic, broken lines where rows are
missing.
"""

import sys

import matplotlib as mpl
import numpy as np
import pytest

from runtime.core.validation import JointComparison
from runtime.reporting import figures as plots


@pytest.fixture
def comparison():
    t = np.r_[np.linspace(0, 1, 50), np.linspace(2, 3, 50)]
    y = np.sin(5 * t)
    return tuple(JointComparison(str(j), t, y, 0.9 * y) for j in (1, 2, 3))


def test_formats(comparison):
    figure = plots.torque_overlay(comparison)
    assert plots.png(figure).startswith(b"\x89PNG") and b"<svg" in plots.svg(figure)
    assert plots.svg(plots.residual_histogram(comparison)).startswith(b"<?xml")
    assert "matplotlib.pyplot" not in sys.modules


def test_same_data_same_bytes(comparison):
    first, second = (plots.svg(plots.joint_overlay(comparison[0])) for _ in range(2))
    assert first == second


def test_lines_break_at_gaps(comparison):
    upper, lower = plots.joint_overlay(comparison[0]).axes
    for y in (upper.lines[0].get_ydata(), upper.lines[1].get_ydata(), lower.lines[0].get_ydata()):
        assert np.isnan(y).sum() == 1 and np.isnan(y[50])


def test_panels_stand_apart_and_inside_the_figure():
    t = np.linspace(0, 1, 50)
    y = 1e5 * np.sin(5 * t)
    figure = plots.torque_overlay(
        tuple(JointComparison(str(j), t, 10.0**-j * y, 0.9 * 10.0**-j * y) for j in range(7))
    )
    plots.png(figure)
    boxes = [ax.get_tightbbox() for ax in figure.axes if ax.get_visible()] + [
        figure.legends[0].get_window_extent()
    ]
    width, height = figure.get_size_inches() * figure.dpi
    assert all(
        box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height for box in boxes
    )
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_logarithmic_axes_read_as_numbers():
    def draw(ax, values):
        ax.plot(*values)
        plots.logarithmic(ax)
        ax.set(xlim=(1e-6, 1e2), ylim=(1e-2, 1e4))

    with mpl.rc_context(plots.STYLE):
        figure = plots.panels([([1e-6, 1e2], [1e-2, 1e4])], draw, 1, cell=(3, 2))
        (ax,) = figure.axes
        plots.png(figure)
        labels = {
            text.get_text() for axis in (ax.xaxis, ax.yaxis) for text in axis.get_ticklabels()
        }
    assert labels >= {"10⁻⁶", "0.01", "1", "100", "10⁴"} and not any(
        "$" in label for label in labels
    )
