"""Helpers of the tests of symbols: exact zero of trigonometric polynomials by SymPy, and values of
SymPy objects at many states.
"""

from __future__ import annotations

import numpy as np
import sympy


def is_zero(expression) -> bool:
    """Whether a polynomial in cos and sin of sums of symbols, and in symbols, vanishes identically.

    Sums of angles are expanded by SymPy; with s**2 + c**2 - 1 of every angle as the (Groebner)
    basis, the remainder is a normal form.
    """
    e = sympy.expand(expression, trig=True)
    names = {}
    for f in e.atoms(sympy.cos, sympy.sin):
        names[f] = sympy.Symbol(f"{f.func.__name__}_{f.args[0]}")
    e = e.xreplace(names)
    if any(p.exp.is_negative for p in e.atoms(sympy.Pow)):
        e = sympy.numer(sympy.together(e))
    angles = sorted({str(f.args[0]) for f in names})
    if not angles:
        return sympy.expand(e) == 0
    sines, cosines = (
        [sympy.Symbol(f"sin_{a}") for a in angles],
        [sympy.Symbol(f"cos_{a}") for a in angles],
    )
    others = sorted(e.free_symbols - {*sines, *cosines}, key=str)
    ring, *generators = sympy.ring([*sines, *cosines, *others], sympy.QQ, "lex")
    basis = [s**2 + c**2 - 1 for s, c in zip(generators, generators[len(angles) :], strict=False)][
        : len(angles)
    ]
    return ring.from_expr(e).rem(basis) == 0


def are_zero(matrix) -> bool:
    return all(is_zero(e) for e in sympy.Matrix(matrix))


def valued(expression, values, steps=()):
    """A SymPy scalar or Matrix at N states, (N, ...): `values` by name are numbers or (N,); `steps`
    are [(symbol, expression)] to compute first.
    """
    scalar = not hasattr(expression, "shape")
    entries = [expression] if scalar else list(expression)
    free = set().union(*(e.free_symbols for e in entries), *(e.free_symbols for _, e in steps)) - {
        x for x, _ in steps
    }
    used = sorted(free, key=str)
    known = [np.asarray(values[str(x)]) for x in used]
    function = sympy.lambdify(
        used, entries, "numpy", cse=lambda reduced: (list(steps), list(reduced))
    )
    N = max((np.size(v) for v in values.values()), default=1)
    made = np.stack([np.broadcast_to(e, (N,)) for e in function(*known)], axis=-1)
    if scalar:
        return made[:, 0]
    return (
        made.reshape(N, *expression.shape)[..., 0]
        if expression.shape[1] == 1
        else made.reshape(N, *expression.shape)
    )
