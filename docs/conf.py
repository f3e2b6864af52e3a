"""How Sphinx builds these pages: `make docs` writes them into site/."""

from __future__ import annotations

import os
import sys
import tomllib
from pathlib import Path

CHECKOUT = Path(__file__).parents[1]
sys.path.insert(0, str(CHECKOUT))

from qcompile.version import __version__  # noqa: E402


def repository() -> str | None:
    """Where the sources are published, if it is known: $QCOMPILE_REPOSITORY, or pyproject.toml."""
    with (CHECKOUT / "pyproject.toml").open("rb") as file:
        urls = tomllib.load(file)["project"].get("urls", {})
    return os.environ.get("QCOMPILE_REPOSITORY") or urls.get("Repository")


project = "qcompile"
copyright = "the qcompile authors"
release = version = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_click",
    "sphinx_copybutton",
]
myst_enable_extensions = ["attrs_inline", "colon_fence"]
myst_heading_anchors = 4
smartquotes = False
default_role = "literal"  # docstrings mark code with single backticks, as Markdown does

autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 80
python_use_unqualified_type_names = True

html_theme = "furo"
html_title = f"qcompile {version}"
html_logo = html_favicon = "images/logo.svg"
html_static_path = ["static"]
html_css_files = ["pages.css"]
html_theme_options: dict[str, object] = {}
if address := repository():
    html_theme_options["source_edit_link"] = f"{address.rstrip('/')}/edit/main/docs/{{filename}}"
