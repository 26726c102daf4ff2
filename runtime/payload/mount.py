"""Effect of a tool or load of known inertia on the base parameters of a robot.

The ten parameters of the load are those in the frame at which it is mounted; they are transformed
to the frame of the link. With P the pseudo-inertia of a body (`runtime.physical.inertia`), about
and along the axes of frame f, and lTf the pose of f in the frame of its link l,

    P_l = lTf P_f lTf',            hence chi_l = A(lTf) chi_f, A of shape (10, 10),
    X of the robot with the load = X + K_l chi_l,     K_l the columns of K = dX/dchi of link l.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from runtime.core.errors import InputError
from runtime.core.limits import LIMIT
from runtime.core.model import GeneratedModel, require
from runtime.physical.inertia import INERTIAL, PhysicalModel, physical_model, pseudo_inertia

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Mount:
    """The link to which a load is fixed, and the frame in which the load parameters are given.

    Attributes
    ----------
    link : int
        Link to which the load is fixed.
    frame : int
        Frame of its parameters: that of the link, or one fixed to the link.
    T : ndarray, shape (4, 4)
        Pose of the frame in the frame of the link.
    """

    link: int
    frame: int
    T: Array

    @property
    def place(self) -> str:
        """Words that name the link or frame to which the load is fixed, such as "link 6"."""
        return (
            f"link {self.link}"
            if self.frame == self.link
            else f"frame {self.frame} of link {self.link}"
        )

    @property
    def action(self) -> Array:
        """Matrix A, (10, 10), that transforms inertial parameters from `frame` to the link frame.

        Their order is that of INERTIAL.
        """
        return np.column_stack(
            [ten_parameters(self.T @ pseudo_inertia(unit) @ self.T.T) for unit in np.eye(10)]
        )

    def columns(self, physical: PhysicalModel) -> Array:
        """Compute the derivatives of X with respect to the parameters of the load, shape (b, 10).

        The parameters are those in the frame `frame`.
        """
        own = physical.K[:, physical.link(self.link)]
        if self.frame == self.link:
            return own
        moved = own @ self.action
        return np.where(
            np.abs(moved) > LIMIT.RIGID_POSE * np.abs(moved).max(axis=1, keepdims=True), moved, 0.0
        )


def mount(
    model: GeneratedModel,
    frame: int | None = None,
    link: int | None = None,
    constants: Mapping[str, float] | None = None,
) -> Mount:
    """Find the link to which a frame is fixed, and the pose of the frame in the frame of the link.

    Parameters
    ----------
    model : GeneratedModel
    frame : int, optional
        Any declared frame; default: that of the link.
    link : int, optional
        Default: the link to which the frame is fixed, or the last link with inertia.
    constants : mapping, optional
        Values in place of the robot file's, as for `frame_poses`.

    Raises
    ------
    InputError
        No such frame or link, or a frame that is fixed to no link with inertia.
    """
    links = physical_model(model).links
    link = links[-1] if link is None and frame is None else link
    if link is not None and link not in links:
        raise InputError(
            f"no link {link} with inertia; such links are {', '.join(map(str, links))}"
        )
    if frame is None or frame == link:
        assert link is not None  # one of both is given
        return Mount(link, link, np.eye(4))
    require(model, "frame_poses")
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, (8, len(model.JOINTS)))
    T: Array = cast(Any, model).frame_poses(q, **(constants or {}))
    if not 1 <= frame <= T.shape[1]:
        raise InputError(f"no frame {frame}; {model.NAME} has frames 1 to {T.shape[1]}")
    poses = {j: np.linalg.solve(T[:, j - 1], T[:, frame - 1]) for j in links}
    size = max(1.0, float(np.abs(T).max()))
    carrying = [
        j for j, pose in poses.items() if np.ptp(pose, axis=0).max() < LIMIT.RIGID_POSE * size
    ]
    if link is not None and link not in carrying:
        raise InputError(
            f"frame {frame} is not fixed to link {link}; it is fixed to {_link_names(carrying)}"
        )
    if not carrying:
        raise InputError(
            f"frame {frame} is not fixed to a link with inertia; such links are "
            f"{', '.join(map(str, links))}"
        )
    link = link or (frame if frame in carrying else carrying[-1])
    return Mount(link, frame, np.eye(4) if link == frame else poses[link].mean(axis=0))


def load_effect(
    model: GeneratedModel,
    load: Mapping[str, float],
    *,
    frame: int | None = None,
    link: int | None = None,
    **constants: float,
) -> Array:
    """Compute the change of the base parameters that a known load causes, shape (b,).

    X + load_effect(...) are the parameters of the robot with the load, in the order of
    BASE_PARAMETERS.

    Parameters
    ----------
    model : GeneratedModel
    load : mapping
        Some of XX XY XZ YY YZ ZZ MX MY MZ M at the frame, SI; those left out are zero.
    frame : int, optional
        Default: that of the link.
    link : int, optional
        Default: the link to which the frame is fixed, or the last link with inertia.
    **constants : float
        Values in place of the robot file's.
    """
    return np.asarray(
        mount(model, frame, link, constants).columns(physical_model(model, constants))
        @ load_vector(load)
    )


def load_vector(load: Mapping[str, float]) -> Array:
    """Return the ten parameters of a load in the order of INERTIAL; InputError for another name."""
    if unknown := [name for name in load if name not in INERTIAL]:
        raise InputError(
            f"unknown parameter {', '.join(unknown)} of a load; expected some of "
            f"{', '.join(INERTIAL)}"
        )
    return np.array([float(load.get(name, 0.0)) for name in INERTIAL])


def load_of_body(
    mass: float, centre: Any, inertia: Any = None, rotation: Any = None
) -> dict[str, float]:
    """Compute the ten inertial parameters of a body from the numbers of its data sheet.

    They are about the origin and along the axes of the frame on which the body is mounted.

    Parameters
    ----------
    mass : float, kg
    centre : array_like, shape (3,), m
        Centre of mass, in that frame.
    inertia : array_like, shape (3, 3), kg m^2, optional
        Tensor about the centre of mass (products as tensor elements, Ixy = -integral x y dm);
        default: a point.
    rotation : array_like, shape (3, 3), optional
        Orientation of the axes of `inertia` in that frame; default: the same axes.
    """
    c, I = (
        np.asarray(centre, dtype=float),
        np.zeros((3, 3)) if inertia is None else np.asarray(inertia, dtype=float),
    )
    R = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
    if c.shape != (3,) or I.shape != (3, 3) or R.shape != (3, 3) or not np.allclose(I, I.T):
        raise InputError(
            f"centre {c.shape}, inertia {I.shape}, rotation {R.shape}; expected the shapes (3,), "
            "(3, 3) and (3, 3), and a symmetric inertia"
        )
    if not mass > 0:
        raise InputError(f"mass {mass} kg; expected a positive mass")
    J = R @ I @ R.T + mass * (c @ c * np.eye(3) - np.outer(c, c))
    return dict(zip(INERTIAL, map(float, (*J[np.triu_indices(3)], *(mass * c), mass)), strict=True))


def ten_parameters(P: Array) -> Array:
    """Compute the ten inertial parameters from a pseudo-inertia P, in the order of INERTIAL.

    J = tr(S) 1 - S, with S its matrix of second moments.
    """
    S = P[:3, :3]
    J = np.trace(S) * np.eye(3) - S
    return np.array([*J[np.triu_indices(3)], *P[:3, 3], P[3, 3]])


def _link_names(links: list[int]) -> str:
    return f"link {', '.join(map(str, links))}" if links else "no link with inertia"
