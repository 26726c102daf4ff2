"""Lines of emitted Python: names say their values, nothing is unpacked or passed that is not read,
the header explains the families.
"""

from __future__ import annotations

import ast
import re
from collections import Counter

import pytest
from campaign import sampled

from symgen.derive.names import FAMILIES, families_of
from symgen.description import load_robot, packaged_robots
from symgen.emit import render
from symgen.emit.generate import generate_files, generate_module


@pytest.fixture(scope="module", params=sampled(packaged_robots(), 4, always=("tx40", "four_bar")))
def texts(request) -> dict[str, str]:
    return generate_files(load_robot(request.param))


def functions(text: str) -> list[ast.FunctionDef]:
    return [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]


def test_nothing_is_unpacked_or_passed_that_is_not_read(texts) -> None:
    """Arguments of public functions and of blocks are the interface: constants stand there whether a
    model has them or not, states and xp whether a block reads them.
    """
    for file, text in texts.items():
        for f in functions(text):
            names = [n for n in ast.walk(f) if isinstance(n, ast.Name)]
            read = {n.id for n in names if isinstance(n.ctx, ast.Load)}
            given = {n.id for n in names if isinstance(n.ctx, ast.Store)}
            methods = ("__array_finalize__", "gathered")
            if f.name.startswith("_") and not f.name.endswith(
                ("_block", "_motion", "_moving", "_passive", *methods)
            ):
                given |= {a.arg for a in (*f.args.args, *f.args.kwonlyargs)}
            assert given - read - {"_"} == set(), (file, f.name)


def test_a_made_name_can_be_said(texts) -> None:
    """A name without a family: at most three factors, or a letter behind the quantity that it is a
    part of; no line has a term that another one takes away.
    """
    for file, text in texts.items():
        for f in (f for f in functions(text) if f.name.endswith("_block")):
            for line in (x for x in f.body if isinstance(x, ast.Assign)):
                name = ast.unparse(line.targets[0])
                if name.isidentifier() and not families_of([name]):
                    assert len(name) <= 30, (file, f.name, name)
                written = Counter(ast.unparse(term) for _, term in terms(line.value))
                assert max(written.values()) == 1, (file, f.name, ast.unparse(line))


def terms(value: ast.expr, sign: int = 1) -> list[tuple[int, ast.expr]]:
    """The signed terms of a sum, as written."""
    if isinstance(value, ast.BinOp) and isinstance(value.op, ast.Add | ast.Sub):
        return [
            *terms(value.left, sign),
            *terms(value.right, sign if isinstance(value.op, ast.Add) else -sign),
        ]
    if isinstance(value, ast.UnaryOp):
        return terms(value.operand, -sign)
    return [(sign, value)]


def test_the_recursion_keeps_its_order(texts) -> None:
    """No angular velocity or acceleration is written in terms of U, which is made of them."""
    for text in texts.values():
        assert not re.search(r"^ +WP?\d+ = .*\bU\d", text, re.MULTILINE)


def test_the_header_explains_the_families_that_occur(texts) -> None:
    for text in texts.values():
        header = ast.get_docstring(ast.parse(text)) or ""
        explained = re.findall(
            r"^ {4}(\w+) +(.+)$",
            header[header.index("Names ") : header.index("Cost per sample")],
            re.MULTILINE,
        )
        assert all(FAMILIES[family] == meaning for family, meaning in explained)
        blocks = [f for f in functions(text) if f.name.endswith("_block")]
        named = {
            n.id
            for f in blocks
            for n in ast.walk(f)
            if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
        }
        assert {*families_of(named)} - {"X"} <= {family for family, _ in explained}


@pytest.mark.parametrize("name", sampled(packaged_robots(), 4, always=("tx40", "four_bar")))
def test_constant_entries_of_a_store_are_written_once(name: str) -> None:
    """The block of the regressor writes no number into its result."""
    text = generate_files(load_robot(name))[f"{name}.py"]
    for f in functions(text):
        if f.name == "_regressor_block":
            numbers = [
                n
                for n in ast.walk(f)
                if isinstance(n, ast.Assign) and isinstance(n.value, ast.Constant)
            ]
            assert not numbers, f.name


def test_public_functions_have_hints(texts) -> None:
    for file, text in texts.items():
        public = [
            f
            for f in ast.parse(text).body
            if isinstance(f, ast.FunctionDef) and not f.name.startswith("_")
        ]
        assert public
        for f in public:
            assert f.returns and all(a.annotation for a in (*f.args.args, *f.args.kwonlyargs)), (
                file,
                f.name,
            )


@pytest.mark.parametrize("error", [RuntimeError, PermissionError])
def test_templates_are_compiled_where_no_folder_can_keep_them(monkeypatch, error) -> None:
    def refused(*given) -> None:
        raise error("the folder belongs to another user")

    expected = generate_module(load_robot("planar_2r"))
    render._environment.cache_clear()
    monkeypatch.setattr("jinja2.FileSystemBytecodeCache.__init__", refused)
    assert generate_module(load_robot("planar_2r")) == expected
    render._environment.cache_clear()


def test_templates_are_compiled_where_the_disk_is_full(monkeypatch) -> None:
    def full(*given) -> None:
        raise OSError("no space left on device")

    expected = generate_module(load_robot("planar_2r"))
    render._environment.cache_clear()
    monkeypatch.setattr("jinja2.FileSystemBytecodeCache.load_bytecode", lambda *given: None)
    monkeypatch.setattr("jinja2.FileSystemBytecodeCache.dump_bytecode", full)
    assert generate_module(load_robot("planar_2r")) == expected
    render._environment.cache_clear()
