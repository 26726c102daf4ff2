"""A model whose regressor is that of its C file, compiled on first use; all else is NumPy.

    model = compiled_model(load_model("tx40"))          # generated/tx40.c beside generated/tx40.py

The object lies in a cache that is checked (`runtime.compiled.cache`), and its regressor is compared
with that of the NumPy module at some states.

A C file is code as a module is: it is compiled where it was emitted here, or where the module
beside it is trusted (`runtime.core.loading`).
"""

from __future__ import annotations

import ctypes
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import numpy as np

from runtime.compiled.cache import FallbackWarning, NotCompiledError, shared_object
from runtime.core.errors import InputError
from runtime.core.limits import LIMIT
from runtime.core.loading import UNTRUSTED, cache_folder, is_emitted, is_trusted
from runtime.core.model import GeneratedModel, channels_of, check_states, constants_of

Array = np.ndarray

ABI = 2


def compiled_model(
    model: GeneratedModel, *, source: Path | None = None, cache: Path | None = None
) -> GeneratedModel:
    """`model` with its regressor in C, or `model` itself, with a FallbackWarning saying why, where
    that cannot be had.

    Parameters
    ----------
    model : GeneratedModel
    source : Path, optional
        The C file; default: beside the file of the model, .c for .py.
    cache : Path, optional
        Folder of the compiled objects; default: `loading.cache_folder`.
    """
    try:
        if channels := channels_of(model):
            raise NotCompiledError(f"{', '.join(channels)}: one value a call in C")
        path = source or _beside(model)
        text = _text(path)
        if not (is_trusted(model) or is_emitted(text)):
            raise NotCompiledError(f"{path} {UNTRUSTED}")
        library = shared_object(
            path, text, cache or cache_folder(), lambda opened: _opened(opened, model)
        )
        compiled = CompiledModel(model, library, text)
        compiled.check()
        return cast(GeneratedModel, compiled)
    except (NotCompiledError, OSError) as e:
        warnings.warn(f"{model.NAME}: NumPy in place of C: {e}", FallbackWarning, stacklevel=2)
        return model


def target_of(model: GeneratedModel) -> str:
    """What computes: "c" for a compiled model, "numpy" for an emitted module."""
    return "c" if isinstance(model, CompiledModel) else "numpy"


class CompiledModel:
    """The generated module `module`, its regressor in C. `source` : text of the C file."""

    def __init__(self, module: GeneratedModel, library: ctypes.CDLL, source: bytes) -> None:
        self.module = module
        self.source = source
        self._library = library

    def __getattr__(self, name: str) -> Any:
        if name == "module":  # while it is being copied
            raise AttributeError(name)
        return getattr(self.module, name)

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: the module and the C file."""
        return _compiled_again, (self.module, self.source)

    def check(self) -> None:
        """NotCompiledError unless the regressor agrees with NumPy on a tile and some samples
        more.
        """
        q, qd, qdd = np.random.default_rng(11).uniform(-2, 2, (3, 71, len(self.module.JOINTS)))
        expected = np.asarray(self.module.regressor(q, qd, qdd))
        difference = np.abs(self.regressor(q, qd, qdd) - expected).max(initial=0.0)
        if not difference <= LIMIT.C_AGREES * np.abs(expected).max(initial=1.0):
            raise NotCompiledError(
                "regressor in C differs from NumPy; report compiler and robot file"
            )

    def regressor(
        self, q: Array, qd: Array, qdd: Array, *, out: Array | None = None, **constants: float
    ) -> Array:
        """D, shape (N, n, b): a view on one store of shape (b, n, N).

        out : a store of the module, store(N).
        """
        module = self.module
        states = [  # C reads past the end of any other
            np.ascontiguousarray(np.atleast_2d(np.asarray(x, dtype=float))) for x in (q, qd, qdd)
        ]
        check_states(module, **dict(zip(("q", "qd", "qdd"), states, strict=True)))
        N = len(states[0])
        store = module.store(N) if out is None else out
        shape = (len(module.BASE_PARAMETERS), len(module.JOINTS), N)
        if not (
            isinstance(store, cast(Any, module).Store)
            and cast(Any, store).ready
            and store.shape == shape
        ):
            raise ValueError(
                f"out: expected store({N}) of shape {shape}, found "
                f"{type(store).__name__} of shape {np.shape(store)}"
            )
        values = np.array([*constants_of(module, constants).values()] or [0.0], dtype=float)
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*states, values, store)]
        function = getattr(self._library, f"{module.NAME}_regressor")
        if status := function(ctypes.c_int64(N), *pointers, ctypes.c_int32(0)):
            raise InputError(f"{module.NAME}: regressor in C refused its arguments with {status}")
        D = store.view(np.ndarray).transpose(2, 1, 0)
        return cast(Array, D[0]) if np.ndim(q) == 1 else D


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


def _opened(path: Path, model: GeneratedModel) -> ctypes.CDLL:
    """The object, if it speaks this ABI, stems from the robot file of the model and has the
    regressor.
    """
    library = ctypes.CDLL(str(path))
    try:
        abi = getattr(library, f"{model.NAME}_abi")
        sha256 = getattr(library, f"{model.NAME}_source_sha256")
        getattr(library, f"{model.NAME}_regressor").restype = ctypes.c_int32
    except AttributeError as e:
        raise NotCompiledError(f"the C file is not that of {model.NAME}: {e}") from e
    sha256.restype = ctypes.c_char_p
    abi.restype = ctypes.c_int32
    if abi() != ABI:
        raise NotCompiledError(f"the C file has interface {abi()}, expected {ABI}; emit it again")
    if sha256().decode() != model.SOURCE_SHA256:
        raise NotCompiledError("C file and module stem from different robot files; emit both again")
    return library
