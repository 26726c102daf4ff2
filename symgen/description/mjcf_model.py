"""Compilation of an MJCF file by MuJoCo's `MjSpec`, with only the parts that the mechanism needs.

MuJoCo opens no other file. Assets, sensors, contacts, cameras and similar elements are left out. A
geom that is a mesh becomes a geom without mass if its body has an <inertial> or never moves; a mass
that only a mesh would give is refused. Elements that stand for many others (replicate, composite,
flexcomp, attach, plugins) are refused too. Of actuators, only the names of the driven joints are
read.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any
from xml.etree import ElementTree

import numpy as np

from symgen.description.fields import located
from symgen.description.xml_text import XmlElement, read_elements
from symgen.errors import DescriptionError

DEEPEST, MAX_BODIES = 150, 400
ORIENTATION = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
INCLUDE = re.compile(rb"""<include\s(?:[^<>"']|"[^"<]*"|'[^'<]*')*?(?:/>|>\s*</include\s*>)""")
MULTIPLIED = (
    "replicate", "composite", "flexcomp", "flex", "attach", "include", "plugin", "extension",
)  # fmt: skip
SECTIONS = ("compiler", "option", "default", "worldbody", "equality", "tendon")
IGNORED = (
    "actuator", "asset", "contact", "custom", "deformable", "keyframe", "sensor", "size",
    "statistic", "visual",
)  # fmt: skip
DRAWN = ("light", "camera")  # of bodies, without effect on the mechanism
RELATIONS = ("joint", "tendon")
FLUID = ("density", "viscosity", "wind")
TEXTS = re.compile(r"\w*(name|class|joint\d?|tendon\d?|body\d?|model|mesh|material|file)\w*")


@dataclass(frozen=True)
class Mjcf:
    """The mechanism of an MJCF file: the compiled model, and the line numbers of bodies and joints.

    Attributes
    ----------
    name : str
        Name of the model.
    model : MjModel
        The model that MuJoCo compiled.
    weightless : bool
        Whether gravity is switched off.
    bodies, joints, relations : list of int
        Line in the file of each body, joint, and relation of joints or tendons, in the order of
        `model`.
    driven : frozenset of str
        Names of the joints that an actuator drives.
    notes : tuple of str
        What was left out.
    """

    name: str
    model: Any
    weightless: bool
    bodies: list[int]
    joints: list[int]
    relations: list[int]
    driven: frozenset[str]
    notes: tuple[str, ...]


def with_includes(content: bytes, read: Callable[[str, int], bytes]) -> bytes:
    """Replace each <include> in an MJCF file by the content of the included file.

    The content is written on one line, so that the line numbers of the file stay. `read` returns
    the bytes of an included file, from its name and the line that includes it, or raises
    DescriptionError.
    """
    parts, end = [], 0
    for e in read_elements(content, DEEPEST).iter("include"):
        name, tag = e.word("file"), INCLUDE.match(content, e.byte)
        if tag is None:
            raise DescriptionError(
                "<include> must have no content, in a file saved as UTF-8; write <include file=.../>",
                line=e.line,
            )
        included = read(name, e.line)
        with located(name):
            inner = with_includes(included, read)
            first = next(iter(read_elements(inner, DEEPEST)), None)
        body = b"" if first is None else inner[first.byte : inner.rindex(b"</")]
        inside = b" ".join(body.split(b"\n")) + b"\n" * tag[0].count(b"\n")
        parts += [content[end : e.byte], inside]
        end = tag.end()
    return b"".join([*parts, content[end:]])


def compiled(content: bytes) -> Mjcf:
    """Compile the content of an MJCF file with MuJoCo, and return its mechanism.

    Raises DescriptionError, with the line, if the file is invalid or has elements that are not
    supported.
    """
    root = read_elements(content, DEEPEST)
    _refuse(root)
    notes = [f"<{tag}>" for tag in sorted({e.tag for e in root} & {*IGNORED})]
    actuators = [e for section in root.own("actuator") for e in section]
    driven = {e.attrib.get(key) for e in actuators for key in ("joint", "jointinparent")}
    tendons = {e.tag for section in root.own("tendon") for e in section}
    flags = {
        key: value
        for option in root.own("option")
        for flag in option.own("flag")
        for key, value in flag.attrib.items()
    }
    weightless = flags.pop("gravity", "enable") == "disable"
    bodies = [e for world in root.own("worldbody") for e in world.iter("body")]
    _take_out(root)
    from_geoms = any(e.attrib.get("inertiafromgeom") == "true" for e in root.own("compiler"))
    weighed = any(e.number("settotalmass", "-1") > 0 for e in root.own("compiler"))
    spec, lines = _spec(root)
    for body in spec.worldbody.bodies:
        _take_out_meshes(body, lines, moves=False, from_geoms=from_geoms, all_weighed=weighed)
    for geom in spec.worldbody.geoms:
        _no_mesh(geom)
    for drawn in (*spec.geoms, *spec.sites):
        drawn.material = ""
    model = _errors_with_lines(spec.compile, lines)
    notes += [key for key in FLUID if np.any(getattr(model.opt, key))]
    notes += [f"<{tag[:30]}>" for tag in sorted(tendons - {"fixed"})]
    notes += [f"flag {key[:30]}" for key, value in sorted(flags.items()) if value != "enable"]
    return Mjcf(
        root.attrib.get("model", ""),
        model,
        weightless,
        [e.line for e in bodies],
        [x.line for e in bodies for x in e.own("joint", "freejoint")],
        [x.line for section in root.own("equality") for x in section],
        frozenset(filter(None, driven)),
        (f"not read: {', '.join(notes)}",) if notes else (),
    )


def _refuse(root: XmlElement) -> None:
    """Raise DescriptionError if the file is no MJCF, or has elements that are not supported."""
    if root.tag != "mujoco":
        hint = "; the name of a URDF file must end in .urdf" if root.tag == "robot" else ""
        raise DescriptionError(f"found <{root.tag[:40]}>; expected <mujoco>{hint}", line=root.line)
    for e in root.iter():
        if e.tag in MULTIPLIED:
            raise DescriptionError(
                f"<{e.tag}> is not read; write out the elements that it generates, as MuJoCo does when it saves the XML",
                line=e.line,
            )
        for key, value in e.attrib.items():
            if not TEXTS.fullmatch(key) and not all(map(_is_finite, value.split())):
                raise DescriptionError(
                    f"<{e.tag} {key}={value[:60]!r}>: expected finite numbers", line=e.line
                )
    if unknown := sorted({e.tag for e in root} - {*SECTIONS, *IGNORED}):
        raise DescriptionError(
            f"<{unknown[0][:40]}> is no element of MJCF; remove this element or correct its name",
            line=root.line,
        )
    for k, e in enumerate(e for world in root.own("worldbody") for e in world.iter("body")):
        if k >= MAX_BODIES:
            raise DescriptionError(f"the file has more than {MAX_BODIES} bodies", line=e.line)
    for e in (e for section in root.own("equality") for e in section):
        if e.tag not in RELATIONS and e.attrib.get("active") != "false":
            name = e.attrib.get("name", "")
            raise DescriptionError(
                f"<{e.tag[:30]}> {name[:40]!r} in <equality>: only joint and tendon relations are supported, not closed loops and ties between bodies; "
                "describe the loop by cut and twin in a robot file",
                line=e.line,
            )


def _is_finite(word: str) -> bool:
    """Whether a word in an MJCF file is a finite number, or no number at all."""
    try:
        return isfinite(float(word))
    except ValueError:
        return True


def _take_out(holder: XmlElement) -> None:
    """Remove all elements inside an XML element that the mechanism does not need (cameras ...)."""
    for e in list(holder):
        if _is_left_out(holder, e):
            holder.remove(e)
        else:
            _take_out(e)


def _is_left_out(holder: XmlElement, e: XmlElement) -> bool:
    match holder.tag:
        case "mujoco":
            return e.tag in IGNORED
        case "equality":
            return e.attrib.get("active") == "false"
        case "tendon":
            return e.tag != "fixed"
        case "worldbody" | "body" | "frame":
            return e.tag in DRAWN
    return False


def _spec(root: XmlElement) -> tuple[Any, list[int]]:
    """Build MuJoCo's MjSpec from XML elements; return the MjSpec, and a list of line numbers of the
    file.

    The list has, for each line of the text that MuJoCo reads, the number of the line in the
    original file.
    """
    try:
        import mujoco
    except ImportError as error:
        raise DescriptionError(
            "MuJoCo is needed to read MJCF files; install it: pip install symgen[mjcf]"
        ) from error
    ElementTree.indent(root, "")  # each tag on a line of its own
    text = ElementTree.tostring(root, "unicode")
    elements = root.iter()
    lines: list[int] = []
    for line in text.splitlines():
        lines.append(lines[-1] if line.startswith("</") else next(elements).line)
    return _errors_with_lines(lambda: mujoco.MjSpec.from_string(text), lines), lines


def _errors_with_lines(act: Callable[[], Any], lines: Sequence[int]) -> Any:
    """Call the MuJoCo function `act`; convert its errors to errors with the line of the file.

    MuJoCo's warnings on the simulation are dropped.
    """
    import mujoco

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return act()
    except ValueError as error:
        message = " ".join(str(error).split())
        number = re.search(r",? line (\d+)\Z", message)
        message = message[: number.start()] if number else message
        raise DescriptionError(
            "MuJoCo refuses the file: "
            f"{message.removeprefix('XML Error: ').removeprefix('Error: ')[:300]}",
            line=lines[int(number[1]) - 1] if number else None,
        ) from error
    finally:
        mujoco.set_mju_user_warning(before)


def _take_out_meshes(
    body: Any, lines: Sequence[int], *, moves: bool, from_geoms: bool, all_weighed: bool
) -> None:
    """Replace the meshes of a body and of its child bodies by geoms without mass.

    Raises DescriptionError if the mass of a moving body depends on a mesh.
    """
    moves = moves or bool(body.joints)
    weighed = (moves or all_weighed) and (from_geoms or not body.explicitinertial)
    for geom in body.geoms:
        if _no_mesh(geom) and weighed:
            number = re.search(r"line (\d+)", geom.info)
            raise DescriptionError(
                "the mass of this body would come from a mesh, and meshes are not read; add <inertial> to the body",
                line=lines[int(number[1]) - 1] if number else None,
            )
    for child in body.bodies:
        _take_out_meshes(child, lines, moves=moves, from_geoms=from_geoms, all_weighed=all_weighed)


def _no_mesh(geom: Any) -> bool:
    """Replace a geom that is a mesh by a massless sphere; return whether it was a mesh."""
    import mujoco

    is_mesh = bool(geom.meshname or geom.hfieldname)
    if is_mesh:
        geom.meshname = geom.hfieldname = ""
        geom.type, geom.size, geom.mass = mujoco.mjtGeom.mjGEOM_SPHERE, (1.0, 1.0, 1.0), 0.0
    return is_mesh
