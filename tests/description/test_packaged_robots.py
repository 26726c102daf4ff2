"""The packaged robots load, say where they come from, and are the mechanisms their sources
describe.
"""

import math
from importlib import resources

import pytest

from symgen.description import load_robot, packaged_robots
from symgen.description.robot import FIXED, PRISMATIC

FOUR = {"Ia": "inertia", "FV": "viscous", "FS": "coulomb", "OFFSET": "offset"}
# standard parameters: ten per link and one per joint of each of Ia, FV, FS, OFFSET
STANDARD = {
    "emps": 14, "emps_asymmetric": 15, "five_bar": 48, "four_bar": 34, "haptic": 78, "panda": 98,
    "planar_2r": 28, "puma560": 84, "rx90": 84,
    "scara": 56, "sr400": 104, "stanford": 84, "two_branch": 108, "tx40": 86, "tx40_table1": 84,
}  # fmt: skip


@pytest.mark.parametrize("name", packaged_robots())
def test_loads_and_names_its_source(name):
    robot = load_robot(name)
    assert (robot.name, robot.file) == (name, f"{name}.yaml")
    assert len(robot.title) > 10
    assert len(robot.source) > 20
    text = (resources.files("symgen.description") / "robots" / robot.file).read_text(
        encoding="utf-8"
    )
    assert text.startswith("#")
    assert all(len(line) <= 160 for line in text.splitlines())


@pytest.mark.parametrize(("name", "count"), STANDARD.items())
def test_standard_parameters(name, count):
    robot = load_robot(name)
    assert len(robot.parameters) == len(set(robot.parameters)) == count
    assert not robot.values or set(robot.values) == set(robot.parameters)


@pytest.mark.parametrize(
    "name",
    [
        "tx40_table1",
        "rx90",
        "puma560",
        "stanford",
        "scara",
        "panda",
        "planar_2r",
        "two_branch",
        "emps",
        "sr400",
        "four_bar",
        "five_bar",
    ],
)
def test_friction_and_actuators_on_every_joint(name):
    robot = load_robot(name)
    assert {e.family: e.kind for e in robot.elements} == FOUR
    assert all(e.keys == robot.joints for e in robot.elements)


def test_table_1_and_its_mirror():
    """Chapter Table 1, column alpha(j); `tx40` has the signs under which eq. (27) is exact."""
    printed = ["0", "pi/2", "0", "-pi/2", "pi/2", "-pi/2"]
    assert [str(f.alpha) for f in load_robot("tx40_table1").frames] == printed
    assert [f.alpha for f in load_robot("tx40").frames] == [
        -f.alpha for f in load_robot("tx40_table1").frames
    ]
    for name in ("tx40", "tx40_table1"):
        robot = load_robot(name)
        assert [(str(f.d), str(f.r)) for f in robot.frames] == [
            ("0", "0"),
            ("0", "0"),
            ("D3", "0"),
            ("0", "RL4"),
            ("0", "0"),
            ("0", "0"),
        ]
        assert robot.constants == {"D3": 0.225, "RL4": 0.225, "g": 9.81}
        assert [str(g) for g in robot.gravity] == ["0", "0", "-g"]


def test_tx40_wrist():
    elements = {e.family: e for e in load_robot("tx40").elements}
    form = {ij: str(c) for ij, c in elements["Ia"].form[6].items()}
    assert form == {(6, 6): "1", (5, 6): "1", (6, 5): "1"}
    assert {ij: str(c) for ij, c in elements["FVM"].form[6].items()} == {(5, 6): "1", (6, 5): "1"}
    assert {i: str(c) for i, c in elements["FSM"].along[6].items()} == {5: "1", 6: "1"}


def test_tx40_drives():
    drives = load_robot("tx40").drives
    assert [row[j] for j, row in enumerate(drives.ratio)] == [32, 32, 45, -48, 45, 32]
    assert drives.ratio[5][4] == 32
    assert sum(x != 0 for row in drives.ratio for x in row) == 7
    assert drives.offset == (0, -math.pi / 2, math.pi / 2, 0, 0, 0)


def test_tx40_limits_contain_the_record():
    """Ranges of the public record in degrees, before the shifts of joints 2 and 3, and its top
    speeds (rounded).
    """
    robot = load_robot("tx40")
    low, high = [-100, -4, -135, -240, -90, -200], [120, 110, 30, 80, 108, 200]
    for j in range(6):
        shift = robot.drives.offset[j]
        assert (
            robot.limits["q"][j][0]
            <= math.radians(low[j]) + shift
            < math.radians(high[j]) + shift
            <= robot.limits["q"][j][1]
        )
    top = [5.0, 5.0, 7.0, 7.2, 5.6, 11.5]
    assert all(
        x <= limit + 0.05 for x, limit in zip(top, robot.limits["qd"], strict=True)
    )  # printed to 0.1 rad/s


def test_panda_limits():
    """FCI documentation: joint 4 never reaches 0."""
    limits = load_robot("panda").limits
    assert limits["q"][3] == (-3.0718, -0.0698)
    assert limits["q"][5] == (-0.0175, 3.7525)
    assert limits["tau"] == (87,) * 4 + (12,) * 3


def test_emps_gravity_is_normal_to_the_motion():
    for name in ("emps", "emps_asymmetric"):
        robot = load_robot(name)
        assert robot.frame(1).sigma == PRISMATIC
        assert not robot.gravity[2]
    assert [e.when for e in load_robot("emps_asymmetric").elements] == [
        None,
        "positive",
        "positive",
        "negative",
        "negative",
    ]


def test_two_branch_shape():
    robot = load_robot("two_branch")
    assert [f.j for f in robot.frames if f.ant == 1] == [2, 6]
    assert robot.path(5) == (1, 2, 3, 4, 5)
    assert [f.j for f in robot.frames if f.sigma == FIXED] == [5]
    assert [f.j for f in robot.frames if f.sigma == PRISMATIC] == [3]
    assert len(set(robot.constants.values())) == len(robot.constants)


def test_haptic_table_5():
    """Chapter Table 5 as printed: ant, mu, sigma, gamma, b, alpha, d, r."""
    rows = [
        [str(x) for x in (f.ant, f.mu, f.sigma, f.gamma, f.b, f.alpha, f.d, f.r)]
        for f in load_robot("haptic").frames
    ]
    assert rows == [row.split() for row in """
        0 1 0 0 0 0     0   0
        1 1 0 0 0 -pi/2 0   0
        2 0 0 0 0 0     D3  0
        3 0 0 0 0 0     D4  0
        1 1 0 0 0 -pi/2 0   0
        5 0 0 0 0 0     D6  0
        6 0 0 0 0 0     D3  0
        3 0 2 0 0 0     -D6 0
    """.strip().splitlines()]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "loop"),
    [("haptic", (7, 8)), ("sr400", (9, 10)), ("four_bar", (4, 5)), ("five_bar", (5, 6))],
)
def test_loops(name, loop):
    """One loop each; what a file assumes beyond its source is said in its comments."""
    robot = load_robot(name)
    assert [(x.cut, x.twin) for x in robot.loops] == [loop]
    text = (resources.files("symgen.description") / "robots" / robot.file).read_text(
        encoding="utf-8"
    )
    assert "assum" in text or "example" in text
