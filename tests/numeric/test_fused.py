"""The fused kernels against scipy, entry by entry and ends included, and least squares on their rows
against lstsq.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess

import numpy as np
import pytest
from campaign import campaign, sampled
from fused_data import in_c, needs_compiler, own_cache
from scipy.signal import cheby1, sosfiltfilt

from oracles.random_robots import random_robot
from runtime.errors import InputError
from runtime.estimators.solution import solve
from runtime.model.compile_cache import NotCompiledError
from runtime.model.compiled import CompiledModel
from runtime.model.loading import cache_folder
from runtime.resolution.c import kernels as fused
from runtime.resolution.c.kernels import (
    FilteredStates,
    Positions,
    Room,
    SignalEntries,
    decimated,
)
from runtime.resolution.c.self_test import unavailable
from runtime.settings.study import Decimate, Lowpass, Signals
from runtime.signals.filters import filtered_states, kept_samples
from symgen.description import load_robot

pytestmark = needs_compiler

RATE = 1000.0
WARNINGS = ["-Wall", "-Wextra", "-pedantic", "-Werror", "-Wmissing-prototypes", "-Wshadow"]
PLAIN = Signals(median=1, lowpass=None, decimate=None)
Array = np.ndarray


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        own_cache(tmp_path_factory.mktemp("cache"), patch)
        yield
    own_cache(cache_folder().parent, pytest.MonkeyPatch())


@pytest.fixture(scope="module")
def planar(tmp_path_factory) -> CompiledModel:
    return in_c(load_robot("planar_2r"), tmp_path_factory.mktemp("planar"))


def walk(N: int, n: int, seed: int = 0) -> Array:
    """A position record, shape (N, n): slow motion and measurement noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(N)[:, None] / RATE
    return np.sin(t * rng.uniform(2, 9, n) + rng.uniform(0, 6, n)) * rng.uniform(
        0.5, 2, n
    ) + 1e-5 * rng.standard_normal((N, n))


def test_the_kernels_pass_their_own_check():
    assert unavailable() == ""


def filtered(
    q: Array, signals: Signals, room: Room | None = None, rate: float = RATE, **moved: object
) -> FilteredStates:
    """States of positions q, shape (N, n)."""
    room = room or Room()
    return FilteredStates(Positions(q, signals.median, room), rate, signals, room, **moved)


@pytest.mark.parametrize(
    ("n", "N", "signals"),
    [
        (2, 300, Signals(median=1)),
        (1, 16, Signals(median=1, lowpass=Lowpass(cutoff=80, order=4, padding="scipy"))),
        (6, 301, Signals(median=5, ends="second-order")),
        (8, 64, Signals(median=1, lowpass=Lowpass(cutoff=80, order=3))),
        (9, 120, Signals(median=1, lowpass=Lowpass(cutoff=80, order=1, on=("q",)))),
        (17, 200, Signals(median=1, lowpass=Lowpass(cutoff=200, order=20, on=("qd",)))),
        (3, 3, Signals(median=1, lowpass=None, ends="second-order")),
        (3, 2, Signals(median=1, lowpass=None)),
    ],
)
@pytest.mark.parametrize("order", ["C", "F"])
def test_states_are_those_of_scipy(n, N, signals, order):
    q = walk(N, n)
    found = filtered(np.asarray(q, order=order), signals)
    expected = filtered_states(q, RATE, signals)
    for x, right in zip(
        found.rows(slice(0, N)), (expected.q, expected.qd, expected.qdd), strict=True
    ):
        if platform.machine() == "x86_64":  # the same operations in the same order
            np.testing.assert_array_equal(x, right.T)
        np.testing.assert_allclose(x, right.T, rtol=0, atol=1e-14 * max(1, np.abs(right).max()))
    if N > 20:
        np.testing.assert_array_equal(found.rows(slice(7, 13)), found.rows(slice(0, N))[..., 7:13])


def test_positions_moved_by_one_step():
    q, up = walk(200, 3), np.random.default_rng(1).integers(0, 2, (200, 3), dtype=np.uint8)
    packed = np.append(np.packbits(up), np.uint8(0))
    found = filtered(q, Signals(median=1), up=packed, step=1e-3).rows(slice(0, 200))
    right = filtered(q + 1e-3 * (2.0 * up - 1), Signals(median=1)).rows(slice(0, 200))
    np.testing.assert_array_equal(found, right)


