"""Random faults in emitted texts: a sign, an index, a constant, an operator, two exchanged names, a
term or a row that is dropped, a wrong shape; in any function of any text.

    python tests/certify/text_faults.py [COUNT] [SEED]      a table of faults and survivors

A fault is one changed line of a function; tables are read back by `test_tables.py`. Lines that compute nothing (comments,
docstrings, messages of errors, hints) are left alone. A fault that changes no value at all, shown
in EQUIVALENT by a reason, may survive; any other has to be refused.
"""

from __future__ import annotations

import random
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

from certify.printed import evaluated
from octave import has_octave

from symgen.certify.texts import text_check
from symgen.certify.witness import Witness
from symgen.description import load_robot
from symgen.emit.generate import generate_files
from symgen.emit.targets import TARGETS, target_of
from symgen.regroup.regrouping import regroup

ROBOTS = ("tx40", "scara", "sr400", "four_bar", "haptic")
NAME = r"[A-Za-z_]\w*"
ENTRY = r"^(\w+\[[\w, ]+\]|AT\(\w+, \d+\)|\w+\(:, [\d, ]+\)|X\(\d+\))$"
OCTAVE = has_octave()
TERM = re.compile(r" [+-] [^+\-=()\[\],]+?(?= [+-] |;|\s*$|\s+[#/%])")


SAME = (  # changed lines that change no value, and why
    (
        r"(real|int32_t) .*\w\[(\d+\*TILE\]|\d+\]\[3\])",
        "an array with room for more, or a parameter that is a pointer",
    ),
    (r"real tile\[\d+ \+ TILE\]\)", "a parameter that is a pointer"),
    (r"if frame not in range", "which frames are refused, not what a frame gives"),
    (r": float = ", "a default that this function does not read; test_tables.py reads it"),
    (r"reshape\(\d+, -2\)", "NumPy takes any negative size as the one that is left"),
    (r"np\.ndindex\(\d+, 3, 4\)", "the last row of a pose, which is not read there"),
    (
        r"memset\(tile, (1,|0, \d+( \+ |\*)TILE( \+ |\*)sizeof)",
        "lanes of a tile beyond the samples, whose results are not kept",
    ),
    (r"N = len\(states\[[12]\]\)", "states are of one shape, which `_states` checks before"),
    (r"ready = -True", "what is not zero is true"),
    (r"masked = -array", "a plain array is asked for a mask too, and has none"),
    (
        r"range\(0, N, \d+\)|     if N <= |every = int|part = slice\(t, t \+ \d+\)",
        "samples at a time",
    ),
    (r"= -(np\.zeros|ca\.SX\()", "minus zero, where every entry is written"),
    (r"np\.zeros\(\(\*shape, len\(rows\[\d\]\)\)\)", "rows are of one length"),
    (r"VP242 = C5b", "cancels: N342 enters NE332 and NE322, whose difference A holds"),
    (
        r"^haptic\.py +VP24 = C5b\*VSP24$",
        "haptic, torques: the term cancels, they are the same to 2e-16",
    ),
    (r"residual = -0;", "minus zero is zero"),
    (r"twist = \[axis, zeros\(N, 4\)\];", "a column more than is read"),
    (r"^haptic_\w+\.m +VS?P24 = ", "haptic: the term cancels, as in its other texts"),
    (r"^haptic_bias\.m +ZZ2R = ", "haptic: ZZ2R cancels in the bias, to 2e-16"),
)
# Survivors that are no such thing: they change the way to a solution, not what is accepted as one.
WAYS = (
    (
        r"if \(N == (0|2|-1)\)",
        "one state alone goes without a tile; test_c_target.py calls every function with 0, 1, and more",
    ),
    (
        r"^four_bar\.py +closing=\(\(L0, L1, L2, L3\), ",
        "constants of the curvature: accelerations, which a Jacobian does not read",
    ),
    (
        r"^four_bar\.py +L2\)\)\)$",
        "the same of gravity, which reads positions alone",
    ),
    (
        r"^four_bar\.c static const real unit",
        "how long Newton's steps are, and how singular is singular: closure is checked behind them",
    ),
    (
        r"^four_bar\.c +for \(size_t j = 0; j < 2; j\+\+\) {$",
        "reads behind an array, which sanitizers of test_c_loops.py see",
    ),
    (
        r"^haptic\.c +const real c = -constants",
        "haptic: gravity reads C5*C5b + S5*S5b, the cosine of c, alone",
    ),
    (r"m == -TILE", "whole tiles go by a loop of known length: the same numbers"),
    (r"memset\(rate, 1", "bytes of 1 are 7.7e-304, as good as zero"),
    (
        r"^tx40\.py .*twist = \[\*z",
        "a Jacobian's column of a prismatic joint: this robot has none",
    ),
    (r"-?xp\.zeros_like\(T\[|- zero,", "zeros and their opposites are the same numbers"),
    (
        r"steps = -int|np\.abs\(volume\)|np\.interp\(|_newton\(q|= -_closure\(|away = |\(given - s \* away\)",
        "the way of Newton: mode and closure are checked behind it",
    ),
    (
        r"^\S+\.c +real (\w+\[\d+\], )*\w+\[\d+\];",
        "the room of an array: more is never read; less is what sanitizers of test_c_target.py see",
    ),
    (
        r"CLOSED = -sizeof",
        "the tolerance of double precision, which is run; test_c_loops.py closes loops in float",
    ),
    (
        r"^haptic_casadi\S* .*VSP24 = VP23$",
        "haptic: the term cancels, the regressor is the same to 3e-18",
    ),
)


