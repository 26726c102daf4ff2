"""CasADi functions in C: the cache of compiled files, and CasADi's own interpreter with one reason
wherever C cannot be had.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from runtime.core.loading import cache_folder
from runtime.loop.compile_cache import FallbackWarning
from runtime.loop.controller_tick import compiled

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler"
)


def cube() -> Any:
    """A function of one number."""
    x = ca.MX.sym("x")
    return ca.Function("cube", [x], [x**3])


def in_c(cache: Path) -> None:
    """The function is compiled, without a warning, and has its value."""
    function = cube()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = compiled(function, cache)
    assert found is not function
    assert float(found(1.5)) == 1.5**3


def refused(reason: str, cache: Path) -> None:
    """CasADi serves, and one warning says why."""
    function = cube()
    with pytest.warns(FallbackWarning, match=reason) as seen:
        assert compiled(function, cache) is function
    assert len(seen) == 1


@needs_compiler
def test_the_cache_is_used_and_repaired(tmp_path: Path) -> None:
    in_c(tmp_path)
    (made,) = tmp_path.iterdir()  # no temporary file is left
    before = made.stat()
    in_c(tmp_path)
    assert made.stat().st_mtime_ns == before.st_mtime_ns
    content = made.read_bytes()
    for damaged in (b"", content[: len(content) // 2], content[:-1] + b"x", b"not an object"):
        made.unlink()
        made.write_bytes(damaged)
        in_c(tmp_path)
        (made,) = tmp_path.iterdir()
        assert made.read_bytes() != damaged


@needs_compiler
def test_an_object_of_another_processor_is_replaced(tmp_path: Path) -> None:
    """Whole and of the right name, but not loadable here."""
    in_c(tmp_path)
    (made,) = tmp_path.iterdir()
    foreign = bytearray(made.read_bytes())
    foreign[18:20] = b"\xf3\x00"  # machine of the ELF header: RISC-V
    made.unlink()
    wrong = (
        tmp_path / f"{made.stem.partition('-')[0]}-{hashlib.sha256(foreign).hexdigest()[:32]}.so"
    )
    wrong.write_bytes(foreign)
    in_c(tmp_path)
    assert not wrong.exists() and len(list(tmp_path.iterdir())) == 1


AT_ONCE = """
import sys, warnings
warnings.simplefilter("error")
from pathlib import Path
import casadi as ca
from runtime.loop.controller_tick import compiled
x = ca.MX.sym("x")
function = ca.Function("cube", [x], [x**3])
found = compiled(function)
assert found is not function
print(float(found(1.5)))
"""


@needs_compiler
def test_two_processes_at_once(tmp_path: Path) -> None:
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path / "new")}
    running = [
        subprocess.Popen(
            [sys.executable, "-c", AT_ONCE], env=environment, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    assert [p.communicate()[0].strip() for p in running] == ["3.375"] * 2
    assert all(p.suffix == ".so" for p in (tmp_path / "new" / "compiled").iterdir())


@needs_compiler
def test_subnormal_numbers_survive(tmp_path: Path) -> None:
    """Objects linked with -ffast-math set flush-to-zero in the thread that loads them."""
    in_c(tmp_path)
    assert (
        float(np.float64(1e-310) * np.float64(1.0)) == 1e-310
        and (np.full(9, 1e-310) * 1.0 == 1e-310).all()
    )


def test_no_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    refused("no C compiler", tmp_path)
    monkeypatch.setenv("CC", "absent-cc")
    refused("no C compiler absent-cc", tmp_path)


@needs_compiler
@pytest.mark.parametrize(
    ("compiler", "reason"),
    [
        ("false", "failed with exit code 1"),
        ("gcc -ffast-math", "arithmetic"),
        ("gcc --no-such-flag", "failed"),
        ("true", "failed with exit code 0"),
    ],
)
def test_a_compiler_that_fails(
    compiler: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", compiler)
    refused(reason, tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_folders_that_cannot_be_used(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    refused("file", tmp_path / "file" / "cache")
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    if any(map(shutil.which, ("cc", "gcc", "clang"))):
        refused("anyone may write", tmp_path / "open")


@needs_compiler
@pytest.mark.skipif(sys.platform != "linux", reason="nobody may write to /proc")
def test_a_folder_that_cannot_be_written() -> None:
    refused(
        "cache folder /proc/symgen: .*; choose another folder by the variable SYMGEN_CACHE",
        Path("/proc/symgen"),
    )


FULL = """
import resource, sys, warnings
from pathlib import Path
import casadi as ca
from runtime.loop.controller_tick import compiled
x = ca.MX.sym("x")
function = ca.Function("cube", [x], [x**3])
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
with warnings.catch_warnings(record=True) as seen:
    warnings.simplefilter("always")
    assert compiled(function, Path(sys.argv[1])) is function
print(*(warning.message for warning in seen))
"""


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="limits of POSIX")
@pytest.mark.parametrize(
    ("room", "reason"),
    [(100, "choose another folder by the variable SYMGEN_CACHE"), (1.1, "failed with")],
    ids=["source", "object"],
)
def test_a_full_disk(room: float, reason: str, tmp_path: Path) -> None:
    """Files may not grow: CasADi serves, one line says why, no temporary file is left. The first
    limit is in bytes, the second in C files.
    """
    generator = ca.CodeGenerator("cube.c")
    generator.add(cube())
    limit = int(room if room > 2 else room * len(generator.dump().encode()))
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(tmp_path / "cache"), str(limit)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (
        reason in done.stdout
        and done.stdout.startswith(
            "the simulation runs in the interpreter of CasADi, because it cannot run as compiled C: "
        )
        and done.stdout.count("\n") == 1
    )
    assert list((tmp_path / "cache").iterdir()) == []


def test_cache_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path))
    assert cache_folder("compiled") == tmp_path / "compiled"
    monkeypatch.delenv("SYMGEN_CACHE")
    assert cache_folder("compiled").parts[-2:] == ("symgen", "compiled")
