"""Verify a claim of `symgen check ROBOT --certificate FILE`, with the standard library alone.

    python check_certificate.py FILE      0: verified, 1: refuted, 2: no certificate that it can judge, and why

It takes from the claim the frame table, the elements and the formulas, and nothing that it can make
itself: primes of 61 bits, random points, and the names of the standard parameters are its own. At
these points it computes the columns of Newton and Euler in frame 0 over F_p: angles are rational
points of the circle, constants, rates and pi random residues, directions of motion random signs. It
verifies that the loops close, the rank of the base columns, every formula (the column of every
standard parameter), and what has no effect. A false formula passes with probability below 2 d/p for
each prime, d the degree of the claim.

Only what is listed here is read; all else is not judged. An expression has numbers, names, + - * /,
** with a whole exponent, and functions of one argument: SIMPLE ones, in a law of a column also
those of LAWS. sin and cos are of sums of whole multiples of joints and constants, quarter turns of
pi, and numbers; sign and abs of the coordinate of the law or of its rate; exp and tanh of arguments
that are linearly independent of each other and of 1, so that their values are independent of
each other and of the state (J. Ax, On Schanuel's conjectures, Annals of Mathematics 93, 1971).
A loop that ties two parallel revolute joints by closure equations is closed by a square root
modulo p, its rates by linear equations. Not judged are other loops of this kind, laws along the
joints that they tie, numeric coefficients, roots, and columns that are energies.
"""

import ast
import json
import math
import random
import re
import sys
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import NamedTuple

INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")


KINDS = ("inertia", "viscous", "coulomb", "stiffness", "offset", "column")
LONGEST, MOST, POWER = 2000, 300, 64  # characters of an expression, entries of a list, an exponent
BASE_ROWS = ("FX0", "FY0", "FZ0", "NX0", "NY0", "NZ0")
FRAME = ("gamma", "b", "alpha", "d", "theta", "r")
SIMPLE = ("sin", "cos")
LAWS = (*SIMPLE, "sign", "abs", "exp", "tanh")
TRIES = 64  # random states until one has a square root modulo p, as every second one
CHARACTERS = re.compile(r"[A-Za-z0-9_ .+*/()-]*")
NUMBER = re.compile(r"([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,2})?")
OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)
UNIT = 10**60 * math.lcm(*range(1, 361))  # an angle that is a number is a multiple of 1/UNIT rad


class SkipError(Exception):
    """Nothing that can be judged: malformed, or beyond this script."""


class NotJudgedError(SkipError):
    """A claim that may hold, of which this script does not know the mathematics."""


class RefutedError(Exception):
    pass


@cache
def parsed(text):
    """The tree of an expression of the listed syntax; its numbers are fractions, exact."""
    require(isinstance(text, str), "an expression is a text")
    require(len(text) <= LONGEST, f"an expression is a text of at most {LONGEST} characters")
    require(CHARACTERS.fullmatch(text), f"{text!r} is no expression")
    tree = ast.parse(text, mode="eval").body
    for node in ast.walk(tree):
        match node:
            case ast.Constant():
                number = text[node.col_offset : node.end_col_offset]
                require(NUMBER.fullmatch(number), f"{number!r} is no number")
                node.value = Fraction(number)
            case ast.BinOp(op=op):
                require(isinstance(op, OPERATORS), f"an operator of {text!r}")
            case ast.UnaryOp(op=ast.USub()) | ast.Name():
                pass
            case ast.Call(func=ast.Name(), args=[_], keywords=[]):
                pass
            case ast.expr():
                raise SkipError(f"{text!r} is no expression")
        if isinstance(node, ast.expr):
            node.text = text[node.col_offset : node.end_col_offset]
    return tree


def known(text, names, functions=SIMPLE):
    """SkipError where an expression has other names or functions."""
    nodes = [*ast.walk(parsed(text))]
    called = [node.func for node in nodes if isinstance(node, ast.Call)]
    for node in nodes:
        if isinstance(node, ast.Name) and not any(node is other for other in called):
            require(node.id in names, f"an expression has the name {node.id} that is no constant")
    for name in called:
        if name.id not in functions:
            raise NotJudgedError(f"the function {name.id} of {text!r}")


