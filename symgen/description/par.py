"""Reader of SYMORO's `.par` files; notes list the data that a Robot cannot store.

    (* Robotname = 'arm' *)   NL = 2   NJ = 2   NF = 2
    Type = 0 serial | 1 tree | 2 closed loops
    ant = {0,1}   sigma = {0,0}   b, d, r, gamma, alpha, mu, theta : NF entries;
    theta_j of a revolute joint is th1, t1 or q1 (+ constant)
    XX ... M, IA, FV, FS : NL entries, a symbol, a number or 0;  G : acceleration of gravity in
    frame 0, as in a robot file

Links are 1 .. NL, cut joints NL+1 .. NJ; the fixed frame NJ+k coincides with cut joint NL+k, so
that NF = 2 NJ - NL. Comments are allowed everywhere, a list may extend over several lines, keys may
be in upper or lower case, and Pi and ^ are allowed as in Mathematica. The format has no field for
the value of a symbol. Values are given in comments, which SYMORO ignores: `(* constants: D3 = 0.45,
g = 9.81 *)`, likewise `values` and `start 1`.

W. Khalil, D. Creusot, SYMORO+: a system for the symbolic modelling of robots, Robotica 15, 1997.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

from symgen.description.angles import SNAP, Angles
from symgen.description.expression import ONE, PI, Expression, twelfths
from symgen.description.fields import located
from symgen.description.grammar import parse
from symgen.description.parts import ANGLES, GEOMETRY
from symgen.description.robot import (
    FIXED,
    INERTIAL,
    PRISMATIC,
    REVOLUTE,
    Element,
    Frame,
    Loop,
    Path,
    Robot,
    parameter,
)
from symgen.errors import DescriptionError, ExpressionError

MAX_BYTES, MAX_FRAMES = 200_000, 200

GEOMETRIC = ("ant", "sigma", "b", "d", "r", "gamma", "alpha", "mu", "theta")
COUNTS = ("NF", "NL", "NJ", "Type", "is_mobile")
LISTS = {
    **{name: name for name in INERTIAL},
    "IA": "Ia",
    "FV": "FV",
    "FS": "FS",
}  # name in the file: family
WRENCH = ("FX", "FY", "FZ", "CX", "CY", "CZ")
BASE_MOTION = ("W0", "WP0", "V0", "VP0")
NAMES_ONLY = (
    "QP",
    "QDP",
    "GAM",
)  # names of rates, accelerations and torques: nothing of the mechanism
KEYS = {
    key.lower(): key
    for key in (
        *GEOMETRIC,
        *COUNTS,
        *LISTS,
        *WRENCH,
        *BASE_MOTION,
        *NAMES_ONLY,
        "G",
        "Z",
        "eta",
        "k",
    )
}

_ENTRY = re.compile(r"\s*([A-Za-z_]\w{0,39})\s*=\s*(\{[^{}=]*\}|[^\s{};=]+)\s*;?", re.ASCII)
_IDENTITY = "1000010000100001"


@dataclass
class _Par:
    """The entries of a `.par` file as text, with their line numbers.

    Attributes
    ----------
    angles : Angles
        Angles near multiples of pi/12.
    name : str
        Name of the robot, from a comment.
    lists : mapping
        Entries of each key, each with its line.
    numbers : mapping
        Tables in the comments, by name: constants, values, start 1, ...
    notes : list of str
        Sentences on values that were read differently from the file.
    not_read : list of str
        Parts of the file that were left out although they change the torques.
    """

    angles: Angles

    name: str = ""
    lists: dict[str, list[tuple[str, int]]] = field(default_factory=dict)
    numbers: dict[str, dict[str, float]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    not_read: list[str] = field(default_factory=list)

    def line(self, path: Path) -> int:
        """Find the line of the `.par` file that defines a field of the Robot, given by its path of
        keys.
        """
        key = KEYS.get(str(path[-1]).lower() if path else "", "ant")
        items = self.lists.get(key) or [("", 1)]
        j = path[1] if len(path) > 1 and isinstance(path[1], int) else 1
        return items[min(j, len(items)) - 1][1]


def read_par(
    content: bytes, file: str, constants: Mapping[str, float] | None = None, *, exact: bool = False
) -> tuple[Robot, tuple[str, ...]]:
    """Return the Robot of a `.par` file, and notes on data that were changed or left out.

    Parameters
    ----------
    content : bytes
        Content of the file.
    file : str
        Name of the file.
    constants : mapping, SI and rad
        Values of the geometric symbols and of gravity. They replace values in a comment of the
        file.
    exact : bool
        As in `symgen.load_robot`.

    Raises
    ------
    DescriptionError
        The file is no `.par` file, describes no robot, or has a symbol without value; the message
        names file and line.
    """
    par = _Par(Angles(exact))
    with located(file, par.line):
        _scan(_text(content), par)
        robot = _robot(par, dict(constants or {}), file, hashlib.sha256(content).hexdigest())
    angles, notes = par.angles.report(file)
    robot = replace(robot, angles=angles, not_read=tuple(par.not_read))
    return robot, (*par.notes, *notes)


def _text(content: bytes) -> str:
    if len(content) > MAX_BYTES:
        raise DescriptionError(
            f"the file has more than {MAX_BYTES} bytes; a .par file has a few thousand", line=1
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")  # of older programs


def _scan(text: str, par: _Par) -> None:
    """Read the comments and the entries of a `.par` file from its text, and store them in `par`."""
    text = _without_comments(text, par)
    position, end = 0, len(text.rstrip())
    while position < end:
        entry = _ENTRY.match(text, position)
        if entry is None:
            start = position + len(text[position:]) - len(text[position:].lstrip())
            line = text.count("\n", 0, start) + 1
            raise DescriptionError(
                (
                    f"found {text[start : start + 30].splitlines()[0]!r}; expected `name = value` "
                    "or `name = {a,b}`"
                ),
                line=line,
            )
        key, first = (
            KEYS.get(entry.group(1).lower(), entry.group(1)),
            text.count("\n", 0, entry.start(2)) + 1,
        )
        if key in par.lists:
            raise DescriptionError(
                f"{key} is given twice (first on line {par.lists[key][0][1]}); keep one", line=first
            )
        if key not in KEYS.values():
            par.notes.append(f"line {first}: key {key} is not read")
        items, line = [], first
        for item in entry.group(2).strip("{}").split(","):
            items.append(
                (item.strip(), line + len(item[: len(item) - len(item.lstrip())].splitlines()[1:]))
            )
            line += item.count("\n")
        par.lists[key] = items
        position = entry.end()


def _without_comments(text: str, par: _Par) -> str:
    """Replace the comments in the text of a `.par` file by blanks, and store their content in
    `par`.

    The text is scanned once, however many comments it opens.
    """

    def blank(comment: re.Match[str]) -> str:
        line = text.count("\n", 0, comment.start()) + 1
        if not comment["end"]:
            raise DescriptionError("a comment (* opens and does not end; add *)", line=line)
        _comment(comment["text"].strip(), line, par)
        return re.sub(r"[^\n]", " ", comment[0])

    return re.sub(r"\(\*(?P<text>.*?)(?P<end>\*\)|\Z)", blank, text, flags=re.DOTALL)


def _comment(text: str, line: int, par: _Par) -> None:
    if named := re.fullmatch(r"Robotname\s*=\s*'([^']*)'", text):
        par.name = named.group(1)
    elif numbers := re.fullmatch(r"(constants|values|start \d{1,3}):(.*)", text, re.DOTALL):
        table = par.numbers.setdefault(numbers.group(1), {})
        for item in filter(str.strip, numbers.group(2).split(",")):
            name, _, value = (part.strip() for part in item.partition("="))
            try:
                table[name] = float(_expression(value, line))
            except (KeyError, ValueError, OverflowError, ZeroDivisionError) as error:
                raise DescriptionError(
                    f"{numbers.group(1)}: {item.strip()[:60]!r}; expected name = number", line=line
                ) from error


def _expression(text: str, line: int) -> Expression:
    """Parse an expression of a `.par` file, whose grammar extends that of robot files.

    Pi, ^, [ ] and function names with a capital letter are also allowed.
    """
    text = re.sub(r"\b(Pi|PI|Sin|Cos|Tan|Sqrt)\b", lambda word: word.group().lower(), text)
    text = re.sub(r"\b(theta|th|t|q)\((\d+)\)", r"\1\2", text)
    try:
        return parse(text.replace("^", "**").replace("[", "(").replace("]", ")"))
    except ExpressionError as error:
        raise DescriptionError(str(error), line=line) from error


def _count(par: _Par, key: str, default: int | None = None) -> int:
    return _whole(_list(par, key, 1, None if default is None else str(default))[0], key)


def _whole(item: tuple[str, int], key: str) -> int:
    text, line = item
    if not re.fullmatch(r"[0-9]{1,6}", text):
        raise DescriptionError(f"{key}: found {text[:30]!r}; expected a whole number", line=line)
    return int(text)


def _list(par: _Par, key: str, n: int, default: str | None = None) -> list[tuple[str, int]]:
    if key not in par.lists:
        if default is None:
            raise DescriptionError(
                f"{key} is missing; add `{key} = {{...}}` with {n} entries", line=1
            )
        return [(default.format(j), 1) for j in range(1, n + 1)]
    items = par.lists[key]
    if len(items) != n:
        raise DescriptionError(f"{key} has {len(items)} entries; expected {n}", line=items[0][1])
    return items


def _robot(par: _Par, constants: dict[str, float], file: str, sha256: str) -> Robot:
    NL, NJ = _count(par, "NL"), _count(par, "NJ")
    NF, kind = _count(par, "NF", 2 * NJ - NL), _count(par, "Type", 0)
    if not (0 < NL <= NJ and NF == 2 * NJ - NL and NF <= MAX_FRAMES):
        raise DescriptionError(
            (
                f"NL = {NL}, NJ = {NJ}, NF = {NF}; expected NL <= NJ and NF = 2 NJ - NL, at most "
                f"{MAX_FRAMES}"
            ),
            line=par.lists["NL"][0][1],
        )
    if kind not in (0, 1, 2) or (kind == 2) != (NJ > NL):
        raise DescriptionError(
            (
                f"Type = {kind} with NL = {NL}, NJ = {NJ}; expected 0 serial or 1 tree with NJ = "
                "NL, 2 closed loops with NJ > NL"
            ),
            line=par.lists["NL"][0][1],
        )
    if par.lists.get("is_mobile", [("0", 1)])[0][0] not in ("0", "False", "false"):
        raise DescriptionError(
            "is_mobile: a base that moves is not supported; expected 0",
            line=par.lists["is_mobile"][0][1],
        )
    frames = _frames(par, NF, loops=kind == 2)
    gravity = [_expression(*item) for item in _list(par, "G", 3, "0")]
    used = {s for f in frames for key in GEOMETRY for s in getattr(f, key).symbols}.union(
        *(e.symbols for e in gravity)
    )
    numbers = {**par.numbers.get("constants", {}), **constants}
    if missing := sorted(s for s in used - set(numbers) if not re.fullmatch(r"q\d+", s)):
        example = ", ".join(f"{s} = ..." for s in missing)
        raise DescriptionError(
            (
                f"no value of {', '.join(missing)}; add a line (* constants: {example} *), or "
                f"convert with --constant {missing[0]}=..."
            ),
            line=1,
        )
    values, massless, keys = _parameters(par, NL, {f.j for f in frames if f.sigma == FIXED})
    _note_rest(par)
    return Robot(
        name=re.sub(r"\W", "_", par.name or file.rpartition(".")[0], flags=re.ASCII),
        frames=frames,
        gravity=(gravity[0], gravity[1], gravity[2]),
        constants={name: value for name, value in numbers.items() if name in used},
        elements=tuple(
            Element(family, kind, {j: {j: ONE} for j in keys[family]}, {})
            for family, kind in (("Ia", "inertia"), ("FV", "viscous"), ("FS", "coulomb"))
            if keys[family]
        ),
        loops=tuple(Loop(k, k + NJ - NL, _start(par, k - NL)) for k in range(NL + 1, NJ + 1)),
        massless=frozenset(massless),
        values=values,
        file=file,
        sha256=sha256,
    )


def _start(par: _Par, k: int) -> dict[int, float]:
    table = par.numbers.get(f"start {k}", {})
    if wrong := [name for name in table if not re.fullmatch(r"q[0-9]{1,4}", name)]:
        raise DescriptionError(
            f"start {k}: {wrong[0][:30]!r} is no joint; expected q1, q2, ...", line=1
        )
    return {int(name[1:]): value for name, value in table.items()}


def _frames(par: _Par, NF: int, *, loops: bool) -> tuple[Frame, ...]:
    defaults = {"b": "0", "gamma": "0", "mu": "1"}
    rows = {key: _list(par, key, NF, defaults.get(key)) for key in GEOMETRIC}
    frames: list[Frame] = []
    variables: list[str] = []
    free: list[int] = []
    for k in range(NF):
        j, ant, sigma, mu = k + 1, *(_whole(rows[key][k], key) for key in ("ant", "sigma", "mu"))
        if sigma not in (REVOLUTE, PRISMATIC, FIXED):
            raise DescriptionError(
                f"joint {j}: sigma = {sigma}; expected 0 revolute, 1 prismatic or 2 fixed",
                line=rows["sigma"][k][1],
            )
        e = {key: _expression(*rows[key][k]) for key in GEOMETRY}
        for key in ANGLES:
            e[key] = _rounded(e[key], f"{key} of frame {j} (line {rows[key][k][1]})", par)
        moved = {REVOLUTE: "theta", PRISMATIC: "r"}.get(sigma)
        if moved is not None:
            variable = _variable(e[moved], j, moved, rows[moved][k][1])
            variables.append(variable)
            e[moved] = e[moved].substitute({variable: Expression.symbol(f"q{j}")})
            if not mu and not loops:
                mu = 1
                free.append(j)
        frames.append(Frame(j, ant, sigma, mu if moved else 0, **e))
    if free:
        par.notes.append(
            f"mu = 0 of joints {', '.join(map(str, free))} read as actuated: there is no loop that "
            "could move them"
        )
    for f in frames:
        for key in GEOMETRY:
            if shared := (getattr(f, key).symbols - {f.q}) & set(variables):
                raise DescriptionError(
                    (
                        f"{key}{f.j}: {', '.join(sorted(shared))} is the variable of a joint; "
                        "expected constants"
                    ),
                    line=rows[key][f.j - 1][1],
                )
    return tuple(frames)


def _variable(e: Expression, j: int, key: str, line: int) -> str:
    """Find the joint variable in the expression of theta_j or r_j: th1, t1, theta1, q1 or r1.

    Another name is accepted if the expression is just this symbol.
    """
    names = {"theta": (f"th{j}", f"t{j}", f"theta{j}", f"q{j}"), "r": (f"r{j}", f"q{j}")}[key]
    usual = sorted((s for s in e.symbols if s.lower() in names), key=lambda s: s not in names)
    alone = [s for s in e.symbols if e == Expression.symbol(s)]
    if not (usual or alone):
        raise DescriptionError(
            (
                f"{key}{j} = {e}; expected the joint variable {', '.join(names)}, alone or plus a "
                "constant"
            ),
            line=line,
        )
    return (usual or alone)[0]


def _rounded(e: Expression, name: str, par: _Par) -> Expression:
    """Replace a decimal that approximates a multiple of pi/12 by the exact multiple."""
    c = e.terms.get(())
    if c is None or len(e.terms) > 2 or not twelfths(float(c), SNAP):
        return e
    k = par.angles.twelfths(float(c), name)
    return e if k is None else e - c + PI * Fraction(k, 12)


def _parameters(
    par: _Par, NL: int, fixed: set[int]
) -> tuple[dict[str, float], set[int], dict[str, list[int]]]:
    """Return the parameter values, the massless links, and the joints with Ia, FV or FS.

    A link is massless if its ten inertial parameters are 0 in the file. The joints are listed by
    family (Ia, FV, FS) of parameters that are not 0 in the file.
    """
    values: dict[str, float] = {}
    zero: dict[str, set[int]] = {}
    renamed: list[str] = []
    for key, family in LISTS.items():
        default = key + "{}" if key in INERTIAL else "0"
        zero[family] = set()
        for j, item in enumerate(_list(par, key, NL, default), start=1):
            e, name = _expression(*item), parameter(family, j)
            if not e:
                zero[family].add(j)
            elif e.symbols:
                if str(e).lower() != name.lower():
                    renamed.append(f"{name} (written {e})")
            else:
                values[name] = _value(e, name, item[1])
    if renamed:
        par.notes.append(f"parameters of this format's names: {', '.join(renamed[:20])}")
    massless = set.intersection(*(zero[p] for p in INERTIAL))
    part = sorted(parameter(p, j) for p in INERTIAL for j in zero[p] - massless)
    if part:
        par.notes.append(f"0 in the file, here parameters of value 0: {', '.join(part)}")
        values |= dict.fromkeys(part, 0.0)
    keys = {
        p: [j for j in range(1, NL + 1) if j not in zero[p] | fixed] for p in ("Ia", "FV", "FS")
    }
    present = {parameter(p, j) for p in INERTIAL for j in range(1, NL + 1) if j not in massless}
    present |= {parameter(p, j) for p, joints in keys.items() for j in joints}
    values |= par.numbers.get("values", {})
    return {name: value for name, value in values.items() if name in present}, massless, keys


def _value(e: Expression, name: str, line: int) -> float:
    try:
        return float(e)
    except (ValueError, OverflowError, ZeroDivisionError) as error:
        raise DescriptionError(
            f"{name}: {e} has no finite real value; expected a number or a symbol", line=line
        ) from error


def _note_rest(par: _Par) -> None:
    """Add notes on data in the file that a Robot cannot store, such as external forces."""
    if any(text != "0" for key in WRENCH for text, _ in par.lists.get(key, ())):
        par.not_read.append("forces of the environment (FX ... CZ)")
    for key in (*BASE_MOTION, "eta", "k"):
        if any(text not in ("0", "") for text, _ in par.lists.get(key, ())):
            par.not_read.append(f"{key} (the base rests and joints are rigid)")
    if "Z" in par.lists and "".join(text for text, _ in par.lists["Z"]) != _IDENTITY:
        par.notes.append("Z is not read: all vectors are in frame 0")
