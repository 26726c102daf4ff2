"""Inertias in units of CAD, about the wrong point, with other products: wrong files are named, right not.

Bodies are boxes, whose inertia is computed here; their sizes are those of an arm and of a finger.
"""

from __future__ import annotations

import re
from pathlib import Path

import airo_models
import numpy as np
import pytest
from typer.testing import CliRunner

from symgen.cli.main import app
from symgen.derive.doubts import doubts
from symgen.description import Robot, load_robot, parse_robot
from symgen.description.bodies import impossible_links
from symgen.description.cad import from_cad
from symgen.description.files import packaged_robots

Array = np.ndarray
Link = tuple[float, Array, Array]  # mass, centre, tensor about it
ARM = (  # mass, sides of the box and its centre, origin of the joint: an arm of 1.2 m
    (4.0, (0.12, 0.15, 0.2), (0.01, -0.03, 0.08), (0.0, 0.0, 0.15)),
    (8.0, (0.45, 0.12, 0.14), (0.2, 0.01, 0.1), (0.0, 0.12, 0.05)),
    (3.0, (0.4, 0.1, 0.09), (0.18, -0.01, 0.02), (0.42, 0.0, 0.0)),
    (1.5, (0.09, 0.12, 0.1), (0.01, 0.06, 0.01), (0.39, 0.0, 0.0)),
    (1.2, (0.08, 0.1, 0.11), (0.0, 0.01, 0.07), (0.0, 0.1, 0.0)),
    (0.4, (0.07, 0.08, 0.03), (0.003, 0.002, 0.04), (0.0, 0.0, 0.1)),
)
FINGER = (
    (0.03, (0.04, 0.02, 0.018), (0.02, 0.001, 0.0), (0.0, 0.0, 0.01)),
    (0.02, (0.03, 0.016, 0.015), (0.015, 0.0, 0.001), (0.04, 0.0, 0.0)),
    (0.012, (0.025, 0.014, 0.013), (0.011, 0.0, 0.0), (0.03, 0.0, 0.0)),
)
AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")


def links(shapes: tuple) -> list[Link]:
    """Boxes, each turned by an angle of its own."""
    rng, found = np.random.default_rng(3), []
    for mass, sides, centre, _ in shapes:
        a, b, c = np.square(sides)
        Q = np.linalg.qr(rng.normal(0, 0.15, (3, 3)) + np.eye(3))[0]
        box = mass / 12 * np.diag([b + c, a + c, a + b])
        found.append((mass, np.array(centre), Q @ box @ Q.T))
    return found


def urdf(shapes: tuple, bodies: list[Link]) -> str:
    lines = ['<robot name="own">', '<link name="base"/>']
    for k, ((M, c, I), (*_, origin)) in enumerate(zip(bodies, shapes, strict=True), 1):
        moments = " ".join(
            f'{name}="{I[i, j]:.12g}"'
            for name, (i, j) in zip(
                ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
                ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)),
                strict=True,
            )
        )
        lines += [
            f'<link name="link{k}"><inertial><origin xyz="{" ".join(map(str, c))}"/>',
            f'<mass value="{M}"/><inertia {moments}/></inertial></link>',
            f'<joint name="j{k}" type="revolute"><origin xyz="{" ".join(map(str, origin))}"/>'
            f'<parent link="{f"link{k - 1}" if k > 1 else "base"}"/><child link="link{k}"/>'
            f'<axis xyz="{AXES[k - 1]}"/>'
            '<limit lower="-2" upper="2" effort="100" velocity="2"/></joint>',
        ]
    return "\n".join([*lines, "</robot>"])


def line(text: str, name: str) -> str:
    """The words that name a link, with the line of its inertia."""
    number = next(k for k, row in enumerate(text.split("\n"), 1) if f'<link name="{name}"' in row)
    return f"link '{name}' (line {number + 1})"


def at_origin(M: float, c: Array) -> Array:
    return M * (c @ c * np.eye(3) - np.outer(c, c))


def changed(shapes: tuple, which: str, I: float = 1.0, M: float = 1.0, c: float = 1.0) -> tuple:
    """Links of `shapes` with factors on those of `which`, "all" or a number."""
    bodies = [
        (M * m, c * x, I * t) if which in ("all", str(k)) else (m, x, t)
        for k, (m, x, t) in enumerate(links(shapes), 1)
    ]
    return shapes, bodies


