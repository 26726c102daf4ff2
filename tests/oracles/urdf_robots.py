"""URDF texts written here from published tables of five makers, and random trees with arbitrary
axes.

Lengths, masses and centres of mass as published (sources beside each); where a maker publishes no
inertia, that of a solid box of the size given takes its place. Joints stand as a URDF author would
place them: z, y and x axes, fixed tools, oblique mounts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]


def box(M: float, x: float, y: float, z: float) -> tuple[float, ...]:
    """ixx ixy ixz iyy iyz izz of a solid box about its centre."""
    return (
        M * (y * y + z * z) / 12,
        0.0,
        0.0,
        M * (x * x + z * z) / 12,
        0.0,
        M * (x * x + y * y) / 12,
    )


def link(
    name: str,
    M: float = 0.0,
    com: str = "0 0 0",
    inertia: tuple[float, ...] | None = None,
    rpy: str = "0 0 0",
) -> str:
    if not M:
        return f'<link name="{name}"/>'
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    tensor = " ".join(
        f'{k}="{x!r}"' for k, x in zip(keys, inertia or box(M, 0.1, 0.12, 0.2), strict=True)
    )
    return (
        f'<link name="{name}"><inertial><origin xyz="{com}" rpy="{rpy}"/><mass '
        f'value="{M}"/><inertia {tensor}/></inertial></link>'
    )


def joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    xyz: str,
    rpy: str = "0 0 0",
    axis: str = "0 0 1",
    more: str = "",
) -> str:
    limit = "" if kind == "fixed" else '<limit lower="-2.9" upper="2.9" velocity="3" effort="100"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child '
        f'link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/>'
        f'<axis xyz="{axis}"/>{limit}{more}</joint>'
    )


def robot(name: str, *parts: str) -> str:
    return "\n".join(['<?xml version="1.0"?>', f'<robot name="{name}">', *parts, "</robot>"])


H = repr(np.pi / 2)


def ur5() -> str:
    """Universal Robots UR5: lengths, masses, centres of mass of the maker's table of DH parameters
    for dynamics.
    """
    rows = [  # parent, xyz, rpy, axis, mass, centre of mass
        ("base", "0 0 0.089159", "0 0 0", "0 0 1", 3.7, "0 -0.02561 0.00193"),
        ("l1", "0 0.13585 0", f"0 {H} 0", "0 1 0", 8.393, "0 0 0.28"),
        ("l2", "0 -0.1197 0.425", "0 0 0", "0 1 0", 2.33, "0 0 0.25"),
        ("l3", "0 0 0.39225", f"0 {H} 0", "0 1 0", 1.219, "0 0.0018 0.01634"),
        ("l4", "0 0.093 0", "0 0 0", "0 0 1", 1.219, "0 -0.0018 0.01634"),
        ("l5", "0 0 0.09465", "0 0 0", "0 1 0", 0.1879, "0 0.0823 -0.001159"),
    ]
    parts = [link("base", 4.0)]
    for k, (parent, xyz, rpy, axis, M, com) in enumerate(rows, start=1):
        parts += [
            joint(f"j{k}", "revolute", parent, f"l{k}", xyz, rpy, axis),
            link(f"l{k}", M, com),
        ]
    return robot(
        "ur5",
        *parts,
        joint("flange", "fixed", "l6", "tool0", "0 0.0823 0", f"0 0 {H}"),
        link("tool0"),
    )


def panda() -> str:
    """Franka Emika Panda: the maker's table after Craig; masses, centres of mass and inertias of
    Gaz et al., RA-L 4(4), 2019 (rounded).
    """
    rows = [  # alpha, a, d, mass, centre of mass, inertia
        (
            0,
            0,
            0.333,
            4.970684,
            "0.003875 0.002081 -0.04762",
            (0.70337, -0.000139, 0.006772, 0.70661, 0.019169, 0.009117),
        ),
        (
            -1,
            0,
            0,
            0.646926,
            "-0.003141 -0.02872 0.003495",
            (0.007962, -0.003925, 0.010254, 0.02811, 0.000704, 0.025995),
        ),
        (
            1,
            0,
            0.316,
            3.228604,
            "0.027518 0.039252 -0.066502",
            (0.037242, -0.004761, -0.011396, 0.036155, -0.012805, 0.01083),
        ),
        (
            1,
            0.0825,
            0,
            3.587895,
            "-0.05317 0.104419 0.027454",
            (0.025853, 0.007796, -0.001332, 0.019552, 0.008641, 0.028323),
        ),
        (
            -1,
            -0.0825,
            0.384,
            1.225946,
            "-0.011953 0.041065 -0.038437",
            (0.035549, -0.002117, -0.004037, 0.029474, 0.000229, 0.008627),
        ),
        (
            1,
            0,
            0,
            1.666555,
            "0.060149 -0.014117 -0.010517",
            (0.001964, 0.000109, -0.001158, 0.004354, 0.000341, 0.005433),
        ),
        (
            1,
            0.088,
            0,
            0.735522,
            "0.010517 -0.004252 0.061597",
            (0.012516, -0.000428, -0.001196, 0.010027, -0.000741, 0.004815),
        ),
    ]
    parts = [link("panda_link0", 0.629769)]
    for k, (alpha, a, d, M, com, inertia) in enumerate(rows, start=1):
        xyz = f"{a} {-alpha * d if alpha else 0} {0 if alpha else d}"
        parts += [
            joint(
                f"panda_joint{k}",
                "revolute",
                f"panda_link{k - 1}",
                f"panda_link{k}",
                xyz,
                f"{alpha * np.pi / 2!r} 0 0",
            ),
            link(f"panda_link{k}", M, com, inertia),
        ]
    hand = [
        joint("hand", "fixed", "panda_link7", "hand", "0 0 0.107", f"0 0 {-np.pi / 4!r}"),
        link("hand", 0.73, "-0.01 0 0.03"),
    ]
    left = joint("finger1", "prismatic", "hand", "left", "0 0 0.0584", axis="0 1 0")
    right = joint(
        "finger2",
        "prismatic",
        "hand",
        "right",
        "0 0 0.0584",
        axis="0 -1 0",
        more='<mimic joint="finger1"/>',
    )
    return robot(
        "panda",
        *parts,
        *hand,
        left,
        link("left", 0.015, "0 0 0.02"),
        right,
        link("right", 0.015, "0 0 0.02"),
    )


def irb120() -> str:
    """ABB IRB 120: lengths 290, 270, 70, 302, 72 mm of its manual; masses share its 25 kg."""
    rows = [
        ("0 0 0.29", "0 0 1", 6.2, "0 0 -0.05"),
        ("0 0 0", "0 1 0", 5.6, "0.001 -0.001 0.11"),
        ("0 0 0.27", "0 1 0", 4.2, "0.02 -0.008 0.05"),
        ("0.134 0 0.07", "1 0 0", 2.4, "-0.02 0 0"),
        ("0.168 0 0", "0 1 0", 1.3, "0 0.001 0"),
        ("0.072 0 0", "1 0 0", 0.3, "-0.01 0 0"),
    ]
    parts = [link("base_link", 5)]
    for k, (xyz, axis, M, com) in enumerate(rows, start=1):
        parent = f"link_{k - 1}" if k > 1 else "base_link"
        friction = f'<dynamics damping="0.{k}" friction="1.{k}"/>'
        parts += [
            joint(f"joint_{k}", "revolute", parent, f"link_{k}", xyz, axis=axis, more=friction),
            link(f"link_{k}", M, com),
        ]
    return robot("abb_irb120_3_58", *parts)


def puma560() -> str:
    """Unimation PUMA 560: lengths, masses, centres of mass and inertias of Armstrong, Khatib and
    Burdick, ICRA 1986; base on a slope.
    """
    rows = [  # alpha / (pi/2), a, d, mass, centre of mass, principal inertia
        (0, 0, 0, 0.0, "0 0 0", (0.0, 0.0, 0.35)),
        (-1, 0, 0.2435, 17.40, "0.068 0.006 -0.016", (0.13, 0.524, 0.539)),
        (0, 0.4318, -0.0934, 4.80, "0 -0.070 0.014", (0.066, 0.0125, 0.086)),
        (1, -0.0203, 0.4331, 0.82, "0 0 -0.019", (0.0018, 0.0018, 0.0013)),
        (-1, 0, 0, 0.34, "0 0 0.001", (0.0003, 0.0003, 0.0004)),
        (1, 0, 0, 0.09, "0 0 0.032", (0.00015, 0.00015, 0.00004)),
    ]
    parts = [
        link("world"),
        joint("mount", "fixed", "world", "b0", "0.1 0.2 0.3", "0.2 -0.3 0.4"),
        link("b0", 13.0),
    ]
    for k, (alpha, a, d, M, com, (xx, yy, zz)) in enumerate(rows, start=1):
        xyz = f"{a} {-alpha * d if alpha else 0} {0 if alpha else d}"
        parts.append(
            joint(
                f"waist{k}", "continuous", f"b{k - 1}", f"b{k}", xyz, f"{alpha * np.pi / 2!r} 0 0"
            )
        )
        parts.append(link(f"b{k}", M or 1e-9, com, (xx, 0.0, 0.0, yy, 0.0, zz)))
    return robot("puma560", *parts)


def scara() -> str:
    """Epson G6 SCARA: arms 300 and 350 mm, stroke 180 mm of the maker's manual; masses share its
    arm; the quill hangs head down.
    """
    parts = [
        link("base_link"),
        joint("j1", "revolute", "base_link", "arm1", "0 0 0.22"),
        link("arm1", 6.5, "0.14 0 0.03"),
        joint("j2", "revolute", "arm1", "arm2", "0.3 0 0.06"),
        link("arm2", 8.0, "0.17 0 0.08", rpy="0.1 0.2 0.3"),
        joint("j3", "prismatic", "arm2", "shaft", "0.35 0 0", f"{np.pi!r} 0 0"),
        link("shaft", 0.9, "0 0 -0.05"),
        joint("j4", "revolute", "shaft", "tool", "0 0 0.1"),
        link("tool", 0.4, "0.01 0.005 0.02"),
    ]
    return robot("epson-g6", *parts)


NAMED = (ur5, panda, irb120, puma560, scara)


def random_tree(seed: int) -> str:
    """3 to 9 links in any placement, axes in any direction: oblique, parallel, opposite,
    intersecting, coincident; some fixed or bare.
    """
    rng = np.random.default_rng([31, seed])
    n = int(rng.integers(3, 10))
    parts = [link("base", 1.0)]
    for k in range(1, n + 1):
        parent = (
            f"l{k - 1}"
            if k > 1 and rng.random() < 0.7
            else ("base" if k == 1 else f"l{rng.integers(1, k)}")
        )
        kind = (
            str(rng.choice(["revolute", "prismatic", "fixed"], p=[0.6, 0.22, 0.18]))
            if k > 1
            else "revolute"
        )
        easy = rng.random(3) < 0.5
        axis = rng.choice([-1, 0, 1], 3) if easy[0] else rng.standard_normal(3)
        axis = np.array([0, 0, 1.0]) if not axis.any() else axis / np.linalg.norm(axis)
        xyz = rng.choice([0, 0.2, -0.3], 3) if easy[1] else rng.uniform(-0.4, 0.4, 3)
        rpy = rng.choice([0, np.pi / 2, np.pi, -np.pi / 2], 3) if easy[2] else rng.uniform(-3, 3, 3)
        if rng.random() < 0.1:  # nearly parallel, as rounded angles leave it
            axis, rpy = np.array([0, 0, 1.0]), np.array([1e-5, 0, 0])
        words = [" ".join(map(repr, map(float, v))) for v in (xyz, rpy, axis)]
        parts.append(joint(f"j{k}", kind, parent, f"l{k}", *words))
        m, x = rng.uniform(0.2, 1, 6), rng.uniform(-0.2, 0.2, (6, 3))
        S = (m[:, None] * x).T @ x
        tensor = (np.trace(S) * np.eye(3) - S)[np.triu_indices(3)]
        com, turn = (" ".join(map(repr, rng.uniform(-0.2, 0.2, 3).tolist())) for _ in range(2))
        bare = kind == "fixed" and rng.random() < 0.3
        parts.append(
            link(f"l{k}", 0.0 if bare else float(m.sum()), com, tuple(map(float, tensor)), turn)
        )
    return robot(f"tree{seed}", *parts)
