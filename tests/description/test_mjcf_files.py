"""MJCF: what is not read is refused by name and line before MuJoCo sees it; no file that it names
is opened; mangled files raise nothing else.
"""

import builtins
import re
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from oracles.mjcf_robots import ARM, GRIPPER
from symgen.cli.main import app
from symgen.description import load_robot
from symgen.description.tree_robot import read_tree
from symgen.description.xml_text import MAX_BYTES
from symgen.errors import DescriptionError

SMALL = """\
<mujoco model="small">
<worldbody>
<body name="a"><joint name="s" axis="0 0 1"/><inertial pos="0.1 0 0" mass="2" diaginertia="1 1 1"/>
<body name="b" pos="0.4 0 0"><joint name="e" axis="0 1 0"/><geom size="0.1" mass="1"/></body>
</body>
</worldbody>
</mujoco>
"""


def error_of(text):
    with pytest.raises(DescriptionError) as caught:
        read_tree(
            text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"), "arm.xml"
        )
    assert caught.value.file == "arm.xml" and caught.value.line is not None
    return caught.value


WORLD = "<worldbody>"
WRONG = [  # what is replaced, by what, line of the error, words of the message
    ("<mujoco model", "<robot model", 7, "mismatched tag"),
    (WORLD, "<worldbody><freejoint/>", 2, "MuJoCo refuses"),
    ('<joint name="e" axis="0 1 0"/>', '<freejoint name="e"/>', 4, "MuJoCo refuses"),
    ('<joint name="e" axis="0 1 0"/>', '<joint name="e" type="ball"/>', 4, "ball joint 'e'"),
    (WORLD, '<include file="/etc/passwd"/><worldbody>', 2, "<include> is not read"),
    (WORLD, '<worldbody><body><include file="../../x.xml"/></body>', 2, "<include> is not read"),
    (WORLD, '<extension><plugin plugin="a"/></extension><worldbody>', 2, "<extension> is not read"),
    (
        WORLD,
        '<worldbody><replicate count="1000000000"><body/></replicate>',
        2,
        "<replicate> is not read",
    ),
    (
        WORLD,
        '<worldbody><composite type="cable" count="1000000000 1 1"/>',
        2,
        "<composite> is not read",
    ),
    (WORLD, '<worldbody><flexcomp file="/etc/passwd"/>', 2, "<flexcomp> is not read"),
    (WORLD, '<worldbody><attach model="m" body="b"/>', 2, "<attach> is not read"),
    (WORLD, '<compiler settotalmass="x"/><worldbody>', 2, "expected 1 number"),
    (WORLD, "<nonsense/><worldbody>", 1, "<nonsense> is no element of MJCF"),
    ('<geom size="0.1" mass="1"/>', '<geom type="mesh" mesh="m"/>', 4, "would come from a mesh"),
    ('<geom size="0.1" mass="1"/>', "", 4, "MuJoCo refuses"),
    ('<geom size="0.1" mass="1"/>', '<geom size="nan" mass="1"/>', 4, "finite"),
    ('pos="0.4 0 0"', 'pos="1 -Infinity 0"', 4, "finite"),
    ('pos="0.4 0 0"', 'pos="1e300 0 0"', 1, "larger than"),
    ('axis="0 1 0"', 'axis="0 0 0"', 4, "MuJoCo refuses"),
    ('axis="0 1 0"', 'axis="&quot;/&gt;"', 4, "MuJoCo refuses"),
    (
        "</worldbody>",
        '</worldbody><equality><connect name="c" body1="a" anchor="0 0 0"/></equality>',
        6,
        "does not say which of the joints 's' have motors; write <actuator><motor joint=\"s\"/></actuator>",
    ),
    ("</worldbody>", '</worldbody><equality><flex flex="f"/></equality>', 6, "<flex> is not read"),
    (
        "</worldbody>",
        '</worldbody><equality><distance name="d" geom1="g"/></equality>',
        6,
        "<distance> 'd' in <equality>: only joint, tendon, connect, weld are read",
    ),
    (
        "</worldbody>",
        '</worldbody><equality><weld name="w" body1="a"/></equality><actuator><motor joint="s"/></actuator>',
        6,
        "loop 'w' ties two links between which only joints with motors or relations move ('s')",
    ),
    (
        "</worldbody>",
        (
            '</worldbody><equality><joint name="p" joint1="s" joint2="e" polycoef="0 1 2 0 '
            '0"/></equality>'
        ),
        6,
        "is not linear; only a0 + a1*y is supported",
    ),
    (
        "</worldbody>",
        '</worldbody><equality><joint name="p" joint1="s"/><joint name="r" joint1="s"/></equality>',
        6,
        "follows from the other relations",
    ),
    (
        "</worldbody>",
        (
            '</worldbody><equality><joint name="p" joint1="s" '
            'joint2="e"/></equality><actuator><motor '
            'joint="s"/><motor joint="e"/></actuator>'
        ),
        6,
        "contains only actuated joints",
    ),
    (SMALL, '<robot name="x"/>', 1, "must end in .urdf"),
    (SMALL, "<mujoco><worldbody/></mujoco>", 1, "no joint that moves"),
]


@pytest.mark.parametrize(("old", "new", "line", "words"), WRONG)
def test_faults_are_errors_with_their_line(old, new, line, words):
    assert old in SMALL
    error = error_of(SMALL.replace(old, new, 1))
    assert words in error.message and error.line == line


