"""The runs of a folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from qcompile.errors import LiveError
from qcompile.live.journal import FILE, Journal


def journals(
    runs: Path, on_damage: Callable[[str], None] = lambda words: None
) -> Iterator[Journal]:
    """Every run below `runs`, the newest last, open until the next is asked for.

    `on_damage` gets words on each that cannot be read.
    """
    found = []
    for folder in _folders(runs):
        try:
            found.append(Journal(folder))
        except LiveError as error:
            on_damage(str(error))
    for journal in sorted(found, key=lambda journal: journal.created):
        with journal:
            yield journal


def find_journal(runs: Path, run_id: str) -> Journal:
    """The run with `run_id` in its name; `last` is the newest.

    Raises:
        LiveError: there is none, or there are several, or it cannot be read.
    """
    known = [folder.name for folder in _folders(runs)]
    if run_id in known:
        return Journal(runs / run_id)
    damaged: list[str] = []
    if run_id == "last":
        found = [journal.folder.name for journal in journals(runs, damaged.append)][-1:]
        if damaged:
            words = "Which run is the last is not known: not all of them can be read."
            raise LiveError(words, *damaged, "Name the run.")
    else:
        found = [name for name in known if run_id and run_id in name]
    if len(found) == 1:
        return Journal(runs / found[0])
    if found:
        raise LiveError(
            f"{len(found)} runs are meant by {run_id!r}: {', '.join(found[:4])}.", "Say more of it."
        )
    raise LiveError(
        f"There is no run {run_id!r} in {runs}.",
        f"It holds {len(known)}: {', '.join(known[-4:])}." if known else "It holds none.",
        "`qcompile runs` lists them; --runs names another folder.",
    )


def _folders(runs: Path) -> list[Path]:
    """Folders with a journal, by name."""
    return sorted(path.parent for path in runs.glob(f"*/{FILE}"))
