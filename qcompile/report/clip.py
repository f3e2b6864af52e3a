"""A finished film, in memory: what a notebook or a page shows."""

from __future__ import annotations

import io
from base64 import b64encode
from dataclasses import dataclass
from html import escape

from qcompile.report.lettering import Picture


@dataclass(frozen=True, eq=False, repr=False)
class Clip:
    """A finished film: the bytes of its file, of `media_type`, and a still of it, a PNG.

    `frames` were filmed, `rate` of them in a second, of `width` and `height` pixels; a notebook
    shows it.
    """

    data: bytes
    media_type: str
    poster: bytes
    width: int
    height: int
    frames: int
    rate: float

    @classmethod
    def of(cls, data: bytes, media_type: str, still: Picture, frames: int, rate: float) -> Clip:
        """The film with a picture (height, width, 3) as its still."""
        from PIL import Image

        file = io.BytesIO()
        Image.fromarray(still).save(file, "png", optimize=True)
        height, width = still.shape[:2]
        return cls(data, media_type, file.getvalue(), width, height, frames, rate)

    @property
    def seconds(self) -> float:
        return self.frames / self.rate

    def html(self, description: str = "Film of an episode") -> str:
        """An HTML element that plays the film and holds all of it."""
        source = f"data:{self.media_type};base64,{b64encode(self.data).decode()}"
        size, words = f'width="{self.width}" height="{self.height}"', escape(description)
        style = 'style="max-width:100%;height:auto"'
        if self.media_type.startswith("image/"):
            return f'<img src="{source}" {size} {style} alt="{words}">'
        poster = f"data:image/png;base64,{b64encode(self.poster).decode()}"
        return (
            f'<video controls loop muted playsinline src="{source}" poster="{poster}" {size} '
            f'{style} aria-label="{words}"></video>'
        )

    def _repr_html_(self) -> str:
        return self.html()

    def __repr__(self) -> str:
        return f"Clip({self.media_type}, {self.frames:,} frames, {len(self.data):,} bytes)"
