"""Runs of a resolution study on an array device: a GPU through CuPy, JAX or PyTorch, or this processor through any of them.

    arrays = load_arrays("tx40", of=model)                                # symgen generate tx40 --target xp
    result = cestac(model, record, study, device=Device(arrays, cupy.zeros(1)))

A batch of runs is one pure function of arrays, without loops over samples, rows or runs:

    xi        what the rounding adds to the position, by random bits that depend on the key of the run alone; two-point bits travel packed
    q, qd, qdd = those of the record + filters of xi            linear, so errors of the device's filters scale with xi (`array_filters`)
    U         the distinct signals of the regressor, decimated at the kept samples; W is never formed
    [W_j Y_j]'[W_j Y_j] by joint, summed; columns scaled; solved; one refinement; ||Y_j - W_j X||

Runs agree with those of `runtime.resolution.run` to rounding, not in every bit. A run whose kappa (condition number with unit columns) reaches the limit
of `runtime.estimators.normal_equations` is solved on the host by the triangular factor, and says so. Under JAX pass `compiled=jax.jit`; float64 must be on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.errors import InputError, SettingsError
from runtime.estimators import linear_system
from runtime.estimators.normal_equations import LIMIT
from runtime.model.array_model import ArrayModel
from runtime.model.text import ModelText
from runtime.observation.decimation import Plan
from runtime.observation.filters import butterworth, decimation_plan, filtered_states, median_filtered
from runtime.observation.observation import decimated_torque
from runtime.resolution.array_filters import Arrays, Modes, decimate, derivative, lowpass_modes, zero_phase
from runtime.resolution.result import Level
from runtime.resolution.rounding import stream
from runtime.resolution.run import Part, Task, observed, part_key, perturbed_position, perturbed_torque
from runtime.resolution.runs import NORMAL, TRIANGULAR, Run, Runs

Array = Any  # of the package in use
Host = np.ndarray
Key = tuple[int, int]  # (level, run)

LEAST = 1 / LIMIT**2
"""1/kappa**2 down to which the normal equations are used."""


@dataclass(frozen=True, eq=False)
class Device:
    """Where the runs of a study are computed: called with a task and blocks of keys, yields the runs of each block.

    arrays : the array module of the same robot file as the model of the study (`runtime.model.array_model.load_arrays`).
    like : any array of the package on the device to be used.
    batch : runs computed at once; a TX40 run of 45000 samples takes about 0.12 GB of memory.
    compiled : turns the function of a batch into a faster one, such as jax.jit; batches of one size have the same shapes.
    """

    arrays: ArrayModel
    like: Array
    batch: int = 8
    compiled: Callable[[Callable[..., Any]], Callable[..., Any]] | None = None

    @property
    def name(self) -> str:
        """Package and device."""
        found = arrays_like(self.like)
        return f"xp, {found.xp.__name__.removeprefix('array_api_compat.')}, {found.device}"

    def __call__(self, task: Task, blocks: Sequence[Sequence[Key]]) -> Iterator[Runs]:
        """The runs of each block of keys (level, run)."""
        work = Batches(task, self.arrays, self.like)
        solve = work.solve if self.compiled is None else self.compiled(work.solve)
        for block in blocks:
            runs: list[Run] = []
            for start in range(0, len(block), self.batch):
                keys = block[start : start + self.batch]
                X, norms, rcond = (to_host(x) for x in solve(*work.inputs(keys)))
                for key, x, norm, r in zip(keys, X, norms, rcond, strict=True):
                    runs.append(Run(*key, tuple(x.tolist()), float(norm), NORMAL) if r > LEAST else work.on_host(key))
            yield Runs.of(runs, len(task.names))


@dataclass(frozen=True, eq=False)
class Constant:
    """What is the same in every run of one record.

    median : q behind the median filter, (N, n), on the host.   states : q, qd, qdd of the record, (N, n) each, on the device.
    rows : 1.0 where a row is used and 0.0 elsewhere, (n, K), on the device.   rate : samples per second, before decimation.
    """

    part: Part
    median: Host
    states: tuple[Array, Array, Array]
    rows: Array
    modes: Modes | None
    plan: Plan | None


@dataclass(frozen=True, eq=False)
class Columns:
    """Entries of the regressor in the torque of one joint. signal : (c,) numbers of signals.   sign : (c,).   place : (c, b), 1 at each column."""

    signal: Array
    sign: Array
    place: Array


class Batches:
    """A task on one device; `solve` is the function of a batch."""

    def __init__(self, task: Task, arrays: ArrayModel, like: Array) -> None:
        if (task.estimate.method, task.estimate.weights) != ("ols", "none"):
            raise SettingsError(f"{task.estimate.method!r} on a device; it runs ols without weights", path=("estimate", "method"))
        self.task, self.model = task, task.model.load() if isinstance(task.model, ModelText) else task.model
        if arrays.SOURCE_SHA256 != self.model.SOURCE_SHA256:
            raise InputError("model and array module stem from different robot files; emit both again", file=arrays.NAME)
        self.arrays_model, self.arrays = arrays, arrays_like(like)
        self.parts = [self._constant(part) for part in task.parts]
        self.columns = self._columns()

    def _constant(self, part: Part) -> Constant:
        put, selection = self.arrays.put, part.selection
        signals = selection.signals
        states = filtered_states(part.q, part.rate, signals)
        N = selection.samples.stop - selection.samples.start
        return Constant(
            part=part,
            median=median_filtered(part.q, signals.median),
            states=(put(states.q), put(states.qd), put(states.qdd)),
            rows=put(selection.mask.astype(float)),
            modes=lowpass_modes(signals.lowpass, part.rate) if signals.lowpass else None,
            plan=decimation_plan(N, selection.factor, signals.decimate),
        )

    def _columns(self) -> list[Columns]:
        put, names = self.arrays.put, self.task.names
        number = {self.model.BASE_PARAMETERS.index(name): place for place, name in enumerate(names)}
        found = []
        for j in range(len(self.model.JOINTS)):
            own = [(number[k], s, c) for k, row, s, c in self.arrays_model.ENTRIES if row == j and k in number]
            place = np.zeros((len(own), len(names)))
            place[np.arange(len(own)), [k for k, *_ in own]] = 1.0
            signal = np.array([s for _, s, _ in own], dtype=np.int64)
            found.append(Columns(put(signal), put(np.array([c for *_, c in own], dtype=float)), put(place)))
        return found

    # --- on the host: what differs from run to run ---

    def inputs(self, keys: Sequence[Key]) -> tuple[list[Array], list[Array]]:
        """For every record xi (R, N, n) and Y (R, n, K), on the device."""
        put, levels = self.arrays.put, [self.task.levels[level] for level, _ in keys]
        xi, Y = [], []
        for k, constant in enumerate(self.parts):
            streams = [part_key((run,) if self.task.settings.common else (level, run), k) for level, run in keys]
            positions, torques = [position for position, _ in streams], [torque for _, torque in streams]
            if all(map(self._packed, levels)):
                octets = np.stack([_octets(constant.part.q.size, self.task.settings.seed, key) for key in positions])
                steps = put(np.array([level.delta for level in levels]))
                xi.append(self._signs(put(octets), constant.part.q.shape) * steps[:, None, None])
            else:
                xi.append(put(np.stack([self._perturbation(constant, *draw) for draw in zip(levels, positions, strict=True)])))
            Y.append(put(np.stack([self._torque(constant.part, *draw) for draw in zip(levels, torques, strict=True)])))
        return xi, Y

    def _packed(self, level: Level) -> bool:
        """Whether xi is Delta or -Delta, one bit a sample."""
        settings = self.task.settings
        joint_side = settings.side == "joint" or self.task.drives is None
        return bool(level.delta) and joint_side and settings.rounding == "two-point" and settings.median == 1

    def _perturbation(self, constant: Constant, level: Level, key: Sequence[int]) -> Host:
        """xi, shape (N, n): the rounded position minus the measured one, both behind the median filter."""
        part = constant.part
        q = perturbed_position(part.q, level, self.task.settings, self.task.drives, key)
        return np.asarray(median_filtered(q, part.selection.signals.median) - constant.median)

    def _torque(self, part: Part, level: Level, key: Sequence[int]) -> Host:
        """Y, shape (n, K)."""
        if not level.torque:
            return part.torque
        return decimated_torque(perturbed_torque(part.tau, level, self.task.settings, self.task.drives, key), part.selection)

    def _signs(self, octets: Array, shape: tuple[int, ...]) -> Array:
        """+1.0 or -1.0, shape (R, N, n), from the bits of octets (R, -1), highest first, as `runtime.resolution.rounding.signs` reads them."""
        xp = self.arrays.xp
        weights = self.arrays.put(np.array([128, 64, 32, 16, 8, 4, 2, 1], dtype=np.uint8))
        bits = xp.bitwise_and(octets[..., None], weights) > 0
        signs = 2.0 * xp.astype(xp.reshape(bits, (octets.shape[0], -1)), xp.float64) - 1.0
        return xp.reshape(signs[:, : int(np.prod(shape))], (-1, *shape))

    # --- on the device ---

    def solve(self, xi: list[Array], Y: list[Array]) -> tuple[Array, Array, Array]:
        """X (R, b), ||Y - W X|| (R,), 1/kappa**2 (R,) of R runs; where that is too small, X and the norm mean nothing."""
        xp = self.arrays.xp
        rows = [block for constant, x, y in zip(self.parts, xi, Y, strict=True) for block in self._rows(constant, x, y)]
        A = sum(_embedded(xp, columns.place, xp.matmul(O, xp.matrix_transpose(O))) for columns, O, _ in rows)
        diagonal = xp.linalg.diagonal(A)
        D = 1 / xp.sqrt(xp.where(diagonal > 0.0, diagonal, 1.0))
        scaled = A * D[:, :, None] * D[:, None, :]
        spread = xp.linalg.eigvalsh(scaled)
        rcond = spread[:, 0] / spread[:, -1]
        hopeless = xp.where(rcond > LEAST, 0.0, xp.ones_like(rcond))  # made regular, so that no package stops at one singular matrix
        scaled = scaled + hopeless[:, None, None] * self.arrays.put(np.eye(len(self.task.names)))
        X = self._step(scaled, D, sum(self._gradient(columns, O, y) for columns, O, y in rows))
        X = X + self._step(scaled, D, sum(self._gradient(columns, O, self._remainder(columns, O, y, X)) for columns, O, y in rows))
        squares = sum(xp.sum(self._remainder(columns, O, y, X) ** 2, axis=(1, 2)) for columns, O, y in rows)
        return X, xp.sqrt(squares), rcond

    def _rows(self, constant: Constant, xi: Array, Y: Array) -> Iterator[tuple[Columns, Array, Array]]:
        """By joint: its columns, W_j' (R, c, K) and Y_j (R, 1, K)."""
        xp = self.arrays.xp
        q, qd, qdd = (x[:, constant.part.selection.samples, :] for x in self._states(constant, xi))
        U = self.arrays_model.signals(q, qd, qdd, **self.task.constants)
        S, R, N = U.shape
        if constant.plan is not None:
            U = xp.reshape(decimate(self.arrays, xp.reshape(U, (S * R, N)), constant.plan), (S, R, constant.plan.K))
        for j, columns in enumerate(self.columns):
            O = xp.take(U, columns.signal, axis=0) * (columns.sign[:, None, None] * constant.rows[j, :])
            yield columns, xp.moveaxis(O, 0, 1), (Y[:, j, :] * constant.rows[j, :])[:, None, :]

    def _states(self, constant: Constant, xi: Array) -> tuple[Array, Array, Array]:
        """q, qd, qdd of the runs, (R, N, n) each: those of the record and the filters of xi."""
        xp, signals, rate = self.arrays.xp, constant.part.selection.signals, constant.part.rate
        R, N, n = xi.shape
        x = xp.reshape(xp.permute_dims(xi, (0, 2, 1)), (R * n, N))
        low = signals.lowpass

        def filtered(x: Array, name: str) -> Array:
            if low is None or constant.modes is None or name not in low.on:
                return x
            return zero_phase(self.arrays, constant.modes, x, butterworth(rate, low)[1])

        x = filtered(x, "q")
        xd = filtered(derivative(self.arrays, x, rate, signals.ends), "qd")
        added = (x, xd, derivative(self.arrays, xd, rate, signals.ends))
        q, qd, qdd = (s + xp.permute_dims(xp.reshape(a, (R, n, N)), (0, 2, 1)) for s, a in zip(constant.states, added, strict=True))
        return q, qd, qdd

    def _gradient(self, columns: Columns, O: Array, r: Array) -> Array:
        """W_j' r, shape (R, b)."""
        xp = self.arrays.xp
        return xp.matmul(xp.matmul(O, xp.matrix_transpose(r))[:, :, 0], columns.place)

    def _remainder(self, columns: Columns, O: Array, y: Array, X: Array) -> Array:
        """Y_j - W_j X, shape (R, 1, K)."""
        xp = self.arrays.xp
        own = xp.matmul(X, xp.matrix_transpose(columns.place))
        return y - xp.matmul(own[:, None, :], O)

    def _step(self, scaled: Array, D: Array, g: Array) -> Array:
        """A^-1 g, shape (R, b), A = D^-1 scaled D^-1."""
        return D * self.arrays.xp.linalg.solve(scaled, (D * g)[:, :, None])[:, :, 0]

    # --- back on the host ---

    def on_host(self, key: Key) -> Run:
        """One run by the triangular factor."""
        draw = (key[1],) if self.task.settings.common else key
        system = linear_system(observed(self.task, self.model, self.task.levels[key[0]], draw), self.task.estimate)
        X = system.solve().X
        norm = float(np.linalg.norm([joint.residual_norm(X) for joint in system.raw.joints]))
        return Run(*key, tuple(X.tolist()), norm, TRIANGULAR)


