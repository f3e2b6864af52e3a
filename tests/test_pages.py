"""The built pages: nothing that was written is lost as an unknown HTML tag."""

from __future__ import annotations

import os
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
        span strong style sub summary sup svg table tbody td th thead title tr u ul video""",
    )
)


class Tags(HTMLParser):
    """Collects the tags of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.found: set[str] = set()

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.found.add(tag)


def unknown_tags(html: str) -> set[str]:
    tags = Tags()
    tags.feed(html)
    return tags.found - HTML


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The documentation, built as `make docs` builds it."""
    folder = tmp_path_factory.mktemp("site")
    words = ["build", "--strict", "--quiet", "--site-dir", str(folder)]
    subprocess.run(
        [sys.executable, "-m", "mkdocs", *words],
        cwd=CHECKOUT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        check=True,
    )
    return folder


def test_no_page_loses_words_in_an_unknown_tag(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 15
    lost = {str(page.relative_to(site)): unknown_tags(page.read_text()) for page in pages}
    assert not {page: tags for page, tags in lost.items() if tags}


def test_expectations_are_on_the_pages(site: Path) -> None:
    for page in ("mitigation", "python", "commands", "compilation"):
        assert "&lt;Z&gt;" in (site / page / "index.html").read_text(), page


def test_a_bare_expectation_would_be_noticed() -> None:
    assert unknown_tags("<p>a device shows a distorted <Z>.</p>") == {"z"}
