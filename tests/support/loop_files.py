"""Random MJCF files with closed loops, and MuJoCo's torques of such a file at states that close them.

The oracle reads the file alone. It closes the loops by Newton's method on the errors that MuJoCo
reports of its constraints. With J, the Jacobian of the constraints by `mj_jac`,

    G = dq/dq_a:  J G = 0 ,    J qdd + Jd qd = 0 ,    Gamma_a = G' Gamma_tree

where Gamma_tree are the torques of `mj_inverse` without constraints, and Jd is that of `mj_jacDot`.
"""

from __future__ import annotations

import mujoco
import numpy as np

Array = np.ndarray
SITE = int(mujoco.mjtObj.mjOBJ_SITE)
CONNECT, WELD = int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)


class ClosedMuJoCo:
    """An MJCF with <connect> and <weld>; `driven` are the joints whose torques are asked."""

    def __init__(self, text: str, driven: list[str]) -> None:
        self.model = model = mujoco.MjModel.from_xml_string(text)
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        model.dof_frictionloss[:] = 0
        model.opt.disableflags |= (
            mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
        )
        self.data = mujoco.MjData(model)
        self.active = [int(model.joint(name).dofadr[0]) for name in driven]
        self.passive = [k for k in range(model.nv) if k not in self.active]
        self.driven = [int(model.joint(name).qposadr[0]) for name in driven]

    @property
    def start(self) -> Array:
        return self.model.qpos0.copy()

    def _at(self, q: Array, qd: Array | None = None) -> None:
        self.data.qpos[:] = q
        self.data.qvel[:] = 0 if qd is None else qd
        mujoco.mj_forward(self.model, self.data)

    def closed(self, q_a: Array, q: Array) -> Array | None:
        """qpos with the driven joints at q_a and all others moved, by small steps from q, so that
        MuJoCo's constraints have no error; None if they have, or if a joint went FAR, into another
        assembly mode.
        """
        q, begin, first = q.copy(), q[self.driven].copy(), q
        for step in np.linspace(0, 1, 21):
            q[self.driven] = begin + step * (q_a - begin)
            for _ in range(30):
                self._at(q)
                n = self.data.ne
                J = self.data.efc_J.reshape(-1, self.model.nv)[:n]
                error = self.data.efc_pos[:n]
                dq = np.zeros(self.model.nv)
                dq[self.passive] = -np.linalg.lstsq(J[:, self.passive], error, rcond=1e-8)[0]
                mujoco.mj_integratePos(self.model, q, dq, 1)
                if np.abs(error).max(initial=0.0) < 1e-13:
                    break
        self._at(q)
        error = np.abs(self.data.efc_pos[: self.data.ne]).max(initial=0.0)
        return q if error < 1e-12 and np.abs(q - first).max() < FAR else None

    def _rows(self, qd: Array) -> tuple[Array, Array]:
        """Jacobian of the constraints, and Jd qd, at the state of `data`."""
        model, data = self.model, self.data
        rows, curved = [], []
        for e in range(model.neq):
            kind = int(model.eq_type[e])
            if kind not in (CONNECT, WELD):  # linear
                linear = np.flatnonzero(data.efc_id[: data.ne] == e)
                rows.append(data.efc_J.reshape(-1, model.nv)[linear].copy())
                curved.append(np.zeros(len(linear)))
                continue
            ends = []
            for k, place in enumerate((model.eq_obj1id[e], model.eq_obj2id[e])):
                if int(model.eq_objtype[e]) == SITE:
                    body, point = model.site_bodyid[place], data.site_xpos[place]
                else:
                    own = model.eq_data[e][3 * k : 3 * k + 3] * (kind != WELD)
                    body = place
                    point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ own
                ends.append((int(body), point.copy()))
            if kind == WELD:
                ends[1] = ends[1][0], ends[0][1]  # of two bodies that are one: any point
            pairs = []
            for body, point in ends:
                jp, jr, dp, dr = (np.zeros((3, model.nv)) for _ in range(4))
                mujoco.mj_jac(model, data, jp, jr, point, body)
                mujoco.mj_jacDot(model, data, dp, dr, point, body)
                pairs.append((np.vstack([jp, jr]), np.vstack([dp, dr])))
            (J, D), (K, E) = pairs
            use = slice(0, 6 if kind == WELD else 3)
            rows.append((J - K)[use])
            curved.append(((D - E) @ qd)[use])
        return np.vstack(rows), np.concatenate(curved)

    def regularity(self) -> float:
        """Smallest singular value of the passive joints' Jacobian at the pose of the file."""
        self._at(self.start)
        J = self._rows(np.zeros(self.model.nv))[0][:, self.passive]
        return float(np.linalg.svd(J, compute_uv=False)[len(self.passive) - 1])

    def mobility(self) -> tuple[int, int]:
        """Degrees of freedom at the pose of the file: with driven joints free, and held."""
        self._at(self.start)
        J = self._rows(np.zeros(self.model.nv))[0]
        rank = np.linalg.matrix_rank
        held = rank(J[:, self.passive], tol=1e-8) if self.passive else 0
        return self.model.nv - rank(J, tol=1e-8), len(self.passive) - held

    def torque(self, q: Array, qd_a: Array, qdd_a: Array) -> Array:
        """Torques of the driven joints at a configuration that closes the loops."""
        a, u, n = self.active, self.passive, self.model.nv
        self._at(q)
        J, _ = self._rows(np.zeros(n))
        inverse = np.linalg.pinv(J[:, u], rcond=1e-8)
        G = np.zeros((n, len(a)))
        G[a], G[u] = np.eye(len(a)), -inverse @ J[:, a]
        assert np.abs(J @ G).max() < 1e-9 * max(1, np.abs(G).max()), "J G = 0"
        qd = G @ qd_a
        self._at(q, qd)
        J, curved = self._rows(qd)
        qdd = np.zeros(n)
        qdd[a] = qdd_a
        qdd[u] = -inverse @ (J[:, a] @ qdd_a + curved)
        flags = self.model.opt.disableflags
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self._at(q, qd)
        self.data.qacc[:] = qdd
        mujoco.mj_inverse(self.model, self.data)
        self.model.opt.disableflags = flags
        return G.T @ self.data.qfrc_inverse


