"""Ctrl-C, without tracebacks from packages that it would interrupt while they load."""

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
    """Within the block, Ctrl-C during an import raises KeyboardInterrupt after that import.

    A package interrupted while it loads raises errors of its own, or is incomplete when it is used
    next.
    """
    before = signal.getsignal(signal.SIGINT)
    on_main_thread = threading.current_thread() is threading.main_thread()
    if not on_main_thread or before is not signal.default_int_handler:
        yield  # the program that runs this one handles Ctrl-C
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
    """Whether an import is running in the frame or in one of its callers."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False