def robot_of(file: str) -> str:
    """Name of the robot of a file; that of a MATLAB file ends with its function."""
    return max((name for name in ROBOTS if file.startswith(name)), key=len)


@dataclass(frozen=True)
class Fault:
    """One changed line."""

    file: str
    target: str
    function: str
    kind: str
    line: int
    old: str
    new: str


@cache
def texts(name: str) -> tuple[Witness, dict[str, tuple[str, str]]]:
    """The witness of a robot, and {file: (target, text)}."""
    regrouping = regroup(load_robot(name))
    files = generate_files(regrouping.robot, targets=tuple(TARGETS), regrouping=regrouping)
    return Witness(regrouping), {file: (target_of(file), text) for file, text in files.items()}


def code_lines(text: str, c: bool) -> Iterator[tuple[str, int, str]]:
    """(function or table, number, line) of lines that compute."""
    inside, quoted, start = (
        "",
        False,
        re.compile(rf"^(?:.*\b)?({NAME})\([^;]*$" if c else rf"^def ({NAME})\("),
    )
    for number, line in enumerate(text.splitlines()):
        ends = c and quoted  # the last line of a comment is none of code
        if c:
            quoted = ("/*" in line or quoted) and "*/" not in line
            if re.match(r"(extern )?const ", line):  # names and values: test_tables.py
                inside = ""
            if (re.match(r"^[a-zKI]", line) and (found := re.search(rf"({NAME})\(", line))) or (
                found := re.search(rf"({NAME})\[\d+\]\[3\] = ", line)
            ):
                inside = found[1]
        else:
            quoted ^= line.count('"""') % 2 == 1
            if found := start.match(line):
                inside = found[1]
            elif line[:1].isalpha():
                inside = ""
        stripped = line.strip()
        idle = r'(#|"""|/\*|def |raise|class |import|from|\) ->|\):|extern)|.*(raise |expected|""")'
        if inside and not (quoted or ends) and stripped and not re.match(idle, stripped):
            yield inside, number, line


def lines_of(text: str, target: str) -> Iterator[tuple[str, int, str]]:
    """(function or table, number, line) of lines that compute, in any language."""
    if target != "matlab":
        yield from code_lines(text, target == "c")
        return
    inside, refusing = "", False
    for number, line in enumerate(text.splitlines()):
        if found := re.match(rf"function .*?({NAME})(\(.*)?$", line):
            inside = found[1]
        # where an error is raised is that of arguments which no robot has
        refusing = line.startswith("if ~") or (refusing and line != "end")
        idle = r"(function |%|end$|model\.| {4}')|if (numel|nargin|~)"
        if inside and line.strip() and not refusing and not re.match(idle, line):
            yield inside, number, line


def turned_sign(line: str, rng: random.Random) -> str:
    places = [
        m for m in re.finditer(r" ([+-]) (?=[\w(])|(?<== )-?(?=[\w(])", line) if "for " not in line
    ]
    if not places:
        return line
    m = rng.choice(places)
    new = {" + ": " - ", " - ": " + ", "-": "", "": "-"}[m[0]]
    return line[: m.start()] + new + line[m.end() :]


def other_index(line: str, rng: random.Random) -> str:
    places = list(re.finditer(r"(?<=[\[\s,(])\d+(?=[\],)])", line)) + list(
        re.finditer(r"(?<=\b[A-Z])\d(?=\d*\b)|(?<=\b[A-Z][A-Z])\d(?=\d*\b)", line)
    )
    if not places:
        return line
    m = rng.choice(places)
    return (
        line[: m.start()]
        + str(int(m[0]) + rng.choice((1, -1)) if int(m[0]) else 1)
        + line[m.end() :]
    )


