"""The C file of a model, compiled on first use and called like the NumPy module; without a compiler
the NumPy module serves.

    model = compiled_model(load_model("tx40"))          # generated/tx40.c beside generated/tx40.py

The object lies in a cache that is checked (`runtime.model.compile_cache`). One tile of every
function is compared with NumPy. A study that needs some
columns alone has their signals compiled apart (`CompiledModel.signals_alone`).

A C file is code as a module is: it is compiled where it was emitted here, or where the module
beside
it is trusted (`runtime.model.loading`).
"""

from __future__ import annotations

import ctypes
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, cast

import numpy as np

from runtime.errors import InputError
from runtime.limits import LIMIT
from runtime.model.compile_cache import (
    FLAGS,
    FallbackWarning,
    NotCompiledError,
    shared_object,
)
from runtime.model.generated import (
    GeneratedModel,
    channels_of,
    check_states,
    constants_of,
    require,
)
from runtime.model.loading import UNTRUSTED, cache_folder, is_emitted, is_trusted
from runtime.model.narrowing import narrowed_source

Array = np.ndarray

ABI = 2
STATES = {
    "regressor": ("q", "qd", "qdd"),
    "inverse_dynamics": ("q", "qd", "qdd"),
    "inertia_matrix": ("q",),
    "bias": ("q", "qd"),
    "gravity": ("q",),
}


def compiled_model(
    model: GeneratedModel,
    *,
    source: Path | None = None,
    cache: Path | None = None,
    signals: bool = False,
) -> GeneratedModel:
    """`model` with its functions in C, or `model` itself, with a FallbackWarning saying why, where
    that cannot be had.

    Parameters
    ----------
    model : GeneratedModel
    source : Path, optional
        The C file; default: beside the file of the model, .c for .py.
    cache : Path, optional
        Folder of the compiled objects; default: `loading.cache_folder`.
    signals : bool
        Compile the distinct signals of the regressor alone, all else in NumPy: half the time.
    """
    kind = CompiledSignals if signals else CompiledModel
    try:
        if channels := channels_of(model):
            raise NotCompiledError(f"{', '.join(channels)}: one value a call in C")
        path = source or _beside(model)
        text, folder = _text(path), cache or cache_folder()
        if not (is_trusted(model) or is_emitted(text)):
            raise NotCompiledError(f"{path} {UNTRUSTED}")
        library = shared_object(
            path, text, folder, lambda opened: _opened(opened, model, kind.FUNCTIONS), kind.OPTIONS
        )
        compiled = kind(model, library, text, folder)
        compiled.check()
        return cast(GeneratedModel, compiled)
    except (NotCompiledError, OSError) as e:
        warnings.warn(f"{model.NAME}: NumPy in place of C: {e}", FallbackWarning, stacklevel=2)
        return model


def target_of(model: GeneratedModel) -> str:
    """What computes: "c" for a compiled model, "numpy" for an emitted module."""
    return "c" if isinstance(model, CompiledSignals) else "numpy"


@dataclass(frozen=True)
class SignalTable:
    """The distinct rows of the store S, shape (b, n, N), as a C function, for other C code:
    S[column, row] = sign U[signal].

    Attributes
    ----------
    address : int
        Of int32_t f(int64_t m, const double *q, const double *qd, const double *qdd, int64_t
        stride, const double *constants,
        double *U, int64_t ustride), which fills U[s*ustride + t], t < m, from states of which joint
        j has m samples from j*stride on and
        returns 0, or 1 if a pointer is missing or m exceeds ustride. It allocates nothing and may
        run in many threads.
    count : int
        Number of signals s; those of constant entries are filled too.
    tile : int
        Samples treated together; m costs as the next multiple.
    column, row, signal, sign : ndarray, shape (entries,)
        Base parameter, joint, signal and +1 or -1 of every entry that is not zero.
    constant : ndarray of bool, shape (entries,)
        Whether no state changes the entry.
    """

    address: int
    count: int
    tile: int
    column: Array
    row: Array
    signal: Array
    sign: Array
    constant: Array


