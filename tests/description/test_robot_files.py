"""Every way a robot file can be wrong gives one DescriptionError: file, line, what was given, what
was expected.
"""

import json
import subprocess
import sys

import pytest

from symgen.description import json_schema, load_robot, packaged_robots, parse_robot, skeleton
from symgen.description.yaml import MAX_BYTES
from symgen.errors import DescriptionError

ARM = """\
symgen: 1
name: arm
title: Test arm
gravity: [0, -g, 0]
constants: {D2: 0.5, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0,  theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}
elements:
  Ia: {kind: inertia, along: all}
  FV: {kind: viscous, along: all}
drives: {ratio: [[100, 0], [0, 100]], offset: [0, 0], torque_constant: 2}
limits: {q: [pi, [-pi/2, pi/2]], qd: [3, 3]}
values: {M1: 2.0}
"""


def error_of(text, file="arm.yaml"):
    with pytest.raises(DescriptionError) as caught:
        parse_robot(text if isinstance(text, bytes) else text.encode(), file)
    assert caught.value.file == file
    return caught.value


# what is replaced, by what, line of the error, words the message must contain: what was given, then
# what was expected
WRONG = [
    ("symgen: 1", "symgen: 2", 1, ["symgen: 2", "expected `symgen: 1`"]),
    ("symgen: 1", "symgen: yes", 1, ["'yes'", "expected `symgen: 1`"]),
    ("symgen: 1\n", "", 1, ["no key `symgen`", "expected `symgen: 1`"]),
    ("name: arm\n", "", 1, ["'name' is missing"]),
    ("name: arm", "name: 2arm", 2, ["'2arm'", "letter"]),
    ("name: arm", "name: a b", 2, ["'a b'", "letter"]),
    ("name: arm", "name: class", 2, ["name: 'class'", "word of Python"]),
    ("name: arm", "name: [a]", 2, ["['a']", "expected text"]),
    (
        "title: Test arm",
        "record: {files: [a.csv]}",
        3,
        ["'record'", "this is a study file: the robot comes first"],
    ),
    ("title: Test arm", "titel: Test arm", 3, ["'titel'", "did you mean 'title'"]),
    ("title: Test arm", 'title: "a\\nb"', 3, ["expected one line"]),
    ("title: Test arm", 'title: \'a"""b\'', 3, ["expected one line", "quotes"]),
    ("[0, -g, 0]", "[0, -g]", 4, ["[0, '-g']", "expected 3 entries"]),
    ("[0, -g, 0]", "down", 4, ["'down'", "expected a list"]),
    ("[0, -g, 0]", "[0, -G, 0]", 4, ["'G'", "declared symbols: D2, g"]),
    ("g: 9.81", "g: fast", 5, ["'fast'", "constant expression"]),
    ("g: 9.81", "g: sqrt(2 - sqrt(5))", 5, ["finite real"]),
    ("g: 9.81", "g: .inf", 5, ["'.inf'", "expected a number"]),
    ("g: 9.81", "g: true", 5, ["True", "expected a number"]),
    ("g: 9.81", "g: 9.81, 2g: 1", 5, ["'2g'", "letter"]),
    ("g: 9.81", "g: 9.81, M1: 1", 5, ["'M1'", "choose another"]),
    ("g: 9.81", "g: 9.81, g: 9.8", 5, ["'g' is given twice", "line 5"]),
    ("ant: 1", "ant: 2", 8, ["ant = 2", "earlier frame"]),
    ("ant: 0", "ant: 2", 7, ["[1, 2]", "cycle"]),
    ("ant: 1", "ant: 7", 8, ["ant = 7", "earlier frame"]),
    ("ant: 1", "ant: base", 8, ["'base'", "expected a whole number"]),
    ("ant: 1, ", "", 8, ["'ant' is missing"]),
    ("  2: {ant", "  3: {ant", 8, ["frame 2 is missing", "without gaps"]),
    ("  2: {ant", "  1: {ant", 8, ["1 is given twice", "line 7"]),
    ("  2: {ant", "  two: {ant", 8, ["'two'", "expected a whole number"]),
    ("1, sigma: 0", "1, sigma: 3", 8, ["sigma = 3", "0 revolute, 1 prismatic or 2 fixed"]),
    ("1, sigma: 0", "1, sigma: 0.0", 8, ["0.0", "expected a whole number"]),
    ("1, sigma: 0", "1, sigma: 0, mu: 2", 8, ["mu = 2", "1 actuated or 0 passive"]),
    ("1, sigma: 0", "1, sigma: 0, mu: 0", 8, ["joints [2] are passive", "set mu: 1"]),
    ("d: D2", "d: L2", 8, ["'L2'", "declared symbols: D2, g"]),
    ("d: D2", "d: __import__('os')", 8, ["__import__", "expected numbers"]),
    ("d: D2", "d: eval(D2)", 8, ["'eval' is not a known function", "sin, cos, tan"]),
    ("d: D2", "d: q1.__class__", 8, ["q1.__class__", "expected numbers"]),
    ("d: D2", "d: [1]", 8, ["[1]", "expected a number or an expression"]),
    ("d: D2", "d: null", 8, ["None", "expected a number or an expression"]),
    ("d: D2", "d: 1/0", 8, ["division by zero"]),
    ("d: D2", "D: D2", 8, ["'D'", "theta, r"]),
    ("theta: q2", "theta: 0", 8, ["theta = 0", "expected q2 once"]),
    ("theta: q2", "theta: q1", 8, ["theta = q1", "expected q2 once"]),
    ("theta: q2", "theta: 2*q2", 8, ["theta = 2*q2", "expected q2 once"]),
    ("theta: q2", "theta: q2 + sin(q2)", 8, ["expected q2 once"]),
    ("theta: q2, r: 0", "theta: q2, r: q2", 8, ["r = q2", "in theta if sigma is 0"]),
    (
        "inertia, along: all",
        "inertial, along: all",
        10,
        ["'inertial'", "expected one of inertia, viscous"],
    ),
    ("inertia, along: all", "inertia", 10, ["acts on no joint", "give `along`"]),
    ("inertia, along: all", "inertia, along: most", 10, ["'most'", "expected `all` or a table"]),
    ("inertia, along: all", "inertia, along: {1: q1**2}", 10, ["q1**2", "such as q5 + q6"]),
    ("inertia, along: all", "inertia, along: {1: q1 + 1}", 10, ["q1 + 1", "such as q5 + q6"]),
    ("inertia, along: all", "inertia, form: {1: q1}", 10, ["q1", "such as q6**2"]),
    ("inertia, along: all", "inertia, along: {5: q1}", 10, ["frame 5 does not exist"]),
    ("inertia, along: all", "inertia, along: {1: q7}", 10, ["'q7'", "declared symbols"]),
    (
        "inertia, along: all",
        "inertia, along: all, when: positive",
        10,
        ["'positive'", "viscous and coulomb"],
    ),
    ("  Ia:", "  M:", 10, ["'M'", "must not be the name of an inertial parameter"]),
    ("  Ia:", "  Ia2:", 10, ["'Ia2'", "digit"]),
    ("viscous, along: all", "coulomb, form: {1: q1**2}", 11, ["no quadratic form", "use `along`"]),
    (
        "[[100, 0], [0, 100]]",
        "[[100, 0]]",
        12,
        ["rows with [2] numbers", "expected 2 rows with 2 numbers"],
    ),
    ("[[100, 0], [0, 100]]", "[[100, 0], [50, 0]]", 12, ["singular"]),
    ("[[100, 0], [0, 100]]", "[[0.1, 0.3], [0.3, 0.9]]", 12, ["singular"]),
    ("[[100, 0], [0, 100]]", "[[100, 0], [0, x]]", 12, ["'x'", "expected a number"]),
    ("offset: [0, 0]", "offset: [0]", 12, ["1 entries", "expected 2"]),
    ("torque_constant: 2", "torque_constant: [2]", 12, ["1 entries", "expected 2"]),
    (
        "torque_constant: 2",
        "torque_const: 2",
        12,
        ["'torque_const'", "did you mean 'torque_constant'"],
    ),
    ("[-pi/2, pi/2]", "[1, -1]", 13, ["(1.0, -1.0)", "lower < upper"]),
    ("[-pi/2, pi/2]", "[1]", 13, ["[1]", "[lower, upper]"]),
    ("qd: [3, 3]", "qd: [3]", 13, ["1 entries", "with 2 entries each"]),
    ("qd: [3, 3]", "qd: [3, -3]", 13, ["-3.0", "positive number"]),
    ("qd: [3, 3]", "qv: [3, 3]", 13, ["'qv'", "expected q, qd, qdd, tau"]),
    ("M1: 2.0", "M3: 2.0", 14, ["'M3'", "not a standard parameter"]),
    ("M1: 2.0", "M1: heavy", 14, ["'heavy'", "expected a number"]),
    ("M1: 2.0", "1: 2.0", 14, ["found 1", "expected a name"]),
    ("values:", "massless: [7]\nvalues:", 14, ["link 7 does not exist", "[1, 2]"]),
    ("values:", "loops: [{cut: 2, twin: 9}]\nvalues:", 14, ["twin frame 9 does not exist"]),
    ("values:", "loops:\n  - {cut: 2, twin: 1}\nvalues:", 15, ["sigma 0", "expected 2"]),
    ("values:", "loops: [{cut: 2}]\nvalues:", 14, ["'twin' is missing"]),
    (
        "values:",
        "loops: [{cut: 2, twin: 1, start: {x: 1}}]\nvalues:",
        14,
        ["'x'", "expected q1, q2"],
    ),
    ("values:", "constraints: {q2: q1}\nvalues:", 14, ["q2", "not a passive joint"]),
    ("values:", "constraints: {z2: q1}\nvalues:", 14, ["'z2'", "expected q1, q2"]),
    # what novices write, and what to write instead
    (
        "theta: q2",
        "theta: q2 + 90",
        8,
        ["frame 2: theta = q2 + 90", "14.3 turns", "90 degrees are pi/2"],
    ),
    (
        "2: {ant: 1, sigma: 0, alpha: 0",
        "2: {ant: 1, sigma: 0, alpha: -90",
        8,
        ["alpha = -90", "angles are in rad"],
    ),
    ("theta: q2", "theta: q2 + 90*D2", 8, ["45 rad", "angles are in rad"]),
    ("theta: q2", "theta: q2 + 90deg", 8, ["unexpected 'deg'", "90 degrees are pi/2"]),
    ("theta: q2", "theta: q2 + 90°", 8, ["unexpected '°'", "90 degrees are pi/2"]),
    ("theta: q2", "theta: q2 + PI/2", 8, ["'PI'", "did you mean 'pi'"]),
    ("theta: q2", "theta: q2 + pi^2", 8, ["unexpected '^'", "a power is written **"]),
    ("d: D2", "d: d2", 8, ["'d2'", "did you mean 'D2'"]),
    ("D2: 0.5", "D2: 500 mm", 5, ["unexpected 'mm'", "SI and rad"]),
    ("D2: 0.5", "D2: 0,5", 5, ["decimal comma"]),
    ("D2: 0.5", "D2: g/20", 5, ["a constant is one number"]),
    (
        "theta: q2, r: 0",
        "theta: 0, r: q2",
        8,
        [
            "expected q2 once",
            "a prismatic joint has sigma: 1 and r: q2",
            "a fixed frame (a tool) sigma: 2",
        ],
    ),
    ("1, sigma: 0", "1, sigma: 1", 8, ["theta = q2", "in r if sigma is 1"]),
    ("1, sigma: 0", "1, sigma: prismatic", 8, ["'prismatic'", "0 revolute, 1 prismatic, 2 fixed"]),
    ("[[100, 0], [0, 100]]", "[100, [0, 100]]", 12, ["found 100", "one row per motor"]),
    ("[[100, 0], [0, 100]]", "100", 12, ["found 100", "one number per motor, [100, 80]"]),
    ("M1: 2.0", "M1R: 2.0", 14, ["'M1R'", "give the standard parameter M1"]),
    ("M1: 2.0", "mass2: 2.0", 14, ["'mass2'", "expected names such as XX2", "M2", "FV2"]),
    ("M1: 2.0", "M2: 2.0}\nmassless: [2] #{", 14, ["'M2'", "link 2 has no inertial parameters"]),
    ("values:", "loops:\n  - {cut: 3, twin: 2}\nvalues:", 15, ["cut frame 3 does not exist"]),
    ("  2: {ant", "\t2: {ant", 8, ["there is a tab here; indent with spaces"]),
    ("  2: {ant", "   2: {ant", 8, ["another indent"]),
    ("theta: q2, r: 0}", "theta: q2 r: 0}", 8, ["missing , or }"]),
    ("title: Test arm", "title: Arm: test", 3, ["between quotes"]),
    ("  2: {ant", "  - {ant", 8, ["every row as `1: {...}`"]),
    # YAML that says more than it shows
    ("[0, -g, 0]", "&a [0, -g, 0]", 4, ["anchors", "write the value itself"]),
    ("[0, -g, 0]", "*a", 4, ["aliases", "write the value itself"]),
    ("[0, -g, 0]", "!!python/object/apply:os.system [echo]", 4, ["tags", "plain value"]),
    ("[0, -g, 0]", "[" * 40 + "]" * 40, 4, ["nested more than"]),
    ("values:", "<<: {M1: 1}\nvalues:", 14, ["'<<'", "expected a name"]),
    ("values:", "? [a, b]\n: 1\nvalues:", 14, ["expected a name"]),
    ("values:", "---\nvalues:", 14, ["second document"]),
    ("values:", "\tvalues:", 14, ["not YAML"]),
    ("{M1: 2.0}", "{M1: 2.0", 14, ["not YAML"]),
    ("title: Test arm", "title: " + "a" * 5000, 3, ["5000 characters", "the limit is"]),
]


