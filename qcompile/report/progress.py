"""A progress bar on standard error or in a notebook."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from qcompile.report.console import console
from qcompile.terminal import plain, plain_output

Show = Callable[[float, str], None]

_LETTERS = 30
_PAUSE_SECONDS = 0.2


@contextmanager
def progress_bar(
    title: str, total: float, *, enabled: bool = True, estimates: bool = True
) -> Iterator[Show]:
    """Show a bar while the block runs; call the yielded function with (done, words) to update it.

    The bar is shown on a terminal or in a notebook, if `enabled`. With `estimates` it shows the
    remaining time. Everything printed meanwhile is plain text.
    """
    err = console(stderr=True)
    if enabled and err.is_jupyter:
        with _notebook_bar(title, total) as show:
            yield show
        return
    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[words]}", markup=False),
        TimeElapsedColumn(),
        *([TimeRemainingColumn()] if estimates else []),
        console=err,
        transient=True,
        disable=not (enabled and err.is_terminal),
    )
    with bar, plain_output():  # rich prints other output above the bar
        task = bar.add_task(title, total=total, words="")
        yield lambda done, words: bar.update(task, completed=done, words=words)


@contextmanager
def _notebook_bar(title: str, total: float) -> Iterator[Show]:
    """One changing line below the cell, empty at the end; rich's bar needs widgets."""
    from IPython.display import display

    handle = display({"text/plain": title}, raw=True, display_id=True)
    shown = time.monotonic()

    def show(done: float, words: str) -> None:
        nonlocal shown
        if time.monotonic() - shown < _PAUSE_SECONDS:
            return
        shown, share = time.monotonic(), min(max(done / total, 0.0), 1.0)
        bar = "█" * round(share * _LETTERS)
        text = plain(f"{title}  {bar:░<{_LETTERS}}  {share:.0%}  {words}")
        handle.update({"text/plain": text}, raw=True)

    try:
        yield show
    finally:
        handle.update({"text/plain": ""}, raw=True)
