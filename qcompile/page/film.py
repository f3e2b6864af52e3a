"""A film within a report."""

from __future__ import annotations

from base64 import b64encode
from io import BytesIO
from pathlib import Path

from markupsafe import Markup

from qcompile.page.document import Film

_MEDIA = {".mp4": "video/mp4", ".webm": "video/webm", ".gif": "image/gif"}
_SECONDS_IN = 1.5
"""Where the still is taken from: the first frame shows little of an episode."""


def film_block(path: Path, label: str, text: str) -> Film | None:
    """The film of a file, as a block of a report; None where the file is not there any more."""
    media = _MEDIA.get(path.suffix)
    if media is None or not path.is_file():
        return None
    contents = path.read_bytes()
    still = Markup("") if media == "image/gif" else _poster(path)
    return Film(label, media, _data_uri(media, contents), still, text)


def _data_uri(media: str, contents: bytes) -> Markup:
    return Markup(f"data:{media};base64,{b64encode(contents).decode()}")


def _poster(path: Path) -> Markup:
    """A frame of the film as a picture, for readers on paper, and before it is played."""
    from imageio import v2
    from PIL import Image

    with v2.get_reader(path) as reader:
        frames = max(int(reader.count_frames()), 1)
        at = int(_SECONDS_IN * float(reader.get_meta_data()["fps"]))
        frame = reader.get_data(min(at, frames - 1))
    stream = BytesIO()
    Image.fromarray(frame).save(stream, format="JPEG", quality=82)
    return _data_uri("image/jpeg", stream.getvalue())
