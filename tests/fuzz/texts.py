"""Cases of text formats, aware of their structure: YAML with nasty values, expressions of the
grammar, `.par`, tables, JSON.
"""

from __future__ import annotations

import json
import random
from typing import Any

from ruamel.yaml import YAML

NASTY = (
    *("", "~", "null", "true", ".inf", "-.inf", ".nan", "nan", "inf", "1e999", "-1e999", "1e308", "-1e308", "1e-999", "5e-324", "-0", "-0.0", "0", "-1", "1", "2", "3", "1000000"),
    *("9" * 20, "9" * 400, "-" + "9" * 5000, "0x7fffffff", "0o17", "1_000", "12:30:45", "2001-01-01", "1.5", "0.1", "1e-400", "1/0", "0**-1", "pi", "pi**32", "1e60", "1e61"),
    *("9**9**9**9", "2**32**32", "10**10000", "(((((1)))))", "sqrt(-1)", "sqrt(0)", "tan(pi/2)", "cos(cos(cos(q1)))", "q1*q1", "q1", "q2", "q1 + q2", "1/q1", "D2", "q9999999999", "__class__", "import", "lambda", "self", "None"),
    *("&a [*a]", "&a 1", "*a", "!!python/object/apply:os.system ['id']", "!!binary aGk=", "!!set {a}", "!!int '1'", "!x y", "{<<: {a: 1}}", "[[[[[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]]]]]", "{a: {a: {a: {a: {a: {a: 1}}}}}}"),
    *("[]", "{}", "[1]", "[1, 2]", "[0, 0, 0]", "[null]", "{1: q1}", "{q1: 0}", "{all: 1}", "{1: 1, 1: 2}", "[1, [2, [3]]]", "all", "essential", "auto", "off", "positive", "iv"),
    *("'../../x'", "/etc/passwd", "'a/b'", "'a\\b'", "CON", "NUL", '"\\0"', '"\\u202e"', '"\\x1b[2J"', "'\"\"\"'", "'*/'", "'</script>'", "'${x}'", "'{{x}}'", "'\\\\input{x}'", "'" + "x" * 5000 + "'", "'é'", "'Ｄ２'", "class", "'1'", "' '", "|\n  a\n  b", ">-\n  a"),
)  # fmt: skip
TOKENS = (
    *(b": ", b"- ", b"[", b"]", b"{", b"}", b",", b"&a ", b"*a", b"!!int ", b"|\n", b">\n", b"'", b'"', b"#", b"\n", b"\t", b"---\n", b"...\n", b"%YAML 1.1\n", b"%TAG ! x:\n", b"? ", b"<<: ", b"@", b"`", b"\xc2\x85", b"\xe2\x80\xa8", b"\xff\xfe", b"\x00"),
    *(word.encode()[:200] for word in NASTY),
)  # fmt: skip


MANY = 20_000  # values of a case


class Raw(str):
    """Text that stands in the file as it is."""


def plain(content: bytes) -> Any:
    """Data of a YAML file."""
    return YAML(typ="safe", pure=True).load(content.decode())


def flow(node: Any) -> str:
    """YAML in flow style."""
    if isinstance(node, Raw):
        return node
    if isinstance(node, dict):
        return "{" + ", ".join(f"{flow(k)}: {flow(v)}" for k, v in node.items()) + "}"
    if isinstance(node, list):
        return "[" + ", ".join(map(flow, node)) + "]"
    if node is None or isinstance(node, bool):
        return {None: "null", True: "true", False: "false"}[node]
    if isinstance(node, str) and not (node.isidentifier() or node[:1] in "-0123456789("):
        return "'" + node.replace("'", "''") + "'"
    return str(node)


def yaml_text(data: dict[Any, Any]) -> str:
    """A file with one key a line; the raw values may have several lines."""
    return "".join(f"{flow(k)}: {flow(v)}\n" for k, v in data.items())


