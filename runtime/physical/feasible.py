"""Method feasible: least squares over the parameters that a physical robot can have.

    min ||R (z - K chi)||^2/||Y||^2 + weight D(chi)      subject to
            P_j(chi) >= margin S_j, forms >= margin 1, Ia, FV, FS >= margin, limits
    X = K chi                                    R z = Q'Y, W = Q R

W is factored once, and b rows enter the semidefinite program (`runtime.physical.semidefinite`); the
conditions are those of `runtime.physical.inertia`. All base parameters are fitted, essential or
not, because a condition connects all parameters of a link. With the columns of only some
parameters, the others would be free to take any values that make a physical robot. `weights`
weights the rows as for ols ("none") and wls. Without a prior, the least-squares solution is the
result if it is feasible.

options (also all options of `runtime.physical.feasibility.RobotLimits`):
    margin     smallest eigenvalue of every condition: for a link with values in the robot file,
               as share of its second moment and mass there (S_j); for others, in SI; 1e-6
    prior      none | euclidean: distance D of the inertial parameters from the values of the robot
               file; "auto": euclidean if the file has values of links, else none
    weight     weight of D, a number; "held-out": the weight with which four fifths of the record in
               time predict the left-out fifth best (product of the five errors); "auto": the largest, to half a decade, that
               raises the residual norm by at most 1 %
    reach      size of the robot, m, which bounds masses and their centres; "auto": from its frames
               if these show the size; null: no such bounds
    explain    whether to name every condition that least squares breaks; true
    linear     options of the least squares that starts the method: rank_tolerance, block

sigma and covariance are those of least squares without conditions, eq. (10): no such formula exists
for estimates on the boundary of a cone. `sigma_corrected` of a parameter is

    sqrt(s^2 + (X - X_0)^2)       X_0, s: least squares and its standard deviation by blocks of time

Conditions that hold and a correct prior move X nearer to the truth than X_0. A wrong prior moves it
away from the truth, by X - X_0 at most. If s is correct, such an interval contains the truth at
least as often as stated, whatever the prior. Resampled records would not show this: estimates that
end at the same limit, or at the value of the file, do not scatter. `details` lists the active
conditions.

Reference: Sousa and Cortesao (2014); Wensing, Kim and Slotine (2018).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, field, replace
from typing import Any, Literal

import numpy as np

from runtime.core.least_squares.linear import System, assemble, percent
from runtime.core.least_squares.method import Beginning, Fitted, Method
from runtime.core.least_squares.wls import by_weights
from runtime.core.model import GeneratedModel
from runtime.core.rows.factor import Array, Factor, triangularise
from runtime.core.rows.observation import Observation
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import limits
from runtime.ground.progress import at
from runtime.ground.settings import Flag, NotNegative, Positive, require
from runtime.physical.feasibility import (
    Feasibility,
    RobotLimits,
    feasibility,
    known_inertia,
    limit_rows,
    nearest_standard,
    pull_to_file,
    units,
    unsolved,
)
from runtime.physical.inertia import PhysicalModel, physical_model, reach_of
from runtime.physical.semidefinite import Distance, LinearBounds, Optimum, closest, everything

LIMIT = limits(__package__)

WEIGHTS = 10.0 ** np.arange(0.0, -9.5, -0.5)
DECADES = WEIGHTS[::2]  # of the search for the weight of smallest held-out error


class FeasibleOptions(RobotLimits):
    """Options (estimate.options) of method feasible, in addition to those of `RobotLimits`.

    Attributes
    ----------
    margin : float
        Smallest eigenvalue of every condition: for a link with values in the robot file, as share
        of its second moment and mass in this file; for others, in SI.
    prior : str
        Distance D of the inertial parameters from the values of the robot file: none or euclidean;
        auto: euclidean if the file has values of links, else none.
    weight : float or str
        Weight of D; held-out: the weight with which four fifths of the record in time predict the
        left-out fifth best; auto: the largest, to half a decade, that raises the residual norm by
        at most 1 %.
    reach : float, str or None, m
        Size of the robot: no centre of mass lies further from the origin of its frame, and all
        links together weigh less than a fifth of the water in a cube of that side, unless
        `total_mass` or `bounds` give masses. auto: from the frames of the robot, if at least two
        links have a length, prismatic joints have limits, and the record does not contradict the
        bounds; null: no such bounds.
    explain : bool
        Whether to name every condition that least squares breaks; false: only the parameters are
        computed, in a third of the time.
    linear : mapping
        Options of the least squares that starts the method: rank_tolerance, block.
    """

    margin: Positive = 1e-6
    prior: Distance | Literal["auto"] = "auto"
    weight: NotNegative | Literal["auto", "held-out"] = "held-out"
    reach: Positive | Literal["auto"] | None = "auto"
    explain: Flag = True
    linear: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        message = f"{self.weight} with prior: none; set prior: euclidean"
        require(self.prior != "none" or isinstance(self.weight, str), message, "weight")


def fit(start: Beginning) -> Fitted:
    """Fit the base parameters by least squares under the conditions of a physical robot.

    `details` holds the standard parameters, the smallest eigenvalue of each condition, and the
    least-squares estimate.
    """
    if start.model is None:
        raise InputError("method feasible needs the model, since it groups the parameters by link")
    observation = start.observation
    system = start.system
    free = start.solution
    physical = physical_model(start.model)
    options = decide_options(start.options, start.model, physical)
    guess = reach_text(options) if start.options.reach == "auto" else ""
    without_prior = None
    if guess:
        open_options = decide_options(replace(start.options, reach=None), start.model, physical)
        unbounded, bounded = by_reach(system.weighted, physical, open_options, options)
        without_prior = bounded
        if bounds_contradict(system.weighted, physical, unbounded, bounded):
            options = open_options
            without_prior = unbounded
            guess += " The record contradicts these values, so they are not used."
    unconstrained = None
    if options.explain or options.prior == "none":
        unconstrained = within_limits(physical, system.names, free.X, options)
    if (
        options.prior == "none"
        and unconstrained is not None
        and unconstrained.feasible
        and unconstrained.margin >= options.margin
    ):
        X = free.X
        chi = unconstrained.chi
        weight = 0.0
    else:
        searched = options
        if options.prior != "none" and options.weight == "held-out":
            found = held_out_weight(observation, system, physical, options)
            searched = replace(options, weight=found)
        known = isinstance(searched.weight, float)
        weighted = f", weight of the prior {searched.weight:g}" if known else ""
        at(f"fitting physical parameters{weighted}")
        chi, weight = solve_with_weight(system.weighted, physical, searched, without_prior)
        X = physical.rows(system.names) @ chi
    if weight == 0:  # nothing was pulled: chi is one of many
        chi = nearest_standard(physical, system.names, X, chi, options)
    smallest = physical.smallest(chi)
    limit = LIMIT.ACTIVE_CONDITION * options.margin
    active = [name for name, value in smallest.items() if value < limit]
    method = "ols" if start.settings.weights == "none" else "wls"
    residual, measured = system.norms(free.X)
    without = percent(residual, measured)
    given = percent(system.norms(X)[0], measured)
    details = {
        "standard": physical.named(chi),
        "smallest_eigenvalues": smallest,
        "active": active,
        "options": asdict(options),
        "weight": weight,
        "least_squares": {
            "method": method,
            **conditions_of(unconstrained),
            "relative_error": without,
            "residual_norm": float(np.linalg.norm(residual)),
            "X": free.X,
        },
    }
    violated = min(smallest.values()) < 0
    failure = "The solver left a condition violated: try another margin, a prior, or bounds on the masses."
    judgement = f"Least squares ({method}) is {unconstrained.text}. " if unconstrained else ""
    parts = (
        failure if violated else "",
        f"{judgement}With the conditions the relative error is {given:.3f} % instead of {without:.3f} %; at their limit: {', '.join(active) or 'none'}.",
        prior_text(physical, options, weight),
        guess,
    )
    return Fitted(
        system,
        replace(free, X=X, residual_norm=residual_norm(system.weighted, X)),
        corrected=lambda: np.hypot(assemble(system, free).sigma_corrected, X - free.X),
        status="not-converged" if violated else "ok",
        message=" ".join(part for part in parts if part),
        details=details,
    )


def conditions_of(judged: Feasibility | None) -> dict[str, Any]:
    """Return the physical conditions that least squares violates, for JSON; {} if not checked."""
    if judged is None:
        return {}
    blocking = [{"condition": name, "margin": t} for name, t in judged.blocking]
    return {"feasible": judged.feasible, "margin": judged.margin, "blocking": blocking}


def within_limits(
    physical: PhysicalModel, names: Sequence[str], X: Array, options: FeasibleOptions
) -> Feasibility:
    """Check whether base parameters X are physical and, if so, within the limits of the robot.

    The two checks are separate because the limits are known or guessed values of a robot, not
    physics.
    """
    judged = feasibility(physical, names, X, blame=options.explain)
    named = dict.fromkeys(limit_rows(physical, options).names)
    if not judged.feasible or not named:
        return judged
    try:
        bounded = feasibility(physical, names, X, options, blame=False)
    except InputError:
        bounded = replace(judged, feasible=False)
    blocking = () if bounded.feasible else tuple((name, bounded.margin) for name in named)
    return replace(bounded, physical=True, blocking=blocking)


def solve_with_weight(
    rows: Factor,
    physical: PhysicalModel,
    options: FeasibleOptions,
    without_prior: Array | None = None,
) -> tuple[Array, float]:
    """Find the standard parameters chi, and the weight with which robot file values act as prior.

    rows : the factored system. without_prior : chi of weight 0, if it is known. Returns chi, shape
    (p,), and the weight.
    """
    if options.prior == "none":
        if without_prior is None:
            without_prior = solve_feasible(rows, physical, options, 0.0)
        return without_prior, 0.0
    if not isinstance(options.weight, str):
        return solve_feasible(rows, physical, options, options.weight), options.weight
    K = physical.rows(rows.names)
    free = (
        without_prior if without_prior is not None else solve_feasible(rows, physical, options, 0.0)
    )
    allowed = LIMIT.WEIGHT_INCREASE * residual_norm(rows, K @ free)
    for weight in map(float, WEIGHTS):
        try:
            chi = solve_feasible(rows, physical, options, weight)
        except SettingsError:
            raise
        except InputError:  # as in `held_out_weight`
            continue
        if residual_norm(rows, K @ chi) <= allowed:
            return chi, weight
    return free, 0.0


def held_out_weight(
    observation: Observation, system: System, physical: PhysicalModel, options: FeasibleOptions
) -> float:
    """Choose the weight of the prior with which a fit best predicts data not used in this fit.

    Four fifths of the record predict the other fifth, five times; the product of the five errors is
    smallest. A sum of the errors would be decided by a fifth that alone determines a parameter,
    since the other fifths predict it badly unless the prior is strong. If two weights are equally
    good, the larger is chosen. A weight is abandoned as soon as it cannot be the best, since no
    prediction error is below the error of least squares on the same fifth.
    """
    folds = observation.columns(system.names).fold_factors(LIMIT.HELD_OUT_PARTS)
    parts = [part.weighted(1 / np.array(system.scales)) for part in folds]
    others = [
        Factor(system.names, triangularise(np.vstack([o.R for o in parts if o is not part])), ())
        for part in parts
    ]

    def logarithm(part: Factor, error: float) -> float:
        """Logarithm of an error norm, which is at least that of rounding."""
        measured = float(np.hypot(np.linalg.norm(part.r12), part.r22))
        return float(np.log(max(error, LIMIT.EXACT_FIT * measured, np.finfo(float).tiny)))

    least = np.cumsum([logarithm(part, part.r22) for part in parts][::-1])[
        ::-1
    ]  # of this part and those after it
    K = physical.rows(system.names)

    at("choosing the weight of the prior by cross-validation")

    def error(weight: float, best: float) -> float:
        fixed, product = replace(options, weight=weight), 0.0
        try:
            for rows, part, left in zip(others, parts, least, strict=True):
                if product + left > best:
                    return float("inf")
                chi, _ = solve_with_weight(rows, physical, fixed)
                product += logarithm(part, residual_norm(part, K @ chi))
        except SettingsError:
            raise
        except InputError:  # a weight by which the program is too badly scaled for the solver
            return float("inf")
        return product

    chosen = 0.0
    best = float("inf")
    for weight in map(float, (0.0, *DECADES[::-1])):
        product = error(weight, best)
        if product <= best:
            chosen = weight
            best = product
    return chosen


def decide_options(
    options: FeasibleOptions, model: GeneratedModel, physical: PhysicalModel
) -> FeasibleOptions:
    """Replace the value "auto" of the prior and of the bounds by settings for this robot.

    The size of the robot gives two bounds: no centre of mass lies further from the origin of its
    frame, along any axis, and all links together weigh less than a fifth of the water in a cube of
    that side.
    """
    prior = (
        ("euclidean" if known_inertia(physical) else "none")
        if options.prior == "auto"
        else options.prior
    )
    message = (
        f"{options.weight}, but {model.NAME} has no inertial values of links; give these values "
        "in the robot file, or remove this key"
    )
    require(
        prior != "none" or isinstance(options.weight, str), message, "estimate", "options", "weight"
    )
    reach = reach_of(model) if options.reach == "auto" else options.reach
    if reach is None or not np.isfinite(reach):
        return replace(options, prior=prior, reach=None)
    masses = [f"M{j}" for j in physical.links]
    said = options.total_mass is not None or any(name in options.bounds for name in masses)
    box = ((-reach, reach),) * 3
    own = {str(j): box for j in physical.links if str(j) not in options.ellipsoid}
    return replace(
        options,
        prior=prior,
        reach=reach,
        total_mass=options.total_mass if said else (0.0, LIMIT.ROBOT_DENSITY * reach**3),
        centre={**own, **options.centre},
    )


def reach_text(options: FeasibleOptions) -> str:
    """Write a sentence on bounds of mass and centre of mass that the robot size gives, if any."""
    if options.reach is None or options.reach == "auto":
        return ""
    mass = options.total_mass[1] if isinstance(options.total_mass, tuple) else np.inf
    total = f", {mass:.3g} kg in all" if mass == LIMIT.ROBOT_DENSITY * options.reach**3 else ""
    return (
        f"Masses and their centres are bounded by the size of the robot, {options.reach:.2g} m by "
        f"its frames{total}: a guess, not physics; set reach, or reach: null for none."
    )


def by_reach(
    rows: Factor, physical: PhysicalModel, unbounded: FeasibleOptions, bounded: FeasibleOptions
) -> tuple[Array | None, Array | None]:
    """Fit the standard parameters chi twice: without and with bounds guessed from the robot size.

    The bounds are on masses and centres of mass. No prior is used. Returns both vectors chi; None
    for a fit without solution, for instance if no robot is within the bounds.
    """
    found: list[Array | None] = []
    for asked in (unbounded, bounded):
        options = replace(asked, prior="none", weight="auto")  # a weight is of a prior
        try:
            found.append(solve_feasible(rows, physical, options, 0.0))
        except InputError:
            found.append(None)
    return found[0], found[1]


def bounds_contradict(
    rows: Factor, physical: PhysicalModel, unbounded: Array | None, bounded: Array | None
) -> bool:
    """Whether mass and centre-of-mass bounds guessed from the robot size contradict the record.

    The bounds contradict the record if they raise the residual norm by more than a small factor
    (WEIGHT_INCREASE in limits.toml), or if no robot is within the bounds.
    """
    if unbounded is None or bounded is None:
        return unbounded is not None
    K = physical.rows(rows.names)
    without = residual_norm(rows, K @ unbounded)
    within = residual_norm(rows, K @ bounded)
    return bool(within > LIMIT.WEIGHT_INCREASE * without)


def prior_text(physical: PhysicalModel, options: FeasibleOptions, weight: float) -> str:
    """Write a sentence on the prior (values of the robot file): kind, weight, missing values."""
    if options.prior == "none":
        return ""
    missing = len(physical.links) * 10 - len(known_inertia(physical))
    some = f" ({missing} parameters of links have no value and stay free)" if missing else ""
    return f"Values of the robot file as prior, {options.prior}, weight {weight:g}{some}."


def solve_feasible(
    rows: Factor, physical: PhysicalModel, options: FeasibleOptions, weight: float
) -> Array:
    """Find the standard parameters chi, shape (p,), of the best fit under the physical conditions.

    For a factored system, chi minimises ||R (z - K chi)||^2 / ||Y||^2 + weight D(chi).
    """
    size = float(np.hypot(np.linalg.norm(rows.r12), rows.r22)) or 1.0
    R, z = rows.R11 @ physical.rows(rows.names) / size, rows.r12 / size
    bounds, space = limit_rows(physical, options), everything(units(physical))
    pull = pull_to_file(physical, "none" if options.prior == "auto" else options.prior, weight)

    def attempt(within: LinearBounds) -> Optimum:
        return closest(R, z, physical.conditions, within, space, least=options.margin, pull=pull)

    optimum = attempt(bounds)
    if not optimum.solved:
        raise InputError(unsolved(optimum.status, bounds, attempt))
    return optimum.chi


def residual_norm(rows: Factor, X: Array) -> float:
    """Compute ||Y - W X|| from the QR factor of the system Y = W X + rho."""
    return float(np.hypot(rows.r22, np.linalg.norm(rows.R11 @ X - rows.r12)))


METHOD = Method(
    FeasibleOptions, by_weights, fit, brief={"explain": False}, any_rank=True, physical=True
)
"""The method `feasible`."""
