"""Random planar loops of one and two degrees of freedom, with lengths as numbers or as constants:
four-bars, kites, parallelograms in either mode, sliders,
slotted levers, jacks, five-bars, a six-bar, and some of them on a turret.

A kind and a seed give one robot; its `start` is closed here by plane trigonometry and chosen away
from dead points.
"""

from __future__ import annotations

import cmath
import re
from collections.abc import Mapping

import numpy as np

from symgen.description import Robot, parse_robot

ELEMENTS = """elements:
  Ia: {kind: inertia, along: all}
  FV: {kind: viscous, along: all}
  FS: {kind: coulomb, along: all}
  OFFSET: {kind: offset, along: all}
"""
SIDES = {  # ground, crank, coupler, rocker
    "four-bar": "ABCD",
    "kite beside the ground": "AABB",
    "kite across the ground": "ABBA",
    "rhombus": "AAAA",
    "parallelogram": "ABAB",
    "antiparallelogram": "ABAB",
    "three equal sides": "ABBB",
}
KINDS = (
    *SIDES,
    "slider-crank",
    "offset slider-crank, driven by the slide",
    "isosceles slider-crank",
    "slotted lever",
    "jack",
    "five-bar",
    "symmetric five-bar",
    "five-bar on slides",
    "six-bar",
    "four-bar on a turret",
    "kite on a turret",
)
TURRET = "  1: {ant: 0, sigma: 0, mu: 1, alpha: 0, d: 0, theta: q1, r: 0}"


def random_loop(
    kind: str, seed: int, *, numbers: bool | None = None, behind: int = 0, named: bool = False
) -> Robot:
    """The robot of a kind and a seed, `behind` that many motors which turn it as a whole; lengths
    are numbers for odd seeds unless said. `named` gives the frames of these motors constants, too.
    """
    rng = np.random.default_rng([57, KINDS.index(kind), seed])
    for _ in range(300):
        made = _made(kind, rng)
        if made is not None:
            break
    else:
        raise AssertionError(kind)
    frames, loops, values, massless = made
    numbers = bool(seed % 2) if numbers is None else numbers
    constants = {"g": 9.81} if numbers else {"g": 9.81} | dict(values)
    text = "\n".join(frames)
    if numbers:
        for name, x in values.items():
            text = text.replace(f" {name},", f" {x},").replace(f"-{name},", f"-{x},")
    gravity = "[0, 0, -g]" if "turret" in kind else "[0, -g, 0]"
    if behind:
        gravity = "[0, -g, 0]"
        text, loops = (_shifted(part, behind) for part in (text, loops))
        massless = [j + behind for j in massless]
        motors = "\n".join(_turning(j, rng) for j in range(1, behind + 1))
        if named:
            decimal = r"-?\d+\.\d+"
            names = {f"H{k}": float(x) for k, x in enumerate(re.findall(decimal, motors))}
            unused, constants = iter(names), constants | names
            motors = re.sub(decimal, lambda _: next(unused), motors)
        text = f"{motors}\n{text}"
    listed = ", ".join(f"{name}: {x}" for name, x in constants.items())
    bare = f"massless: {sorted(massless)}\n" if massless else ""
    head = f"symgen: 1\nname: loop\ngravity: {gravity}\nconstants: {{{listed}}}\nframes:\n"
    return parse_robot(f"{head}{text}\nloops:\n{loops}\n{bare}{ELEMENTS}".encode(), "loop.yaml")


def _shifted(text: str, by: int) -> str:
    """The numbers of frames and joints of rows and loops, all of them `by` larger."""
    number = r"(\bq|\bant: |\bcut: |\btwin: |(?m:^)  )(\d+)"
    return re.sub(number, lambda m: f"{m[1]}{int(m[2]) + by}", text)


def _turning(j: int, rng: np.random.Generator) -> str:
    """A hinge before the loop, its axis at any angle to the one before."""
    gamma, alpha, b, d, r = (round(float(x), 2) for x in rng.uniform(-1.5, 1.5, 5))
    return (
        f"  {j}: {{ant: {j - 1}, sigma: 0, mu: 1, gamma: {gamma}, b: {b}, alpha: {alpha}, d: {d}, "
        f"theta: q{j}, r: {r}}}"
    )


