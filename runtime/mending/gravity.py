"""The direction of gravity in frame 0, by two angles.

    g(a, b) = |g| (e + a u + b v)/||e + a u + b v||,    e = g/|g|; u, v, e orthonormal

Gauss-Newton steps fit (a, b) together with the parameters of the robot (`Baseline.first_step`).
They start at the direction of the reading, and the rows of the search are fitted again after each
step. A direction along another axis is not found in this way: it is a cause of its own.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from runtime.ground.limits import limits
from runtime.mending.reading import Reading
from runtime.plausible.causes import GRAVITY, Cause, unchanged_study

LIMIT = limits(__package__)

Array = np.ndarray


def turned_gravity(g: Array, a: float, b: float) -> Array:
    """Turn gravity g, shape (3,), by two small angles; its magnitude stays."""
    size = float(np.linalg.norm(g))
    e = g / size
    u = np.cross(e, np.eye(3)[int(np.argmin(np.abs(e)))])
    u /= np.linalg.norm(u)
    turned = e + a * u + b * np.cross(e, u)
    return np.asarray(size * turned / np.linalg.norm(turned))


def gravity_of(reading: Reading) -> Array:
    """Return the gravity of a reading in frame 0, shape (3,), m/s^2; zero if it is not known."""
    known = getattr(reading.model, "CONSTANTS", {})
    return np.array([float(known.get(key, 0.0)) for key in GRAVITY])


def along(g: Array, n: int, before: Array) -> Cause:
    """Make the cause that gravity is g, shape (3,), m/s^2, and not `before`."""
    cos = float(g @ before / np.linalg.norm(g) / np.linalg.norm(before))
    angle = np.degrees(np.arccos(np.clip(cos, -1.0, 1.0)))
    entry = ", ".join(f"{x:.3g}" for x in g)
    return unchanged_study(
        n,
        kind="gravity",
        says=f"gravity is turned by {angle:.1f} degrees: [{entry}] m/s^2 in frame 0",
        remedy=f"set gravity: [{entry}], or turn frame 0",
        subject="the direction of gravity",
        constants=dict(zip(GRAVITY, map(float, g), strict=True)),
    )


def tilted(reading: Reading) -> Cause | None:
    """Search for the direction of gravity that explains the rows of the search best.

    Return None if the best direction is that of the reading, or if the rows do not determine it.
    """
    first, n = gravity_of(reading), len(reading.p)
    if reading.baseline is None or not first.any() or reading.data.case.variants is None:
        return None
    g, present = _start(reading, first)
    for _ in range(LIMIT.GRAVITY_PASSES):
        baseline = present.baseline
        assert baseline is not None
        change = partial(_turned, g, n)
        J = np.array([baseline.effect(partial(change, k)) for k in (0, 1)])
        step = baseline.first_step(J)
        if step is None:
            break
        a, b = np.clip(step[0], -0.5, 0.5)
        better = None
        for share in (1.0, 0.3):
            new = turned_gravity(g, share * a, share * b)
            other = reading.changed(along(new, n, first))
            if (
                other is not None
                and other.baseline is not None
                and other.baseline.given.score < baseline.given.score
            ):
                better = other, new
                break
        if better is None:
            break
        moved = float(np.hypot(a, b))
        present, g = better
        if moved < 1e-3:
            break
    cos = float(g @ first) / float(first @ first)
    if np.degrees(np.arccos(np.clip(cos, -1.0, 1.0))) < LIMIT.LEAST_TILT:
        return None
    return along(g, n, first)


def _start(reading: Reading, first: Array) -> tuple[Array, Reading]:
    """Return the best of five directions: the direction of the reading, and four directions turned
    from it.

    A turn about an axis in the plane of all motion has no effect of first order.
    """
    best = first, reading
    for a, b in ((0.4, 0.0), (-0.4, 0.0), (0.0, 0.4), (0.0, -0.4)):
        g = turned_gravity(first, a, b)
        other = reading.changed(along(g, len(reading.p), first))
        if other is None or other.baseline is None or best[1].baseline is None:
            continue
        if other.baseline.given.score < best[1].baseline.given.score:
            best = g, other
    return best


def _turned(g: Array, n: int, k: int, xi: float) -> Cause:
    """Make the cause (possible error) that gravity is turned by the angle xi about one of two axes."""
    g = turned_gravity(g, *(xi, 0.0) if k == 0 else (0.0, xi))
    return unchanged_study(n, constants=dict(zip(GRAVITY, map(float, g), strict=True)))
