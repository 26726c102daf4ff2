"""Distal (classic) tables: the converted robot has the poses of the classic matrix product, and the
torques that go with them.
"""

import numpy as np
import pytest
from typer.testing import CliRunner

import symgen
from oracles.pinocchio_model import PinocchioModel
from oracles.random_robots import random_parameters
from symgen.certify.lagrange import Lagrange
from symgen.cli.main import app
from symgen.derive.doubts import doubts
from symgen.description import parse_robot, write_yaml
from symgen.errors import DescriptionError

# PUMA 560 in the classic convention, as printed in textbooks: alpha, a, d; a and d in m
PUMA = (
    (90, 0, 0),
    (0, 0.4318, 0),
    (-90, 0.0203, 0.15005),
    (90, 0, 0.4318),
    (-90, 0, 0),
    (0, 0, 0.05625),
)


def table(rows, sigma=(), ant=(), head="convention: distal"):
    """Text of a robot file from rows of alpha (degrees), a, d; theta offsets 0.1 j on prismatic
    joints.
    """
    lines = ["symgen: 1", "name: arm", head, "gravity: [0, 0, -9.81]", "frames:"]
    for j, (alpha, a, d) in enumerate(rows, start=1):
        prismatic = bool(sigma) and sigma[j - 1] == 1
        theta, r = (f"0.1*{j}", f"q{j} + {d}") if prismatic else (f"q{j}", d)
        i = ant[j - 1] if ant else j - 1
        lines.append(
            f"  {j}: {{ant: {i}, sigma: {int(prismatic)}, alpha: {alpha}*pi/180, d: {a}, theta: "
            f"{theta}, r: {r}}}"
        )
    return "\n".join(lines)


