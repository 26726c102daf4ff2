"""A mass fixed to a link: its parameters from records with and without it, known or unknown.

    [Y_a; Y_b - W_Lk chi_Lk] = [[W_a, 0], [W_b, W_Lu]] [X; chi_Lu]        W_L = W K_L

a without, b with the load; K_L the ten columns of K = dX/dchi of the link that carries it, so chi_L are XX ... M of the load alone at the frame of
that link. Known ones (a weighed M) move to the left. What of the ten the motion shows is judged as for any other parameter. Where friction
changes with the load, rows b have friction columns of their own.

    X_b - X_a = K_L chi_L,    covariance C_a + C_b

is the alternative from two estimates, for records that are gone: less precise, as every other parameter is fitted twice.

Reference: Khalil, Gautier and Lemoine (2007), identification of the payload inertial parameters of industrial manipulators.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.errors import InputError, SettingsError
from runtime.estimate import Estimate, aligned
from runtime.estimators import estimate
from runtime.estimators.solution import Solution, solve
from runtime.estimators.triangular import Factor, triangularise
from runtime.model import GeneratedModel
from runtime.observation import Observation, stack
from runtime.physical import INERTIAL, PhysicalModel, physical_model
from runtime.study import EstimateSettings, PayloadSettings

Array = np.ndarray

UNITS = {"XX": "kg*m**2", "MX": "kg*m", "M": "kg"}
LOAD = "L"  # suffix of the load's parameters: ML, MXL, ...; friction under load: FV1L
FRICTION = ("viscous", "coulomb")


@dataclass(frozen=True, eq=False)
class Payload:
    """The load on link `link`: ten parameters at its frame, kg, kg m, kg m^2.

    names, value, sigma : of the unknown ones that have an effect, in the order of XX .. M; sigma by time blocks where known, else eq. (10).
    known : given ones.   estimate : the joint solution with all base parameters, or None where it came from two estimates.
    """

    link: int
    names: tuple[str, ...]
    value: Array
    sigma: Array
    known: Mapping[str, float]
    estimate: Estimate | None = None

    def __getitem__(self, family: str) -> float:
        """Value of one parameter by family: payload["M"]."""
        return float(self.known[family]) if family in self.known else float(self.value[self.names.index(family)])

    def __str__(self) -> str:
        return self.to_table()

    def to_table(self) -> str:
        """One line per parameter."""
        rows: list[Sequence[str]] = [(f"load on link {self.link}", "value", "sigma", "unit")]
        rows += [(name, f"{self.known[name]:.6g}", "given", _unit(name)) for name in self.known]
        found = zip(self.names, self.value, self.sigma, strict=True)
        rows += [(name, f"{x:.6g}", f"{s:.2g}" if np.isfinite(s) else "-", _unit(name)) for name, x, s in found]
        return aligned(rows)

    def summary(self) -> dict[str, Any]:
        """For JSON."""
        found = {n: {"value": x, "sigma": s} for n, x, s in zip(self.names, self.value, self.sigma, strict=True)}
        return {"link": self.link, "known": dict(self.known), "parameters": found}


def payload(
    model: GeneratedModel,
    without: Sequence[Observation],
    loaded: Sequence[Observation],
    settings: PayloadSettings,
    method: EstimateSettings | None = None,
    *,
    provenance: Mapping[str, Any] | None = None,
) -> Payload:
    """The joint solution of observations without and with the load, all base columns in each, by a linear method (ols or wls)."""
    if not without or not loaded:
        raise InputError("a payload needs a record without it and one with it (record, payload.record)")
    physical = physical_model(model)
    link, unknown, columns, chi_known = carried(physical, settings)
    friction = friction_columns(model, physical) if settings.friction else []
    names = (*model.BASE_PARAMETERS, *(f"{family}{LOAD}" for family in unknown), *(model.BASE_PARAMETERS[k] + LOAD for k in friction))

    def extended(seen: Observation, load: float) -> Observation:
        own = load * np.hstack([seen.W @ physical.K[:, columns], seen.W[:, friction]])
        Y = seen.Y - load * (seen.W @ (physical.K @ chi_known))
        return replace(seen, W=np.asfortranarray(np.hstack([seen.W, own])), Y=Y, names=names)

    both = stack([extended(stack(without), 0.0), extended(stack(loaded), 1.0)])
    found = estimate(both, method, model=model, provenance=provenance)
    units = {**found.units, **{f"{family}{LOAD}": _unit(family) for family in unknown}}
    units |= {model.BASE_PARAMETERS[k] + LOAD: found.units.get(model.BASE_PARAMETERS[k], "") for k in friction}
    found = replace(found, units=units)
    place = [found.names.index(f"{family}{LOAD}") for family in unknown]
    sigma = np.where(np.isnan(found.sigma_corrected), found.sigma, np.fmax(found.sigma, found.sigma_corrected))
    return Payload(link, unknown, found.X[place], sigma[place], dict(settings.known), found)


def payload_difference(model: GeneratedModel, without: Estimate, loaded: Estimate, settings: PayloadSettings) -> Payload:
    """The load from two estimates of all base parameters, weighted by the inverse of C_a + C_b."""
    physical = physical_model(model)
    link, unknown, columns, chi_known = carried(physical, settings)
    for fit in (without, loaded):
        if fit.names != physical.base or not np.isfinite(fit.covariance).all():
            raise InputError("the difference needs estimates of all base parameters of the model, each with a full covariance")
    L = np.linalg.cholesky(without.covariance + loaded.covariance)
    dX = loaded.X - without.X - physical.K @ chi_known
    found = _least_squares(np.linalg.solve(L, physical.K[:, columns]), np.linalg.solve(L, dX), unknown)
    sigma = np.sqrt(found.variances())
    for group in found.groups:
        sigma[[unknown.index(name) for name in group]] = np.nan
    return Payload(link, unknown, found.X, sigma, dict(settings.known))


def friction_columns(model: GeneratedModel, physical: PhysicalModel) -> list[int]:
    """Base parameters that are made of viscous and Coulomb friction alone."""
    elements: Mapping[str, Any] = model.ELEMENTS  # type: ignore[attr-defined]
    friction = np.array([name in elements and elements[name][0] in FRICTION for name in physical.standard])
    return [k for k, row in enumerate(physical.K) if not row[~friction].any()]


def carried(physical: PhysicalModel, settings: PayloadSettings) -> tuple[int, tuple[str, ...], list[int], Array]:
    """Link, unknown families with an effect, their columns of K, and the known standard parameters, shape (p,)."""
    link = physical.links[-1] if settings.link is None else settings.link
    if link not in physical.links:
        message = f"no link {link} with inertia; links are {', '.join(map(str, physical.links))}"
        raise SettingsError(message, path=("payload", "link"))
    ten = dict(zip(INERTIAL, physical.link(link), strict=True))
    chi = np.zeros(len(physical.standard))
    for family, value in settings.known.items():
        chi[ten[family]] = value
    unknown = tuple(family for family in INERTIAL if family not in settings.known and physical.K[:, ten[family]].any())
    return link, unknown, [ten[family] for family in unknown], chi


def _least_squares(A: Array, y: Array, names: Sequence[str]) -> Solution:
    return solve(Factor(tuple(names), triangularise(np.column_stack([A, y])), ()), tolerance=1e-10)


def _unit(family: str) -> str:
    return UNITS.get(family, UNITS["MX"] if family.startswith("M") else UNITS["XX"])
