"""Sphinx configuration: Markdown pages, the theme, and pages that need no network."""

import re

from torchfair import __version__

project = "torchfair"
author = "The torchfair developers"
copyright = "2026, the torchfair developers"
release = version = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 4
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"torchfair {__version__}"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = True
nitpicky = True  # a reference that leads nowhere is a warning
nitpick_ignore_regex = [
    ("py:class", r"(torch|abc|collections|scipy|numpy|pathlib)\..*"),
    ("py:class", r"torchfair\.constraints\._indexed\.IndexedModule"),  # what moves indices
    ("py:class", r"torchfair\.projection\.(system\.Evaluation|state\.Linearised|course\.Course)"),  # parts of a state
    ("py:class", r"torchfair\.formfinding\.job\..*\.[A-Z]"),  # type variables
    (
        "py:class",
        r"torchfair\.(_names\.(Names|Sentence)|meshing\.components\.ReadSurface)",
    ),  # parts of meshes that are read
]


def mark_shapes(app, what, name, obj, options, lines):
    """Sets shapes such as (*batch, V, 3), whose star means emphasis otherwise, as code."""
    for number, line in enumerate(lines):
        parts = line.split("``")
        parts[::2] = [re.sub(r"\((\.\.\.|\*)[^()]*\)", r"``\g<0>``", part) for part in parts[::2]]
        lines[number] = "``".join(parts)


def skip_tuple_fields(app, what, name, obj, skip, options):
    """The fields of a named tuple stand in its docstring already."""
    return True if type(obj).__name__ == "_tuplegetter" else None


def find_public_name(app, env, node, contnode):
    """Leads references by a short name, or by the module of the definition, to where the object is documented."""
    if node.get("refdomain") != "py":
        return None
    domain, parts = env.get_domain("py"), node["reftarget"].split(".")
    for size in (2, 1):
        ending = "." + ".".join(parts[-size:])
        found = [name for name, entry in domain.objects.items() if name.endswith(ending) and not entry.aliased]
        if len(parts) >= size and len(found) == 1:
            return domain.resolve_xref(env, node["refdoc"], app.builder, node["reftype"], found[0], node, contnode)
    return None


def setup(app):
    app.connect("autodoc-process-docstring", mark_shapes, priority=400)  # before napoleon
    app.connect("autodoc-skip-member", skip_tuple_fields)
    app.connect("missing-reference", find_public_name)
