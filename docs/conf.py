"""The pages of docs/ as a site: `sphinx-build -W docs build/docs`. The reference is made from the code."""

from __future__ import annotations

import importlib.metadata
import os
import sys
from pathlib import Path

from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent))
os.environ["COLUMNS"] = "100"  # of the command's help, whatever terminal builds the pages

project = "conespot"
release = importlib.metadata.version("conespot")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
suppress_warnings = ["misc.highlighting_failure"]  # a block of a language without colours is still a block
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_preserve_defaults = True
html_theme = "furo"
html_title = "conespot"
html_show_copyright = False
html_copy_source = False
html_static_path = ["style"]
html_css_files = ["tables.css"]


def _write_reference(app: Sphinx) -> None:
    """Write the pages that are made from the models and the parser, where they are not what stands there."""
    from reference_pages import PAGES

    for name, make in PAGES.items():
        page, text = Path(app.srcdir) / "reference" / f"{name}.md", make()
        if not page.is_file() or page.read_text("utf-8") != text:
            page.write_text(text, "utf-8")


def setup(app: Sphinx) -> None:
    """Have the reference made before pages are read."""
    app.connect("builder-inited", _write_reference)