def other_constant(line: str, rng: random.Random) -> str:
    """2 becomes 3, 0.5 becomes 1.5, a default by 0.1."""
    code, _, value = line.partition(" = ")
    places = list(re.finditer(r"(?<![\w.\[])\d+(\.\d+)?(?![\w.\]])", value))
    if not places:
        return line
    m = rng.choice(places)
    changed = f"{float(m[0]) + 1.0}" if "." in m[0] else str(int(m[0]) + 1)
    return f"{code} = {value[: m.start()]}{changed}{value[m.end() :]}"


def other_operator(line: str, rng: random.Random) -> str:
    """A product becomes a sum, a square a cube, cos sin."""
    places = list(
        re.finditer(
            r"(?<=[\w)])\.\^2|(?<=[\w)])\.\*(?=[\w(])|(?<=[\w)])\*\*2|(?<=[\w)])\*(?=[\w(])|\b(cos|sin)(?=\()",
            line,
        )
    )
    if not places or "**{" in line or "(*" in line:
        return line
    m = rng.choice(places)
    new = {"**2": "**3", "*": " + ", "cos": "sin", "sin": "cos", ".^2": ".^3", ".*": " + "}[m[0]]
    return line[: m.start()] + new + line[m.end() :]


def exchanged(line: str, rng: random.Random) -> str:
    names = sorted({*re.findall(r"\b[A-Z]\w*\b", line.partition(" = ")[2])})
    if len(names) < 2 or re.search(r"\b(\w+)=\1\b", line):  # keywords have no order
        return line
    a, b = rng.sample(names, 2)
    head, mark, rest = line.partition(" = ")
    return head + mark + re.sub(rf"\b({a}|{b})\b", lambda m: b if m[1] == a else a, rest)


def dropped_term(line: str, rng: random.Random) -> str:
    places = list(TERM.finditer(line))
    if not places:
        return line
    m = rng.choice(places)
    return line[: m.start()] + line[m.end() :]


def dropped_row(line: str, rng: random.Random) -> str:
    if re.match(r"\s*([A-Z]\w*\[[\d, ]+\]|AT\(\w+, \d+\)|[A-Z]\w*\(:, [\d, ]+\)) = ", line):
        return re.match(r"\s*", line)[0] + (
            ";" if line.rstrip().endswith(";") or ";  " in line else "pass"
        )
    return line


def wrong_shape(line: str, rng: random.Random) -> str:
    changes = (
        (".T", ""), ("transpose(2, 1, 0)", "transpose(1, 2, 0)"), ("-1)", "-2)"), ("axis=-1", "axis=0"),
        ("axis=1", "axis=0"), ("reshape(-1, ", "reshape("), ("moveaxis(result, -1, 0)", "moveaxis(result, 0, -1)"),
        ("[..., 0]", ""), ("[..., None]", ""), ("(1, 0), (-2, -1)", "(0, 1), (-2, -1)"), ("(1, 0)", "(0, 1)"),
        ("[:, :3", "[:, :2"), ("[:3", "[:2"), ("*start", "*start + 1"),
    )  # fmt: skip
    fitting = [(old, new) for old, new in changes if old in line]
    old, new = rng.choice(fitting) if fitting else ("", "")
    return line.replace(old, new, 1) if old else line


KINDS: tuple[Callable[[str, random.Random], str], ...] = (
    turned_sign, other_index, other_constant, other_operator, exchanged, dropped_term, dropped_row,
    wrong_shape,
)  # fmt: skip


def faults(count: int, seed: int) -> list[Fault]:
    """Random faults, texts, functions and kinds alike; the files of MATLAB are one text."""
    rng, found = random.Random(seed), []
    places: list[tuple[str, list[str]]] = []
    for name in ROBOTS:
        files = [file for file in texts(name)[1] if not file.endswith(".h")]
        places += [(name, [file]) for file in files if not file.endswith(".m")]
        if OCTAVE and (of_matlab := [file for file in files if file.endswith(".m")]):
            places.append((name, of_matlab))
    while len(found) < count:
        name, several = places[len(found) % len(places)]
        file = rng.choice(several)
        target, text = texts(name)[1][file]
        by_function: dict[str, list[tuple[int, str]]] = {}
        for function, number, line in lines_of(text, target):
            by_function.setdefault(function, []).append((number, line))
        function = rng.choice(sorted(by_function))
        number, line = rng.choice(by_function[function])
        kind = rng.choice(KINDS)
        code, _, comment = re.match(r"(.*?)(\s*(?:#|/\*|% ).*)?$", line).group(1, 2, 2)
        new = kind(code, rng) + (comment or "")
        if new != line:
            found.append(Fault(file, target, function, kind.__name__, number, line, new))
    return found


