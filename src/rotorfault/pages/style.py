"""What the HTML pages of rotorfault share: how they look, in light and dark, on a desk and on a telephone.

A page is one file that opens offline, so it holds its style itself: a template puts ``{{ style }}`` into its
``<style>`` element. The classes of `STYLE` that templates use:

- ``scroll``: around a table that may be wider than the screen. It alone scrolls; a shadow shows where more is.
- ``stacked``: a table whose rows become blocks below each other on a telephone. Its head is in a ``<thead>``, each
  cell has its column's title as ``data-label``; a cell of class ``first`` goes to the top of its block.
- ``verdict``: a cell whose words are not squeezed; ``confirmed``, ``partly``, ``not``: colours of verdicts.
- ``n``: a cell of numbers. ``soft``: what is said aside. ``lead``: what a page opens with.
- ``key``: a row of ``<div>`` with a number (``<b>``) and what it counts, for the top of a page.
"""

from __future__ import annotations

import json
import re

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup, escape

STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #57606a; --line: #d0d7de; --paper: #ffffff;
  --tint: #f4f6f8; --link: #0060a0; --shade: rgba(27, 31, 36, .22);
  --yes: #00664a; --partly: #8a5a00; --no: #a33b00; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e3e8ee; --soft: #a3adb8; --line: #3b444f; --paper: #14181d; --tint: #20262d; --link: #74b9ff;
    --shade: rgba(0, 0, 0, .65); --yes: #5fd3a6; --partly: #e3b341; --no: #ff9a68; }
}
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { font: 16px/1.55 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 0 auto;
  max-width: 66rem; padding: 1.5rem; overflow-wrap: break-word; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { margin: 2.4rem 0 .6rem; border-bottom: 1px solid var(--line); }
h3 { margin: 1.6rem 0 .4rem; font-size: 1.05rem; }
p, li, dl, figcaption { max-width: 48rem; }
a { color: var(--link); }
nav { display: flex; flex-wrap: wrap; gap: .2rem 1rem; margin: .8rem 0; }
.soft { color: var(--soft); }
.lead { font-size: 1.12rem; }
.key { display: flex; flex-wrap: wrap; gap: .6rem; margin: 1rem 0; }
.key div { background: var(--tint); border: 1px solid var(--line); border-radius: 6px; padding: .35rem .8rem; }
.key b { display: block; font-size: 1.35rem; line-height: 1.3; font-variant-numeric: tabular-nums; }
.scroll { overflow-x: auto; max-width: 100%; margin: .6rem 0 1rem; background-repeat: no-repeat;
  background-image: linear-gradient(to right, var(--paper) 40%, transparent),
    linear-gradient(to left, var(--paper) 40%, transparent), linear-gradient(to right, var(--shade), transparent),
    linear-gradient(to left, var(--shade), transparent);
  background-position: 0 0, 100% 0, 0 0, 100% 0; background-size: 2rem 100%, 2rem 100%, .7rem 100%, .7rem 100%;
  background-attachment: local, local, scroll, scroll; }
table { border-collapse: collapse; font-size: .88rem; }
th, td { text-align: left; padding: .3rem .7rem; border-bottom: 1px solid var(--line); vertical-align: top; }
th { background: var(--tint); }
td.verdict { min-width: 7.5rem; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.confirmed { color: var(--yes); font-weight: 600; } .partly { color: var(--partly); font-weight: 600; }
.not { color: var(--no); font-weight: 600; }
dt { font-weight: 600; float: left; clear: left; width: 12rem; } dd { margin: 0 0 .2rem 12rem; }
figure { margin: 1.4rem 0; }
figure img { display: block; width: 100%; max-width: 56rem; height: auto; background: #ffffff; padding: .3rem;
  border: 1px solid var(--line); border-radius: 6px; }
figcaption { font-size: .9rem; color: var(--soft); margin-top: .3rem; }
code { font-size: .82rem; background: var(--tint); padding: .05rem .25rem; overflow-wrap: anywhere; }
details summary { cursor: pointer; }
@media (prefers-color-scheme: dark) { figure img { filter: brightness(.92); } }
@media (max-width: 40rem) {
  body { padding: 1rem .8rem; }
  h1 { font-size: 1.5rem; }
  th, td { padding: .3rem .5rem; }
  dt { float: none; width: auto; } dd { margin: 0 0 .4rem; }
  figure img { padding: .1rem; }
  table.stacked, .stacked tbody { display: block; }
  .stacked thead { display: none; }
  .stacked tr { display: flex; flex-direction: column; border: 1px solid var(--line); border-radius: 6px;
    margin: 0 0 .7rem; padding: .4rem .6rem; }
  .stacked td, .stacked td.n { display: block; border: 0; padding: .1rem 0; text-align: left; white-space: normal; }
  .stacked td.first { order: -1; }
  .stacked td.verdict { min-width: 0; font-size: 1rem; }
  .stacked td[data-label]::before { content: attr(data-label) ": "; color: var(--soft); font-weight: 400; }
}
"""


def environment() -> Environment:
    """The environment of a page's template: it escapes, refuses what is undefined, and knows `STYLE` as ``style``."""
    made = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.globals["style"] = Markup(STYLE)
    made.filters["coded"] = coded
    return made


def coded(text: str) -> Markup:
    """A text as HTML, with what stands between backticks as code.

    Parameters
    ----------
    text : str
        Escaped here.
    """
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def script_data(data: object) -> Markup:
    """Data for a script element: nothing in it can end the element.

    Parameters
    ----------
    data : object
        What JSON holds, without NaN.
    """
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c"))