def arrays_like(like: Array) -> Arrays:
    """Package and device of an array; InputError where the package cannot hold float64."""
    try:
        from array_api_compat import array_namespace, device
    except ImportError as e:
        raise InputError("arrays of other packages need array-api-compat: pip install symgen[gpu]") from e
    xp, place = array_namespace(like), device(like)

    def put(x: Host) -> Array:
        return xp.asarray(np.ascontiguousarray(x), device=place)

    found = put(np.zeros(1)).dtype
    if found != xp.float64:
        raise InputError(f"arrays of float64 become {found}; expected float64 (JAX: set jax_enable_x64 before arrays are made)")
    return Arrays(xp, put, str(place))


def to_host(x: Array) -> Host:
    """The array in the memory of this processor."""
    for name in ("cpu", "get"):  # PyTorch, CuPy
        if hasattr(x, name):
            x = getattr(x, name)()
    return np.asarray(x) if hasattr(x, "__array__") else np.from_dlpack(x)


def _octets(size: int, seed: int, key: Sequence[int]) -> Host:
    """The octets from which `runtime.resolution.rounding.signs` takes its bits."""
    return np.frombuffer(stream(seed, *key).bytes(-(-size // 8)), dtype=np.uint8)


def _embedded(xp: Any, place: Array, G: Array) -> Array:
    """G, shape (R, c, c), over all columns, shape (R, b, b)."""
    return xp.matmul(xp.matmul(xp.matrix_transpose(place), G), place)
