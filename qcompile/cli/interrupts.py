"""Ctrl-C, without the tracebacks of packages that it would break off half loaded."""

from __future__ import annotations

import _thread
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_LOOK_SECONDS = 0.01


@contextmanager
def after_imports() -> Iterator[None]:
    """Within the block Ctrl-C raises KeyboardInterrupt once the import it comes in is done.

    A package that is broken off raises errors of its own, or is not whole when it is used next.
    """
    before = signal.getsignal(signal.SIGINT)
    on_main_thread = threading.current_thread() is threading.main_thread()
    if not on_main_thread or before is not signal.default_int_handler:
        yield  # somebody else decides what Ctrl-C does
        return
    signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _interrupt(_: int, frame: FrameType | None) -> None:
    if not _imports(frame):
        raise KeyboardInterrupt
    again = threading.Timer(_LOOK_SECONDS, _thread.interrupt_main)
    again.daemon = True
    again.start()


def _imports(frame: FrameType | None) -> bool:
    """Whether an import is under way in the frame or one that led to it."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False
