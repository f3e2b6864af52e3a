"""Results that can be written as a page."""

from __future__ import annotations

from qcompile.errors import OptionError
from qcompile.output import checked_path
from qcompile.page.document import Document
from qcompile.page.render import write_report
from qcompile.sweep.arguments import Name
from qcompile.verbs.results import Result


class Reported(Result):
    """A result with a report. `call` is the Python call that made it, if known."""

    call: str = ""

    def document(self, command: str) -> Document:
        """The contents of the report; `command` is the command or call that made the result."""
        raise NotImplementedError

    def report(self, path: Name, *, command: str | None = None) -> None:
        """Write an HTML page with scores, figures, tables, circuits, settings and versions.

        Everything is in this one file, which opens offline; an existing file is overwritten. The
        page shows `command`, by default the Python call.

        Raises:
            OptionError: the file does not end with .html; the command is not a string.
            OutputError: it cannot be written.
        """
        file = checked_path(path)
        if not isinstance(command, str | None):
            raise OptionError(
                f"command cannot be of type {type(command).__name__}.",
                "It must be a string or None.",
            )
        write_report(self.document(self.call if command is None else command), file)
