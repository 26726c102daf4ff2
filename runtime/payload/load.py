"""Inertial parameters of a load fixed to a link, from records with and without the load.

    [Y_a; Y_b - W_Lk chi_Lk] = [[W_a, 0], [W_b, W_Lu]] [X; chi_Lu]        W_L = W K_L

a without, b with the load; K_L the ten columns of K = dX/dchi of the link to which the load is
fixed. chi_L are then XX ... M of the load alone at the frame of that link, or with K_L A
(`runtime.payload.mount`) at a frame fixed to the link. Known parameters (a weighed M) move to the
left. A parameter of the load is reported only if it has an effect; its standard deviation shows
whether the motion excites it. If friction changes with the load, rows b have friction columns of
their own.

Reference: Khalil, Gautier and Lemoine (2007), identification of the payload inertial parameters of
industrial manipulators.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.core.documents import Result
from runtime.core.errors import InputError, SettingsError
from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.method import linear_estimate
from runtime.core.markup import number
from runtime.core.model import GeneratedModel, elements_of
from runtime.core.rows.observation import Observation, stack
from runtime.core.study import EstimateSettings
from runtime.core.table import Table
from runtime.payload.mount import Mount, load_vector, mount
from runtime.payload.settings import PayloadSettings
from runtime.physical.inertia import INERTIAL, PhysicalModel, physical_model

Array = np.ndarray

UNITS = {"XX": "kg*m**2", "MX": "kg*m", "M": "kg"}
LOAD = "L"  # suffix of the load's parameters: ML, MXL, ...; friction under load: FV1L
FRICTION = ("viscous", "coulomb")


@dataclass(frozen=True, eq=False)
class Payload(Result):
    """The estimated load on a link: its inertial parameters and their standard deviations.

    Attributes
    ----------
    link : int
        Number of the link to which the load is fixed.
    names : tuple of str
        Families XX .. M of the unknown parameters that have an effect, in that order.
    value : ndarray, shape (u,), kg m^2, kg m or kg
    sigma : ndarray, shape (u,)
        Standard deviations by blocks of time if they are known, else eq. (10).
    given : mapping of str to float
        Parameters that were given, by family.
    estimate : Estimate
        All base parameters and those of the load, fitted together.
    frame : int or None
        Number of the frame at which the parameters are meant; None: that of the link.
    """

    link: int
    names: tuple[str, ...]
    value: Array
    sigma: Array
    given: Mapping[str, float]
    estimate: Estimate
    frame: int | None = None

    @property
    def place(self) -> str:
        """Words that name the link or frame to which the load is fixed, such as "link 6"."""
        return (
            f"link {self.link}"
            if self.frame in (None, self.link)
            else f"frame {self.frame} of link {self.link}"
        )

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
        caption = f"Load on {self.place}, its parameters there, SI"
        return Table(caption, (f"load on {self.place}", "value", "sigma", "unit"), rows)

    def to_table(self) -> str:
        """Return the table of the load as text."""
        return self.table().to_text()

    def summary(self) -> dict[str, Any]:
        """Return the load as a mapping for JSON."""
        parameters = {
            n: {"value": x, "sigma": s}
            for n, x, s in zip(self.names, self.value, self.sigma, strict=True)
        }
        return {
            "link": self.link,
            "frame": self.frame or self.link,
            "known": dict(self.given),
            "parameters": parameters,
        }


def payload(
    model: GeneratedModel,
    without: Sequence[Observation],
    loaded: Sequence[Observation],
    settings: PayloadSettings,
    method: EstimateSettings | None = None,
    *,
    provenance: Mapping[str, Any] | None = None,
) -> Payload:
    """Estimate a load and all base parameters together, from records without and with the load.

    Parameters
    ----------
    without, loaded : sequence of Observation
        Rows of the records without and with the load.
    settings : PayloadSettings
        Where the load is fixed, and which of its parameters are known.
    method : EstimateSettings, optional
        ols or wls; default: ols.
    provenance : mapping, optional
        Further entries of the provenance of the estimate.
    """
    if not without or not loaded:
        raise InputError(
            "a payload needs a record without the load (record) and a record with the load (payload.record)"
        )
    physical = physical_model(model)
    load = load_columns(model, physical, settings)
    friction = friction_columns(model, physical) if settings.friction else []
    names = (
        *model.BASE_PARAMETERS,
        *(f"{family}{LOAD}" for family in load.unknown),
        *(model.BASE_PARAMETERS[k] + LOAD for k in friction),
    )

    def extended(rows: Observation, mounted: float) -> Observation:
        """Add the columns of the load to W; they are zero if the load is not mounted.

        The torque of its known parameters is moved to Y.
        """
        of_load = mounted * np.hstack([rows.W @ load.columns, rows.W[:, friction]])
        Y = rows.Y - mounted * (rows.W @ load.torque)
        return replace(rows, W=np.asfortranarray(np.hstack([rows.W, of_load])), Y=Y, names=names)

    both = stack([extended(stack(without), 0.0), extended(stack(loaded), 1.0)])
    fit = linear_estimate(both, method, model=model, provenance=provenance)
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
    return Payload(
        load.mount.link,
        load.unknown,
        fit.X[place],
        sigma[place],
        dict(settings.known),
        fit,
        load.mount.frame,
    )


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

    SettingsError if there is no such link or frame.
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