def store(entries: SignalEntries, y: Array) -> Array:
    """Rows of signals as columns by joints, shape (b, n, K)."""
    filled = np.zeros((len(entries.names), entries.n, y.shape[1]))
    joints = np.repeat(np.arange(entries.n), np.diff(entries.start))
    filled[entries.place, joints] = entries.sign[:, None] * y[entries.number]
    return filled


def scipy_decimate(u: Array, factor: int, phase: str, padding: str) -> Array:
    """Chebyshev I forward and backward over all samples, then the kept ones."""
    sos = cheby1(8, 0.05, 0.8 / factor, output="sos")
    return sosfiltfilt(sos, u, axis=-1, padlen=27 if padding == "scipy" else 24)[
        ..., kept_samples(u.shape[-1], factor, phase)
    ]


@pytest.mark.parametrize(
    ("N", "factor", "phase", "padding"),
    [
        (28, 2, "first", "scipy"),
        (25, 2, "last", "matlab"),
        (300, 3, "last", "scipy"),
        (641, 10, "first", "matlab"),
        (1999, 40, "last", "scipy"),
        (2600, 40, "first", "scipy"),
        (45, 50, "first", "scipy"),
        (1507, 100, "last", "matlab"),
        (2750, 500, "first", "scipy"),
    ],
)
def test_decimated_signals_are_those_of_scipy(N, factor, phase, padding, planar):
    q = walk(N + 40, 2, seed=factor)
    settings, samples, room = (
        Decimate(factor=factor, phase=phase, padding=padding),
        slice(17, 17 + N),
        Room(),
    )
    states = filtered(q, PLAIN, room)
    entries = SignalEntries(planar, planar.BASE_PARAMETERS)
    y = decimated(entries, states, samples, factor, settings, planar.constant_values({}), room)
    expected = filtered_states(q, RATE, PLAIN)[samples]
    D = planar.module.regressor(expected.q, expected.qd, expected.qdd).transpose(2, 1, 0)
    right = scipy_decimate(np.ascontiguousarray(D), factor, phase, padding)
    largest = np.abs(D).max(axis=(1, 2), keepdims=True)
    assert np.all(np.abs(store(entries, y) - right) <= (2e-14 + 2e-15 * factor**2) * largest)
    assert np.shares_memory(y, room.array("y", len(entries.whole_groups), y.shape[1]))


@pytest.mark.parametrize("seed", sampled([1, 4, 9], 1))
def test_random_robots_entry_by_entry(seed, tmp_path):
    """Prismatic joints, trees, couplings; some columns only, in an order of their own; other
    constants than the file's.
    """
    model = in_c(random_robot(seed), tmp_path)
    n, room, rng = len(model.JOINTS), Room(), np.random.default_rng(seed)
    names = tuple(
        rng.permutation(model.BASE_PARAMETERS)[: max(2, len(model.BASE_PARAMETERS) - 3)].tolist()
    )
    changed = {name: value + 0.1 for name, value in list(model.CONSTANTS.items())[:1]}
    q, samples = walk(700, n, seed), slice(3, 690)
    states, entries = filtered(q, Signals(median=1), room), SignalEntries(model, names)
    expected = filtered_states(q, RATE, Signals(median=1))[samples]
    D = model.module.regressor(expected.q, expected.qd, expected.qdd, **changed).transpose(2, 1, 0)
    D = np.ascontiguousarray(D[[model.BASE_PARAMETERS.index(name) for name in names]])
    for factor in (1, 12):
        y = decimated(
            entries,
            states,
            samples,
            factor,
            Decimate(factor=factor),
            model.constant_values(changed),
            room,
        )
        right = D if factor == 1 else scipy_decimate(D, factor, "first", "scipy")
        largest = np.abs(D).max(axis=(1, 2), keepdims=True)
        assert np.all(np.abs(store(entries, y) - right) <= 1e-12 * largest)


def system(
    planar: CompiledModel, K: int, seed: int
) -> tuple[SignalEntries, Array, Array, Array, Array]:
    """SignalEntries, made-up signals, torques and mask; W in the rows that the mask keeps."""
    rng = np.random.default_rng(seed)
    entries = SignalEntries(planar, planar.BASE_PARAMETERS)
    y, Y, mask = (
        rng.standard_normal((len(entries.wanted), K)),
        rng.standard_normal((2, K)),
        rng.random((2, K)) < 0.8,
    )
    D = store(entries, y)
    return entries, y, Y, mask, np.vstack([D[:, j, mask[j]].T for j in range(2)])