Made = tuple[list[str], str, Mapping[str, float], list[int]]


def _length(rng: np.random.Generator, low: float = 0.2, high: float = 0.6) -> float:
    return round(float(rng.uniform(low, high)), int(rng.choice([3, 5])))


def _meeting(a: complex, b: complex, l: float, m: float, sign: int) -> complex | None:
    """Where circles of radius l about a and m about b meet, well away from touching."""
    d = abs(b - a)
    x = (d * d + l * l - m * m) / (2 * d)
    if d < 0.05 or l * l - x * x < 0.02 * l * l:
        return None
    return a + (b - a) / d * (x + sign * 1j * (l * l - x * x) ** 0.5)


def _angle(z: complex) -> float:
    return cmath.phase(z)


def _start(q: Mapping[int, float]) -> str:
    return "{" + ", ".join(f"q{j}: {x:.6f}" for j, x in q.items()) + "}"


def _hinge(j: int, ant: int, d: str, mu: int = 0, alpha: str = "0") -> str:
    return f"  {j}: {{ant: {ant}, sigma: 0, mu: {mu}, alpha: {alpha}, d: {d}, theta: q{j}, r: 0}}"


def _fixed(j: int, ant: int, d: str) -> str:
    return f"  {j}: {{ant: {ant}, sigma: 2, mu: 0, alpha: 0, d: {d}, theta: 0, r: 0}}"


def _slide(j: int, ant: int, d: str, mu: int) -> str:
    """Along x of frame `ant`, at the height d."""
    return (
        f"  {j}: {{ant: {ant}, sigma: 1, mu: {mu}, gamma: pi/2, b: 0, alpha: pi/2, d: {d}, "
        f"theta: 0, r: q{j}}}"
    )


def _made(kind: str, rng: np.random.Generator) -> Made | None:
    if kind in SIDES or kind.endswith("turret"):
        return _four_bar(kind, rng)
    if "slider" in kind:
        return _slider(kind, rng)
    if kind == "slotted lever":
        return _slotted(rng)
    if kind == "jack":
        return _jack(rng)
    if kind == "six-bar":
        return _six_bar(rng)
    return _five_bar(kind, rng)


def _four_bar(kind: str, rng: np.random.Generator) -> Made | None:
    on = kind.endswith("turret")
    sides = (
        SIDES[kind.removesuffix(" on a turret")]
        if kind.startswith("four")
        else SIDES.get(kind, "AABB")
    )
    values = {name: _length(rng) for name in dict.fromkeys(sides)}
    L = [values[name] for name in sides]
    names = [f"L{name}" for name in sides]
    q1, sign = float(rng.uniform(0.5, 2.4)), int(rng.choice([1, -1]))
    A, D = L[1] * cmath.exp(1j * q1), complex(L[0])
    B = _meeting(A, D, L[2], L[3], sign)
    if B is None:
        return None
    linear = abs(_angle((B - A) / (L[2]))) < 1e-9
    if kind in ("parallelogram", "antiparallelogram") and linear != (kind == "parallelogram"):
        return None
    if abs(((B - A) / (B - D)).imag) < 0.3 or (kind == "kite across the ground" and abs(B) < 0.05):
        return None
    if sides == "ABBA" and abs(B - 0) < 0.05:
        return None
    q = {1: q1, 2: _angle((B - A) / A), 3: _angle(B - D), 4: 0.0}
    q[4] = q[3] - q[1] - q[2]
    k = int(on)
    frames = [TURRET] if on else []
    base = "pi/2" if on else "0"
    frames += [
        _hinge(1 + k, k, "0", 1, base),
        _hinge(2 + k, 1 + k, names[1]),
        _hinge(3 + k, k, names[0], 0, base),
        _hinge(4 + k, 2 + k, names[2]),
        _fixed(5 + k, 3 + k, names[3]),
    ]
    loops = (
        f"  - {{cut: {4 + k}, twin: {5 + k}, start: {_start({j + k: x for j, x in q.items()})}}}"
    )
    massless = [int(rng.integers(2, 4)) + k] if rng.random() < 0.2 else []
    return frames, loops, {f"L{name}": x for name, x in values.items()}, massless


