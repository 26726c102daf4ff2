"""The mechanism of an MJCF with loops as a URDF, its loops in one of the forms that URDF users write."""

from __future__ import annotations

import json
import re

import mujoco
import numpy as np
from support.loop_files import CONNECT, SITE, WELD, rotation, words

FORMS = (
    "loop_joint", "drake:loop_joint", "loop", "constraint", "gazebo", "second parent", "yaml", "closures",
    "pin_loops",
)  # fmt: skip
MOTORS = ("transmission", "ros2_control", "yaml")


def bare(text: str) -> str:
    """The MJCF without motor inertias and springs, for which a URDF has no place, and with its
    gravity.
    """
    text = re.sub(r'gravity="[^"]*"', 'gravity="0 0 -9.81"', text)
    return re.sub(r' (armature|stiffness|springref)="[^"]*"', "", text)


def rpy(R: np.ndarray) -> str:
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    return words([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def urdf_of(text: str, driven: list[str], form: str, motors: str, seed: int) -> dict[str, str]:
    """Files of the URDF, by name. Position 0 of each joint is that of `ref` in the MJCF."""
    rng = np.random.default_rng([seed, 8])
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pose: dict[str, tuple[np.ndarray, np.ndarray]] = {"ground": (np.zeros(3), np.eye(3))}
    link_of, lines, parallel = {0: "ground"}, ['<link name="ground"/>'], []
    for b in range(1, model.nbody):
        first, count = int(model.body_jntadr[b]), int(model.body_jntnum[b])
        parent = link_of[int(model.body_parentid[b])]
        for k in range(first, first + count):
            name, last = model.joint(k).name, k == first + count - 1
            link = model.body(b).name if last else f"{model.body(b).name}_{k}"
            at, R = data.xanchor[k].copy(), rotation(rng)
            p, Q = pose[parent]
            pose[link] = at, R
            kind = "prismatic" if int(model.jnt_type[k]) == 2 else "continuous"
            parallel += [data.xaxis[k].copy()] if kind == "continuous" else []
            limit = '<limit effort="9" velocity="9" lower="-9" upper="9"/>' * (kind == "prismatic")
            lines.append(
                f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{link}"/>'
                f'<origin xyz="{words(Q.T @ (at - p))}" rpy="{rpy(Q.T @ R)}"/>'
                f'<axis xyz="{words(R.T @ data.xaxis[k])}"/>{limit}'
                f'<dynamics damping="{float(model.dof_damping[model.jnt_dofadr[k]])!r}"/></joint>'
            )
            inertial = ""
            if last:
                M, I = float(model.body_mass[b]), model.body_inertia[b]
                own = R.T @ data.ximat[b].reshape(3, 3)
                inertial = (
                    f'<inertial><origin xyz="{words(R.T @ (data.xipos[b] - at))}" rpy="{rpy(own)}"/>'
                    f'<mass value="{M!r}"/><inertia ixx="{float(I[0])!r}" iyy="{float(I[1])!r}" '
                    f'izz="{float(I[2])!r}" ixy="0" ixz="0" iyz="0"/></inertial>'
                )
            lines.append(f'<link name="{link}">{inertial}</link>')
            parent = link
        link_of[b] = parent
    files, table = {}, {"loops": [], "closures": [], "pin_loops": [], "ball_loops": []}
    around = max(([a for a in parallel if abs(a @ b) > 1 - 1e-9] for b in parallel), key=len)
    planar = len(around) >= max(2, len(parallel) - 2)  # a turret and a wrist aside
    axis = around[0] if planar else np.array([1.0, 0.0, 0.0])
    for e in range(model.neq):
        weld = int(model.eq_type[e]) == WELD
        assert weld or int(model.eq_type[e]) == CONNECT
        ends = [int(model.eq_obj1id[e]), int(model.eq_obj2id[e])]
        if int(model.eq_objtype[e]) == SITE:
            world = data.site_xpos[ends[0]].copy()
            ends = [int(model.site_bodyid[s]) for s in ends]
        else:
            b = ends[0]
            own = model.eq_data[e][:3] * (not weld)
            world = data.xpos[b] + data.xmat[b].reshape(3, 3) @ own
        links = [link_of[b] for b in ends]
        W = rotation(rng)
        local = [(R.T @ (world - p), R.T @ W) for p, R in (pose[link] for link in links)]
        xyz, turns = [words(p) for p, _ in local], [rpy(R) for _, R in local]
        kind = "fixed" if weld else "spherical"
        own_axis = ""
        if planar and not weld and rng.random() < 0.5:
            kind, own_axis = "revolute", f'<axis xyz="{words(W.T @ axis)}"/>'
            if rng.random() < 0.3 and form != "gazebo":
                own_axis = ""
        one, two = links
        if form.endswith("loop_joint"):
            lines.append(
                f'<{form} name="c{e}" type="{kind}"><link1 link="{one}" xyz="{xyz[0]}" rpy="{turns[0]}"/>'
                f'<link2 link="{two}" xyz="{xyz[1]}" rpy="{turns[1]}"/>{own_axis}</{form}>'
            )
        elif form == "loop":
            lines.append(
                f'<loop name="c{e}" type="{kind}"><predecessor link="{one}"><origin xyz="{xyz[0]}" '
                f'rpy="{turns[0]}"/></predecessor><successor link="{two}"><origin xyz="{xyz[1]}" '
                f'rpy="{turns[1]}"/></successor>{own_axis}</loop>'
            )
        elif form == "constraint":
            lines.append(
                f'<constraint name="c{e}" type="{kind}"><parent link="{one}"/><child link="{two}"/>'
                f'<parent_origin xyz="{xyz[0]}" rpy="{turns[0]}"/><child_origin xyz="{xyz[1]}" '
                f'rpy="{turns[1]}"/>{own_axis.replace("axis", "parent_axis", 1)}</constraint>'
            )
        elif form == "gazebo":
            kind = {"spherical": "ball"}.get(kind, kind)
            inner = own_axis and f"<axis><xyz>{words(W.T @ axis)}</xyz></axis>"
            lines.append(
                f'<gazebo><joint name="c{e}" type="{kind}"><parent>{one}</parent><child>{two}</child>'
                f"<pose>{xyz[1]} {turns[1]}</pose>{inner}</joint></gazebo>"
            )
        elif form == "second parent":
            kind = "fixed" if weld else "continuous"
            (p, P), (q, Q) = pose[one], pose[two]
            if not weld:  # the frame of the child is at the loop
                lines.append(f'<link name="end{e}"/>')
                lines.append(
                    f'<joint name="f{e}" type="fixed"><parent link="{two}"/><child link="end{e}"/>'
                    f'<origin xyz="{xyz[1]}" rpy="{turns[1]}"/></joint>'
                )
                two, q, Q = f"end{e}", world, W
            lines.append(
                f'<joint name="c{e}" type="{kind}"><parent link="{one}"/><child link="{two}"/>'
                f'<origin xyz="{words(P.T @ (q - p))}" rpy="{rpy(P.T @ Q)}"/>'
                f'<axis xyz="{words(Q.T @ axis)}"/></joint>'
            )
        elif form == "yaml":
            row = {"links": links, "points": [list(map(float, p)) for p, _ in local]}
            if weld:
                row |= {"type": "fixed", "rpy": [[float(x) for x in t.split()] for t in turns]}
            elif own_axis:
                row |= {"axis": [float(x) for x in pose[one][1].T @ axis]}
            table["loops"].append(row)
        elif form == "closures":
            row = {"link_a": one, "link_b": two, "point": world.tolist(), "axis": axis.tolist()}
            table["closures"].append(row)
        else:
            key = "pin_loops" if planar else "ball_loops"
            table[key].append(
                {"name": f"c{e}", "parent": one, "child": two}
                | {"parent_xyz": local[0][0].tolist(), "child_xyz": local[1][0].tolist()}
            )
    beside: dict[str, object] = {}
    if form == "yaml":
        beside["loops"] = table["loops"]
    exported = {key: table[key] for key in ("closures", "pin_loops", "ball_loops") if table[key]}
    if form == "closures":
        exported["independent"] = driven
    elif motors == "yaml" and not exported:
        beside["actuated"] = driven
    elif motors == "ros2_control":
        inside = "".join(
            f'<joint name="{name}"><command_interface name="effort"/></joint>' for name in driven
        )
        lines.append(f'<ros2_control name="r" type="system">{inside}</ros2_control>')
    else:
        lines += [
            f'<transmission name="t{k}"><joint name="{name}"/><actuator name="m{k}"/></transmission>'
            for k, name in enumerate(driven)
        ]
    if beside:
        files["robot.loops.yaml"] = json.dumps(beside)
    if exported:
        files["loop_closures.yaml"] = json.dumps(exported)
    files["robot.urdf"] = '<robot name="robot">\n' + "\n".join(lines) + "\n</robot>\n"
    return files