@pytest.mark.parametrize("K", [40, 511, 512, 513, 2500])
def test_least_squares_of_kept_rows(K, planar):
    """Two records; rows left out by joint."""
    entries, y, Y, mask, W = system(planar, K, 1)
    _, y2, Y2, mask2, W2 = system(planar, 30, 2)
    factor = entries.factor([(y, Y, mask), (y2, Y2, mask2)])
    every, right = np.vstack([W, W2]), np.concatenate([Y[mask], Y2[mask2]])
    X = np.linalg.lstsq(every, right, rcond=None)[0]
    fit, unit = solve(factor), every / np.linalg.norm(every, axis=0)
    np.testing.assert_allclose(fit.X, X, rtol=1e-12, atol=1e-13)
    assert np.isclose(fit.residual_norm, np.linalg.norm(right - every @ X), rtol=1e-12)
    assert np.isclose(fit.cond_unit, np.linalg.cond(unit), rtol=1e-9)
    assert [joint.rows for joint in factor.joints] == [
        int(mask[j].sum() + mask2[j].sum()) for j in range(2)
    ]


def test_columns_that_rows_do_not_tell_apart(planar):
    """Near ones are solved to their digits; of a column without effect the least norm is taken."""
    entries, y, Y, mask, _ = system(planar, 400, 3)
    first, second = entries.number[0], next(k for k in entries.number if k != entries.number[0])
    for apart in (1e-2, 1e-7, 0.0):
        near = y.copy()
        near[second] = near[first] + apart * y[second] if apart else 0.0
        D = store(entries, near)
        W = np.vstack([D[:, j, mask[j]].T for j in range(2)])
        residual = np.linalg.norm(Y[mask] - W @ solve(entries.factor([(near, Y, mask)])).X)
        best = np.linalg.norm(Y[mask] - W @ np.linalg.lstsq(W, Y[mask], rcond=None)[0])
        assert np.isclose(residual, best, rtol=1e-10)


def test_refusals(planar):
    room, q = Room(), walk(20, 2)
    with pytest.raises(InputError, match="20 samples"):
        decimated(SignalEntries(planar, planar.BASE_PARAMETERS), filtered(q, PLAIN, room), slice(0, 20), 2, Decimate(factor=2),
                  planar.constant_values({}), room)  # fmt: skip
    with pytest.raises(InputError, match="12 samples"):
        filtered(q[:12], Signals(median=1), room)
    with pytest.raises(InputError, match=r"signals\.lowpass\.cutoff"):
        filtered(q, Signals(median=1), room, rate=90.0)
    with pytest.raises(InputError, match="refused arguments"):
        filtered(q, PLAIN, room).rows(slice(5, 30))
    with pytest.raises(InputError, match="5 bytes for 40 bits; expected one byte more"):
        filtered(q, PLAIN, room, up=np.zeros(5, dtype=np.uint8), step=1.0)
    with pytest.raises(InputError, match="no column nothing"):
        SignalEntries(planar, ("nothing",))
    with pytest.raises(InputError, match="no constant nothing"):
        planar.constant_values({"nothing": 1.0})


def test_another_interface_is_refused(tmp_path):
    (tmp_path / "other.c").write_text(
        fused.SOURCE.read_text().replace(f"#define ABI {fused.ABI}", "#define ABI 77")
    )
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))))
    (tmp_path / "kernels.c").write_text((tmp_path / "other.c").read_text())
    subprocess.run(
        [compiler, "-std=c11", "-O0", "-shared", "-fPIC", "kernels.c", "-o", "other.so"],
        cwd=tmp_path,
        check=True,
    )
    with pytest.raises(NotCompiledError, match="interface 77"):
        fused._opened(tmp_path / "other.so")


def test_subnormal_numbers_survive():
    fused.library()
    assert np.float64(1e-310) * 1.0 > 0


