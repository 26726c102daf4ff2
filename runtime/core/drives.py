"""Motor side and joint side, by one matrix for both directions (chapter 4.2.1: Gamma_a = N K_T I):

    qm  = R (q - offset)                    tau = R' (torque_constant * u)

so that the power tau' qd is that of the motors. Off-diagonal elements of R are couplings: motor 6
of a wrist also turns with joint 5. Leaving them out of the position, the torque or both changes the
total error of a fit little and ruins the joints concerned, hence `decoupled`, for reports that
compare.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from runtime.core.errors import InputError, SettingsError

Array = np.ndarray
Coupling = Literal["both", "position", "torque", "none"]


@dataclass(frozen=True, eq=False)
class Drives:
    """Drives of n joints: gear ratios with couplings, offsets and torque constants.

    Parameters
    ----------
    ratio : ndarray, shape (n, n), rad/rad, or rad/m for a prismatic joint
        R, motor turns per joint turn, signs included.
    offset : ndarray, shape (n,), rad or m
        Joint position where the motor reads zero.
    torque_constant : ndarray, shape (n,), N m/A or N m/V
        Motor torque per unit of u; 1 if u is a torque.
    coupling : "both", "position", "torque" or "none"
        Where the off-diagonal elements of R count.
    declared : bool
        Whether the robot file states torque constants; currents need them.
    """

    ratio: Array
    offset: Array
    torque_constant: Array
    coupling: Coupling = "both"
    declared: bool = True

    def __post_init__(self) -> None:
        ratio = np.array(self.ratio, dtype=float)
        n = len(ratio) if ratio.ndim else 0
        if ratio.shape != (n, n) or n == 0:
            raise InputError(f"drives: ratio has shape {ratio.shape}; expected (n, n)")
        offset, constant = (
            np.broadcast_to(np.asarray(x, dtype=float), (n,))
            if np.ndim(x) == 0
            else np.array(x, dtype=float)
            for x in (self.offset, self.torque_constant)
        )
        for name, x in (("offset", offset), ("torque_constant", constant)):
            if x.shape != (n,):
                raise InputError(
                    f"drives: {name} has shape {x.shape}; expected ({n},), one per joint"
                )
        if not all(np.isfinite(x).all() for x in (ratio, offset, constant)) or not constant.all():
            raise InputError(
                "drives: ratio, offset and torque_constant must be finite, and no torque constant "
                "zero"
            )
        if not (np.diag(ratio).all() and np.linalg.matrix_rank(ratio) == n):
            raise InputError(
                f"drives: ratio is singular or has a zero on its diagonal {np.diag(ratio)}; motor "
                "positions must determine joint positions"
            )
        for name, x in (("ratio", ratio), ("offset", offset), ("torque_constant", constant)):
            object.__setattr__(self, name, x)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Drives:
        """Read drives from the DRIVES constant of an emitted module."""
        constant = mapping.get("torque_constant")
        return cls(
            mapping["ratio"],
            mapping.get("offset", 0.0),
            np.asarray(1.0 if constant is None else constant),
            declared=constant is not None,
        )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.ratio)

    def decoupled(self, coupling: Coupling) -> Drives:
        """The same drives with the coupling applied in `both` directions, in `position` or `torque` only, or in `none`."""
        return replace(self, coupling=coupling)

    def joint_position(self, qm: Array) -> Array:
        """q = R^-1 qm + offset; qm, shape (N, n), rad."""
        return np.asarray(
            np.linalg.solve(self._matrix("position"), self._checked(qm).T).T + self.offset
        )

    def motor_position(self, q: Array) -> Array:
        """qm = R (q - offset), rad; q, shape (N, n)."""
        return np.asarray((self._checked(q) - self.offset) @ self._matrix("position").T)

    def joint_torque(self, u: Array) -> Array:
        """tau = R' (torque_constant u), N m or N; u, shape (N, n), A, V or N m."""
        return np.asarray((self._checked(u) * self.torque_constant) @ self._matrix("torque"))

    def motor_command(self, tau: Array) -> Array:
        """u = R'^-1 tau / torque_constant, A, V or N m; tau, shape (N, n), N m or N."""
        return np.asarray(
            np.linalg.solve(self._matrix("torque").T, self._checked(tau).T).T / self.torque_constant
        )

    @property
    def motion(self) -> Array:
        """Motor turns per joint turn, shape (n, n): R, or its diagonal if positions are decoupled."""
        return self._matrix("position")

    def _matrix(self, quantity: str) -> Array:
        return self.ratio if self.coupling in ("both", quantity) else np.diag(np.diag(self.ratio))

    def _checked(self, x: Array) -> Array:
        x = np.asarray(x, dtype=float)
        if x.ndim != 2 or x.shape[1] != self.n:
            raise InputError(
                f"drives of {self.n} joints given an array of shape {x.shape}; expected (N, "
                f"{self.n})"
            )
        return x


def encoder_drives(side: str, drives: Drives | None, section: str = "signals") -> Drives | None:
    """Drives between the joints and the encoders; None if the encoders are at the joints.

    section : of the study, which names the side.
    """
    if side == "joint":
        return None
    if drives is None:
        raise SettingsError(
            "motor, but the robot has no drives; use side: joint or give drives in the robot file",
            path=(section, "side"),
        )
    return drives


def encoder_root(drives: Drives | None, n: int) -> Array:
    """Joint motion per encoder motion, shape (n, n): the identity on the joint side, R^-1 on the motor side."""
    if drives is None:
        return np.eye(n)
    return np.asarray(
        drives.joint_position(np.eye(n)).T - drives.joint_position(np.zeros((1, n))).T
    )
