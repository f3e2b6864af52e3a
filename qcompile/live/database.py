"""The rows of a journal's file: damage is explained, and every write is durable at once."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from qcompile.errors import LiveError
from qcompile.live.journal_file import connect, reading


class Database:
    """An open `connection` to a journal's SQLite file.

    Raises:
        LiveError: the file is not a database, or cannot be read or written; every method may raise
            it.
        NeverBegunError: the file is empty.
    """

    def __init__(self, path: Path):
        self.path, self.connection = path, connect(path)

    def close(self) -> None:
        self.connection.close()

    def rows(self, statement: str, *values: object) -> list[tuple[Any, ...]]:
        """The rows that a query returns."""
        with reading(self.path):
            return self.connection.execute(statement, values).fetchall()

    def do(self, statement: str, *values: object) -> None:
        """Execute a change; it is on the disk when this returns."""
        try:
            self.connection.execute(statement, values)
        except sqlite3.Error as error:
            raise LiveError(
                f"The run's journal in {self.path.parent} cannot be read or written: {error}.",
                "Jobs that were sent are recorded in it and are found again once this is fixed.",
            ) from error

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """A block whose writes are committed together, or not at all."""
        self.do("BEGIN IMMEDIATE")
        try:
            yield
            self.do("COMMIT")
        except BaseException:
            self.do("ROLLBACK")
            raise