@pytest.mark.parametrize("compiler", [c for c in ("gcc", "clang") if shutil.which(c)])
@pytest.mark.parametrize(
    "variant",
    [
        "",
        *(pytest.param(flag, marks=campaign) for flag in ("-DPORTABLE", "-DSCALAR", "-DDOUBLES=8")),
    ],
)
def test_no_warnings(compiler, variant, tmp_path):
    """As it is compiled, without the parts for one processor, and as a compiler without vector
    types reads it.
    """
    flags = [*fused.FUSED_FLAGS, *WARNINGS, *([variant] if variant else [])]
    done = subprocess.run(
        [compiler, *flags, str(fused.SOURCE), "-o", str(tmp_path / "fused.so")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


@campaign
@pytest.mark.parametrize(
    "variant", ["-DPORTABLE", *(pytest.param(flag, marks=campaign) for flag in ("-DSCALAR", "-O1"))]
)
def test_clean_under_sanitizers_and_the_same_numbers(variant, tmp_path):
    """A driver with arrays of exact size, which prints a checksum of every result; the plain loops
    give the same to rounding.
    """
    sums = {}
    for flags in (
        ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", variant],
        ["-O3"],
    ):
        (tmp_path / "kernels.c").write_text(fused.SOURCE.read_text())
        (tmp_path / "driver.c").write_text(DRIVER)
        compiler = next(filter(None, map(shutil.which, ("gcc", "clang", "cc"))))
        line = [compiler, "-std=c11", "-ffp-contract=off", *flags, "driver.c", "-o", "driver"]
        built = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
        if "cannot find" in built.stderr:
            pytest.skip("no sanitizer libraries")
        assert built.returncode == 0, built.stderr
        environment = {**os.environ, "ASAN_OPTIONS": "detect_leaks=0"}  # the driver frees nothing
        done = subprocess.run(
            [str(tmp_path / "driver")], capture_output=True, text=True, check=False, env=environment
        )
        assert (done.returncode, done.stderr) == (0, "")
        sums[len(flags)] = np.array(done.stdout.split(), dtype=float)
    first, second = sums.values()
    assert len(first) == 2 and np.isfinite(first).all() and (first != 0).all()
    np.testing.assert_allclose(first, second, rtol=1e-10)


DRIVER = r"""
#include "kernels.c"
#include <stdio.h>
#include <stdlib.h>
static uint32_t seed = 1;
static double number(void) { seed = seed*1664525u + 1013904223u; return seed/4294967296.0 - 0.5; }
static double *array(int64_t size, int fill)
{
    double *x = malloc((size_t)size*sizeof *x);
    for (int64_t i = 0; i < size; i++) x[i] = fill ? number() : 0.0;
    return x;
}
static void total_of(const double *x, int64_t size)
{
    double sum = 0.0;
    for (int64_t i = 0; i < size; i++) sum += (1.0 + (double)(i % 7))*x[i];
    printf("%.17g\n", sum);
}
static int32_t signals(int64_t m, const double *q, const double *qd, const double *qdd, int64_t stride, const double *c, double *U, int64_t ustride)
{
    for (int64_t s = 0; s < 9; s++)
        for (int64_t t = 0; t < m; t++)
            U[s*ustride + t] = c[0]*q[(s % 3)*stride + t] + (double)s*qd[t] - qdd[2*stride + t]*q[t];
    return 0;
}
int main(void)
{
    enum { N = 203, n = 9, FACTOR = 7, G = 3, blocks = 6, S = 8, T = 16, K = blocks*G + 2, LENGTH = 50, STRIDE = LENGTH + 2*LANES, PAD = 12 };
    double sos[12] = {0.1, 0.2, 0.1, 1, -0.4, 0.1, 1, 2, 1, 1, -0.5, 0.2}, zi[4] = {0.2, -0.1, 0.3, 0.1};
    struct lowpass low = {2, PAD, sos, zi};
    uint8_t *up = malloc(N*n/8 + 2);
    for (int i = 0; i < N*n/8 + 2; i++) up[i] = (uint8_t)(7*i);
    struct states states = {N, n, PAD, 1, 100.0, 0.01, low, low, array(2*N*LANES, 1), up, array(2*(N + 2*PAD)*LANES, 0),
                            array(2*(N + 2*PAD)*LANES, 0), array(2*(N + 2*PAD)*LANES, 0)};
    int32_t bad = fused_states(&states);
    double *q = array(n*N, 0), *qd = array(n*N, 0), *qdd = array(n*N, 0);
    bad |= fused_gather(&states, 0, N, q, qd, qdd, N);
    total_of(qdd, n*N);
    int32_t *wanted = malloc(S*sizeof *wanted);
    for (int32_t s = 0; s < S; s++) wanted[s] = s + 1;
    double one = 1.0;
    struct source from = {signals, &one, 9, S, T, LENGTH, STRIDE, wanted, array(9*T, 0), array(3*n*T, 0), array(S*STRIDE, 0) + LANES};
    struct decimation plan = {3, 150, 5, FACTOR, G, blocks, 2, 30, LENGTH, 2, K, 0.1, array(4*STATE, 1), array((FACTOR + 1)*STATE, 1),
                              array(30*STATE, 1), array(STATE*2*STATE, 1), array((LENGTH + STATE)*2*STATE, 1), array(blocks*S*2*STATE, 0),
                              array(S*STATE, 0), array(S*K, 0)};
    bad |= fused_decimated(&states, &from, &plan);
    total_of(plan.y, S*K);
    return bad;
}
"""