@pytest.mark.parametrize(
    ("old", "new", "line", "words"), WRONG, ids=[f"{new.strip()[:32]!r}" for _, new, _, _ in WRONG]
)
def test_error_names_line_given_and_expected(old, new, line, words):
    assert ARM.count(old) >= 1
    error = error_of(ARM.replace(old, new, 1))
    assert error.line == line or (error.line, line) == (
        15,
        14,
    )  # an unclosed { is noticed at the end of the text
    assert str(error).endswith(f"(arm.yaml, line {error.line})")
    for word in words:
        assert word in str(error), str(error)


def test_an_antecedent_after_one_that_does_not_exist():
    """Frame 1 is mounted on frame 2, and frame 2 on a frame that the table lacks."""
    error = error_of(ARM.replace("ant: 1", "ant: 7").replace("ant: 0", "ant: 2"))
    assert error.line == 8 and "ant = 7; expected an earlier frame" in str(error)


def test_cut_and_twin_exchanged():
    fixed = "  3: {ant: 1, sigma: 2, alpha: 0, d: D2, theta: 0, r: 0}\n"
    error = error_of(ARM.replace("elements:", f"{fixed}loops: [{{cut: 3, twin: 2}}]\nelements:"))
    assert "twin frame 2 has sigma 0" in str(error) and "exchange cut and twin" in str(error)