def classic(alpha, a, d, theta):
    """Rot(z, theta) Trans(z, d) Trans(x, a) Rot(x, alpha), written out as in textbooks."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0, sa, ca, d],
            [0, 0, 0, 1],
        ]
    )


def product(rows, sigma, q):
    T = np.eye(4)
    for j, ((alpha, a, d), x) in enumerate(zip(rows, q, strict=True), start=1):
        prismatic = bool(sigma) and sigma[j - 1] == 1
        T = T @ classic(
            np.radians(alpha), a, d + x if prismatic else d, 0.1 * j if prismatic else x
        )
    return T


@pytest.mark.parametrize("seed", range(6))
def test_last_frame_is_that_of_the_classic_product(seed):
    rng = np.random.default_rng(seed)
    n = 6 if seed == 0 else int(rng.integers(2, 7))
    rows = (
        PUMA
        if seed == 0
        else [(int(rng.integers(-180, 180)), *(rng.integers(-9, 9, 2) / 10)) for _ in range(n)]
    )
    sigma = (0,) * 6 if seed == 0 else tuple(rng.integers(0, 2, n))
    robot = parse_robot(table(rows, sigma).encode(), "arm.yaml")
    q = rng.uniform(-2, 2, n)
    assert len(robot.frames) == n + any(rows[-1][:2])
    np.testing.assert_allclose(
        Lagrange(robot).poses(q[None])[0, -1], product(rows, sigma, q), atol=1e-13
    )


def test_torques_of_the_puma():
    """Weights of the links from the classic transformations, by the principle of virtual work; the
    whole model by pinocchio.
    """
    robot = parse_robot(table(PUMA).encode(), "puma.yaml")
    chi, model, oracle = random_parameters(robot, 3), Lagrange(robot), PinocchioModel(robot)
    rng = np.random.default_rng(4)
    q, qd, qdd = rng.standard_normal((3, 6))
    np.testing.assert_allclose(
        model.torque(q[None], qd[None], qdd[None], chi)[0],
        oracle.torque(q, qd, qdd, chi),
        rtol=1e-10,
    )
    value, h = dict(zip(robot.parameters, chi, strict=True)), 1e-6

    def potential(x):
        """9.81 times the sum of M z + MS_z: Khalil's frame j before Trans(x, a) Rot(x, alpha) of
        the classic frame j.
        """
        total = 0.0
        for j in range(1, 7):
            alpha, a, _ = PUMA[j - 1]
            T = product(PUMA[:j], (), x[:j]) @ np.linalg.inv(
                classic(np.radians(alpha), a, 0.0, 0.0)
            )
            total += 9.81 * (
                T[2, :3] @ [value[f"{p}{j}"] for p in ("MX", "MY", "MZ")] + T[2, 3] * value[f"M{j}"]
            )
        return total

    slope = [(potential(q + h * e) - potential(q - h * e)) / (2 * h) for e in np.eye(6)]
    np.testing.assert_allclose(
        model.torque(q[None], 0 * q[None], 0 * q[None], chi)[0], slope, atol=1e-6
    )  # central differences


def test_branches_start_at_the_far_end():
    rows = ((90, 0.3, 0.1), (0, 0.2, 0), (-90, 0.1, 0.2))
    robot = parse_robot(table(rows, ant=(0, 1, 1)).encode(), "tree.yaml")
    assert [f.ant for f in robot.frames] == [0, 1, 1, 2, 3] and sorted(robot.massless) == [4, 5]
    q = np.array([0.3, -0.7, 1.1])
    poses = Lagrange(robot).poses(q[None])[0]
    np.testing.assert_allclose(poses[3], product(rows[:2], (), q[:2]), atol=1e-14)
    np.testing.assert_allclose(poses[4], product((rows[0], rows[2]), (), q[[0, 2]]), atol=1e-14)
    assert parse_robot(write_yaml(robot).encode(), "again.yaml").frames == robot.frames


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("alpha: 90*pi/180", "alpha: 90", "^frame 1: alpha = 90: 90 rad are 14.3 turns"),
        (
            "alpha: 90",
            "gamma: 1, alpha: 90",
            "^frames.1.gamma: frame 1: gamma is not part of the distal",
        ),
        ("convention: distal", "convention: classic", "'classic'; expected proximal or distal"),
        ("convention: distal", "convention: distal\nloops: [{cut: 2, twin: 3}]", "distal table"),
    ],
)
def test_faults(old, new, words):
    with pytest.raises(DescriptionError, match=words):
        parse_robot(table(PUMA).replace(old, new, 1).encode(), "arm.yaml")


def test_edits_are_those_of_the_table():
    rows = ((0, 0.4, 0), (0, 0, 0))
    before, turned, longer, khalil = (
        symgen.regrouping(parse_robot(text.encode(), "arm.yaml"))
        for text in (
            table(rows),
            table(((90, 0.4, 0), rows[1])),
            table((rows[0], (0, 0.3, 0))),
            table(rows, head=""),
        )
    )
    assert symgen.base_difference(before, turned).edits == ("alpha of frame 1: 0 -> pi/2",)
    assert symgen.base_difference(before, longer).edits == ("d of frame 2: 0 -> 0.3",)
    assert symgen.base_difference(khalil, before).edits == ("convention: none -> distal",)


def test_doubts_name_the_row_of_the_table():
    rows = PUMA[0], (0, 431.8, 0), *PUMA[2:]
    text = table(rows).replace("90*pi/180", "1.5708", 1)
    angle, length = doubts(parse_robot(text.encode(), "arm.yaml"))
    assert angle.startswith("frame 1: alpha has 1.5708, not pi/2")
    assert length.startswith("frame 2: d holds a length of 431.8 m")


def energies(rows, values, q, gravity):
    """Inertia matrix and gravity torques of link data in the frames of the table, by products of
    its matrices alone: A_ij = sum tr(dT/dq_i H dT'/dq_j), H the pseudo-inertia.
    """
    h, n = 1e-6, len(rows)
    H = []
    for j in range(1, n + 1):
        xx, xy, xz, yy, yz, zz, mx, my, mz, m = (
            values[f"{f}{j}"] for f in ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
        )
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        ms = np.array([[mx], [my], [mz]])
        H.append(np.block([[np.trace(J) / 2 * np.eye(3) - J, ms], [ms.T, np.array([[m]])]]))

    def poses(x):
        return [product(rows[: j + 1], (), x[: j + 1]) for j in range(n)]

    steps = [
        [(a - b) / (2 * h) for a, b in zip(poses(q + h * e), poses(q - h * e), strict=True)]
        for e in np.eye(n)
    ]
    A = [
        [sum(np.trace(s @ M @ t.T) for s, M, t in zip(u, H, v, strict=True)) for v in steps]
        for u in steps
    ]
    Q = [
        -sum(np.append(gravity, 0) @ s @ M[:, 3] for s, M in zip(u, H, strict=True)) for u in steps
    ]
    return np.array(A), np.array(Q)


@pytest.mark.parametrize("rows", [PUMA[:3], ((0, 0.4, 0), (0, 0.3, 0)), PUMA], ids=len)
def test_values_are_read_in_the_frames_of_the_table(rows):
    """Torques of link data given in the classic frames, against matrices that know nothing of Khalil's."""
    n = len(rows)
    rng = np.random.default_rng(n)
    names = [
        f"{f}{j}"
        for j in range(1, n + 1)
        for f in ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
    ]
    values = dict(zip(names, rng.uniform(0.5, 2, len(names)).tolist(), strict=True))
    text = table(rows) + f"\nvalues: {values}\n"
    model = symgen.model(parse_robot(text.encode(), "arm.yaml"))
    standard = dict.fromkeys(model.STANDARD_PARAMETERS, 0.0) | model.VALUES
    X = model.base_parameters(standard)
    for q in rng.uniform(-2, 2, (3, n)):
        A, Q = energies(rows, values, q, np.array([0, 0, -9.81]))
        np.testing.assert_allclose(model.gravity(q, X), Q, atol=1e-7 * np.abs(Q).max())
        np.testing.assert_allclose(model.inertia_matrix(q, X), A, atol=1e-7 * np.abs(A).max())


def test_values_without_those_that_enter_are_refused():
    text = table(((0, 0.4, 0), (0, 0.3, 0))) + "\nvalues: {ZZ1: 0.2, M2: 1.0}\n"
    with pytest.raises(
        DescriptionError, match=r"values of link 1 .* to convert ZZ1, also give MX1, M1"
    ):
        parse_robot(text.encode(), "arm.yaml")
    some = table(((0, 0.4, 0), (0, 0.3, 0))) + "\nvalues: {M1: 3.0, MX1: -0.6, ZZ1: 0.16}\n"
    moved = parse_robot(some.encode(), "arm.yaml").values
    assert moved == pytest.approx({"M1": 3.0, "MX1": 0.6, "ZZ1": 0.16 - 2 * 0.4 * 0.6 + 3 * 0.16})


def test_commands_say_that_values_and_parameters_are_in_two_frames(tmp_path):
    """MX1 is -0.6 in the file and 0.6 in Khalil's frame (the test above)."""
    rows = ((0, 0.4, 0), (0, 0.3, 0))
    values = "\nvalues: {M1: 3.0, MX1: -0.6, ZZ1: 0.16}\n"
    for file, text, told in (
        ("a.yaml", table(rows) + values, "`values` of a.yaml in those of its classic table"),
        ("b.yaml", table(rows), "not in those of the classic table"),
        ("c.yaml", table(rows, head="convention: proximal") + values, ""),
    ):
        (tmp_path / file).write_text(text)
        result = CliRunner().invoke(app, ["show", str(tmp_path / file)])
        said = " ".join(result.stderr.split())
        assert told in said and ("Khalil's frames" in said) == bool(told)
