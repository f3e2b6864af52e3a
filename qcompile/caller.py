"""Who calls: the command line, whose options have dashes, or Python, whose arguments have none."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_is_command_line: ContextVar[bool] = ContextVar("is_command_line", default=False)
_TYPED = {"imports": "import", "settings": "set", "max_wait_s": "max_wait_seconds"}
"""Arguments that have another name on the command line."""


@contextmanager
def command_line() -> Iterator[None]:
    """Within the block, `option` gives the words of the command line."""
    token = _is_command_line.set(True)
    try:
        yield
    finally:
        _is_command_line.reset(token)


def option(name: str) -> str:
    """An argument as the caller writes it: `--max-steps`, or `max_steps` in Python."""
    if not _is_command_line.get():
        return name
    return f"--{_TYPED.get(name, name).replace('_', '-')}"
