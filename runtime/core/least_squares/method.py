"""Definition of an estimation method: its options, its first least squares, and its fit.

    start = rows(observation, settings, options)     least squares, solved once for every method
    fitted = fit(start)                              the result of the method; None: the start is the result

A new method is a file with a function `fit` and a line in METHODS (`runtime.compose`), the only
place with its name. Other code asks what a Method says of itself: whether it is linear, weighs rows
by joint, simulates the closed loop (`observe`), or gives a physical robot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from runtime.core.least_squares.estimate import Status
from runtime.core.least_squares.linear import LinearOptions, System
from runtime.core.least_squares.solution import Solution
from runtime.core.model import GeneratedModel
from runtime.core.rows.factor import Array
from runtime.core.rows.observation import Observation
from runtime.core.study import EstimateSettings
from runtime.ground.errors import SettingsError
from runtime.ground.settings import Settings, require, structure

OPTIONS = ("estimate", "options")
WEIGHTINGS = ("none", "joint", "iterated", "covariance")


@dataclass(frozen=True, eq=False)
class Beginning:
    """Input of an estimation method: rows, settings, and a least-squares solution to start from.

    Attributes
    ----------
    observation : Observation
        Rows used, with the fitted columns only.
    settings : EstimateSettings
    options : Settings
        Options of the method, checked.
    system : System
        The rows as least squares weighs them.
    solution : Solution
        Solution of that system.
    model : GeneratedModel or None
    """

    observation: Observation
    settings: EstimateSettings
    options: Any
    system: System
    solution: Solution
    model: GeneratedModel | None


@dataclass(frozen=True, eq=False)
class Fitted:
    """Output of an estimation method: the weighted rows, the solution and its uncertainty.

    Attributes
    ----------
    system : System
        Rows with the final weights of the method.
    solution : Solution
        Solution with the X of the method.
    covariance : ndarray, shape (b, b), or None
        Covariance of X; default: eq. (10) of `system`.
    corrected : callable or None
        Function that computes the standard deviations, shape (b,), without the assumption of
        independent residuals; default: those of `system`. Trials do not call it.
    status, message : str
        Outcome, if the rows are good.
    details : mapping
    """

    system: System
    solution: Solution
    covariance: Array | None = None
    corrected: Callable[[], Array] | None = None
    status: Status = "ok"
    message: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Method:
    """One estimation method that the setting estimate.method can name.

    Attributes
    ----------
    options : type
        Settings class of estimate.options.
    rows : callable
        Function that weighs the rows for the least squares from which the method starts.
    fit : callable or None
        Function that computes the result of the method from this start; None: the result is that of
        the least squares, which need no single row.
    weights : tuple of str
        Values of estimate.weights that the method accepts.
    observe : callable or None
        Function that makes the rows of a problem, for a method that needs rows of its own, such as
        one that simulates the closed loop of the records; None: the rows of the measured positions.
    brief : mapping
        Options of the method that give the estimate alone, such as {"explain": False}.
    any_rank : bool
        Whether the method gives an estimate if the rows do not determine all parameters.
    physical : bool
        Whether its estimates are those of a physical robot; the first such method of a list fits
        the physical set of an identification (`runtime.core.parameter_sets`).
    rounding : str
        Sentence of the method on a study that rounds recorded positions (CESTAC), with {method} for
        its name; "" if no sentence is needed.
    intervals : str
        What is known of its 95 % intervals if they do not hold 95 % of the true values; "" if they do.
    """

    options: type[Settings]
    rows: Callable[[Observation, EstimateSettings, LinearOptions], System]
    fit: Callable[[Beginning], Fitted] | None = None
    weights: tuple[str, ...] = WEIGHTINGS
    observe: Callable[[Any], Observation] | None = None
    brief: Mapping[str, Any] = field(default_factory=dict)
    any_rank: bool = False
    physical: bool = False
    rounding: str = ""
    intervals: str = ""

    @property
    def linear(self) -> bool:
        """Whether the result is that of one least squares, so that eqs. (7) to (11) hold."""
        return self.fit is None

    @property
    def weighs(self) -> bool:
        """Whether the method accepts weights by joint."""
        return "joint" in self.weights

    def checked(self, settings: EstimateSettings) -> Any:
        """Check options and weights of the settings for this method, and return the options.

        Raise SettingsError if they do not suit the method.
        """
        message = (
            f"{settings.weights!r} with method {settings.method}; expected "
            f"{' or '.join(self.weights)}, since this method has its own weights or none; other "
            "weights need method wls"
        )
        require(settings.weights in self.weights, message, "estimate", "weights")
        return structure(self.options, settings.options, OPTIONS)

    def system(self, observation: Observation, settings: EstimateSettings) -> System:
        """Build the weighted least-squares system from which the method starts."""
        options = self.checked(settings)
        if not isinstance(options, LinearOptions):
            given = getattr(options, "linear", {})
            options = structure(LinearOptions, given, (*OPTIONS, "linear"))
        return self.rows(observation, settings, options)


Methods: TypeAlias = Mapping[str, Method]
"""Methods of estimation by the name that estimate.method gives them (METHODS of `compose`)."""


def method_of(settings: EstimateSettings, methods: Methods) -> Method:
    """Return the method of estimation that `settings` names; raise SettingsError if it is unknown."""
    if settings.method not in methods:
        raise SettingsError(
            f"unknown method {settings.method!r}; expected {' or '.join(methods)}",
            path=("estimate", "method"),
        )
    return methods[settings.method]


def linear_companion(settings: EstimateSettings, methods: Methods) -> EstimateSettings:
    """Replace a method that is not linear by linear least squares with the same weights.

    The companion is the first linear method that accepts these weights. A linear method stays as it
    is. Weights and columns stay the same. Essential parameters and weak directions of a method that
    is not linear are those of its companion.
    """
    if method_of(settings, methods).linear:
        return settings
    companion = linear_method(settings.weights, methods)
    return EstimateSettings(companion, settings.weights, settings.columns)


def linear_method(weights: str, methods: Methods) -> str:
    """Return the name of the first linear method that accepts these weights."""
    return next(
        name for name, method in methods.items() if method.linear and weights in method.weights
    )


def linear_system(observation: Observation, settings: EstimateSettings, methods: Methods) -> System:
    """Weigh the rows Y = W X + rho for the linear companion of the method that `settings` names."""
    linear = linear_companion(settings, methods)
    return method_of(linear, methods).system(observation, linear)