class CompiledSignals:
    """The generated module `module`, the distinct signals of its regressor in C. `signals`: for
    other C code. `source`: the C file's text.
    """

    FUNCTIONS: ClassVar[tuple[str, ...]] = ("signals",)
    OPTIONS: ClassVar[tuple[str, ...]] = (*FLAGS, "-DSIGNALS_ONLY")

    def __init__(
        self, model: GeneratedModel, library: ctypes.CDLL, source: bytes, cache: Path
    ) -> None:
        self.module, self._library, self.source, self._cache = model, library, source, cache
        self.signals = _signals(library, model)
        self._n, self._b = len(model.JOINTS), len(model.BASE_PARAMETERS)

    def __getattr__(self, name: str) -> Any:
        if name == "module":  # while it is being copied
            raise AttributeError(name)
        return getattr(self.module, name)

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: the module and the C file."""
        return _compiled_again, (self.module, self.source)

    def check(self) -> None:
        """Raise unless the signals agree with the regressor in NumPy on a tile and some samples
        more.
        """
        (q, qd, qdd), table = _probes(self._n), self.signals
        expected = np.asarray(self.module.regressor(q, qd, qdd)).transpose(2, 1, 0)
        rows = self.signal_rows(q, qd, qdd, np.empty((table.count, len(q))))
        store = np.zeros_like(expected)
        store[table.column, table.row] = table.sign[:, None] * rows[table.signal]
        _require_equal("signals", store, expected)

    def signal_rows(self, q: Array, qd: Array, qdd: Array, out: Array, **constants: float) -> Array:
        """The distinct signals of the regressor, shape (signals.count, N), in `out`, a float64
        array in C order.
        """
        states = [np.ascontiguousarray(x.T) for x in self._states("regressor", (q, qd, qdd))]
        N = states[0].shape[1]
        if (
            out.shape != (self.signals.count, N)
            or out.dtype != np.float64
            or not out.flags.c_contiguous
        ):
            raise InputError(
                f"out {out.dtype} {out.shape}; expected float64 {(self.signals.count, N)} in C "
                "order"
            )
        inputs = [ctypes.c_void_p(x.ctypes.data) for x in states]
        values, length = self.constant_values(constants), ctypes.c_int64(N)
        others = ctypes.c_void_p(values.ctypes.data), ctypes.c_void_p(out.ctypes.data)
        if status := getattr(self._library, f"{self.module.NAME}_signals")(
            length, *inputs, length, *others, length
        ):
            raise InputError(
                f"{self.module.NAME}: signals in C refused its arguments with {status}"
            )
        return out

    def signals_alone(self, wanted: Sequence[int]) -> SignalTable:
        """The table of signals, whose function fills the rows `wanted` alone, in the same bits;
        `signals` where they cannot be compiled.
        """
        text = narrowed_source(self.source.decode(), wanted).encode()
        path, functions = Path(f"{self.module.NAME}.c"), CompiledSignals.FUNCTIONS
        try:
            library = shared_object(
                path,
                text,
                self._cache,
                lambda opened: _opened(opened, self.module, functions),
                CompiledSignals.OPTIONS,
            )
        except (NotCompiledError, OSError):
            return self.signals
        return _signals(library, self.module)

    def _states(self, name: str, given: Sequence[Array]) -> tuple[Array, ...]:
        """Contiguous (N, n) arrays of one shape: C reads past the end of any other."""
        states = tuple(
            np.ascontiguousarray(np.atleast_2d(np.asarray(x, dtype=float))) for x in given
        )
        check_states(self.module, **dict(zip(STATES[name], states, strict=True)))
        return states

    def constant_values(self, constants: Mapping[str, float]) -> Array:
        """Values of CONSTANTS in their order, those given in place of the robot file's."""
        values = [*constants_of(self.module, constants).values()]
        return np.array(values or [0.0], dtype=float)


