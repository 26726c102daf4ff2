"""Functions on request, `symgen generate --with`, against pinocchio and the identities of their
names, on 30 random robots.

Derivatives along a motion are central differences of sixth order of step 2 ms, which leave
1e-12; the tolerance is 1e-10 of the largest entry.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from campaign import campaign, sampled, some
from typer.testing import CliRunner

from oracles.pinocchio_model import PinocchioModel, element_columns
from oracles.random_robots import random_parameters, random_robot, random_state
from oracles.test_emitted_agree import PACKAGED
from symgen import load_robot
from symgen.certify.importing import imported
from symgen.certify.modules import certified_files, certify
from symgen.cli.main import app
from symgen.derive.models import ON_REQUEST, OPTIONS
from symgen.description.robot import Robot
from symgen.emit.generate import generate_files
from symgen.errors import SymgenError
from symgen.regroup.regrouping import regroup

Array = np.ndarray
STEP, SIX_POINTS = 0.002, {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
ROBOTS = sampled([random_robot(seed) for seed in range(30)], 8, more=4)


def slope(f: Callable[[float], Array]) -> Array:
    """df/dt at 0."""
    return sum(c * (f(m * STEP) - f(-m * STEP)) / STEP for m, c in SIX_POINTS.items())


def close(found: Array, expected: Array, scale: float) -> None:
    assert np.shape(found) == np.shape(expected)
    assert np.abs(np.asarray(found) - expected).max() <= 1e-10 * scale


@pytest.mark.parametrize("robot", [*PACKAGED[:4], *ROBOTS], ids=lambda r: r.name)
@some(2)
def test_dynamics_on_request(robot: Robot, tmp_path) -> None:
    (file, text), *_ = generate_files(robot, options=OPTIONS).items()
    (tmp_path / file).write_text(text, encoding="utf-8")
    module, oracle = imported(tmp_path / file), PinocchioModel(robot)
    chi = random_parameters(robot, seed=1)
    X, zero = module.base_parameters(chi), np.zeros(len(robot.joints))
    for q, qd, qdd in zip(*random_state(robot, 3, seed=2), strict=True):
        rubbing = friction(robot, q, qd, chi)
        tau, weight = oracle.torque(q, qd, qdd, chi), oracle.gravity(q, chi)
        scale = max(np.abs(tau).max(), np.abs(weight).max(), np.abs(rubbing).max(), 1.0)

        def at(t: float, q=q, qd=qd, qdd=qdd) -> tuple[Array, Array]:
            return q + t * qd + t**2 / 2 * qdd, qd + t * qdd

        C, A = module.coriolis(q, qd, X), oracle.inertia_matrix(q, chi)
        close(C @ qd, oracle.torque(q, qd, zero, chi) - weight - rubbing, scale)
        close(slope(lambda t: oracle.inertia_matrix(at(t)[0], chi)), C + C.T, scale)  # Ad - 2C skew

        qdr, qddr = qdd, qd - qdd
        Y = module.slotine_li_regressor(q, qd, qdr, qddr)
        close(Y @ X, A @ qddr + C @ qdr + weight + rubbing, scale)

        close(module.momentum_regressor(q, qd) @ X, A @ qd, scale)
        rate = slope(lambda t: oracle.inertia_matrix(at(t)[0], chi) @ at(t)[1])
        close(module.momentum_rate_regressor(q, qd) @ X, rate - tau, scale)

        kinetic, potential = (module.energy_regressor(q, qd) @ X).T
        close(kinetic, qd @ A @ qd / 2, scale)
        close(slope(lambda t: module.energy_regressor(*at(t))[1] @ X), weight @ qd, scale)
        close(potential - (module.energy_regressor(0 * q, qd)[1] @ X),
              height(oracle, q, chi) - height(oracle, 0 * q, chi), scale)  # fmt: skip

        wrench = base_wrench(oracle, q, qd, qdd, chi)
        close(module.base_wrench_regressor(q, qd, qdd) @ chi, wrench, np.abs(wrench).max())


def friction(robot: Robot, q: Array, qd: Array, chi: Array) -> Array:
    """What elements add by motion alone."""
    value, zero = dict(zip(robot.parameters, chi, strict=True)), 0 * q
    moving, still = (element_columns(robot, q, x, zero) for x in (qd, zero))
    return sum((value[name] * (moving[name] - still[name]) for name in moving), zero)


def height(oracle: PinocchioModel, q: Array, chi: Array) -> float:
    """Potential energy of the links by pinocchio; of springs and constant torques, a straight
    line of torques from 0 to q.
    """
    value, zero = oracle._set_inertias(chi), 0 * q
    U = pin.computePotentialEnergy(oracle.model, oracle.data, oracle._full(q))
    ends = (element_columns(oracle.robot, x, zero, zero) for x in (zero, q))
    first, last = (sum((value[n] * c for n, c in e.items()), zero) for e in ends)
    return float(U + q @ (first + last) / 2)


def base_wrench(oracle: PinocchioModel, q: Array, qd: Array, qdd: Array, chi: Array) -> Array:
    """Force, then moment about the origin of frame 0, that the base exerts."""
    oracle._set_inertias(chi)
    pin.rnea(oracle.model, oracle.data, *map(oracle._full, (q, qd, qdd)))
    first = [k for k in range(1, oracle.model.njoints) if oracle.model.parents[k] == 0]
    return np.asarray(sum(oracle.data.liMi[k].act(oracle.data.f[k]).vector for k in first))


@pytest.mark.parametrize("name", sampled(["scara", "sr400", "tx40", "haptic"], 1))
def test_every_target_has_them_certified(name: str) -> None:
    robot = load_robot(name)
    files = certified_files(robot, targets=("numpy", "c"), options=OPTIONS)
    assert len(files) == 3  # the module, the C file and its header
    for text in (text for file, text in files.items() if not file.endswith(".h")):
        said = text.partition("Certificate by symgen")[2].partition("sha256 of all but")[0]
        certificate = " ".join(said.split())
        assert all(
            model in certificate.replace("# ", "").replace("// ", "") for model in ON_REQUEST
        )


@campaign
def test_a_wrong_function_on_request_is_refused() -> None:
    regrouping = regroup(load_robot("scara"))
    files = generate_files(load_robot("scara"), regrouping=regrouping, options=OPTIONS)
    ((file, text),) = files.items()
    for function in ON_REQUEST:
        body = text.index(f"def _{function}_block")
        line = next(
            x for x in text[body:].splitlines() if " = " in x and "[" in x.partition(" = ")[0]
        )
        names, _, value = line.rpartition(" = ")  # one line may fill several entries
        changed = f"{names} = 2*{value}"
        wrong = text[:body] + text[body:].replace(line, changed, 1)
        assert certify(regrouping, {file: wrong}, OPTIONS).texts[file].wrong == [function]


def test_nothing_changes_where_nothing_is_asked_for() -> None:
    robot = load_robot("scara")
    assert generate_files(robot) == generate_files(robot, options=())
    assert not any(name in text for text in generate_files(robot).values() for name in ON_REQUEST)


def test_what_cannot_be_had_is_said(tmp_path) -> None:
    with pytest.raises(SymgenError, match="has no formula"):
        generate_files(load_robot("four_bar"), options=("coriolis",))
    assert "energy_regressor" in next(
        iter(generate_files(load_robot("four_bar"), options=("energy",)).values())
    )
    result = CliRunner().invoke(app, ["generate", "scara", "--with", "inertia"])
    assert (
        result.exit_code == 2 and "expected one of coriolis, slotine_li, momentum" in result.output
    )


def test_the_header_repeats_the_command(tmp_path) -> None:
    command = ["generate", "scara", "--with", "energy,coriolis", "-o", str(tmp_path)]
    assert CliRunner().invoke(app, command).exit_code == 0
    assert "symgen generate scara --with energy,coriolis" in (tmp_path / "scara.py").read_text()
    assert CliRunner().invoke(app, [*command, "--check"]).exit_code == 0
