r"""One reader of printed formulas: LaTeX, MathML, or the text of robot files.

A formula becomes a row of items, as a person sees them: numbers, names, signs, separators,
brackets, fractions, powers. Braces and rows that nobody sees are no brackets. The row is evaluated
while it is read. Two factors side by side need a separator between them, a sign stands at the start
of a sum, and a name is one of the known names: all else is a ReadError.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from itertools import product
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

NUMBER, NAME, FUNCTION, SIGN, TIMES, OVER, TO, SUP, FRACTION, ROOT, MARK = range(11)


class Item(NamedTuple):
    """What a person sees at one place: its kind, its text, and the rows inside it."""

    kind: int
    text: str = ""
    rows: tuple[list[Item], ...] = ()


class ReadError(ValueError):
    """A row is no formula, or one that can be read in two ways."""


def _real(x: Any) -> Any:
    return np.real(x)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "sqrt": lambda x: np.sqrt(x + 0j),
    "exp": np.exp,
    "tanh": np.tanh,
    "abs": lambda x: np.abs(_real(x)),
    "sign": lambda x: np.sign(_real(x)),
    "max": lambda *x: np.maximum(*map(_real, x)),
    "min": lambda *x: np.minimum(*map(_real, x)),
}
"""Functions of real arguments, of a complex one where a root or a power may be complex."""

# --- names ---

LETTERS = {"π": "pi", "Γ": "Gamma", "α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta"}
LETTERS |= {"ϑ": "vartheta", "θ": "theta", "φ": "phi", "ψ": "psi"}
STEMS = {"Gamma": ("GAM", "Gamma"), "vartheta": ("th",), "q.": ("QP",), "q..": ("QDP",)}
"""What a letter, or a letter with dots, stands for besides itself."""
SMALL = {("I", "a"): "Ia", ("F", "v"): "FV", ("F", "s"): "FS", ("F", "vm"): "FVM"}
SMALL |= {("F", "sm"): "FSM"}
"""Families with a part of their name in the subscript."""
INSIDE = str.maketrans({",": "_", "−": "m", "-": "m", "/": "o", "·": "x"})


def meant(letter: str, subscript: str, known: Collection[str]) -> str:
    """The one known name that a letter with a subscript stands for."""
    stem = letter.rstrip("'")
    small = re.match("[a-z]*", subscript)[0]  # type: ignore[index]
    index, marks = subscript.translate(INSIDE), "b" * letter.count("'")
    stems = [(s, index) for s in STEMS.get(stem, (stem,))]
    if (stem, small) in SMALL:
        stems.append((SMALL[stem, small], index[len(small) :]))
    candidates = {f"{s}{gap}{i}{marks}" for (s, i), gap in product(stems, ("", "_"))}
    found = candidates & {*known}
    if len(found) != 1:
        raise ReadError(
            f"{letter} with the subscript {subscript!r} is {sorted(found) or 'no name'}"
        )
    return found.pop()


# --- values ---


class _Row:
    """A row of items, read from left to right."""

    def __init__(self, items: list[Item], value: Callable[[str, str], Any]) -> None:
        self.items, self.value, self.place = items, value, 0

    def peek(self) -> Item | None:
        return self.items[self.place] if self.place < len(self.items) else None

    def accept(self, kind: int, *texts: str) -> Item | None:
        item = self.peek()
        if item is None or item.kind != kind or (texts and item.text not in texts):
            return None
        self.place += 1
        return item

    def inside(self, items: list[Item]) -> Any:
        return evaluated(items, self.value)

    def sum(self) -> Any:
        sign = self.accept(SIGN)
        total = self.product()
        total = -total if sign and sign.text == "-" else total
        while sign := self.accept(SIGN):
            term = self.product()
            total = total + (term if sign.text == "+" else -term)
        return total

    def product(self) -> Any:
        x = self.factor()
        while self.peek():
            if self.accept(TIMES):
                x = x * self.factor()
            elif self.accept(OVER):
                x = x / self.factor()
            else:
                break
        return x

    def factor(self) -> Any:
        x = self.primary()
        while power := self.accept(SUP):
            x = (x + 0j) ** self.inside(power.rows[0])
        if self.accept(TO):
            minus = self.accept(SIGN, "-")
            n = self.primary()
            x = (x + 0j) ** (-n if minus else n)
        return x

    def primary(self) -> Any:
        item = self.peek()
        if item is None:
            raise ReadError("a factor is missing")
        self.place += 1
        match item.kind:
            case _ if item.kind == NUMBER:
                return complex(float(item.text))
            case _ if item.kind == NAME and item.text == "ⅇ":
                power = self.accept(SUP)
                return np.exp(self.inside(power.rows[0]) if power else 1)
            case _ if item.kind == NAME:
                return self.value(*_letter(item))
            case _ if item.kind == FRACTION:
                return self.inside(item.rows[0]) / self.inside(item.rows[1])
            case _ if item.kind == ROOT:
                return FUNCTIONS["sqrt"](self.inside(item.rows[0]))
            case _ if item.kind == FUNCTION:
                power = self.accept(SUP)
                x = FUNCTIONS[item.text](*self.arguments())
                return (x + 0j) ** self.inside(power.rows[0]) if power else x
            case _ if item.kind == MARK and item.text == "(":
                x = self.sum()
                self.close(")")
                return x
            case _ if item.kind == MARK and item.text == "|":
                x = self.sum()
                self.close("|")
                return FUNCTIONS["abs"](x)
        raise ReadError(f"{item.text!r} where a factor has to stand")

    def arguments(self) -> list[Any]:
        if not self.accept(MARK, "("):
            raise ReadError("a function without brackets")
        found = [self.sum()]
        while self.accept(MARK, ","):
            found.append(self.sum())
        self.close(")")
        return found

    def close(self, text: str) -> None:
        if not self.accept(MARK, text):
            raise ReadError(f"{text} is missing")


def evaluated(items: list[Item], value: Callable[[str, str], Any]) -> Any:
    """The value of a row; `value` gives that of a letter with a subscript."""
    row = _Row(items, value)
    x = row.sum()
    if (item := row.peek()) is not None:
        raise ReadError(f"two factors without a separator, or what is none: {item.text!r}")
    return x


def _letter(item: Item) -> tuple[str, str]:
    """Letter and subscript of a name."""
    return item.text, "".join(map(_written, item.rows[0])) if item.rows else ""


def _written(item: Item) -> str:
    """An item of a subscript as it stands there."""
    letter, below = _letter(item) if item.kind == NAME else (item.text, "")
    return letter + below


def values_of(known: Mapping[str, Any]) -> Callable[[str, str], Any]:
    """The value of what a letter with a subscript stands for, among known names."""
    return lambda letter, subscript: known[meant(letter, subscript, known)]


def left(items: list[Item]) -> tuple[list[Item], list[Item]]:
    """The two sides of an equation."""
    places = [k for k, item in enumerate(items) if item == Item(MARK, "=")]
    if len(places) != 1:
        raise ReadError("no equation")
    return items[: places[0]], items[places[0] + 1 :]


# --- text ---

TEXT = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*)(?P<call>\()?"
    r"|(?P<op>\*\*|[-+*/(),]))"
)
OPERATORS = {"**": TO, "*": TIMES, "/": OVER, "+": SIGN, "-": SIGN, "(": MARK, ")": MARK, ",": MARK}


def of_text(text: str) -> list[Item]:
    """Read an expression in the grammar of robot files; its names have no subscripts."""
    items, place, text = [], 0, text.strip()
    while place < len(text):
        match = TEXT.match(text, place)
        if match is None:
            raise ReadError(f"{text[place:][:20]!r}")
        if match["number"]:
            items.append(Item(NUMBER, match["number"]))
        elif match["name"]:
            items.append(Item(FUNCTION if match["call"] else NAME, match["name"]))
            items += [Item(MARK, "(")] * bool(match["call"])
        else:
            items.append(Item(OPERATORS[match["op"]], match["op"]))
        place = match.end()
    return items


# --- LaTeX ---

COMMANDS = {r"\,": TIMES, r"\cdot": TIMES, "+": SIGN, "-": SIGN, "/": OVER, "=": MARK, ",": MARK}
COMMANDS |= dict.fromkeys("()|", MARK)
LATEX = re.compile(r"\\(?:[A-Za-z]+|.)|\d+(?:\.\d+)?|[A-Za-z]+'*|\s+|.", re.DOTALL)
UNSEEN = (r"\left", r"\right", r"\quad", "&", r"\\", r"\;")
DOTS = {r"\dot": ".", r"\ddot": ".."}
FONTS = (r"\mathit", r"\mathbf")


class _Latex:
    def __init__(self, text: str) -> None:
        self.tokens = [t for t in LATEX.findall(text) if not t.isspace() and t not in UNSEEN]
        self.place = 0

    def group(self) -> list[Item]:
        """One token, or what stands in braces."""
        if self.tokens[self.place] == "{":
            self.place += 1
            items = self.row()
            self.place += 1
            return items
        return self.one()

    def word(self) -> str:
        """Letters in braces, such as those of a word in italics."""
        opening, start = self.tokens[self.place], self.place + 1
        end = self.tokens.index("}", start)
        self.place = end + 1
        if opening != "{":
            raise ReadError("a font without braces")
        return "".join(self.tokens[start:end]).replace(r"\_", "_")

    def row(self) -> list[Item]:
        items: list[Item] = []
        while self.place < len(self.tokens) and self.tokens[self.place] != "}":
            items += self.one()
        return items

    def one(self) -> list[Item]:
        token = self.tokens[self.place]
        self.place += 1
        if token in COMMANDS:
            return [Item(COMMANDS[token], {r"\cdot": "·"}.get(token, token))]
        match token:
            case "{":
                self.place -= 1
                return self.group()
            case "^":
                return [Item(SUP, "", (self.group(),))]
            case r"\frac":
                return [Item(FRACTION, "", (self.group(), self.group()))]
            case r"\sqrt":
                return [Item(ROOT, "", (self.group(),))]
            case r"\operatorname":
                return [Item(FUNCTION, self.word())]
            case _ if token in DOTS:
                return [self.named(self.word() + DOTS[token])]
            case _ if token in FONTS:
                return [self.named(self.word() + self.primes())]
            case _ if token[0] == "\\" and token[1:] in FUNCTIONS:
                return [Item(FUNCTION, token[1:])]
            case _ if token[0] == "\\" and token[1:] in LETTERS.values():
                return [self.named(token[1:] + self.primes())]
            case _ if token[0].isdigit():
                return [Item(NUMBER, token)]
            case _ if token[0].isalpha():
                if len(token.rstrip("'")) > 2:
                    raise ReadError(f"{token} in letters that are names of their own")
                return [self.named(token)]
        raise ReadError(f"{token!r} is not read")

    def primes(self) -> str:
        start = self.place
        while self.place < len(self.tokens) and self.tokens[self.place] == "'":
            self.place += 1
        return "'" * (self.place - start)

    def named(self, letter: str) -> Item:
        if self.place < len(self.tokens) and self.tokens[self.place] == "_":
            self.place += 1
            return Item(NAME, letter, (self.group(),))
        return Item(NAME, letter)


def of_latex(text: str) -> list[Item]:
    """Read a formula of LaTeX."""
    try:
        reader = _Latex(text)
        items = reader.row()
    except IndexError as error:
        raise ReadError("it ends too early") from error
    if reader.place != len(reader.tokens):
        raise ReadError("a brace closes what is not open")
    return items


# --- MathML ---

SHOWN = {"·": TIMES, "+": SIGN, "-": SIGN, "(": MARK, ")": MARK, "|": MARK, ",": MARK, "=": MARK}


def _items(node: ElementTree.Element) -> Iterator[Item]:
    text, children = (node.text or "").strip(), [*node]
    match node.tag:
        case "math" | "mrow":
            yield from _side_by_side(children)
        case "msub":
            yield _named(children)
        case "msubsup":
            yield _named(children[:2])
            yield Item(SUP, "", ([*_items(children[2])],))
        case "mover":
            yield _named([node])
        case "msup":
            yield from _items(children[0])
            yield Item(SUP, "", ([*_items(children[1])],))
        case "mfrac":
            yield Item(FRACTION, "", tuple([*_items(x)] for x in children))
        case "msqrt":
            yield Item(ROOT, "", ([*_side_by_side(children)],))
        case "mn" if re.fullmatch(r"\d+(\.\d+)?", text):
            yield Item(NUMBER, text)
        case "mi":
            name = LETTERS.get(text, text)
            yield Item(FUNCTION, name) if name in FUNCTIONS else _named([node])
        case "mo" if text in FUNCTIONS:
            yield Item(FUNCTION, text)
        case "mo" if (text := text.replace("−", "-")) in SHOWN:
            yield Item(SHOWN[text], text)
        case _:
            raise ReadError(f"<{node.tag}>{text!r} is not read")


def _side_by_side(nodes: list[ElementTree.Element]) -> Iterator[Item]:
    """A space separates two factors; the product that nobody sees does not."""
    for node in nodes:
        if node.tag == "mspace":
            if float(node.get("width", "0").removesuffix("em")) < 0.1:
                raise ReadError("a space that nobody sees")
            yield Item(TIMES, " ")
        elif not (node.tag == "mo" and (node.text or "").strip() in ("\u2062", "\u2061", "")):
            yield from _items(node)


def _named(nodes: list[ElementTree.Element]) -> Item:
    first, *below = nodes
    dots = ""
    if first.tag == "mover":
        first, over = first
        dots = {"˙": ".", "¨": ".."}[over.text or ""]
    letter = (first.text or "").strip().replace("\u2032", "'")
    stem = letter.rstrip("'")
    letter = LETTERS.get(stem, stem) + letter[len(stem) :] + dots
    letter += "*" * (first.get("class") == "matrix")
    return Item(NAME, letter, tuple([Item(NAME, "".join(x.itertext()))] for x in below))


def of_mathml(text: str) -> list[Item]:
    """Read MathML markup: one formula, or the terms of a sum one after the other."""
    return [*_items(ElementTree.fromstring(f"<mrow>{text}</mrow>"))]
