"""The C file: agreement with NumPy on every packaged robot, no warnings, clean under sanitizers,
deterministic, closed to hostile texts.
"""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from math import prod
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from campaign import campaign, sampled, some

from symgen.description import load_robot, packaged_robots, parse_robot
from symgen.emit.generate import generate_files

FLAGS = [
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-pedantic",
    "-Werror",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",
]
FAST = [
    *FLAGS,
    "-O2",
    "-ftree-vectorize",
    "-shared",
    "-fPIC",
]  # as users are told to compile: seconds a robot
SOON = [*FLAGS, "-O0", "-shared", "-fPIC"]
COMPILERS = [c for c in ("gcc", "clang") if shutil.which(c)]
GENERAL_LOOPS = {"four_bar", "five_bar"}  # their functions read a closed state: test_c_loops.py
ROBOTS = [name for name in packaged_robots() if name not in GENERAL_LOOPS]
FUNCTIONS = {
    "regressor": ("q", "qd", "qdd"),
    "inverse_dynamics": ("q", "qd", "qdd"),
    "inertia_matrix": ("q",),
    "bias": ("q", "qd"),
    "gravity": ("q",),
}
needs_compiler = pytest.mark.skipif(not COMPILERS, reason="no C compiler")


@cache
def files(name: str) -> dict[str, str]:
    return generate_files(load_robot(name), targets=("numpy", "c"), command=name)


def numpy_module(name: str, text: str) -> ModuleType:
    module = ModuleType(name)
    exec(compile(text, name, "exec"), module.__dict__)  # noqa: S102 (our own output)
    return module


