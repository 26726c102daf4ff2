"""Models in C: the API and the values of the NumPy module, the cache, and NumPy with one reason
wherever C cannot be had.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from runtime import load_model
from runtime.compiled.model import CompiledModel, FallbackWarning, compiled_model
from runtime.core.errors import InputError
from runtime.core.loading import cache_folder
from runtime.core.model import GeneratedModel
from runtime.core.rows.regressor import Columns
from runtime.core.signals.filters import States, decimation_plan
from runtime.core.study import Decimate
from symgen.description import load_robot
from symgen.emit.generate import generate_files

NAME = "planar_2r"
needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Module and C file of one robot."""
    folder = tmp_path_factory.mktemp("models")
    for name, text in generate_files(
        load_robot(NAME), targets=("numpy", "c"), command=NAME
    ).items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def model(folder: Path) -> GeneratedModel:
    return load_model(NAME, folder=folder, trust=True)


@pytest.fixture(scope="module")
def warm(tmp_path_factory: pytest.TempPathFactory, model: GeneratedModel) -> Path:
    """A cache that holds the compiled robot; only read by the tests."""
    cache = tmp_path_factory.mktemp("cache")
    compiled_model(model, cache=cache)
    return cache


def states(N: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-2, 2, (3, N, 2))


def in_c(model: GeneratedModel, cache: Path, **options: Path) -> CompiledModel:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = compiled_model(model, cache=cache, **options)
    assert isinstance(found, CompiledModel)
    return found


def refused(model: GeneratedModel, reason: str, **options: Path) -> None:
    """NumPy serves, and one warning says why."""
    with pytest.warns(FallbackWarning, match=reason) as seen:
        assert compiled_model(model, **options) is model
    assert len(seen) == 1


@needs_compiler
@pytest.mark.parametrize("N", [0, 1, 63, 64, 129, 1024])
def test_the_api_of_the_module(N: int, model: GeneratedModel, warm: Path) -> None:
    c, (q, qd, qdd), X = (
        in_c(model, warm),
        states(N),
        np.arange(1.0, 1 + len(model.BASE_PARAMETERS)),
    )
    calls = {
        "regressor": (q, qd, qdd),
        "observation_matrix": (q, qd, qdd),
        "inverse_dynamics": (q, qd, qdd, X),
        "inertia_matrix": (q, X),
        "bias": (q, qd, X),
        "gravity": (q, X),
        "forward_dynamics": (q, qd, qdd, X),
        "frame_poses": (q,),  # not in C
    }
    for name, arguments in calls.items():
        found, expected = getattr(c, name)(*arguments), getattr(model, name)(*arguments)
        assert found.shape == expected.shape and found.strides == expected.strides
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    if N:
        one = [x[0] for x in (q, qd, qdd)]
        np.testing.assert_allclose(c.regressor(*one), model.regressor(*one), rtol=1e-12, atol=1e-12)
        assert c.inverse_dynamics(*one, X).shape == (2,)
    assert c.BASE_PARAMETERS == model.BASE_PARAMETERS and c.NAME == NAME


@needs_compiler
def test_stores_and_constants(model: GeneratedModel, warm: Path) -> None:
    c, given = in_c(model, warm), states(70)
    out = c.store(70)
    W = c.observation_matrix(*given, out=out)
    assert np.shares_memory(W, out) and W.flags.f_contiguous
    name = next(iter(model.CONSTANTS))
    np.testing.assert_allclose(
        c.regressor(*given, **{name: 0.7}),
        model.regressor(*given, **{name: 0.7}),
        rtol=1e-12,
        atol=1e-12,
    )
    fortran = [np.asfortranarray(x) for x in given]
    assert np.array_equal(c.regressor(*fortran, out=out), c.regressor(*given))
    assert np.array_equal(
        c.regressor(*(x.astype(np.float32) for x in given)),
        c.regressor(*(x.astype(np.float32).astype(float) for x in given)),
    )
    for wrong in (np.zeros(out.shape), out[:], c.store(69)):
        with pytest.raises(ValueError, match=r"expected store\(70\)"):
            c.regressor(*given, out=wrong)
    with pytest.raises(InputError, match="no constant unknown"):
        c.regressor(*given, unknown=1.0)


