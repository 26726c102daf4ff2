"""General regrouping rules, exact for any geometry, applied from the tips to the base.

The rules are identities between regressor columns. They hold for any motion of link i = ant(j) and
any gravity [GK90, KB95], hence also in closed loops. For a revolute joint j, the vectors a = A_j e3
and p = P_ij are constant, and

    D_YY = -D_XX + D_J_i( A diag(1,1,0) A' )
    D_MZ = D_MS_i(a) + D_J_i( 2 (p.a) E - p a' - a p' )
    D_M  = D_M_i + D_MS_i(p) + D_J_i( (p.p) E - p p' )

Therefore YY_j, MZ_j and M_j are moved to link i. For a prismatic joint j, the inertia tensor is
moved to link i, J_i += iRj J_j iRj'. For a fixed joint j, all ten parameters are moved. A parameter
that reaches the base has no effect, unless the base is free: its link 0 has parameters.

[GK90] M. Gautier, W. Khalil, IEEE T-RA 6(3), 1990. [KB95] W. Khalil, F. Bennis, IJRR 14(2), 1995.
"""

from __future__ import annotations

from symgen.derive.algebra import IDENTITY, Vector, array
from symgen.derive.geometry import Rotation, axis_rotation, displacement
from symgen.description.expression import ONE, ZERO, Expression, call
from symgen.description.robot import FIXED, PRISMATIC, REVOLUTE, Frame, Robot, parameter

TENSOR = {"XX": (0, 0), "XY": (0, 1), "XZ": (0, 2), "YY": (1, 1), "YZ": (1, 2), "ZZ": (2, 2)}
FIRST = ("MX", "MY", "MZ")

Combination = dict[str, Expression]  # {parameter: coefficient}
Step = tuple[
    str, str, Expression
]  # (from, into, coefficient): `into` receives coefficient * `from`


class Transfer:
    """Regrouping of standard parameters from each link to the link before it, by the general rules.

    `steps` holds the moves. `combination` holds, for each parameter that remains, the sum of
    standard parameters that it stands for. The torque is then the sum over the remaining names k of
    D_k combination[k](chi).
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.combination: dict[str, Combination] = {name: {name: ONE} for name in robot.parameters}
        self.steps: list[Step] = []
        self.rigid: set[int] = (
            set()
        )  # frames fixed to a link or the base, no links themselves: what reaches them goes on
        for f in robot.frames:
            if (
                f.sigma == FIXED
                and f.j not in robot.links
                and (f.ant == 0 or f.ant in robot.links or f.ant in self.rigid)
            ):
                self.rigid.add(f.j)
        for name in robot.assume:
            del self.combination[name]
        for f in reversed(robot.frames):
            if f.j in robot.links and (f.ant == 0 or f.ant in robot.links or f.ant in self.rigid):
                self._link(f)

    @property
    def remaining(self) -> tuple[str, ...]:
        return tuple(name for name in self.robot.parameters if name in self.combination)

    def _link(self, frame: Frame) -> None:
        for name, image in link_relations(frame).items():
            into: Combination = {}
            for (k, at), c in image.items():
                for target, share in (
                    self._reached(k, frame.ant).items() if at else [(parameter(k, frame.j), ONE)]
                ):
                    into[target] = into.get(target, ZERO) + c * share
            acting = {target: c for target, c in into.items() if c}
            if {parameter(name, frame.j), *acting} <= {*self.combination}:  # none assumed zero
                self._move(parameter(name, frame.j), acting)

    def _reached(self, name: str, j: int) -> Combination:
        """Express the regressor column of an inertial parameter in frame j by columns of link parameters.

        A frame that is fixed to a link but is no link itself is replaced by that link. Parameters
        of the base have no columns, unless the base is free.
        """
        if j == 0 and not self.robot.base_is_free:
            return {}
        if j not in self.rigid:
            return {parameter(name, j): ONE}
        total: Combination = {}
        for (k, _), c in link_relations(self.robot.frame(j))[name].items():
            for target, share in self._reached(k, self.robot.frame(j).ant).items():
                total[target] = total.get(target, ZERO) + c * share
        return total

    def _move(self, source: str, image: Combination) -> None:
        """Remove the regressor column `source`, which is the sum image_k D_k over other regressor
        columns.

        The other columns then stand for the parameters of `source` too.
        """
        amount = self.combination.pop(source)
        for target, c in image.items():
            self.steps.append((source, target, c))
            into = self.combination[target]
            product = {value: c * value for value in {*amount.values()}}
            for name, value in amount.items():
                total = into.get(name, ZERO) + product[value]
                into[name] = total
                if not total:
                    del into[name]


def link_relations(f: Frame) -> dict[str, dict[tuple[str, int], Expression]]:
    """Return the rules that move parameters of link j to the link i before it, as coefficients.

    The result is {removed parameter of link j: {(parameter, 1 if of link i, else 0): coefficient}}.
    """
    cg, sg, ca, sa = (call(trig, e) for e in (f.gamma, f.alpha) for trig in ("cos", "sin"))
    A = axis_rotation(cg, sg, ca, sa)
    p = displacement(A, f.b, f.d, f.r0)
    relations: dict[str, dict[tuple[str, int], Expression]] = {}
    mass = {"M": {("M", 1): ONE} | _first(p) | _tensor(_steiner(p, p, 0))}
    if f.sigma == REVOLUTE:
        a = A @ array((ZERO, ZERO, ONE))
        zz = [[A[k][0] * A[m][0] + A[k][1] * A[m][1] for m in range(3)] for k in range(3)]
        relations["YY"] = {("XX", 0): -ONE} | _tensor(zz)
        relations["MZ"] = _first(a) | _tensor(_steiner(p, a, 1))
        return relations | mass
    turned = Rotation(A, call("cos", f.theta0), call("sin", f.theta0))
    R = [turned.up(e) for e in IDENTITY]  # axes of frame j in frame i
    for name, (k, m) in TENSOR.items():
        relations[name] = _tensor(
            [
                [R[k][x] * R[m][y] + (R[m][x] * R[k][y] if k != m else ZERO) for y in range(3)]
                for x in range(3)
            ]
        )
    if f.sigma == PRISMATIC:
        return relations
    for k, name in enumerate(FIRST):
        relations[name] = _first(R[k]) | _tensor(_steiner(p, R[k], 1))
    return relations | mass


def _steiner(p: Vector, u: Vector, symmetric: int) -> list[list[Expression]]:
    """Compute the matrix (p.u) E - p u' of the parallel-axis rule, from vectors p and u.

    If `symmetric`, the matrix is 2 (p.u) E - p u' - u p'. E is the identity.
    """
    trace = (p[0] * u[0] + p[1] * u[1] + p[2] * u[2]) * (1 + symmetric)
    return [
        [
            (trace if k == m else ZERO) - p[k] * u[m] - (u[k] * p[m] if symmetric else ZERO)
            for m in range(3)
        ]
        for k in range(3)
    ]


def _tensor(J: list[list[Expression]]) -> dict[tuple[str, int], Expression]:
    return {(name, 1): J[k][m] for name, (k, m) in TENSOR.items() if J[k][m]}


def _first(u: Vector) -> dict[tuple[str, int], Expression]:
    return {(name, 1): c for name, c in zip(FIRST, u, strict=True) if c}