class CompiledModel(CompiledSignals):
    """The API of the generated module in C; what the C file lacks is that of the module."""

    FUNCTIONS = tuple(STATES)
    OPTIONS = FLAGS

    def __init__(
        self, model: GeneratedModel, library: ctypes.CDLL, source: bytes, cache: Path
    ) -> None:
        super().__init__(model, library, source, cache)
        self._large = _large()

    def regressor(
        self, q: Array, qd: Array, qdd: Array, *, out: Array | None = None, **constants: float
    ) -> Array:
        """D, shape (N, n, b): a view on one store of shape (b, n, N)."""
        D = self._filled_store(q, qd, qdd, out, constants).transpose(2, 1, 0)
        return cast(Array, D[0]) if np.ndim(q) == 1 else D

    def observation_matrix(
        self, q: Array, qd: Array, qdd: Array, *, out: Array | None = None, **constants: float
    ) -> Array:
        """W, shape (n*N, b), rows joint-major, Fortran order: the same store, no copy."""
        return self._filled_store(q, qd, qdd, out, constants).reshape(self._b, -1).T

    def inverse_dynamics(
        self, q: Array, qd: Array, qdd: Array, X: Array, **constants: float
    ) -> Array:
        """Gamma, shape (N, n)."""
        return self._dynamics("inverse_dynamics", (q, qd, qdd), X, constants, 1)

    def inertia_matrix(self, q: Array, X: Array, **constants: float) -> Array:
        """A(q), shape (N, n, n)."""
        return self._dynamics("inertia_matrix", (q,), X, constants, 2)

    def bias(self, q: Array, qd: Array, X: Array, **constants: float) -> Array:
        """Gamma at qdd = 0, shape (N, n)."""
        return self._dynamics("bias", (q, qd), X, constants, 1)

    def gravity(self, q: Array, X: Array, **constants: float) -> Array:
        """Gamma at rest without friction, shape (N, n)."""
        return self._dynamics("gravity", (q,), X, constants, 1)

    def forward_dynamics(
        self, q: Array, qd: Array, tau: Array, X: Array, **constants: float
    ) -> Array:
        """qdd = A(q)**-1 (tau - bias), shape (N, n); ModelError where the module has none."""
        require(self.module, "forward_dynamics")
        A, H = self.inertia_matrix(q, X, **constants), self.bias(q, qd, X, **constants)
        return np.linalg.solve(A, (np.asarray(tau, dtype=float) - H)[..., None])[..., 0]

    def check(self) -> None:
        """Raise unless every function agrees with NumPy on a tile and some samples more."""
        states, X = _probes(self._n), np.random.default_rng(11).uniform(-1, 1, self._b)
        for name, used in STATES.items():
            arguments = [*states[: len(used)], *([] if name == "regressor" else [X])]
            _require_equal(name, *(getattr(m, name)(*arguments) for m in (self, self.module)))

    def _filled_store(
        self, q: Array, qd: Array, qdd: Array, out: Array | None, constants: Mapping[str, float]
    ) -> Array:
        states = self._states("regressor", (q, qd, qdd))
        N = len(states[0])
        if out is None:
            out = self.module.store(N)
        elif not (
            isinstance(out, cast(Any, self.module).Store)
            and cast(Any, out).ready
            and out.shape == (self._b, self._n, N)
        ):
            raise ValueError(
                f"out: expected store({N}) of shape {(self._b, self._n, N)}, found "
                f"{type(out).__name__} of shape {np.shape(out)}"
            )
        self._call("regressor", states, constants, out)
        return out.view(np.ndarray)

    def _dynamics(
        self, name: str, given: Sequence[Array], X: Array, constants: Mapping[str, float], axes: int
    ) -> Array:
        states = self._states(name, given)
        X = np.ascontiguousarray(X, dtype=float)
        if X.shape != (self._b,):
            raise InputError(f"{self.module.NAME}: X has shape {X.shape}; expected ({self._b},)")
        result = np.empty((*[self._n] * axes, len(states[0])))
        self._call(name, (*states, X), constants, result)
        result = np.moveaxis(result, -1, 0)
        return cast(Array, result[0]) if np.ndim(given[0]) == 1 else result

    def _call(
        self, name: str, inputs: Sequence[Array], constants: Mapping[str, float], result: Array
    ) -> None:
        values = self.constant_values(constants)
        if not (
            result.flags.c_contiguous
            and result.flags.aligned
            and result.flags.writeable
            and result.dtype == np.float64
        ):
            raise InputError(
                f"{self.module.NAME}: the store is not a writeable float64 array in C order"
            )
        stream = result.nbytes > self._large
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*inputs, values, result)]
        status = getattr(self._library, f"{self.module.NAME}_{name}")(
            ctypes.c_int64(result.shape[-1]), *pointers, ctypes.c_int32(stream)
        )
        if status:
            raise InputError(f"{self.module.NAME}: {name} in C refused its arguments with {status}")