WRONG = {  # files, the number of named links, and the remedy
    "g m^2, one link": (changed(ARM, "2", I=1e3), 1, "in g m^2: multiply them by 1e-3"),
    "kg mm^2, one link": (changed(ARM, "3", I=1e6), 1, "in kg mm^2: multiply them by 1e-6"),
    "g mm^2, one link": (changed(ARM, "6", I=1e9), 1, "in g mm^2: multiply them by 1e-9"),
    "g m^2": (changed(ARM, "all", I=1e3), 6, "in g m^2: multiply them by 1e-3"),
    "kg mm^2": (changed(ARM, "all", I=1e6), 6, "in kg mm^2: multiply them by 1e-6"),
    "g mm^2": (changed(ARM, "all", I=1e9), 6, "in g mm^2: multiply them by 1e-9"),
    "1e-3, one link": (changed(ARM, "1", I=1e-3), 1, "multiply them by 1e3"),
    "1e-6, one link": (changed(ARM, "4", I=1e-6), 1, "multiply them by 1e6"),
    "1e-9, one link": (changed(ARM, "5", I=1e-9), 1, "multiply them by 1e9"),
    "1e-6": (changed(ARM, "all", I=1e-6), 6, "multiply them by 1e6"),
    "g and g mm^2": (
        changed(ARM, "all", I=1e9, M=1e3),
        6,
        "g mm^2 and g: multiply by 1e-9 and 1e-3",
    ),
    "g": (changed(ARM, "all", M=1e3), 6, "the mass is probably in g: multiply it by 1e-3"),
    "a finger in g m^2": (changed(FINGER, "2", I=1e3), 1, "in g m^2: multiply them by 1e-3"),
    "a finger in kg mm^2": (changed(FINGER, "all", I=1e6), 3, "in kg mm^2: multiply them by 1e-6"),
    "a finger in g mm^2": (changed(FINGER, "3", I=1e9), 1, "in g mm^2: multiply them by 1e-9"),
    "a finger, 1e-3": (changed(FINGER, "all", I=1e-3), 3, "multiply them by 1e3"),
    "8000 kg m^2 on 1 kg": (
        (ARM, [*links(ARM)[:5], (1.0, np.zeros(3), 8000 * np.eye(3))]),
        1,
        "in kg mm^2: multiply them by 1e-6",
    ),
    "mm": (changed(ARM, "2", c=1e3), 1, "from the origin; lengths are in m, not mm"),
    "about the origins": (
        (ARM, [(M, c, I + at_origin(M, c)) for M, c, I in links(ARM)]),
        6,
        "about the origins of the links",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files_are_named_with_their_lines(name: str, tmp_path: Path) -> None:
    case, count, remedy = WRONG[name]
    text = urdf(*case)
    (tmp_path / "own.urdf").write_text(text)
    robot = load_robot(tmp_path / "own.urdf")
    (said,) = from_cad(robot)
    assert remedy in said and said in doubts(robot)
    right = links(case[0])
    wrong = [
        f"link{k}"
        for k, (a, b) in enumerate(zip(right, case[1], strict=True), 1)
        if any(np.any(np.not_equal(x, y)) for x, y in zip(a, b, strict=True))
    ]
    named = re.findall(r"link '(\w+)' \(line \d+\)", said)
    assert set(named) <= set(wrong)
    assert len(named) + int((re.search(r"(\d+) more\)", said) or [0, 0])[1]) == count
    for link in named:
        assert line(text, link) in said


@pytest.mark.parametrize("shapes", [ARM, FINGER])
def test_right_boxes_are_unnamed(shapes: tuple, tmp_path: Path) -> None:
    (tmp_path / "own.urdf").write_text(urdf(shapes, links(shapes)))
    robot = load_robot(tmp_path / "own.urdf")
    assert from_cad(robot) == [] and not impossible_links(robot)


PLATE = np.array([[2.36, 2.05, -1.05], [2.05, 4.03, 0.71], [-1.05, 0.71, 5.05]]) * 1e-6


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ((0, -1, -2, 3, -4, 5), "a body has it with products of the other sign"),
        ((0, 3, 5, 1, 2, 4), "in the order xx, yy, zz, xy, xz, yz"),
        ((0, 3, 5, 1, 4, 2), "in the order xx, yy, zz, xy, yz, xz"),
        ((0, 4, 2, 3, 1, 5), "a body has it with xy and yz exchanged"),
    ],
)
def test_products_that_make_a_body_are_named(order: tuple, words: str, tmp_path: Path) -> None:
    """The published hands `allegro_*_hand.urdf` have products of the other sign."""
    six = PLATE[np.triu_indices(3)]
    given = [(-1 if k < 0 else 1) * six[abs(k)] for k in order]
    I = np.zeros((3, 3))
    I[np.triu_indices(3)] = given
    I = I + np.triu(I, 1).T
    (tmp_path / "own.urdf").write_text(urdf(FINGER[:1], [(0.03, np.zeros(3), I)]))
    ((j, said),) = impossible_links(load_robot(tmp_path / "own.urdf"))
    assert j == 1 and words in said and "link 'link1' (line 4)" in said