def joints_of(text):
    """The joint variables in an expression."""
    names = {node.id for node in ast.walk(parsed(text)) if isinstance(node, ast.Name)}
    return {name for name in names if re.fullmatch("q[0-9]+", name)}


def whole(node):
    """An exponent, an int of moderate size."""
    negative = isinstance(node, ast.UnaryOp)
    x = node.operand if negative else node
    if not isinstance(x, ast.Constant) or x.value.denominator != 1 or x.value > POWER:
        raise SkipError(f"an exponent is a whole number up to {POWER}, not {node.text}")
    return -int(x.value) if negative else int(x.value)


def real(node, constants):
    """The value of an expression at the constants of the robot file, in floats."""
    here = lambda other: real(other, constants)  # noqa: E731
    match node:
        case ast.Constant():
            return float(node.value)
        case ast.Name():
            return math.pi if node.id == "pi" else float(constants[node.id])
        case ast.UnaryOp():
            return -here(node.operand)
        case ast.Call():
            return {"sin": math.sin, "cos": math.cos}[node.func.id](here(node.args[0]))
        case ast.BinOp(op=ast.Pow()):
            return here(node.left) ** whole(node.right)
    u, v = here(node.left), here(node.right)
    match node.op:
        case ast.Add():
            return u + v
        case ast.Sub():
            return u - v
        case ast.Mult():
            return u * v
    return u / v


def linear(node):
    """{atom: factor} of an angle: atoms are names, pi, joints, or 1."""
    if isinstance(node, ast.Constant):
        return {1: node.value}
    if isinstance(node, ast.Name):
        return {node.id: Fraction(1)}
    if isinstance(node, ast.UnaryOp):
        return {a: -x for a, x in linear(node.operand).items()}
    if not isinstance(node, ast.BinOp):
        raise NotJudgedError(f"the angle {node.text}")
    u, v = linear(node.left), linear(node.right)
    if isinstance(node.op, (ast.Add, ast.Sub)):
        sign = 1 if isinstance(node.op, ast.Add) else -1
        return {a: u.get(a, 0) + sign * v.get(a, 0) for a in {*u, *v}}
    if isinstance(node.op, ast.Div) and {*v} == {1}:
        return {a: x / v[1] for a, x in u.items()}
    if isinstance(node.op, ast.Mult) and ({*u} == {1} or {*v} == {1}):
        factor, other = (u[1], v) if {*u} == {1} else (v[1], u)
        return {a: x * factor for a, x in other.items()}
    raise NotJudgedError(f"the angle {node.text}")


def fraction(node):
    """The value of an expression of numbers alone."""
    terms = linear(node)
    if {*terms} != {1}:
        raise NotJudgedError(f"an angle with the factor {node.text}")
    return terms[1]


class Coordinate(NamedTuple):
    """The coordinate of a law at a state: position and rate, and the signs of both.

    The position is the sum of factors times joints, {joint: factor}.
    """

    name: str
    row: dict
    q: int
    qd: int
    signs: tuple


