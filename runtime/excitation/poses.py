"""Poses at rest that let the parameters of gravity be identified as well as the range of the joints
allows.

Of c parameters, W the rows of the poses over the deviations s_j of the torques, W0 those of the
poses of a record, if there is one:

    max log det M,  M = W0'W0 + W'W        C = M^-1, the predicted covariance

by exchange: each pose in turn gives way to the one of CANDIDATES random ones that enlarges the
determinant most, until none does; the best of several random starts.

References: Fedorov (1972), Theory of Optimal Experiments; Atkinson, Donev and Tobias (2007).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.excitation.criteria import limits_of
from runtime.json_documents import Result
from runtime.model.generated import GeneratedModel, joint_labels
from runtime.records.record import Record
from runtime.rows.observe import at_rest, observe
from runtime.rows.selection import per_joint
from runtime.settings.excitation import ExcitationSettings
from runtime.settings.study import EstimateSettings, Signals, Study
from runtime.table import Table

Array = np.ndarray
CANDIDATES = 600  # random poses that are looked at
RIDGE = 1e-12  # on M, of columns of length 1 over all candidates: few poses leave it singular
LARGEST_CONDITION = 1e4  # of W; beyond, poses do not determine the parameters


@dataclass(frozen=True, eq=False)
class StaticPoses(Result, keys="poses condition sigma compared s taken_in"):
    """Poses at rest, compared with those of the record alone, or with as many random ones.

    Attributes
    ----------
    model : GeneratedModel
    poses : ndarray, shape (N, n), rad or m
    condition : pair of float
        Of W, columns of length 1 over all candidates: with these poses (and those of the record),
        and by what they are compared with; inf: not every parameter is determined.
    sigma : dict of pairs of float, SI
        Predicted deviations of each parameter that rest shows, alike.
    compared : str
        What they are compared with.
    s : ndarray, shape (n,), N m or N
        Deviations of the torques.
    taken_in : tuple of str
        Parameters left out, whose torques at rest are those of others, which take them in.
    """

    model: GeneratedModel
    poses: Array
    condition: tuple[float, float]
    sigma: dict[str, tuple[float, float]]
    compared: str
    s: Array
    taken_in: tuple[str, ...]

    def to_table(self) -> str:
        """Condition, deviations and poses, and what was not looked at."""
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
            f"{len(self.poses)} poses at rest tell {len(self.sigma)} parameters of "
            f"{self.model.NAME}: cond(W) {self.condition[0]:.1f}, by {self.compared} "
            f"{self.condition[1]:.1f}."
            f"{f' Left out, since others take them in at rest: {lost}.' if lost else ''}\n\n"
            f"{sigma.to_text()}\n\n{poses.to_text()}\n\n"
            f"SI units, for torque deviations of {', '.join(f'{x:.3g}' for x in self.s)}. "
            "Ranges of the joints are kept; collisions and limits of torque were not looked at. "
            "Approach every pose from both sides and record the mean torque."
        )


def static_poses(
    model: GeneratedModel, records: Sequence[Record] = (), study: Study | None = None
) -> StaticPoses:
    """study.excitation.poses poses, default 20, within the limits of q that tell the parameters of
    gravity best.

    Parameters
    ----------
    model : GeneratedModel
    records : sequence of Record
        Poses at rest that were recorded already, which stay: the next ones are sought.
    study : Study, optional
        Section `excitation`: poses, limits, columns, torque_sigma (default: 1), starts, seed.

    Raises
    ------
    InputError
        Too few poses, no parameter that acts at rest, no limits of q, a record of a motion.
    """
    study = study or Study()
    if records and study.signals.reader != "static":
        raise InputError("poses are sought beside recorded poses: signals: {reader: static}")
    settings, n = study.excitation or ExcitationSettings(), len(model.JOINTS)
    count, rng = settings.poses or 20, np.random.default_rng(settings.seed)
    s = per_joint(settings.torque_sigma or 1.0, n, "excitation.torque_sigma")
    limits = limits_of(model, {"qd": np.inf, "qdd": np.inf, **settings.limits})
    q = rng.uniform(limits.lower, limits.upper, (CANDIDATES, n))
    drawn = Record(np.arange(float(CANDIDATES)), q, np.zeros_like(q), rate=1.0, name="poses")
    columns: Any = "all" if settings.columns == "essential" else settings.columns
    study = Study(signals=Signals(reader="static"), estimate=EstimateSettings(columns=columns))
    shown: Any = at_rest(model, [drawn], study)[0].estimate.columns
    rows = observe(model, [drawn, *records], study, columns=shown)
    W, candidates, names = rows.W / s[rows.joints][:, None], rows.record == 0, np.array(shown)
    size = np.linalg.norm(W[candidates], axis=0)
    apart = np.abs(np.diag(np.linalg.qr(W[candidates] / size, mode="r"))) > RIDGE**0.5
    W, size = W[:, apart] / size[apart], size[apart]
    A = W[candidates].reshape(n, CANDIDATES, -1).transpose(1, 0, 2)
    M = RIDGE * np.eye(len(size)) + W[~candidates].T @ W[~candidates]
    starts = [rng.integers(CANDIDATES, size=count) for _ in range(settings.starts)]
    best = max(
        (_exchanged(A, M, start) for start in starts),
        key=lambda x: float(np.linalg.slogdet(_sum(A, M, x))[1]),
    )
    others = starts[0][: 0 if records else count]
    condition, sigma = zip(*(_quality(_sum(A, M, x)) for x in (best, others)), strict=True)
    if np.isinf(condition[0]):
        raise InputError(
            f"{count} poses do not determine the {len(size)} parameters that rest shows; ask for "
            "more poses or wider limits"
        )
    return StaticPoses(
        model,
        q[best],
        condition,
        dict(zip(names[apart].tolist(), (np.array(sigma) / size).T.tolist(), strict=True)),
        "the record alone" if records else "random poses",
        s,
        tuple(names[~apart].tolist()),
    )


def _sum(A: Array, M: Array, chosen: Array) -> Array:
    """M with the rows of these poses; A, shape (K, n, c), of all candidates."""
    return np.asarray(M + np.einsum("kni,knj->ij", A[chosen], A[chosen]))


def _exchanged(A: Array, M: Array, chosen: Array) -> Array:
    """Numbers of the poses after exchange."""
    chosen, before = chosen.copy(), np.empty(0)
    while not np.array_equal(chosen, before):
        before = chosen.copy()
        for i, k in enumerate(before):
            C = np.linalg.inv(_sum(A, M, np.delete(chosen, i)))
            gain = np.linalg.slogdet(np.eye(A.shape[1]) + A @ C @ A.transpose(0, 2, 1))[1]
            chosen[i] = gain.argmax() if gain.max() > gain[k] + 1e-6 else k
    return chosen


def _quality(M: Array) -> tuple[float, Array]:
    """Condition of W, and deviations, shape (c,); infinite where it does not determine them."""
    condition, sigma = float(np.sqrt(np.linalg.cond(M))), np.sqrt(np.diag(np.linalg.inv(M)))
    return (condition, sigma) if condition < LARGEST_CONDITION else (np.inf, np.inf * sigma)
