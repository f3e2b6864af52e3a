"""Charges of a run's jobs, including jobs that IBM may have accepted without answering."""

from __future__ import annotations

from datetime import UTC, datetime

from qcompile.errors import BudgetError
from qcompile.execution import qpu_seconds
from qcompile.limits import MAX_QPU_SECONDS
from qcompile.live.database import Database
from qcompile.live.journal_file import reading
from qcompile.live.records import Charge

_DOUBTS = "charged_s IS NULL AND job_id IS NULL"


class Charges:
    """The charges of a journal.

    A charge is recorded before its job is sent, in doubt and with its cap. It gets the job's id
    when IBM returns or lists it, and the amount once IBM reports it. So `upper_s` is never less
    than IBM has charged. Sums are cached between jobs.
    """

    def __init__(self, database: Database):
        self._db = database
        self._sums: tuple[float, float] | None = None

    def forget_sums(self) -> None:
        """Drop the cached sums: another process may have written to the journal."""
        self._sums = None

    # Totals

    @property
    def settled_s(self) -> float:
        """The charges that IBM has reported so far."""
        return self._known()[0]

    @property
    def upper_s(self) -> float:
        """The reported charges, plus the cap of each job whose charge is not known."""
        [[open_s]] = self._db.rows("SELECT total(cap_s) FROM charge WHERE charged_s IS NULL")
        return self.settled_s + float(open_s)

    @property
    def worst_ratio(self) -> float:
        """The largest ratio of charge to IBM's estimate so far, at least 1."""
        return self._known()[1]

    def _known(self) -> tuple[float, float]:
        if self._sums is None:
            rows = self._db.rows(
                "SELECT executions, charged_s FROM charge WHERE charged_s IS NOT NULL"
            )
            total_s, worst = 0.0, 1.0
            for executions, charged_s in rows:
                total_s += charged_s
                worst = max(worst, charged_s / qpu_seconds(1, executions))
            self._sums = total_s, worst
        return self._sums

    # Queries

    def all(self, where: str = "TRUE", *values: object) -> list[Charge]:
        """The charges that match `where`, in the order they were sent."""
        rows = self._db.rows(
            f"SELECT {Charge.COLUMNS} FROM charge WHERE {where} ORDER BY row", *values
        )
        with reading(self._db.path):
            return [Charge.of_row(row) for row in rows]

    def doubts(self, number: int | None = None) -> list[Charge]:
        """Charges of jobs that IBM may have accepted, all or those of job `number`."""
        if number is None:
            return self.all(_DOUBTS)
        return self.all(f"{_DOUBTS} AND number = ?", number)

    def uncharged(self) -> list[Charge]:
        """Charges of known jobs that have ended and whose amount IBM has not reported."""
        return self.all(
            "charged_s IS NULL AND job_id IS NOT NULL AND "
            "job_id NOT IN (SELECT job_id FROM submission WHERE state = 'sent')"
        )

    def of_job(self, job_id: str) -> Charge | None:
        """The charge of the job, if it is known."""
        return next(iter(self.all("job_id = ?", job_id)), None)

    def executions_of(self, number: int) -> int:
        """The executions of job `number` of the run; the largest of any job if it has none yet."""
        most = "SELECT max(executions) FROM submission"
        [[of_number]] = self._db.rows(f"{most} WHERE number = ?", number)
        [[of_any]] = self._db.rows(most) if of_number is None else [[of_number]]
        return int(of_any or 0)

    @property
    def are_settled(self) -> bool:
        """Whether every job of the run and its charge are known."""
        looked_over = bool(self._db.rows("SELECT 1 FROM looked_over"))
        return looked_over and not self.doubts() and not self.uncharged()

    # Changes

    def note_doubt(self, number: int, executions: int, cap_s: float, sent_at: datetime) -> None:
        """Record that a job is being sent: from now on IBM may have it."""
        self._db.do("DELETE FROM looked_over")
        self._insert(number, executions, cap_s, sent_at, None)

    def drop(self, doubt: Charge) -> None:
        """Remove the charge: IBM has no such job."""
        self._db.do("DELETE FROM charge WHERE row = ?", doubt.row)

    def note_unanswered(self, doubt: Charge, at: datetime, *, refused: bool) -> None:
        """Record that sending ended at `at` without a job id, and whether IBM refused it."""
        self._db.do(
            "UPDATE charge SET sent_at = ?, refused = ? WHERE row = ?",
            *(at.isoformat(), refused, doubt.row),
        )

    def note_job(self, doubt: Charge, job_id: str, cap_s: float) -> None:
        """Record the job of a charge in doubt; IBM stops the job after `cap_s`."""
        self._db.do(
            "UPDATE charge SET job_id = ?, cap_s = ? WHERE row = ?", job_id, cap_s, doubt.row
        )

    def note_unexpected(
        self, number: int, executions: int, cap_s: float, sent_at: datetime, job_id: str
    ) -> None:
        """Record a job of the run that the journal did not know."""
        self._insert(number, executions, cap_s, sent_at, job_id)

    def note_reconciled(self) -> None:
        """Record that IBM has no other jobs of this run."""
        self._db.do("INSERT INTO looked_over VALUES (?)", datetime.now(UTC).isoformat())

    def settle(self, charge: Charge, charged_s: float) -> None:
        """Record what IBM charged for a job."""
        total_s, worst = self._known()
        self._db.do("UPDATE charge SET charged_s = ? WHERE row = ?", charged_s, charge.row)
        ratio = charged_s / qpu_seconds(1, charge.executions)
        self._sums = total_s + charged_s, max(worst, ratio)

    def _insert(self, *values: object) -> None:
        self._db.do(
            "INSERT INTO charge (number, executions, cap_s, sent_at, job_id, refused) "
            "VALUES (?,?,?,?,?,0)",
            *(value.isoformat() if isinstance(value, datetime) else value for value in values),
        )


def check_limit(max_qpu_seconds: float) -> None:
    """Check that a limit of QPU seconds can be enforced.

    Raises:
        BudgetError: the limit is not a positive number of seconds, or is too large.
    """
    is_number = isinstance(max_qpu_seconds, int | float) and not isinstance(max_qpu_seconds, bool)
    if not is_number or not 0 < max_qpu_seconds <= MAX_QPU_SECONDS:
        shown = f"{max_qpu_seconds:g}" if is_number else repr(max_qpu_seconds)
        raise BudgetError(
            f"The limit cannot be {shown} QPU seconds.",
            f"Give a number above 0 and at most {MAX_QPU_SECONDS:,.0f}.",
        )