def places(node: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all values."""
    items = (
        node.items()
        if isinstance(node, dict)
        else enumerate(node)
        if isinstance(node, list)
        else ()
    )
    return [path, *(found for key, value in items for found in places(value, (*path, key)))]


def changed(node: Any, path: tuple[Any, ...], value: Any) -> Any:
    """A copy with another value at the path; None where it is to be left out."""
    if not path:
        return value
    if isinstance(node, dict):
        return {k: changed(v, path[1:], value) if k == path[0] else v for k, v in node.items()}
    return [changed(v, path[1:], value) if k == path[0] else v for k, v in enumerate(node)]


def nasty(rng: random.Random, symbols: tuple[str, ...]) -> Raw:
    """A value that files should not have, or a random expression."""
    if rng.random() < 0.3:
        return Raw(expression(rng, symbols, 4))
    if rng.random() < 0.02:
        depth = rng.choice((50, 1000, 10000))
        left, right = rng.choice(("[]", "{}", ("{a: ", "}"), ("- ", "")))
        return Raw(left * depth + "1" + right * depth)
    return Raw(rng.choice(NASTY))


def structured(
    data: dict[Any, Any],
    rng: random.Random,
    symbols: tuple[str, ...] = ("q1", "q2", "D2", "g"),
    others: tuple[Any, ...] = (),
) -> bytes:
    """YAML with values, keys or subtrees changed."""
    for _ in range(rng.choice((1, 1, 2, 3, 6))):
        spots = [path for path in places(data) if path]
        if not spots:
            break
        path = rng.choice(spots)
        holder: Any = data
        for key in path[:-1]:
            holder = holder[key]
        match rng.randrange(7):
            case 0 | 1 | 2:
                data = changed(data, path, nasty(rng, symbols))
            case 3:  # a subtree from elsewhere
                other = rng.choice((data, *others))
                found: Any = other
                for key in rng.choice(places(other)):
                    found = found[key]
                data = changed(data, path, found)
            case 4 if isinstance(holder, dict):  # another key
                renamed = {
                    (nasty(rng, symbols) if k == path[-1] else k): v for k, v in holder.items()
                }
                data = changed(data, path[:-1], renamed) if path[:-1] else renamed
            case 5:  # left out
                kept = (
                    {k: v for k, v in holder.items() if k != path[-1]}
                    if isinstance(holder, dict)
                    else [v for k, v in enumerate(holder) if k != path[-1]]
                )
                data = changed(data, path[:-1], kept) if path[:-1] else kept
            case 6 if isinstance(holder, list):
                data = changed(
                    data, path[:-1], holder * rng.choice((2, 30, 300 if len(spots) < 300 else 3))
                )
        if len(places(data)) > MANY:
            break
    return yaml_text(data).encode("utf-8", "replace")


def expression(rng: random.Random, symbols: tuple[str, ...], depth: int) -> str:
    """A random sentence of the grammar, sometimes beside it."""
    inner = lambda: expression(rng, symbols, depth - 1)  # noqa: E731
    if depth <= 0 or rng.random() < 0.2:
        usual = (
            *symbols,
            "pi",
            "0",
            "1",
            "2",
            "1/2",
            "0.1",
            "1e-60",
            "1e60",
            "7" * rng.choice((3, 59)),
        )
        return rng.choice(
            usual if rng.random() < 0.98 else ("1e61", "7" * 61, "x", "1e400", "(", "")
        )
    return rng.choice((
        lambda: f"{inner()} + {inner()}", lambda: f"{inner()} - {inner()}", lambda: f"{inner()}*{inner()}", lambda: f"({inner()})*({inner()})",
        lambda: f"{inner()}/({inner()})", lambda: f"({inner()})**{rng.choice((0, 1, 2, 3, 8, 9, 31, 32, -1, -2, -8, -32) * 3 + (33, '(1/2)', 'q1', 10**9))}",
        lambda: f"-{inner()}", lambda: f"{rng.choice(('sin', 'cos', 'tan', 'sqrt') * 9 + ('exp', 'inv', 'pi', 'q1'))}({inner()})",
        lambda: "(" * (n := rng.choice((3, 38, 41, 900))) + inner() + ")" * n, lambda: "+-" * rng.choice((1, 20, 900)) + inner(),
        lambda: " + ".join(f"{rng.choice(symbols)}**{k}*{rng.choice(symbols)}" for k in range(rng.choice((3, 30)))), lambda: f"({inner()})**8*({inner()})**8",
    ))()  # fmt: skip


def par(content: bytes, rng: random.Random) -> bytes:
    """A `.par` file with items of its lists changed."""
    text = content.decode("latin-1")
    for _ in range(rng.choice((1, 1, 2, 4))):
        spots = [k for k, c in enumerate(text) if c in "{,=}"]
        if not spots:
            break
        at = rng.choice(spots) + 1
        end = next((k for k in range(at, len(text)) if text[k] in "{},\n"), len(text))
        word = rng.choice(
            (
                expression(rng, ("th1", "t2", "D2", "q1", "XX1"), 3),
                rng.choice(NASTY),
                "(*",
                "*)",
                "(* x *)",
                "{1,2}",
                "Pi/2",
                "th1+th2",
                "1.5708",
                "-1.5707963",
                "3",
                "999999",
                "{",
                "}",
            )
        )
        text = text[:at] + word + text[end if rng.random() < 0.8 else at :]
        if rng.random() < 0.1:
            lines = text.splitlines(keepends=True)
            a, b = (rng.randrange(len(lines)) for _ in range(2))
            lines[a], lines[b] = lines[b], rng.choice((lines[a], lines[b]))
            text = "".join(lines)
    return text.encode(rng.choice(("utf-8", "utf-8", "utf-8-sig", "latin-1", "utf-16")), "replace")


FIELDS = (
    "",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "1e308",
    "-1e308",
    "5e-324",
    "1_0",
    "0x10",
    "1,5",
    '"1.0"',
    '"',
    "'",
    "abc",
    "٣",
    "１",
    "1e",
    "--1",
    "\x00",
    "\x1b[2J",
    "\u202e",
    "#",
    " ",
    "9" * 400,
    "1" + "0" * 5000,
    "true",
    "None",
    "1+2j",
    "1d3",
    "\x85",
    "\u2028",
    "\x0c",
    "\x1c",
)
HEADERS = (
    "t",
    "q1",
    "q2",
    "tau1",
    "tau2",
    "qr1",
    "q0",
    "q01",
    "q" + "9" * 5000,
    "q٣",
    "tau" + "1" * 20,
    "",
    " ",
    '"q1"',
    "q1\x1b[2J",
    "a" * 20000,
    "1",
    "#q1",
    "q-1",
    "q1;q2",
    "nan",
)


def table(content: bytes, rng: random.Random) -> bytes:
    """A text table with fields, rows, names or the delimiter changed."""
    rows = [line.split(",") for line in content.decode().splitlines()]
    for _ in range(rng.choice((1, 1, 2, 4))):
        k = rng.randrange(len(rows))
        match rng.randrange(9):
            case 0 | 1 | 2:
                rows[k][rng.randrange(len(rows[k]))] = rng.choice(FIELDS)
            case 3 | 4:
                rows[0][rng.randrange(len(rows[0]))] = rng.choice(HEADERS)
            case 5:
                rows[k] = rng.choice(
                    (
                        [""],
                        [],
                        rows[k] * 2,
                        rows[k][:-1],
                        rows[k] * (5000 if len(rows[k]) < 100 else 1),
                        [*rows[k], "#"],
                    )
                )
                rows[k] = rows[k] or [""]
            case 6:
                rows[k:k] = [list(rows[rng.randrange(len(rows))])] * rng.choice((1, 3, 100))
            case 7:
                column = rng.randrange(len(rows[k]))
                scale = rng.choice((0.0, -1.0, 1e300, 1e-300, 1e9, float("nan")))
                rows = [
                    [
                        repr(float(x) * scale) if i == column and is_number(x) else x
                        for i, x in enumerate(row)
                    ]
                    for row in rows
                ]
            case 8:
                rows = rows[: rng.choice((1, 2, 3, 9, 11))]
    ending = rng.choice(("\n",) * 6 + ("\r\n", "\r", "\x85", "\u2028", "\x00"))
    text = (
        ending.join(rng.choice((",",) * 10 + (";", "\t", " ", " , ")).join(row) for row in rows)
        if rng.random() < 0.1
        else ending.join(map(",".join, rows))
    )
    return text.encode(rng.choice(("utf-8",) * 8 + ("utf-16", "utf-8-sig", "latin-1")), "replace")


JSON_VALUES = (
    *("null", "true", "false", "0", "-1", "1e999", "-1e999", "NaN", "Infinity", "1e308", "9" * 400, "9" * 5000, "1.5", "[]", "{}", "[[]]", "[1, 2]", '{"": 1}', '""', '"x"'),
    *('"\\u001b[2J"', '"\\ud800"', '"\\u0000"', '"</script>"', '"' + "x" * 5000 + '"', '"symgen-estimate/2"', '"symgen-cestac/1"', "'x'", "01", "1_0", "[[1], [2, 3]]", "[null, 1]"),
    *("[" * 500, "[" * 5000 + "]" * 5000, "[" * 100_000 + "]" * 100_000, '{"a":' * 5000 + "1" + "}" * 5000, "[" + "1," * 50_000 + "1]"),
)  # fmt: skip


def json_case(data: Any, rng: random.Random) -> bytes:
    """JSON with values changed, left out or put in from elsewhere; `Raw` text stands as it is."""
    raw: list[str] = []
    for _ in range(rng.choice((1, 1, 2, 3))):
        path = rng.choice(places(data))
        found = data
        for key in path[:-1]:
            found = found[key]
        if path and isinstance(found, dict) and rng.random() < 0.25:
            data = changed(
                data,
                path[:-1],
                {
                    k if k != path[-1] else rng.choice((None, "x" * 3000, "\x1b[2J")): v
                    for k, v in found.items()
                    if k != path[-1] or rng.random() < 0.7
                },
            )
        elif path and rng.random() < 0.3:
            data = changed(data, path, found)
        else:
            data = changed(data, path, f"@{len(raw)}@")
            raw.append(rng.choice(JSON_VALUES))
    text = json.dumps(data)
    for k, value in enumerate(raw):
        text = text.replace(f'"@{k}@"', value)
    return text.encode("utf-8", "surrogatepass")


def is_number(text: str) -> bool:
    """Whether Python reads the field as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