def _slider(kind: str, rng: np.random.Generator) -> Made | None:
    L1 = _length(rng)
    L2 = L1 if kind.startswith("isosceles") else _length(rng)
    e = _length(rng, 0.05, 0.15) if kind.startswith("offset") else 0.0
    q1, driven = float(rng.uniform(0.4, 1.2)), kind.endswith("slide")
    A = L1 * cmath.exp(1j * q1)
    if abs(A.imag - e) > 0.9 * L2:
        return None
    x = A.real + (L2**2 - (A.imag - e) ** 2) ** 0.5
    B = complex(x, e)
    if abs(((B - A) / A).imag) < 0.2 or abs((B - A).real) < 0.05:
        return None
    q = {1: q1, 2: _angle((B - A) / A), 3: x, 4: _angle(B - A) - np.pi / 2}
    frames = [
        _hinge(1, 0, "0", int(not driven)),
        _hinge(2, 1, "LA"),
        _slide(3, 0, "E" if e else "0", int(driven)),
        _hinge(4, 3, "0", 0, "-pi/2"),
        _fixed(5, 2, "LA" if kind.startswith("isosceles") else "LB"),
    ]
    values = (
        {"LA": L1} | ({} if kind.startswith("isosceles") else {"LB": L2}) | ({"E": e} if e else {})
    )
    return frames, f"  - {{cut: 4, twin: 5, start: {_start(q)}}}", values, []


def _slotted(rng: np.random.Generator) -> Made | None:
    L1, L0 = _length(rng), _length(rng)
    q1 = float(rng.uniform(0.5, 2.4))
    A = L1 * cmath.exp(1j * q1)
    lever = A - L0
    q = {1: q1, 2: _angle(lever), 3: abs(lever), 4: q1 - _angle(lever) - np.pi / 2}
    if abs(lever) < 0.1:
        return None
    frames = [
        _hinge(1, 0, "0", 1),
        _hinge(2, 0, "LB"),
        _slide(3, 2, "0", 0),
        _hinge(4, 3, "0", 0, "-pi/2"),
        _fixed(5, 1, "LA"),
    ]
    return frames, f"  - {{cut: 4, twin: 5, start: {_start(q)}}}", {"LA": L1, "LB": L0}, []


def _jack(rng: np.random.Generator) -> Made | None:
    """A boom on a jack, a second boom on its end on another one: two degrees of freedom, lengths in
    millimetres for some.
    """
    unit = float(rng.choice([1.0, 0.001]))
    a, b, c, d, L = (round(_length(rng) * unit, 8) for _ in range(5))
    q1, q4 = float(rng.uniform(0.6, 1.4)), float(rng.uniform(-1.6, -0.8))
    tip = b * cmath.exp(1j * q1)
    jack = tip - a
    elbow = -c + d * 0  # foot of the second jack on the first boom, behind its end
    second = d * cmath.exp(1j * q4) - elbow
    if abs(jack) < 0.1 * unit or abs(second) < 0.1 * unit:
        return None
    q = {
        1: q1,
        2: _angle(jack) - np.pi / 2,
        3: abs(jack),
        4: q4,
        5: _angle(second) - np.pi / 2,
        6: abs(second),
    }
    q |= {7: q[1] - q[2], 9: q[4] - q[5]}
    frames = [
        _hinge(1, 0, "0"),
        _hinge(2, 0, "LA"),
        "  3: {ant: 2, sigma: 1, mu: 1, alpha: -pi/2, d: 0, theta: 0, r: q3}",
        _hinge(4, 1, "L"),
        "  5: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: LC, theta: q5, r: 0}",
        "  6: {ant: 5, sigma: 1, mu: 1, alpha: -pi/2, d: 0, theta: 0, r: q6}",
        _hinge(7, 3, "0", 0, "pi/2"),
        _fixed(8, 1, "LB"),
        _hinge(9, 6, "0", 0, "pi/2"),
        _fixed(10, 4, "LD"),
    ]
    loops = f"  - {{cut: 7, twin: 8, start: {_start({j: q[j] for j in (1, 2, 3, 7)})}}}\n"
    loops += f"  - {{cut: 9, twin: 10, start: {_start({j: q[j] for j in (4, 5, 6, 9)})}}}"
    values = {"LA": a, "LB": b, "LC": round(L - c, 8), "LD": d, "L": L}
    return (frames, loops, values, []) if values["LC"] > 0.05 * unit else None


