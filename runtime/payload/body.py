"""Mass, centre of mass and inertia of a load at a place that the user's file names.

The parameters chi_m of the load are about the origin and along the axes of the frame m at which
they were estimated. With P the pseudo-inertia (`runtime.physical.inertia`) and pTm the pose of m in
the place p,

    P_p = pTm P_m pTm',    M,    c = MS / M,    I = J - M (c'c 1 - c c')

c is the centre of mass in the frame of the place, and I the tensor about c along its axes, as
pendants and data sheets have them. Deviations follow from the covariance C of chi_m, to first
order: C_p = G C G' with G = d(M, c, I) / d chi_m.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.ground.errors import SettingsError
from runtime.ground.table import Table, number
from runtime.physical.inertia import INERTIAL, pseudo_inertia

Array = np.ndarray

PREFERRED = ("tool0", "flange")  # names at which pendants state a load
NUMBERS = (  # name and unit of each number, in the order of `body_of`
    ("mass", "kg"),
    *((f"centre {axis}", "m") for axis in "xyz"),
    *((f"inertia {axes}", "kg*m**2") for axes in ("xx", "xy", "xz", "yy", "yz", "zz")),
)
SMALL = 1e-9  # of the largest derivative: no effect
STEP = 1e-30  # of complex derivatives


@dataclass(frozen=True, eq=False)
class Place:
    """A place on the link of a load, with its pose T, shape (4, 4), in the frame of the link.

    `name` is the name in the robot file, and `words` says in words which place it is.
    """

    name: str
    words: str
    T: Array


@dataclass(frozen=True, eq=False)
class Body:
    """Mass, centre of mass and inertia tensor of a load at a place.

    Attributes
    ----------
    place : Place
        The place whose frame is used.
    value, sigma : ndarray, shape (10,)
        Mass, centre of mass (x, y, z) and inertia tensor (xx, yy, zz, xy, xz, yz), and their
        standard deviations; nan for a number that no torque determines.
    """

    place: Place
    value: Array
    sigma: Array

    @property
    def rows(self) -> list[tuple[str, float, float, str]]:
        """Name, value, standard deviation and unit of each number that is determined."""
        return [
            (name, float(x), float(s), unit)
            for (name, unit), x, s in zip(NUMBERS, self.value, self.sigma, strict=True)
            if np.isfinite(x)
        ]

    @property
    def missing(self) -> str:
        """Sentence on the numbers that no torque of the robot determines; "" if there are none."""
        names = [name for (name, _), x in zip(NUMBERS, self.value, strict=True) if np.isnan(x)]
        return f"No torque of this robot depends on {', '.join(names)}." if names else ""

    def table(self) -> Table:
        """Return a table with one line per number."""
        return Table(
            f"Load at {self.place.words}: centre of mass, and inertia about it, in the frame of "
            f"{self.place.name}",
            (f"load at {self.place.name}", "value", "sigma", "unit"),
            [(name, number(x, ".6g"), number(s, ".2g"), unit) for name, x, s, unit in self.rows],
        )

    def summary(self) -> dict[str, Any]:
        """Return the numbers as a mapping for JSON."""
        return {
            "at": self.place.name,
            "values": {name: {"value": x, "sigma": s, "unit": u} for name, x, s, u in self.rows},
        }


def place_on(
    mounts: Mapping[str, tuple[int, Any]], link: int, frame: int, at: str | None, T: Array
) -> Place:
    """Choose the place for a load on `link`: `at` or, without `at`, tool0, flange or the last named
    place on the link.

    Parameters
    ----------
    mounts : mapping
        Link and pose of each named place of the robot.
    frame : int
        Number of the frame of the estimated parameters, which is the place if it is not the frame
        of the link, or if the link has no named place.
    at : str or None
        Name that the user gave.
    T : ndarray, shape (4, 4)
        Pose of that frame in the frame of the link.

    Raises
    ------
    SettingsError
        There is no place of the name `at` on the link.
    """
    names = [name for name, (j, _) in mounts.items() if j == link]
    if at is not None and at not in names:
        listed = ", ".join(names[:20]) or "none"
        raise SettingsError(
            f"{at!r} is no named place on link {link}; the robot file has the places {listed}",
            path=("payload", "at"),
        )
    if at is None and (frame != link or not names):
        return Place(f"frame {frame}", f"frame {frame}, Khalil's", T)
    usual = next((name for name in PREFERRED if name in names), None)
    name = at or usual or names[-1]
    shown = f"{name!a}"[1:-1][:60]  # as in messages: whatever the file calls it, on one line
    last = "" if at or usual else f" (the last of the file on link {link})"
    return Place(shown, f"{shown}{last}", np.array(mounts[name][1]))


def body_at(
    place: Place, T: Array, chi: Array, covariance: Array, unknown: Sequence[bool]
) -> Body | None:
    """Compute mass, centre and inertia of a load at a place; None if the mass is not positive.

    Parameters
    ----------
    place : Place
        The place.
    T : ndarray, shape (4, 4)
        Pose, in the frame of the link, of the frame of chi.
    chi : ndarray, shape (10,)
        Parameters of the load, in the order XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M.
    covariance : ndarray, shape (10, 10)
        Covariance of chi; zero for given parameters.
    unknown : sequence of bool, shape (10,)
        Whether no torque depends on the parameter, so that its value is not known.
    """
    if unknown[-1] or not chi[-1] > 0:
        return None
    pose = np.linalg.solve(place.T, T)

    def derivatives(at: Array) -> Array:
        steps = at + 1j * STEP * np.eye(10)
        return np.column_stack([_body(pose, step).imag for step in steps]) / STEP

    G = derivatives(chi)
    generic = np.where(unknown, np.random.default_rng(1).uniform(0.5, 1.0, 10), chi)
    sizes = np.abs(derivatives(generic))
    lost = (sizes[:, unknown] > SMALL * sizes.max(axis=1, keepdims=True)).any(axis=1)
    sigma = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", G, covariance, G), 0.0))
    value = np.where(lost, np.nan, _body(pose, chi))
    return Body(place, value, np.where(lost, np.nan, sigma))


def _body(pose: Array, chi: Array) -> Array:
    """Compute mass, centre and the inertia tensor about the centre, shape (10,), in the frame in
    which `pose` is given.

    chi may be complex.
    """
    P = pose @ np.tensordot(chi, UNITS, axes=1) @ pose.T
    S, c, M = P[:3, :3], P[:3, 3] / P[3, 3], P[3, 3]
    about = S - M * np.outer(c, c)
    I = np.trace(about) * np.eye(3) - about
    return np.array([M, *c, *I[np.triu_indices(3)]])


UNITS = np.array([pseudo_inertia(unit) for unit in np.eye(len(INERTIAL))])
"""Pseudo-inertias of the ten unit vectors, shape (10, 4, 4)."""
