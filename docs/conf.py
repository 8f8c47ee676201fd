"""The site: `sphinx-build -W docs site`; Markdown pages, the API from docstrings, the examples run.

Sphinx, because it is what numpy, scipy and matplotlib are documented with: references to functions
are checked, docstrings and examples are run by it, and its warnings can be errors.
"""

import re
import sys
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
sys.path.insert(0, str(ROOT / "docs"))
from pages_to_watch import make_pages  # noqa: E402

import modal  # noqa: E402

project = "Waves in sphere packings"
author = "the authors of granular-wave-modes"
copyright = f"2026, {author}"
release = version = modal.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.intersphinx"]
extensions += ["sphinx_gallery.gen_gallery", "outputs"]
napoleon_google_docstring = False
INVENTORIES = {
    "python": ("https://docs.python.org/3", "python3.11/html"),
    "numpy": ("https://numpy.org/doc/stable", "python-numpy-doc/html"),
    "scipy": ("https://docs.scipy.org/doc/scipy", "python-scipy-doc/html"),
    "matplotlib": ("https://matplotlib.org/stable", "python-matplotlib-doc/html"),
    "h5py": ("https://docs.h5py.org/en/stable", "python-h5py-doc/html"),
}
"""Other projects to whose names references lead: their address, and the folder of Debian's package
of their pages, in which a list of names is."""
# Without the network a list that is not on this machine makes no link, and no warning either; with
# `-t online` all lists are fetched.
intersphinx_mapping = {}
for name, (address, folder) in INVENTORIES.items():
    inventory = Path("/usr/share/doc") / folder / "objects.inv"
    if tags.has("online"):  # noqa: F821 (Sphinx defines it)
        intersphinx_mapping[name] = (address, None)
    elif inventory.is_file():
        intersphinx_mapping[name] = (address, str(inventory))
html_theme = "furo"
html_title = "Waves in sphere packings"
html_static_path = ["_static"]
html_css_files = ["site.css"]
EXTRA = ROOT / "docs/_extra"
EXTRA.mkdir(exist_ok=True)  # before Sphinx looks for it; the pages to watch go there
SCRIPTS = {path.stem for path in (ROOT / "examples").glob("*.py")}
for page in (ROOT / "docs/examples").glob("*.rst"):  # of scripts that have gone since
    if page.stem not in SCRIPTS | {"index"}:
        page.unlink()
html_extra_path = [EXTRA.name]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
python_use_unqualified_type_names = True
exclude_patterns = ["_outputs"]
suppress_warnings = ["config.cache"]
sphinx_gallery_conf = {
    "examples_dirs": "../examples",  # not its folders: in them nothing is called README
    "gallery_dirs": "examples",
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"(^|/)_\w+\.py",  # what they share
    "within_subsection_order": "FileNameSortKey",
    "show_memory": False,
    "write_computation_times": False,  # its page would load scripts from the network
    "min_reported_time": 1e9,
    "default_thumb_file": str(ROOT / "docs/_static/table.png"),  # of those without a picture
    "remove_config_comments": True,
    "abort_on_example_error": True,
}
html_math_renderer = "mathml"


def as_literal(app, what, name, obj, options, lines):
    """Docstrings are written for people who read the source: what is code there is code here."""
    lines[:] = [re.sub(r"(?<!`)`([^`]+)`(?!`)", r"``\1``", line) for line in lines]
    lines[:] = [
        line if ">>>" in line else re.sub(r"(?<!``)\|(?!``)", r"\\|", line) for line in lines
    ]
    lines[:] = [re.sub(r"(?<![\w`])\*\.", r"\\*.", line) for line in lines]


def formula(display):
    """Return the writer of equations in MathML, which browsers draw without script or network."""

    def visit(translator, node):
        translator.body.append(convert(node.astext(), display=display))
        raise nodes.SkipNode

    return visit


def say_levels(app, pagename, templatename, context, doctree):
    """Give the captions of contents, which are headings to who hears the page, a level."""
    for part in ("body", "furo_navigation_tree"):
        if part in context:
            leveled = 'role="heading" aria-level="2"'
            context[part] = context[part].replace('role="heading"', leveled)


def setup(app):
    """Docstrings, equations, and the pages to watch."""
    app.connect("builder-inited", lambda app: make_pages(EXTRA, quick=app.tags.has("quick")))
    app.connect("html-page-context", say_levels, priority=900)  # after the theme
    app.connect("autodoc-process-docstring", as_literal, priority=400)  # before napoleon's
    app.add_html_math_renderer("mathml", (formula("inline"), None), (formula("block"), None))
