"""The commands that messages about a run quote."""

from __future__ import annotations

import shlex
from pathlib import Path

from qcompile.live.journal import Journal


def resume_command(journal: Journal) -> str:
    """The command that resumes a run."""
    return f"qcompile resume {name_of(journal)}{folder_option(journal)}"


def export_command(journal: Journal) -> str:
    """The command that exports everything a run has recorded."""
    return f"qcompile runs{folder_option(journal)} export {name_of(journal)}"


def name_of(journal: Journal) -> str:
    """The name that the command line finds a run by: its folder's name."""
    return shlex.quote(journal.folder.name)


def folder_option(journal: Journal) -> str:
    """The `--runs` option for a run outside the default folder, else empty."""
    runs = journal.folder.parent
    return "" if runs == Path("runs") else f" --runs {shlex.quote(str(runs))}"
