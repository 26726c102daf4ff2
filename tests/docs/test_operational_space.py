"""What is felt at the handle: hand formulas of the planar arm with a handle at the end of link 2,
differences, and the haptic interface.
"""

from dataclasses import replace

import numpy as np
import pytest
from operational_space import operational_space

from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import load_model
from runtime.ground.errors import InputError
from symgen.description import load_robot
from symgen.description.grammar import parse
from symgen.description.robot import FIXED, Frame
from symgen.emit.generate import generate_module

L1, L2, G = 0.5, 0.4, 9.81
Q = np.array([[0.3, 0.9], [-1.1, 1.7], [2.0, -0.6], [0.4, 2.4]])
PLANE = (0, 1)


def emitted(robot, folder):
    path = folder / f"{robot.name}.py"
    path.write_text(generate_module(robot), encoding="utf-8")
    return load_model(path, trust=True)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """planar_2r with frame 3, the handle, at L2 along x2."""
    planar = load_robot("planar_2r")
    zero = parse("0")
    handle = Frame(3, 2, FIXED, 0, zero, zero, zero, parse("L2", ("L2",)), zero, zero)
    constants = dict(planar.constants) | {"L2": L2}
    return emitted(
        replace(
            planar, frames=(*planar.frames, handle), constants=constants, massless=frozenset({3})
        ),
        tmp_path_factory.mktemp("model"),
    )


@pytest.fixture(scope="module")
def haptic(tmp_path_factory):
    return emitted(load_robot("haptic"), tmp_path_factory.mktemp("model"))


def estimate(names, X, C=None):
    b = len(names)
    C = np.zeros((b, b)) if C is None else C
    sigma = np.sqrt(np.diag(C))
    return Estimate(tuple(names), X, sigma, C, sigma, 1.0, 1.0, 1.0, b, 0.0, 0.0, (), "ols")


def random_estimate(model, seed=0):
    """A physical arm and a full covariance, about 2 % of each parameter."""
    rng = np.random.default_rng(seed)
    values = {
        "ZZ1R": 1.8,
        "MX1R": 2.4,
        "MY1": 0.1,
        "FV1": 2.0,
        "FS1": 3.0,
        "OFFSET1": 0.2,
        "ZZ2": 0.4,
        "MX2": 0.9,
        "MY2": -0.08,
        "Ia2": 0.05,
    }
    values |= {"FV2": 1.0, "FS2": 1.5, "OFFSET2": -0.1}
    X = np.array([values[name] for name in model.BASE_PARAMETERS])
    root = 0.02 * np.abs(X)[:, None] * rng.standard_normal((len(X), len(X))) / np.sqrt(len(X))
    return estimate(model.BASE_PARAMETERS, X, root @ root.T)


def jacobian(q):
    q1, q12 = q[0], q[0] + q[1]
    return np.array(
        [
            [-L1 * np.sin(q1) - L2 * np.sin(q12), -L2 * np.sin(q12)],
            [L1 * np.cos(q1) + L2 * np.cos(q12), L2 * np.cos(q12)],
        ]
    )


def test_a_point_mass_at_the_handle_is_felt_as_itself(arm):
    """m at the handle of massless links: Lambda = m 1, the user carries m g, no stiffness."""
    m = 1.7
    X = dict.fromkeys(arm.STANDARD_PARAMETERS, 0.0) | {"ZZ2": m * L2**2, "MX2": m * L2, "M2": m}
    seen = operational_space(
        arm, estimate(arm.BASE_PARAMETERS, arm.base_parameters(X)), Q, axes=PLANE
    )
    np.testing.assert_allclose(
        seen.mass.value, np.broadcast_to(m * np.eye(2), (4, 2, 2)), atol=1e-12
    )
    np.testing.assert_allclose(seen.principal.value, m, atol=1e-12)
    np.testing.assert_allclose(
        seen.static_force.value, np.broadcast_to([0, m * G], (4, 2)), atol=1e-12
    )
    np.testing.assert_allclose(seen.stiffness.value, 0, atol=1e-6)
    assert not seen.singular.any()
    assert seen.message == ""


