"""Sphinx configuration: Markdown pages, the theme, and pages that need no network."""

from torchfair import __version__

project = "torchfair"
author = "The torchfair developers"
copyright = "2026, the torchfair developers"
release = version = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"torchfair {__version__}"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = True
