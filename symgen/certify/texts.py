"""Texts that leave, run and compared with the witness, function by function.

NumPy, xp (with NumPy arrays) and CasADi are imported; C is compiled, and called in a process of its
own. What cannot be run here, for want of a library or a compiler, is said to be not run.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import wrap
from types import ModuleType
from typing import Any

import numpy as np

from symgen.certify import call_c
from symgen.certify.importing import END, HEAD, below, imported
from symgen.certify.tables import table_errors
from symgen.certify.witness import STATES, Check, Witness
from symgen.derive.exact import Array
from symgen.derive.models import MODELS
from symgen.version import VERSION

TOLERANCE = 1e-9  # of the largest entry: rounding of some thousand operations, and closed loops
LIBRARIES = {"numpy": "numpy", "xp": "array_api_compat", "casadi": "casadi"}
C_FLAGS = ("-std=c11", "-O0", "-ffp-contract=off", "-shared", "-fPIC")
WITHOUT_AVX512 = "-D__builtin_cpu_supports(x)=0"  # another way past the caches
LONGEST_RUN = 300  # s, of the compiler and of the functions
HELPERS = {"store", "signals", "jacobian_of", "elements", "array_namespace"}
"""Public names that are no models: those of other checks, or of the functions that use them."""
TILES = 70  # samples of the functions in C: some tiles, the last one not full


@dataclass(frozen=True)
class TextCheck:
    """What ran of a text.

    Attributes
    ----------
    target : str
        Which one the text is of.
    sha256 : str
        Hash of the text below its header.
    errors : mapping
        Largest difference of each function and each table from the witness, of the largest entry;
        infinite where it does not run or has another shape, zero where a table is right.
    constants : str
        Which constants the functions were called with.
    left_out : tuple of str
        Functions that this robot gives no sense to.
    not_run : str
        Why nothing ran; empty where it did.
    raised : mapping
        What functions of a module raised in place of a result.
    """

    target: str
    sha256: str
    errors: Mapping[str, float] = field(default_factory=dict)
    constants: str = ""
    left_out: tuple[str, ...] = ()
    not_run: str = ""
    raised: Mapping[str, str] = field(default_factory=dict)

    @property
    def wrong(self) -> list[str]:
        """What disagrees; NaN does."""
        return [name for name, error in self.errors.items() if not error < TOLERANCE]

    @property
    def valid(self) -> bool:
        return not self.wrong and bool(self.errors or self.not_run)

    def checks(self, file: str) -> list[tuple[bool, str]]:
        """Whether each function agrees with the witness, and whether the tables are right."""
        if self.not_run:
            return [(True, f"{file} {self.sentence}")]
        tables = [name for name in self.errors if name.isupper()]
        wrong = [name for name in tables if name in self.wrong]
        told = f"tables of {file} against the robot file: {', '.join(wrong or tables)}"
        return [
            (
                error < TOLERANCE,
                f"{name} of {file} "
                + (
                    f"ends in an error: {self.raised[name]}"
                    if name in self.raised
                    else f"against CasADi: {error:.1e} of the largest"
                ),
            )
            for name, error in self.errors.items()
            if name not in tables
        ] + [(not wrong, told)] * bool(tables)

    @property
    def sentence(self) -> str:
        """What ran."""
        if self.not_run:
            return f"not run: {self.not_run}"
        functions = [name for name in self.errors if not name.isupper()]
        tables = [name for name in self.errors if name.isupper()]
        return (
            f"{', '.join(functions)} at random states, parameters and {self.constants} agree with "
            f"Lagrange's equations and products of frames to {TOLERANCE:g}"
            + f"; {', '.join(tables)} with the robot file"
            * bool(tables)
        )


def text_check(file: str, text: str, target: str, witness: Witness) -> TextCheck:
    """Run every function of a text, below its header, and compare it with the witness."""
    text = below(text)
    key = sha256(text.encode("utf-8")).hexdigest()
    library = LIBRARIES.get(target)
    if library and importlib.util.find_spec(library) is None:
        return TextCheck(target, key, not_run=f"{library} is not installed")
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if target == "c" and compiler is None:
        return TextCheck(target, key, not_run="there is no C compiler")
    with TemporaryDirectory(prefix="symgen-", ignore_cleanup_errors=True) as folder:
        path = Path(folder) / file
        path.write_text(text, encoding="utf-8", newline="\n")
        errors, raised = (
            (c_errors(path, text, str(compiler), witness), {})
            if target == "c"
            else module_errors(path, target, witness)
        )
    left_out = tuple(sorted(witness.left_out))
    return TextCheck(target, key, errors, witness.drawn, left_out, raised=raised)


# --- headers ---


def headed(text: str, check: TextCheck, formulas: str) -> str:
    """The text below what its certificate says."""
    mark = "//" if check.target == "c" else "#"
    lines = wrap(
        f"{HEAD} by symgen {VERSION}: formulas {formulas}; {check.sentence}.", 97 - len(mark)
    )
    return "\n".join([*(f"{mark} {line}" for line in lines), f"{mark} {END}{check.sha256}", text])


# --- modules ---


def module_errors(
    path: Path, target: str, witness: Witness
) -> tuple[dict[str, float], dict[str, str]]:
    """Errors of the functions and tables of a Python module, and what they raised."""
    try:
        module = imported(path)
    except Exception as error:  # a text may fail in any way
        return {"import": float("inf")}, {"import": repr(error)}
    checks, call = dict(witness.checks), _casadi if target == "casadi" else _called
    if target == "casadi":  # all three, by position
        del checks["observation_matrix"]
        checks |= {
            n: c[:2] for n, c in checks.items() if n == "passive_joints"
        } | witness.derivatives
    ran = {name: largest(module, name, checks[name], call, witness) for name in checks}
    errors = {name: error for name, (error, _) in ran.items()}
    own = [
        n for n, value in vars(module).items() if callable(value) and not isinstance(value, type)
    ]
    unchecked = {n for n in own if not n.startswith("_")} - {*errors, *HELPERS, *witness.left_out}
    errors |= dict.fromkeys(unchecked, float("inf")) | table_errors(module, witness)
    return errors, {name: text for name, (_, text) in ran.items() if text}


def largest(
    module: ModuleType,
    name: str,
    checks: list[Check],
    call: Callable[..., Array],
    witness: Witness,
) -> tuple[float, str]:
    """Largest error of a function in all its checks, and what it raised."""
    try:
        errors = [
            difference(c.compared(call(module, name, c, witness.keywords)), c.expected, c.scale)
            for c in checks
        ]
    except Exception as error:  # a text may fail in any way
        return float("inf"), str(error) or repr(error)
    return max(errors), ""


def difference(value: Any, expected: Array, scale: Array | float) -> float:
    """Largest difference, of `scale`; infinite for another shape, NaN for NaN."""
    value = np.asarray(value, dtype=float)
    if value.shape != expected.shape:
        return float("inf")
    error = np.abs(value - expected)
    error = np.divide(error, scale, out=error, where=error != 0)  # 0/0 is 0
    return float(np.max(error, initial=0.0))


def _called(module: ModuleType, name: str, check: Check, constants: Mapping[str, float]) -> Array:
    value = getattr(module, name)(*check.arguments, **check.keywords, **constants)
    return np.stack(value, axis=-2) if isinstance(value, tuple) else np.asarray(value)


def _casadi(module: ModuleType, name: str, check: Check, constants: Mapping[str, float]) -> Array:
    """Results side by side, by sample, as the NumPy module has them."""
    arguments, keywords, ndim = check.arguments, check.keywords, check.expected.ndim
    function = module.jacobian_of(keywords["frame"]) if keywords else getattr(module, name)
    alone = arguments[0].ndim == 1
    N = 1 if alone else len(arguments[0])
    results = function.call([np.asarray(a).T for a in (*arguments, *constants.values())])
    arrays = [np.asarray(r).reshape(r.size1(), N, -1).transpose(1, 0, 2) for r in results]
    if name.endswith("derivatives"):
        value = np.concatenate(arrays, axis=2)
    else:
        value = np.stack(arrays, axis=1) if len(arrays) > 1 or ndim + alone > 3 else arrays[0]
    value = value[0] if alone else value
    return value[..., 0] if value.ndim == ndim + 1 and value.shape[-1] == 1 else value


# --- C ---


def c_errors(path: Path, text: str, compiler: str, witness: Witness) -> dict[str, float]:
    """Errors of the functions of a C file, results written past the caches too."""
    name, library = witness.robot.name, path.with_suffix(".so")
    rows = np.arange(TILES) % STATES
    own, constants = witness.own[rows], [*witness.keywords.values(), 0.0]
    N, n, b = own.shape
    found = re.findall(rf"^int32_t {name}_(\w+)\(", text, re.MULTILINE)
    checks = {
        f: replace(
            c,
            arguments=tuple(a[rows] if a.ndim > 1 else a for a in c.arguments),
            expected=c.expected[rows],
        )
        for f in found
        for c in witness.checks.get(f, ())[:1]
    }
    asked = [(f, check, flags) for f, check in checks.items() for flags in (0, 1)]
    calls: list[tuple[str, list[Any], int]] = [
        (f"{name}_{f}", [N, *map(_flat, c.arguments), constants, None, flags], c.expected.size)
        for f, c, flags in asked
    ]
    columns = [_flat(x[rows].T) for x in (witness.q, witness.qd, witness.qdd)]
    try:
        entries, signals, varying = (
            int(re.findall(rf"{name}_{what}_count = (\d+)", text)[0])
            for what in ("entry", "signal", "varying")
        )
        last = (f"{name}_signals", [N, *columns, N, constants, None, N], signals * N)
        job = {
            "library": str(library),
            "calls": [*calls, last],
            "tables": [[f"{name}_entries", 3 * entries]],
        }
        results: list[Any] = []
        for flags in (C_FLAGS, (*C_FLAGS, WITHOUT_AVX512)):
            _run([*compiler.split(), *flags, str(path), "-o", str(library), "-lm"])
            ran = json.loads(_run([sys.executable, "-I", call_c.__file__], json.dumps(job)))
            results += ran[:-2]
        (_, computed), table = ran[-2:]
        row, signal, sign = np.reshape(table, (entries, 3)).T
        store = np.zeros((b * n, N))
        store[row] = sign[:, None] * np.reshape(computed, (signals, N))[signal]
    except (OSError, subprocess.SubprocessError, ValueError, IndexError):
        return {"compile": float("inf")}
    apart = {"abi", "signals", *witness.left_out}
    errors = dict.fromkeys({*found} - {*checks, *apart}, float("inf"))
    errors["signals"] = difference(store.reshape(b, n, N).T, own, 1.0)
    store[row[:varying]] = 0.0  # the functions leave to their caller what is constant
    for (f, check, _), (status, numbers) in zip(2 * asked, results, strict=True):
        shape = check.expected.shape[1:]
        if MODELS[f].by_columns:
            value = (np.reshape(numbers, (*shape[::-1], N)) + store.reshape(b, n, N)).T
        else:
            value = np.moveaxis(np.reshape(numbers, (*shape, N)), -1, 0)
        worst = float("inf") if status else difference(value, check.expected, check.scale)
        errors[f] = max(errors.get(f, 0.0), worst)
    return errors | {"SOURCE_SHA256": 0.0 if f'"{witness.robot.sha256}"' in text else float("inf")}


def _flat(a: Array) -> list[float]:
    return [float(x) for x in a.ravel()]


def _run(command: list[str], given: str = "") -> str:
    """What a command prints. Raises SubprocessError where it fails, or takes too long."""
    return subprocess.run(
        command, input=given, capture_output=True, text=True, timeout=LONGEST_RUN, check=True
    ).stdout