def test_against_hand_formulas(arm):
    fit = random_estimate(arm)
    v = 0.2
    seen = operational_space(arm, fit, Q, axes=PLANE, speed=v)
    for k, q in enumerate(Q):
        J = jacobian(q)
        coupling = fit["ZZ2"] + L1 * (fit["MX2"] * np.cos(q[1]) - fit["MY2"] * np.sin(q[1]))
        A = np.array(
            [
                [fit["ZZ1R"] + 2 * coupling - fit["ZZ2"], coupling],
                [coupling, fit["ZZ2"] + fit["Ia2"]],
            ]
        )
        np.testing.assert_allclose(
            seen.mass.value[k], np.linalg.inv(J @ np.linalg.inv(A) @ J.T), rtol=1e-10
        )
        inverse = np.linalg.inv(J)
        FV, FS = np.array([fit["FV1"], fit["FV2"]]), np.array([fit["FS1"], fit["FS2"]])
        for u in range(2):
            felt = v * FV @ inverse[:, u] ** 2 + FS @ np.abs(inverse[:, u])
            assert seen.friction.value[k, u] == pytest.approx(felt, rel=1e-10)
        np.testing.assert_allclose(
            seen.position[k, :2],
            [L1 * np.cos(q[0]) + L2 * np.cos(q.sum()), L1 * np.sin(q[0]) + L2 * np.sin(q.sum())],
        )


def test_stiffness_is_the_change_of_the_static_force(arm):
    """Along the handle's coordinates, at configurations moved by J^-1 dx."""
    fit, h = random_estimate(arm), 1e-5
    seen = operational_space(arm, fit, Q, axes=PLANE)
    for k, q in enumerate(Q):
        for u in range(2):
            dq = np.linalg.solve(jacobian(q), h * np.eye(2)[u])
            ahead, behind = (
                operational_space(arm, fit, q + s * dq, axes=PLANE).static_force.value[0]
                for s in (1, -1)
            )
            np.testing.assert_allclose(
                seen.stiffness.value[k, :, u], (ahead - behind) / (2 * h), rtol=1e-5, atol=1e-5
            )


@pytest.mark.parametrize("what", ["mass", "principal", "friction", "static_force", "stiffness"])
def test_deviations_are_those_of_differences(arm, what):
    """sqrt(g' C g) with the gradient g by central differences of the whole computation in X."""
    fit = random_estimate(arm)
    gradient = []
    for i, x in enumerate(fit.X):
        h = 1e-5 * max(1.0, abs(x))
        step = h * np.eye(len(fit.X))[i]
        ahead, behind = (
            getattr(
                operational_space(arm, estimate(fit.names, fit.X + s * step), Q, axes=PLANE), what
            ).value
            for s in (1, -1)
        )
        gradient.append((ahead - behind) / (2 * h))
    expected = np.sqrt(np.einsum("i...,ik,k...->...", gradient, fit.covariance, gradient))
    found = getattr(operational_space(arm, fit, Q, axes=PLANE), what).sigma
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-7)


def test_singular_configurations_are_told(arm):
    q = np.array([[0.3, 0.9], [0.3, 0.0], [0.3, np.pi]])
    seen = operational_space(arm, random_estimate(arm), q, axes=PLANE)
    assert seen.singular.tolist() == [False, True, True]
    assert "2 of 3 configurations are singular (first: 1" in seen.message
    for felt in (seen.mass, seen.principal, seen.friction, seen.static_force, seen.stiffness):
        assert np.isnan(felt.value[1:]).all()
        assert np.isfinite(felt.value[0]).all()


def test_an_estimate_without_dynamics_is_told(arm):
    """ZZ2 + Ia2 negative: A is not positive definite anywhere."""
    fit = random_estimate(arm)
    X = np.where([name == "ZZ2" for name in fit.names], -0.5, fit.X)
    seen = operational_space(arm, estimate(fit.names, X), Q, axes=PLANE)
    assert seen.indefinite.all() and not seen.singular.any()
    assert (
        "at 4 of 4 the estimated inertia matrix is not positive definite (first: 0)" in seen.message
    )
    assert np.isnan(seen.principal.value).all()


def test_one_axis_of_a_redundant_arm(arm):
    """With one coordinate of two, the other joint motion is free: 1/Lambda is the diagonal element
    of the mobility.
    """
    fit = random_estimate(arm)
    both = operational_space(arm, fit, Q, axes=PLANE).mass.value
    one = operational_space(arm, fit, Q, axes=(1,)).mass.value
    np.testing.assert_allclose(1 / one[:, 0, 0], np.linalg.inv(both)[:, 1, 1], rtol=1e-10)