@pytest.mark.parametrize("theta", ["q2 + 3*pi", "q2 - 6.28", "q2 + 8*pi + D2"])
def test_turns_written_with_pi_are_no_degrees(theta):
    assert parse_robot(ARM.replace("theta: q2", f"theta: {theta}").encode(), "arm.yaml").joints == (
        1,
        2,
    )


@pytest.mark.parametrize(
    ("content", "line", "word"),
    [
        (b"", 1, "found nothing"),
        (b"# only a comment\n", 1, "found nothing"),
        (b"12", 1, "found 12"),
        (b"- a\n- b", 1, "found ['a', 'b']"),
        (b"name: caf\xe9", 1, "0xe9 is not UTF-8"),
        (b"a: 1\nb: \xff", 2, "0xff is not UTF-8"),
        (b"\xff\xfes\x00", 1, "save the file as UTF-8"),
        (b"a\x00b: 1", 1, "not YAML"),
        (b"\x89PNG\r\n\x1a\n", 1, "is not UTF-8"),
        (b"# " + b"x" * MAX_BYTES, 1, f"more than {MAX_BYTES} bytes"),
    ],
)
def test_files_that_are_no_robot_files(content, line, word):
    error = error_of(content, "arm.yaml")
    assert (error.line, word in str(error)) == (line, True), str(error)


