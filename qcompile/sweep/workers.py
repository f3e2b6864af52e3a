"""Worker processes that end with the process they work for, however that ends."""

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
    """Processes that are started within do not hear Ctrl-C: their parent does, and ends them.

    A terminal sends it to all; in one that is still importing it would end in a traceback.
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
    """Have this process end soon after its parent, the process `parent`, has; said once for all.

    Nothing tells a process that its parent was killed, but it has another parent from then on.
    """
    if os.getpid() != parent:
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_SECONDS)
    os._exit(1)  # at once: nobody is left to hand anything to
