"""Functions of emitted modules on the arrays of other packages: agreement with NumPy's arrays,
transformations of JAX and PyTorch, float32.
"""

from __future__ import annotations

import importlib
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from campaign import campaign, sampled, some

from symgen.cli.generate import emitted
from symgen.description import load_robot, packaged_robots
from symgen.emit.generate import generate_module

GENERAL_LOOPS = {"four_bar", "five_bar"}  # closed by Newton iteration: NumPy only
ROBOTS = [name for name in packaged_robots() if name not in GENERAL_LOOPS]
TOLERANCE = 1e-12  # of each column's maximum
N = 37


def module(name: str, text: str) -> ModuleType:
    found = ModuleType(name)
    exec(compile(text, name, "exec"), found.__dict__)  # noqa: S102 (our own output)
    return found


@cache
def models(name: str) -> tuple[Any, Any]:
    """The module, and itself with NumPy's arrays taken as those of a package that writes to none."""
    text = generate_module(load_robot(name), command=name)
    stacked = module(name, text)
    stacked._IN_PLACE = False
    return module(name, text), stacked


def package(name: str) -> Any:
    """PyTorch (1 GB) is no part of the extra `test`: where it is missing its tests are skipped, and
    the summary says so.
    """
    found = pytest.importorskip("torch") if name == "torch" else importlib.import_module(name)
    if name == "jax":
        found.config.update("jax_enable_x64", True)
        return importlib.import_module("jax.numpy")
    return found


def host(x: Any) -> np.ndarray:
    return np.asarray(getattr(x, "_array", x))  # array_api_strict keeps its NumPy array there


def deviation(found: Any, expected: Any) -> float:
    """Largest difference in units of each column's maximum."""
    found, expected = host(found), np.asarray(expected)
    assert found.shape == expected.shape and found.dtype == np.float64
    scale = np.abs(expected).max(axis=tuple(range(expected.ndim - 1)))
    return float((np.abs(found - expected) / np.where(scale > 0, scale, 1)).max())


def calls(model: Any) -> dict[str, tuple[np.ndarray, ...]]:
    rng = np.random.default_rng(3)
    q, qd, qdd, tau = rng.uniform(-2, 2, (4, N, len(model.JOINTS)))
    X, standard = (
        rng.uniform(0.5, 1, len(model.BASE_PARAMETERS)),
        rng.uniform(-1, 1, len(model.STANDARD_PARAMETERS)),
    )
    found: dict[str, tuple[np.ndarray, ...]] = {
        "regressor": (q, qd, qdd),
        "observation_matrix": (q, qd, qdd),
        "inverse_dynamics": (q, qd, qdd, X),
        "inertia_matrix": (q, X),
        "bias": (q, qd, X),
        "gravity": (q, X),
        "forward_dynamics": (q, qd, tau, X),
        "frame_poses": (q,),
        "jacobian": (q,),
        "base_parameters": (standard,),
    }
    return found | ({"passive_joints": (q,)} if hasattr(model, "passive_joints") else {})


def agree(name: str, xp: Any) -> None:
    reference, stacked = models(name)
    model = stacked if xp is np else reference
    for function, arguments in calls(reference).items():
        found = getattr(model, function)(*(xp.asarray(x) for x in arguments))
        assert deviation(found, getattr(reference, function)(*arguments)) <= TOLERANCE, function


@pytest.mark.parametrize("name", ROBOTS)
@some(5)
def test_agrees_under_numpy_and_under_the_strict_standard(name):
    agree(name, np)
    agree(name, package("array_api_strict"))


@campaign
@pytest.mark.parametrize(
    "name", sampled(["tx40", "haptic", "sr400", "emps_asymmetric"], 0, always=("emps_asymmetric",))
)
def test_agrees_under_jax(name):
    agree(name, package("jax"))


@pytest.mark.parametrize("name", ROBOTS)
def test_agrees_under_torch(name):
    agree(name, package("torch"))


def test_any_leading_axes_and_passive_rates():
    _, model = models("sr400")
    q, qd, qdd = np.random.default_rng(1).uniform(-1, 1, (3, 4, 5, len(model.JOINTS)))
    grid = model.regressor(q, qd, qdd)
    np.testing.assert_array_equal(grid[2, 3], model.regressor(q[2, 3], qd[2, 3], qdd[2, 3]))
    ahead = model.passive_joints(q + 1e-6 * qd)
    position, velocity, acceleration = model.passive_joints(q, qd, qdd)
    np.testing.assert_allclose((ahead - position) / 1e-6, velocity, atol=1e-8)
    assert acceleration.shape == velocity.shape == (4, 5, len(model.PASSIVE))


def test_constants_are_keywords():
    reference, model = models("tx40")
    q, qd, qdd = calls(reference)["regressor"]
    changed = {"D3": 0.3, "g": 1.6}
    assert (
        deviation(
            model.regressor(q, qd, qdd, **changed), reference.regressor(q, qd, qdd, **changed)
        )
        <= TOLERANCE
    )


