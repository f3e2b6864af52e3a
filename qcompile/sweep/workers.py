"""Worker processes that end when their parent process ends, however it ends."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

_LOOK_SECONDS = 0.5


@contextmanager
def deaf_children() -> Iterator[None]:
    """Processes started within the block ignore Ctrl-C: their parent handles it, and ends them.

    A terminal sends Ctrl-C to all of them; one that is still importing would print a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # children inherit the mask
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@cache
def end_with(parent: int) -> None:
    """Make this process end soon after its parent, the process `parent`, has ended.

    A process is not told that its parent was killed, but it then gets another parent.
    """
    if os.getpid() != parent:
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_SECONDS)
    os._exit(1)  # at once: nothing is left to return results to