# --- random files ---


def words(v: Array | list[float]) -> str:
    return " ".join(repr(float(x)) for x in np.asarray(v, dtype=float))


def rotation(rng: np.random.Generator) -> Array:
    Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return Q * np.linalg.det(Q)


def quaternion(R: Array) -> Array:
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(R).ravel())
    return quat


class Body:
    """A body, with joints and bodies on it, in world coordinates at the start."""

    def __init__(self, rng, name, point, *joints, held=(), R=None):
        self.rng, self.name, self.point = rng, name, np.asarray(point, dtype=float)
        self.joints, self.held = joints, list(held)
        self.R = rotation(rng) if R is None else R

    def text(self, point=(0, 0, 0), R=None, world=None) -> str:
        rng = self.rng
        R = np.eye(3) if R is None else R
        W = np.eye(3) if world is None else world  # turns the whole mechanism
        own = W @ self.R
        here = W @ self.point
        d = rng.uniform(0.001, 0.01, 3)
        inertia = words([d[1] + d[2], d[0] + d[2], d[0] + d[1]])
        joints = "".join(
            f'<joint name="{name}" type="{kind}" axis="{words(own.T @ (W @ axis))}" ref="{ref!r}" '
            f'pos="{words(own.T @ (W @ np.asarray(at, dtype=float) - here))}" {more}/>'
            for name, kind, axis, at, ref, more in self.joints
        )
        inside = "".join(held.text(here, own, W) for held in self.held)
        return (
            f'<body name="{self.name}" pos="{words(R.T @ (here - point))}" '
            f'quat="{words(quaternion(R.T @ own))}">{joints}'
            f'<inertial pos="{words(rng.uniform(-0.1, 0.1, 3))}" quat="{words(rng.standard_normal(4))}" '
            f'mass="{rng.uniform(0.2, 2)!r}" diaginertia="{inertia}"/>{inside}</body>\n'
        )

    def all(self):
        yield self
        for held in self.held:
            yield from held.all()


FAR = 1.0  # rad or m
REGULAR = 0.05  # m per rad: less is near a dead point
KINDS = (
    "four-bar",
    "five-bar",
    "parallelogram",
    "slider-crank",
    "jack",
    "four-bar on a turret",
    "spatial crank",
    "ankle",
    "welded four-bar",
    "welded five-bar",
    "welded spatial crank",
    "welded hand",
    "four-bar of two points",
    "welded five-bar of two points",
    "spatial loop of two points",
    "welded spatial crank of three points",
)
ENDS = (" of two points", " of three points")


