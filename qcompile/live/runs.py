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
    """Every run in `runs`, the newest last; each stays open until the next one is requested.

    `on_damage` gets a message about each unreadable run. Runs that never began are skipped.
    """
    for folder in _by_age(runs, on_damage):
        try:
            journal = Journal(folder)
        except LiveError as error:  # damaged after it was sorted
            on_damage(str(error))
            continue
        with journal:
            yield journal


def find_journal(runs: Path, run_id: str) -> Journal:
    """The run with `run_id` in its name; `last` is the newest.

    Raises:
        LiveError: no run or several runs match, or the run cannot be read.
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
            words = f"The last run is not known: {len(damaged)} of the runs cannot be read."
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
        f"It holds {len(known)}: {', '.join(known[-4:])}." if known else "It holds no runs.",
        "`qcompile runs` lists them; --runs names another folder.",
    )


def _of_id(runs: Path, run_id: str) -> Path | None:
    """The folder of the run with this ID, if the folder has a different name."""
    for folder in _folders(runs):
        with suppress(LiveError), Journal(folder, checked=False) as journal:
            if journal.id == run_id:
                return folder
    return None


def _by_age(runs: Path, on_damage: Callable[[str], None]) -> list[Path]:
    """The folders of all runs that began, the oldest first; opens one journal at a time."""
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
    """Folders with a journal, by name; a leading dot marks a journal that is being created."""
    folders = (path.parent for path in runs.glob(f"*/{FILE}"))
    return sorted(folder for folder in folders if not folder.name.startswith("."))
