"""Letters on a picture: the DejaVu fonts that come with matplotlib, on every system the same."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qcompile.terminal import one_line

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

Colour = tuple[int, int, int]
Picture = NDArray[np.uint8]

_CUT = "…"


@lru_cache
def _font(size: int, bold: bool) -> FreeTypeFont:
    import matplotlib
    from PIL.ImageFont import Layout, truetype

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name
    return truetype(str(path), size, layout_engine=Layout.BASIC)


def width_of(text: str, size: int, *, bold: bool = False) -> int:
    """How many pixels a line of text is wide."""
    return round(_font(size, bold).getlength(text))


def fitted(text: str, width: int, size: int, *, bold: bool = False) -> str:
    """A text as one line of at most `width` pixels; what is too long ends with an ellipsis."""
    line = one_line(text)
    if width_of(line, size, bold=bold) <= width:
        return line
    while line and width_of(line + _CUT, size, bold=bold) > width:
        line = line[:-1].rstrip()
    return line + _CUT


@lru_cache(maxsize=512)
def _mask(text: str, size: int, bold: bool) -> NDArray[np.uint16]:
    """How much of each pixel the letters cover, from 0 to 255, (height, width, 1)."""
    from PIL import Image, ImageDraw

    width, height = width_of(text, size, bold=bold) + 2, round(1.3 * size)
    image = Image.new("L", (width, height))
    ImageDraw.Draw(image).text((0, 0), text, fill=255, font=_font(size, bold))
    return np.asarray(image, dtype=np.uint16)[:, :, np.newaxis]


def write(
    picture: Picture,
    text: str,
    x: int,
    y: int,
    size: int,
    colour: Colour,
    *,
    bold: bool = False,
    align: float = 0.0,
) -> None:
    """Write a line of text into a picture (height, width, 3), its top at `y`.

    It begins at `x` with `align` 0, is centred there with 0.5 and ends there with 1. What lies
    outside the picture is cut off.
    """
    mask = _mask(text, size, bold)
    x = max(x - round(align * width_of(text, size, bold=bold)), 0)
    part = picture[y : y + len(mask), x : x + mask.shape[1]]
    mask = mask[: len(part), : part.shape[1]]
    part[:] = (part * (255 - mask) + np.array(colour, dtype=np.uint16) * mask + 127) // 255
