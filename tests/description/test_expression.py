"""The grammar of robot files: what it reads, exactly, and that nothing else is ever read."""

import math
from contextlib import suppress
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from symgen.description.expression import Expression, simplified
from symgen.description.grammar import MAX_LENGTH, parse
from symgen.errors import ExpressionError


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("0.225", "0.225"),
        ("1e-3*a", "0.001*a"),
        ("-pi/2", "-pi/2"),
        ("q5 - q2 + pi", "pi - q2 + q5"),
        ("a*(b + c) - a*b", "a*c"),
        ("2**-3", "0.125"),
        ("-2**2", "-4"),
        ("cos(pi/2 + x)", "-sin(x)"),
        ("sin(-x)", "-sin(x)"),
        ("cos(3*pi)", "-1"),
        ("sqrt(9/4)", "1.5"),
        ("tan(0)", "0"),
        ("1/(a + b)", "1/(a + b)"),
    ],
)
def test_canonical_text(text, canonical):
    assert str(parse(text)) == canonical
    assert parse(canonical) == parse(text)


def test_decimals_are_exact():
    assert parse("0.1 + 0.2").constant == Fraction(3, 10)
    assert parse(0.225).constant == Fraction(9, 40)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "q1.__class__",
        "exec(a)",
        "lambda: 1",
        "a[0]",
        "a if b else c",
        "a; b",
        "a = 1",
        "a, b",
        "'a'",
        "a // b",
        "a % b",
        "a @ b",
        "1j",
        "0x10",
        "1_000",
        "٣",
        "a!",
        "",
        " ",
        "(",
        "a)",
        "1 2",
        "a b",
        "2a",
        "*a",
        "a**b",
        "a**0.5",
        "a**(1/2)",
        "a**99",
        "sin",
        "sin()",
        "1/0",
        "1/(a - a)",
        "0**-1",
        "0**(-1)",
        "tan(pi/2)",
        "sqrt(-1)",
        "9" * 100,
        "1e999",
        "(" * 60 + "1" + ")" * 60,
        "a" * (MAX_LENGTH + 1),
        "((a+b+c+d+e+f+g)**4)**8",
        "((((((2**32)**32)**32)**32)**32)**32)**32",
    ],
)
def test_outside_the_grammar(text):
    with pytest.raises(ExpressionError) as caught:
        parse(text, set("abcdefg"))
    assert caught.value.column is not None
    assert (
        "found" in str(caught.value) or "expect" in str(caught.value) or len(str(caught.value)) > 20
    )


def test_undeclared_symbol_lists_the_declared_ones():
    with pytest.raises(
        ExpressionError, match=r"undeclared symbol 'L2'; declared symbols: D2, g at column 5"
    ):
        parse("2 * L2", {"D2", "g"})


SYMBOLS = {"a": 0.7, "b": -1.3, "D3": 0.225}
ATOMS = (
    st.sampled_from([*SYMBOLS, "pi"])
    | st.integers(0, 9).map(str)
    | st.decimals(0, 9, places=2).map(str)
)
TEXTS = st.recursive(
    ATOMS,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
        st.tuples(st.sampled_from(["sin", "cos"]), inner).map(lambda t: f"{t[0]}({t[1]})"),
        inner.map(lambda t: f"-{t}"),
        st.tuples(inner, st.integers(0, 3)).map(lambda t: f"({t[0]})**{t[1]}"),
    ),
    max_leaves=6,
)


@given(TEXTS)
def test_value_and_round_trip(text):
    try:
        e = parse(text)
    except ExpressionError as error:
        assert "expands" in str(error)
        return
    expected = eval(  # noqa: S307  the test's own text
        text, {"__builtins__": {}, "sin": math.sin, "cos": math.cos, "pi": math.pi}, SYMBOLS
    )
    scale = max(
        1.0, sum(abs(Expression({m: c}).value(SYMBOLS)) for m, c in e.terms.items()), abs(expected)
    )
    assert math.isclose(
        e.value(SYMBOLS), expected, abs_tol=1e-9 * scale
    )  # sums of a few dozen rounded terms
    assert parse(str(e)) == e


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text):
    with suppress(ExpressionError):
        parse(text, {"a"})


@given(st.text(alphabet="ab12.()+-*/ episncoqrt", max_size=40))
def test_any_text_of_the_alphabet_is_read_or_refused(text):
    with suppress(ExpressionError):
        parse(text)


@pytest.mark.parametrize(
    ("text", "simple"),
    [
        ("cos(pi/3)**2 + sin(pi/3)**2", "1"),
        ("L*(cos(L)**2 + sin(L)**2)", "L"),
        ("L - L*cos(L)**2", "L*sin(L)**2"),
        ("cos(L)**2 + 2*sin(L)**2", "cos(L)**2 + 2*sin(L)**2"),
    ],
)
def test_squares_of_cosine_and_sine_are_one(text: str, simple: str) -> None:
    assert str(parse(text, ("L",))) == simple


def test_an_identity_of_a_thousand_terms_is_seen():
    """One replacement after the other: each was a call inside the last, and a look at every term."""
    ones, names = Expression.number(1), [f"a{k}" for k in range(10)]
    for name in names:
        ones = ones * (parse(f"cos({name})", names) ** 2 + parse(f"sin({name})", names) ** 2)
    assert len(ones.terms) == 2**10 and str(simplified(ones)) == "1"
