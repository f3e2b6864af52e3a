"""Chromium, for tests that look at pages as a reader does."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium")
ARGUMENTS = [
    *("--no-sandbox", "--disable-gpu", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync"),
]
WIDTHS = (1280, 390)

needs_chromium = pytest.mark.skipif(
    CHROMIUM is None and os.environ.get("CI") != "true",
    reason="Chromium is not installed: pages are not looked at. Debian: apt-get install chromium",
)


@pytest.fixture(scope="module")  # while it is open, this thread has a running event loop
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as started:
        assert CHROMIUM is not None, "the checks need Chromium: apt-get install chromium"
        opened = started.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield opened
        opened.close()


@contextmanager
def page_of(browser: Any, path: Path) -> Iterator[Any]:
    """A page, opened from its file; `trouble` is what it says on the console or loads."""
    opened = browser.new_page(viewport={"width": WIDTHS[0], "height": 900})
    opened.trouble = []
    opened.on("console", lambda message: opened.trouble.append(message.text))
    opened.on("pageerror", lambda error: opened.trouble.append(str(error)))
    opened.on(
        "request",
        lambda asked: asked.url.startswith(("data:", "file:")) or opened.trouble.append(asked.url),
    )
    opened.goto(path.as_uri())
    yield opened
    opened.close()
