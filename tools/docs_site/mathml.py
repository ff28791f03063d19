"""Formulas of the site as MathML, which browsers draw themselves: no script, nothing from the network."""

from __future__ import annotations

import re

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxTranslator

# Commands that the converter lacks, and what it has in their place.
OTHERS = {r"\\(big|Big)(?![a-zA-Z])": r"\\\1l", r"\\dots(?![a-zA-Z])": r"\\ldots"}


def mathml(tex: str, display: bool) -> str:
    """A formula as a MathML element.

    Parameters
    ----------
    tex : str
        In LaTeX.
    display : bool
        Whether it stands by itself, not in a line of text.
    """
    for pattern, other in OTHERS.items():
        tex = re.sub(pattern, other, tex)
    return str(tex2mathml(tex.strip(), as_block=display))


def visit_inline(translator: SphinxTranslator, node: nodes.math) -> None:
    """Write a formula in a line."""
    translator.body.append(mathml(node.astext(), display=False))  # type: ignore[attr-defined]
    raise nodes.SkipNode


def visit_display(translator: SphinxTranslator, node: nodes.math_block) -> None:
    """Write a formula of its own; a wide one scrolls by itself on a narrow page."""
    translator.body.append(f'<div class="formula">{mathml(node.astext(), display=True)}</div>')  # type: ignore[attr-defined]
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer with Sphinx."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_display, None))
    app.config.html_math_renderer = "mathml"  # type: ignore[attr-defined]
    return {"parallel_read_safe": True, "parallel_write_safe": True}