def refused(fault: Fault) -> bool:
    """Whether the certificate refuses a text with the fault."""
    witness, files = texts(robot_of(fault.file))
    lines = files[fault.file][1].splitlines()
    assert lines[fault.line] == fault.old
    lines[fault.line] = fault.new
    beside = {file: text for file, (target, text) in files.items() if target == "matlab"}
    changed = "\n".join(lines) + "\n"
    return not text_check(fault.file, changed, fault.target, witness, beside).valid


def equivalent(fault: Fault) -> str:
    """Why a fault changes no value; empty where it does, or might."""
    (old, new), c = (
        (parts(line, fault.target == "c") for line in (fault.old, fault.new)),
        fault.target,
    )
    text = texts(robot_of(fault.file))[1][fault.file][1]
    body = [line for f, _, line in lines_of(text, c) if f == fault.function]
    if old[0] == new[0] and re.fullmatch(NAME, old[0]):
        below = [
            parts(line, c == "c")
            for f, number, line in lines_of(text, c)
            if f == fault.function and number > fault.line
        ]
        again = [k for k, (left, _) in enumerate(below) if left == old[0]]  # the next loop's own
        reads = " ".join(right for _, right in below[: (again or [None])[0]])
        if (
            c == "c"
            and new[1] == f"-{old[1]}"
            and not re.search(rf"\b{old[0]}\b", reads.replace(f"cos({old[0]})", ""))
        ):
            return f"{old[0]} is read by cosines alone"
        if not any(
            re.search(rf"\b{old[0]}\b", parts(line, fault.target == "c")[1]) for line in body
        ):
            return f"{old[0]} is never read"
        names = {*re.findall(NAME, old[1])} | {*re.findall(NAME, new[1])}
        rng = random.Random(3)
        try:
            values = [{n: rng.uniform(0.5, 2) for n in names} for _ in range(3)]
            a, b = ([evaluated([("x", e)], v)["x"] for v in values] for e in (old[1], new[1]))
            if all(abs(x - y) < 1e-12 * abs(x) for x, y in zip(a, b, strict=True)):
                return "the same expression in another order"
        except (SyntaxError, ValueError, KeyError, ZeroDivisionError, TypeError):  # or a list
            pass
    if fault.old.strip().startswith("constants = ["):  # the defaults of MATLAB
        defaults = [re.findall(r"[\d.]+", line) for line in (fault.old, fault.new)]
        changed = [k for k, (x, y) in enumerate(zip(*defaults, strict=True), 1) if x != y]
        if not any(f"constants(:, {k})" in line for k in changed for line in body):
            return "the default of a constant that this function does not read"
    return next(
        (reason for pattern, reason in SAME if re.search(pattern, f"{fault.file} {fault.new}")), ""
    )


def parts(line: str, c: bool) -> tuple[str, str]:
    """What is assigned, and the expression."""
    line = re.sub(r"(#|/\*|% ).*", "", line).strip().rstrip(";")
    left, _, right = line.removeprefix("const real ").partition(" = ")
    return re.sub(ENTRY, "entry", left), right.replace("np.", "").replace("ca.", "").replace(
        ".*", "*"
    ).replace("./", "/").replace(".^", "**")


def main() -> None:
    count, seed = (
        (int(x) for x in (*sys.argv[1:], "300", "1")[:2]) if len(sys.argv) > 2 else (300, 1)
    )
    survivors = 0
    ways = dict.fromkeys((reason for _, reason in WAYS), 0)
    for k, fault in enumerate(faults(count, seed)):
        if not refused(fault):
            reason = equivalent(fault)
            way = next(
                (why for pattern, why in WAYS if re.search(pattern, f"{fault.file} {fault.new}")),
                "",
            )
            if way and not reason:
                ways[way] += 1
                reason = f"SURVIVES, {way}"
            survivors += not reason
            print(
                f"{k}: {reason or 'SURVIVES'}: {fault.file} {fault.function} {fault.kind} line {fault.line + 1}\n   {fault.old}\n   {fault.new}",
                flush=True,
            )
    print(f"{survivors} of {count} faults survive, beside {ways}")


if __name__ == "__main__":
    main()
