"""A document as HTML: one page that opens offline, on paper and on a phone."""

from __future__ import annotations

import platform
from base64 import b64encode
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from qcompile.characters import for_markup
from qcompile.errors import OptionError
from qcompile.live.client_errors import without_secrets
from qcompile.output import write_file
from qcompile.page.document import Document
from qcompile.page.svg import inline
from qcompile.version import versions

if TYPE_CHECKING:
    from jinja2 import Environment

SUFFIX = ".html"
_GREYS = range(0, 101, 5)


def render(document: Document, now: datetime | None = None) -> str:
    """The page: everything that it shows is in it. `now` is when it says that it was written."""
    made = now or datetime.now(UTC)
    known = versions(*document.packages)
    named = {"qcompile": known.pop("qcompile"), "Python": platform.python_version()} | known
    sections = [section for section in document.sections if section.blocks]
    return (
        _environment()
        .get_template("page.html")
        .render(
            document=document,
            sections=sections,
            made=f"{made.astimezone(UTC):%d %B %Y, %H:%M} UTC".lstrip("0"),
            versions={name: number for name, number in named.items() if number != "none"},
            greys=_GREYS,
        )
    )


def write_report(document: Document, path: Path) -> None:
    """Write the page to a .html file, which is overwritten.

    Raises:
        OptionError: the file has another suffix.
        OutputError: it cannot be written.
    """
    check_suffix(path)
    write_file(path, render(document).encode())


def check_suffix(path: Path) -> None:
    """Nothing, if the name is one of a page.

    Raises:
        OptionError: it is not.
    """
    if path.suffix != SUFFIX:
        raise OptionError(f"{path} must end with {SUFFIX}.")


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("qcompile.page"),
        autoescape=True,
        finalize=_public,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"inline": inline, "uri": _uri}
    return environment


def _uri(data: bytes, media: str) -> Markup:
    """A file within the page."""
    return Markup(f"data:{media};base64,{b64encode(data).decode()}")


def _public(value: Any) -> Any:
    """What an expression of a template shows, without tokens; markup is as it was made."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return for_markup(without_secrets(value))
