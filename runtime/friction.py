"""Friction curve of each joint: friction torque against velocity, and the law that describes it.

    f_j = Y_j - W_j X without the friction and offset of joint j
            (Y, W decimated, X estimated for all parameters)

    coulomb+viscous   FS s + FV v + OFFSET                                  s = sign(v)
    asymmetric        FSP, FVP forward, FSN, FVN backward
    stribeck          FS s + FV v + OFFSET + FST s exp(-(v/VS)^2)
            FST the excess at standstill, VS its velocity
    load              FS s + FV v + OFFSET + FL s |tau_r|
            tau_r the rigid-body torque that the transmission transmits
    stribeck+load     both

Every term is computed at the rate of the record and decimated like Y, so that the filter rounds
sign(v) on both sides in the same way. Every law contains the first law. All parameters are linear
except VS, which is searched; therefore the F-test of VS is approximate (VS means nothing if FST =
0). Residuals are correlated in time: standard deviations take blocks of time as independent, and
the F-test and Akaike's criterion count N/T samples, with T the correlation time of the residual in
rows. The law is chosen by its error on blocks of time that were not used in its fit. X is not
estimated again: the curve shows the form of the friction, not how the other parameters would
change.

References: Armstrong-Helouvry, Dupont and Canudas de Wit (1994), section 2, for the laws; Hamon,
Gautier and Garrec (2010) for friction that grows with the load.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, cast

import numpy as np
from scipy.optimize import minimize_scalar

from runtime.core.least_squares.block_covariance import block_covariance
from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import percent
from runtime.core.model import GeneratedModel, elements_of, is_axis, joint_labels, require
from runtime.core.problem import Problem
from runtime.core.residuals import correlation_time, p_value, residual_correlation
from runtime.core.result import Identification
from runtime.core.rows.observation import split_rows
from runtime.core.rows.prepared import Prepared
from runtime.core.rows.regressor import in_time
from runtime.core.signals.filters import decimated
from runtime.ground.errors import InputError
from runtime.ground.part import BLACK, BLUE, GREY, LIGHT, ORANGE, Figure, Part
from runtime.ground.table import Table, number
from runtime.physical.inertia import physical_model

FRICTION_BINS = 40
"""Bins of a friction curve."""
INTERVAL = 1.96
"""Half width of a 95 % interval in deviations, deviations."""
LAW_GAIN = 0.01
"""Share by which a law of more terms must lower the held-out error."""
LAW_LEVEL = 0.01
"""Level of the F-test of a law of more terms."""
STRIBECK_FASTEST = 0.5
"""Largest VS that is searched, of the largest speed."""
STRIBECK_GRID = 16
"""Values of VS that are tried first."""
STRIBECK_SLOWEST = 0.005
"""Smallest VS that is searched, of the largest speed."""

Array = np.ndarray

CHOSEN = "What the rest of the model leaves of the torque of each joint, against its velocity. A law with more terms is chosen only if it predicts blocks of time that did not fit it at least 1 % better and passes the F-test, which counts independent samples."

OWN = ("viscous", "coulomb", "offset")  # kinds of elements that make the curve


@dataclass(frozen=True)
class FrictionLaw:
    """One friction law fitted to the friction torque of one joint: parameters, errors and tests.

    Attributes
    ----------
    name : str
    parameters : mapping of str to float
        Values by name, SI.
    sigma : mapping of str to float
        Standard deviations by name, with blocks of time as independent.
    error : float, %
        100 ||f - law|| / ||f|| on all rows.
    held_out : float, %
        The same error on blocks of time that were not used in the fit.
    aic : float
        Akaike's criterion minus that of the first law.
    p_value : float
        p-value of the F-test against the first law; 1 for the first law itself.
    """

    name: str
    parameters: Mapping[str, float]
    sigma: Mapping[str, float]
    error: float
    held_out: float
    aic: float
    p_value: float


@dataclass(frozen=True, eq=False)
class FrictionCurve:
    """Friction of one joint against its velocity, with the fitted friction laws.

    Attributes
    ----------
    joint : str
    v : ndarray, shape (N,), rad/s or m/s
        Velocity at the rows.
    f : ndarray, shape (N,), N m or N
        Friction torque at the rows.
    centre : ndarray, shape (k,), rad/s or m/s
        Mean velocity of each bin.
    mean : ndarray, shape (k,), N m or N
        Mean friction of each bin.
    half : ndarray, shape (k,), N m or N
        Half width of the 95 % confidence interval of the mean.
    laws : tuple of FrictionLaw
        The fitted laws; the first is Coulomb and viscous.
    law_name : str
        Name of the chosen law.
    law_torques : mapping of str to ndarray, shape (k,), N m or N
        Mean torque of each law in each bin, by name of the law.
    """

    joint: str
    v: Array
    f: Array
    centre: Array
    mean: Array
    half: Array
    laws: tuple[FrictionLaw, ...]
    law_name: str
    law_torques: Mapping[str, Array]

    @property
    def law(self) -> FrictionLaw:
        """The friction law chosen for the joint, by its prediction of data not used in the fit."""
        return next(law for law in self.laws if law.name == self.law_name)

    def to_table(self) -> str:
        """Tabulate the laws; add parameters of the chosen law and a note on its Stribeck term."""
        compared, predicting = law_tables([self])
        parts = [compared.to_text(), f"{self.label}: {predicting.rows[0][2]}", self.note]
        return "\n".join(part for part in parts if part)

    @property
    def label(self) -> str:
        """Name of the chosen law; "(no peak)" is added if its Stribeck term FST is negative."""
        return (
            f"{self.law_name} (no peak)"
            if self.law.parameters.get("FST", 1.0) < 0
            else self.law_name
        )

    @property
    def note(self) -> str:
        """Sentence that explains the sign of the Stribeck term FST; empty for a law without it."""
        excess = self.law.parameters.get("FST")
        if excess is None:
            return ""
        if excess > 0:
            return "friction is larger at standstill than in slow motion: the Stribeck effect"
        return "FST is negative: friction falls towards standstill, there is no Stribeck peak; the term bends the curve of viscous friction"

    def summary(self) -> dict[str, Any]:
        """Return the curve and its laws as a mapping for JSON."""
        curve = {"velocity": self.centre, "torque": self.mean, "half_interval": self.half}
        return {
            "joint": self.joint,
            "chosen": self.law_name,
            "note": self.note,
            "laws": self.laws,
            "curve": curve,
        }


@dataclass(frozen=True, eq=False)
class Friction(Part):
    """Friction curves of all joints, a part of the report.

    Attributes
    ----------
    curves : tuple of FrictionCurve
    unit : str
        Unit of the torques.
    """

    curves: tuple[FrictionCurve, ...]
    unit: str = "N m"

    name = "friction"
    title = "Friction curves"

    def text(self) -> str:
        """Explain how a law is chosen, and the sign of its Stribeck term FST for each joint."""
        notes = [f"Joint {curve.joint}: {curve.note}." for curve in self.curves if curve.note]
        return "\n".join([CHOSEN, *notes])

    def brief(self) -> str:
        """Write the laws of every joint as tables of text."""
        return "\n\n".join(curve.to_table() for curve in self.curves)

    def tables(self) -> tuple[Table, Table]:
        """Make a table that compares the laws, and a table of the parameters of the chosen laws."""
        return law_tables(self.curves)

    def figures(self) -> tuple[Figure, ...]:
        """Make the figure of friction torque against velocity."""
        return (friction_figure(self.curves, self.unit),)

    def summary(self) -> list[dict[str, Any]]:
        """Return the curves as a list of mappings for JSON."""
        return [curve.summary() for curve in self.curves]


def friction_figure(curves: Sequence[FrictionCurve], unit: str = "N m") -> Figure:
    """Make the figure of friction torque against velocity, with one plot per joint.

    The figure shows the rows in grey, the bins with their 95 % intervals, the first law and the
    chosen law.
    """
    speed = "m/s" if unit == "N" else "rad/s"
    first: Any = {"color": BLUE, "linewidth": 1.2, "linestyle": "--"}
    bins: Any = {"fmt": "o", "color": BLACK, "markersize": 3, "linewidth": 1.0}

    def draw(curve: FrictionCurve, ax: Any) -> None:
        style: Any = {"color": LIGHT, "markersize": 2, "zorder": 1, "rasterized": True}
        ax.plot(curve.v, curve.f, ".", label="rows", **style)
        ax.errorbar(curve.centre, curve.mean, curve.half, label="bins, 95 %", **bins)
        law = curve.laws[0].name
        torques = curve.law_torques
        for side in (curve.centre < 0, curve.centre >= 0):
            x = curve.centre[side]
            ax.plot(x, torques[law][side], label="Coulomb and viscous", **first)
            if curve.law_name != law:
                chosen = torques[curve.law_name][side]
                ax.plot(x, chosen, color=ORANGE, linewidth=1.4, label="chosen law")
        ax.set(title=f"joint {curve.joint}: {curve.label}")
        ax.set(xlabel=f"velocity, {speed}", ylabel=f"friction, {unit}")
        ax.axhline(0, color=GREY, linewidth=0.6)
        ax.axvline(0, color=GREY, linewidth=0.6)

    return Figure(
        "Friction against velocity",
        "Friction torque against velocity, joint by joint, with laws",
        [partial(draw, curve) for curve in curves],
        name="friction",
        legend=2 * min(2, len(curves)),
    )


def friction(result: Identification) -> Friction:
    """Compute the friction curves of all joints from the result of an identification."""
    if not result.determined:
        raise InputError("the record does not determine the parameters; record a richer motion")
    return Friction(friction_curves(result.problem, result.estimate), result.torque_unit)


def law_tables(curves: Sequence[FrictionCurve]) -> tuple[Table, Table]:
    """Make a table that compares the laws of each joint, and a table of the chosen laws.

    The second table holds the parameters of each chosen law with their standard deviations.
    """
    compared = [
        (
            *(curve.joint, law.name, number(law.error, ".2f"), number(law.held_out, ".2f")),
            *(number(law.aic, "+.1f"), number(law.p_value, ".2g")),
        )
        for curve in curves
        for law in curve.laws
    ]
    laws = [
        (
            *(curve.joint, curve.label),
            ", ".join(
                f"{name} {x:.4g} ± {curve.law.sigma[name]:.2g}"
                for name, x in curve.law.parameters.items()
            ),
        )
        for curve in curves
    ]
    return (
        Table(
            "Laws compared",
            (
                *("joint", "law", "error %", "held-out error %", "AIC against the first"),
                "p of the F-test",
            ),
            compared,
        ),
        Table("Chosen laws, SI", ("joint", "law", "parameters"), laws),
    )


def friction_curves(problem: Problem, fit: Estimate) -> tuple[FrictionCurve, ...]:
    """Compute the friction curve of each joint from an identification problem and its estimate.

    The estimate must contain all parameters.
    """
    problem.require_motion("a friction curve")
    model = problem.model
    require(model, "inverse_dynamics")
    parts = [_terms(model, record, fit, k) for k, record in enumerate(problem.prepared)]
    return tuple(
        _curve(label, joined([part[j] for part in parts]))
        for j, label in enumerate(joint_labels(model))
        if fit.per_joint[j].rows and not is_axis(model.JOINTS[j])
    )


def own_friction(model: GeneratedModel, j: int) -> list[int]:
    """Find the base parameters that contain only friction and offset of joint j (from 0).

    These parameters define the friction curve of the joint.
    """
    physical = physical_model(model)
    elements = elements_of(model)
    of_curve = [name in elements and elements[name][0] in OWN for name in physical.standard]
    others = ~np.array(of_curve)
    structure = np.asarray(model.STRUCTURE)
    alone = structure[:, j] & (structure.sum(axis=1) == 1)
    return [int(k) for k in np.flatnonzero(alone) if not physical.K[k][others].any()]


def _terms(model: GeneratedModel, record: Prepared, fit: Estimate, number: int) -> list[Terms]:
    """Compute the friction torque and the terms of the friction laws, for each joint of one record.
    A term is, for instance, the velocity or its sign.
    """
    selection = record.certain(model)
    observation = record.observation(model)
    window = record.states[selection.samples]
    X = np.array([fit[name] if name in fit.names else 0.0 for name in model.BASE_PARAMETERS])
    block = observation.blocks()
    alone = [own_friction(model, j) for j in range(observation.n)]
    frictionless = X.copy()
    frictionless[[k for columns in alone for k in columns]] = (
        0.0  # each acts on its own joint alone
    )
    transmitted = np.abs(
        cast(Any, model).inverse_dynamics(
            window.q, window.qd, window.qdd, frictionless, **in_time(model, window)
        )
    )

    def at_rows(signal: Array, j: int) -> Array:
        return decimated(signal, selection.factor, selection.signals.decimate)[
            ..., selection.mask[j]
        ]

    terms = []
    for j in range(observation.n):
        rest = X.copy()
        rest[alone[j]] = 0.0
        rows = observation.joint(j)
        v = window.qd[:, j]
        s = np.sign(v)
        signals = {
            "FS": s,
            "FV": v,
            "OFFSET": np.ones_like(v),
            "FSP": (v > 0) * 1.0,
            "FVP": np.maximum(v, 0),
            "FSN": (v < 0) * -1.0,
            "FVN": np.minimum(v, 0),
            "FL": s * transmitted[:, j],
        }

        def excess(VS: float | Array, v: Array = v, j: int = j) -> Array:
            return at_rows(np.sign(v) * np.exp(-((v / np.asarray(VS)[..., None]) ** 2)), j)

        linear = {name: at_rows(signal, j) for name, signal in signals.items()}
        of_record = block[rows] + (number << 32)
        terms.append(
            Terms(
                observation.Y[rows] - observation.W[rows] @ rest,
                linear["FV"],
                of_record,
                linear,
                excess,
            )
        )
    return terms


def _curve(joint: str, terms: Terms) -> FrictionCurve:
    if len(terms.f) < 10 * len(LAWS["stribeck+load"]):
        raise InputError(
            f"only {len(terms.f)} rows of joint {joint}; a friction curve needs more rows: widen "
            "rows.window, or lower rows.low_speed"
        )
    all_rows = np.ones(len(terms.f), dtype=bool)
    even = terms.block % 2 == 0
    fits = {name: fit_law(terms, names, all_rows) for name, names in LAWS.items()}
    first = next(iter(LAWS))
    residuals = {name: terms.f - law_torque(terms, fit) for name, fit in fits.items()}
    squares = {name: float(r @ r) for name, r in residuals.items()}
    count = len(terms.f) / correlation_time(residual_correlation(residuals["stribeck+load"]))
    laws = []
    for name, names in LAWS.items():
        aic = count * np.log(squares[name] / squares[first]) + 2 * (len(names) - len(LAWS[first]))
        laws.append(
            FrictionLaw(
                name,
                fits[name],
                deviations(terms, fits[name], residuals[name]),
                percent(residuals[name], terms.f),
                held_out_error(terms, names, even),
                float(aic),
                p_value(squares[first], squares[name], len(LAWS[first]), len(names), count),
            )
        )
    centre, mean, half, mean_of = _bins(terms)
    torques = {name: mean_of(law_torque(terms, fit)) for name, fit in fits.items()}
    return FrictionCurve(
        joint, terms.v, terms.f, centre, mean, half, tuple(laws), _predicting(laws), torques
    )


def _predicting(laws: Sequence[FrictionLaw]) -> str:
    """Choose the significant friction law that best predicts data not used in its fit.

    Return the name of the law. The law must also predict clearly better than the first law. If no
    law does, the first law is chosen.
    """
    first, *others = laws
    worth = [
        law
        for law in others
        if law.p_value < LAW_LEVEL and law.held_out < (1 - LAW_GAIN) * first.held_out
    ]
    return min(worth, key=lambda law: law.held_out, default=first).name


def _bins(terms: Terms) -> tuple[Array, Array, Array, Callable[[Array], Array]]:
    """Average the friction torque in intervals (bins) of velocity with about equally many samples.

    No bin contains both directions of motion. Returns the centres, the means, the half widths of
    the 95 % intervals, and the function that averages any signal over the bins.
    """
    sides = [terms.v[terms.v < 0], terms.v[terms.v >= 0]]
    shares = [max(round(FRICTION_BINS * len(side) / len(terms.v)), 1) for side in sides]
    inner = [
        np.quantile(side, np.linspace(0, 1, k + 1))
        for side, k in zip(sides, shares, strict=True)
        if len(side)
    ]
    edges = np.unique(np.concatenate([*inner, [0.0]]))
    which = np.clip(np.searchsorted(edges, terms.v, side="right") - 1, 0, max(len(edges) - 2, 0))
    count = np.bincount(which)
    used = np.flatnonzero(count > 1)

    def mean_of(x: Array) -> Array:
        return np.asarray((np.bincount(which, weights=x) / np.maximum(count, 1))[used])

    mean = np.bincount(which, weights=terms.f) / np.maximum(count, 1)
    _, cell = np.unique(which * (terms.block.max() + 1) + terms.block, return_inverse=True)
    sums = np.bincount(cell, weights=terms.f - mean[which])  # of a bin in a block
    bin_of = np.zeros(len(sums), dtype=int)
    bin_of[cell] = which
    variance = (
        np.bincount(bin_of, weights=sums**2, minlength=len(count)) / np.maximum(count, 1) ** 2
    )
    return mean_of(terms.v), mean[used], INTERVAL * np.sqrt(variance[used]), mean_of


@dataclass(frozen=True, eq=False)
class Terms:
    """Friction torque, velocity and terms of the friction laws of one joint, sample by sample.

    Attributes
    ----------
    f : ndarray, shape (N,), N m or N
        Friction torque.
    v : ndarray, shape (N,), rad/s or m/s
        Velocity.
    block : ndarray of int, shape (N,)
        Block of time of each row.
    linear : mapping of str to ndarray, shape (N,)
        Linear terms of the laws, by the name of their parameter.
    excess : function of float to ndarray, shape (N,), or of ndarray, shape (k,), to (k, N)
        The Stribeck term, multiplied by FST, for one value of VS or for several.
    """

    f: Array
    v: Array
    block: Array
    linear: Mapping[str, Array]
    excess: Callable[[float | Array], Array]

    @cached_property
    def grid(self) -> tuple[Array, Array]:
        """Logarithms of trial Stribeck velocities, shape (k,), and the Stribeck terms, (k, N)."""
        x = np.log(
            np.abs(self.v).max() * np.geomspace(STRIBECK_SLOWEST, STRIBECK_FASTEST, STRIBECK_GRID)
        )
        return x, self.excess(np.exp(x))


LAWS: Mapping[str, tuple[str, ...]] = {
    "coulomb+viscous": ("FS", "FV", "OFFSET"),
    "asymmetric": ("FSP", "FVP", "FSN", "FVN"),
    "stribeck": ("FS", "FV", "OFFSET", "FST", "VS"),
    "load": ("FS", "FV", "OFFSET", "FL"),
    "stribeck+load": ("FS", "FV", "OFFSET", "FL", "FST", "VS"),
}


def joined(parts: Sequence[Terms]) -> Terms:
    """Join the friction torque and the terms of one joint from several records."""
    linear = {
        name: np.concatenate([part.linear[name] for part in parts]) for name in parts[0].linear
    }
    _, block = np.unique(np.concatenate([part.block for part in parts]), return_inverse=True)
    f, v = (np.concatenate([getattr(part, name) for part in parts]) for name in ("f", "v"))
    return Terms(
        f, v, block, linear, lambda VS: np.concatenate([part.excess(VS) for part in parts], axis=-1)
    )


def _columns(terms: Terms, names: Sequence[str], VS: float | None) -> Array:
    """Build the matrix whose columns are the terms with linear parameters of a friction law.

    Shape (N, terms).
    """
    return np.column_stack(
        [
            terms.excess(cast(float, VS)) if name == "FST" else terms.linear[name]
            for name in names
            if name != "VS"
        ]
    )


def fit_law(terms: Terms, names: Sequence[str], rows: Array) -> dict[str, float]:
    """Fit the parameters of a friction law to a subset of the samples by least squares.

    VS is searched on a logarithmic axis.
    """
    f = terms.f[rows]
    VS = _excess_velocity(terms, names, rows) if "VS" in names else None
    x = np.linalg.lstsq(_columns(terms, names, VS)[rows], f, rcond=None)[0]
    law = dict(zip((name for name in names if name != "VS"), map(float, x), strict=True))
    return law if VS is None else {**law, "VS": VS}


def _excess_velocity(terms: Terms, names: Sequence[str], rows: Array) -> float:
    """Find the Stribeck velocity VS that gives the least sum of squared residuals of a law.

    With e the part of the Stribeck term that is orthogonal to the other terms, and r the residual
    of the other terms, the Stribeck term reduces the sum of squares by (e'r)^2 / e'e.
    """
    others = _columns(terms, [name for name in names if name not in ("FST", "VS")], None)[rows]
    U, s, _ = np.linalg.svd(others, full_matrices=False)
    Q = U[:, s > s[0] * max(others.shape) * np.finfo(float).eps]
    r = terms.f[rows] - Q @ (Q.T @ terms.f[rows])

    def left(excess: Array) -> Array:
        """Return the change of the sum of squared residuals if the Stribeck term is added.

        The change is zero or negative.

        `excess` has shape (..., N).
        """
        e = excess[..., rows]
        e = e - (e @ Q) @ Q.T
        length = np.sum(e**2, axis=-1)
        taken: Array = np.divide((e @ r) ** 2, length, out=np.zeros_like(length), where=length > 0)
        return -taken

    grid, excesses = terms.grid
    best, step = grid[np.argmin(left(excesses))], grid[1] - grid[0]
    ends = (max(best - step, grid[0]), min(best + step, grid[-1]))
    found = minimize_scalar(
        lambda x: float(left(terms.excess(float(np.exp(x))))),
        bounds=ends,
        method="bounded",
        options={"xatol": 1e-3},
    )
    return float(np.exp(found.x))


def law_torque(terms: Terms, law: Mapping[str, float]) -> Array:
    """Compute the torque of a friction law at all samples, shape (N,), from its parameters."""
    names = tuple(law)
    return np.asarray(
        _columns(terms, names, law.get("VS")) @ [law[name] for name in names if name != "VS"]
    )


def held_out_error(terms: Terms, names: Sequence[str], even: Array) -> float:
    """Compute the prediction error of a friction law, %, on samples not used in its fit.

    The fit to one half of the blocks of time predicts the other half.
    """
    residual = np.empty_like(terms.f)
    for rows in (even, ~even):
        residual[~rows] = (terms.f - law_torque(terms, fit_law(terms, names, rows)))[~rows]
    return percent(residual, terms.f)


def deviations(terms: Terms, law: Mapping[str, float], residual: Array) -> dict[str, float]:
    """Compute the standard deviations of the parameters of a friction law, by name.

    Blocks of time are taken as independent. For VS, the derivative of the law with respect to VS is
    used as its column.
    """
    A = _columns(terms, tuple(law), law.get("VS"))
    if "VS" in law:
        VS, h = law["VS"], 1e-4 * law["VS"]
        A = np.column_stack(
            [A, law["FST"] * (terms.excess(VS + h) - terms.excess(VS - h)) / (2 * h)]
        )
    T = np.linalg.pinv(np.linalg.qr(A, mode="r"))
    blocks = split_rows(np.column_stack([A, residual]), terms.block)
    return dict(
        zip(
            law,
            map(float, np.sqrt(np.diag(block_covariance(blocks, np.zeros(A.shape[1]), T)))),
            strict=True,
        )
    )
