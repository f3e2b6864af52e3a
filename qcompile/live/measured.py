"""The registers that a run's jobs measure, recorded before sending, and later their bits."""

from __future__ import annotations

from collections.abc import Sequence

from qcompile.live.database import Database
from qcompile.live.journal_file import reading
from qcompile.live.records import Register


class Measured:
    """The registers of a journal, by the number of the job in the run."""

    def __init__(self, database: Database):
        self._db = database

    def of(self, number: int) -> list[Register]:
        """The registers of job `number`, in order, with their bits once it is done."""
        rows = self._db.rows(
            f"SELECT {Register.COLUMNS} FROM measured WHERE number = ? ORDER BY rowid", number
        )
        with reading(self._db.path):
            return [Register.of_row(row) for row in rows]

    def note(self, number: int, registers: Sequence[Register]) -> None:
        """Replace the registers of job `number`."""
        self._db.do("DELETE FROM measured WHERE number = ?", number)
        for register in registers:
            self._db.do(
                f"INSERT INTO measured (number, {Register.COLUMNS}) VALUES (?,?,?,?,?,?)",
                *(number, *register.row),
            )
