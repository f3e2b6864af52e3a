"""The runs of a folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from qcompile.errors import LiveError
from qcompile.live.journal import Journal
from qcompile.live.journal_file import FILE, NeverBegunError


def journals(
    runs: Path, on_damage: Callable[[str], None] = lambda words: None
) -> Iterator[Journal]:
    """Every run below `runs`, the newest last, each open until the next is asked for.

    `on_damage` gets words on each that cannot be read. One that never began is passed over.
    """
    for folder in _by_age(runs, on_damage):
        try:
            journal = Journal(folder)
        except LiveError as error:  # damaged since it was dated
            on_damage(str(error))
            continue
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
    if (folder := _of_id(runs, run_id)) is not None:
        return Journal(folder)
    damaged: list[str] = []
    if run_id == "last":
        matches = [folder.name for folder in _by_age(runs, damaged.append)][-1:]
        if damaged:
            words = f"Which run is the last is not known: {len(damaged)} cannot be read."
            first = damaged[0].partition("\n")[0]
            raise LiveError(words, first, "Name the run; `qcompile runs` lists them.")
    else:
        matches = [name for name in known if run_id and run_id in name]
    if len(matches) == 1:
        return Journal(runs / matches[0])
    if matches:
        raise LiveError(
            f"{run_id!r} matches {len(matches)} runs: {', '.join(matches[:4])}.",
            "Give more of the ID.",
        )
    raise LiveError(
        f"There is no run {run_id!r} in {runs}.",
        f"It holds {len(known)}: {', '.join(known[-4:])}." if known else "It holds none.",
        "`qcompile runs` lists them; --runs names another folder.",
    )


def _of_id(runs: Path, run_id: str) -> Path | None:
    """The folder of the run with this ID, if another name than the ID was chosen for it."""
    for folder in _folders(runs):
        with suppress(LiveError), Journal(folder, checked=False) as journal:
            if journal.id == run_id:
                return folder
    return None


def _by_age(runs: Path, on_damage: Callable[[str], None]) -> list[Path]:
    """The folders of all runs that began, the oldest first; one journal is open at a time."""
    dated = []
    for folder in _folders(runs):
        try:
            with Journal(folder, checked=False) as journal:
                dated.append((journal.created, folder))
        except NeverBegunError:
            continue
        except LiveError as error:
            on_damage(str(error))
    return [folder for _, folder in sorted(dated)]


def _folders(runs: Path) -> list[Path]:
    """Folders with a journal, by name; those with a dot are of journals that are being made."""
    folders = (path.parent for path in runs.glob(f"*/{FILE}"))
    return sorted(folder for folder in folders if not folder.name.startswith("."))
