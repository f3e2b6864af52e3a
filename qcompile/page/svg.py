"""Figures as inline SVG: their colours follow the page, and nothing in them runs or is fetched.

Neutral colours become mixtures of the page's ink and paper, those of the figures' palette become
variables that the style sheet lightens on a dark page; a reader without these sees them as drawn.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

from markupsafe import Markup

from qcompile.live.client_errors import without_secrets

_SVG, _XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
_SHAPES = {
    *("svg", "g", "defs", "clipPath", "use", "symbol", "path", "rect", "circle", "ellipse"),
    *("line", "polyline", "polygon", "text", "tspan", "image", "marker", "linearGradient", "stop"),
}
"""The elements that are kept: no scripts, style sheets, links, or pages within the picture."""
_PAINTS = ("fill", "stroke", "stop-color")
_NAMED = {"black": "#000000", "white": "#ffffff"}
_HEX = re.compile(r"#([0-9a-fA-F]{6}|[0-9a-fA-F]{3})\b")
_LOCAL = re.compile(r"url\(\s*[\"']?#([^)\"']+)[\"']?\s*\)")
_LENGTH = re.compile(r"([\d.]+)\s*(pt|px|in|)")
_PX = {"pt": 96 / 72, "px": 1.0, "in": 96.0, "": 1.0}


def inline(svg: str, prefix: str) -> tuple[Markup, float]:
    """The picture as an element of a page, and its width in CSS pixels.

    `prefix` is put before its ids, so that several pictures stand in one page. Its name is given by
    what surrounds it: the picture itself is hidden from screen readers, whose users would hear
    every label of an axis by itself.
    """
    root = ElementTree.fromstring(svg)
    width_px = _width_px(root)
    kept = _kept(root, prefix)
    for name in ("width", "height", "version", "role", "aria-label"):
        kept.attrib.pop(name, None)
    kept.set("stroke-linejoin", "round")  # what matplotlib says in a style sheet
    kept.set("aria-hidden", "true")
    kept.set("focusable", "false")
    text = ElementTree.tostring(kept, encoding="unicode")
    return Markup(text), width_px


def _width_px(root: ElementTree.Element) -> float:
    match = _LENGTH.fullmatch(root.get("width", ""))
    if match is not None:
        return float(match[1]) * _PX[match[2]]
    return float(root.get("viewBox", "0 0 480 320").split()[2])


def _kept(element: ElementTree.Element, prefix: str) -> ElementTree.Element:
    """The element with those within it that are shapes or text, and their own attributes."""
    kept = ElementTree.Element(element.tag.removeprefix(f"{{{_SVG}}}"))
    style = dict(_declarations(element.get("style", "")))
    for name, value in element.attrib.items():
        if name in _PAINTS:
            style.setdefault(name, value)
        elif name == "id":
            kept.set("id", f"{prefix}-{value}")
        elif name in ("href", f"{{{_XLINK}}}href"):
            if value.startswith("#"):
                kept.set("href", f"#{prefix}-{value[1:]}")
            elif value.startswith("data:image/png;base64,"):
                kept.set("href", value)
        elif not name.startswith(("on", "{", "style", "class")):
            kept.set(name, _local(value, prefix))
    if style:
        pairs = (f"{name}:{_painted(name, _local(v, prefix))}" for name, v in style.items())
        kept.set("style", ";".join(pairs))
    is_text = kept.tag in ("text", "tspan")
    kept.text = without_secrets(element.text or "") if is_text else None
    for child in element:
        if child.tag.removeprefix(f"{{{_SVG}}}") in _SHAPES:
            inner = _kept(child, prefix)
            inner.tail = without_secrets(child.tail or "") if is_text else None
            kept.append(inner)
    return kept


def _declarations(style: str) -> list[tuple[str, str]]:
    pairs = (part.partition(":") for part in style.split(";") if ":" in part)
    return [(name.strip(), value.strip()) for name, _, value in pairs]


def _local(value: str, prefix: str) -> str:
    """The value with references within the picture alone."""
    value = _LOCAL.sub(lambda match: f"URL(#{prefix}-{match[1]})", value)
    return re.sub(r"url\([^)]*\)", "none", value).replace("URL(", "url(")


def _painted(name: str, value: str) -> str:
    """The value of a style property, its colour one that follows the page."""
    if name not in _PAINTS:
        return value
    return _HEX.sub(_followed, _NAMED.get(value, value))


def _followed(match: re.Match[str]) -> str:
    digits = match[1].lower()
    if len(digits) == 3:
        digits = "".join(2 * digit for digit in digits)
    red, green, blue = (int(digits[k : k + 2], 16) for k in (0, 2, 4))
    if max(red, green, blue) - min(red, green, blue) <= 4:
        return f"var(--grey-{round(20 * (1 - green / 255)) * 5})"
    return f"var(--c-{digits}, #{digits})"
