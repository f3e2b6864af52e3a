"""Reports as a reader meets them: in Chromium, wide and narrow, by eye, keyboard and ear."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from looking import WIDTHS, browser, needs_chromium, page_of

__all__ = ["browser"]

NAMED = {"image", "figure", "region", "table", "Video", "link", "button", "navigation", "heading"}
"""The roles that a screen reader reads by their names."""

pytestmark = needs_chromium


@pytest.mark.parametrize("kind", ["run", "evaluate", "calibrate", "study", "plan", "wide"])
def test_a_report_is_read(kind: str, browser: Any, report: Callable[[str], Path]) -> None:
    """By eye at two widths, by keyboard, by ear, and on a light page and a dark one."""
    with page_of(browser, report(kind)) as page:
        check_that_nothing_is_cut_off(page)
        check_that_a_keyboard_reaches_everything_once(page)
        check_that_a_screen_reader_has_names_and_headings_in_order(page)
        check_that_text_can_be_read(page)
        assert page.trouble == []
        loaded = page.evaluate("performance.getEntriesByType('resource').map(e => e.name)")
        assert [name for name in loaded if not name.startswith("data:")] == []


CUT_OFF = """() => {
  const inside = element => element.parentElement?.closest('.scroll, .sr, details:not([open])');
  const wide = document.documentElement.clientWidth, found = [];
  for (const element of document.body.querySelectorAll('*:not(.skip):not(.sr)')) {
    const box = element.getBoundingClientRect();
    if (inside(element) || !box.width || !box.height) continue;
    const scrolls = element.matches('.scroll');
    const clipped = element.scrollWidth > element.clientWidth + 1 && element.clientWidth > 0
      && getComputedStyle(element).overflowX !== 'visible' && !scrolls;
    if (box.left < -0.5 || box.right > wide + 0.5 || clipped)
      found.push(element.outerHTML.slice(0, 120));
  }
  return found;
}"""

OUT_OF_REACH = """() => [...document.querySelectorAll('*')].filter(element =>
  element.scrollWidth > element.clientWidth + 1 && element.tabIndex < 0
  && ['auto', 'scroll'].includes(getComputedStyle(element).overflowX)).length"""

FOCUSABLE = """() => [...document.querySelectorAll('a, summary, video, [tabindex="0"]')]
  .filter(element => element.checkVisibility() && !element.closest('details:not([open]) > div'))
  .length"""

HEADINGS = """() => [...document.querySelectorAll('h1, h2, h3, h4')].map(e => +e.tagName[1])"""


def check_that_nothing_is_cut_off(page: Any) -> None:
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.scrollingElement.scrollWidth") <= width
        assert page.evaluate(CUT_OFF) == []
        assert page.evaluate(OUT_OF_REACH) == 0


def check_that_a_keyboard_reaches_everything_once(page: Any) -> None:
    page.set_viewport_size({"width": WIDTHS[0], "height": 900})
    count = page.evaluate(FOCUSABLE)
    reached = []
    for _ in range(count):
        page.keyboard.press("Tab")
        reached.append(
            page.evaluate(
                """() => {
                  const e = document.activeElement, style = getComputedStyle(e);
                  e.dataset.reached = +(e.dataset.reached || 0) + 1;
                  return [e.tagName, e.dataset.reached, style.outlineStyle];
                }"""
            )
        )
    assert count >= 6
    assert {name for name, _, _ in reached}.isdisjoint({"BODY", "HTML"})
    others = [one for one in reached if one[0] != "VIDEO"]  # whose controls are stops of its own
    if others == reached:
        assert {times for _, times, _ in others} == {"1"}
    assert {outline for _, _, outline in others} == {"solid"}


def check_that_a_screen_reader_has_names_and_headings_in_order(page: Any) -> None:
    session = page.context.new_cdp_session(page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    shown = [node for node in nodes if not node["ignored"] and "role" in node]
    roles = {node["role"]["value"] for node in shown}
    assert {"main", "navigation", "banner", "contentinfo", "heading"} <= roles
    nameless = [
        node["role"]["value"]
        for node in shown
        if node["role"]["value"] in NAMED and not node.get("name", {}).get("value", "").strip()
    ]
    assert nameless == []
    levels = page.evaluate(HEADINGS)
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))
    images = [node for node in shown if node["role"]["value"] == "image"]
    assert images, "a report has a figure"


CONTRAST = """() => {
  const light = ([r, g, b]) => [r, g, b].map(v => v / 255)
    .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
  const canvas = document.createElement('canvas').getContext('2d', {willReadFrequently: true});
  const numbers = colour => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  };
  const below = element => {
    for (let e = element; e; e = e.parentElement) {
      const colour = numbers(getComputedStyle(e).backgroundColor);
      if (colour[3] === 255) return colour;
    }
    return [255, 255, 255, 255];
  };
  const found = [];
  for (const element of document.querySelectorAll('body *')) {
    const has = [...element.childNodes].some(n => n.nodeType === 3 && n.textContent.trim());
    if (!has || !element.checkVisibility()) continue;
    const style = getComputedStyle(element);
    const ink = numbers(element.closest('svg') ? style.fill : style.color);
    const a = light(ink), b = light(below(element));
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    const least = element.closest('svg') ? 3 : 4.5;
    if (ratio < least) found.push([element.outerHTML.slice(0, 90), ratio]);
  }
  return found;
}"""


def check_that_text_can_be_read(page: Any) -> None:
    """WCAG 2 asks for 4.5 to 1, and for 3 to 1 in graphics."""
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        assert page.evaluate(CONTRAST) == []


def test_a_name_from_a_file_is_text(browser: Any, report: Callable[[str], Path]) -> None:
    opened = browser.new_page()
    opened.on("dialog", lambda dialog: pytest.fail(f"a script ran: {dialog.message}"))
    opened.goto(report("run").as_uri())
    assert opened.title().startswith("<script>alert(1)</script>\"'&amp;$x$ on ibm_lima")
    assert opened.locator("h1").inner_text() == "<script>alert(1)</script>\"'&amp;$x$ on ibm_lima"
    assert opened.locator("script").count() == 0
    assert opened.locator("video").evaluate("v => v.videoWidth") > 0
    opened.close()