def test_alias_bomb_stops_at_its_first_anchor():
    bomb = "a: &a [x, x]\n" + "".join(
        f"{b}: &{b} [{','.join(['*' + a] * 9)}]\n"
        for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    )
    assert error_of(bomb).line == 1


def test_missing_file_lists_the_packaged_robots(tmp_path):
    for source in ("no_such_robot", str(tmp_path / "none.yaml"), tmp_path / "none.yaml"):
        with pytest.raises(DescriptionError, match=r"no file .*packaged are .*tx40"):
            load_robot(source)
    for source in (tmp_path, "a\0b", "x" * 5000):
        with pytest.raises(DescriptionError, match="cannot read"):
            load_robot(source)


def test_load_from_a_path(tmp_path):
    file = tmp_path / "my_arm.yaml"
    file.write_bytes(ARM.encode())
    robot = load_robot(file)
    assert (robot.name, robot.file) == ("arm", "my_arm.yaml")
    assert load_robot(str(file)) == robot
    file.write_bytes(ARM.replace("g: 9.81", "g: x").encode())
    with pytest.raises(DescriptionError, match=r"\(my_arm.yaml, line 5\)"):
        load_robot(file)


def test_bytes_are_hashed_as_they_are():
    unix, windows = (
        parse_robot(ARM.encode(), "a"),
        parse_robot(ARM.replace("\n", "\r\n").encode(), "a"),
    )
    assert unix.sha256 != windows.sha256
    assert (unix.frames, unix.values) == (windows.frames, windows.values)
    assert (
        parse_robot(b"\xef\xbb\xbf" + ARM.encode(), "a").frames == unix.frames
    )  # a byte order mark is no error


