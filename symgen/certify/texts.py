"""Run emitted source files and compare each function with independently computed values.

A Python module is imported and used in three ways: with arrays of NumPy, with arrays that it may
not write to, and by CasADi. A C file is compiled and called in a process of its own. A file that
cannot run here, for instance without a compiler, is reported as not run.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from base64 import b64decode
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import wrap
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from symgen.certify import call_c, call_octave
from symgen.certify.importing import END, HEAD, imported, without_certificate
from symgen.certify.witness import STATES, Check, Witness
from symgen.derive.exact import Array
from symgen.derive.loops import close
from symgen.derive.models import MODELS
from symgen.derive.regressor import acting, element_names
from symgen.emit.generate import EMITTERS
from symgen.emit.matlab_target import MODEL
from symgen.emit.spec import STATES as STATE_NAMES
from symgen.emit.targets import TARGETS
from symgen.errors import SymgenError
from symgen.version import VERSION

TOLERANCE = 1e-9  # of the largest entry: rounding of some thousand operations, and closed loops
C_FLAGS = ("-std=c99", "-O0", "-ffp-contract=off", "-shared", "-fPIC")
LONGEST_RUN = 300  # s, of the compiler and of the functions
IN_OCTAVE, PASSIVE = "in Octave", "passive_joints"
HELPERS = {"store", "casadi"}
"""Public names that are no models."""
NUMPY, STACKED, CASADI = "on NumPy's arrays", "stacked as for other packages", "by CasADi"
DERIVATIVES = "inverse_dynamics_derivatives"
Use = Callable[[ModuleType, str, Check, Mapping[str, float]], Array]
Call = tuple[str, list[Any], int, float | str]
CLOSED = "closed"  # what closes the loops in C
TILES = 71  # samples of the functions in C: some tiles, the last not full


@dataclass(frozen=True)
class TextCheck:
    """Result of running an emitted source file and comparing it with independent values.

    Attributes
    ----------
    target : str
        Target of the file, such as numpy or c.
    sha256 : str
        Hash of the text without the lines of its certificate.
    errors : mapping
        Largest difference of each function from the independent values, relative to the largest
        entry. The difference is infinite if the function fails, if its result has another shape, or
        if a call without constants differs from a call with the constants of the robot file.
    constants : str
        Name of the constants with which the functions were called.
    left_out : tuple of str
        Functions that have no meaning for this robot.
    uses : tuple of str
        The ways in which a Python module was run.
    not_run : str
        Reason why the file was not run; empty if it was run.
    raised : mapping
        Error message of each function of a Python module that failed.
    """

    target: str
    sha256: str
    errors: Mapping[str, float] = field(default_factory=dict)
    constants: str = ""
    left_out: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()
    not_run: str = ""
    raised: Mapping[str, str] = field(default_factory=dict)

    @property
    def wrong(self) -> list[str]:
        """Names of the functions whose results differ from the independent values, or are NaN."""
        return [name for name, error in self.errors.items() if not error < TOLERANCE]

    @property
    def valid(self) -> bool:
        return not self.wrong and bool(self.errors or self.not_run)

    def checks(self, file: str) -> list[tuple[bool, str]]:
        """List a pair per function: whether its results agree with independent values, and a text
        with its error.
        """
        if self.not_run:
            return [(True, f"{file} {self.sentence}")]
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
        ]

    @property
    def sentence(self) -> str:
        """Sentence for the certificate: which functions were run and agree, or why the file was not
        run.
        """
        if self.not_run:
            return self.not_run
        uses = ", ".join(self.uses)
        if {*self.errors} == {MODEL}:
            return f"names and values are those of the robot file, {uses}"
        return (
            f"{', '.join(self.errors)} at random states, parameters and {self.constants} agree with "
            f"Lagrange's equations and products of frames to {TOLERANCE:g}"
            + f", {uses}"
            * bool(uses)
        )


def text_check(
    file: str,
    text: str,
    target: str,
    witness: Witness,
    beside: Mapping[str, str] | None = None,
) -> TextCheck:
    """Run every function of a source file and compare the results with independent values.

    The lines of a certificate in the text are removed first. `beside` has the texts of files whose
    functions this file may call, by file name.
    """
    text = without_certificate(text)
    key = sha256(text.encode("utf-8")).hexdigest()
    if file.endswith(".m"):
        return octave_check(file, text, target, key, {**(beside or {}), file: text}, witness)
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if file.endswith(".h"):
        return TextCheck(
            target,
            key,
            not_run=f"it declares the functions of {file[:-2]}.c, where their certificate stands",
        )
    if not file.endswith((".py", ".c")):
        return TextCheck(
            target, key, not_run=f"not run: nothing here runs {TARGETS[target].language}"
        )
    if file.endswith(".c") and compiler is None:
        return TextCheck(target, key, not_run="not run: there is no C compiler")
    left_out = tuple(sorted(witness.left_out))
    with TemporaryDirectory(prefix="symgen-", ignore_cleanup_errors=True) as folder:
        path = Path(folder) / file
        path.write_text(text, encoding="utf-8", newline="\n")
        if file.endswith(".c"):
            errors = c_errors(path, text, str(compiler), witness)
            return TextCheck(target, key, errors, witness.drawn, left_out)
        errors, raised, uses = module_errors(path, witness)
    return TextCheck(target, key, errors, witness.drawn, left_out, uses, raised=raised)


# --- what the certificate says ---


def with_certificate(text: str, check: TextCheck, formulas: str) -> str:
    """Add the certificate to a source text: in the docstring of a Python module, else in comments.

    In a docstring the certificate stands at the end; comments stand before the text, but after it
    in MATLAB, whose help is the first comment of a file.
    """
    said = f"{HEAD}{VERSION}: formulas {formulas}; {check.sentence}."
    if not text.startswith('"""'):
        mark = f"{EMITTERS[check.target].language.comment} "
        lines = [*wrap(said, 98 - len(mark)), f"{END}{check.sha256}"]
        comment = "".join(f"{mark}{line}\n" for line in lines)
        return f"{text}\n{comment}" if check.target == "matlab" else comment + text
    docstring, end, rest = text.partition('\n"""\n')
    lines = ["", "", *wrap(said, 98), f"{END}{check.sha256}"]
    return docstring + "\n".join(lines) + end + rest


