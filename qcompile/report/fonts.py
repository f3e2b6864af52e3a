"""What matplotlib says of fonts that are not installed: once, not for every piece of text."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

_MARK = "findfont: "


class _Once(logging.Filter):
    """Lets each message about fonts pass once in a process, in plain words."""

    def __init__(self) -> None:
        super().__init__()
        self._said: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        text = record.getMessage()
        if not text.startswith(_MARK) or record.levelno < logging.WARNING:
            return True
        if text in self._said:
            return False
        self._said.add(text)
        words = text.removeprefix(_MARK).rstrip(".")
        record.msg, record.args = f"{words}: another font is used instead.", ()
        return True


_once = _Once()


@contextmanager
def fonts_noted_once() -> Iterator[None]:
    """Within the block, a font that is missing is noted once."""
    log = logging.getLogger("matplotlib.font_manager")
    log.addFilter(_once)
    try:
        yield
    finally:
        log.removeFilter(_once)
