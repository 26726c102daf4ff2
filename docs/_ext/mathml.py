"""Formulas as MathML, made when the site is built: no script, no fonts to fetch, readable offline
and by screen readers.
"""

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx


def inline(translator: Any, node: nodes.math) -> None:
    """$...$"""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def display(translator: Any, node: nodes.math_block) -> None:
    r"""$$...$$; a number such as (7) is written \tag{7} and stands at the right."""
    text, _, tag = node.astext().partition(r"\tag{")
    number = f'<span class="eqno">({tag.split("}")[0]})</span>' if tag else ""
    translator.body.append(
        f'<div class="math">{convert(text.strip(), display="block")}{number}</div>\n'
    )
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (inline, None), (display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
