"""A progress bar on standard error, for whatever lasts longer than a blink."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from qcompile.report.console import console
from qcompile.terminal import plain_output


@contextmanager
def progress_bar(
    title: str, total: float, *, enabled: bool = True
) -> Iterator[Callable[[float, str], None]]:
    """Show a bar while the block runs; call what it yields with (done, words) to move it.

    Nothing is shown unless it is `enabled`, on a terminal or in a notebook.
    """
    err = console(stderr=True)
    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[words]}", markup=False),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=err,
        transient=True,
        disable=not enabled or not (err.is_terminal or err.is_jupyter),
    )
    with bar, plain_output():  # rich shows what is printed meanwhile above the bar
        task = bar.add_task(title, total=total, words="")
        yield lambda done, words: bar.update(task, completed=done, words=words)