class Field:
    """A random geometry over F_p, and random states in it."""

    def __init__(self, claim, p):
        self.claim, self.p, self.circle, self.values = claim, p, {}, {}
        self.sign, self.exponentials, self.arguments = {}, {}, []
        self.passive = {int(j): linear(parsed(e)) for j, e in claim["passive"].items()}
        free = {f"q{j}" for j in (*claim["joints"], *claim["tied"])}
        self.of_joints = free | {f"q{j}" for j in self.passive}
        self.along = {  # {joint: {actuated or tied: n}}
            j: {int(a[1:]): residue(n, p) for a, n in angle.items() if a in free}
            for j, angle in self.passive.items()
        }
        tied = {*claim["tied"]}
        self.loose = tied | {j for j, row in self.along.items() if tied & {*row}}
        self.order = order(claim, self.along)

    def point(self, atom):
        while atom not in self.circle:
            t = random.randrange(self.p)
            if (1 + t * t) % self.p:
                below = pow(1 + t * t, -1, self.p)
                self.circle[atom] = ((1 - t * t) * below % self.p, 2 * t * below % self.p)
        if self.circle[atom] is None:
            raise NotJudgedError(f"the angle {atom}, of which its joints have no whole multiple")
        return self.circle[atom]

    def around(self, point, n):
        """The point n times around, by squaring."""
        (a, b), (c, s), p = point, (1, 0), self.p
        while n:
            if n % 2:
                c, s = (c * a - s * b) % p, (s * a + c * b) % p
            a, b, n = (a * a - b * b) % p, 2 * a * b % p, n // 2
        return c, s

    def number(self, n):
        """The point of an angle of n rad, n > 0: all such angles are multiples of one unit."""
        if (n * UNIT).denominator != 1:
            raise NotJudgedError(f"an angle of {n} rad")
        if n not in self.circle:
            self.circle[n] = self.around(self.point("rad/UNIT"), int(n * UNIT))
        return self.circle[n]

    def cos_sin(self, angle):
        c, s = 1, 0
        for atom, n in angle.items():
            if not n:
                continue
            n *= 2 if atom == "pi" else 1
            if atom == 1:
                (a, b), n = self.number(abs(n)), 1 if n > 0 else -1
            else:
                a, b = (0, 1) if atom == "pi" else self.point(atom)
            if Fraction(n).denominator != 1:
                raise NotJudgedError(
                    f"{n} of the angle {atom}" if atom != "pi" else f"an angle of {n / 2}*pi"
                )
            a, b = self.around((a, b if n > 0 else -b), abs(int(n)))
            c, s = c * a - s * b, s * a + c * b
        return c % self.p, s % self.p

    def value(self, node, at=None):
        """The residue of an expression, in a law at a coordinate."""
        p, here = self.p, lambda other: self.value(other, at)
        if isinstance(node, str):
            node = parsed(node)
        match node:
            case ast.Constant():
                return node.value.numerator * pow(node.value.denominator, -1, p) % p
            case ast.Name(id="q") if at:
                return at.q
            case ast.Name(id="qd") if at:
                return at.qd
            case ast.Name():
                return self.values.setdefault(node.id, random.randrange(1, p))
            case ast.UnaryOp():
                return -here(node.operand) % p
            case ast.Call():
                return self.function(node, at)
            case ast.BinOp(op=ast.Pow()):
                return pow(here(node.left), whole(node.right), p)
        u, v = here(node.left), here(node.right)
        match node.op:
            case ast.Add():
                return (u + v) % p
            case ast.Sub():
                return (u - v) % p
            case ast.Mult():
                return u * v % p
        return u * pow(v, -1, p) % p

    def function(self, node, at):
        """The residue of a function of one argument."""
        name, argument, p = node.func.id, node.args[0], self.p
        if name in ("sin", "cos"):
            return self.cos_sin(self.angle(argument, at))[name == "sin"]
        if name in ("sign", "abs"):
            x = self.value(argument, at)
            for own, s in zip((at.q, at.qd), at.signs, strict=True):
                if x in (own, -own % p):
                    s = s if x == own else -s
                    return (s if name == "sign" else s * x) % p
            raise NotJudgedError(f"{node.text}, where {argument.text} is neither q nor qd")
        return self.exponential(node, at)

    def angle(self, node, at):
        """{atom: factor} of an angle; in a law the coordinate is that of its joints."""
        angle = {}
        row = {f"q{j}": parsed(x) for j, x in at.row.items()} if at else {}
        for atom, n in linear(node).items():
            if atom == "qd" or re.fullmatch("qd[0-9]+", str(atom)):
                raise NotJudgedError(f"the angle {node.text}, a rate")
            terms = {atom: 1}
            if at and atom == "q":
                terms = {joint: fraction(factor) for joint, factor in row.items()}
            for other, m in terms.items():
                angle[other] = angle.get(other, 0) + n * m
        return angle

    def exponential(self, node, at):
        """The residue of exp or tanh: E or (E^2 - 1)/(E^2 + 1), E random for each argument."""
        argument, p = node.args[0], self.p
        inside = [x.func.id for x in ast.walk(argument) if isinstance(x, ast.Call)]
        if {"exp", "tanh"} & {*inside}:
            raise NotJudgedError(f"{node.text}, a function within a function")
        x = self.value(argument, at)
        either = {self.value(argument, at._replace(signs=(s, t))) for s in (1, -1) for t in (1, -1)}
        if not either <= {x, -x % p}:
            raise NotJudgedError(f"{node.text}, whose argument is another one after a stop")
        at_plus = self.value(argument, at._replace(signs=(1, 1)))
        self.arguments[-1][f"{node.text} of {at.name}"] = at_plus
        if -x % p in self.exponentials:
            E = pow(self.exponentials[-x % p], -1, p)
        else:
            E = self.exponentials.setdefault(x, random.randrange(1, p))
        return E if node.func.id == "exp" else (E * E - 1) * pow(E * E + 1, -1, p) % p

    def move(self):
        """A random state: points and values of all joints, their rates; {joint: {actuated: n}}."""
        joints, tied = self.claim["joints"], self.claim["tied"]
        for _ in range(TRIES):
            self.circle = {a: x for a, x in self.circle.items() if a not in self.of_joints}
            self.q = {j: random.randrange(self.p) for j in (*joints, *tied)}
            self.values |= {f"q{j}": x for j, x in self.q.items()}
            if all(self.closed(*loop) for loop in self.order):
                break
        else:
            raise NotJudgedError(f"no closed state of joints {tied}")
        self.follow()
        rows = {j: {j: 1} for j in joints}
        qd, qdd = ({j: random.randrange(self.p) for j in joints} for _ in range(2))
        self.rates(qd, qdd)
        if tied:
            columns = {j: self.drift({}, {j: 1}) for j in (*joints, *tied)}
            of_tied = [columns[j] for j in tied]
            by_joint = {i: solved(of_tied, columns[i], self.p) for i in joints}
            rows |= {j: {i: x[k] for i, x in by_joint.items()} for k, j in enumerate(tied)}
            for rate in (qd, qdd):
                rate |= {j: sum(x * rate[i] for i, x in rows[j].items()) for j in tied}
            rest = solved(of_tied, self.drift(qd, qdd), self.p)
            self.rates(qd, qdd | {j: qdd[j] + x for j, x in zip(tied, rest, strict=True)})
        for j, row in self.along.items():
            rows[j] = {
                i: sum(x * rows[k].get(i, 0) for k, x in row.items()) % self.p
                for i in joints
                if any(i in rows[k] for k in row)
            }
        self.values |= {f"qd{j}": x for j, x in self.qd.items()}
        self.sign, self.exponentials = {}, {}
        self.arguments.append({})
        return rows

    def follow(self):
        """Positions of the joints that follow others by linear equations."""
        for j, angle in self.passive.items():
            self.q[j] = sum(
                residue(n, self.p) * (1 if a == 1 else self.value(str(a))) for a, n in angle.items()
            )
            self.values[f"q{j}"] = self.q[j]
            try:
                self.circle[f"q{j}"] = self.cos_sin(angle)
            except NotJudgedError:
                self.circle[f"q{j}"] = None

    def rates(self, qd, qdd):
        """Set the rates of all joints from those of the actuated and tied ones."""
        rest = dict.fromkeys((*self.claim["joints"], *self.claim["tied"]), 0)
        self.qd, self.qdd = {**rest, **qd}, {**rest, **qdd}
        for rate in (self.qd, self.qdd):
            rate |= {j: sum(x * rate[i] for i, x in row.items()) for j, row in self.along.items()}

    def drift(self, qd, qdd):
        """How much the ends of all loops accelerate away from each other."""
        self.rates(qd, qdd)
        at = motion(self, [0] * 3, [0] * 3, [0] * 3)
        return [x for cut, twin in self.claim["loops"] for x in gap(at[twin][4], at[cut][4])]

    def apart(self, cut, twin, **points):
        """How far the ends of a loop are apart, with joints at points of the circle."""
        self.circle |= points
        self.follow()
        at = motion(self, [0] * 3, [0] * 3, [0] * 3)
        return gap(at[twin][1], at[cut][1])

    def closed(self, cut, twin, a, b):
        """Close a loop by its joints a and b; False where this state has no root modulo p.

        The ends are apart by A + R V, where A and V depend on joint b, and R turns about the axis
        of a. They meet where |A|^2 = |V|^2, which is linear in cosine and sine of b, and R V = -A.
        """
        p, half = self.p, pow(2, -1, self.p)
        self.rates({}, {})

        def parts(point):
            ahead, behind, aside = (
                self.apart(cut, twin, **{a: x, b: point}) for x in ((1, 0), (-1, 0), (0, 1))
            )
            A = [(x + y) * half % p for x, y in zip(ahead, behind, strict=True)]
            return A, gap(A, ahead), gap(A, aside)

        def excess(point):
            A, V, _ = parts(point)
            return dot(V, V) - dot(A, A)

        ahead, behind, aside = map(excess, ((1, 0), (-1, 0), (0, 1)))
        h = (ahead + behind) * half
        f, g = ahead - h, aside - h
        square = (f * f + g * g - h * h) % p
        root = pow(square, (p + 1) // 4, p)  # p = 3 mod 4
        if root * root % p != square or (f * f + g * g) % p == 0:
            return False
        root, below = random.choice((root, -root)), pow(f * f + g * g, -1, p)
        point = (g * root - h * f) * below % p, (-f * root - h * g) * below % p
        A, V, W = parts(point)
        below = pow(dot(V, V), -1, p)
        points = {a: (-dot(A, V) * below % p, -dot(A, W) * below % p), b: point}
        if any(x % p for x in self.apart(cut, twin, **points)):
            raise NotJudgedError(f"the closure of frames {cut} and {twin}")
        return True

    def signs(self, actuated, row, sign):
        """Signs of position and rate along a row, (0, 0) where no actuated joint moves it.

        Proportional rows have one direction, up to the sign of the first factor in the robot file.
        """
        p, constants = self.p, self.claim["constants"]
        first = next((i for i in sorted(actuated) if actuated[i]), None)
        if first is None:
            return 0, 0
        leading = sum(
            real(parsed(x), constants)
            * (
                int(j) == first
                if int(j) not in self.passive
                else self.passive[int(j)].get(f"q{first}", 0)
            )
            for j, x in row.items()
        )
        require(sign == (-1 if leading < 0 else 1), "a sign is not that of the first factor")
        scale = pow(actuated[first], -1, p)
        ratio = tuple((i, x * scale % p) for i, x in sorted(actuated.items()) if x)
        place = sum(self.value(x) * self.q[int(j)] for j, x in row.items())
        rest = (place - sum(x * self.q[i] for i, x in actuated.items())) * scale % p
        return tuple(
            self.sign.setdefault(key, random.choice((1, -1))) * sign
            for key in (("q", ratio, rest), ("qd", ratio))
        )


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


def residue(x, p):
    """A fraction modulo p."""
    return x.numerator * pow(x.denominator, -1, p) % p


def gap(u, v):
    return add(v, times(-1, u))


def solved(columns, b, p):
    """x with sum x_k columns_k = -b modulo p; NotJudgedError unless there is one alone."""
    rows = [[*row, -y] for *row, y in zip(*columns, b, strict=True)]
    for k in range(len(columns)):
        pivot = next((row for row in rows[k:] if row[k] % p), None)
        if pivot is None:
            raise NotJudgedError("a state in which the loops leave joints free")
        rows.remove(pivot)
        pivot = [x * pow(pivot[k], -1, p) % p for x in pivot]
        rows = [[(x - row[k] * y) % p for x, y in zip(row, pivot, strict=True)] for row in rows]
        rows.insert(k, pivot)
    if any(row[-1] for row in rows[len(columns) :]):
        raise NotJudgedError("loops that do not stay closed")
    return [row[-1] for row in rows[: len(columns)]]


def order(claim, along):
    """(cut, twin, a, b) of the loops that tie two joints each, in an order that closes them."""
    frames = {f["j"]: f for f in claim["frames"]}
    waiting, known, found = [*claim["loops"]], {*claim["joints"]}, []
    while len(known) < len({*claim["joints"], *claim["tied"]}):
        for loop in waiting:
            path, joints = [*loop], set()
            while path:
                if path[-1] and frames[path[-1]]["sigma"] != 2:
                    joints |= {path[-1], *along.get(path[-1], ())}
                path.append(frames[path.pop()]["ant"]) if path[-1] else path.pop()
            tied = sorted(joints & {*claim["tied"]} - known)
            if len(tied) == 2 and all(frames[j]["sigma"] == 0 for j in tied):
                break
        else:
            raise NotJudgedError(f"closure equations that tie joints {claim['tied']}")
        waiting.remove(loop)
        known |= {*tied}
        found.append((*loop, *(f"q{j}" for j in tied)))
    return found


def motion(F, w, wd, g):
    """{frame: (R, P, w, wd, a, {joint: (z, P or None)})} from the motion of frame 0."""
    p = F.p
    E3 = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    at = {0: (E3, [0] * 3, w, wd, g, {})}

    def reduced(v):
        return [x % p for x in v]

    for f in F.claim["frames"]:
        R, P, w, wd, a, axes = at[f["ant"]]
        for angle, shift, axis in (("gamma", "b", 2), ("alpha", "d", 0), ("theta", "r", 2)):
            A, step = screw(F, F.angle(parsed(f[angle]), None), F.value(f[shift]), axis)
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
    return at


def regressor(F):
    """{parameter: {actuated joint: column}} at a random state."""
    p, rows, claim = F.p, F.move(), F.claim
    w, wd, g = [0] * 3, [0] * 3, [-F.value(e) for e in claim["gravity"]]
    free = base_of(claim) == "free"
    if base_of(claim) != "fixed":  # at random, gravity in the acceleration
        w, wd, g = ([random.randrange(p) for _ in g] for _ in range(3))
    at, torque = motion(F, w, wd, g), {}
    for j in links(claim):
        R, P, w, wd, a, axes = at[j]
        for k, name in enumerate(INERTIAL):
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
            if free:
                wrench = (*force, *add(moment, cross(P, force)))
                torque[f"{name}{j}"] |= dict(zip(BASE_ROWS, wrench, strict=True))
    for cut, twin in claim["loops"]:
        if at[cut][:2] != at[twin][:2]:
            raise RefutedError(f"frames {cut} and {twin} do not coincide")
    torque |= elements(F, rows)
    total = {}
    for name, by_joint in torque.items():
        total[name] = dict.fromkeys(rows_of(claim), 0)
        for j, x in by_joint.items():
            for i, n in ({j: 1} if j in BASE_ROWS else rows[j]).items():
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
            loose = bool(F.loose & {*G})
            if loose and (e["kind"] in ("coulomb", "stiffness", "column") or e["when"]):
                raise NotJudgedError(f"{e['family']}{key} along joints that closure equations tie")
            signs = (0, 0) if loose else F.signs(actuated, row, e["signs"][key])
            force = signs[1] if e["kind"] == "coulomb" else 1
            if e["kind"] in state:
                force = sum(x * state[e["kind"]][j] for j, x in G.items())
            force *= {"positive": int(signs[1] > 0), "negative": int(signs[1] < 0)}.get(
                e["when"], 1
            )
            if e["kind"] == "column":
                name = f"{e['family']}{key}"
                place = sum(x * F.q[j] for j, x in G.items()) % p
                speed = sum(x * F.qd[j] for j, x in G.items()) % p
                law = e["laws"][[*e["along"]].index(key)]
                force *= F.value(law, Coordinate(name, row, place, speed, signs))
            torque[f"{e['family']}{key}"] = {j: x * force % p for j, x in G.items()}
        for key, form in e["form"].items():
            by_joint = torque.setdefault(f"{e['family']}{key}", {})
            for place, x in form.items():
                i, j = map(int, place.split(","))
                if e["kind"] == "stiffness" and {i, j} & F.loose:
                    raise NotJudgedError(f"{e['family']}{key} in a form of tied joints")
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


def independent(F):
    """NotJudgedError unless the arguments of exp and tanh are linearly independent, with 1."""
    columns = {}
    for place in F.arguments[0]:
        column = tuple(state[place] for state in F.arguments)
        if tuple(-x % F.p for x in column) not in columns:
            columns.setdefault(column, place)
    if rank([[1] * len(F.arguments), *columns], F.p) != 1 + len(columns):
        raise NotJudgedError(f"the independence of {', '.join(columns.values())}"[:150])


def once(pairs):
    """An object of JSON; SkipError where a key stands twice."""
    require(len(dict(pairs)) == len(pairs), "a key stands twice")
    return dict(pairs)


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
    """A random prime of 61 bits, 3 mod 4: then x**((p + 1)/4) is the root of a square x."""
    while not is_prime(n := random.randrange(2**60 + 3, 2**61, 4)):
        pass
    return n


def require(condition, text):
    if not condition:
        raise SkipError(text)


def base_of(claim):
    """Whether the base is fixed, moves (its motion is an input), or is free (its wrench is a row)."""
    base = claim.get("base", "fixed")
    require(base in ("fixed", "moving", "free"), "the base is neither fixed, moving nor free")
    return base


def rows_of(claim):
    """The rows of the torques: of a free base, then the joints."""
    return [*(BASE_ROWS if base_of(claim) == "free" else ()), *claim["joints"]]


def links(claim):
    """The links with parameters, that of a free base before the others."""
    return [0] * (base_of(claim) == "free") + [f["j"] for f in claim["frames"] if f["link"]]


def well_formed(claim):
    """SkipError where the claim is none."""
    require(isinstance(claim, dict), "it is no object of keys")
    if str(claim.get("method")).startswith("numeric"):
        raise NotJudgedError("coefficients that are numeric, for the constants of the file alone")
    require(re.fullmatch(r"[\w.-]{1,80}", claim["robot"], re.ASCII), "the robot has no name")
    lists = ("frames", "gravity", "joints", "tied", "loops", "elements", "standard_parameters", "base_parameters", "no_effect", "primes")  # fmt: skip
    for key in lists:
        require(isinstance(claim[key], list), f"{key} is no list")
        require(len(claim[key]) <= 20 * MOST, f"{key} is too long")
    base_of(claim)
    require(claim["frames"] and claim["joints"] and len(claim["gravity"]) == 3, "no robot")
    require(all(type(p) is int and p > 1 for p in claim["primes"]), "a prime is a whole number")
    require(claim["valid"] is True and claim["failures"] == [], "it says itself that it fails")
    require(len(claim["frames"]) <= MOST, "too many frames")
    constants = claim["constants"]
    for name, x in constants.items():
        require(re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", name), "a constant has no name")
        require(not re.fullmatch("(q|qd)[0-9]*|pi", name), f"a constant is called {name}")
        require(type(x) in (int, float) and math.isfinite(x), f"{name} has no value")
    constants = {*constants, "pi"}
    seen, moving = {0}, set()
    for f in claim["frames"]:
        require(all(type(f[key]) is int for key in ("j", "ant", "sigma")), "a frame is incomplete")
        require(f["ant"] in seen and f["j"] not in seen, "frames are not in the order of a tree")
        require(f["sigma"] in (0, 1, 2) and type(f["link"]) is bool, "a frame is incomplete")
        variable = {0: "theta", 1: "r"}.get(f["sigma"])
        for key in FRAME:
            own = {f"q{f['j']}"} if key == variable else set()
            require(joints_of(f[key]) == own, "a joint variable")
            known(f[key], constants | own)
        if variable:
            require(linear(parsed(f[variable]))[f"q{f['j']}"] == 1, "a joint variable")
            moving.add(f["j"])
        seen.add(f["j"])
    given = [*claim["joints"], *numbers(claim["passive"]), *claim["tied"]]
    require(sorted(given) == sorted(moving), "joints are not those of the frames")
    for pair in claim["loops"]:
        require(len(pair) == 2 and {*pair} <= seen - {0}, "a loop of frames that are none")
    require(not claim["tied"] or base_of(claim) == "fixed", "a base that moves, with a loop")
    free = {f"q{j}" for j in (*claim["joints"], *claim["tied"])}
    for text in claim["passive"].values():
        known(text, constants | free)
    for text in [
        *claim["gravity"],
        *(c for b in claim["base_parameters"] for c in b["coefficients"].values()),
    ]:
        known(text, constants)
    for e in claim["elements"]:
        element(e, moving, constants)


def numbers(keys):
    """The joints that are keys, each written in one way."""
    require(all(re.fullmatch("[1-9][0-9]*", key, re.ASCII) for key in keys), "a key is no number")
    return {int(key) for key in keys}


def element(e, moving, constants):
    """SkipError where an element is none."""
    require(re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", e["family"]), "an element has no name")
    if e["kind"] not in KINDS:
        raise NotJudgedError(f"elements of the kind {e['kind']}")
    require(e["when"] in (None, "positive", "negative"), "an element")
    require(not e.get("energies"), "a column that is an energy")
    along, form, laws = e["along"], e["form"], e.get("laws", [])
    require(numbers(along).isdisjoint(numbers(form)), f"{e['family']} stands twice")
    require({*e["signs"]} == {*along}, "an element without signs")
    require(all(type(s) is int and s in (1, -1) for s in e["signs"].values()), "a sign is 1 or -1")
    require(len(laws) == len(along) * (e["kind"] == "column"), "an element without its laws")
    require(
        not form or (e["kind"] in ("inertia", "viscous", "stiffness") and not e["when"]), "a form"
    )
    places = [numbers(row) for row in along.values()]
    places += [numbers(place.split(",")) for row in form.values() for place in row]
    require(all(joints <= moving for joints in places), "an element of no joint")
    for row in (*along.values(), *form.values()):
        for text in row.values():
            known(text, constants)
    state = {name + j for name in ("q", "qd") for j in ("", *map(str, moving))}
    for text in laws:
        known(text, constants | state, LAWS)


def parameters(claim):
    """Names of the standard parameters of a robot, by its links and elements, each of them once."""
    of_links = [f"{name}{j}" for j in links(claim) for name in INERTIAL]
    keys = [(e["family"], key) for e in claim["elements"] for key in {**e["along"], **e["form"]}]
    names = [*of_links, *(f"{family}{key}" for family, key in keys)]
    twice = {name for name in names if names.count(name) > 1}
    require(not twice, f"several parameters are called {', '.join(sorted(twice))}")
    return {*names}


def check(claim):
    """Sentences on what is wrong."""
    well_formed(claim)
    base, own_names, wrong = claim["base_parameters"], parameters(claim), set()
    own = [b["own"] for b in base]
    for key in ("standard_parameters", "no_effect"):
        require(len({*claim[key]}) == len(claim[key]), f"a name of {key} stands twice")
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
        rows = rows_of(claim)
        states = [regressor(F) for _ in range(2 * len(base) // len(rows) + 15)]
        independent(F)
        W = [[D[name][i] for name in own] for D in states for i in rows]
        if (found := rank(W, p)) != len(base):
            wrong.add(f"the rank is {found}, not {len(base)}")
        K = [{name: F.value(c) for name, c in b["coefficients"].items()} for b in base]
        for name in sorted(own_names):
            of_base = [(o, k[name]) for o, k in zip(own, K, strict=True) if k.get(name)]
            for D in states:
                for i in rows:
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
        claim = json.loads(file.read_text("utf-8"), object_pairs_hook=once)
        wrong = check(claim)
    except RefutedError as what:
        return 1, f"refuted: {what}"
    except NotJudgedError as what:
        return 2, f"not judged: {ascii(str(what))[1:-1][:200]}"
    except Exception as what:  # whatever is wrong with a file, it is no certificate
        return 2, f"no certificate: {ascii(str(what))[1:-1][:200] or type(what).__name__}"
    if wrong:
        return 1, f"{claim['robot']}: refuted: {'; '.join(wrong[:5])}"
    return 0, f"{claim['robot']}: verified: rank {claim['rank']} and every formula"


if __name__ == "__main__":
    status, text = main(Path(sys.argv[1]))
    print(text)
    sys.exit(status)
