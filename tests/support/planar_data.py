"""Motions, observations and records of the planar arm, for tests of what stands on Y = W X + rho."""

import numpy as np
import planar_2r_model as planar

from runtime.core.record import Origin, Record
from runtime.core.rows.observation import Observation
from runtime.core.study import EstimateSettings

OLS = EstimateSettings()
WLS = EstimateSettings(method="wls")

TRUE = np.array([1.8, 2.4, 0.15, 6.0, 4.0, 0.35, 0.9, -0.08, 2.0, 1.5])
"""Parameters in the order of planar.BASE_PARAMETERS, SI."""


def motion(t):
    """q, qd, qdd of shape (N, 2) of a smooth exciting motion; t, shape (N,), s."""
    amplitude = np.array([[0.9, 0.4, 0.2], [1.1, 0.5, 0.15]])
    pulsation = np.array([[1.3, 3.1, 7.3], [1.7, 4.3, 8.9]])
    phase = pulsation * np.asarray(t)[:, None, None] + np.array([[0.3, 1.0, 2.0], [0.7, 0.1, 1.3]])
    q = (amplitude * np.sin(phase)).sum(-1)
    qd = (amplitude * pulsation * np.cos(phase)).sum(-1)
    qdd = -(amplitude * pulsation**2 * np.sin(phase)).sum(-1)
    return q, qd, qdd


def one_joint_at_rest(t):
    """The same motion with joint 2 at rest at q2 = 0."""
    q, qd, qdd = motion(t)
    for x in (q, qd, qdd):
        x[:, 1] = 0
    return q, qd, qdd


def observation(N=300, rate=30.0, noise=(0.0, 0.0), seed=0, X=TRUE, motion=motion, colour=None):
    """Observation of N instants with noise of deviation noise[j] (N m) on joint j; `colour` filters
    a (2, N) white array.
    """
    t = np.arange(N) / rate
    W = planar.observation_matrix(*motion(t))
    white = np.random.default_rng(seed).standard_normal((2, N))
    error = white if colour is None else colour(white)
    Y = W @ X + (np.array(noise)[:, None] * error).reshape(-1)
    return Observation(
        W=W,
        Y=Y,
        rows=(N, N),
        names=planar.BASE_PARAMETERS,
        t=np.tile(t, 2),
        record=np.zeros(2 * N, dtype=int),
        rate=rate,
        settings={"signals": {"median": 1}},
        files={"q.csv": "ab" * 32},
    )


def record(N=6000, rate=1000.0, noise=0.05, seed=0, X=TRUE):
    """Record of the motion with exact positions and white torque noise of deviation `noise` N m."""
    t = np.arange(N) / rate
    q, qd, qdd = motion(t)
    tau = planar.inverse_dynamics(q, qd, qdd, X) + noise * np.random.default_rng(
        seed
    ).standard_normal((N, 2))
    return Record(t, q, tau, rate=rate, name="planar", origin=Origin({"planar.csv": "cd" * 32}))