def _probes(n: int) -> Array:
    """States q, qd, qdd of a tile and some samples more, shape (3, N, n)."""
    return np.random.default_rng(11).uniform(-2, 2, (3, 71, n))


def _require_equal(name: str, result: Array, expected: Array) -> None:
    """NotCompiledError where C and NumPy differ by more than rounding."""
    if not np.abs(result - expected).max(initial=0.0) <= LIMIT.C_AGREES * np.abs(expected).max(
        initial=1.0
    ):
        raise NotCompiledError(f"{name} in C differs from NumPy; report compiler and robot file")


def _compiled_again(module: GeneratedModel, source: bytes) -> CompiledModel:
    """The compiled model in another process; InputError where it cannot be compiled there, as NumPy
    would not give the same bits.
    """
    with TemporaryDirectory(prefix="symgen-") as folder:
        path = Path(folder) / f"{module.NAME}.c"
        path.write_bytes(source)
        model = compiled_model(module, source=path)
    if not isinstance(model, CompiledModel):
        raise InputError(
            f"a worker has no compiled {module.NAME} (its log says why); use --target numpy, "
            "or install a C compiler there"
        )
    return model


def _signals(library: ctypes.CDLL, model: GeneratedModel) -> SignalTable:
    tile, count, entries = (
        ctypes.c_int32.in_dll(library, f"{model.NAME}_{name}").value
        for name in ("tile", "signal_count", "entry_count")
    )
    place, signal, sign = (
        np.array(
            (ctypes.c_int32 * 3 * entries).in_dll(library, f"{model.NAME}_entries"), dtype=np.intp
        )
        .reshape(-1, 3)
        .T
    )
    column, row = np.divmod(place, len(model.JOINTS))
    address = ctypes.cast(getattr(library, f"{model.NAME}_signals"), ctypes.c_void_p).value
    constant = (
        np.arange(entries) >= ctypes.c_int32.in_dll(library, f"{model.NAME}_varying_count").value
    )
    return SignalTable(cast(int, address), count, tile, column, row, signal, sign, constant)


def _large() -> int:
    """Bytes beyond which a result should not pass through the caches: a third of the last one, of
    which a large one is shared by many cores.
    """
    try:
        size = os.sysconf("SC_LEVEL3_CACHE_SIZE")
    except (AttributeError, ValueError, OSError):
        size = 0
    share: int = LIMIT.CACHE_OF_A_CORE
    return min(size if size > 0 else share, share) // 3


def _beside(model: GeneratedModel) -> Path:
    file = getattr(model, "__file__", None)
    if file is None:
        raise NotCompiledError("the model was not loaded from a file, and no C file is given")
    return Path(file).with_suffix(".c")


def _text(path: Path) -> bytes:
    if not path.is_file():
        raise NotCompiledError(
            f"there is no {path}; `symgen generate {path.stem} --target numpy,c` writes it, except "
            "where loops need iteration"
        )
    return path.read_bytes()


def _opened(path: Path, model: GeneratedModel, functions: Iterable[str]) -> ctypes.CDLL:
    """The object, if it speaks this ABI, stems from the robot file of the model and has the
    functions.
    """
    library = ctypes.CDLL(str(path))
    try:
        abi, sha256 = (
            getattr(library, f"{model.NAME}_abi"),
            getattr(library, f"{model.NAME}_source_sha256"),
        )
        for name in functions:
            getattr(library, f"{model.NAME}_{name}").restype = ctypes.c_int32
    except AttributeError as e:
        raise NotCompiledError(f"the C file is not that of {model.NAME}: {e}") from e
    sha256.restype, abi.restype = ctypes.c_char_p, ctypes.c_int32
    if abi() != ABI:
        raise NotCompiledError(f"the C file has interface {abi()}, expected {ABI}; emit it again")
    if sha256().decode() != model.SOURCE_SHA256:
        raise NotCompiledError("C file and module stem from different robot files; emit both again")
    return library