# --- modules ---


def module_errors(
    path: Path, witness: Witness
) -> tuple[dict[str, float], dict[str, str], tuple[str, ...]]:
    """Run the functions of a Python module and compare the results with independent values.

    Return the error of each function, the messages of functions that failed, and the ways in which
    the module was run.
    """
    try:
        module = imported(path)
    except (RecursionError, MemoryError) as error:
        raise SymgenError(
            f"{path.name} has expressions that are too long for Python; in the robot file, replace "
            "each long sum by one constant"
        ) from error
    except Exception as error:  # a text may fail in any way
        return {"import": float("inf")}, {"import": repr(error)}, ()
    uses: dict[str, Use] = {NUMPY: _called}
    if not witness.tied:
        uses |= {STACKED: _stacked, CASADI: _by_casadi}
    errors: dict[str, float] = {}
    raised = {}
    with _restored(module):
        for how, call in uses.items():
            for name, checks in witness.checks.items():
                if how == CASADI:
                    checks = [c for c in checks if _is_of_casadi(name, c)]
                if not checks:
                    continue
                found, text = largest(module, name, checks, call, witness)
                errors[name] = max(errors.get(name, 0.0), found)
                if text:
                    raised[name] = f"{text} ({how})"
                elif how == CASADI and not any(c.keywords for c in checks):
                    _share_graph(module, name)
        if not witness.tied:
            try:
                errors[DERIVATIVES] = _derivative_error(module, witness)
            except Exception as error:  # a text may fail in any way
                errors[DERIVATIVES], raised[DERIVATIVES] = float("inf"), repr(error)
    try:
        right = same_elements(
            module.elements(**witness.keywords), witness.constants, witness
        ) and same_elements(module.elements(), witness.robot.constants, witness)
    except Exception as error:  # a text may fail in any way
        right, raised["elements"] = False, repr(error)
    errors["elements"] = 0.0 if right else float("inf")
    public = {n for n, value in vars(module).items() if isinstance(value, FunctionType)}
    known = {*errors, *HELPERS, *witness.left_out}
    for name in public - known:
        if not name.startswith("_"):
            errors[name] = float("inf")
    return errors, raised, tuple(uses)


