"""A Sphinx extension that renders formulas as MathML, which browsers show without a network."""

from __future__ import annotations

from typing import TYPE_CHECKING

from docutils.nodes import SkipNode
from latex2mathml.converter import convert

if TYPE_CHECKING:
    from docutils.nodes import math, math_block
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer of formulas with a Sphinx application, as "mathml"; return that Sphinx
    may read and write pages with it in parallel. Sphinx calls it.
    """
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(writer: HTML5Translator, node: math) -> None:
    """Write a formula inside a line of text."""
    writer.body.append(convert(node.astext()))
    raise SkipNode


def _block(writer: HTML5Translator, node: math_block) -> None:
    """Write a formula that stands in a line of its own."""
    writer.body.append(convert(node.astext(), display="block"))
    raise SkipNode
