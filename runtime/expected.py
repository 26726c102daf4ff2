"""Estimate the likely error of the torques that the parameters predict for other motions.

Standard deviations of the parameters, and the effect of encoder steps on them, are converted to
torque errors of motions within the range of the robot.

    D       regressor in states of a reference motion: sines of every joint over a part of the range
            and at a part of the speed of the robot file, or of the record if the file has no limits
    C       covariance S C_10 S of least squares with joints weighted by their residuals: C_10 of
            eq. (10), and S the diagonal matrix of corrected over stated standard deviations, times
            a factor for correlations longer than a block
    V       the same, if the fit uses the values of the robot file, known to 30 %:
            (K'C^-1 K + S^-1)^-1 over the standard parameters, X = K chi, S diagonal; the estimate
            of the standard parameters is then chi_V
    a       share of the accelerations that is an error of the encoder's steps
    D_0     D without accelerations

    F a     torques of the laws that the model lacks, dX the change of X with them
            (`runtime.unmodelled`)

    expected^2 = tr(D K V K'D')/||D X||^2 + ||D (X - K chi_V)||^2/||D X||^2
                 + (a/(1 + a))^2 ||(D - D_0) X||^2/||D X||^2 + ||D dX + F a||^2/||D X||^2

The first term is what the record leaves undetermined. The second term is the difference between the
fit and the joint estimate of record and values. The third term is the amount by which the encoder
steps make inertias too small (the encoder resolution of the record:
`runtime.counts.encoder_advice`). The fourth term is what the model lacks; the first two terms are
then multiplied by the share of the squared error that the laws leave. Other effects that the model
lacks are included only as far as they are in the residuals of C.

The squared error of one record is a sum of b squares, a few of which are large: with M = K'D'D K V
it is distributed as chi^2/nu with nu = tr(M)^2/tr(M^2) degrees of freedom. The interval of the
expected error has the first two terms times quantiles of this distribution, the third times two
factors (`STEPS_MOVE`), and the fourth times two others (`LAWS_MOVE`). If one direction is
undetermined, nu is 1; an expected error of 30 % may then be an error of 2 %.

Reference: Satterthwaite (1946) for nu.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import System, assemble
from runtime.core.least_squares.wls import weighted_system
from runtime.core.model import TRANSMITTED, GeneratedModel, channels_of, joint_units
from runtime.core.residuals import unseen_by_blocks
from runtime.core.result import Identification
from runtime.core.rows.prepared import Prepared
from runtime.counts.encoder_advice import acceleration_error
from runtime.ground.check import Answer, Check, Question
from runtime.ground.limits import LIMIT
from runtime.ground.part import Part
from runtime.physical.inertia import INERTIAL, PhysicalModel, physical_model
from runtime.unmodelled import Lacking, depends, friction_columns, lacking_of

EXPECTED_INTERVAL = (0.05, 0.95)
"""Probabilities of the ends of that interval. Measured: benchmarks/truth.md."""
RANGE_ROUNDING = 1e-13
"""Eigenvalues of a scaled matrix that are rounding."""
LAWS_MOVE = (0.6, 1.5)
"""What the laws that the model lacks may do to predictions, over what they are expected to do: ends of the interval. Measured: benchmarks/verdicts.md."""
REFERENCE_RANGE = (0.2, 0.8)
"""Amplitudes of the reference motion over half of the range of a joint. Measured: benchmarks/truth.md."""
REFERENCE_SPEED = (0.1, 0.5)
"""Speeds of the reference motion over the largest of a joint. Measured: benchmarks/truth.md."""
REFERENCE_STATES = 400
"""States of the reference motion."""
STEPS_MOVE = (0.25, 2.0)
"""What the steps of the encoders may do to predictions, over the share of the accelerations that they make: ends of the interval. Measured: benchmarks/truth_classes.py."""
VALUES_KNOWN = 0.3
"""Relative deviation to which the values of a robot file are taken as known, of a link by its mass and its inertia. Measured: benchmarks/truth.md."""

Array = np.ndarray


class Expected(NamedTuple):
    """Expected error of predicted torques, %, with lower and upper limit of its likely range, %."""

    error: float
    low: float
    high: float
    motions: str = ""
    """Which motions it speaks of."""


@Question(
    "How far off are predictions of other motions?",
    f"{LIMIT.EXPECTED_ERROR:g} % (usable where it may be less)",
    "record a motion over the range and speeds for which you need the model, for a longer time, "
    "or with finer positions (symgen excite; signals: {reader: counts})",
    outcome=True,
)
def expected_off(likely: Expected) -> Answer | None:
    """Judge whether the expected error of predicted torques is small enough; None if unknown."""
    if np.isnan(likely.error):
        return None
    limit = LIMIT.EXPECTED_ERROR
    interval = f"{100 * (EXPECTED_INTERVAL[1] - EXPECTED_INTERVAL[0]):g}"
    return Answer(
        "good" if likely.high <= limit else "no" if likely.low > limit else "doubtful",
        f"On {likely.motions}, expect an error of {likely.error:.2g} % of the torques"
        + (
            f" ({interval} % interval {likely.low:.2g} to {likely.high:.2g} %, if the model is right)"
            if likely.low < likely.high
            else ""
        ),
    )


@dataclass(frozen=True, eq=False)
class ExpectedError(Part):
    """Part of the report: the expected error of torques that the final parameters predict."""

    result: Identification

    name = "expected_error"
    title = "Predictions of other motions"
    about = "prediction"

    @property
    def expected_error(self) -> float:
        """Expected error, %, of torques predicted in the joint ranges up to half maximum speed."""
        return self.expected.error

    @cached_property
    def expected(self) -> Expected:
        """Expected error of predicted torques, and the interval in which it is likely to be, %."""
        result = self.result
        if not result.usable:
            return Expected(*3 * (float("nan"),))
        steps = [
            acceleration_error(r.record, r.states, r.study.signals, r.drives)
            for r in result.prepared
            if r.reader.filters_positions
        ]
        system = result.problem.linear_system(result.observation)
        if system.settings.weights == "none":
            system = weighted_system(result.observation, "joint", system.settings.columns)
        return expected_error(
            result.model,
            system,
            result.model_estimate,
            result.prepared,
            max(steps, default=0.0),
            self.lacking,
        )

    @cached_property
    def unseen_error(self) -> float:
        """Error that parameters from other parts of the record may have on one part, %; nan if it
        is not computed.
        """
        return unseen_error(self.result)

    @cached_property
    def lacking(self) -> Lacking | None:
        """Laws of load, position or time that the model lacks; None if nothing can be said."""
        found = self.result.lacking
        return found if found is not None else lacking_of(self.result)

    def checks(self) -> tuple[Check, ...]:
        """Return the questions on what the model lacks, and on the expected error if it is known."""
        lacks = self.lacking and depends(self.lacking, self.result.model)
        return tuple(check for check in (lacks, expected_off(self.expected)) if check)


def expected_error(
    model: GeneratedModel,
    system: System,
    fit: Estimate,
    records: Sequence[Prepared],
    steps: float = 0.0,
    lacking: Lacking | None = None,
) -> Expected:
    """Compute the expected error of torques predicted for other motions, with its interval, %.

    The error is nan if neither the robot file nor the records give a range, if a loop cannot close
    in the range, or if the records lack a signal of the model.

    Parameters
    ----------
    model : GeneratedModel
    system : System
        Rows of the records as linear least squares weighs them, with weights: residuals of a joint
        with large forces do not show the noise of a wrist.
    fit : Estimate
        The parameters that are used.
    records : sequence of Prepared
    steps : float
        Share of the accelerations that is an error of the encoder's steps.
    lacking : Lacking or None
        Laws that the model lacks.
    """
    states = reference_states(model, records)
    if states is None or not has_channels(model, records):
        return Expected(*3 * (float("nan"),))
    try:
        D, still = regressors(model, states, records, fit)
    except ValueError:  # a loop that does not close
        return Expected(*3 * (float("nan"),))
    least_squares = assemble(system, system.solve())
    columns = [model.BASE_PARAMETERS.index(name) for name in least_squares.names]
    D, still = D[:, :, columns], still[:, :, columns]
    X = np.array(
        [dict(zip(fit.names, fit.X, strict=True)).get(name, 0.0) for name in least_squares.names]
    )
    lost_part = 0.0 if lacking is None else lost(lacking, states, D, X, model, least_squares.names)
    K, near, V = determined_by(model, system, least_squares, has_prior(fit))
    D, still = D @ K, still @ K
    if has_prior(fit):
        X = np.linalg.lstsq(K, X, rcond=None)[0]
    A = D.reshape(-1, len(X))
    size = np.linalg.norm(A @ X)
    inertial = np.linalg.norm(A @ X - still.reshape(-1, len(X)) @ X) / size
    spread, nu = undetermined(A, V)
    open_part = (spread + np.sum((A @ (X - near)) ** 2)) / size**2
    if lacking is not None:  # the laws no longer make the deviations larger
        open_part *= lacking.left
    times = np.array([1.0, *(chi2.ppf(p, nu) / nu for p in EXPECTED_INTERVAL)])
    lacks = np.array([1.0, *LAWS_MOVE]) * lost_part / size
    part = np.array([1.0, *STEPS_MOVE]) * inertial * steps / (1 + steps)
    errors = 100 * np.sqrt(open_part * times + part**2 + lacks**2)
    motions = (
        "other motions (over limits.q of the robot file, up to half of limits.qd)"
        if limits_of(model)
        else "other motions (of the range and speeds of this record, since the robot file has no "
        f"{missing_limits(model)})"
    )
    error, low, high = np.minimum(errors, LIMIT.LARGEST_EXPECTED).tolist()
    return Expected(error, low, high, motions)


def has_prior(fit: Estimate) -> bool:
    """Whether a fit uses the values of the robot file."""
    return bool(dict(fit.details.get("options", {})).get("prior", "none") != "none")


def determined_by(
    model: GeneratedModel, system: System, least_squares: Estimate, prior: bool
) -> tuple[Array, Array, Array]:
    """Compute K, and the parameters with covariance V that the rows determine, with or without
    values of the robot file.

    Without the values of the robot file (`prior`), K is the identity and the parameters are X, else
    X = K chi and the parameters are chi_V.
    """
    ratio = least_squares.sigma_corrected / least_squares.sigma
    wider = np.fmax(ratio, 1.0) * np.sqrt(unseen_by_blocks(system.observation, least_squares))
    if not prior:
        V = np.outer(wider, wider) * least_squares.covariance
        return np.eye(len(wider)), least_squares.X, V
    physical = physical_model(model)
    K, rows = physical.rows(least_squares.names), system.weighted
    R = rows.R11 / (wider * (1.0 if system.known_variance else least_squares.sigma_rho))
    return K, *with_values(physical, K, R, R @ least_squares.X)


def undetermined(A: Array, V: Array) -> tuple[float, float]:
    """Compute tr(A V A') and its degrees of freedom nu, for rows A of a regressor."""
    M = A.T @ A @ V
    trace = float(np.trace(M))
    return max(trace, 0.0), max(trace**2 / float(np.sum(M * M.T)), 1.0)


def unseen_error(result: Identification) -> float:
    """Compute how large the error on a part of the record may be, given what the other parts
    determine, %.

    The result is in % of the torques of the part. It combines the upper limit of tr(W V W'), with W
    the rows of the part and V the covariance from the other parts, and the error of the fit. The
    result is inf if the other parts do not determine V, and nan if there are no parts.
    """
    most = float("nan")
    for rest, part in result.held_out:
        system = weighted_system(rest, "joint", result.problem.settings.estimate.columns)
        solution = system.solve()
        if solution.rank < len(system.names):
            return float("inf")
        least_squares = assemble(system, solution)
        K, _, V = determined_by(
            result.model, system, least_squares, has_prior(result.model_estimate)
        )
        if not np.isfinite(V).all():
            return float("inf")
        spread, nu = undetermined(part.columns(system.names).factor.R11 @ K, V)
        upper = spread * chi2.ppf(EXPECTED_INTERVAL[1], nu) / nu
        most = float(np.fmax(most, 100 * np.sqrt(upper) / np.linalg.norm(part.Y)))
    return float(np.hypot(most, result.model_estimate.relative_error))


def lost(
    lacking: Lacking,
    states: tuple[Array, Array, Array],
    D: Array,
    X: Array,
    model: GeneratedModel,
    names: Sequence[str],
) -> float:
    """Compute ||D dX + F a|| in the states, with the laws that the model lacks.

    D : shape (K, n, b), columns of the parameters X of the record.
    """
    q, qd, _ = states
    left, load = D @ lacking.dX, D @ np.where(friction_columns(model, names), 0.0, X)
    for law in lacking.laws:
        left[:, law.j] += law.torque(q[:, law.j], qd[:, law.j], load[:, law.j])
    return float(np.linalg.norm(left))


def has_channels(model: GeneratedModel, records: Sequence[Prepared]) -> bool:
    """Whether every record has the channels of the model that the model does not compute."""
    recorded = [c for c in channels_of(model) if not c.startswith(TRANSMITTED)]
    return not recorded or bool(records and all({*recorded} <= {*r.channels} for r in records))


def regressors(
    model: GeneratedModel,
    states: tuple[Array, Array, Array],
    records: Sequence[Prepared],
    fit: Estimate,
) -> tuple[Array, Array]:
    """Compute D and D_0, the regressors at the states with and without accelerations, (K, n, b).

    A channel, such as a temperature, has random values of the records; a torque that a joint
    transmits is the torque of the other parameters of `fit` at the states.
    """
    q, qd, qdd = states
    rng, channels = np.random.default_rng(0), channels_of(model)
    timed = {
        c: rng.choice(np.concatenate([record.channels[c] for record in records]), len(q))
        for c in channels
        if not c.startswith(TRANSMITTED)
    }
    transmitted = {
        c: model.JOINTS.index(int(c.removeprefix(TRANSMITTED)))
        for c in channels
        if c.startswith(TRANSMITTED)
    }
    laws = {name for c in transmitted for name in channels[c]}
    X = np.array(
        [
            fit[name] if name in fit.names and name not in laws else 0.0
            for name in model.BASE_PARAMETERS
        ]
    )

    def at(qdd: Array) -> Array:
        none = {c: np.zeros(len(q)) for c in transmitted}
        D = np.asarray(model.regressor(q, qd, qdd, **timed, **none))  # type: ignore[arg-type]
        if not transmitted:
            return D
        tau = {c: (D @ X)[:, j] for c, j in transmitted.items()}
        return np.asarray(model.regressor(q, qd, qdd, **timed, **tau))  # type: ignore[arg-type]

    return at(qdd), at(np.zeros_like(qdd))


def with_values(physical: PhysicalModel, K: Array, R: Array, y: Array) -> tuple[Array, Array]:
    """Estimate standard parameters chi from equations R K chi = y and the values of the robot file.

    The rows have errors of variance 1. Parameters without a value are free. Return chi and its
    covariance.
    """
    known = np.array([physical.values.get(name, np.nan) for name in physical.standard])
    deviation = np.abs(known)
    for ten in map(physical.link, physical.links):
        xx, _, _, yy, _, zz, *_, mass = known[ten]
        size, weight = (xx + yy + zz) / 2, mass
        deviation[ten] = [size] * 6 + [np.sqrt(size * weight)] * 3 + [weight]
    chosen = [name.startswith((*INERTIAL, "Ia")) for name in physical.standard]
    given = np.isfinite(deviation) & (deviation > 0) & chosen
    known, precision = np.where(given, known, 0.0), np.zeros(len(known))
    precision[given] = (VALUES_KNOWN * deviation[given]) ** -2.0
    rows = R @ K
    A, g = rows.T @ rows + np.diag(precision), rows.T @ (y - rows @ known)
    d = np.sqrt(np.where(np.diag(A) > 0, np.diag(A), 1.0))
    V = np.linalg.pinv(A / np.outer(d, d), rcond=RANGE_ROUNDING, hermitian=True)
    V = V / np.outer(d, d)
    return known + V @ g, V


def limits_of(model: GeneratedModel) -> tuple[Array, Array] | None:
    """Return joint ranges, shape (n, 2), and largest speeds, shape (n,), of the robot file.

    The result is None if a limit is missing or not finite.
    """
    limits = dict(getattr(model, "LIMITS", {}) or {})
    n = len(model.JOINTS)
    span, speed = (np.asarray(limits.get(key, ()), dtype=float) for key in ("q", "qd"))
    known = span.shape == (n, 2) and speed.shape == (n,) and np.isfinite([*span.T, speed]).all()
    return (span, speed) if known else None


def missing_limits(model: GeneratedModel) -> str:
    """Name the limits that the robot file lacks: "limits", "limits.q" or "limits.qd"."""
    limits = dict(getattr(model, "LIMITS", {}) or {})
    lacking = [f"limits.{key}" for key in ("q", "qd") if not len(np.ravel(limits.get(key, ())))]
    return lacking[0] if len(lacking) == 1 else "limits" if lacking else "finite limits"


def reference_states(
    model: GeneratedModel, records: Sequence[Prepared]
) -> tuple[Array, Array, Array] | None:
    """Make random states q, qd, qdd of sine motions in the range of the robot, shape (K, n) each.

    The result is None if neither the robot file nor a record gives a range.
    """
    n = len(model.JOINTS)
    limits = limits_of(model)
    if limits is None:
        if not records:
            return None
        q = np.concatenate([record.states.q for record in records])
        qd = np.concatenate([record.states.qd for record in records])
        half = np.ptp(q, axis=0) / 2
        speed = np.abs(qd).max(axis=0)
        units = np.array(joint_units(model))
        alike = units[:, None] == units
        half, speed = (
            np.array([max(x[j], np.median(x[alike[j]])) for j in range(n)]) for x in (half, speed)
        )  # a joint that hardly moves: as its neighbours
        middle = (q.max(axis=0) + q.min(axis=0)) / 2
        half, speed = half / REFERENCE_RANGE[1], speed / REFERENCE_SPEED[1]
    else:
        span, speed = limits
        middle, half = span.mean(axis=1), np.ptp(span, axis=1) / 2
    rng, shape = np.random.default_rng(0), (REFERENCE_STATES, n)
    (least, most), (slow, fast) = REFERENCE_RANGE, REFERENCE_SPEED
    a = half * rng.uniform(least, most, shape)
    w = np.minimum(speed * rng.uniform(slow, fast, shape) / np.where(a > 0, a, np.inf), 2 * np.pi)
    phase = rng.uniform(0, 2 * np.pi, shape)
    return middle + a * np.sin(phase), a * w * np.cos(phase), -a * w**2 * np.sin(phase)
