"""The commands that messages about a run name."""

from __future__ import annotations

import shlex
from pathlib import Path

from qcompile.live.journal import Journal


def resume_command(journal: Journal) -> str:
    """The command that resumes a run."""
    return f"qcompile resume {name_of(journal)}{folder_option(journal)}"


def export_command(journal: Journal) -> str:
    """The command that writes all that a run holds."""
    return f"qcompile runs{folder_option(journal)} export {name_of(journal)}"


def name_of(journal: Journal) -> str:
    """The name by which the command line finds a run: that of its folder."""
    return shlex.quote(journal.folder.name)


def folder_option(journal: Journal) -> str:
    """The option that names the folder of a run, where it is not the usual one."""
    runs = journal.folder.parent
    return "" if runs == Path("runs") else f" --runs {shlex.quote(str(runs))}"