def test_ratios_of_uncoupled_drives_are_a_diagonal():
    rows = "[[100, 0], [0, -80]]"
    robots = [
        parse_robot(ARM.replace("[[100, 0], [0, 100]]", x).encode(), "a.yaml")
        for x in (rows, "[100, -80]")
    ]
    assert robots[0].drives == robots[1].drives
    assert robots[1].drives.ratio == ((100.0, 0.0), (0.0, -80.0))


def test_defaults_and_expressions():
    robot = parse_robot(ARM.encode(), "arm.yaml")
    assert [str(x) for x in robot.gravity] == ["0", "-g", "0"]
    assert robot.joints == (1, 2)
    assert str(robot.frame(2).d) == "D2"
    assert not robot.frame(2).gamma
    assert not robot.frame(2).b
    assert robot.drives.torque_constant == (2.0, 2.0)
    assert robot.limits["q"][1] == (-1.5707963267948966, 1.5707963267948966)
    assert robot.limits["q"][0] == (-3.141592653589793, 3.141592653589793)
    assert robot.values == {"M1": 2.0}
    fixed = ARM.replace(
        "elements:", "  3: {ant: 2, sigma: 2, alpha: 0, d: 0, theta: pi/3, r: 0.1}\nelements:"
    )
    assert parse_robot(fixed.encode(), "a").frame(3).mu == 0


def test_elements_along_rows_and_forms():
    text = ARM.replace(
        "viscous, along: all", "viscous, along: {1: q1}, form: {2: q2**2 + 2*D2*q1*q2}"
    )
    element = parse_robot(text.encode(), "a").elements[1]
    assert {j: {i: str(c) for i, c in row.items()} for j, row in element.along.items()} == {
        1: {1: "1"}
    }
    assert {ij: str(c) for ij, c in element.form[2].items()} == {
        (2, 2): "1",
        (1, 2): "D2",
        (2, 1): "D2",
    }


def test_loops_and_constraints():
    text = """\
symgen: 1
name: four_bar
gravity: [0, -g, 0]
constants: {g: 9.81, L1: 1, L2: 2, L3: 1.5, L4: 2.5}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: L1, theta: q2, r: 0}
  3: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: L4, theta: q3, r: 0}
  4: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: L2, theta: q4, r: 0}
  5: {ant: 3, sigma: 2, alpha: 0, d: L3, theta: 0, r: 0}
loops: [{cut: 4, twin: 5, start: {q1: 1.2, q2: -pi/4}}]
constraints: {q4: q3 - q1 - q2}
"""
    robot = parse_robot(text.encode(), "a")
    assert (robot.loops[0].cut, robot.loops[0].twin) == (4, 5)
    assert robot.loops[0].start == {1: 1.2, 2: -0.7853981633974483}
    assert str(robot.constraints[4]) == "-q1 - q2 + q3"
    assert robot.links == (1, 2, 3)


def test_skeleton_is_a_robot_file():
    text = skeleton("my_arm")
    assert parse_robot(text.encode(), "my_arm.yaml").name == "my_arm"
    every = (
        text.replace("# drives", "drives")
        .replace("# limits", "limits")
        .replace("# values", "values")
    )
    assert parse_robot(every.encode(), "my_arm.yaml").drives is not None
    with pytest.raises(DescriptionError, match="'my-arm' is not a valid name"):
        skeleton("my-arm")


def test_json_schema_for_editors():
    schema = json.loads(json.dumps(json_schema()))
    assert {"symgen", "name", "gravity", "frames"} == set(schema["required"])
    assert schema["additionalProperties"] is False
    assert set(schema["$defs"]) == {
        "LawScalar",
        "Frame",
        "Loop",
        "Element",
        "Drives",
        "LimitsTable",
    }


def test_import_is_light():
    code = (
        "import sys, symgen.description; print([m for m in ('numpy', 'sympy', 'casadi', "
        "'scipy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_exist():
    import symgen.description as description

    assert all(hasattr(description, name) for name in description.__all__)
    assert "tx40" in packaged_robots()


def test_a_constant_that_is_a_number_is_refused_by_its_line() -> None:
    """A key 3 beside names ended in a TypeError where an expression had an unknown symbol."""
    text = ARM.replace("g: 9.81", "3: 1, g: 9.81").replace("alpha: 0", "alpha: D", 1)
    with pytest.raises(DescriptionError, match=r"constants\.3: found 3; expected a name"):
        parse_robot(text.encode(), "arm.yaml")
