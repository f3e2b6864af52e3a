"""A film within a report."""

from __future__ import annotations

from base64 import b64encode

from markupsafe import Markup

from qcompile.page.document import Film
from qcompile.report.clip import Clip


def film_block(clip: Clip, label: str, text: str) -> Film:
    """A film, with its still for readers on paper and before it is played, as a block."""
    still = _data_uri("image/png", clip.poster)
    return Film(label, clip.media_type, _data_uri(clip.media_type, clip.data), still, text)


def _data_uri(media: str, contents: bytes) -> Markup:
    return Markup(f"data:{media};base64,{b64encode(contents).decode()}")
