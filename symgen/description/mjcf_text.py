"""MJCF text, reduced to what the mechanism needs before MuJoCo sees it: no file is opened, nothing
is multiplied, nothing is drawn.

Kept are compiler and option settings, defaults of joints and geoms, bodies with their joints,
inertials and those geoms whose mass matters, sites, and
the equality constraints of joints and tendons. Elements that stand for many others (replicate,
composite, flexcomp, attach, include, plugins) are refused by name;
assets, sensors, contacts, cameras and the rest are left out. Geoms of bodies that have an
<inertial>, or never move, are left out too; a mass
that only a mesh would tell is refused. Actuators are read here: the names of the joints they drive.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

from symgen.description.fields import located
from symgen.description.xml_text import XmlElement, read_elements
from symgen.errors import DescriptionError

DEEPEST, MAX_BODIES = 150, 400
ORIENTATION = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
_POSE = ("pos", *ORIENTATION)
ATTRIBUTES: dict[str, tuple[str, ...]] = {  # element: its attributes that matter
    "mujoco": ("model",),
    "compiler": ("angle", "eulerseq", "autolimits", "boundmass", "boundinertia",
                 "balanceinertia", "inertiafromgeom", "inertiagrouprange", "settotalmass"),
    "option": ("gravity",),
    "default": ("class",),
    "worldbody": (),
    "body": ("name", "childclass", "gravcomp", *_POSE),
    "frame": ("name", "childclass", *_POSE),
    "inertial": ("mass", "diaginertia", "fullinertia", *_POSE),
    "joint": ("name", "class", "type", "pos", "axis", "range", "limited", "stiffness",
              "springdamper", "springref", "ref", "armature", "damping", "frictionloss",
              "actuatorfrcrange", "actuatorfrclimited"),
    "freejoint": ("name",),
    "geom": ("name", "class", "type", "size", "fromto", "mass", "density", "shellinertia",
             "group", *_POSE),
    "site": ("name", "type", "size", "fromto", *_POSE),
    "equality": (),
    "tendon": (),
    "fixed": ("name", "stiffness", "damping", "frictionloss", "armature", "springlength"),
}  # fmt: skip
# of elements whose attributes are others where they stand
ATTRIBUTES_IN: dict[tuple[str, str], tuple[str, ...]] = {
    ("equality", "joint"): ("name", "joint1", "joint2", "polycoef", "active"),
    ("equality", "tendon"): ("name", "tendon1", "tendon2", "polycoef", "active"),
    ("fixed", "joint"): ("joint", "coef"),
    **{
        ("default", tag): tuple(key for key in ATTRIBUTES[tag] if key not in ("name", "class"))
        for tag in ("joint", "geom")
    },
}
TEXTS = ("name", "class", "childclass", "joint", "joint1", "joint2", "tendon1", "tendon2", "model")
INCLUDE = re.compile(rb"""<include\s(?:[^<>"']|"[^"<]*"|'[^'<]*')*?(?:/>|>\s*</include\s*>)""")
MULTIPLIED = (
    "replicate", "composite", "flexcomp", "flex", "attach", "include", "plugin", "extension",
)  # fmt: skip
BODIES = ("worldbody", "body", "frame")
INSIDE = {  # element: what of its content matters
    "default": ("default", "joint", "geom"),
    **dict.fromkeys(BODIES, ("body", "frame", "joint", "freejoint", "inertial", "site", "geom")),
    "equality": ("joint", "tendon"),
    "tendon": ("fixed",),
    "fixed": ("joint",),
}
SECTIONS = ("compiler", "option", "default", "worldbody", "equality", "tendon")
FLUID, NOT_ZERO = ("density", "viscosity", "wind"), set("123456789")
IGNORED = (
    "actuator",
    "asset",
    "contact",
    "custom",
    "deformable",
    "keyframe",
    "sensor",
    "size",
    "statistic",
    "visual",
)


def with_includes(content: bytes, read: Callable[[str, int], bytes]) -> bytes:
    """An MJCF file with the content of the files that it includes in their place, each on one line,
    so that lines of the file stay.

    read : gives the bytes of an included file by its name and the line that includes it, or raises
    DescriptionError.
    """
    parts, end = [], 0
    for e in (e for e in _every(read_elements(content, DEEPEST)) if e.tag == "include"):
        name, tag = e.text("file"), INCLUDE.match(content, e.byte)
        if tag is None:
            raise DescriptionError("<include> is read from UTF-8, without content", line=e.line)
        included = read(name, e.line)
        with located(name):
            inner = with_includes(included, read)
            first = next(iter(read_elements(inner, DEEPEST).children), None)
        body = b"" if first is None else inner[first.byte : inner.rindex(b"</")]
        inside = b" ".join(body.split(b"\n")) + b"\n" * tag[0].count(b"\n")
        parts += [content[end : e.byte], inside]
        end = tag.end()
    return b"".join([*parts, content[end:]])


@dataclass
class Mjcf:
    """What an MJCF file says of its mechanism.

    Attributes
    ----------
    name, text : str
        Of the model, and the reduced file.
    weightless : bool
        Whether gravity is switched off.
    from_geoms : bool
        Whether geoms tell the mass of every body that moves, of those with an <inertial> too.
    all_weighed : bool
        Whether bodies that never move have a mass that matters, by settotalmass.
    lines, bodies, joints, relations : list of int
        Line of the file of each line of the text but the first, which is empty, of each body, of
        each joint, and of each relation of joints or tendons.
    driven : frozenset of str
        Names of the joints that an actuator drives.
    notes : tuple of str
        What was left out.
    """

    name: str
    text: str = ""
    weightless: bool = False
    from_geoms: bool = False
    all_weighed: bool = False
    lines: list[int] = field(default_factory=list)
    bodies: list[int] = field(default_factory=list)
    joints: list[int] = field(default_factory=list)
    relations: list[int] = field(default_factory=list)
    driven: frozenset[str] = frozenset()
    notes: tuple[str, ...] = ()


def reduced(content: bytes) -> Mjcf:
    """The part of an MJCF file that makes its mechanism; DescriptionError, with the line, of what
    is no plain MJCF.
    """
    root = read_elements(content, DEEPEST)
    if root.tag != "mujoco":
        hint = "; a URDF is read from a file that ends in .urdf" if root.tag == "robot" else ""
        raise DescriptionError(f"found <{root.tag[:40]}>; expected <mujoco>{hint}", line=root.line)
    for e in _every(root):
        if e.tag in MULTIPLIED:
            raise DescriptionError(
                f"<{e.tag}> is not read; write out what it stands for, as MuJoCo's saved XML does",
                line=e.line,
            )
    mjcf = Mjcf(root.attributes.get("model", ""))
    compilers = [e for e in root.children if e.tag == "compiler"]
    mjcf.from_geoms = any(e.attributes.get("inertiafromgeom") == "true" for e in compilers)
    mjcf.all_weighed = any(e.number("settotalmass", "-1") > 0 for e in compilers)
    parts = [_open(root, ATTRIBUTES["mujoco"], mjcf)]
    for section in SECTIONS:
        parts += (text for e in root.own(section) for text in _copied(e, "mujoco", mjcf))
    mjcf.text = "".join([*parts, "</mujoco>"])
    options = [e for e in root.children if e.tag == "option"]
    flags = {
        key: value
        for e in options
        for x in e.children
        if x.tag == "flag"
        for key, value in x.attributes.items()
    }
    mjcf.weightless = flags.pop("gravity", "enable") == "disable"
    driven = (x for e in root.children if e.tag == "actuator" for x in e.children)
    mjcf.driven = frozenset(
        name
        for x in driven
        for key in ("joint", "jointinparent")
        if (name := x.attributes.get(key))
    )
    left = [f"<{tag}>" for tag in sorted({e.tag for e in root.children} & set(IGNORED))]
    left += [key for e in options for key in FLUID if set(e.attributes.get(key, "")) & NOT_ZERO]
    tendons = (x for e in root.children if e.tag == "tendon" for x in e.children)
    left += [f"<{tag[:30]}>" for tag in sorted({x.tag for x in tendons} - {"fixed"})]
    left += [f"flag {key[:30]}" for key, value in sorted(flags.items()) if value != "enable"]
    mjcf.notes = (f"not read: {', '.join(left)}",) if left else ()
    if unknown := sorted({e.tag for e in root.children} - set(SECTIONS) - set(IGNORED)):
        raise DescriptionError(f"<{unknown[0][:40]}> is no part of an MJCF file", line=root.line)
    return mjcf


def _every(e: XmlElement) -> Iterator[XmlElement]:
    yield e
    for child in e.children:
        yield from _every(child)


def _open(e: XmlElement, attributes: Iterable[str], mjcf: Mjcf, end: str = "") -> str:
    """The start of an element, on a line of its own."""
    mjcf.lines.append(e.line)
    own = {key: e.attributes[key] for key in attributes if key in e.attributes}
    for key, value in own.items():
        if key not in TEXTS and any(
            word.strip("+-")[:3].lower() in ("nan", "inf") for word in value.split()
        ):
            raise DescriptionError(
                f"<{e.tag} {key}={value[:60]!r}>: expected finite numbers", line=e.line
            )
    return f"\n<{e.tag}{''.join(f' {key}={quoteattr(value)}' for key, value in own.items())}{end}>"


def _copied(
    e: XmlElement, holder: str, mjcf: Mjcf, *, moves: bool = False, weighed: bool = False
) -> Iterator[str]:
    """Text of an element in a `holder`, with what of its content matters; `moves`: it belongs to a
    body that does, `weighed`: geoms tell the mass of its body.
    """
    if e.tag == "body":
        mjcf.bodies.append(e.line)
        if len(mjcf.bodies) > MAX_BODIES:
            raise DescriptionError(f"more than {MAX_BODIES} bodies", line=e.line)
        tags = {child.tag for child in e.own("joint", "freejoint", "inertial")}
        moves = moves or bool(tags - {"inertial"})
        mass_matters = moves or mjcf.all_weighed
        weighed = mass_matters and (mjcf.from_geoms or "inertial" not in tags)
    own = ATTRIBUTES_IN.get((holder, e.tag), ATTRIBUTES[e.tag])
    if e.tag not in INSIDE:
        yield _open(e, own, mjcf, end="/")
        return
    yield _open(e, own, mjcf)
    for child in e.children:
        if _matters(child, e.tag, weighed=weighed):
            if e.tag in BODIES and child.tag in ("joint", "freejoint"):
                mjcf.joints.append(child.line)
            if e.tag == "equality":
                mjcf.relations.append(child.line)
            yield from _copied(child, e.tag, mjcf, moves=moves, weighed=weighed)
    yield f"</{e.tag}>"


def _matters(child: XmlElement, holder: str, *, weighed: bool) -> bool:
    """Whether an element in a `holder` says something of the mechanism; DescriptionError where it
    does, and is not read.
    """
    if holder == "equality" and child.attributes.get("active") == "false":
        return False
    if holder == "equality" and child.tag not in INSIDE[holder]:
        name = child.attributes.get("name", "")
        raise DescriptionError(
            f"<{child.tag[:30]}> {name[:40]!r} in <equality>: joint and tendon relations are "
            "read, closed loops and ties between bodies not; "
            "describe the loop by cut and twin in a robot file",
            line=child.line,
        )
    if holder in BODIES and child.tag == "geom":
        if weighed and any(key in child.attributes for key in ("mesh", "hfield")):
            raise DescriptionError(
                "the mass of this body would come from a mesh, which is not read; add <inertial>",
                line=child.line,
            )
        return weighed
    return child.tag in INSIDE[holder]
