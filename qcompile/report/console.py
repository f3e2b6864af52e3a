"""The console for all tables and progress bars: rich's, with plain text."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from qcompile.terminal import plain


class PlainConsole(Console):
    """rich's console; escape sequences come only from rich, never from printed text."""

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        for segment in super().render(renderable, options):
            if segment.control:
                yield segment
            else:
                yield Segment(plain(segment.text), segment.style)


def console(*, stderr: bool = False, **settings: Any) -> PlainConsole:
    """A console on the stream below `plain_output`, which would remove rich's colours."""
    stream = sys.stderr if stderr else sys.stdout
    return PlainConsole(file=getattr(stream, "rich_proxied_file", stream), **settings)