@needs_compiler
@pytest.mark.parametrize(
    "wrong", [np.zeros((69, 2)), np.zeros((70, 3)), np.zeros((1, 70, 2)), np.zeros(2)]
)
def test_shapes_are_checked_before_c_reads(
    wrong: np.ndarray, model: GeneratedModel, warm: Path
) -> None:
    c, (q, qd, _) = in_c(model, warm), states(70)
    with pytest.raises(InputError, match="expected"):
        c.regressor(q, qd, wrong)


@needs_compiler
@pytest.mark.parametrize("changed", [False, True])
def test_decimated_columns_of_both(model: GeneratedModel, warm: Path, changed: bool) -> None:
    """W by the regressor in C, all columns and some in another order, with the
    constants of the file and with one changed.
    """
    constants = {next(iter(model.CONSTANTS)): 0.7} if changed else {}
    given, c = States(*states(903)), in_c(model, warm)
    names = model.BASE_PARAMETERS
    for columns in (None, [names[3], names[0], names[-1]]):
        for plan in (decimation_plan(903, 4, Decimate(factor=4)), None):
            found, expected = (
                Columns(m, columns, constants).decimated(given, plan) for m in (c, model)
            )
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@needs_compiler
@pytest.mark.parametrize("shift", range(8))
def test_streamed_rows_at_every_place_in_a_cache_line(
    model: GeneratedModel, warm: Path, shift: int
) -> None:
    """Written past the caches in whole lines: the bits of ordinary stores, nothing beside the rows,
    whatever their length.
    """
    c = in_c(model, warm)
    constants, (b, n) = np.array([*model.CONSTANTS.values(), 0.0]), model.STRUCTURE.shape
    for N in (*range(1, 68), 203):
        given, results = states(N), []
        for flags in (0, 1):
            memory = np.full(b * n * N + 32, np.nan)
            start = (-memory.ctypes.data // 8) % 8 + 8 + shift
            rows = memory[start : start + b * n * N]
            pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*given, constants, rows)]
            assert (
                c._library.planar_2r_regressor(ctypes.c_int64(N), *pointers, ctypes.c_int32(flags))
                == 0
            )
            assert np.isnan(memory[:start]).all() and np.isnan(memory[start + b * n * N :]).all()
            results.append(rows)
        assert np.array_equal(*results, equal_nan=True) and np.isfinite(results[0]).any(), N


