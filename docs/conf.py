"""The site: `sphinx-build -W docs site`; Markdown pages, the API from docstrings, the examples run.

Sphinx, because it is what numpy, scipy and matplotlib are documented with: references to functions
are checked, docstrings and examples are run by it, and its warnings can be errors.
"""

import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from docutils import nodes
from latex2mathml.converter import convert

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
import modal  # noqa: E402
from analysis.watch import watch_page  # noqa: E402
from modal.modes.mode_set import write_modes  # noqa: E402
from modal.packing.network_file import write_network  # noqa: E402
from modal.waves.signals import write_signals  # noqa: E402

project = "Waves in sphere packings"
author = "the authors of granular-wave-modes"
copyright = f"2026, {author}"
release = version = modal.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_gallery.gen_gallery"]
html_theme = "furo"
html_title = "Waves in sphere packings"
html_static_path = ["_static"]
html_css_files = ["site.css"]
EXTRA = ROOT / "docs/_extra"
EXTRA.mkdir(exist_ok=True)  # before Sphinx looks for it; pages_to_watch fills it
html_extra_path = [EXTRA.name]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
python_use_unqualified_type_names = True
suppress_warnings = ["config.cache"]
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "examples",
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "show_memory": False,
    "min_reported_time": 1e9,
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
    """What writes an equation as MathML, which browsers draw without a script or a network."""

    def visit(translator, node):
        translator.body.append(convert(node.astext(), display=display))
        raise nodes.SkipNode

    return visit


def pages_to_watch(app):
    """The wave and the modes of a small crystal, which the page about watching links to."""
    network = modal.fcc(cells=(4, 4, 40))
    with TemporaryDirectory() as folder:
        packing, wave, modes = (
            Path(folder) / f"crystal.{kind}.h5" for kind in ("network", "signals", "modes")
        )
        write_network(packing, network)
        write_signals(wave, modal.propagate(network, duration=1.5e-4, particles=True).signals)
        write_modes(modes, modal.eigenmodes(network, lowest=20, shapes=True))
        watch_page(wave, EXTRA / "crystal_wave.html", packing)
        watch_page(modes, EXTRA / "crystal_modes.html", packing)


def setup(app):
    """Docstrings, equations, and the pages to watch."""
    app.connect("builder-inited", pages_to_watch)
    app.connect("autodoc-process-docstring", as_literal)
    app.add_html_math_renderer("mathml", (formula("inline"), None), (formula("block"), None))