def largest(
    module: ModuleType,
    name: str,
    checks: list[Check],
    call: Use,
    witness: Witness,
) -> tuple[float, str]:
    """Compute the largest error of an emitted function over all its test calls.

    Return the error, and the message if the function failed. The error is infinite if the defaults
    of the function are not the constants of the robot file. With stacked arrays, the defaults are
    not checked again: the run on NumPy's arrays has checked them.
    """
    try:
        errors = [
            difference(c.compared(call(module, name, c, witness.keywords)), c.expected, c.scale)
            for c in checks
        ]
        constants = () if call is _stacked else (witness.defaults, {})
        if len({outcome(call, module, name, checks[0], k) for k in constants}) > 1:
            return (
                float("inf"),
                "values without given constants differ from values with the constants of the robot file",
            )
    except Exception as error:  # a text may fail in any way
        return float("inf"), str(error) or repr(error)
    return max(errors), ""


def outcome(
    call: Use, module: ModuleType, name: str, check: Check, constants: Mapping[str, float]
) -> bytes | str:
    """Call an emitted function; return its result as bytes, or the message of its exception."""
    try:
        return call(module, name, check, constants).tobytes()
    except Exception as error:  # a text may fail in any way
        return str(error)


def difference(value: Any, expected: Array, scale: Array | float) -> float:
    """Compute the largest difference between the arrays `value` and `expected`, divided by `scale`.

    The result is infinite if the shapes differ, or if a difference is NaN.
    """
    value = np.asarray(value, dtype=float)
    if value.shape != expected.shape:
        return float("inf")
    error = np.abs(value - expected)
    error = np.divide(error, scale, out=error, where=error != 0)  # 0/0 is 0
    return float(np.max(np.where(np.isnan(error), np.inf, error), initial=0.0))


def _called(module: ModuleType, name: str, check: Check, constants: Mapping[str, float]) -> Array:
    value = getattr(module, name)(*check.arguments, **check.keywords, **constants)
    return np.stack(value, axis=-2) if isinstance(value, tuple) else np.asarray(value)


def _stacked(module: ModuleType, name: str, check: Check, constants: Mapping[str, float]) -> Array:
    """Call an emitted function in the mode for array packages that do not allow assignment to
    entries.
    """
    vars(module)["_IN_PLACE"] = False
    try:
        return _called(module, name, check, constants)
    finally:
        vars(module)["_IN_PLACE"] = True


def _is_of_casadi(name: str, check: Check) -> bool:
    """Whether a test call of an emitted function is also made by CasADi, not only with NumPy.

    One state has no observation matrix, and CasADi has no blocks of samples. One text gives the
    Jacobians of all frames, so that only two frames and the default frame are run.
    """
    blocks = check.arguments[0].ndim > 1 and len(check.arguments[0]) > STATES
    return name != "observation_matrix" and not blocks and check.keywords.get("frame", 1) <= 2


def _by_casadi(
    module: ModuleType, name: str, check: Check, constants: Mapping[str, float]
) -> Array:
    """Evaluate an emitted function by CasADi at all samples; return results in the shape NumPy
    gives.
    """
    function, arguments = _function(module, name, *check.keywords.values()), check.arguments
    alone, ndim = arguments[0].ndim == 1, check.expected.ndim
    N = 1 if alone else len(arguments[0])
    given = dict(zip(function.name_in(), map(np.transpose, arguments), strict=False))
    results = function(**given, **constants)
    labels = function.name_out()
    if name == "passive_joints":  # positions, rates, accelerations, of what is given
        labels = labels[: len(arguments)]
    arrays = [np.asarray(results[label]) for label in labels]
    arrays = [r.reshape(len(r), N, -1).transpose(1, 0, 2) for r in arrays]
    value = np.stack(arrays, axis=1) if len(arrays) > 1 or ndim + alone > 3 else arrays[0]
    value = value[0] if alone else value
    return value[..., 0] if value.ndim == ndim + 1 and value.shape[-1] == 1 else value


@lru_cache(maxsize=64)
def _function(module: ModuleType, name: str, *frame: int) -> Any:
    return module.casadi(name, frame=frame[0]) if frame else module.casadi(name)