@needs_compiler
def test_the_cache_is_used_and_repaired(model: GeneratedModel, tmp_path: Path) -> None:
    in_c(model, tmp_path)
    (made,) = tmp_path.iterdir()  # no temporary file is left
    before = made.stat()
    in_c(model, tmp_path)
    assert made.stat().st_mtime_ns == before.st_mtime_ns
    content = made.read_bytes()
    for damaged in (b"", content[: len(content) // 2], content[:-1] + b"x", b"not an object"):
        made.unlink()
        made.write_bytes(damaged)
        in_c(model, tmp_path)
        (made,) = tmp_path.iterdir()
        assert made.read_bytes() != damaged


@needs_compiler
def test_an_object_of_another_processor_is_replaced(model: GeneratedModel, tmp_path: Path) -> None:
    """Whole and of the right name, but not loadable here."""
    in_c(model, tmp_path)
    (made,) = tmp_path.iterdir()
    foreign = bytearray(made.read_bytes())
    foreign[18:20] = b"\xf3\x00"  # machine of the ELF header: RISC-V
    made.unlink()
    wrong = (
        tmp_path / f"{made.stem.partition('-')[0]}-{hashlib.sha256(foreign).hexdigest()[:32]}.so"
    )
    wrong.write_bytes(foreign)
    in_c(model, tmp_path)
    assert not wrong.exists() and len(list(tmp_path.iterdir())) == 1


@needs_compiler
def test_two_processes_at_once(folder: Path, tmp_path: Path) -> None:
    code = (
        "import sys, warnings\nwarnings.simplefilter('error')\nfrom pathlib import Path\nfrom "
        "runtime import load_model\n"
        "from runtime.compiled.model import compiled_model\n"
        f"print(type(compiled_model(load_model('{NAME}', folder=Path(sys.argv[1]), trust=True))).__name__)"
    )
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path / "new")}
    running = [
        subprocess.Popen(
            [sys.executable, "-c", code, str(folder)],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    assert [p.communicate()[0].strip() for p in running] == ["CompiledModel"] * 2
    assert all(p.suffix == ".so" for p in (tmp_path / "new" / "compiled").iterdir())


@needs_compiler
def test_subnormal_numbers_survive(model: GeneratedModel, warm: Path) -> None:
    """Objects linked with -ffast-math set flush-to-zero in the thread that loads them."""
    in_c(model, warm)
    assert (
        float(np.float64(1e-310) * np.float64(1.0)) == 1e-310
        and (np.full(9, 1e-310) * 1.0 == 1e-310).all()
    )


def test_no_compiler(
    model: GeneratedModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    refused(model, "no C compiler", cache=tmp_path)
    monkeypatch.setenv("CC", "absent-cc")
    refused(model, "no C compiler absent-cc", cache=tmp_path)


@needs_compiler
@pytest.mark.parametrize(
    ("compiler", "reason"),
    [
        ("false", "failed with 1"),
        ("gcc -ffast-math", "arithmetic"),
        ("gcc --no-such-flag", "failed"),
        ("true", "failed with 0"),
    ],
)
def test_a_compiler_that_fails(
    compiler: str,
    reason: str,
    model: GeneratedModel,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CC", compiler)
    refused(model, reason, cache=tmp_path)
    assert list(tmp_path.iterdir()) == []


@needs_compiler
def test_sources_that_do_not_fit(model: GeneratedModel, folder: Path, tmp_path: Path) -> None:
    text = (folder / f"{NAME}.c").read_text(encoding="utf-8")
    source, cache = tmp_path / f"{NAME}.c", tmp_path / "cache"
    refused(model, "there is no", source=source, cache=cache)
    wrong = {
        "syntax": (text + "int", "failed with 1"),
        "robot": (text.replace(model.SOURCE_SHA256, "0" * 64), "different robot files"),
        "interface": (
            text.replace("_abi(void) { return 2; }", "_abi(void) { return 99; }"),
            "interface 99",
        ),
        "name": (text.replace(f"{NAME}_", "other_"), "not that of"),
        "values": (text.replace("D[0][t] =", "D[0][t] = 3.0 +", 1), "differs from NumPy"),
    }
    for content, reason in wrong.values():
        source.write_text(content, encoding="utf-8")
        refused(model, reason, source=source, cache=cache)


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_folders_that_cannot_be_used(model: GeneratedModel, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    refused(model, "file", cache=tmp_path / "file" / "cache")
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    if any(map(shutil.which, ("cc", "gcc", "clang"))):
        refused(model, "anyone may write", cache=tmp_path / "open")


@needs_compiler
@pytest.mark.skipif(sys.platform != "linux", reason="nobody may write to /proc")
def test_a_folder_that_cannot_be_written(model: GeneratedModel) -> None:
    refused(
        model,
        "cache folder /proc/symgen: .*; choose another by SYMGEN_CACHE",
        cache=Path("/proc/symgen"),
    )


FULL = """
import resource, sys, warnings
from pathlib import Path
from runtime import load_model
from runtime.compiled.model import compiled_model
model = load_model("planar_2r", folder=Path(sys.argv[1]), trust=True)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), int(sys.argv[3])))
with warnings.catch_warnings(record=True) as seen:
    warnings.simplefilter("always")
    assert compiled_model(model, cache=Path(sys.argv[2])) is model
print(*(warning.message for warning in seen))
"""


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="limits of POSIX")
@pytest.mark.parametrize(
    ("room", "reason"),
    [(100, "choose another by SYMGEN_CACHE"), (1.1, "failed with")],
    ids=["source", "object"],
)
def test_a_full_disk(room: float, reason: str, folder: Path, tmp_path: Path) -> None:
    """Files may not grow: NumPy serves, one line says why, no temporary file is left. The first
    limit is in bytes, the second in C files.
    """
    limit = int(room if room > 2 else room * (folder / f"{NAME}.c").stat().st_size)
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(folder), str(tmp_path / "cache"), str(limit)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (
        reason in done.stdout
        and done.stdout.startswith(f"{NAME}: NumPy in place of C: ")
        and done.stdout.count("\n") == 1
    )
    assert list((tmp_path / "cache").iterdir()) == []


def test_cache_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path / "compiled"
    monkeypatch.delenv("SYMGEN_CACHE")
    assert cache_folder().parts[-2:] == ("symgen", "compiled")
