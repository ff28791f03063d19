"""Formulas of the site as drawings in the page: the same in every browser, without scripts, fonts or the network."""

from __future__ import annotations

import functools
import xml.etree.ElementTree as ET

import ziamath
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import SphinxError
from sphinx.util.docutils import SphinxTranslator

SIZE = 16.0  # px at which a formula is drawn; lengths then become multiples of the text's own size


@functools.cache
def drawing(tex: str, display: bool) -> str:
    """A formula as an SVG element in the colour of the text, with its source for who cannot see it.

    Parameters
    ----------
    tex : str
        In LaTeX.
    display : bool
        Whether it stands by itself, not in a line of text.
    """
    if "\\\\" in tex and "\\begin" not in tex:  # several lines, as docstrings write them
        tex = f"\\begin{{align*}}{tex.strip()}\\end{{align*}}"
    try:
        formula = ziamath.Latex(tex.strip(), size=SIZE, inline=not display, color="currentColor")
    except Exception as error:
        raise SphinxError(f"this formula cannot be drawn: {tex!r} ({error})") from error
    element = formula.svgxml()
    for side in ("width", "height"):
        element.set(side, f"{float(element.get(side, '0')) / SIZE:.4g}em")
    element.set("style", f"vertical-align: {formula.getyofst() / SIZE:.4g}em")
    element.set("role", "img")
    element.set("aria-label", " ".join(tex.split()))
    return ET.tostring(element, encoding="unicode", short_empty_elements=True)


def visit_inline(translator: SphinxTranslator, node: nodes.math) -> None:
    """Write a formula in a line."""
    translator.body.append(f'<span class="formula">{drawing(node.astext(), display=False)}</span>')
    raise nodes.SkipNode


def visit_display(translator: SphinxTranslator, node: nodes.math_block) -> None:
    """Write a formula of its own; a wide one scrolls by itself on a narrow page."""
    translator.body.append(f'<div class="formula">{drawing(node.astext(), display=True)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer with Sphinx."""
    app.add_html_math_renderer("drawings", (visit_inline, None), (visit_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
