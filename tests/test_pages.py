"""The built pages: nothing that was written is lost as an unknown HTML tag."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

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
