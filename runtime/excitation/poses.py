"""Search for static poses that determine the gravity parameters best, within the limits of the joints.

W holds the rows of the poses, divided by the standard deviations s_j of the torques; W0 holds the
rows of poses that were recorded already, if there are any. The search finds

    max log det M,  M = W0'W0 + W'W        C = M^-1, the predicted covariance

by exchange: each pose in turn is replaced by that of many random poses (`CANDIDATES`) which
enlarges the determinant most, until no exchange enlarges it. The result is the best of several
random starts.

References: Fedorov (1972), Theory of Optimal Experiments; Atkinson, Donev and Tobias (2007).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from runtime.core.model import GeneratedModel, joint_labels, require_no_axes, require_no_channels
from runtime.core.problem import Problem
from runtime.core.rows.prepared import stacked
from runtime.core.rows.selection import per_joint
from runtime.excitation.criteria import limits_of
from runtime.excitation.settings import ExcitationSettings
from runtime.ground.documents import Result
from runtime.ground.errors import InputError
from runtime.ground.table import Table

Array = np.ndarray
CANDIDATES = 600  # random poses that are looked at
RIDGE = 1e-12  # on M, of columns of length 1 over all candidates: few poses leave it singular
LARGEST_CONDITION = 1e4  # of W; beyond, poses do not determine the parameters


@dataclass(frozen=True, eq=False)
class StaticPoses(Result, keys="poses condition sigma compared s taken_in"):
    """Static poses that the search found, compared with recorded poses or with random poses.

    Attributes
    ----------
    model : GeneratedModel
    poses : ndarray, shape (N, n), rad or m
    condition : pair of float
        Condition number of W, whose columns have length 1 over all candidates: with these poses
        (and the poses of the record), and with the poses of the comparison; inf: not every
        parameter is determined.
    sigma : dict of pairs of float, SI
        Predicted standard deviations of each parameter that acts at rest, in the same two cases.
    compared : str
        Poses of the comparison: the record alone, or as many random poses.
    s : ndarray, shape (n,), N m or N
        Standard deviations of the torques.
    taken_in : tuple of str
        Parameters left out, because their torques at rest are combinations of the torques of
        others.
    """

    model: GeneratedModel
    poses: Array
    condition: tuple[float, float]
    sigma: dict[str, tuple[float, float]]
    compared: str
    s: Array
    taken_in: tuple[str, ...]

    def to_table(self) -> str:
        """Write condition numbers, standard deviations and poses as text.

        The text also says what the search did not check.
        """
        lost = ", ".join(self.taken_in)
        sigma = Table(
            "",
            ("deviation", "with these poses", self.compared),
            [(name, *(f"{x:.3g}" for x in pair)) for name, pair in self.sigma.items()],
        )
        poses = Table(
            "",
            ("pose", *(f"q{joint}" for joint in joint_labels(self.model))),
            [(str(k), *(f"{x:.4f}" for x in q)) for k, q in enumerate(self.poses, start=1)],
        )
        return (
            f"{len(self.poses)} static poses determine {len(self.sigma)} parameters of "
            f"{self.model.NAME}: cond(W) {self.condition[0]:.1f}, by {self.compared} "
            f"{self.condition[1]:.1f}.{f' Not estimated, because at rest they cannot be separated from others: {lost}.' if lost else ''}\n\n{sigma.to_text()}\n\n{poses.to_text()}\n\nSI "
            f"units, for torque deviations of {', '.join(f'{x:.3g}' for x in self.s)}. The poses "
            "are within the ranges of the joints; collisions and limits of torque were not "
            "checked. Approach every pose from both sides and record the mean torque."
        )


def static_poses(problem: Problem) -> StaticPoses:
    """Search for the static poses that determine the gravity parameters best, within the limits of q.

    study.excitation.poses is the number of poses, default 20.

    Parameters
    ----------
    problem : Problem
        Prepared problem. Its records are static poses that were recorded already; they stay, and
        the search adds poses to them. Section `excitation` of the settings: poses, limits, columns,
        torque_sigma (default: 1), starts, seed.

    Raises
    ------
    InputError
        Too few poses, no parameter that acts at rest, no limits of q, or a record of a motion.
    """
    model, settings = problem.model, cast(Any, problem.settings).excitation or ExcitationSettings()
    require_no_channels(model, "the search for poses")
    require_no_axes(model, "the search for poses")
    if problem.records and not problem.reader.at_rest:
        raise InputError(
            "new poses can be added only to a record of poses at rest; set signals: {reader: static}"
        )
    count, n = settings.poses or 20, len(model.JOINTS)
    rng = np.random.default_rng(settings.seed)
    s = per_joint(settings.torque_sigma or 1.0, n, "excitation.torque_sigma")
    limits = limits_of(model, {"qd": np.inf, "qdd": np.inf, **settings.limits})
    q = rng.uniform(limits.lower, limits.upper, (CANDIDATES, n))
    shown = _acting(model, q, settings.columns)
    candidates = _rows_at_rest(model, q, shown)  # (K, n, c)
    W = (
        candidates.transpose(1, 0, 2).reshape(n * CANDIDATES, -1)
        / np.repeat(s, CANDIDATES)[:, None]
    )
    recorded = np.zeros((0, len(shown)))
    if problem.records:
        rows = stacked(model, problem.prepared, shown)
        recorded = rows.W / s[rows.joints][:, None]
    names = np.array(shown)
    size = np.linalg.norm(W, axis=0)
    apart = np.abs(np.diag(np.linalg.qr(W / size, mode="r"))) > RIDGE**0.5
    W, recorded = W[:, apart] / size[apart], recorded[:, apart] / size[apart]
    size = size[apart]
    A = W.reshape(n, CANDIDATES, -1).transpose(1, 0, 2)
    M = RIDGE * np.eye(len(size)) + recorded.T @ recorded
    starts = [rng.integers(CANDIDATES, size=count) for _ in range(settings.starts)]
    best = max(
        (_exchanged(A, M, start) for start in starts),
        key=lambda x: float(np.linalg.slogdet(_sum(A, M, x))[1]),
    )
    others = starts[0][: 0 if problem.records else count]
    condition, sigma = zip(*(_quality(_sum(A, M, x)) for x in (best, others)), strict=True)
    if np.isinf(condition[0]):
        raise InputError(
            f"{count} poses do not determine the {len(size)} parameters that act at rest; "
            "set more poses or wider limits"
        )
    return StaticPoses(
        model,
        q[best],
        condition,
        dict(zip(names[apart].tolist(), (np.array(sigma) / size).T.tolist(), strict=True)),
        "the record alone" if problem.records else "random poses",
        s,
        tuple(names[~apart].tolist()),
    )


def _rows_at_rest(model: GeneratedModel, q: Array, names: Sequence[str]) -> Array:
    """Compute the regressor columns `names` at rest in the poses q, shape (K, n).

    The result has shape (K, n, c).
    """
    rest = np.zeros_like(q)
    numbers = [model.BASE_PARAMETERS.index(name) for name in names]
    return np.asarray(model.regressor(q, rest, rest))[..., numbers]


def _acting(model: GeneratedModel, q: Array, columns: Any) -> tuple[str, ...]:
    """Select, from the base parameters `columns`, those that cause torques at rest in the poses q.

    columns : names of base parameters; essential and all mean all base parameters.
    """
    names = tuple(model.BASE_PARAMETERS)
    size = np.abs(_rows_at_rest(model, q, names)).max(axis=(0, 1))
    acting = {name for name, x in zip(names, size, strict=True) if x > 1e-9 * size.max()}
    asked = names if columns in ("essential", "all") else columns
    shown = tuple(name for name in asked if name in acting)
    if not shown:
        raise InputError(
            f"poses at rest show no parameter of {model.NAME}: gravity acts along no joint, and no joint has an offset or spring; record a motion, or correct gravity in the robot file"
        )
    return shown


def _sum(A: Array, M: Array, chosen: Array) -> Array:
    """Add W'W of the chosen poses to the information matrix M.

    A, shape (K, n, c), holds the rows of all candidate poses; `chosen` holds indices of poses.
    """
    return np.asarray(M + np.einsum("kni,knj->ij", A[chosen], A[chosen]))


def _exchanged(A: Array, M: Array, chosen: Array) -> Array:
    """Exchange poses as long as an exchange raises det M of the information matrix M; return pose
    numbers.
    """
    chosen, before = chosen.copy(), np.empty(0)
    while not np.array_equal(chosen, before):
        before = chosen.copy()
        for i, k in enumerate(before):
            C = np.linalg.inv(_sum(A, M, np.delete(chosen, i)))
            gain = np.linalg.slogdet(np.eye(A.shape[1]) + A @ C @ A.transpose(0, 2, 1))[1]
            chosen[i] = gain.argmax() if gain.max() > gain[k] + 1e-6 else k
    return chosen


def _quality(M: Array) -> tuple[float, Array]:
    """Compute the condition number of W and the standard deviations of the parameters from M = W'W.

    The standard deviations have shape (c,). All results are infinite if the condition number is 1e4
    or more (`LARGEST_CONDITION`): then W does not determine the parameters.
    """
    condition, sigma = float(np.sqrt(np.linalg.cond(M))), np.sqrt(np.diag(np.linalg.inv(M)))
    return (condition, sigma) if condition < LARGEST_CONDITION else (np.inf, np.inf * sigma)