@contextmanager
def _restored(module: ModuleType) -> Iterator[None]:
    """Restore the functions of a module after the block."""
    own = dict(vars(module))
    try:
        yield
    finally:
        vars(module).update(own)


def _share_graph(module: ModuleType, name: str) -> None:
    """Let a checked function of CasADi take the place of the module's function `name`.

    Other functions that call `name` then share its expression graph and do not run its text again;
    for instance, forward_dynamics calls inverse_dynamics.
    """
    function = _function(module, name)

    def shared(*columns: Any, **inputs: Any) -> Any:
        given = dict(zip(function.name_in(), columns, strict=False))
        values = [*function(**given, **inputs).values()]
        return values if len(values) > 1 else values[0]

    vars(module)[name] = shared


def _derivative_error(module: ModuleType, witness: Witness) -> float:
    """Compare the emitted derivatives dGamma/dqdd with inertia matrix A, and dGamma/dX with
    regressor D.

    Return the larger of the two errors.
    """
    function = module.casadi(DERIVATIVES)
    base = () if witness.base is None else (witness.base[0],)
    states = (*base, witness.q[0], witness.qd[0], witness.qdd[0], witness.X)
    *_, A, D = map(np.asarray, function(*states, *witness.keywords.values()))
    joints = witness.A[0][:, -len(witness.q[0]) :]
    return max(
        difference(A, joints, np.abs(witness.A).max()),
        difference(D, witness.own[0], np.abs(witness.own).max()),
    )


def same_elements(table: Any, constants: Mapping[str, float], witness: Witness) -> bool:
    """Whether a module's table of elements (friction, springs, ...) agrees with the robot file.

    The kind, the direction of motion, and the row or form of each element are compared.
    """
    expected = element_names(witness.robot)
    if list(table) != [name for name in witness.robot.parameters if name in expected]:
        return False
    for name, (e, j) in expected.items():
        kind, when, row = table[name]
        right = {i: c.value(constants) for i, c in acting(e, j).items()}
        if (kind, when) != (e.acts_as, e.when or "both") or {*row} != {*right}:
            return False
        if any(abs(row[i] - c) > TOLERANCE * abs(c) for i, c in right.items()):
            return False
    return True


# --- MATLAB ---


def octave_check(
    file: str, text: str, target: str, key: str, texts: Mapping[str, str], witness: Witness
) -> TextCheck:
    """Run the function of a MATLAB file in Octave and compare its results with independent values.

    The function may call the functions of the other `texts`.
    """
    name = file.removeprefix(f"{witness.robot.name}_").removesuffix(".m")
    if call_octave.octave() is None:
        return TextCheck(target, key, not_run="not run: there is no Octave")
    if name in witness.left_out:
        return TextCheck(target, key, not_run=f"not run: {name} has no meaning for this robot")
    try:
        error, message = _octave_error(file.removesuffix(".m"), name, texts, witness)
    except call_octave.OctaveError as failure:
        error, message = float("inf"), str(failure)
    raised = {name: message} if message else {}
    return TextCheck(target, key, {name: error}, witness.drawn, (), (IN_OCTAVE,), raised=raised)


def _octave_error(
    function: str, name: str, texts: Mapping[str, str], witness: Witness
) -> tuple[float, str]:
    """Return the largest error of a MATLAB function over all its test calls, and its error message."""
    if name == MODEL:
        (values,) = call_octave.called(texts, [call_octave.Call(function, [])])
        return (0.0 if _has_names(values, witness) else float("inf")), ""
    checks = witness.checks.get(name, [])
    drawn, defaults = (
        [np.array([*k.values()])] * bool(k) for k in (witness.keywords, witness.defaults)
    )
    calls = [
        call_octave.Call(function, [*_rows(name, c), *drawn], _outputs(name, c)) for c in checks
    ]
    calls += [  # constants that are not given are those of the robot file
        call_octave.Call(function, [*_rows(name, c), *last], _outputs(name, c))
        for c in checks[:1]
        for last in (defaults, [])
    ]
    *results, given, left_out = call_octave.called(texts, calls)
    if any(not np.array_equal(a, b, equal_nan=True) for a, b in zip(given, left_out, strict=True)):
        return float("inf"), "values without given constants differ from those with constants"
    return max(_error_of_rows(name, c, r) for c, r in zip(checks, results, strict=True)), ""


