"""The simulated record of the haptic interface: the motion of the chapter, section 4.2.1, through
the exact inverse model.

    0 .. 80 s     triangles at constant low speed, corners rounded over 0.5 s
    80 .. 214 s   sums of three sinusoids per joint

Nothing here was measured: no record of the interface is public. What the chapter gives is used as
given (4000 counts per motor revolution, both filters at 10 Hz, the two kinds of motion, 16000 rows,
cond(W) near 150). What it does not give: sampling at 1 kHz, the usual rate of haptic control, and
the transmission ratio of the robot file, both fixed before any figure of Table 7 was computed and
left alone since; the sinusoids, of the smallest cond(W) among 700 random draws within +-55 degrees,
60 rad/s^2 and 0.3 rad from the singular configurations of the parallelogram; torque noise, of an
order at which the parameters that Table 6 leaves out are not seen.
"""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

import runtime
from runtime.loop.reference import Reference
from symgen.demo import Prepared, simulated_record

Array = np.ndarray
Jet = Array  # shape (3, N): a function of time, its first and its second derivative

RATE = 1000.0  # Hz
DURATION = 214.0  # s: 5344 decimated samples of three joints, 16032 rows
LOW = 80.0  # s of triangles
CHANGE = 2.0  # s from triangles to sinusoids
CORNER = 0.5  # s over which a triangle turns round
ENCODER = 2 * pi / 4000  # rad on the motor
# deviation of the white torque noise before the filters, of the largest torque of each motor
NOISE = 0.1
CUTOFF = 10.0  # Hz
SEED = 1
NOTE = "No record of this interface is public: this one is SIMULATED, nothing below was measured."
DELTA = (2 * pi / 4000, 2 * pi / 100, 2 * pi / 80)  # rad on the motor: the columns of Table 7
CENTRE = (0.0, -0.8, -0.8 - pi / 2)  # rad: arm and forearm at right angles
TRIANGLES = (
    (1.0, 5, 0.1),
    (0.55, 6, 0.3),
    (0.55, 8, 0.7),
)  # amplitude rad, periods in LOW, phase in periods
SINUSOIDS = (  # amplitude rad, frequency Hz, phase rad
    ((0.61, 0.40, 2.0), (0.25, 0.96, 0.4), (0.13, 1.25, 1.3)),
    ((0.54, 0.26, 4.2), (0.13, 1.00, 2.9), (0.14, 1.70, 4.5)),
    ((0.38, 0.25, 6.1), (0.24, 0.97, 0.8), (0.06, 1.41, 5.6)),
)


def prepare(model: Any, duration: float = DURATION, runs: int = 5) -> Prepared:
    """Study and record. Settings of the chapter: Butterworth and decimation at 10 Hz, CESTAC on the
    motor side. No median filter: there are no outliers.
    """
    study = runtime.Study(
        signals={"median": 1, "lowpass": {"cutoff": CUTOFF}, "decimate": {}},
        cestac={"side": "motor", "delta": list(DELTA), "runs": runs, "seed": SEED},
    )
    path = motion(duration)
    return simulated_record(model, study, path, NOTE, seed=SEED, encoder=ENCODER, noise=NOISE)


def motion(duration: float = DURATION) -> Reference:
    """Joints 1, 2, 5; the first LOW/DURATION of the duration is slow."""
    t = np.arange(round(duration * RATE)) / RATE
    low = duration * LOW / DURATION
    change = smooth_step(t, low - CHANGE / 2, CHANGE)
    joints = []
    for centre, (amplitude, periods, phase), terms in zip(
        CENTRE, TRIANGLES, SINUSOIDS, strict=True
    ):
        slow = triangle(t, LOW / periods, amplitude, phase)
        joint = slow + product(change, sinusoids(t, terms) - slow)
        joint[0] += centre
        joints.append(joint)
    q, qd, qdd = np.moveaxis(np.array(joints), 0, -1)
    return Reference(RATE, q, qd, qdd)


def triangle(t: Array, period: float, amplitude: float, phase: float) -> Jet:
    """Constant speed 4 amplitude/period; within CORNER the speed turns round as x - sin(2 pi x)/(2
    pi), so that the acceleration is continuous.
    """
    speed = 4 * amplitude / period
    s = np.mod(t + phase * period, period)
    side = np.where(s < period / 2, 1.0, -1.0)
    u = np.mod(s, period / 2) - period / 4  # s from the middle of the corner
    x = np.clip(u / CORNER + 0.5, 0, 1)
    inside = np.abs(u) < CORNER / 2
    round_ = x - x**2 - (np.cos(2 * pi * x) - 1) / (2 * pi**2)
    q = np.where(inside, amplitude + speed * CORNER * (round_ - 0.5), amplitude - speed * np.abs(u))
    qd = np.where(
        inside, speed * (1 - 2 * (x - np.sin(2 * pi * x) / (2 * pi))), -speed * np.sign(u)
    )
    qdd = np.where(inside, -2 * speed / CORNER * (1 - np.cos(2 * pi * x)), 0.0)
    return np.asarray(side * np.array([q, qd, qdd]))


def sinusoids(t: Array, terms: tuple[tuple[float, float, float], ...]) -> Jet:
    """sum_k a sin(2 pi f t + phase)."""
    total = np.zeros((3, len(t)))
    for a, f, phase in terms:
        w = 2 * pi * f
        total += a * np.array(
            [np.sin(w * t + phase), w * np.cos(w * t + phase), -(w**2) * np.sin(w * t + phase)]
        )
    return total


def smooth_step(t: Array, start: float, length: float) -> Jet:
    """From 0 to 1 by the polynomial of degree 7 whose first three derivatives are zero at both
    ends.
    """
    x = np.clip((t - start) / length, 0, 1)
    return np.array(
        [
            x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3),
            140 * x**3 * (1 - x) ** 3 / length,
            420 * x**2 * (1 - x) ** 2 * (1 - 2 * x) / length**2,
        ]
    )


def product(a: Jet, b: Jet) -> Jet:
    """The product of two functions with its derivatives."""
    return np.array(
        [a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2 * a[1] * b[1] + a[0] * b[2]]
    )
