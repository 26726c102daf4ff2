"""Verify a claim of `symgen check ROBOT --certificate FILE`, with the standard library alone.

    python check_certificate.py FILE      0: verified, 1: refuted, 2: no certificate that it can judge, and why

It takes from the claim the frame table, the elements and the formulas, and nothing that it can make
itself: primes of 61 bits, random points, and the names of the standard parameters are its own. At
these points it computes the columns of Newton and Euler in frame 0 over F_p: angles are rational
points of the circle, constants, rates and pi random residues, directions of motion random signs, and
a function such as tanh is one random residue for each argument. It verifies that the loops close,
the rank of the base columns, every formula (the column of every standard parameter), and what has no
effect. A false formula passes with probability below 2 d/p for each prime, d the degree of the claim.
Not judged: joints that only closure equations tie, roots, columns that are energies, and angles that
are no quarter turns of pi, constants or numbers.
"""

import ast
import json
import random
import re
import sys
from fractions import Fraction
from pathlib import Path

INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")


KINDS = ("inertia", "viscous", "coulomb", "stiffness", "offset", "column")
LONGEST, MOST, POWER = 2000, 300, 64  # characters of an expression, entries of a list, an exponent
FRAME = ("gamma", "b", "alpha", "d", "theta", "r")


class SkipError(Exception):
    """Nothing that can be judged: malformed, or beyond this script."""


class RefutedError(Exception):
    pass


def parsed(text):
    if not isinstance(text, str) or len(text) > LONGEST:
        raise SkipError(f"an expression is a text of at most {LONGEST} characters")
    return ast.parse(text, mode="eval").body


def whole(x):
    """An exponent or a multiple, an int of moderate size."""
    if not isinstance(x, ast.Constant) or type(x.value) is not int or abs(x.value) > POWER:
        raise SkipError("an exponent is a whole number up to 64")
    return x.value


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
        self.tree, self.functions = parsed, {}
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
            n, b = abs(int(n)), b if n > 0 else -b
            while n:  # the point n times around, by squaring
                if n % 2:
                    c, s = (c * a - s * b) % self.p, (s * a + c * b) % self.p
                a, b, n = (a * a - b * b) % self.p, 2 * a * b % self.p, n // 2
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
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return -self.value(node.operand) % p
        if isinstance(node, ast.Call) and node.func.id in ("cos", "sin"):
            return self.cos_sin(linear(node.args[0]))[node.func.id == "sin"]
        if not isinstance(node, ast.BinOp):
            raise SkipError(ast.unparse(node))
        u = self.value(node.left)
        v = 0 if isinstance(node.op, ast.Pow) else self.value(node.right)
        if isinstance(node.op, ast.Div):
            return u * pow(v, -1, p) % p
        if isinstance(node.op, ast.Pow):
            return pow(u, whole(node.right), p)
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
        self.sign, self.functions = {}, {}
        return rows

    def law(self, node, along, s, sd):
        """The residue of a law: q, qd are position and rate along a row, `along` its angle."""
        here = lambda other: self.law(other, along, s, sd)  # noqa: E731
        if isinstance(node, ast.Name) and node.id in ("q", "qd"):
            return s if node.id == "q" else sd
        if isinstance(node, ast.Name) and re.fullmatch(r"qd?[0-9]+", node.id):
            rate = self.qd if node.id[1] == "d" else self.q
            return rate[int(node.id.strip("qd"))]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return -here(node.operand) % self.p
        if isinstance(node, ast.BinOp):
            if isinstance(node.op, ast.Pow):
                return pow(here(node.left), whole(node.right), self.p)
            u, v = here(node.left), here(node.right)
            if isinstance(node.op, ast.Div):
                return u * pow(v, -1, self.p) % self.p
            signs = {ast.Add: u + v, ast.Sub: u - v, ast.Mult: u * v}
            return signs[type(node.op)] % self.p
        if not isinstance(node, ast.Call):
            return self.value(node)
        name, arguments = node.func.id, [here(x) for x in node.args]
        if name in ("sin", "cos"):
            angle = {}
            for atom, n in linear(node.args[0]).items():
                for other, m in (along if atom == "q" else {atom: 1}).items():
                    angle[other] = angle.get(other, 0) + n * m
            return self.cos_sin(angle)[name == "sin"]
        if name == "sign" and arguments in ([sd], [-sd % self.p]):
            sign = self.sign.setdefault(("law", sd), random.choice((1, -1)))
            return sign if arguments == [sd] else -sign
        return self.functions.setdefault((name, *arguments), random.randrange(self.p))


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
            raise RefutedError(f"frames {cut} and {twin} do not coincide")
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
            if e["kind"] == "column":
                place = sum(x * F.q[j] for j, x in G.items()) % p
                speed = sum(x * F.qd[j] for j, x in G.items()) % p
                along = {f"q{j}": linear(F.tree(x))[1] for j, x in row.items()}
                force = F.law(F.tree(e["laws"][list(e["along"]).index(key)]), along, place, speed)
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


def is_prime(n):
    """Miller and Rabin; these bases prove it up to 2^64."""
    d, r = n - 1, 0
    while d % 2 == 0:
        d, r = d // 2, r + 1
    for a in (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37):
        x = pow(a, d, n)
        if x not in (1, n - 1) and all((x := x * x % n) != n - 1 for _ in range(r - 1)):
            return False
    return True


def prime():
    """A random prime of 61 bits."""
    while not is_prime(n := random.randrange(2**60 + 1, 2**61, 2)):
        pass
    return n


def require(condition, text):
    if not condition:
        raise SkipError(text)