def _outputs(name: str, check: Check) -> int:
    """Return the number of results that a test call requests from a MATLAB function."""
    return len(check.arguments) if name == PASSIVE else 1


def _rows(name: str, check: Check) -> list[Array]:
    """Return the arguments of a test call of a MATLAB function: all states, and the frame."""
    given = [*check.arguments]
    if name == PASSIVE:
        given += [0 * given[0]] * (3 - len(given))
    if name in MODELS and MODELS[name].of_frames:
        given.append(np.array([*check.keywords.values()]))  # empty: the default
    return given


def _error_of_rows(name: str, check: Check, results: list[Array]) -> float:
    """Compare the results of a MATLAB function, which have no last axes of length 1."""
    value = np.stack(results, axis=1) if len(results) > 1 else results[0]
    alone = check.arguments[0].ndim == 1 and name != "base_parameters"
    shape = (1, *check.expected.shape) if alone else check.expected.shape
    long, expected = (list(x) for x in (value.shape, shape))
    for axes in (long, expected):
        while axes[-1:] == [1]:
            axes.pop()
    if long != expected:
        return float("inf")
    value = value.reshape(shape)
    return difference(check.compared(value[0] if alone else value), check.expected, check.scale)


def _has_names(values: list[Array], witness: Witness) -> bool:
    """Whether the names and values of a MATLAB model are those of the robot."""
    regrouping, robot = witness.regrouping, witness.robot
    keys = [call_octave.text_of(x) for x in values[::2]]
    found = dict(zip(keys, values[1::2], strict=True))
    words = {
        "base_parameters": regrouping.names,
        "standard_parameters": robot.parameters,
        "constants": tuple(regrouping.constants),
    }
    known = [b.combination for b in regrouping.base]
    has_X = {name for row in known for name in row} <= {*robot.values}
    numbers: dict[str, list[float]] = {
        "joints": [*robot.joints],
        "constant_values": [*regrouping.constants.values()],
        "standard_values": [robot.values.get(name, np.nan) for name in robot.parameters],
        "X": [
            sum(c.value(robot.constants) * robot.values[name] for name, c in row.items())
            for row in known
        ]
        if has_X
        else [],
    }
    if {*keys} != {*words, *numbers}:
        return False
    right = [call_octave.text_of(found[key]).split() == [*names] for key, names in words.items()]
    right += [
        len(found[key].ravel()) == len(x)
        and np.allclose(found[key].ravel(), x, rtol=TOLERANCE, atol=0, equal_nan=True)
        for key, x in numbers.items()
    ]
    return all(right)


# --- C ---


