"""Verify a claim of `symgen check ROBOT --certificate FILE`, with the standard library alone.

    python check_certificate.py FILE      0: verified, 1: refuted, 2: skipped, and why

From the frame table of the claim it computes, over the prime fields of the claim and at random
points of its own, the columns of Newton and Euler in frame 0: angles are rational points of the
circle, constants, rates and pi random residues, directions of motion random signs. It verifies that
the loops close, the rank of the base columns, and every formula, that is the column of every
standard parameter. It takes for granted the frame table, and what the elements of the claim say.
A false formula passes with probability below (2 d / p) for each prime, d the degree of the claim.
Skipped: joints that only closure equations tie, roots, and angles that are no quarter turns of pi,
constants or numbers.
"""

import ast
import json
import random
import sys
from fractions import Fraction
from pathlib import Path

INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")


class SkipError(Exception):
    pass


def linear(node):
    """{atom: factor} of an angle: atoms are names, pi, joints, or 1."""
    if isinstance(node, ast.Constant):
        return {1: Fraction(str(node.value))}
    if isinstance(node, ast.Name):
        return {node.id: Fraction(1)}
    if isinstance(node, ast.UnaryOp):
        return {a: -x for a, x in linear(node.operand).items()}
    if not isinstance(node, ast.BinOp):
        raise SkipError(f"the angle {ast.unparse(node)}")
    u, v = linear(node.left), linear(node.right)
    if isinstance(node.op, (ast.Add, ast.Sub)):
        sign = 1 if isinstance(node.op, ast.Add) else -1
        return {a: u.get(a, 0) + sign * v.get(a, 0) for a in {*u, *v}}
    if isinstance(node.op, ast.Div) and {*v} == {1}:
        return {a: x / v[1] for a, x in u.items()}
    if isinstance(node.op, ast.Mult) and ({*u} == {1} or {*v} == {1}):
        factor, other = (u[1], v) if {*u} == {1} else (v[1], u)
        return {a: x * factor for a, x in other.items()}
    raise SkipError(f"the angle {ast.unparse(node)}")


class Field:
    """A random geometry over F_p, and random states in it."""

    def __init__(self, claim, p):
        self.claim, self.p, self.circle, self.values, self.sign = claim, p, {}, {}, {}
        self.tree = lambda text: ast.parse(text, mode="eval").body
        self.passive = {int(j): linear(self.tree(e)) for j, e in claim["passive"].items()}

    def point(self, atom):
        while atom not in self.circle:
            t = random.randrange(self.p)
            if (1 + t * t) % self.p:
                below = pow(1 + t * t, -1, self.p)
                self.circle[atom] = ((1 - t * t) * below % self.p, 2 * t * below % self.p)
        return self.circle[atom]

    def cos_sin(self, angle):
        c, s = 1, 0
        for atom, n in angle.items():
            n *= 2 if atom == "pi" else 1
            if atom == 1:  # an angle that is a number has a point of its own
                a, b = self.point(abs(n))
                b, n = (b if n > 0 else -b), int(n != 0)
            else:
                a, b = (0, 1) if atom == "pi" else self.point(atom)
            if n.denominator != 1 if isinstance(n, Fraction) else False:
                raise SkipError(
                    f"{n} of the angle {atom}" if atom != "pi" else f"an angle of {n / 2}*pi"
                )
            for _ in range(abs(int(n))):
                c, s = (c * a - s * (b if n > 0 else -b), s * a + c * (b if n > 0 else -b))
        return c % self.p, s % self.p

    def value(self, node):
        """The residue of an expression."""
        p = self.p
        if isinstance(node, str):
            node = self.tree(node)
        if isinstance(node, ast.Constant):
            x = Fraction(str(node.value))
            return x.numerator * pow(x.denominator, -1, p) % p
        if isinstance(node, ast.Name):
            return self.values.setdefault(node.id, random.randrange(1, p))
        if isinstance(node, ast.UnaryOp):
            return -self.value(node.operand) % p
        if isinstance(node, ast.Call) and node.func.id in ("cos", "sin"):
            return self.cos_sin(linear(node.args[0]))[node.func.id == "sin"]
        if not isinstance(node, ast.BinOp):
            raise SkipError(ast.unparse(node))
        u, v = self.value(node.left), self.value(node.right)
        if isinstance(node.op, ast.Div):
            return u * pow(v, -1, p) % p
        if isinstance(node.op, ast.Pow):
            return pow(u, ast.literal_eval(node.right), p)
        add, sub = isinstance(node.op, ast.Add), isinstance(node.op, ast.Sub)
        return (u + v if add else u - v if sub else u * v) % p

    def move(self):
        """A random state: points and values of all joints, their rates; {joint: {actuated: n}}."""
        names = {f"q{j}" for j in self.claim["joints"]}
        self.circle = {a: x for a, x in self.circle.items() if not str(a).startswith("q")}
        rows = {j: {j: 1} for j in self.claim["joints"]}
        self.q, self.qd, self.qdd = ({j: random.randrange(self.p) for j in rows} for _ in range(3))
        self.values |= {f"q{j}": x for j, x in self.q.items()}
        for j, angle in self.passive.items():
            n = {a: x.numerator * pow(x.denominator, -1, self.p) for a, x in angle.items()}
            rows[j] = {int(a[1:]): x for a, x in n.items() if a in names}
            rest = sum(x * (1 if a == 1 else self.value(a)) for a, x in n.items() if a not in names)
            self.q[j] = self.values[f"q{j}"] = sum(x * self.q[i] for i, x in rows[j].items()) + rest
            for rate in (self.qd, self.qdd):
                rate[j] = sum(x * rate[i] for i, x in rows[j].items())
            if all(x.denominator == 1 for a, x in angle.items() if a != "pi"):
                self.circle[f"q{j}"] = self.cos_sin(angle)
        self.sign = {}
        return rows


