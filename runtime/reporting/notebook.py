"""Results in a notebook: HTML tables of an Estimate and of a resolution study. Every text is escaped; no script, no style sheet, no request."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runtime.estimators.estimate import Estimate
    from runtime.resolution.result import Cestac

NAME = re.compile(r"([A-Za-z]+)(\d[0-9_]*R?)")


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def estimate_html(fit: Estimate) -> str:
    """How good the fit is, its parameters, then the joints behind a fold."""
    parameters = zip(fit.names, fit.X, fit.sigma, fit.relative_sigma, fit.sigma_corrected, strict=True)
    rows = [
        (symbol(n), _number(x, ".5g"), _number(s, ".2g"), _number(p, ".2f"), _number(c, ".2g"), unit(fit.units.get(n, "")))
        for n, x, s, p, c in parameters
    ]
    joints = [
        (j.joint, str(j.rows), _number(j.residual_norm, ".5g"), _number(j.relative_error, ".2f"), _number(j.sigma_rho, ".3g"))
        for j in fit.per_joint
    ]
    return element(
        "div",
        element(
            "p", element("b", fit.method), f": {fit.rows} rows, {len(fit.names)} parameters, rank {fit.rank}, {fit.status}; {_quality(fit)}"
        ),
        *([element("p", fit.message)] if fit.message else []),
        table(("parameter", "value", "σ", "%σ", "σ corrected", "unit"), rows),
        element("details", element("summary", "joints"), table(("joint", "rows", "‖ρ‖", "error %", "σρ"), joints)),
    )


def cestac_html(result: Cestac) -> str:
    """%e of every parameter at every level, then the residual and the verdict."""
    header = ("parameter", "least squares", *(r.level.label for r in result.levels))
    rows = [
        (
            symbol(name),
            _number(result.reference.X[i], ".4g"),
            *(f"{_number(r.mean[i], '.4g')} ({_number(r.e[i], '.2f')} %)" for r in result.levels),
        )
        for i, name in enumerate(result.names)
    ]
    rows.append(("%e(ρ)", "", *(f"{_number(r.e_rho, '.2f')} %" for r in result.levels)))
    rows.append(("verdict", "", *(r.verdict for r in result.levels)))
    head = element("p", element("b", "Resolution study"), f": mean of the runs and, in brackets, %e (21); {result.verdict}")
    return element("div", head, table(header, rows))


def symbol(name: str) -> Markup:
    """ZZ1R with 1R below."""
    found = NAME.fullmatch(name)
    return element("span", found[1], element("sub", found[2])) if found else element("span", name)


def unit(text: str) -> str:
    """kg*m**2 as kg m²."""
    return text.replace("**2", "²").replace("*", " ")


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> Markup:
    """First column to the left, numbers to the right."""
    return element("table", element("thead", _row("th", header)), element("tbody", *(_row("td", row) for row in rows)))


def element(tag: str, *children: str, **attributes: str) -> Markup:
    """<tag attributes>children</tag>, escaped unless they are elements."""
    inside = "".join(c if isinstance(c, Markup) else escape(c) for c in children)
    given = "".join(f' {name}="{escape(value)}"' for name, value in attributes.items())
    return Markup(f"<{tag}{given}>{inside}</{tag}>")


def _row(tag: str, cells: Sequence[str]) -> Markup:
    return element(
        "tr", *(element(tag, cell, style=f"padding:0 0.6em;text-align:{'right' if k else 'left'}") for k, cell in enumerate(cells))
    )


def _quality(fit: Estimate) -> str:
    return f"error {_number(fit.relative_error, '.2f')} %, σρ {_number(fit.sigma_rho, '.3g')}, cond {_number(fit.cond_unit, '.3g')} (unit columns)"


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "–"
