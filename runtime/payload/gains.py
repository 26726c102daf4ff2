"""Torque constants of the drives, estimated from a load of known mass.

Let v be the torque of a record, computed with the torque constants of the robot file; the true
torque is g v, with a factor g for each motor. V holds the share of every motor in the torque of
every joint (block diagonal without coupling); the index a means without the load, b with the load:

    [[V_a, -W_a, 0, 0], [V_b, -W_b, -W_Lu, -W_Lk chi_Lk]] [g; X; chi_Lu; 1] = 0

    together   W and the load's columns are exact, V is noisy: total least squares with exact
               columns. With Q a basis of the exact columns and D the standard deviations of the
               columns of V, g ~ D^-1 times the smallest right singular vector of (V - Q Q'V) D^-1;
               the last entry gives the size.
    per joint  v_j = W_j (X/g_j) + W_Lu (chi_Lu/g_j) + W_Lk chi_Lk (1/g_j): one least squares per
               motor, noise on the left side alone; drives without coupling only.

The reported load is computed from the torques times g; its standard deviations include those of g.

If the torque of a motor does not change with the load, its gain is not determined: the standard
deviation is then large, and the gain is refused. Without a weighed load no record separates g from
X.

Reference: Gautier and Briot (2011), global identification of drive gains and dynamic parameters;
identification.md 5.8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr
from scipy.optimize import nnls

from runtime.core.drives import Drives
from runtime.core.least_squares.block_covariance import gram_root, scatter
from runtime.core.least_squares.linear import LinearOptions, assemble, ordinary
from runtime.core.model import GeneratedModel, joint_labels
from runtime.core.rows.factor import triangularise
from runtime.core.rows.observation import Observation, split_rows, stack
from runtime.core.rows.prepared import Prepared, decimated_torque
from runtime.core.study import EstimateSettings
from runtime.ground.documents import Result
from runtime.ground.errors import InputError
from runtime.ground.limits import limits
from runtime.ground.table import Table, number
from runtime.payload.load import load_columns
from runtime.payload.settings import PayloadSettings
from runtime.physical.inertia import physical_model

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class DriveGains(Result, keys="joints constant together sigma alone sigma_alone refused"):
    """Correction factors g of the torque constants of the motors, estimated by two methods.

    A factor is nan if a method cannot estimate it.

    Attributes
    ----------
    joints : tuple of str
    constant : ndarray, shape (n,), N m/A or N m/V
        Torque constants with which the records were read, of the records or of the robot file.
    together : ndarray, shape (n,)
        g by total least squares over all joints.
    sigma : ndarray, shape (n,)
        Standard deviation of `together`, from resampled blocks of time.
    alone : ndarray, shape (n,)
        g of each motor by least squares on its own joint.
    sigma_alone : ndarray, shape (n,)
        Standard deviation of `alone`.
    sigma_load : ndarray, shape (u,)
        Standard deviations of the unknown parameters of the load, including those of g.
    """

    joints: tuple[str, ...]
    constant: Array
    together: Array
    sigma: Array
    alone: Array
    sigma_alone: Array
    sigma_load: Array

    @property
    def factors(self) -> Array:
        """Correction factors g of the torque constants, shape (n,); 1 if not estimated."""
        return np.where(np.isfinite(self.together), self.together, 1.0)

    @property
    def refused(self) -> tuple[str, ...]:
        """Motors whose factor g is not determined, since the standard deviation of g is too large.

        The %sigma of g is too large (GAIN_REFUSED in limits.toml or more). The factor is that of
        the joint solution `together`.
        """
        return tuple(
            j
            for j, g, s in zip(self.joints, self.together, self.sigma, strict=True)
            if not 100 * s < LIMIT.GAIN_REFUSED * abs(g)
        )

    @property
    def text(self) -> str:
        """Sentence that says which torque constants the load does not determine, if any."""
        if not self.refused:
            return (
                "the load determines every gain. The parameters of the load use these gains, but "
                "those of the robot do not: set record.torque_constant to these constants and "
                "identify the robot again"
            )
        return (
            "REFUSED, the load does not change their torque enough (%sigma from "
            f"{LIMIT.GAIN_REFUSED:g}): motor {', '.join(self.refused)}"
        )

    def table(self) -> Table:
        """Return the table of the correction factors, with one line per motor."""
        columns = (self.together, self.sigma, self.alone, self.sigma_alone)
        return Table(
            "Factors on the torque constants by which the records were read",
            ("motor", "together", "sigma", "alone", "sigma", "torque constant"),
            [
                (
                    *(joint, *(number(x, ".5g") for x in row)),
                    "refused" if joint in self.refused else f"{constant * row[0]:.6g}",
                )
                for joint, constant, *row in zip(self.joints, self.constant, *columns, strict=True)
            ],
        )

    def to_table(self) -> str:
        """Return the table of the correction factors as text."""
        return self.table().to_text()


def drive_gains(
    model: GeneratedModel,
    without: Sequence[Prepared],
    loaded: Sequence[Prepared],
    settings: PayloadSettings,
    *,
    seed: int = 1,
) -> DriveGains:
    """Estimate correction factors of the torque constants, from records with and without a load.

    Parameters
    ----------
    without, loaded : sequence of Prepared
        Records without and with the load, joint side.
    settings : PayloadSettings
        Where the load is fixed, and its mass, which must be known.
    seed : int
        Seed of the resampling.
    """
    if not without or not loaded or "M" not in settings.known:
        raise InputError(
            "drive gains need a record without the load, a record with the load, and the weighed "
            "mass of the load (payload.known: {M: ...})"
        )
    drives = _drives(model)
    constants = []
    for reading in (*without, *loaded):
        constant = reading.record.origin.torque_constant
        constants.append(drives.torque_constant if constant is None else constant)
    if any(not np.array_equal(constant, constants[0]) for constant in constants):
        raise InputError(
            "the records were read with different torque constants; give all records "
            "the same record.torque_constant, since one factor per motor is estimated for all records"
        )
    observation = stack(
        [
            _with_load(
                model,
                _with_motors(model, reading, drives),
                settings,
                mounted,
            )
            for records, mounted in ((without, 0.0), (loaded, 1.0))
            for reading in records
        ]
    )
    n = drives.n
    exact = observation.W[:, : -n - 1]
    load = observation.W[:, -n - 1]
    V = observation.W[:, -n:]
    deviations, alone, sigma_alone = _alone(observation, exact, load, drives)
    together, sigma = _together(observation, exact, load, V, deviations, drives, seed)
    return DriveGains(
        joint_labels(model),
        np.asarray(constants[0]),
        together[:n],
        sigma[:n],
        alone,
        sigma_alone,
        sigma[n + len(model.BASE_PARAMETERS) :],
    )


def _drives(model: GeneratedModel) -> Drives:
    return Drives.from_mapping(model.DRIVES or {"ratio": np.eye(len(model.JOINTS))})


def _with_motors(model: GeneratedModel, record: Prepared, drives: Drives) -> Observation:
    """Extend W of a record by one column per motor: the torque of this motor on each joint."""
    selection = record.certain(model)
    observation = record.observation(model)
    motor = drives.motor_command(record.record.torque) * drives.torque_constant
    mask = selection.mask.ravel()
    shares = [
        decimated_torque(motor[:, [m]] * drives.ratio[m], selection).ravel()[mask]
        for m in range(drives.n)
    ]
    names = (*observation.names, *(f"motor {m + 1}" for m in range(drives.n)))
    return replace(
        observation, W=np.asfortranarray(np.column_stack([observation.W, *shares])), names=names
    )


def _with_load(
    model: GeneratedModel, observation: Observation, settings: PayloadSettings, mounted: float
) -> Observation:
    """Insert the columns of the load into W, before the columns of the motors.

    Order: W, W_Lu, torque of the known part of the load, motors. The columns of the load are zero
    if it is not mounted.
    """
    load = load_columns(model, physical_model(model), settings)
    b = len(model.BASE_PARAMETERS)
    W = observation.W[:, :b]
    V = observation.W[:, b:]
    columns = [W, mounted * (W @ load.columns), mounted * (W @ load.torque), V]
    names = (
        *observation.names[:b],
        *(f"{family} of the load" for family in load.unknown),
        "known load",
        *observation.names[b:],
    )
    return replace(observation, W=np.asfortranarray(np.column_stack(columns)), names=names)


def _alone(
    observation: Observation, exact: Array, load: Array, drives: Drives
) -> tuple[Array, Array, Array]:
    """Estimate the correction factor g of each motor by least squares on the rows of its joint.

    Returns the standard deviation of the torque residual of every joint, g, and the standard
    deviation of g. g is 1/(coefficient of the known load), and nan if motors are coupled.
    """
    n = observation.n
    deviation = np.ones(n)
    gain = np.full(n, np.nan)
    sigma = np.full(n, np.nan)
    coupled = drives.ratio != np.diag(np.diag(drives.ratio))
    for j in range(n):
        rows = observation.joint(j)
        A = np.column_stack([exact[rows], load[rows]])
        used = [k for k in range(A.shape[1]) if A[:, k].any()]
        names = tuple(observation.names[k] for k in used)
        of_joint = Observation(
            np.asfortranarray(A[:, used]),
            observation.Y[rows],
            observation.rows[j : j + 1],
            names,
            observation.t[rows],
            observation.record[rows],
            observation.rate,
            motion=None if observation.motion is None else observation.motion[rows],
        )
        factored = ordinary(of_joint, EstimateSettings(), LinearOptions())
        fit = assemble(factored, factored.solve())
        deviation[j] = fit.sigma_rho
        if "known load" in names and not coupled[j].any() and not coupled[:, j].any():
            k = names.index("known load")
            gain[j] = 1 / fit.X[k]
            sigma[j] = max(fit.sigma[k], fit.sigma_corrected[k]) * gain[j] ** 2
    return deviation, gain, sigma


def _together(
    observation: Observation,
    exact: Array,
    load: Array,
    V: Array,
    deviation: Array,
    drives: Drives,
    seed: int,
) -> tuple[Array, Array]:
    """Estimate motor factors g, X and the load by total least squares, over all joints together.

    Only the motor torques have errors. g : factors of the torque constants. Returns the values and
    their standard deviations over resampled blocks of time, for g, X and the load in this order;
    nan for columns that depend on others.
    """
    weight = np.repeat(
        1 / np.maximum(deviation, 1e-12 * np.abs(observation.Y).max()), observation.rows
    )
    n = len(deviation)
    independent = _independent(exact)
    E = exact[:, independent]
    A = np.column_stack([E, load, V]) * weight[:, None]
    D = _column_deviations(observation.rows, deviation, drives)
    blocks = split_rows(A, observation.blocks())
    found, scattered = np.full((2, n + exact.shape[1]), np.nan)
    places = [*range(n), *(n + independent)]
    found[places] = _gains(triangularise(A), D)
    scattered[places] = scatter(
        blocks, lambda gram: _gains(gram_root(gram), D), LIMIT.GAIN_RUNS, seed
    )
    return found, scattered


def _gains(R: Array, D: Array) -> Array:
    """Compute the motor factors g, X and the load from the QR factor R of the extended W.

    Columns of R: columns without errors (of X and the load), known load, motor torques V. D :
    standard deviations of the errors in V.
    """
    n = len(D)
    e = len(R) - n - 1
    g = np.linalg.svd(R[-n:, -n:] / D)[2][-1] / D
    along = R[-n - 1, -n:] @ g / R[-n - 1, -n - 1] if R[-n - 1, -n - 1] else 0.0
    g = g / along if along else np.full(n, np.nan)
    return np.append(g, np.linalg.lstsq(R[:e, :e], R[:e, -n:] @ g - R[:e, e], rcond=None)[0])


def _column_deviations(rows: Sequence[int], deviation: Array, drives: Drives) -> Array:
    """Compute the standard deviations of errors in the motor torque columns V, with weighted rows.

    Rows of joint j are divided by s_j, and s_j^2 = sum_m (R_mj sigma_m)^2.
    """
    largest = (deviation**2).max()
    variance = (
        largest * nnls(drives.ratio.T**2, deviation**2 / largest)[0]
    )  # scaled: nnls of SciPy 1.13 takes tiny values for zero
    weighted = (drives.ratio**2 * variance[:, None] / deviation**2) @ np.asarray(rows, dtype=float)
    return np.asarray(np.sqrt(np.maximum(weighted, 1e-6 * weighted.max())))


def _independent(A: Array) -> Array:
    """Find linearly independent columns of A, by pivoting on columns of norm 1."""
    norms = np.linalg.norm(A, axis=0)
    used = np.flatnonzero(norms)
    R, order = qr(triangularise(A[:, used] / norms[used]), mode="r", pivoting=True)
    size = np.abs(np.diag(R))
    return np.asarray(np.sort(used[order[size > LIMIT.INDEPENDENT_COLUMN * size[0]]]))


def scaled(model: GeneratedModel, record: Prepared, gains: DriveGains) -> Observation:
    """Build the system Y = W X + rho of a record, each motor torque multiplied by its factor g."""
    n = len(model.JOINTS)
    motors = _with_motors(model, record, _drives(model))
    Y = motors.W[:, -n:] @ gains.factors
    return replace(motors, W=motors.W[:, :-n], Y=Y, names=motors.names[:-n])
