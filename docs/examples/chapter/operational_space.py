"""What a user feels at the handle of a back-drivable robot, from an Estimate and with its
uncertainty (chapter, end of 4.2.2).

With J the Jacobian of the handle's velocity, xd = J qd, and the user's force f in place of the
motors, J' f = Gamma:

    apparent mass   Lambda = (J A^-1 J')^-1     f = Lambda xdd from rest, no friction, no gravity
    friction        f_u    = Gamma_f' J^+ u     u' f while the handle moves along the unit vector u
    static force    f_0    = J^+' Gamma_0       Gamma_0: gravity, offsets and springs
    stiffness       K      = d f_0 / dx = (d f_0 / dq) J^+      positive: the handle pulls back

Gamma_f = (H(q, qd) - H(q, -qd))/2 at qd = J^+ u v is the part of the bias H that changes sign with
the motion: friction, whatever its elements are called. All four are linear in the parameters or,
for Lambda, have the derivative dLambda = B' dA B with B = A^-1 J' Lambda; deviations follow from
the covariance of the Estimate, eq. (10), by linearisation. Closed loops: the columns of J are the
actuated joints.

Where J loses rank there is no such thing as a mass at the handle, and where the estimated A is not
positive definite there is no dynamics: those configurations are marked and hold nan. They are not
smoothed over.

O. Khatib, A unified approach for motion and force control of robot manipulators: the operational
space formulation, IEEE J. Robotics and Automation 3(1), 1987.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from runtime import Estimate, InputError
from runtime.core.model import GeneratedModel, require

Array = np.ndarray

SINGULAR = 1e-2
"""Smallest over largest singular value of J below which a configuration is singular."""
SLOW = 1e-3
"""Speed of the handle at which friction is evaluated, m/s: dry friction alone, in practice."""
STEP = 1e-5
"""Step of the differences for the stiffness, rad or m: truncation and rounding errors are both near
1e-10 of the force.
"""
HANDLE = 4
"""Frame of the support of the handle of the haptic interface."""
SHEET = (25, 31)
"""Configurations of joints 2 and 5 at q1 = 0."""
Linear = Callable[[Array], Array]  # X of shape (b,) to a quantity of shape (N, ...), linear in X


@dataclass(frozen=True, eq=False)
class Quantity:
    """A quantity at N configurations.

    Attributes
    ----------
    value : ndarray, shape (N, ...)
        nan where the configuration is singular.
    sigma : ndarray, shape (N, ...)
        Standard deviation; nan besides where the quantity depends on a parameter that the record
        does not determine.
    """

    value: Array
    sigma: Array


@dataclass(frozen=True, eq=False)
class OperationalSpace:
    """What the user feels at N configurations, in m coordinates of frame 0 (`axes`). SI.

    Attributes
    ----------
    position : ndarray, shape (N, 3), m
        Of the handle, frame 0.
    singular : ndarray of bool, shape (N,)
    conditioning : ndarray, shape (N,)
        Smallest over largest singular value of J.
    indefinite : ndarray of bool, shape (N,)
        Where the estimated A is not positive definite.
    mass : Quantity, shape (N, m, m), kg
        Lambda.
    principal : Quantity, shape (N, m), kg
        Eigenvalues of Lambda, ascending.
    directions : ndarray, shape (N, m, m)
        Eigenvectors of Lambda in the columns, frame 0.
    friction : Quantity, shape (N, m), N
        For a motion along each coordinate.
    static_force : Quantity, shape (N, m), N
    stiffness : Quantity, shape (N, m, m), N/m
    """

    position: Array
    singular: Array
    conditioning: Array
    indefinite: Array
    mass: Quantity
    principal: Quantity
    directions: Array
    friction: Quantity
    static_force: Quantity
    stiffness: Quantity

    @property
    def message(self) -> str:
        """How many configurations are left out, why, and the first one's number, from 0; empty
        where none is.
        """
        parts = []
        if self.singular.any():
            first = int(np.argmax(self.singular))
            parts.append(
                f"{int(self.singular.sum())} of {len(self.singular)} configurations are singular "
                f"(first: {first}, conditioning {self.conditioning[first]:.2g})"
            )
        if self.indefinite.any():
            first = int(np.argmax(self.indefinite))
            parts.append(
                f"at {int(self.indefinite.sum())} of {len(self.indefinite)} the estimated inertia "
                f"matrix is not positive definite (first: {first})"
            )
        return "; ".join(parts) + "; nothing is told there." if parts else ""


def operational_space(
    model: GeneratedModel,
    estimate: Estimate,
    q: Array,
    *,
    frame: int | None = None,
    axes: Sequence[int] = (0, 1, 2),
    speed: float = SLOW,
    singular: float = SINGULAR,
    constants: Mapping[str, float] | None = None,
) -> OperationalSpace:
    """Apparent mass, friction, static force and stiffness felt at the origin of `frame` (default:
    the model's last).

    Parameters
    ----------
    model : GeneratedModel
        With Jacobian, poses and dynamics.
    estimate : Estimate
        Of all base parameters or of some; those it lacks count as exactly zero.
    q : ndarray, shape (N, n), rad or m
        Actuated joints.
    frame : int, optional
        Number of the frame at whose origin the user holds the robot.
    axes : sequence of int
        Coordinates of frame 0 in which the handle is free, 0 x, 1 y, 2 z, at most n; (0, 1) for a
        robot in the x0-y0 plane.
    speed : float, m/s
        Of the handle where friction is evaluated.
    singular : float
        Conditioning of J below which a configuration is singular.
    constants : mapping of str to float, optional
        In place of the robot file's.

    Raises
    ------
    InputError
        Shapes, axes, frame or names that do not suit the model.
    """
    require(model, "jacobian", "frame_poses", "inertia_matrix", "bias", "gravity")
    q = np.atleast_2d(np.asarray(q, dtype=float))
    n = len(model.JOINTS)
    if q.ndim != 2 or q.shape[1] != n:
        raise InputError(f"{model.NAME}: q has shape {q.shape}; expected (N, {n}) or ({n},)")
    if (
        not 0 < len(axes) <= n
        or any(k not in (0, 1, 2) for k in axes)
        or len(set(axes)) != len(axes)
    ):
        raise InputError(
            f"axes {tuple(axes)}; expected at most {n} different ones of 0, 1, 2: {n} actuated "
            "joints move a handle in no more directions"
        )
    frames = len(model.frame_poses(q[0], **dict(constants or {})))  # type: ignore[attr-defined]
    if not (frame is None or 1 <= frame <= frames) or not speed > 0:
        raise InputError(
            f"{model.NAME}: frame {frame}, speed {speed} m/s; expected a frame from 1 to {frames} "
            "and a positive speed"
        )
    X, C = parameters_of(model, estimate)
    handle = _Handle(model, q, frame, list(axes), dict(constants or {}), singular, X)
    mass = _quantity(handle.mass, X, C)
    principal, directions = _principal(mass.value, handle.lost)
    along = _quantity(
        lambda X: _array("nap,nab,nbp->np", directions, handle.mass(X), directions), X, C
    )
    return OperationalSpace(
        position=handle.position,
        singular=handle.singular,
        conditioning=handle.conditioning,
        indefinite=handle.indefinite,
        mass=mass,
        principal=Quantity(principal, along.sigma),
        directions=directions,
        friction=_quantity(lambda X: handle.friction(X, speed), X, C),
        static_force=_quantity(handle.static_force, X, C),
        stiffness=_quantity(handle.stiffness, X, C),
    )


class _Handle:
    """The model at N configurations, seen from the handle; every quantity is linear in X."""

    def __init__(
        self,
        model: Any,
        q: Array,
        frame: int | None,
        axes: list[int],
        constants: dict[str, float],
        singular: float,
        X: Array,
    ) -> None:
        self.model, self.q, self.axes, self.constants = model, q, axes, constants
        self.frame = {} if frame is None else {"frame": frame}
        frames = np.asarray(model.frame_poses(q, **constants))
        self.position = frames[:, (frames.shape[1] if frame is None else frame) - 1, :3, 3]
        J = self.jacobian(q)
        s = np.linalg.svd(J, compute_uv=False)
        self.conditioning = s[:, -1] / s[:, 0]
        A = np.asarray(model.inertia_matrix(q, X, **constants))
        self.singular, self.indefinite = (
            ~(self.conditioning >= singular),
            ~(np.linalg.eigvalsh(A)[:, 0] > 0),
        )
        self.lost = self.singular | self.indefinite
        self.inverse = self.inverted(J)
        JT = np.swapaxes(J, 1, 2)[~self.lost]
        weighted = np.linalg.solve(A[~self.lost], JT)  # A^-1 J'
        self.B = np.full_like(self.inverse, np.nan)
        self.B[~self.lost] = weighted @ np.linalg.inv(J[~self.lost] @ weighted)

    def jacobian(self, q: Array) -> Array:
        """J, shape (N, m, n)."""
        return np.asarray(self.model.jacobian(q, **self.frame, **self.constants))[:, self.axes]

    def inverted(self, J: Array) -> Array:
        """J^+, shape (N, n, m); nan where the configuration is singular."""
        inverse = np.full(np.swapaxes(J, 1, 2).shape, np.nan)
        inverse[~self.lost] = np.linalg.pinv(J[~self.lost])
        return inverse

    def mass(self, X: Array) -> Array:
        """B' A B: Lambda at the estimate, its differential elsewhere."""
        return _array(
            "nja,njk,nkb->nab",
            self.B,
            self.model.inertia_matrix(self.q, X, **self.constants),
            self.B,
        )

    def friction(self, X: Array, speed: float) -> Array:
        """f_u for every coordinate."""
        forces = []
        for k in range(len(self.axes)):
            qd = np.where(self.lost[:, None], 0.0, self.inverse[:, :, k]) * speed
            forward, backward = (
                np.asarray(self.model.bias(self.q, v, X, **self.constants)) for v in (qd, -qd)
            )
            forces.append(_array("nj,nj->n", (forward - backward) / 2, self.inverse[:, :, k]))
        return np.stack(forces, axis=1)

    def static_force(self, X: Array, q: Array | None = None) -> Array:
        """f_0 at q, or at one near by."""
        inverse, q = (self.inverse, self.q) if q is None else (self.inverted(self.jacobian(q)), q)
        return _array("nja,nj->na", inverse, self.model.gravity(q, X, **self.constants))

    def stiffness(self, X: Array) -> Array:
        """d f_0 / dq by central differences, times J^+."""
        steps = STEP * np.eye(self.q.shape[1])
        columns = [
            (self.static_force(X, self.q + h) - self.static_force(X, self.q - h)) / (2 * STEP)
            for h in steps
        ]
        return _array("naj,njb->nab", np.stack(columns, axis=2), self.inverse)


def _array(subscripts: str, *operands: Any) -> Array:
    return np.asarray(np.einsum(subscripts, *operands))


def parameters_of(model: GeneratedModel, estimate: Estimate) -> tuple[Array, Array]:
    """X, shape (b,), and its covariance, (b, b), in the order of the model; parameters that were
    not estimated are zero, without deviation.
    """
    order = list(model.BASE_PARAMETERS)
    unknown = [name for name in estimate.names if name not in order]
    if unknown:
        raise InputError(
            f"{', '.join(unknown)}: not base parameters of {model.NAME}; expected an estimate of "
            "this model"
        )
    at = [order.index(name) for name in estimate.names]
    X, C = np.zeros(len(order)), np.zeros((len(order), len(order)))
    X[at] = estimate.X
    C[np.ix_(at, at)] = estimate.covariance
    return X, C


def _quantity(quantity: Linear, X: Array, C: Array) -> Quantity:
    """A quantity linear in X with its deviation, sqrt(g' C g); directions without variance are not
    evaluated.

    Where C is nan in the row of a parameter, which the record then does not determine, a quantity
    that depends on this parameter has the deviation nan.
    """
    value = quantity(X)
    total = np.zeros_like(value)
    known = np.isfinite(np.diag(C))
    for direction in np.eye(len(X))[~known]:
        total[quantity(direction) != 0] = np.nan
    variances, vectors = np.linalg.eigh(C[np.ix_(known, known)])
    for variance, vector in zip(variances, vectors.T, strict=True):
        if variance > 0:
            direction = np.zeros(len(X))
            direction[known] = vector
            total += variance * quantity(direction) ** 2
    return Quantity(value, np.sqrt(total))


def _principal(mass: Array, lost: Array) -> tuple[Array, Array]:
    """Eigenvalues, ascending, and eigenvectors of Lambda; nan where it is singular."""
    values, vectors = np.full(mass.shape[:2], np.nan), np.full(mass.shape, np.nan)
    values[~lost], vectors[~lost] = np.linalg.eigh(mass[~lost])
    return values, vectors


def felt_at_the_handle(
    model: GeneratedModel, estimate: Estimate, image: Path
) -> list[tuple[str, ...]]:
    """Medians and extremes over a sheet of the workspace of the haptic interface, with their
    deviations; the four maps are drawn to `image`.

    The sheet: q1 = 0, the arm about upright, the elbow q3 from folded to stretched, both singular.
    """
    q2, q3 = np.meshgrid(np.linspace(-1.0, 0.3, SHEET[0]), np.linspace(0, np.pi, SHEET[1]))
    q2, q3 = q2.T.ravel(), q3.T.ravel()
    q = np.stack([np.zeros(q2.size), q2, q2 + q3 - np.pi], axis=1)
    space = operational_space(model, estimate, q, frame=HANDLE)
    panels = panels_of(space)
    draw(space, panels, image)
    print(
        "Lambda = (J A^-1 J')^-1 at the support of the handle, dry friction for a motion along "
        "the worst coordinate, and the change of the force that holds the branch against gravity, "
        "per metre; q1 = 0. Deviations are those of the fourteen parameters, linearised; the "
        f"handle itself is not in the model.\n\n{space.message}\n"
    )
    rows = [("felt", "smallest", "median", "largest", "median %sigma")]
    for title, (value, sigma) in panels.items():
        order = np.argsort(value)[: np.isfinite(value).sum()]
        shown = (order[0], order[len(order) // 2], order[-1])
        cells = (f"{value[k]:.3g} +- {sigma[k]:.1g}" for k in shown)
        relative = 100 * np.median(sigma[order] / np.abs(value[order]))
        rows.append((title, *cells, f"{relative:.2g}"))
    return rows


def panels_of(space: OperationalSpace) -> dict[str, tuple[Array, Array]]:
    """(values, deviations), each of shape (N,), by title."""

    def worst(felt: Quantity) -> tuple[Array, Array]:
        value, sigma = (
            np.abs(x).reshape(len(space.singular), -1) for x in (felt.value, felt.sigma)
        )
        k = np.argmax(np.nan_to_num(value), axis=1)[:, None]
        value, sigma = (np.take_along_axis(x, k, axis=1)[:, 0] for x in (value, sigma))
        return value, sigma

    mass = space.principal
    return {
        "smallest apparent mass, kg": (mass.value[:, 0], mass.sigma[:, 0]),
        "largest apparent mass, kg": (mass.value[:, -1], mass.sigma[:, -1]),
        "friction, worst coordinate, N": worst(space.friction),
        "stiffness, largest element, N/m": worst(space.stiffness),
    }


def draw(space: OperationalSpace, panels: Mapping[str, tuple[Array, Array]], image: Path) -> None:
    """Four maps over the sheet; crosses: singular configurations. Levels are in geometric steps up
    to the 90th percentile.
    """
    x, y = (space.position[:, k].reshape(SHEET) for k in (2, 0))
    figure = Figure((8.2, 6.4), layout="constrained")
    for ax, (title, (value, _)) in zip(figure.subplots(2, 2).ravel(), panels.items(), strict=True):
        lowest, high = np.nanmin(value), np.nanquantile(value, 0.9)
        levels = np.geomspace(max(lowest, 1e-3 * high), 1.0001 * high, 13)
        shown = np.ma.masked_invalid(value.reshape(SHEET))
        filled = ax.contourf(x, y, shown, levels, cmap="cividis", norm=LogNorm(), extend="both")
        ax.plot(*space.position[space.singular][:, [2, 0]].T, "x", color="tab:orange", markersize=3)
        figure.colorbar(filled, ax=ax, format="%.3g")
        ax.set(title=title, xlabel="z0, along axis 1, m", ylabel="x0, upwards, m", aspect="equal")
    with mpl.rc_context({"font.size": 8}):
        figure.savefig(image, dpi=150)
