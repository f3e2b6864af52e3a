"""The rows of a journal's file: read with words for what is damaged, written before anything else
happens."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from qcompile.errors import LiveError
from qcompile.live.journal_file import connect, reading


class Database:
    """The SQLite file of a journal, as a `connection` to it.

    Raises:
        LiveError: the file is no database, or it cannot be read or written, here and wherever it is
            read or written.
        NeverBegunError: it is empty.
    """

    def __init__(self, path: Path):
        self.path, self.connection = path, connect(path)

    def close(self) -> None:
        self.connection.close()

    def rows(self, statement: str, *values: object) -> list[tuple[Any, ...]]:
        """What a query finds."""
        with reading(self.path):
            return self.connection.execute(statement, values).fetchall()

    def do(self, statement: str, *values: object) -> None:
        """Have a change on the disk before anything else happens."""
        try:
            self.connection.execute(statement, values)
        except sqlite3.Error as error:
            raise LiveError(
                f"The run's journal in {self.path.parent} cannot be read or written: {error}.",
                "What was sent has its tag in it and is found again, once this is mended.",
            ) from error

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """What is written in the block is there wholly, or not at all."""
        self.do("BEGIN IMMEDIATE")
        try:
            yield
            self.do("COMMIT")
        except BaseException:
            self.do("ROLLBACK")
            raise
