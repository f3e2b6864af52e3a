"""A folder of cells: each result is stored in its own file, and used only for that cell."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from pydantic import BaseModel, ValidationError

from qcompile.output import check_writable, write_file
from qcompile.reading import ContentsError, read_json
from qcompile.sweep.engine import Named

C = TypeVar("C", bound=Named)
R = TypeVar("R", bound=BaseModel)


@dataclass(frozen=True)
class Folder(Generic[C, R]):
    """The results of a sweep in `path`/cells, a file NAME.json for the cell of that name.

    `model` is the schema of a file. `match` returns the result of a cell, or None if its file is of
    another cell or other settings.
    """

    path: Path
    model: type[R]
    match: Callable[[C, R], R | None]

    @property
    def cells(self) -> Path:
        """The folder of the cells' files."""
        return self.path / "cells"

    def file(self, cell: Named) -> Path:
        """The file of a cell."""
        return self.cells / f"{cell.name}.json"

    def check_writable(self) -> None:
        """Check that cells can be written, before anything is run.

        Raises:
            OutputError: the folder cannot be made or written to.
        """
        check_writable(self.cells / "cell.json")

    def write(self, cell: C, result: R) -> None:
        """Write the result of a cell, completely or not at all.

        Raises:
            OutputError: the file cannot be written.
        """
        write_file(self.file(cell), (json.dumps(result.model_dump()) + "\n").encode())

    def read(self, cell: C) -> R | None:
        """The result of a cell; None if it has no file, or a damaged one."""
        try:
            result = self.model.model_validate_json(read_json(self.file(cell)))
        except (OSError, ContentsError, ValidationError):
            return None
        return self.match(cell, result)

    def finished(self, cells: Sequence[C]) -> dict[str, R]:
        """The results of the cells that have one, by cell name."""
        results = {cell.name: self.read(cell) for cell in cells}
        return {name: result for name, result in results.items() if result is not None}

    def missing(self, cells: Sequence[C]) -> list[C]:
        """The cells that have no result."""
        return [cell for cell in cells if self.read(cell) is None]