BOMB = (
    '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "'
    + "&a;" * 50
    + '"><!ENTITY c "'
    + "&b;" * 50
    + '">]>'
)
HOSTILE = {
    "expanding entities": BOMB + SMALL.replace("small", "&c;"),
    "external entity": '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]>'
    + SMALL.replace("small", "&a;"),
    "nesting": "<mujoco><worldbody>" + "<body>" * 100_000,
    "nested bodies": SMALL.replace(WORLD, WORLD + "<body>" * 140 + "</body>" * 140),
    "many bodies": SMALL.replace(WORLD, WORLD + "<body/>" * 40_000),
    "many joints": SMALL.replace(
        "<joint", "".join(f'<joint name="x{k}"/>' for k in range(300)) + "<joint", 1
    ),
    "size": SMALL + " " * MAX_BYTES,
    "bytes": bytes(range(256)) * 100,
    "nothing": b"",
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_files_are_refused(kind):
    start = time.process_time()
    if kind == "nested bodies":  # deep, and a mechanism all the same
        assert read_tree(HOSTILE[kind].encode(), "arm.xml")[0].joints == (1, 2)
    else:
        error_of(HOSTILE[kind])
    assert time.process_time() - start < 5  # the contract of issue 6: no hang above 5 s


def test_no_file_reaches_mujoco(tmp_path, monkeypatch):
    """Files of meshes and textures that are no such files are not opened."""
    text = ARM.replace(
        "<worldbody>",
        '<size memory="900G"/><custom><numeric name="n" size="999999999"/></custom><worldbody>',
        1,
    )
    monkeypatch.chdir(tmp_path)
    for name in re.findall(r'file="(.*?)"', text):
        (tmp_path / name).mkdir(parents=True, exist_ok=True)
    assert read_tree(text.encode(), "arm.xml") == read_tree(text.encode(), "arm.xml")
    read_tree(SMALL.encode(), "small.xml")  # what MuJoCo opens when it loads
    opened = []
    real = builtins.open
    monkeypatch.setattr(builtins, "open", lambda *a, **k: opened.append(a) or real(*a, **k))
    read_tree(text.encode(), "arm.xml")
    assert opened == []


def test_what_is_left_out_is_said():
    text = SMALL.replace('name="b"', 'name="b" gravcomp="0.5"').replace(
        WORLD,
        '<option gravity="0 0 -9"><flag gravity="disable" contact="disable"/></option><worldbody>',
    )
    robot, notes = read_tree(text.encode(), "small.xml")
    assert (
        "not read: flag contact" in notes
        and robot.not_read == ("gravcomp of 'b'",)
        and [str(g) for g in robot.gravity] == ["0", "0", "0"]
    )
    polynomial = SMALL.replace('axis="0 1 0"', 'axis="0 1 0" damping="1 0.5"')
    try:
        said = read_tree(polynomial.encode(), "small.xml")[0].not_read
    except DescriptionError as error:  # MuJoCo before 4 knows one damping
        assert "MuJoCo refuses" in error.message
    else:
        assert "damping that grows with speed of 'e'" in said


def test_fluid_and_spatial_tendons_are_said():
    text = SMALL.replace(
        WORLD,
        '<option density="1000" viscosity="0" wind="1 0 0"/><worldbody><site name="w"/>',
    ).replace(
        "</worldbody>",
        '</worldbody><tendon><spatial stiffness="3"><site site="w"/></spatial></tendon>',
    )
    robot, _ = read_tree(text.encode(), "small.xml")
    assert robot.not_read == ("forces of a fluid (density, wind)", "<spatial> in <tendon>")


def test_convert_and_every_verb(tmp_path):
    file, table = tmp_path / "gripper.xml", tmp_path / "gripper.yaml"
    file.write_text(GRIPPER)
    result = CliRunner().invoke(app, ["convert", str(file), str(table)])
    assert result.exit_code == 0 and "joints: q1 = 'wrist1'" in result.stdout
    assert load_robot(table).frames == load_robot(file).frames and dict(
        load_robot(table).values
    ) == dict(load_robot(file).values)
    (tmp_path / "small.mjcf").write_text(SMALL)
    result = CliRunner().invoke(app, ["check", str(tmp_path / "small.mjcf")])
    assert result.exit_code == 0 and "certificate valid" in result.stdout


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_mangled_files_raise_nothing_else(data):
    text = ARM if data.draw(st.booleans()) else GRIPPER
    for _ in range(data.draw(st.integers(1, 4))):
        at, length = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 12))
        text = (
            text[:at]
            + data.draw(st.text(alphabet="<>/=\"' 0123456789.e-&;!x\n\x00é", max_size=8))
            + text[at + length :]
        )
    try:
        read_tree(text.encode("utf-8", "surrogatepass"), "arm.xml")
    except DescriptionError as error:
        assert re.search(r"\(arm\.xml, line \d+\)$", str(error))


def test_nothing_is_said_or_written_beside_the_result(tmp_path, monkeypatch, capfd) -> None:
    """Two hinges on one axis: MuJoCo cannot solve for their accelerations and would tell a file of
    the working folder.
    """
    hinge = '<joint type="hinge" axis="0 0 1"/>'
    text = (
        f'<mujoco><worldbody><body>{hinge * 2}<inertial pos="0 0 0" mass="1" diaginertia="1 1 '
        '1"/></body></worldbody></mujoco>'
    )
    monkeypatch.chdir(tmp_path)
    assert read_tree(text.encode(), "a.xml")[0].joints == (1, 2)
    assert list(tmp_path.iterdir()) == [] and capfd.readouterr() == ("", "")
