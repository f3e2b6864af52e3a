"""Figures within a page: nothing runs, nothing is fetched, no name is taken twice."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from qcompile.page.svg import inline

HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
    'width="144pt" height="72pt" viewBox="0 0 144 72">'
)


def drawn(body: str, prefix: str = "b1") -> str:
    return str(inline(f"{HEAD}{body}</svg>", prefix)[0])


def test_its_width_is_in_pixels() -> None:
    assert inline(f"{HEAD}</svg>", "b1")[1] == 144 * 96 / 72
    assert inline('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 300 20"/>', "b")[1] == 300


@pytest.mark.parametrize(
    "body",
    [
        "<script>alert(1)</script>",
        '<g onload="alert(1)" class="score"/>',
        "<foreignObject><b>alert</b></foreignObject>",
        "<style>* { fill: url(https://alert) }</style>",
        '<a href="javascript:alert(1)"><rect width="1"/></a>',
        '<use href="https://alert"/>',
        '<image xlink:href="https://alert"/>',
        '<rect style="fill: url(https://alert#a)" clip-path="url(https://alert)"/>',
        "<metadata>alert</metadata><!-- alert -->",
    ],
)
def test_what_runs_or_is_fetched_is_left_out(body: str) -> None:
    kept = drawn(body)
    assert not re.search("alert|https|script|class", kept)
    ElementTree.fromstring(kept)


def test_text_stays_text() -> None:
    assert "&lt;b&gt; &amp; &lt;/script&gt;" in drawn(
        "<text>&lt;b&gt; &amp; &lt;/script&gt;</text>"
    )


def test_two_figures_share_no_ids() -> None:
    body = (
        '<defs><clipPath id="a"><rect width="9"/></clipPath><path id="m" d="M0 0"/></defs>'
        '<use xlink:href="#m" clip-path="url(#a)" style="stroke: #000000"/>'
    )
    first, second = drawn(body, "b1"), drawn(body, "b2")
    assert set(re.findall(r'id="([^"]+)"', first)) == {"b1-a", "b1-m"}
    assert 'href="#b1-m"' in first
    assert 'clip-path="url(#b1-a)"' in first
    assert "b1" not in second


def test_neutral_colours_follow_the_page_and_others_can() -> None:
    body = (
        '<rect style="fill: #ffffff"/><path style="stroke: #000000; fill: none"/>'
        '<path style="fill: #0072b2" stroke="#777"/><text style="fill: black">a</text>'
    )
    styles = re.findall(r'style="([^"]+)"', drawn(body))
    assert styles == [
        "fill:var(--grey-0)",
        "stroke:var(--grey-100);fill:none",
        "fill:var(--c-0072b2, #0072b2);stroke:var(--grey-55)",
        "fill:var(--grey-100)",
    ]
