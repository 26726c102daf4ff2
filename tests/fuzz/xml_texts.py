"""Cases of XML formats, aware of their structure: URDF and MJCF with nasty attributes, elements,
document types, encodings and depth.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from xml.etree import ElementTree

LAUGHS = "".join(f'<!ENTITY a{k} "{10 * f"&a{k - 1};"}">' for k in range(1, 10))
DOCTYPES = (
    f'<!DOCTYPE robot [<!ENTITY a0 "aaaaaaaaaa">{LAUGHS}]>',
    '<!DOCTYPE robot SYSTEM "file:///etc/passwd">',
    '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///dev/zero">]>',
    '<!DOCTYPE robot [<!ENTITY % p SYSTEM "http://localhost/x.dtd"> %p;]>',
    '<!DOCTYPE robot [<!ATTLIST link name CDATA "x">]>',
    "<?xml-stylesheet href='x'?>",
    "<![CDATA[x]]>",
    "<!-- -- -->",
    "&lt;&#0;&#x110000;&x;",
)  # fmt: skip
NUMBERS = (
    "0",
    "-0",
    "1e9",
    "1e10",
    "1e308",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "1e-300",
    "0x1p3",
    "1_0",
    "",
    "1 2",
    "1 2 3 4",
    "1 0 0",
    "0 0 0",
    "1e-7 0 1",
    "3.14159 1.5708 0",
    "1e9 1e9 1e9",
    "1e-320 0 0",
    "٣",
    "9" * 400,
    "abc",
    "1,5",
    "-1",
)


@dataclass(frozen=True)
class Dialect:
    """Names of elements, values of attributes beside numbers and names, and elements that may be
    put anywhere: tag, attributes; `@` is a name, `#` a number.
    """

    tags: tuple[str, ...]
    values: tuple[str, ...]
    grown: tuple[tuple[str, dict[str, str]], ...]


STRANGE = (
    "",
    "class",
    "../x",
    "a" * 3000,
    "é",
    "\u202e",
    "x\ty",
    "{{7*7}}",
    '"><script>',
    "package://../x.dae",
)
URDF = Dialect(
    ("robot", "link", "joint", "inertial", "mimic", "xacro:macro", "origin", "x", "axis"),
    (*STRANGE, "revolute", "continuous", "fixed", "floating", "prismatic"),
    (("mimic", {"joint": "@", "multiplier": "#", "offset": "#"}),),
)
MJCF = Dialect(
    ("mujoco", "compiler", "option", "default", "worldbody", "body", "frame", "joint", "geom", "site", "equality", "tendon", "include", "replicate", "x"),
    (*STRANGE, *("true", "false", "auto", "degree", "radian", "xyz", "zZy", "hinge", "slide", "ball", "free", "mesh", "box", "capsule", "ellipsoid", "plane", "sdf")),
    (
        ("joint", {"joint1": "@", "joint2": "@", "polycoef": "# # 0 0 0"}),
        ("joint", {"name": "@", "type": "slide", "axis": "# # #", "ref": "#", "range": "# #"}),
        ("joint", {"armature": "#", "damping": "#", "stiffness": "#", "springref": "#", "frictionloss": "#"}),
        ("freejoint", {}),
        ("geom", {"type": "box", "size": "# # #", "mass": "#", "density": "#", "fromto": "# # # # # #"}),
        ("geom", {"type": "mesh", "mesh": "@"}),
        ("inertial", {"pos": "# # #", "mass": "#", "diaginertia": "# # #"}),
        ("inertial", {"pos": "0 0 0", "mass": "1", "fullinertia": "# # # # # #"}),
        ("body", {"name": "@", "pos": "# # #", "euler": "# # #", "quat": "# # # #"}),
        ("compiler", {"boundmass": "#", "boundinertia": "#", "balanceinertia": "true", "inertiafromgeom": "true", "eulerseq": "@"}),
        ("option", {"gravity": "# # #"}),
        ("fixed", {"name": "@", "stiffness": "#"}),
        ("include", {"file": "/etc/passwd"}),
        ("replicate", {"count": "1000000000", "euler": "0 0 1"}),
        ("flag", {"gravity": "disable"}),
    ),
)  # fmt: skip


def changed(content: bytes, rng: random.Random, dialect: Dialect) -> bytes:
    """XML with attributes and elements changed; sometimes a document type, another encoding, much
    nesting.
    """
    root = ElementTree.fromstring(content)
    for _ in range(rng.choice((1, 1, 2, 3, 6))):
        elements = list(root.iter())
        e, other = rng.choice(elements), rng.choice(elements)
        names = [
            str(value)
            for x in elements
            for key in ("name", "link", "joint", "joint1", "tendon1", "class")
            if (value := x.get(key))
        ] or ["x"]
        match rng.randrange(8):
            case 0 | 1 | 2 if e.attrib:
                key = rng.choice(sorted(e.attrib))
                numbers = " ".join(
                    rng.choice(NUMBERS) if rng.random() < 0.3 else word
                    for word in str(e.get(key)).split()
                )
                e.set(
                    key,
                    rng.choice(
                        (
                            rng.choice(NUMBERS),
                            rng.choice(names),
                            rng.choice(dialect.values),
                            numbers,
                        )
                    ),
                )
            case 3 if e.attrib:
                del e.attrib[rng.choice(sorted(e.attrib))]
            case 4 if not any(x is e for x in other.iter()) and len(elements) < 500:
                e.append(other)
            case 5 if len(e):
                e.remove(rng.choice(list(e)))
            case 6:
                e.tag = rng.choice(dialect.tags)
            case 7:
                tag, attributes = rng.choice(dialect.grown)
                new = ElementTree.SubElement(e, tag)
                for key, value in attributes.items():
                    words = [
                        rng.choice(names)
                        if w == "@"
                        else rng.choice((*NUMBERS, "1", "0.5"))
                        if w == "#"
                        else w
                        for w in value.split()
                    ]
                    new.set(key, " ".join(words))
    text = ElementTree.tostring(root, encoding="unicode")
    if rng.random() < 0.1:
        text = rng.choice(DOCTYPES) + text
    if rng.random() < 0.05:
        depth, at = rng.choice((10, 40, 20000)), text.index(">") + 1
        text = text[:at] + "<a>" * depth + "</a>" * rng.choice((depth, 0)) + text[at:]
    encoding = rng.choice(("utf-8",) * 12 + ("utf-16", "latin-1", "utf-7"))
    name = rng.choice(
        (
            "utf-8",
            "utf-16",
            "latin-1",
            "x-none",
            "ascii",
            "utf-7",
            "shift_jis",
            "idna",
            "rot13",
            "zlib",
        )
    )
    declared = f'<?xml version="1.0" encoding="{name}"?>' if rng.random() < 0.15 else ""
    return (declared + text).encode(encoding, "replace")
