"""The built pages: nothing that was written is lost as an unknown HTML tag."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import click
import pytest
from looking import WIDTHS, browser, needs_chromium, page_of

from qcompile.cli.group import cli

__all__ = ["browser"]

CHECKOUT = Path(__file__).parents[1]
HTML = set(
    re.findall(
        r"\w+",
        """a abbr article aside b blockquote body br button code dd del details div dl dt em
        figcaption figure footer form h1 h2 h3 h4 h5 h6 head header hr html i img input ins kbd
        label li link main mark meta nav noscript ol p path picture pre script section small source
        span strong style sub summary sup table tbody td th thead title tr u ul video""",
    )
)


class Links(HTMLParser):
    """Collects where a page links to, and the places in it that can be linked."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: set[str] = set()
        self.places: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.targets |= {values[name] or "" for name in ("href", "src") if name in values}
        if "id" in values:
            self.places.add(values["id"] or "")


def broken_links(pages: dict[Path, str]) -> set[tuple[str, str]]:
    """Links, images and anchors of these pages that lead nowhere: (page, target)."""
    read = {}
    for path, html in pages.items():
        read[path.resolve()] = links = Links()
        links.feed(html)
    broken = set()
    for path, links in read.items():
        for target in links.targets:
            place, _, anchor = unquote(target).partition("#")
            if re.match(r"\w+:", place):
                continue  # of another site, or data in the page
            file = (path.parent / place.partition("?")[0]).resolve() if place else path
            there = file.is_file() and (
                not anchor or file not in read or anchor in read[file].places
            )
            if not there:
                broken.add((path.name, target))
    return broken


class Tags(HTMLParser):
    """Collects the tags of a page; the theme's icons, which are SVG, have tags of their own."""

    def __init__(self) -> None:
        super().__init__()
        self.found: set[str] = set()
        self.drawing = 0

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.drawing += tag == "svg"
        if not self.drawing:
            self.found.add(tag)

    def handle_endtag(self, tag: str) -> None:
        self.drawing -= tag == "svg"


def unknown_tags(html: str) -> set[str]:
    tags = Tags()
    tags.feed(html)
    return tags.found - HTML


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The documentation, built as `make docs` builds it."""
    folder = tmp_path_factory.mktemp("site")
    words = ["--fail-on-warning", "--keep-going", "--quiet", "docs", str(folder)]
    subprocess.run([sys.executable, "-m", "sphinx", *words], cwd=CHECKOUT, check=True)
    return folder


def test_no_page_loses_words_in_an_unknown_tag(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 15
    lost = {str(page.relative_to(site)): unknown_tags(page.read_text()) for page in pages}
    assert not {page: tags for page, tags in lost.items() if tags}


def test_every_link_image_and_anchor_leads_somewhere(site: Path) -> None:
    pages = {page: page.read_text() for page in site.rglob("*.html")}
    assert not broken_links(pages)


@needs_chromium
def test_no_page_is_wider_than_a_screen_or_a_phone(site: Path, browser: Any) -> None:
    pages = [page for page in sorted(site.rglob("*.html")) if "_static" not in page.parts]
    assert len(pages) > 15
    wide = set()
    with page_of(browser, pages[0]) as page:
        for width in WIDTHS:
            page.set_viewport_size({"width": width, "height": 900})
            for path in pages:
                page.goto(path.as_uri())
                if page.evaluate("document.scrollingElement.scrollWidth") > width:
                    wide.add((path.name, width))
        assert page.trouble == []
    assert not wide


def test_broken_links_would_be_noticed(tmp_path: Path) -> None:
    html = '<a href="b.html">b</a><a href="#far">c</a><img src="d.png"><p id="near"></p>'
    right = '<a href="#near">e</a><a href="https://example.org/x">f</a>'
    (tmp_path / "a.html").write_text(html + right)
    found = broken_links({tmp_path / "a.html": html + right})
    assert found == {("a.html", "b.html"), ("a.html", "#far"), ("a.html", "d.png")}


def test_the_python_reference_has_the_public_names_with_types(site: Path) -> None:
    import qcompile

    html = (site / "reference/python.html").read_text()
    missing = {name for name in qcompile.__all__ if f'id="qcompile.{name}"' not in html}
    assert not missing
    shown = re.sub("<[^>]+>", "", html)
    assert "episodes: int" in shown
    assert not re.findall(r'id="qcompile\.[\w.]*\._[a-z]\w*"', html), "internals"


def test_the_commands_page_has_every_command_and_option(site: Path) -> None:
    html = (site / "reference/commands.html").read_text()
    shown = re.sub("<[^>]+>", "", html)
    context = click.Context(cli)
    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        assert command is not None
        options = [o for p in command.params if isinstance(p, click.Option) for o in p.opts]
        assert not [option for option in options if option not in shown], name


def test_commands_of_a_help_page_are_code_on_the_commands_page(site: Path) -> None:
    """Beside each is what it does: without the spaces between them the two were one sentence."""
    blocks = re.findall(r"<pre>(.*?)</pre>", (site / "reference/commands.html").read_text(), re.S)
    texts = [re.sub(r"<[^>]*>", "", block) for block in blocks]
    shown = "qcompile run --backend ibm_lima        play the shipped LunarLander policy"
    assert any(shown in text for text in texts)


def test_expectations_are_on_the_pages(site: Path) -> None:
    for page in (
        "background/mitigation",
        "background/compilation",
        "reference/python",
        "reference/commands",
    ):
        assert "&lt;Z&gt;" in (site / f"{page}.html").read_text(), page


def test_a_bare_expectation_would_be_noticed() -> None:
    assert unknown_tags("<p>a device shows a distorted <Z>.</p>") == {"z"}
