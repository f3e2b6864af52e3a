"""How Sphinx builds these pages: `make docs` writes them into site/."""

from __future__ import annotations

import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

from sphinx.addnodes import desc_annotation

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


# What a reader of a signature does not need: modules, shapes of arrays, defaults without a literal.
_PLAIN = (
    (re.compile(r"~?\b(?:[a-z_]\w*\.)+(?=[A-Za-z])"), ""),
    (re.compile(r"ndarray\[tuple\[Any, \.\.\.\], dtype\[(\w+)\]\]"), "ndarray[\\1]"),
    (re.compile(r" \| Planned\b"), ""),
    (re.compile(r" \(live: planned\)"), ""),
    (re.compile(r"<factory>"), "{}"),
    (re.compile(r"<function \w+(?: at \w+)?>"), "..."),
)


def without_annotations(words: str) -> str:
    """`Annotated[X, ...]` as X, at every depth: the checks of a value are in its docstring."""
    before, mark, after = words.partition("Annotated[")
    if not mark:
        return words
    depth, first_end = 1, None
    for i, letter in enumerate(after):
        depth += (letter in "([") - (letter in ")]")
        if depth == 1 and letter == "," and first_end is None:
            first_end = i
        if depth == 0:
            return without_annotations(before + after[:first_end] + after[i + 1 :])
    return words


def plain_signature(
    app: object, what: str, name: str, obj: object, options: object, signature: str, result: str
) -> tuple[str, str]:
    """The signature as a user would write it."""
    for pattern, words in _PLAIN:
        signature = pattern.sub(words, signature) if signature else signature
        result = pattern.sub(words, result) if result else result
    return signature and without_annotations(signature), result


def starts_with_prose(
    app: object, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Napoleon would take the words before a colon for the type of an attribute."""
    if what in ("attribute", "data", "property"):
        lines.insert(0, "")


def without_checks(app: object, domain: str, kind: str, content: Any) -> None:
    """Drop the type of an attribute where pydantic's checks hide it; the class signature has it."""
    for annotation in [*content.parent.findall(desc_annotation)]:
        if "FieldInfo" in annotation.astext():
            annotation.parent.remove(annotation)


def commands_as_code(app: object, ctx: object, lines: list[str]) -> None:
    """Show the lines of a help page that sphinx-click marks with bars, as typed, as code."""
    code = [line.startswith("| ") for line in lines]
    for index in range(len(lines) - 1, -1, -1):
        if code[index]:
            lines[index] = f"    {lines[index][2:]}"
            if index == 0 or not code[index - 1]:
                lines[index:index] = [".. code-block:: text", ""]


def setup(app: Any) -> None:
    app.connect("sphinx-click-process-description", commands_as_code)
    app.connect("autodoc-process-signature", plain_signature)
    app.connect("autodoc-process-docstring", starts_with_prose, priority=400)
    app.connect("object-description-transform", without_checks)