def compiled(folder: Path, text: str, compiler: str, flags: list[str]) -> Path:
    (folder / "robot.c").write_text(text, encoding="utf-8")
    done = subprocess.run(
        [compiler, *flags, "robot.c", "-o", "robot.so", "-lm"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return folder / "robot.so"


def call(
    library: ctypes.CDLL,
    module: ModuleType,
    name: str,
    states: np.ndarray,
    X: np.ndarray,
    shape: tuple[int, ...],
) -> np.ndarray:
    """The result of one C function, in an array that held zeros; nothing around it is written."""
    N, used = states.shape[1], FUNCTIONS[name]
    memory = np.full(prod(shape) * N + 16, np.nan)
    S = memory[8:-8].reshape(*(shape[::-1] if name == "regressor" else shape), N)
    S[:] = 0
    constants = np.array([*module.CONSTANTS.values(), 0.0])
    arrays = [
        *(np.ascontiguousarray(x) for x in states[: len(used)]),
        *([] if name == "regressor" else [X]),
        constants,
        S,
    ]
    pointers = [ctypes.c_void_p(x.ctypes.data) for x in arrays]
    assert getattr(library, f"{module.NAME}_{name}")(ctypes.c_int64(N), *pointers) == 0
    assert np.isnan(memory[:8]).all() and np.isnan(memory[-8:]).all()
    return np.moveaxis(S.transpose(1, 0, 2) if name == "regressor" else S, -1, 0)


def compare(library: ctypes.CDLL, module: ModuleType, samples: tuple[int, ...]) -> None:
    n, b = len(module.JOINTS), len(module.BASE_PARAMETERS)
    shapes = {"regressor": (n, b), "inertia_matrix": (n, n)}
    X = np.random.default_rng(5).standard_normal(b)
    for N in samples:
        states = np.random.default_rng(N).uniform(-3, 3, (3, N, n))
        for name, used in FUNCTIONS.items():
            arguments = [*states[: len(used)], *([] if name == "regressor" else [X])]
            expected = getattr(module, name)(*arguments)
            found = call(library, module, name, states, X, shapes.get(name, (n,)))
            assert found.shape == expected.shape
            if N:
                scale = np.abs(expected).reshape(-1, expected.shape[-1]).max(axis=0)  # by column
                assert (np.abs(found - expected) <= 1e-12 * scale).all(), (name, N)


@needs_compiler
@pytest.mark.parametrize("name", sampled(ROBOTS, 4, always=("emps_asymmetric", "haptic", "tx40")))
@some(4)
def test_agrees_with_numpy(name: str, tmp_path: Path) -> None:
    """To 1e-12 of each column's maximum: the sums are the same, sines and cosines may differ by
    some units in the last place.
    """
    library = ctypes.CDLL(str(compiled(tmp_path, files(name)[f"{name}.c"], COMPILERS[0], SOON)))
    compare(library, numpy_module(name, files(name)[f"{name}.py"]), (0, 1, 513))


@needs_compiler
@campaign
@pytest.mark.parametrize("name", ROBOTS)
def test_agrees_as_users_compile_it(name: str, tmp_path: Path) -> None:
    library = ctypes.CDLL(str(compiled(tmp_path, files(name)[f"{name}.c"], COMPILERS[0], FAST)))
    compare(library, numpy_module(name, files(name)[f"{name}.py"]), (0, 1, 513, 1024))


@needs_compiler
@pytest.mark.parametrize("level", ["-O1", "-O2", "-O3", "-Os"])
@pytest.mark.parametrize("name", ["planar_2r", pytest.param("five_bar", marks=campaign)])
def test_no_warnings_of_two_joints(name: str, level: str, tmp_path: Path) -> None:
    """gcc -O1 warned of 4 steps of a loop that has at most one (-Waggressive-loop-optimizations)."""
    compiled(tmp_path, files(name)[f"{name}.c"], COMPILERS[0], [*FLAGS, level, "-shared", "-fPIC"])


@needs_compiler
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", [pytest.param("panda", marks=campaign), "sr400"])
def test_portable_path(name: str, compiler: str, tmp_path: Path) -> None:
    library = ctypes.CDLL(
        str(compiled(tmp_path, files(name)[f"{name}.c"], compiler, [*FAST, "-DPORTABLE"]))
    )
    compare(library, numpy_module(name, files(name)[f"{name}.py"]), (1, 131))


@needs_compiler
def test_long_chain(tmp_path: Path) -> None:
    """Ten joints: headings that come again in one body (the columns of the inertia matrix)."""
    frames = "\n".join(
        (
            f"  {j}: {{ant: {j - 1}, sigma: 0, alpha: {('0', '-pi/2', 'pi/2')[j % 3]}, d: L, "
            "theta: "
            f"q{j}, r: 0.1}}"
        )
        for j in range(1, 11)
    )
    robot = parse_robot(
        (
            f"symgen: 1\nname: chain\ngravity: [0, 0, -g]\nconstants: {{g: 9.81, L: "
            f"0.3}}\nframes:\n{frames}\n"
        ).encode(),
        file="chain.yaml",
    )
    emitted_files = generate_files(robot, targets=("numpy", "c"))
    library = ctypes.CDLL(
        str(
            compiled(
                tmp_path,
                emitted_files["chain.c"],
                COMPILERS[0],
                ["-O0", "-shared", "-fPIC", "-ffp-contract=off", "-DPORTABLE"],
            )
        )
    )
    compare(library, numpy_module("chain", emitted_files["chain.py"]), (1, 33))


MAIN = """
#include <stdint.h>
#include <stdlib.h>
int32_t {name}_regressor(int64_t, const double *, const double *, const double *, const double *, double *);
int32_t {name}_inertia_matrix(int64_t, const double *, const double *, const double *, double *);
int main(void)
{{
    const double constants[] = {{{constants}}};
    for (int64_t N = 0; N < 200; N += 33) {{
        double *q = calloc((size_t)(N*{n} + 1), sizeof *q), *X = calloc({b}, sizeof *X);
        double *S = calloc((size_t)(N*{b}*{n} + 1), sizeof *S), *A = calloc((size_t)(N*{n}*{n} + 1), sizeof *A);
        if ({name}_regressor(N, q, q, q, constants, S) || {name}_inertia_matrix(N, q, X, constants, A))
            return 1;
        if ({name}_regressor(-1, q, q, q, constants, S) != 1 || {name}_regressor(N, q, q, NULL, constants, S) != 1)
            return 2;
        free(q), free(X), free(S), free(A);
    }}
    return 0;
}}
"""


OF_ONE_STATE = """
#include <stdlib.h>
#include "robot.h"
int main(void)
{{
    const int32_t frame = {n};
    double *q = calloc({n}, sizeof *q), *X = calloc({b}, sizeof *X), *constants = calloc({k}, sizeof *X);
    double *S = calloc({n}*{b} + 16*{n}, sizeof *S);
{calls}
    free(q), free(X), free(constants), free(S);
    return 0;
}}
"""


def calls_of_one_state(name: str, header: str) -> str:
    """A call of every function of one state that the header declares."""
    given = {"qd": "q", "tau": "q", "J": "S"}
    lines = []
    for f, parameters in re.findall(r"(\w+1)\(([^()]*)\);", re.sub(r"\s+", " ", header)):
        names = [p.split()[-1].lstrip("*") for p in parameters.split(",")]
        stored = names[-1]  # qdd is given, but to forward dynamics
        names = [given.get(x, "q" if x == "qdd" else x) for x in names[:-1]] + ["S"]
        assert f.startswith(name) and stored in ("S", "J", "qdd")
        lines.append(f"    {f}({', '.join(names)});")
    assert len(lines) == 8
    return "\n".join(lines)


def sanitized(folder: Path, main: str, robot: dict[str, str], name: str, *flags: str) -> str:
    """What a program prints on the error stream under the sanitizers of addresses and undefined
    behaviour.
    """
    (folder / "main.c").write_text(main)
    for ending in ("c", "h"):
        (folder / f"robot.{ending}").write_text(robot[f"{name}.{ending}"], encoding="utf-8")
    sanitize = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    command = [COMPILERS[0], *FLAGS, "-O1", *flags, *sanitize, "main.c", "robot.c", "-o", "main"]
    done = subprocess.run(
        [*command, "-lm"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    done = subprocess.run([folder / "main"], capture_output=True, text=True, check=False)
    assert (done.returncode == 0) == (done.stderr == "")
    return done.stderr


def sizes(name: str) -> dict[str, int | str]:
    module = numpy_module(name, files(name)[f"{name}.py"])
    n, b, k = len(module.JOINTS), len(module.BASE_PARAMETERS), len(module.CONSTANTS) + 1
    return {"name": name, "n": n, "b": b, "k": k}


@campaign
@needs_compiler
@pytest.mark.parametrize(
    "path", [[], pytest.param(["-DPORTABLE"], marks=campaign)], ids=["wide", "portable"]
)
def test_sanitizers(path: list[str], tmp_path: Path) -> None:
    module = numpy_module("scara", files("scara")["scara.py"])
    constants = ", ".join(map(repr, [*module.CONSTANTS.values(), 0.0]))
    main = MAIN.format(**sizes("scara"), constants=constants)
    assert sanitized(tmp_path, main, files("scara"), "scara", *path) == ""


@campaign
@needs_compiler
@pytest.mark.parametrize("name", ["tx40", "scara"])
def test_sanitizers_of_one_state(name: str, tmp_path: Path) -> None:
    """Every function of one state is clean; a room that is one too small is seen."""
    robot = files(name)
    calls = calls_of_one_state(name, robot[f"{name}.h"])
    main = OF_ONE_STATE.format(**sizes(name), calls=calls)
    assert sanitized(tmp_path, main, robot, name, "-DPORTABLE") == ""
    text, count = re.subn(
        r"(real T\[\d+\], T_\[)(\d+)\]", lambda m: f"{m[1]}{int(m[2]) - 1}]", robot[f"{name}.c"]
    )
    assert count
    seen = sanitized(tmp_path, main, {**robot, f"{name}.c": text}, name, "-DPORTABLE")
    assert re.search("runtime error|AddressSanitizer", seen)


def test_quantities_have_the_names_of_the_numpy_module() -> None:
    text = files("tx40")["tx40.c"]
    assert (
        "const real W12 = -S2*QP1;" in text
        and "/* Link 2 */" in text
        and "np." not in text
        and "**" not in text.split("*/", 1)[1]
    )


@needs_compiler
@pytest.mark.parametrize(
    "title",
    [
        "*/ int evil(void) { return 1; } /*",
        "a /* b */ c",
        "?\u202e?/ \\",
        "**/*/ */",
        "\n*/",
        "ends in \\",
    ],
)
def test_texts_stay_in_their_comment(title: str, tmp_path: Path) -> None:
    """A robot refuses most such titles itself; the command may hold any file name."""
    robot = replace(load_robot("planar_2r"), title="?? / ** / ?? *")
    text = generate_files(robot, targets=("c",), command=title)["planar_2r.c"]
    compiled(tmp_path, text, COMPILERS[0], [*FLAGS, "-O0", "-shared", "-fPIC"])
    comment, code = text.split("*/", 1)
    assert (
        "evil" not in code
        and comment.count("/*") == 1
        and code == files("planar_2r")["planar_2r.c"].split("*/", 1)[1]
    )


AWKWARD = b"""
symgen: 1
name: awkward
gravity: [0, 0, -m]
constants: {m: 9.81, double: 0.3, TILE: 0.2, y0: 0.1}
frames:
  1: {ant: 0, sigma: 0, alpha: pi/3, d: y0, theta: q1, r: 0}
  2: {ant: 1, sigma: 1, alpha: 1.1, d: double/(TILE*y0), theta: 0.4, r: q2 + TILE}
elements:
  FA: {kind: coulomb, along: all, when: positive}
  FB: {kind: coulomb, along: all, when: negative}
  FC: {kind: viscous, along: all, when: negative}
"""


@needs_compiler
def test_constants_with_the_names_of_c(tmp_path: Path) -> None:
    """Keywords and macros as constants, quotients of products, motion in one direction."""
    made = generate_files(parse_robot(AWKWARD, "awkward.yaml"), targets=("numpy", "c"))
    library = ctypes.CDLL(str(compiled(tmp_path, made["awkward.c"], COMPILERS[0], FAST)))
    compare(library, numpy_module("awkward", made["awkward.py"]), (65,))


@needs_compiler
def test_nan_and_infinity_as_in_numpy(tmp_path: Path) -> None:
    module = numpy_module("planar_2r", files("planar_2r")["planar_2r.py"])
    library = ctypes.CDLL(
        str(compiled(tmp_path, files("planar_2r")["planar_2r.c"], COMPILERS[0], FAST))
    )
    states = np.ones((3, 5, 2))
    states[1, 1, 0], states[1, 2, 1], states[2, 3, 0] = np.nan, np.inf, -np.inf
    b = len(module.BASE_PARAMETERS)
    with np.errstate(invalid="ignore"):
        expected = module.regressor(*states)
    np.testing.assert_allclose(
        call(library, module, "regressor", states, np.ones(b), (2, b)),
        expected,
        rtol=1e-12,
        atol=1e-12,
    )


@needs_compiler
def test_long_bodies_are_cut_into_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of many joints: functions of a size that compilers take; the same numbers."""
    monkeypatch.setattr("symgen.emit.c_target.LONGEST", 0)
    monkeypatch.setattr("symgen.emit.c_target.OF_PART", 7)
    text = generate_files(load_robot("scara"), targets=("c",), command="scara")["scara.c"]
    assert "PART void regressor_part3(" in text and "KERNEL static void regressor" not in text
    library = ctypes.CDLL(str(compiled(tmp_path, text, COMPILERS[0], SOON)))
    compare(library, numpy_module("scara", files("scara")["scara.py"]), (0, 1, 33))