def cross(u, v):
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]


def dot(u, v):
    return sum(a * b for a, b in zip(u, v, strict=True))


def add(*vectors):
    return [sum(entries) for entries in zip(*vectors, strict=True)]


def times(factor, v):
    return [factor * x for x in v]


def product(A, B):
    return [[dot(row, column) for column in zip(*B, strict=True)] for row in A]


def screw(F, angle, shift, axis):
    """Rotation about x (0) or z (2), and translation along it."""
    (c, s), i, j = F.cos_sin(angle), (axis + 1) % 3, (axis + 2) % 3
    A = [[int(k == m) for m in range(3)] for k in range(3)]
    A[i][i], A[i][j], A[j][i], A[j][j] = c, -s, s, c
    return A, [shift if k == axis else 0 for k in range(3)]


def regressor(F):
    """{parameter: {actuated joint: column}} at a random state."""
    p, rows, claim = F.p, F.move(), F.claim
    g = [-F.value(e) for e in claim["gravity"]]
    E3 = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    at = {0: (E3, [0] * 3, [0] * 3, [0] * 3, g, {})}  # R, P, w, wd, a, {joint: (z, P or None)}
    torque = {}

    def reduced(v):
        return [x % p for x in v]

    for f in claim["frames"]:
        R, P, w, wd, a, axes = at[f["ant"]]
        for angle, shift, axis in (("gamma", "b", 2), ("alpha", "d", 0), ("theta", "r", 2)):
            A, step = screw(F, linear(F.tree(f[angle])), F.value(f[shift]), axis)
            P = reduced(add(P, [dot(row, step) for row in R]))
            R = [reduced(row) for row in product(R, A)]
        z, j, sigma = [row[2] for row in R], f["j"], f["sigma"]
        lever = add(P, times(-1, at[f["ant"]][1]))
        a = add(a, cross(wd, lever), cross(w, cross(w, lever)))
        if sigma == 0:
            spin = times(F.qd[j], z)
            wd = add(wd, times(F.qdd[j], z), cross(w, spin))
            w = add(w, spin)
        elif sigma == 1:
            a = add(a, cross(w, times(2 * F.qd[j], z)), times(F.qdd[j], z))
        w, wd, a = reduced(w), reduced(wd), reduced(a)
        axes = axes if sigma == 2 else {**axes, j: (z, P if sigma == 0 else None)}
        at[j] = R, P, w, wd, a, axes
        for k, name in enumerate(INERTIAL if f["link"] else ()):
            force, moment = [0] * 3, [0] * 3
            if name == "M":
                force = a
            elif k > 5:
                ms = [row[k - 6] for row in R]
                force = add(cross(wd, ms), cross(w, cross(w, ms)))
                moment = cross(ms, a)
            else:
                u, v = ([row["XYZ".index(c)] for row in R] for c in name)
                J = [
                    [(u[m] * v[n] + v[m] * u[n]) // (2 if u == v else 1) for n in range(3)]
                    for m in range(3)
                ]
                Jw = [dot(row, w) for row in J]
                moment = add([dot(row, wd) for row in J], cross(w, Jw))
            torque[f"{name}{j}"] = {
                i: dot(z, moment) + dot(cross(z, add(P, times(-1, o))), force)
                if o
                else dot(z, force)
                for i, (z, o) in axes.items()
            }
    for cut, twin in claim["loops"]:
        if at[cut][:2] != at[twin][:2]:
            raise ValueError(f"frames {cut} and {twin} do not coincide")
    torque |= elements(F, rows)
    total = {}
    for name, by_joint in torque.items():
        total[name] = dict.fromkeys(claim["joints"], 0)
        for j, x in by_joint.items():
            for i, n in rows[j].items():
                total[name][i] = (total[name][i] + n * x) % p
    return total


def elements(F, rows):
    """{parameter: {joint: torque}} of what acts along rows or in forms."""
    torque, p = {}, F.p
    state = {"inertia": F.qdd, "viscous": F.qd, "stiffness": F.q}
    for e in F.claim["elements"]:
        for key, row in e["along"].items():
            G = {int(j): F.value(x) for j, x in row.items()}
            actuated = {}
            for j, x in G.items():
                for i, n in rows[j].items():
                    actuated[i] = (actuated.get(i, 0) + x * n) % p
            first = next((i for i in sorted(actuated) if actuated[i]), None)
            s = 0
            if (
                first is not None
            ):  # proportional rows have one direction, up to the sign of the file
                ratio = tuple(
                    (i, x * pow(actuated[first], -1, p) % p)
                    for i, x in sorted(actuated.items())
                    if x
                )
                s = F.sign.setdefault(ratio, random.choice((1, -1))) * e["signs"][key]
            force = s if e["kind"] == "coulomb" else 1
            if e["kind"] in state:
                force = sum(x * state[e["kind"]][j] for j, x in G.items())
            force *= {"positive": int(s > 0), "negative": int(s < 0)}.get(e["when"], 1)
            torque[f"{e['family']}{key}"] = {j: x * force % p for j, x in G.items()}
        for key, form in e["form"].items():
            by_joint = torque.setdefault(f"{e['family']}{key}", {})
            for place, x in form.items():
                i, j = map(int, place.split(","))
                by_joint[i] = (by_joint.get(i, 0) + F.value(x) * state[e["kind"]][j]) % p
    return torque


def rank(rows, p):
    """Rank over F_p."""
    found = []
    for row in rows:
        for pivot, other in found:
            if row[pivot]:
                row = [(x - row[pivot] * y) % p for x, y in zip(row, other, strict=True)]
        pivot = next((k for k, x in enumerate(row) if x), None)
        if pivot is not None:
            inverse = pow(row[pivot], -1, p)
            found.append((pivot, [x * inverse % p for x in row]))
    return len(found)


def check(claim):
    """Sentences on what is wrong."""
    if claim["tied"]:
        raise SkipError(f"only closure equations tie joints {claim['tied']}")
    base, wrong = claim["base_parameters"], set()
    own = [b["own"] for b in base]
    for p in claim["primes"]:
        if p < 2**29 or any(p % k == 0 for k in range(2, int(p**0.5) + 1)):
            return [f"{p} is no prime of thirty bits"]
        F = Field(claim, p)
        states = [regressor(F) for _ in range(2 * len(base) // len(claim["joints"]) + 15)]
        W = [[D[name][i] for name in own] for D in states for i in claim["joints"]]
        if not rank(W, p) == len(base) == claim["rank"]:
            wrong.add(f"the rank is {rank(W, p)}, not {claim['rank']}, of {len(base)} columns")
        K = [{name: F.value(c) for name, c in b["coefficients"].items()} for b in base]
        for name in claim["standard_parameters"]:
            for D in states:
                for i in claim["joints"]:
                    if (
                        D[name][i]
                        - sum(D[o][i] * k.get(name, 0) for o, k in zip(own, K, strict=True))
                    ) % p:
                        wrong.add(f"the column of {name} is not what the formulas say")
    return sorted(wrong)


if __name__ == "__main__":
    claim = json.loads(Path(sys.argv[1]).read_text("utf-8"))
    try:
        wrong = check(claim)
    except SkipError as what:
        sys.exit(print(f"skipped: {what}") or 2)
    except (ValueError, KeyError, ZeroDivisionError) as what:
        wrong = [f"{what}"]
    verdict = "; ".join(wrong) or f"verified: rank {claim['rank']} and every formula"
    sys.exit(print(f"{claim['robot']}: {verdict}") or int(bool(wrong)))