def well_formed(claim):
    """SkipError where the claim is none."""
    require(isinstance(claim, dict), "it is no object of keys")
    require(re.fullmatch(r"[\w.-]{1,80}", claim["robot"], re.ASCII), "the robot has no name")
    lists = ("frames", "gravity", "joints", "tied", "loops", "elements", "standard_parameters", "base_parameters", "no_effect", "primes")  # fmt: skip
    for key in lists:
        require(isinstance(claim[key], list), f"{key} is no list")
        require(len(claim[key]) <= 20 * MOST, f"{key} is too long")
    require(claim["frames"] and claim["joints"] and len(claim["gravity"]) == 3, "no robot")
    require(all(type(p) is int and p > 1 for p in claim["primes"]), "a prime is a whole number")
    require(claim["valid"] is True and claim["failures"] == [], "it says itself that it fails")
    require(len(claim["frames"]) <= MOST, "too many frames")
    seen = {0}
    for f in claim["frames"]:
        require(f["ant"] in seen and f["j"] not in seen, "frames are not in the order of a tree")
        require(f["sigma"] in (0, 1, 2) and type(f["link"]) is bool, "a frame is incomplete")
        require(all(isinstance(f[key], str) for key in FRAME), "a frame is incomplete")
        variable = {0: "theta", 1: "r"}.get(f["sigma"])
        for key in FRAME:
            joints = {n.id for n in ast.walk(parsed(f[key])) if isinstance(n, ast.Name)}
            joints = {name for name in joints if re.fullmatch("q[0-9]+", name)}
            require(joints == ({f"q{f['j']}"} if key == variable else set()), "a joint variable")
        if variable:
            require(linear(parsed(f[variable]))[f"q{f['j']}"] == 1, "a joint variable")
        seen.add(f["j"])
    moving = [f["j"] for f in claim["frames"] if f["sigma"] != 2]
    passive = [int(j) for j in claim["passive"]]
    given = [*claim["joints"], *passive, *claim["tied"]]
    require(sorted(given) == sorted(moving), "joints are not those of the frames")
    require(not claim["tied"], f"only closure equations tie joints {claim['tied']}")
    names = {*claim["constants"], "pi", *(f"q{j}" for j in moving)}
    texts = [*claim["gravity"], *(f[key] for f in claim["frames"] for key in FRAME)]
    texts += [c for b in claim["base_parameters"] for c in b["coefficients"].values()]
    for text in [*texts, *claim["passive"].values()]:
        for node in ast.walk(parsed(text)):
            known = not isinstance(node, ast.Name) or node.id in {*names, "sin", "cos"}
            require(known, "an expression has a name that is no constant")
    for e in claim["elements"]:
        require(e["kind"] in KINDS and e["when"] in (None, "positive", "negative"), "an element")
        require(not e.get("energies"), "a column that is an energy")


def parameters(claim):
    """Names of the standard parameters of a robot, by its links and elements."""
    of_links = [f"{name}{f['j']}" for f in claim["frames"] if f["link"] for name in INERTIAL]
    keys = [(e["family"], key) for e in claim["elements"] for key in {**e["along"], **e["form"]}]
    return {*of_links, *(f"{family}{key}" for family, key in keys)}


def check(claim):
    """Sentences on what is wrong."""
    well_formed(claim)
    base, own_names, wrong = claim["base_parameters"], parameters(claim), set()
    own = [b["own"] for b in base]
    used = {*own, *(name for b in base for name in b["coefficients"])}
    if used - own_names or {*claim["standard_parameters"]} != own_names:
        return ["it names other parameters than the robot has"]
    if any(b["name"] not in (b["own"], f"{b['own']}R") for b in base):
        return ["a base parameter is not called like its own standard parameter"]
    if not len(base) == claim["rank"] == claim["count"]:
        return [f"{len(base)} base parameters, rank {claim['rank']} and count {claim['count']}"]
    hidden = set(own_names)
    for p in (prime(), prime()):
        F = Field(claim, p)
        states = [regressor(F) for _ in range(2 * len(base) // len(claim["joints"]) + 15)]
        W = [[D[name][i] for name in own] for D in states for i in claim["joints"]]
        if (found := rank(W, p)) != len(base):
            wrong.add(f"the rank is {found}, not {len(base)}")
        K = [{name: F.value(c) for name, c in b["coefficients"].items()} for b in base]
        for name in sorted(own_names):
            of_base = [(o, k[name]) for o, k in zip(own, K, strict=True) if k.get(name)]
            for D in states:
                for i in claim["joints"]:
                    if D[name][i] % p:
                        hidden.discard(name)
                    if (D[name][i] - sum(D[o][i] * x for o, x in of_base)) % p:
                        wrong.add(f"the column of {name} is not what the formulas say")
    if {*claim["no_effect"]} != hidden:
        wrong.add("other parameters have no effect")
    return sorted(wrong)


def main(file):
    """Exit status, and what to print."""
    try:
        require(file.stat().st_size < 20_000_000, "it is too long")
        claim = json.loads(file.read_text("utf-8"))
        wrong = check(claim)
    except RefutedError as what:
        return 1, f"refuted: {what}"
    except Exception as what:  # whatever is wrong with a file, it is no certificate
        return 2, f"no certificate: {ascii(str(what))[1:-1][:200] or type(what).__name__}"
    if wrong:
        return 1, f"{claim['robot']}: refuted: {'; '.join(wrong[:5])}"
    return 0, f"{claim['robot']}: verified: rank {claim['rank']} and every formula"


if __name__ == "__main__":
    status, text = main(Path(sys.argv[1]))
    print(text)
    sys.exit(status)
