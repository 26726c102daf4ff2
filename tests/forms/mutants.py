"""Wrong equations, one change each: a factor dropped, a sign, an index, a power, a quotient turned,
and in typeset formulas a separator that is missing.

A mutant of an emitted file is run like the file itself. It counts only if its line matters: if
another value of the line is refused too.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import NamedTuple

from forms.printed import Form

from symgen.certify.texts import text_check
from symgen.certify.witness import Witness
from symgen.description import load_robot
from symgen.emit.generate import generate_files
from symgen.regroup.regrouping import regroup

Mutator = Callable[[str, random.Random], str]


def replaced(pattern: str, new: str | Callable[[re.Match[str], random.Random], str]) -> Mutator:
    """Replace one match of a pattern, drawn at random; the text itself where there is none."""
    compiled = re.compile(pattern)

    def mutate(text: str, rng: random.Random) -> str:
        places = [*compiled.finditer(text)]
        if not places:
            return text
        m = rng.choice(places)
        made = m.expand(new) if isinstance(new, str) else new(m, rng)
        return text[: m.start()] + made + text[m.end() :]

    return mutate


def other_digit(m: re.Match[str], rng: random.Random) -> str:
    return m[1] + str((int(m[2]) + rng.randint(1, 8)) % 10) + m[3]


def other_sign(m: re.Match[str], rng: random.Random) -> str:
    return m[0].translate(str.maketrans({"+": "-", "-": "+", "−": "+"}))


NAME = r"[A-Za-z_]\w*(?![\w(.])"
TEXT = {
    "factor dropped": replaced(rf"(?<![\w*./]){NAME}\*(?!\*)|(?<!\*)\*{NAME}(?!\*\*)", ""),
    "sign": replaced(r" [+-] ", other_sign),
    "index": replaced(r"(?<![\w.])([A-Za-z_]+)(\d)(\w*)(?![\w(])", other_digit),
    "power": replaced(rf"(?<![\w.]){NAME}(?!\*\*)|\*\*2", lambda m, _: "**3" if m[0] == "**2" else f"{m[0]}**2"),
    "quotient turned": replaced(rf"(?<=\w)\*(?={NAME})|(?<=\w)/(?=\w)", lambda m, _: "*" if m[0] == "/" else "/"),
}  # fmt: skip
SYMBOL = r"(?:\\d?dot\{q\}|\\mathit\{[^}]*\}|\\[A-Z]?[a-z]+|[A-Za-z]+)_\{[^{}]*\}"
LATEX = {
    "factor dropped": replaced(rf"(?<!\^){SYMBOL}(?:\^\{{\d\}})?\\,|\\,{SYMBOL}(?!\^)", ""),
    "sign": replaced(r" [+-] ", other_sign),
    "index": replaced(r"(_\{[a-z]*)(\d)([^{}]*\})", other_digit),
    "power": replaced(r"\^\{2\}|(?<=\})_\{\w+\}(?!\^)|(?<=[A-Za-z])_\{\w+\}(?!\^)", lambda m, _: "^{3}" if m[0] == "^{2}" else f"{m[0]}^{{2}}"),
    "quotient turned": replaced(r"\\frac\{(\w+)\}\{(\w+)\}", r"\\frac{\2}{\1}"),
    "separator dropped": replaced(r"\\,", " "),
}  # fmt: skip
GAP = '<mo>\u2062</mo><mspace width="0.14em"/>'
ATOM = r"<msub>(?:(?!<msub|</msub).)*</msub>"
MATHML = {
    "factor dropped": replaced(rf"{ATOM}{GAP}|{GAP}{ATOM}", ""),
    "sign": replaced(r'<mo form="infix">[+−]</mo>', lambda m, _: m[0].replace("+", "~").replace("−", "+").replace("~", "−")),
    "index": replaced(r"(<mn>)(\d)(\d*</mn>(?:<mi>R</mi>)?(?:</mrow>)?</msub>)", other_digit),
    "power": replaced(rf"{ATOM}|<mn>2</mn></msu(?:b?sup)>", lambda m, _: f"<msup>{m[0]}<mn>2</mn></msup>" if m[0].startswith("<msub>") else m[0].replace("2", "3")),
    "quotient turned": replaced(r"<mfrac>(<m\w>[^<]*</m\w>)(<m\w>[^<]*</m\w>)</mfrac>", r"<mfrac>\2\1</mfrac>"),
    "separator dropped": replaced(GAP, "<mo>\u2062</mo>"),
}  # fmt: skip


def mutators(form: Form) -> Mapping[str, Mutator]:
    language = form.name.partition(",")[0]
    return {"LaTeX": LATEX, "MathML": MATHML}.get(language, TEXT)


class Mutant(NamedTuple):
    """One wrong text of one equation of a form."""

    kind: str
    label: str
    right: str
    wrong: str
    refused: bool


def of_forms(forms: Sequence[Form], count: int, seed: int) -> Iterator[Mutant]:
    """Mutants of equations that are drawn at random; kinds of mutants take turns."""
    rng, made = random.Random(seed), 0
    forms = [form for form in forms if form.equations]
    kinds = mutators(forms[0])
    while made < count:
        kind = [*kinds][made % len(kinds)]
        for _ in range(300):
            form = rng.choice(forms)
            k = rng.randrange(len(form.equations))
            label, text = form.equations[k]
            wrong = kinds[kind](text, rng)
            if wrong != text:
                break
            kind = rng.choice([*kinds]) if rng.random() < 0.05 else kind  # none has a quotient, say
        made += 1
        yield Mutant(kind, label, text, wrong, form.refuses(k, wrong))


# --- emitted files ---

LINE = re.compile(
    r"^(\s+[^=#]*? = )([-\w\s+*/().]*\b[A-Z]\w*[-\w\s+*/().]*?)(;?(?:\s+(?:#|/[*/]).*)?)$"
)
EMITTED = ("planar_2r", "scara", "four_bar", "haptic")


@cache
def emitted(name: str, file: str) -> tuple[Witness, str]:
    regrouping = regroup(load_robot(name))
    target = "c" if file.endswith(".c") else "numpy"
    return Witness(regrouping), generate_files(
        regrouping.robot, targets=(target,), regrouping=regrouping
    )[file]


def of_files(ending: str, count: int, seed: int) -> Iterator[Mutant]:
    """Mutants of lines that compute something, of files in Python (.py) or C (.c)."""
    rng, made = random.Random(seed), 0
    while made < count:
        name = EMITTED[made % len(EMITTED)]
        file = f"{name}{ending}"
        lines = emitted(name, file)[1].splitlines()
        places = [k for k, line in enumerate(lines) if _computes(line)]
        kind = [*TEXT][rng.randrange(len(TEXT))]
        k = rng.choice(places)
        head, right, tail = LINE.match(lines[k]).groups()  # type: ignore[union-attr]
        wrong = TEXT[kind](right, rng)
        if wrong == right:
            continue

        if ending == ".c":
            wrong = re.sub(rf"({NAME})\*\*([23])", lambda m: "*".join([m[1]] * int(m[2])), wrong)
        changed, another = (
            [*lines[:k], head + value + tail, *lines[k + 1 :]]
            for value in (wrong, f"1.3*({right}) + 0.1")
        )
        is_refused = refused(file, changed)
        if not is_refused and not refused(file, another):
            continue  # the value of this line changes nothing
        made += 1
        yield Mutant(kind, f"{file}, line {k + 1}", lines[k].strip(), wrong, is_refused)


def refused(file: str, lines: Sequence[str]) -> bool:
    """Whether the lines of a file do not compute what Lagrange's equations give."""
    witness, _ = emitted(file.partition(".")[0], file)
    target = "c" if file.endswith(".c") else "numpy"
    return not text_check(file, "\n".join(lines) + "\n", target, witness).valid


def _computes(line: str) -> bool:
    """Whether a line is an assignment of arithmetic to be mutated."""
    match = LINE.match(line)
    return bool(
        match
        and re.search(r"\*| [+-] ", match[2])
        and not re.search(r"\b(if|else|int\d*_t|size_t|for)\b", line)
    )
