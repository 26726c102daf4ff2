"""Notes on robots that are valid but probably not what was meant, and the relations that `show`
prints.
"""

from pathlib import Path

import pytest
from campaign import some
from typer.testing import CliRunner

from symgen.cli.main import app
from symgen.derive.doubts import doubts, equal_sides, other_units
from symgen.description import load_robot, packaged_robots, parse_robot

TWO_BARS = """\
symgen: 1
name: bars
gravity: [0, -g, 0]
constants: {L1: 0.4, L2: 0.3, L3: 0.4, L4: 0.3, g: 9.81}
frames:
  1: {ant: 0, sigma: 0,        alpha: 0, d: 0,  theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: L1, theta: q2, r: 0}
  3: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: L4, theta: q3, r: 0}
  4: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: L3, theta: q4, r: 0}
  5: {ant: 2, sigma: 2,        alpha: 0, d: L2, theta: 0,  r: 0}
loops: [{cut: 4, twin: 5}]
"""


def robot(text):
    return parse_robot(text.encode(), "bars.yaml")


def test_equal_sides_under_two_names_are_told():
    (note,) = equal_sides(robot(TWO_BARS))
    assert "frames 4 and 5" in note and "L1 and L3, L2 and L4 are equal" in note


def test_a_parallelogram_and_unequal_sides_are_not():
    assert equal_sides(robot(TWO_BARS.replace("d: L3", "d: L1").replace("d: L4", "d: L2"))) == []
    assert equal_sides(robot(TWO_BARS.replace("L3: 0.4, L4: 0.3", "L3: 0.41, L4: 0.32"))) == []


@pytest.mark.parametrize("name", packaged_robots())
def test_packaged_robots_raise_no_doubt(name):
    assert doubts(load_robot(name)) == []


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("L1: 0.4", "L1: 400", "frame 2: d holds a length of 400 m; lengths are in m, not mm"),
        (
            "gravity:",
            "drives: {ratio: [[100]], offset: [-90]}\ngravity:",
            "drives.offset of joint 1: -90 rad are 14.3 turns",
        ),
        (
            "gravity:",
            "limits: {q: [[-170, 180]]}\ngravity:",
            "limits.q of joint 1: 180 rad are 28.6 turns",
        ),
    ],
)
def test_other_units_are_told(old, new, words):
    (note,) = other_units(
        robot(
            TWO_BARS.replace(old, new)
            .split("  3:")[0]
            .replace(" mu: 0,", "")
            .replace("[[100]], offset: [-90]", "[[100, 0], [0, 100]], offset: [-90, 0]")
            .replace("[[-170, 180]]", "[[-170, 180], 3]")
        )
    )
    assert words in note


def test_large_and_small_robots_and_free_joints_are_left_alone():
    crane = (
        TWO_BARS.split("  3:", maxsplit=1)[0]
        .replace(" mu: 0,", "")
        .replace("L1: 0.4", "L1: 80")
        .replace("d: 0,", "d: 12,")
    )
    assert other_units(robot(crane + "limits: {q: [1e16, 25]}\n")) == []
    assert (
        other_units(
            robot(
                crane.replace("80", "0.002")
                .replace("d: 12,", "d: 0,")
                .replace("g: 9.81", "g: 1.62")
            )
        )
        == []
    )


@pytest.mark.parametrize(
    ("angle", "meant"),
    [("1.5708", "pi/2"), ("-1.5707963", "-pi/2"), ("0.7854", "pi/4"), ("0.0001", "0")],
)
def test_decimals_for_round_angles_are_told(tmp_path, angle, meant):
    (tmp_path / "bars.yaml").write_text(
        TWO_BARS[: TWO_BARS.index("  2:")].replace("alpha: 0", f"alpha: {angle}")
    )
    for verb in ("show", "check", "generate"):
        result = CliRunner().invoke(
            app,
            [
                verb,
                str(tmp_path / "bars.yaml"),
                *(["-o", str(tmp_path)] if verb == "generate" else []),
            ],
        )
        assert result.exit_code == 0
        assert (
            result.stderr.startswith("note: frame 1: alpha has")
            and f", not {meant}: another robot" in result.stderr
        )


BOX = """<robot name="m"><link name="base"/>
<link name="a"><inertial><mass value="1"/>
<inertia ixx="0.02" iyy="0.006" izz="0.006" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
</robot>"""


@pytest.mark.parametrize("words", [["show"], ["check"], ["convert", "out.yaml"]], ids=str)
def test_an_inertia_that_no_body_can_have_is_told_once(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    Path("m.urdf").write_text(BOX)
    result = CliRunner().invoke(app, [words[0], "m.urdf", *words[1:]])
    assert result.exit_code == 0
    told = " ".join(result.stderr.split())
    assert told.count("ixx 0.02 > iyy + izz 0.012; this inertia enters ZZ1R.") == 1


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "2: {ant: 1, sigma: 0, mu: 0,",
            "2: {ant: 1, sigma: 0,",
            ["2 joints are actuated ([1, 2])", "set mu: 0 for each joint without a motor"],
        ),
        (
            "1: {ant: 0, sigma: 0,        alpha: 0",
            "1: {ant: 0, sigma: 0, alpha: pi/2",
            ["cannot coincide", "check the lengths, alpha"],
        ),
        (
            "loops:",
            "  6: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: 0, theta: q6, r: 0}\nloops:",
            ["joint 6 is in no loop", "declare q6"],
        ),
    ],
)
@some(1)
def test_a_loop_that_does_not_close_is_told_with_its_file(tmp_path, old, new, words):
    assert TWO_BARS.count(old) == 1
    (tmp_path / "bars.yaml").write_text(
        TWO_BARS.replace(old, new).replace("d: L3", "d: L1").replace("d: L4", "d: L2")
    )
    result = CliRunner().invoke(app, ["show", str(tmp_path / "bars.yaml")])
    assert result.exit_code == 2 and result.stderr.endswith("(bars.yaml)\n"), result.stderr
    assert all(word in result.stderr for word in words), result.stderr


def test_show_prints_the_passive_joints():
    lines = CliRunner().invoke(app, ["show", "sr400"]).stdout.splitlines()
    relations = [line for line in lines if line.startswith("passive: ")]
    assert len(relations) == len(load_robot("sr400").passive)
    assert all(" = " in line for line in relations)


def test_show_finds_a_name_in_other_capitals():
    assert (
        "similar names: ZZ1R"
        in CliRunner().invoke(app, ["show", "planar_2r", "--only", "zz1r"]).stderr
    )