def test_haptic_handle_accelerates_as_its_mass_says(haptic):
    """Lambda xdd = f for a force at the support of the handle, from the forward dynamics at rest;
    in three directions.
    """
    fit = estimate(haptic.BASE_PARAMETERS, haptic.base_parameters(haptic.VALUES))
    q = np.array([[0.0, -0.8, -2.4], [0.5, -0.4, -2.2], [-0.7, -1.1, -2.0]])
    seen = operational_space(haptic, fit, q, frame=4)
    rest = np.zeros_like(q)
    J = haptic.jacobian(q, frame=4)[:, :3]
    for f in np.eye(3):
        tau = haptic.bias(q, rest, fit.X) + np.einsum("naj,a->nj", J, f)
        xdd = np.einsum("naj,nj->na", J, haptic.forward_dynamics(q, rest, tau, fit.X))
        np.testing.assert_allclose(
            np.einsum("nab,nb->na", seen.mass.value, xdd), np.broadcast_to(f, (3, 3)), atol=1e-10
        )
    assert (seen.principal.value > 0).all()


def test_general_loop(tmp_path):
    """Tool point of the five-bar linkage: Lambda xdd = f from the forward dynamics; the columns of
    J are the actuated joints.
    """
    model = emitted(load_robot("five_bar"), tmp_path)
    X = dict.fromkeys(model.STANDARD_PARAMETERS, 0.0)
    for j, length in ((1, 0.25), (2, 0.36), (3, 0.27), (4, 0.34)):
        X |= {f"M{j}": 1.0, f"MX{j}": length / 2, f"ZZ{j}": length**2 / 3}
    fit = estimate(model.BASE_PARAMETERS, model.base_parameters(X))
    q = np.array([[2.2, 0.9], [2.3, 1.0]])
    seen = operational_space(model, fit, q, frame=5, axes=PLANE)
    J, rest = model.jacobian(q, frame=5)[:, :2], np.zeros_like(q)
    for f in np.eye(2):
        tau = model.bias(q, rest, fit.X) + np.einsum("naj,a->nj", J, f)
        xdd = np.einsum("naj,nj->na", J, model.forward_dynamics(q, rest, tau, fit.X))
        np.testing.assert_allclose(
            np.einsum("nab,nb->na", seen.mass.value, xdd), np.broadcast_to(f, (2, 2)), atol=1e-9
        )


def test_essential_parameters_alone(haptic):
    """Parameters left out count as zero; the order of the names does not matter."""
    X = dict(zip(haptic.BASE_PARAMETERS, haptic.base_parameters(haptic.VALUES), strict=True))
    names = ["ZZ3R", "ZZ1R", "XX2R", "ZZ2R", "XX3R", "MX3R"]
    q = np.array([[0.2, -0.8, -2.4]])
    some = operational_space(haptic, estimate(names, np.array([X[n] for n in names])), q, frame=4)
    padded = np.array([X[n] if n in names else 0.0 for n in haptic.BASE_PARAMETERS])
    every = operational_space(haptic, estimate(haptic.BASE_PARAMETERS, padded), q, frame=4)
    np.testing.assert_allclose(some.mass.value, every.mass.value, rtol=1e-12)


def test_bad_input(arm):
    fit = random_estimate(arm)
    with pytest.raises(InputError, match=r"q has shape \(1, 3\); expected \(N, 2\)"):
        operational_space(arm, fit, np.zeros(3))
    with pytest.raises(InputError, match="at most 2 different ones"):
        operational_space(arm, fit, Q)
    with pytest.raises(InputError, match=r"frame 9, speed 0.001 m/s; expected a frame from 1 to 3"):
        operational_space(arm, fit, Q, axes=PLANE, frame=9)
    with pytest.raises(InputError, match=r"speed 0 m/s; .* positive speed"):
        operational_space(arm, fit, Q, axes=PLANE, speed=0)
    with pytest.raises(InputError, match="FS9: not base parameters of planar_2r"):
        operational_space(arm, estimate(["FS9"], np.ones(1)), Q, axes=PLANE)


def test_parameters_that_the_record_does_not_determine(arm):
    """Their covariance is nan: deviations are nan where a quantity depends on them, and elsewhere
    those of the others.
    """
    fit = random_estimate(arm)
    known = operational_space(arm, fit, Q, axes=PLANE)
    lost = fit.names.index("FS1")
    C = fit.covariance.copy()
    C[lost], C[:, lost] = np.nan, np.nan
    space = operational_space(arm, estimate(fit.names, fit.X, C), Q, axes=PLANE)
    assert np.isnan(space.friction.sigma).any() and np.isfinite(space.friction.value).all()
    for quantity, whole in (
        (space.mass, known.mass),
        (space.static_force, known.static_force),
        (space.stiffness, known.stiffness),
    ):
        np.testing.assert_allclose(quantity.sigma, whole.sigma, rtol=1e-6)