def random_file(kind: str, seed: int) -> tuple[str, list[str]]:
    """The text of a random MJCF of a kind, away from dead points, and the names of the joints that
    are not passive.
    """
    for k in range(200):
        text, driven = _drawn(kind, np.random.default_rng([91, KINDS.index(kind), seed, k]))
        oracle = ClosedMuJoCo(text, driven)
        if oracle.regularity() > REGULAR / (1 + 15 * kind.endswith(ENDS)):  # points are near
            return text, driven
    raise AssertionError(kind)


def _drawn(kind: str, rng: np.random.Generator) -> tuple[str, list[str]]:
    x, y, z = np.eye(3)

    def near(*point):
        return np.array(point) + rng.uniform(-0.03, 0.03, 3) * [1, 0, 1]

    def hinge(name, axis, at, passive=True):
        more = f'damping="{rng.uniform(0, 1)!r}"' if rng.random() < 0.5 or not passive else ""
        more += f' armature="{rng.uniform(0, 0.1)!r}"' if rng.random() < 0.3 or not passive else ""
        more += ' stiffness="2" springref="0.3"' if rng.random() < 0.3 else ""
        more += ' frictionloss="0.1"' if not passive else ""
        return name, "hinge", axis, at, float(rng.uniform(-1, 1)), more

    def slide(name, axis, at, passive=True):
        name, _, axis, at, ref, more = hinge(name, axis, at, passive)
        return name, "slide", axis, at, ref, more

    A, B, C, D = near(0, 0, 0), near(0.1, 0.02, 0.25), near(0.6, 0.05, 0.4), near(0.5, 0.03, 0)
    driven = ["crank"]
    rest: list[str] = []
    several = 1 + kind.endswith(ENDS[0]) + 2 * kind.endswith(ENDS[1])
    planar = kind.removeprefix("welded ").removesuffix(ENDS[0]).removesuffix(ENDS[1])
    if planar in ("four-bar", "parallelogram", "four-bar on a turret"):
        if planar == "parallelogram":
            D, C = A + [0.5, 0.03, 0.1], B + [0.5, 0.03, 0.1]
        rod = Body(rng, "rod", B, hinge("rod", y, B))
        crank = Body(rng, "crank", A, hinge("crank", y, A, False), held=[rod])
        rocker = Body(rng, "rocker", D, hinge("rocker", y, D))
        roots, ends, point = [crank, rocker], ("rod", "rocker"), C
        if planar == "four-bar on a turret":
            wrist = Body(rng, "wrist", C, hinge("wrist", rotation(rng)[0], C, False))
            rod.held.append(wrist)
            base = Body(rng, "base", A, hinge("turret", z, A, False), held=roots)
            roots, driven, rest = [base], ["crank"], ["turret", "wrist"]
    elif planar == "five-bar":
        E = near(0.3, 0, 0.6)
        C = near(0.55, 0, 0.3)
        left = Body(rng, "left", B, hinge("left", y, B))
        right = Body(rng, "right", C, hinge("right", -y, C))
        crank = Body(rng, "crank", A, hinge("crank", y, A, False), held=[left])
        other = Body(rng, "other", D, hinge("other", y, D, False), held=[right])
        roots, ends, point, driven = [crank, other], ("left", "right"), E, ["crank", "other"]
    elif planar == "slider-crank":
        rod = Body(rng, "rod", B, hinge("rod", y, B))
        crank = Body(rng, "crank", A, hinge("crank", y, A, False), held=[rod])
        piston = Body(rng, "piston", D, slide("piston", x, D))
        roots, ends, point = [crank, piston], ("rod", "piston"), near(0.6, 0, 0.1)
    elif planar == "jack":
        quill = Body(rng, "quill", B, slide("jack", (C - A) * [1, 0, 1], B, False))
        tube = Body(rng, "tube", A, hinge("tube", y, A), held=[quill])
        boom = Body(rng, "boom", D, hinge("boom", y, D))
        roots, ends, point, driven = [tube, boom], ("quill", "boom"), C, ["jack"]
    elif planar == "spatial crank":
        a, b, c, d = rotation(rng)[0], *rotation(rng)[:2], rotation(rng)[1]
        rod = Body(rng, "rod", B, hinge("rod1", b, B), hinge("rod2", c, B))
        crank = Body(rng, "crank", A, hinge("crank", a, A, False), held=[rod])
        rocker = Body(rng, "rocker", D, hinge("rocker", d, D))
        roots, ends, point = [crank, rocker], ("rod", "rocker"), C
    elif planar == "spatial loop":  # of six hinges: 7 with that of the two points
        hinges = [hinge(f"rod{k}", v, B + 0.1 * v) for k, v in enumerate(rotation(rng))]
        rod = Body(rng, "rod", B, *hinges)
        crank = Body(rng, "crank", A, hinge("crank", rotation(rng)[0], A, False), held=[rod])
        rocker = Body(
            rng, "rocker", D, *(hinge(f"rocker{k}", v, D) for k, v in enumerate(rotation(rng)[:2]))
        )
        roots, ends, point = [crank, rocker], ("rod", "rocker"), C
    elif planar == "ankle":
        foot = Body(
            rng, "foot", [0, 0, 0], hinge("pitch", y, [0, 0, 0]), hinge("roll", x, [0, 0, 0])
        )
        roots, ties = [foot], []
        for side, name in ((1, "l"), (-1, "r")):
            at, tip = near(0, 0.05 * side, 0.3), near(-0.07, 0.05 * side, 0.3)
            rod = Body(
                rng, f"rod_{name}", tip, hinge(f"u1{name}", y, tip), hinge(f"u2{name}", x, tip)
            )
            roots.append(
                Body(rng, f"crank_{name}", at, hinge(f"m{name}", y, at, False), held=[rod])
            )
            ties.append((f"rod_{name}", "foot", near(-0.08, 0.05 * side, 0.02)))
        driven = ["ml", "mr"]
    if kind == "welded hand":
        hand = Body(rng, "hand", B + 0.05, R=rotation(rng))
        hand.joints = (("free", "free", z, B, 0.0, ""),)
        arm = Body(rng, "arm", B, hinge("elbow", rotation(rng)[0], B, False))
        upper = Body(rng, "upper", A, hinge("crank", rotation(rng)[0], A, False), held=[arm])
        roots, ends, driven, rest, point = [upper, hand], ("arm", "hand"), ["crank", "elbow"], [], C
    elif kind.startswith("welded"):  # the missing joint is a body more
        axis = y if "spatial" not in kind else rotation(rng)[2]
        tip = Body(rng, "tip", point, hinge("tip", axis, point))
        if "spatial" in kind:
            tip.joints = tuple(hinge(f"tip{k}", v, point) for k, v in enumerate(rotation(rng)))
        next(b for r in roots for b in r.all() if b.name == ends[0]).held.append(tip)
        ends = ("tip", ends[1]) if rng.random() < 0.5 else (ends[1], "tip")
    W = rotation(rng) if rng.random() < 0.7 else np.eye(3)
    bodies = {b.name: b for root in roots for b in root.all()}
    text = "".join(root.text(world=W) for root in roots)
    equality = ""
    ties = ties if kind == "ankle" else [(*ends, point)]
    if several > 1:
        beside = rotation(rng) if "spatial" in kind else [x, z] if "welded" in kind else [y]
        ties += [(*rng.permutation(ends), point + 0.07 * beside[k]) for k in range(several - 1)]
    for k, (one, other, at) in enumerate(ties):
        first, second = bodies[one], bodies[other]
        anchor = words((W @ first.R).T @ (W @ (np.asarray(at) - first.point)))
        if not kind.startswith("welded") or several > 1:
            if rng.random() < 0.4:
                for body in (first, second):
                    local = words((W @ body.R).T @ (W @ (np.asarray(at) - body.point)))
                    site = f'<site name="s{k}{body.name}" pos="{local}"/>'
                    text = text.replace(f'<body name="{body.name}"', f'<body name="{body.name}"', 1)
                    head = text.index(">", text.index(f'<body name="{body.name}"')) + 1
                    text = text[:head] + site + text[head:]
                equality += f'<connect name="c{k}" site1="s{k}{one}" site2="s{k}{other}"/>'
            else:
                equality += (
                    f'<connect name="c{k}" body1="{one}" body2="{other}" anchor="{anchor}"/>'
                )
        else:
            equality += f'<weld name="c{k}" body1="{one}" body2="{other}" anchor="0.1 0.2 0.3"/>'
    text = text.replace('type="free"', "FREE")
    motors = "".join(f'<motor joint="{name}"/>' for name in driven if name != "free")
    text = (
        f'<mujoco model="loop"><compiler angle="radian"/><option gravity="{words(rng.uniform(-8, 8, 3))}"/>\n'
        f"<worldbody>\n{text}</worldbody>\n<equality>{equality}</equality>\n"
        f"<actuator>{motors}</actuator></mujoco>\n"
    )
    return _free(text), [*driven, *rest]


def _free(text: str) -> str:
    """Write a joint FREE as MuJoCo does, without axis and reference."""
    import re

    return re.sub(r'<joint name="(\w+)" FREE [^>]*/>', r'<freejoint name="\1"/>', text)
