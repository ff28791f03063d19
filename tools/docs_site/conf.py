"""Settings of Sphinx for the site of the documentation; `make docs` runs it, by tools/docs_site/build.py."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from rotorfault import __version__

project = "rotorfault"
author = "rotorfault contributors"
copyright = "rotorfault contributors, MIT licence"
version = release = __version__

extensions = [
    "myst_nb",  # pages in Markdown, and notebooks, which are run
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_design",  # the grid of the gallery
    "formulas",  # drawn into the page: tools/docs_site/formulas.py
    "public_names",  # docstrings of what the package exports: tools/docs_site/public_names.py
]
exclude_patterns = ["_build", "**/.ipynb_checkpoints"]
smartquotes = False  # options begin with two hyphens
suppress_warnings = ["mystnb.unknown_mime_type"]

# Markdown as on a forge: anchors of headings, $formulas$.
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_dmath_double_inline = True
nb_execution_mode = "force"
nb_execution_timeout = 180
nb_execution_raise_on_error = True
nb_merge_streams = True

default_role = "py:obj"
python_use_unqualified_type_names = True
autodoc_typehints = "none"  # NumPy-style docstrings say type and unit of every parameter
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
napoleon_google_docstring = False
napoleon_numpy_docstring = True
napoleon_use_rtype = False
toc_object_entries_show_parents = "hide"

html_math_renderer = "drawings"
html_theme = "pydata_sphinx_theme"
html_title = "rotorfault"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_use_opensearch = ""
html_theme_options = {
    "logo": {"text": "rotorfault"},
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "header_links_before_dropdown": 8,
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "show_nav_level": 1,
    "search_as_you_type": False,
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
    "footer_start": ["copyright"],
    "footer_end": [],
    "article_header_start": ["breadcrumbs"],
    "secondary_sidebar_items": ["page-toc"],
}
html_sidebars = {name: [] for name in ("index", "conventions", "survival", "paper")} | {"**": ["sidebar-nav-bs"]}