def c_errors(path: Path, text: str, compiler: str, witness: Witness) -> dict[str, float]:
    """Compile a C file, run its functions, and return the largest numerical error of each function.

    Functions of several samples and functions of one state are both run.
    """
    name, library = witness.robot.name, path.with_suffix(".so")
    rows = np.arange(TILES) % STATES
    constants = [*witness.keywords.values(), 0.0]
    found = re.findall(rf"^int32_t {name}_(\w+)\(\s*int64_t", text, re.MULTILINE)
    several = [(f, check) for f in found for check in witness.checks.get(f, ())[:1]]
    single = [(f, check) for f, check in _of_one_state(name, text, witness) if f != CLOSED]
    try:
        _run([*compiler.split(), *C_FLAGS, str(path), "-o", str(library), "-lm"])
        closed = _closed(library, witness, constants) if witness.tied else None
        if closed is not None and np.isnan(closed).any():
            return {f"{CLOSED}1": float("inf")}

        def given(f: str, check: Check, k: Any) -> list[list[float]]:
            """List the values of the arguments with which a C function is called for the samples k.

            A closed mechanism has one struct with all its states.
            """
            model = MODELS[f].on(witness.robot)
            named = dict(zip(model.arguments, check.arguments, strict=True))
            if closed is not None:
                named = {"s": closed} | {x: a for x, a in named.items() if x not in STATE_NAMES}
            return [*(_flat(a[k] if a.ndim > 1 else a) for a in named.values()), constants]

        calls: list[Call] = [  # rows that are always zero are not written
            (f"{name}_{f}", [TILES, *given(f, c, rows), None], c.expected[rows].size, 0.0)
            for f, c in several
        ]
        calls += [
            (
                f"{name}_{f}1",
                [*c.keywords.values(), *given(f, c, k), None],
                c.expected[k].size,
                np.nan,
            )
            for f, c in single
            for k in range(len(c.expected))
        ]
        results = iter(_results(library, calls))
    except (OSError, subprocess.SubprocessError, ValueError):
        return {"compile": float("inf")}
    unknown = {*found} - {f for f, _ in several}
    unknown |= {f"{f}1" for f in _one_state(name, text)} - {f"{f}1" for f, _ in single}
    unknown -= {*witness.left_out, *(f"{f}1" for f in witness.left_out)}
    unknown -= {f"{CLOSED}1"} if closed is not None else set()
    errors = dict.fromkeys(unknown, float("inf"))
    if closed is not None:
        place = [witness.robot.moving.index(j) for j in close(witness.robot).independent]
        motion = np.hstack([x[:, place] for x in (witness.x, witness.xd, witness.xdd)])
        size = np.abs(motion).max(axis=0)
        errors[f"{CLOSED}1"] = difference(closed[:, : motion.shape[1]], motion, size)
    for f, check in several:
        status, numbers = next(results)
        shape = _stored(f, check.expected.shape[1:])
        value = np.moveaxis(np.reshape(numbers, (*shape, TILES)), -1, 0)
        value = value.transpose(0, 2, 1) if MODELS[f].by_columns else value
        errors[f] = float("inf") if status else difference(value, check.expected[rows], check.scale)
    for f, check in single:
        value = np.array([next(results)[1] for _ in check.expected])
        value = value.reshape(len(value), *_stored(f, check.expected.shape[1:]))
        value = value.transpose(0, 2, 1) if MODELS[f].by_columns else value
        worst = difference(check.compared(value), check.expected, check.scale)
        errors[f"{f}1"] = max(errors.get(f"{f}1", 0.0), worst)
    return errors


def _closed(library: Path, witness: Witness, constants: list[float]) -> Array:
    """Run the compiled C function that closes the loops at every test state; return the closed
    states.

    A state is NaN if Newton's method fails.
    """
    name, closure = witness.robot.name, close(witness.robot)
    n, m = len(witness.robot.joints), len(closure.tied)
    calls: list[Call] = [
        (
            f"{name}_{CLOSED}1",
            [*map(_flat, state), constants, None],
            3 * (n + m) + m * n + m,
            f"{name}_start",
        )
        for state in zip(witness.q, witness.qd, witness.qdd, strict=True)
    ]
    results = _results(library, calls)
    return np.array([[np.nan if status else x for x in numbers] for status, numbers in results])


def _results(library: Path, calls: list[Call]) -> list[tuple[Any, Array]]:
    """Call functions of a C library in another process; return status and result of each call."""
    job = {"library": str(library), "calls": calls}
    found = json.loads(_run([sys.executable, "-I", call_c.__file__], json.dumps(job)))
    return [(status, np.frombuffer(b64decode(numbers))) for status, numbers in found]


def _of_one_state(name: str, text: str, witness: Witness) -> Iterator[tuple[str, Check]]:
    """Yield each C function that computes one sample per call, with its expected values.

    A function with a frame as argument has one check per frame.
    """
    for f in _one_state(name, text):
        every = [c for c in witness.checks.get(f, ()) if c.arguments[0].ndim > 1]
        framed = [c for c in every if c.keywords.get("frame")]
        yield from ((f, check) for check in framed or every[:1])


def _one_state(name: str, text: str) -> list[str]:
    found = re.findall(rf"^(?:void|int32_t) {name}_(\w+)1\(", text, re.MULTILINE)
    return list(dict.fromkeys(found))


def _stored(f: str, shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape in which C stores a result; axes are reversed if the model is stored by
    columns.
    """
    return shape[::-1] if MODELS[f].by_columns else shape


def _flat(a: Array) -> list[float]:
    return [float(x) for x in a.ravel()]


def _run(command: list[str], given: str = "") -> str:
    """Run a command of the operating system, such as the C compiler, and return its output as text.

    SubprocessError is raised if the command fails or needs too much time.
    """
    return subprocess.run(
        command, input=given, capture_output=True, text=True, timeout=LONGEST_RUN, check=True
    ).stdout
