"""The results of verbs: short to print, with figures, and the JSON document of the command."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from qcompile.notebook import html_paragraphs
from qcompile.output import checked_path, write_file
from qcompile.report.table import Table
from qcompile.sweep.arguments import Name


class Result:
    """Plain values with a short repr; `to_dict` is the document of the command with --json."""

    def __init__(self, values: Mapping[str, Any]):
        self._values = dict(values)

    def to_dict(self) -> dict[str, Any]:
        """The document that the command prints with --json."""
        return self._values

    def save(self, path: Name) -> None:
        """Write `to_dict` as JSON to a file, which is overwritten.

        Raises:
            OptionError: the path is neither a name nor a path.
            OutputError: the file cannot be written.
        """
        text = json.dumps(self.to_dict(), indent=1, allow_nan=False)
        write_file(checked_path(path), (text + "\n").encode())

    def table(self) -> Table:
        """What `repr` and notebooks show: a table that is saved as .md, .csv or .tex."""
        raise NotImplementedError

    @property
    def remark(self) -> str:
        """A note that is shown below the table."""
        return ""

    def __repr__(self) -> str:
        return "\n".join(filter(None, [str(self.table()), self.remark]))

    def _repr_html_(self) -> str:
        return self.table()._repr_html_() + html_paragraphs([self.remark] if self.remark else [])