@pytest.mark.campaign
def test_jax_compiles_maps_and_differentiates():
    jnp = package("jax")
    import jax

    reference = model = models("planar_2r")[0]
    q, qd, qdd, X = map(jnp.asarray, calls(reference)["inverse_dynamics"])
    expected = reference.inverse_dynamics(*calls(reference)["inverse_dynamics"])
    assert deviation(jax.jit(model.inverse_dynamics)(q, qd, qdd, X), expected) <= TOLERANCE
    assert (
        deviation(
            jax.vmap(model.inverse_dynamics, in_axes=(0, 0, 0, None))(q, qd, qdd, X), expected
        )
        <= TOLERANCE
    )
    by_X = jax.jacfwd(model.inverse_dynamics, argnums=3)(
        q, qd, qdd, X
    )  # the torques are linear in X: this is the regressor
    assert deviation(by_X, reference.regressor(*calls(reference)["regressor"])) <= TOLERANCE
    by_length = jax.grad(lambda D2: model.inverse_dynamics(q, qd, qdd, X, D2=D2)[0, 0])(0.5)
    step = [
        reference.inverse_dynamics(*calls(reference)["inverse_dynamics"], D2=0.5 + h)[0, 0]
        for h in (1e-5, -1e-5)
    ]
    assert float(by_length) == pytest.approx((step[0] - step[1]) / 2e-5, rel=1e-8)


def test_torch_maps_and_differentiates():
    torch = package("torch")
    reference = model = models("planar_2r")[0]
    q, qd, qdd, X = map(torch.asarray, calls(reference)["inverse_dynamics"])
    mapped = torch.func.vmap(model.inverse_dynamics, in_dims=(0, 0, 0, None))(q, qd, qdd, X)
    assert (
        deviation(mapped, reference.inverse_dynamics(*calls(reference)["inverse_dynamics"]))
        <= TOLERANCE
    )
    one_sided = models("emps_asymmetric")[0]
    states = calls(one_sided)["regressor"]
    assert (
        deviation(
            torch.func.vmap(one_sided.regressor)(*map(torch.asarray, states)),
            one_sided.regressor(*states),
        )
        <= TOLERANCE
    )
    by_acceleration = torch.func.vmap(
        torch.func.jacrev(model.inverse_dynamics, argnums=2), in_dims=(0, 0, 0, None)
    )(q, qd, qdd, X)
    assert deviation(by_acceleration, reference.inertia_matrix(host(q), host(X))) <= TOLERANCE


@pytest.mark.parametrize("name", ["jax", "torch", "array_api_strict"])
def test_float32_stays_float32(name):
    model, _ = models("scara")
    xp = package(name)
    for function, arguments in calls(model).items():
        single = [xp.asarray(x.astype(np.float32)) for x in arguments]
        found, right = getattr(model, function)(*single), getattr(model, function)(*arguments)
        assert found.dtype == single[0].dtype == xp.float32, function
        scale = np.abs(right).max()
        tolerance = 1e-3 if function == "forward_dynamics" else 1e-5
        assert np.abs(host(found) - right).max() <= tolerance * scale, function


def test_lists_and_a_store_of_numpy():
    model, _ = models("planar_2r")
    q, qd, qdd, X = calls(model)["inverse_dynamics"]
    torques = model.inverse_dynamics(q.tolist(), qd.tolist(), qdd.tolist(), list(X))
    np.testing.assert_array_equal(torques, model.inverse_dynamics(q, qd, qdd, X))
    np.testing.assert_array_equal(
        model.bias(q[0].tolist(), [0, 1], list(X)), model.bias(q[0], np.array([0.0, 1.0]), X)
    )
    strict = package("array_api_strict")
    states = [strict.asarray(x) for x in (q, qd, qdd)]
    with pytest.raises(ValueError, match="out: only NumPy arrays can be written into a store"):
        model.regressor(*states, out=model.store(N))


def test_mixed_precisions_packages_and_shapes_are_refused():
    model, _ = models("planar_2r")
    strict = package("array_api_strict")
    q = strict.asarray(np.zeros((3, 2)))
    with pytest.raises(
        TypeError, match=r"float32, .*float64; expected all float64, or all float32"
    ):
        model.regressor(q, strict.astype(q, strict.float32), q)
    with pytest.raises(TypeError, match="int64; expected all float64"):
        model.frame_poses(strict.astype(q, strict.int64))
    with pytest.raises(TypeError):
        model.regressor(q, np.zeros((3, 2)), q)
    with pytest.raises(ValueError, match=r"X of shape \(3,\); expected \(\d+,\)"):
        model.gravity(q, strict.asarray(np.zeros(3)))
    with pytest.raises(ValueError, match=r"state of shape \(3, 4\); expected \(..., 2\)"):
        model.frame_poses(strict.asarray(np.zeros((3, 4))))


def test_loops_closed_by_iteration_have_none(capsys):
    assert emitted(["four_bar"], ("numpy", "xp")).keys() == {"four_bar.py"}
    assert "the target xp is not possible" in capsys.readouterr().err
