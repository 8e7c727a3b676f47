"""Sphinx configuration: Markdown pages, the theme, and pages that need no network."""

import html
import re
import sys
import textwrap
from importlib import import_module
from inspect import ismodule
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import gallery
from docutils import nodes
from sphinx.util import logging

import torchfair
from torchfair import __version__, meshing
from torchfair.formfinding.fair import planar_quads

vars(planar_quads)["QuadMesh"] = meshing.QuadMesh  # imported there for types only, and without it no type is a link

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
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_js_files = ["copy.js", "breaks.js"]
mathjax_path = "mathjax/startup.js"  # docs/vendor_mathjax.py says where it is from
mathjax3_config = {
    "loader": {"load": ["input/tex", "output/chtml"]},
    "options": {"processHtmlClass": "tex2jax_process|mathjax_process|math|output_area"},
}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
maximum_signature_line_length = 90
napoleon_google_docstring = True
nitpicky = True  # a reference that leads nowhere is a warning
nitpick_ignore_regex = [
    ("py:class", r"(torch|abc|collections|scipy|numpy|pathlib|os)\..*"),
    ("py:class", r"Tensor|Path|Console|Document|BackgroundServer|Ints|Floats|Callback"),  # imported for types only
    ("py:class", r"torchfair\..*\.[A-Z]"),  # type variables
    ("py:class|py:obj", r"(typing\.Literal|tuple|dict)\[.*"),  # what a default in a signature is cut into
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
    return contnode if exists(node["reftarget"]) else None


def exists(target):
    """Whether a class of this package has this full name: an internal one, which has no page."""
    module, _, name = target.rpartition(".")
    try:
        return module.startswith("torchfair.") and hasattr(import_module(module), name)
    except ImportError:
        return False


def public_names():
    """Part, name and value of all that the parts of the package show."""
    for part in torchfair._PARTS:
        module = import_module(f"torchfair.{part}")
        for name, value in vars(module).items():
            home = getattr(value, "__module__", None) or ""
            inside = home.startswith("torchfair.") if hasattr(module, "__path__") else home == module.__name__
            if inside and not name.startswith("_") and not ismodule(value):
                yield part, name, value


def warn_of_names_without_a_page(app, env):
    """Everything public of every part is in the reference, some of it with another part from which it comes."""
    documented = env.get_domain("py").objects
    for part, name, value in public_names():
        homes = [full.rpartition(".")[0] for full in documented if full.endswith(f".{name}")]
        modules = [sys.modules[home] for home in homes if home in sys.modules]
        if not any(getattr(module, name, None) is value for module in modules):
            logging.getLogger(__name__).warning("torchfair.%s.%s is public and on no page", part, name)


def describe(app, pagename, templatename, context, doctree):
    """The first paragraph of a page is its description, where search engines and links show one."""
    paragraph = next(doctree.findall(nodes.paragraph), None) if doctree else None
    if paragraph is not None:
        words = html.escape(textwrap.shorten(paragraph.astext(), 200, placeholder=" …"), quote=True)
        context["metatags"] = context.get("metatags", "") + f'<meta name="description" content="{words}" />\n'


def fill_gallery(app, docname, source):
    """Puts the experiments into their page."""
    if docname == "gallery":
        source[0] = source[0].replace("<!-- entries -->", gallery.page())


def setup(app):
    app.connect("autodoc-process-docstring", mark_shapes, priority=400)  # before napoleon
    app.connect("autodoc-skip-member", skip_tuple_fields)
    app.connect("missing-reference", find_public_name)
    app.connect("html-page-context", describe)
    app.connect("source-read", fill_gallery)
    app.connect("env-check-consistency", warn_of_names_without_a_page)
