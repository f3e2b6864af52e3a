"""Worker processes that end with the process they work for, however that ends."""

from __future__ import annotations

import os
import threading
import time
from functools import cache

_LOOK_SECONDS = 0.5


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
