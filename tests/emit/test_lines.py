"""Lines of emitted Python: names say their values, nothing is unpacked or passed that is not read, the header explains the families."""

from __future__ import annotations

import ast
import re

import pytest
from campaign import sampled

from symgen.derive.names import FAMILIES, families_of
from symgen.description import load_robot, packaged_robots
from symgen.emit.generate import generate_files

PACKAGES = {"np", "ca", "xp"}


@pytest.fixture(scope="module", params=sampled(packaged_robots(), 4, always=("tx40", "four_bar")))
def texts(request) -> dict[str, str]:
    files = generate_files(load_robot(request.param), targets=("numpy", "casadi", "xp"))
    return {name: text for name, text in files.items() if name.endswith(".py")}


def functions(text: str) -> list[ast.FunctionDef]:
    return [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]


def test_nothing_is_unpacked_or_passed_that_is_not_read(texts) -> None:
    """Arguments of public functions are the interface: constants stand there whether a model has them or not."""
    for file, text in texts.items():
        for f in functions(text):
            names = [n for n in ast.walk(f) if isinstance(n, ast.Name)]
            read = {n.id for n in names if isinstance(n.ctx, ast.Load)}
            given = {n.id for n in names if isinstance(n.ctx, ast.Store)}
            if f.name.startswith("_") and f.name != "__array_finalize__":
                given |= {a.arg for a in (*f.args.args, *f.args.kwonlyargs)}
            assert given - read - {"_"} == set(), (file, f.name)


def terms(value: ast.expr, sign: int = 1) -> list[tuple[int, ast.expr]]:
    """The signed terms of a sum, as written."""
    if isinstance(value, ast.BinOp) and isinstance(value.op, ast.Add | ast.Sub):
        return [*terms(value.left, sign), *terms(value.right, sign if isinstance(value.op, ast.Add) else -sign)]
    if isinstance(value, ast.UnaryOp):
        return terms(value.operand, -sign)
    return [(sign, value)]


def letters(value: ast.expr) -> str:
    """A term as a name says it."""
    if isinstance(value, ast.Constant):
        return f"x{value.value}"
    if isinstance(value, ast.BinOp) and isinstance(value.op, ast.Pow):
        return letters(value.left) * 2
    if isinstance(value, ast.BinOp):
        return "".join(sorted((letters(value.left), letters(value.right)), key=lambda w: w.startswith("x")))
    if isinstance(value, ast.Call):
        return re.sub(r"^(np\.|ca\.|xp\.|_)", "", ast.unparse(value.func)) + letters(value.args[0])
    return ast.unparse(value)


def test_a_made_name_says_its_value(texts) -> None:
    """A name without a family is its line in letters: p where a term is added, m where it is subtracted."""
    made = 0
    for file, text in texts.items():
        for f in functions(text):
            if not f.name.startswith("_") or f.name in ("_closed", "_assembled", "_newton", "_solved"):
                continue
            for line in f.body:
                if not (isinstance(line, ast.Assign) and isinstance(line.targets[0], ast.Name)):
                    continue
                name, value = line.targets[0].id, line.value
                words = [(sign, letters(term)) for sign, term in terms(value)]
                if len(words) > 1 and re.fullmatch(r"[A-Z]\w*[pm][A-Z]\w*", name) and not families_of([name]):
                    said = words[0][1] + "".join(("p" if sign > 0 else "m") + word for sign, word in words[1:])
                    assert words[0][0] > 0 and name.rstrip("b") == said.rstrip("b"), (file, f.name, ast.unparse(line))
                    made += 1
    assert made or "tx40.py" not in texts


def test_the_recursion_keeps_its_order(texts) -> None:
    """No angular velocity or acceleration is written in terms of U, which is made of them."""
    for text in texts.values():
        assert not re.search(r"^ +WP?\d+ = .*\bU\d", text, re.MULTILINE)


def test_the_header_explains_the_families_that_occur(texts) -> None:
    for text in texts.values():
        header = ast.get_docstring(ast.parse(text)) or ""
        explained = re.findall(r"^ {4}(\w+) +(.+)$", header[header.index("Names ") : header.index("Cost per sample")], re.MULTILINE)
        assert all(FAMILIES[family] == meaning for family, meaning in explained)
        blocks = [f for f in functions(text) if f.name.endswith("_block")]
        named = {n.id for f in blocks for n in ast.walk(f) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
        assert {*families_of(named)} - {"X"} <= {family for family, _ in explained}


@pytest.mark.parametrize("name", sampled(packaged_robots(), 4, always=("tx40", "four_bar")))
def test_constant_entries_are_written_once_a_call(name: str) -> None:
    """No block writes a number into its result."""
    text = generate_files(load_robot(name))[f"{name}.py"]
    for f in functions(text):
        if f.name.endswith("_block"):
            numbers = [n for n in ast.walk(f) if isinstance(n, ast.Assign) and isinstance(n.value, ast.Constant)]
            assert not numbers, f.name


def test_public_functions_have_hints(texts) -> None:
    for file, text in texts.items():
        public = [f for f in ast.parse(text).body if isinstance(f, ast.FunctionDef) and not f.name.startswith("_")]
        assert public
        for f in public:
            assert f.returns and all(a.annotation for a in (*f.args.args, *f.args.kwonlyargs)), (file, f.name)
