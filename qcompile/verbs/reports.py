"""Results that can be written as a page."""

from __future__ import annotations

from pathlib import Path

from qcompile.page.document import Document
from qcompile.page.render import write_report
from qcompile.sweep.arguments import Name
from qcompile.verbs.results import Result


class Reported(Result):
    """A result with a report. `call` is how its verb was called in Python, where that is known."""

    call: str = ""

    def document(self, command: str) -> Document:
        """What the report says; `command` is how the result was made."""
        raise NotImplementedError

    def report(self, path: Name, *, command: str | None = None) -> None:
        """Write a page of HTML with scores, figures, tables, circuits, settings and versions.

        Everything is in this one file, which opens offline; a file that is there is overwritten.
        The page shows `command`, by default the call in Python.

        Raises:
            OptionError: the file does not end with .html.
            OutputError: it cannot be written.
        """
        write_report(self.document(self.call if command is None else command), Path(path))
