"""The `excitation` section of a study: settings of the search for an exciting motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal

from pydantic import Field

from runtime.ground.settings import Many, Positive, Real, Seed, Settings, Text, Whole, require
from runtime.loop.trajectories import AnyFamily, Fourier, PointToPoint

MOST_INSTANTS = {"grid": 2e4, "rate": 2e7}
"""Largest number of instants of a motion, on the grid of the optimiser and at the controller's rate."""


class Sphere(Settings):
    """A sphere fixed to a frame of the robot, used to keep links apart.

    Attributes
    ----------
    frame : int
        Number of the frame.
    radius : float, m
        Radius.
    centre : tuple of 3 float, m
        Centre, in that frame.
    """

    frame: Whole
    radius: Positive
    centre: tuple[Real, Real, Real] = (0.0, 0.0, 0.0)


class ExcitationSettings(Settings):
    """Settings of the search for an exciting motion.

    Attributes
    ----------
    parts : tuple of Family
        Families in the order of the motion (`runtime.loop.trajectories`).
    poses : int or None
        Number of static poses to search instead of a motion, for `signals.reader: static`
        (`runtime.excitation.poses`); null: search for a motion.
    criterion : str
        record, cond, logdet or sigma; auto: record if there is a record, else cond. record is the
        largest ratio of the predicted %sigma of a parameter to its %sigma with the motion of the
        record: if it is below 1, the new motion determines every parameter better.
    columns : str or tuple of str
        Parameters that the motion must determine: essential (of an estimate), all, or names.
    limits : mapping
        q, qd, qdd, tau that replace the limits of the robot file: one value per joint, or
        [lower, upper] for q.
    torque_rms : tuple of float or None, N m or N
        Largest root mean square of each torque; null: unlimited.
    torque_rate : tuple of float or None, N m/s or N/s
        Largest rate of change of each torque; null: unlimited.
    margin : float
        Share of every limit that the optimiser leaves free, since it checks the limits at its grid
        points only.
    grid : float, Hz
        Sampling rate of the motion inside the optimiser.
    rate : float, Hz
        Rate of the controller.
    begin : tuple of float or None, rad or m
        Positions at the start; null: free.
    spheres : tuple of Sphere
        Spheres fixed to the links.
    apart : tuple of pairs of int or None
        Pairs of spheres, numbered from 1, that must keep a distance; null: every pair whose frame
        numbers differ by more than 1.
    gap : float, m
        Smallest distance between the surfaces of such a pair.
    smooth : float, rad/s or m/s
        v0 of tanh(qd/v0), which replaces sign(qd) inside the optimiser only.
    torque_sigma : tuple of float or None, N m or N
        Standard deviation s_j of each torque; null: from an estimate, else 1 for every joint.
    starts : int
        Number of random starts.
    iterations : int
        Largest number of iterations of the optimiser in each of its two stages.
    seed : int
        Seed of the random starts.
    """

    parts: Annotated[Many[AnyFamily], Field(min_length=1)] = field(
        default_factory=lambda: (Fourier(), PointToPoint(points=7, travel=1.0, blend=0.25))
    )
    poses: Annotated[Whole, Field(ge=1, le=10_000)] | None = None
    criterion: Literal["auto", "record", "cond", "logdet", "sigma"] = "auto"
    columns: Literal["essential", "all"] | Many[Text] = "essential"
    limits: Mapping[str, Any] = field(default_factory=dict)
    torque_rms: Many[Real] | None = None
    torque_rate: Many[Real] | None = None
    margin: Annotated[Real, Field(ge=0, lt=1)] = 0.02
    grid: Annotated[Real, Field(ge=0.01, le=10_000)] = 20.0
    rate: Annotated[Real, Field(ge=0.01, le=1e6)] = 1000.0
    begin: Many[Real] | None = None
    spheres: Many[Sphere] = ()
    apart: tuple[tuple[Whole, Whole], ...] | None = None
    gap: Real = 0.0
    smooth: Positive = 0.05
    torque_sigma: Many[Real] | None = None
    starts: Annotated[Whole, Field(ge=1, le=10_000)] = 10
    iterations: Annotated[Whole, Field(ge=1, le=100_000)] = 200
    seed: Seed = 1

    def __post_init__(self) -> None:
        length = sum(part.duration for part in self.parts)
        for key in ("grid", "rate"):
            instants = length * getattr(self, key)
            require(
                instants <= MOST_INSTANTS[key],
                f"{getattr(self, key):g} Hz over {length:g} s are {instants:.3g} instants; expected "
                f"at most {MOST_INSTANTS[key]:g}",
                key,
            )
        for pair in self.apart or ():
            require(
                all(1 <= k <= len(self.spheres) for k in pair),
                f"{list(pair)}; expected two numbers of spheres, from 1 to {len(self.spheres)}",
                "apart",
            )

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of spheres that must keep a distance, as indices from 0."""
        if self.apart is not None:
            return tuple((a - 1, b - 1) for a, b in self.apart)
        count = range(len(self.spheres))
        return tuple(
            (a, b)
            for a in count
            for b in count
            if a < b and abs(self.spheres[a].frame - self.spheres[b].frame) > 1
        )