def yaml_robot(ten: list[Array]) -> Robot:
    """A SCARA-like arm with the values of two links, about the origins of the link frames."""
    names = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
    values = {
        f"{n}{j}": float(x) for j, row in enumerate(ten, 1) for n, x in zip(names, row, strict=True)
    }
    rows = "1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0.3}, 2: {ant: 1, sigma: 0, alpha: 0, d: 0.4, theta: q2, r: 0}"
    numbers = ", ".join(f"{k}: {x!r}" for k, x in values.items())
    text = (
        f"symgen: 1\nname: own\nframes: {{{rows}}}\ngravity: [0, 0, -9.81]\nvalues: {{{numbers}}}\n"
    )
    return parse_robot(text.encode(), "own.yaml")


def ten(M: float, c: Array, I: Array, point: float = 1.0) -> Array:
    return np.array([*(I + point * at_origin(M, c))[np.triu_indices(3)], *(M * c), M])


def test_values_of_a_robot_file() -> None:
    first, second, *_ = links(ARM)
    assert from_cad(yaml_robot([ten(*first), ten(*second)])) == []
    M, c, I = second
    (said,) = from_cad(yaml_robot([ten(*first), ten(M, c, 1e6 * I)]))
    assert said.startswith("link 2 (own.yaml): ") and "probably in kg mm^2" in said
    ((j, said),) = impossible_links(yaml_robot([ten(*first), ten(M, c, I, point=0.0)]))
    assert j == 2 and said.endswith("about the centre of mass, a body has these moments")


MJCF = """<mujoco><worldbody>
<body name="upper" pos="0 0 0.1"><joint axis="0 1 0"/>
<inertial pos="0.2 0 0" mass="3" diaginertia="{} {} {}"/>
<body name="fore" pos="0.4 0 0"><joint axis="0 1 0"/>
<inertial pos="0.1 0 0.01" mass="1" diaginertia="0.002 0.01 0.011"/></body></body></worldbody></mujoco>
"""


@pytest.mark.parametrize(("factor", "words"), [(1.0, ""), (1e6, "kg mm^2"), (1e-6, "by 1e6")])
def test_bodies_of_mjcf(factor: float, words: str, tmp_path: Path) -> None:
    (tmp_path / "own.xml").write_text(MJCF.format(*(factor * x for x in (0.005, 0.04, 0.042))))
    said = " ".join(from_cad(load_robot(tmp_path / "own.xml")))
    assert bool(said) == bool(words) and words in said
    assert not said or said.startswith("body 'upper' (line 2): ")


def test_right_robots_are_unnamed() -> None:
    """Packaged robots, and published files of arms, grippers, cameras and platforms."""
    files = sorted(Path(airo_models.__file__).parent.rglob("*.urdf"))
    read = 0
    for source in [*packaged_robots(), *files]:
        try:
            robot = load_robot(source)
        except Exception as error:  # no joint moves, or a mesh is missing
            assert "joint" in str(error)
            continue
        read += 1
        assert from_cad(robot) == [], source
    assert read >= 20


@pytest.mark.parametrize("verb", ["show", "check", "excite"])
def test_each_command_tells_it_once(verb: str, tmp_path: Path) -> None:
    case, _, _ = WRONG["g mm^2, one link"]
    (tmp_path / "own.urdf").write_text(
        urdf(ARM[:2], [case[1][0], (8.0, np.ones(3) / 9, np.diag([3e8, 4e8, 5e8]))])
    )
    options = ["--poses", "12"] if verb == "excite" else []
    done = CliRunner().invoke(app, [verb, str(tmp_path / "own.urdf"), *options])
    told = " ".join(done.stderr.split())
    assert told.count("link 'link2' (line 7): by the moments") == 1, done.output
