"""General regrouping relations, exact over Q(geometry), from the tips to the base.

Identities between regressor columns that hold for any motion of link i = ant(j) and any gravity [GK90, KB95], hence also in closed loops.
Revolute j, with a = A_j e3 and p = P_ij (both constant):

    D_YY = -D_XX + D_J_i( A diag(1,1,0) A' )
    D_MZ = D_MS_i(a) + D_J_i( 2 (p.a) E - p a' - a p' )
    D_M  = D_M_i + D_MS_i(p) + D_J_i( (p.p) E - p p' )

so YY_j, MZ_j, M_j go to link i. Prismatic j: the inertia tensor goes to link i, J_i += iRj J_j iRj'. Fixed j: all ten parameters go.
What reaches the base has no effect.

[GK90] M. Gautier, W. Khalil, IEEE T-RA 6(3), 1990.  [KB95] W. Khalil, F. Bennis, IJRR 14(2), 1995.
"""

from __future__ import annotations

from symgen.derive.scalar import apply
from symgen.description.expression import ONE, ZERO, Expression, call
from symgen.description.robot import FIXED, INERTIAL, PRISMATIC, REVOLUTE, Frame, Robot, parameter

TENSOR = {"XX": (0, 0), "XY": (0, 1), "XZ": (0, 2), "YY": (1, 1), "YZ": (1, 2), "ZZ": (2, 2)}
FIRST = ("MX", "MY", "MZ")

Combination = dict[str, Expression]  # {parameter: coefficient}
Vec = tuple[Expression, Expression, Expression]
Mat = tuple[Vec, Vec, Vec]
Step = tuple[str, str, Expression]  # (from, into, coefficient): `into` receives coefficient * `from`


class Transfer:
    """Where the parameters of a link end up: `steps` one link down at a time, `combination` of each kept parameter.

    After the tips have been processed, the torque is sum over kept names k of D_k combination[k](chi).
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.combination: dict[str, Combination] = {name: {name: ONE} for name in robot.parameters}
        self.steps: list[Step] = []
        self.rigid: set[int] = set()  # frames fixed to a link, or to the base, that are none themselves: what reaches them goes on
        for f in robot.frames:
            if f.sigma == FIXED and f.j not in robot.links and (f.ant == 0 or f.ant in robot.links or f.ant in self.rigid):
                self.rigid.add(f.j)
        for f in reversed(robot.frames):
            if f.j in robot.links and (f.ant == 0 or f.ant in robot.links or f.ant in self.rigid):
                self._link(f)

    @property
    def kept(self) -> tuple[str, ...]:
        return tuple(name for name in self.robot.parameters if name in self.combination)

    def _link(self, frame: Frame) -> None:
        for name, image in link_relations(frame).items():
            into: Combination = {}
            for (k, at), c in image.items():
                for target, share in self._reached(k, frame.ant).items() if at else [(parameter(k, frame.j), ONE)]:
                    into[target] = into.get(target, ZERO) + c * share
            self._move(parameter(name, frame.j), {target: c for target, c in into.items() if c})

    def _reached(self, name: str, j: int) -> Combination:
        """The columns of links that the column of a parameter of frame j is."""
        if j == 0:
            return {}
        if j not in self.rigid:
            return {parameter(name, j): ONE}
        total: Combination = {}
        for (k, _), c in link_relations(self.robot.frame(j))[name].items():
            for target, share in self._reached(k, self.robot.frame(j).ant).items():
                total[target] = total.get(target, ZERO) + c * share
        return total

    def _move(self, source: str, image: Combination) -> None:
        """Remove the column `source` = sum_k image_k column k."""
        amount = self.combination.pop(source)
        for target, c in image.items():
            self.steps.append((source, target, c))
            into = self.combination[target]
            for name, value in amount.items():
                total = into.get(name, ZERO) + c * value
                into[name] = total
                if not total:
                    del into[name]


def link_relations(f: Frame) -> dict[str, dict[tuple[str, int], Expression]]:
    """{parameter of link j that goes: {(parameter, 1 if of link i else 0 of link j): coefficient}}."""
    A, p = _rotation(f), _position(f)
    relations: dict[str, dict[tuple[str, int], Expression]] = {}
    if f.sigma == REVOLUTE:
        a = apply(A, (ZERO, ZERO, ONE))
        zz = [[A[k][0] * A[m][0] + A[k][1] * A[m][1] for m in range(3)] for k in range(3)]
        relations["YY"] = {("XX", 0): -ONE} | _tensor(zz)
        relations["MZ"] = _first(a) | _tensor(_steiner(p, a, 1))
        relations["M"] = {("M", 1): ONE} | _first(p) | _tensor(_steiner(p, p, 0))
        return relations
    R = _product(A, _turn(f))
    for name, (k, m) in TENSOR.items():
        relations[name] = _tensor([[R[x][k] * R[y][m] + (R[x][m] * R[y][k] if k != m else ZERO) for y in range(3)] for x in range(3)])
    if f.sigma == PRISMATIC:
        return relations
    for k, name in enumerate(FIRST):
        u: Vec = (R[0][k], R[1][k], R[2][k])
        relations[name] = _first(u) | _tensor(_steiner(p, u, 1))
    relations["M"] = {("M", 1): ONE} | _first(p) | _tensor(_steiner(p, p, 0))
    return relations


def _steiner(p: Vec, u: Vec, symmetric: int) -> list[list[Expression]]:
    """(p.u) E - p u', or 2 (p.u) E - p u' - u p' if `symmetric`."""
    trace = (p[0] * u[0] + p[1] * u[1] + p[2] * u[2]) * (1 + symmetric)
    return [[(trace if k == m else ZERO) - p[k] * u[m] - (u[k] * p[m] if symmetric else ZERO) for m in range(3)] for k in range(3)]


def _tensor(J: list[list[Expression]]) -> dict[tuple[str, int], Expression]:
    return {(name, 1): J[k][m] for name, (k, m) in TENSOR.items() if J[k][m]}


def _first(u: Vec) -> dict[tuple[str, int], Expression]:
    return {(name, 1): c for name, c in zip(FIRST, u, strict=True) if c}


def _rotation(f: Frame) -> Mat:
    """A = Rot(z, gamma) Rot(x, alpha), cos**2 + sin**2 left as it is."""
    ca, sa, cg, sg = (call(trig, e) for e in (f.alpha, f.gamma) for trig in ("cos", "sin"))
    return ((cg, -sg * ca, sg * sa), (sg, cg * ca, -cg * sa), (ZERO, sa, ca))


def _turn(f: Frame) -> Mat:
    c, s = call("cos", f.theta0), call("sin", f.theta0)
    return ((c, -s, ZERO), (s, c, ZERO), (ZERO, ZERO, ONE))


def _position(f: Frame) -> Vec:
    A = _rotation(f)
    cg, sg = call("cos", f.gamma), call("sin", f.gamma)
    return (f.d * cg + f.r0 * A[0][2], f.d * sg + f.r0 * A[1][2], f.b + f.r0 * A[2][2])


def _product(A: Mat, B: Mat) -> Mat:
    return tuple(tuple(A[k][0] * B[0][m] + A[k][1] * B[1][m] + A[k][2] * B[2][m] for m in range(3)) for k in range(3))  # type: ignore[return-value]


__all__ = ["INERTIAL", "Step", "Transfer", "link_relations"]