def _five_bar(kind: str, rng: np.random.Generator) -> Made | None:
    L0, L1, L2, L3, L4 = (_length(rng) for _ in range(5))
    slides = kind.endswith("slides")
    names = ["L0", "L1", "L2", "L3", "L4"]
    if kind.startswith("symmetric"):
        L3, L4, names = L1, L2, ["L0", "L1", "L2", "L1", "L2"]
    q1, q3 = float(rng.uniform(1.6, 2.4)), float(rng.uniform(0.6, 1.4))
    if slides:  # carriages on the ground line carry the rods
        A, B = (
            complex(-round(float(rng.uniform(0.05, 0.2)), 3), 0),
            complex(round(float(rng.uniform(0.1, 0.3)), 3), L0 / 4),
        )
    else:
        A, B = L1 * cmath.exp(1j * q1), L0 + L3 * cmath.exp(1j * q3)
    C = _meeting(A, B, L2, L4, int(rng.choice([1, -1])))
    if C is None:
        return None
    if slides:
        q = {1: A.real, 2: _angle(C - A) - np.pi / 2, 3: B.real, 4: _angle(C - B) - np.pi / 2}
        q[5] = q[4] - q[2]
        frames = [
            _slide(1, 0, "0", 1),
            _hinge(2, 1, "0", 0, "-pi/2"),
            _slide(3, 0, "L1", 1),
            _hinge(4, 3, "0", 0, "-pi/2"),
        ]
        values = {"L1": L0 / 4, "L2": L2, "L4": L4}
    else:
        q = {1: q1, 2: _angle((C - A) / A), 3: q3, 4: _angle((C - B) / (B - L0))}
        q[5] = q[3] + q[4] - q[1] - q[2]
        frames = [
            _hinge(1, 0, "0", 1),
            _hinge(2, 1, names[1]),
            _hinge(3, 0, "L0", 1),
            _hinge(4, 3, names[3]),
        ]
        values = dict(zip(names, (L0, L1, L2, L3, L4), strict=True))
    frames += [_hinge(5, 2, names[2]), _fixed(6, 4, names[4])]
    return frames, f"  - {{cut: 5, twin: 6, start: {_start(q)}}}", values, []


def _six_bar(rng: np.random.Generator) -> Made | None:
    """Watt's chain: a four-bar whose rocker drives a second one."""
    L = [_length(rng) for _ in range(8)]
    q1 = float(rng.uniform(0.5, 2.4))
    A, D = L[1] * cmath.exp(1j * q1), complex(L[0])
    B = _meeting(A, D, L[2], L[3], int(rng.choice([1, -1])))
    if B is None or abs(((B - A) / (B - D)).imag) < 0.3:
        return None
    E, G = D + L[4] * (B - D) / L[3], complex(L[5])
    H = _meeting(E, G, L[6], L[7], int(rng.choice([1, -1])))
    if H is None or abs(((H - E) / (H - G)).imag) < 0.3:
        return None
    q = {
        1: q1,
        2: _angle((B - A) / A),
        3: _angle(B - D),
        5: 0.0,
        6: _angle((H - E) / (B - D)),
        7: _angle(H - G),
    }
    q[5], q[8] = q[3] - q[1] - q[2], q[7] - q[3] - q[6]
    frames = [
        _hinge(1, 0, "0", 1),
        _hinge(2, 1, "L1"),
        _hinge(3, 0, "L0"),
        _fixed(4, 3, "L3"),
        _hinge(5, 2, "L2"),
        _hinge(6, 3, "L4"),
        _hinge(7, 0, "L5"),
        _hinge(8, 6, "L6"),
        _fixed(9, 7, "L7"),
    ]
    loops = f"  - {{cut: 5, twin: 4, start: {_start({j: q[j] for j in (1, 2, 3, 5)})}}}\n"
    loops += f"  - {{cut: 8, twin: 9, start: {_start({j: q[j] for j in (6, 7, 8)})}}}"
    return frames, loops, {f"L{k}": x for k, x in enumerate(L)}, []
