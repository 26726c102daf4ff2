"""Inertial parameters of a load fixed to a link, from records with and without the load.

    [Y_a; Y_b - W_Lk chi_Lk] = [[W_a, 0], [W_b, W_Lu]] [X; chi_Lu]        W_L = W K_L

The index a means without the load, b with the load. K_L has the ten columns of K = dX/dchi of the
link to which the load is fixed. chi_L are then XX ... M of the load alone at the frame of that link,
or with K_L A at a frame fixed to the link. Known parameters (a weighed M) move to the left. A
parameter of the load is reported only if it has an effect; its standard deviation shows whether the
motion excites it. If friction changes with the load, rows b have friction columns of their own.

Reference: Khalil, Gautier and Lemoine (2007), identification of the payload inertial parameters of
industrial manipulators.

A tool or load of known inertia changes the base parameters of a robot. Its ten parameters are given in
the frame at which it is mounted, and are transformed to the frame of the link. With P the
pseudo-inertia of a body (`runtime.physical.inertia`), about and along the axes of frame f, and lTf
the pose of f in the frame of its link l,

    P_l = lTf P_f lTf',            hence chi_l = A(lTf) chi_f, A of shape (10, 10),
    X of the robot with the load = X + K_l chi_l,     K_l the columns of K = dX/dchi of link l.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import numpy as np

from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import System, assemble
from runtime.core.least_squares.wls import weighted_system
from runtime.core.model import GeneratedModel, elements_of, require
from runtime.core.rows.observation import Observation, stack
from runtime.ground.documents import Result
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import limits
from runtime.ground.table import Table, number
from runtime.payload.body import Body, Place, body_at, place_on
from runtime.payload.settings import PayloadSettings
from runtime.physical.inertia import INERTIAL, PhysicalModel, physical_model, pseudo_inertia

LIMIT = limits(__package__)

Array = np.ndarray

UNITS = {"XX": "kg*m**2", "MX": "kg*m", "M": "kg"}
LOAD = "L"  # suffix of the load's parameters: ML, MXL, ...; friction under load: FV1L
FRICTION = ("viscous", "coulomb")


@dataclass(frozen=True, eq=False)
class Payload(Result):
    """The estimated load on a link: its inertial parameters and their standard deviations.

    Attributes
    ----------
    mount : Mount
        Link to which the load is fixed, and frame of its parameters.
    at : Place
        Place of the robot file at which mass, centre and inertia are given.
    names : tuple of str
        Families XX .. M of the unknown parameters that have an effect, in that order.
    value : ndarray, shape (u,), kg m^2, kg m or kg
    sigma : ndarray, shape (u,)
        Standard deviations by blocks of time if they are known, else eq. (10).
    given : mapping of str to float
        Parameters that were given, by family.
    estimate : Estimate
        All base parameters and those of the load, fitted together.
    """

    mount: Mount
    at: Place
    names: tuple[str, ...]
    value: Array
    sigma: Array
    given: Mapping[str, float]
    estimate: Estimate

    @property
    def link(self) -> int:
        """Number of the link to which the load is fixed."""
        return self.mount.link

    @property
    def place(self) -> str:
        """Words that name link and frame of the parameters: "link 6, in Khalil's frame 6"."""
        return f"link {self.mount.link}, in Khalil's frame {self.mount.frame}"

    @property
    def body(self) -> Body | None:
        """Mass, centre and inertia at the place `at`; None if the mass is not positive."""
        fit, families = self.estimate, [*INERTIAL]
        chi, C = np.zeros(10), np.zeros((10, 10))
        places = [families.index(name) for name in self.names]
        columns = [fit.names.index(f"{name}{LOAD}") for name in self.names]
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.nan_to_num(self.sigma / fit.sigma[columns], nan=1.0, posinf=1.0)
        covariance = np.nan_to_num(fit.covariance[np.ix_(columns, columns)])
        C[np.ix_(places, places)] = covariance * np.outer(factor, factor)
        chi[places] = self.value
        for family, x in self.given.items():
            chi[families.index(family)] = x
        unknown = [name not in self.names and name not in self.given for name in families]
        return body_at(self.at, self.mount.T, chi, C, unknown)

    def __getitem__(self, family: str) -> float:
        """Return the value of one parameter of the load, such as payload["M"] for the mass."""
        return (
            float(self.given[family])
            if family in self.given
            else float(self.value[self.names.index(family)])
        )

    def table(self) -> Table:
        """Return the table of the load, with one line per parameter."""
        rows = [(name, number(x, ".6g"), "given", _unit(name)) for name, x in self.given.items()]
        rows += [
            (name, number(x, ".6g"), number(sigma, ".2g"), _unit(name))
            for name, x, sigma in zip(self.names, self.value, self.sigma, strict=True)
        ]
        caption = f"Load on {self.place}, SI"
        return Table(caption, (f"load on link {self.link}", "value", "sigma", "unit"), rows)

    def to_table(self) -> str:
        """Return the table of the load as text."""
        return self.table().to_text()

    def summary(self) -> dict[str, Any]:
        """Return the load as a mapping for JSON."""
        parameters = {
            n: {"value": x, "sigma": s}
            for n, x, s in zip(self.names, self.value, self.sigma, strict=True)
        }
        body = self.body
        return {
            "link": self.link,
            "frame": self.mount.frame,
            "known": dict(self.given),
            "parameters": parameters,
            "body": None if body is None else body.summary(),
        }


def payload(
    model: GeneratedModel,
    without: Sequence[Observation],
    loaded: Sequence[Observation],
    settings: PayloadSettings,
    weigh: Callable[..., System] = weighted_system,
    *,
    columns: Sequence[str] | Literal["all"] = "all",
    provenance: Mapping[str, Any] | None = None,
) -> Payload:
    """Estimate a load and all base parameters together, from records without and with the load.

    Parameters
    ----------
    without, loaded : sequence of Observation
        Rows of the records without and with the load.
    settings : PayloadSettings
        Where the load is fixed, and which of its parameters are known.
    weigh : function of rows and `columns`, optional
        Weighs the rows for linear least squares; default: equal weights.
    columns : sequence of str or "all", optional
        Base parameters that are fitted.
    provenance : mapping, optional
        Further entries of the provenance of the estimate.
    """
    if not without or not loaded:
        raise InputError(
            "a payload needs a record without the load (record) and a record with the load (payload.record)"
        )
    physical = physical_model(model)
    load = load_columns(model, physical, settings)
    mounts = getattr(model, "MOUNTS", {})
    at = place_on(mounts, load.mount.link, load.mount.frame, settings.at, load.mount.T)
    friction = friction_columns(model, physical) if settings.friction else []
    names = (
        *model.BASE_PARAMETERS,
        *(f"{family}{LOAD}" for family in load.unknown),
        *(model.BASE_PARAMETERS[k] + LOAD for k in friction),
    )

    def extended(rows: Observation, mounted: float) -> Observation:
        """Add the columns of the load to W, which are zero if the load is not mounted.

        The torque of its known parameters is moved to Y.
        """
        of_load = mounted * np.hstack([rows.W @ load.columns, rows.W[:, friction]])
        Y = rows.Y - mounted * (rows.W @ load.torque)
        return replace(rows, W=np.asfortranarray(np.hstack([rows.W, of_load])), Y=Y, names=names)

    if columns != "all":
        left_out = {*model.BASE_PARAMETERS} - {*columns}
        columns = tuple(name for name in names if name.removesuffix(LOAD) not in left_out)
    both = stack([extended(stack(without), 0.0), extended(stack(loaded), 1.0)])
    system = weigh(both, columns=columns)
    fit = assemble(system, system.solve(), model=model, provenance=provenance)
    units = {**fit.units, **{f"{family}{LOAD}": _unit(family) for family in load.unknown}}
    units |= {
        model.BASE_PARAMETERS[k] + LOAD: fit.units.get(model.BASE_PARAMETERS[k], "")
        for k in friction
    }
    fit = replace(fit, units=units)
    place = [fit.names.index(f"{family}{LOAD}") for family in load.unknown]
    sigma = np.where(
        np.isnan(fit.sigma_corrected), fit.sigma, np.fmax(fit.sigma, fit.sigma_corrected)
    )
    known = dict(settings.known)
    return Payload(load.mount, at, load.unknown, fit.X[place], sigma[place], known, fit)


def friction_columns(model: GeneratedModel, physical: PhysicalModel) -> list[int]:
    """List the indices of the base parameters that consist only of viscous and Coulomb friction."""
    elements = elements_of(model)
    friction = np.array(
        [name in elements and elements[name][0] in FRICTION for name in physical.standard]
    )
    return [k for k, row in enumerate(physical.K) if not row[~friction].any()]


@dataclass(frozen=True, eq=False)
class LoadColumns:
    """Derivatives of the base parameters with respect to the load parameters, one column each.

    Attributes
    ----------
    mount : Mount
        Where the load is fixed.
    unknown : tuple of str
        Families of the unknown parameters that have an effect.
    columns : ndarray, shape (b, u)
        dX/dchi of the unknown parameters.
    torque : ndarray, shape (b,)
        Change of the base parameters by the known parameters.
    """

    mount: Mount
    unknown: tuple[str, ...]
    columns: Array
    torque: Array


def load_columns(
    model: GeneratedModel, physical: PhysicalModel, settings: PayloadSettings
) -> LoadColumns:
    """Compute the derivatives of the base parameters with respect to the parameters of a load.

    Raise SettingsError if there is no such link or frame.
    """
    try:
        place = mount(model, settings.frame, settings.link)
    except InputError as e:
        raise SettingsError(
            e.message, path=("payload", "frame" if settings.frame is not None else "link")
        ) from e
    K = place.columns(physical)
    free = [
        k for k, family in enumerate(INERTIAL) if family not in settings.known and K[:, k].any()
    ]
    return LoadColumns(
        place, tuple(INERTIAL[k] for k in free), K[:, free], K @ load_vector(settings.known)
    )


def _unit(family: str) -> str:
    return UNITS.get(family, UNITS["MX"] if family.startswith("M") else UNITS["XX"])


@dataclass(frozen=True, eq=False)
class Mount:
    """The link to which a load is fixed, and the frame in which the load parameters are given.

    Attributes
    ----------
    link : int
        Link to which the load is fixed.
    frame : int
        Frame of its parameters: the frame of the link, or a frame fixed to the link.
    T : ndarray, shape (4, 4)
        Pose of the frame in the frame of the link.
    """

    link: int
    frame: int
    T: Array

    @property
    def action(self) -> Array:
        """Matrix A, (10, 10), that transforms inertial parameters from `frame` to the link frame.

        The order of the parameters is XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M.
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
        Some of XX XY XZ YY YZ ZZ MX MY MZ M at the frame, SI; parameters that are left out are
        zero.
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
    """Return the ten parameters of a load in the order XX ... M; raise InputError for any other
    name.
    """
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

    The parameters are about the origin and along the axes of the frame on which the body is
    mounted.

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
    """Compute the ten inertial parameters from a pseudo-inertia P, in the order XX ... M.

    J = tr(S) 1 - S, with S its matrix of second moments.
    """
    S = P[:3, :3]
    J = np.trace(S) * np.eye(3) - S
    return np.array([*J[np.triu_indices(3)], *P[:3, 3], P[3, 3]])


def _link_names(links: list[int]) -> str:
    return f"link {', '.join(map(str, links))}" if links else "no link with inertia"
