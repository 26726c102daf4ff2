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

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

from symgen.description.xml_text import XmlElement, read_elements
from symgen.errors import DescriptionError

DEEPEST, MAX_BODIES = 150, 400
ORIENTATION = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
_POSE = ("pos", *ORIENTATION)
ATTRIBUTES: dict[str, tuple[str, ...]] = {  # element: its attributes that matter
    "mujoco": ("model",),
    "compiler": ("angle", "eulerseq", "autolimits", "boundmass", "boundinertia",
                 "balanceinertia", "inertiafromgeom", "inertiagrouprange"),
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
}  # fmt: skip
RELATIONS: dict[str, tuple[str, ...]] = {
    "joint": ("name", "joint1", "joint2", "polycoef", "active"),
    "tendon": ("name", "tendon1", "tendon2", "polycoef", "active"),
}
TEXTS = ("name", "class", "childclass", "joint", "joint1", "joint2", "tendon1", "tendon2", "model")
FIXED_TENDON = ("name", "stiffness", "damping", "frictionloss", "armature", "springlength")
MULTIPLIED = (
    "replicate", "composite", "flexcomp", "flex", "attach", "include", "plugin", "extension",
)  # fmt: skip
SECTIONS = ("compiler", "option", "default", "worldbody", "equality", "tendon")
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


@dataclass
class Mjcf:
    """What an MJCF file says of its mechanism.

    Attributes
    ----------
    name, text : str
        Of the model, and the reduced file.
    weightless : bool
        Whether gravity is switched off.
    joints : list of int
        Line of each joint, in the order of the file.
    bodies : int
        Their number.
    driven : frozenset of str
        Names of the joints that an actuator drives.
    notes : tuple of str
        What was left out.
    """

    name: str
    text: str = ""
    weightless: bool = False
    joints: list[int] = field(default_factory=list)
    bodies: int = 0
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
    for e in (e for e in root.children if e.tag == "compiler"):
        if e.number("settotalmass", "-1") > 0:
            raise DescriptionError(
                "settotalmass is not read; write the masses out, as MuJoCo's saved XML does",
                line=e.line,
            )
    mjcf = Mjcf(root.attributes.get("model", ""))
    always = any(
        e.attributes.get("inertiafromgeom") == "true" for e in root.children if e.tag == "compiler"
    )
    parts = [_open(root, ATTRIBUTES["mujoco"])]
    for e in (e for section in SECTIONS for e in root.children if e.tag == section):
        if e.tag == "worldbody":
            parts += [
                "<worldbody>",
                *_inside(e, mjcf, moves=False, weighed=False, always=always),
                "</worldbody>",
            ]
        elif e.tag == "equality":
            parts += ["<equality>", *_relations(e), "</equality>"]
        elif e.tag == "tendon":
            parts += ["<tendon>", *_tendons(e), "</tendon>"]
        elif e.tag == "default":
            parts += _default(e)
        else:
            parts.append(_open(e, ATTRIBUTES[e.tag], end="/"))
    mjcf.text = "".join([*parts, "</mujoco>"])
    flags = {
        key: value
        for e in root.children
        if e.tag == "option"
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
    left += [f"flag {key[:30]}" for key, value in sorted(flags.items()) if value != "enable"]
    mjcf.notes = (f"not read: {', '.join(left)}",) if left else ()
    if unknown := sorted({e.tag for e in root.children} - set(SECTIONS) - set(IGNORED)):
        raise DescriptionError(f"<{unknown[0][:40]}> is no part of an MJCF file", line=root.line)
    return mjcf


def _every(e: XmlElement) -> Iterator[XmlElement]:
    yield e
    for child in e.children:
        yield from _every(child)


def _open(e: XmlElement, attributes: Iterable[str], end: str = "") -> str:
    own = {key: e.attributes[key] for key in attributes if key in e.attributes}
    for key, value in own.items():
        if key not in TEXTS and any(
            word.strip("+-")[:3].lower() in ("nan", "inf") for word in value.split()
        ):
            raise DescriptionError(
                f"<{e.tag} {key}={value[:60]!r}>: expected finite numbers", line=e.line
            )
    return f"<{e.tag}{''.join(f' {key}={quoteattr(value)}' for key, value in own.items())}{end}>"


def _default(e: XmlElement) -> list[str]:
    parts = [_open(e, ATTRIBUTES["default"])]
    for child in e.children:
        if child.tag == "default":
            parts += _default(child)
        elif child.tag in ("joint", "geom"):
            parts.append(
                _open(
                    child,
                    [key for key in ATTRIBUTES[child.tag] if key not in ("name", "class")],
                    end="/",
                )
            )
    return [*parts, "</default>"]


def _inside(e: XmlElement, mjcf: Mjcf, *, moves: bool, weighed: bool, always: bool) -> list[str]:
    """What stands in a body, a frame or the world; `weighed`: its geoms tell its mass, `always`:
    those of every body that moves.
    """
    parts: list[str] = []
    for child in e.children:
        if child.tag == "body":
            parts += _body(child, mjcf, moves=moves, always=always)
        elif child.tag == "frame":
            parts += [
                _open(child, ATTRIBUTES["frame"]),
                *_inside(child, mjcf, moves=moves, weighed=weighed, always=always),
                "</frame>",
            ]
        elif child.tag in ("joint", "freejoint"):
            mjcf.joints.append(child.line)
            parts.append(_open(child, ATTRIBUTES[child.tag], end="/"))
        elif child.tag in ("inertial", "site") or (child.tag == "geom" and weighed):
            if child.tag == "geom" and any(key in child.attributes for key in ("mesh", "hfield")):
                raise DescriptionError(
                    (
                        "the mass of this body would come from a mesh, which is not read; add "
                        "<inertial>"
                    ),
                    line=child.line,
                )
            parts.append(_open(child, ATTRIBUTES[child.tag], end="/"))
    return parts


def _body(e: XmlElement, mjcf: Mjcf, *, moves: bool, always: bool) -> list[str]:
    mjcf.bodies += 1
    if mjcf.bodies > MAX_BODIES:
        raise DescriptionError(f"more than {MAX_BODIES} bodies", line=e.line)
    tags = {child.tag for child in e.own("joint", "freejoint", "inertial")}
    moves = moves or bool(tags - {"inertial"})
    inside = _inside(
        e, mjcf, moves=moves, weighed=moves and (always or "inertial" not in tags), always=always
    )
    return [_open(e, ATTRIBUTES["body"]), *inside, "</body>"]


def _relations(e: XmlElement) -> list[str]:
    parts = []
    for child in e.children:
        if child.attributes.get("active") == "false":
            continue
        if child.tag not in RELATIONS:
            name = child.attributes.get("name", "")
            raise DescriptionError(
                f"<{child.tag[:30]}> {name[:40]!r} in <equality>: joint and tendon relations are "
                "read, closed loops and ties between bodies not; "
                "describe the loop by cut and twin in a robot file",
                line=child.line,
            )
        parts.append(_open(child, RELATIONS[child.tag], end="/"))
    return parts


def _tendons(e: XmlElement) -> list[str]:
    """Fixed tendons: sums of joint positions, which relations may tie."""
    parts = []
    for child in (child for child in e.children if child.tag == "fixed"):
        parts += [
            _open(child, FIXED_TENDON),
            *(_open(x, ("joint", "coef"), end="/") for x in child.children if x.tag == "joint"),
            "</fixed>",
        ]
    return parts
