"""Conversion of positions and torques between motors and joints (chapter, section 4.2.1).

One matrix R serves both directions, so that the power tau' qd is that of the motors:

    qm  = R (q - offset)                    tau = R' (torque_constant * u)

The chapter writes Gamma_a = N K_T I. Off-diagonal elements of R are couplings: motor 6 of a wrist
also turns with joint 5. Without the couplings of the position, the torque or both, the total error
of a fit changes little, but the parameters of the coupled joints are wrong. `Drives.decoupled`
makes such drives, for reports that compare them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from runtime.ground.errors import InputError, SettingsError

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
        Joint position at which the motor position is zero.
    torque_constant : ndarray, shape (n,), N m/A or N m/V
        Motor torque per unit of u; 1 if u is a torque.
    coupling : "both", "position", "torque" or "none"
        Quantities for which the off-diagonal elements of R are used.
    declared : bool
        Whether the robot file states torque constants, which are needed if currents are recorded.
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
                "may be zero"
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
        """Make drives from the constant DRIVES of an emitted model, a generated Python module."""
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
        """Return the same drives with gear couplings used for positions, torques, both or neither.

        coupling : "position", "torque", "both" or "none".
        """
        return replace(self, coupling=coupling)

    def joint_position(self, qm: Array) -> Array:
        """Compute joint positions q = R^-1 qm + offset from motor positions qm.

        qm : shape (N, n), rad.
        """
        return np.asarray(
            np.linalg.solve(self._matrix("position"), self._checked(qm).T).T + self.offset
        )

    def motor_position(self, q: Array) -> Array:
        """Compute motor positions qm = R (q - offset), rad, from joint positions q.

        q : shape (N, n), rad or m.
        """
        return np.asarray((self._checked(q) - self.offset) @ self._matrix("position").T)

    def joint_torque(self, u: Array) -> Array:
        """Compute joint torques tau = R' (torque_constant u), N m or N, from motor commands u.

        u : shape (N, n), A, V or N m.
        """
        return np.asarray((self._checked(u) * self.torque_constant) @ self._matrix("torque"))

    def motor_command(self, tau: Array) -> Array:
        """Compute motor commands u = R'^-1 tau / torque_constant from joint torques tau.

        u is in A, V or N m; tau has shape (N, n), N m or N.
        """
        return np.asarray(
            np.linalg.solve(self._matrix("torque").T, self._checked(tau).T).T / self.torque_constant
        )

    @property
    def motion(self) -> Array:
        """Matrix R of gear ratios, shape (n, n), in the motor positions qm = R (q - offset).

        R is diagonal if the couplings of the gears are not used for positions.
        """
        return self._matrix("position")

    def _matrix(self, quantity: str) -> Array:
        return self.ratio if self.coupling in ("both", quantity) else np.diag(np.diag(self.ratio))

    def _checked(self, x: Array) -> Array:
        x = np.asarray(x, dtype=float)
        if x.ndim != 2 or x.shape[1] != self.n:
            raise InputError(
                f"an array of shape {x.shape} for drives of {self.n} joints; expected (N, {self.n})"
            )
        return x


def encoder_drives(side: str, drives: Drives | None, section: str = "signals") -> Drives | None:
    """Return the drives that convert joint to encoder positions; None for encoders at the joints.

    Raise SettingsError if the encoders are at the motors and the robot has no drives. section :
    section of the study whose key `side` is "joint" or "motor", for messages.
    """
    if side == "joint":
        return None
    if drives is None:
        raise SettingsError(
            "side: motor needs drives, but the robot has no drives; set side: joint, or give "
            "drives in the robot file",
            path=(section, "side"),
        )
    return drives


def encoder_root(drives: Drives | None, n: int) -> Array:
    """Compute the matrix, shape (n, n), that converts encoder velocities to joint velocities.

    For encoders at the joints (drives None) it is the identity, for encoders at the motors R^-1.
    """
    if drives is None:
        return np.eye(n)
    return np.asarray(
        drives.joint_position(np.eye(n)).T - drives.joint_position(np.zeros((1, n))).T
    )
