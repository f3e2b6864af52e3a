"""What a run's jobs cost: those that IBM has, and those that it may have."""

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

    A charge is there before a job is sent, in doubt, with its cap. It gets the id of its job when
    IBM answers, or lists it; and what was charged once IBM says that. So `upper_s` is never less
    than what IBM has charged. Sums of what is charged are kept, and not made anew for each job.
    """

    def __init__(self, database: Database):
        self._db = database
        self._sums: tuple[float, float] | None = None

    def forget_sums(self) -> None:
        """Another process may have written: the sums are made anew."""
        self._sums = None

    # What they come to

    @property
    def settled_s(self) -> float:
        """What IBM has charged, as far as it has said."""
        return self._known()[0]

    @property
    def upper_s(self) -> float:
        """What IBM has charged, and the cap of each job of which it has not said it."""
        [[open_s]] = self._db.rows("SELECT total(cap_s) FROM charge WHERE charged_s IS NULL")
        return self.settled_s + float(open_s)

    @property
    def worst_ratio(self) -> float:
        """The worst of charge to IBM's estimate so far, 1 at least."""
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

    # One by one

    def all(self, where: str = "TRUE", *values: object) -> list[Charge]:
        """Those for which `where` holds, in the order in which they were sent."""
        rows = self._db.rows(
            f"SELECT {Charge.COLUMNS} FROM charge WHERE {where} ORDER BY row", *values
        )
        with reading(self._db.path):
            return [Charge.of_row(row) for row in rows]

    def doubts(self, number: int | None = None) -> list[Charge]:
        """Jobs that IBM may have accepted and that are not known, of job `number` or of all."""
        if number is None:
            return self.all(_DOUBTS)
        return self.all(f"{_DOUBTS} AND number = ?", number)

    def uncharged(self) -> list[Charge]:
        """Known jobs that have ended, but for their charge."""
        return self.all(
            "charged_s IS NULL AND job_id IS NOT NULL AND "
            "job_id NOT IN (SELECT job_id FROM submission WHERE state = 'sent')"
        )

    def of_job(self, job_id: str) -> Charge | None:
        """That of the job, if it is known."""
        return next(iter(self.all("job_id = ?", job_id)), None)

    def executions_of(self, number: int) -> int:
        """Those of job `number` of the run; where it does not have that yet, the most of any."""
        most = "SELECT max(executions) FROM submission"
        [[of_number]] = self._db.rows(f"{most} WHERE number = ?", number)
        [[of_any]] = self._db.rows(most) if of_number is None else [[of_number]]
        return int(of_any or 0)

    @property
    def are_settled(self) -> bool:
        """Whether all that IBM has of the run is known, and what it charged for it."""
        looked_over = bool(self._db.rows("SELECT 1 FROM looked_over"))
        return looked_over and not self.doubts() and not self.uncharged()

    # How they change

    def note_doubt(self, number: int, executions: int, cap_s: float, sent_at: datetime) -> None:
        """A job is being sent: from now on IBM may have it."""
        self._db.do("DELETE FROM looked_over")
        self._insert(number, executions, cap_s, sent_at, None)

    def drop(self, doubt: Charge) -> None:
        """IBM has no such job."""
        self._db.do("DELETE FROM charge WHERE row = ?", doubt.row)

    def note_unanswered(self, doubt: Charge, at: datetime, *, refused: bool) -> None:
        """Sending it ended `at` then without a job's id, and with a refusal if `refused`."""
        self._db.do(
            "UPDATE charge SET sent_at = ?, refused = ? WHERE row = ?",
            *(at.isoformat(), refused, doubt.row),
        )

    def note_job(self, doubt: Charge, job_id: str, cap_s: float) -> None:
        """It is no longer in doubt: its job is known, and is cut off at `cap_s`."""
        self._db.do(
            "UPDATE charge SET job_id = ?, cap_s = ? WHERE row = ?", job_id, cap_s, doubt.row
        )

    def note_unexpected(
        self, number: int, executions: int, cap_s: float, sent_at: datetime, job_id: str
    ) -> None:
        """IBM has a job of which the journal had nothing."""
        self._insert(number, executions, cap_s, sent_at, job_id)

    def note_reconciled(self) -> None:
        """IBM has no job of the run but those that are here."""
        self._db.do("INSERT INTO looked_over VALUES (?)", datetime.now(UTC).isoformat())

    def settle(self, charge: Charge, charged_s: float) -> None:
        """What IBM charged for a job is known now."""
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
    """Nothing, if charges can be held to the limit.

    Raises:
        BudgetError: it is no number of seconds that may be spent.
    """
    is_number = isinstance(max_qpu_seconds, int | float) and not isinstance(max_qpu_seconds, bool)
    if not is_number or not 0 < max_qpu_seconds <= MAX_QPU_SECONDS:
        found = f"{max_qpu_seconds:g}" if is_number else repr(max_qpu_seconds)
        raise BudgetError(
            f"A limit of {found} QPU seconds cannot be kept.",
            f"Give a number above 0, {MAX_QPU_SECONDS:,.0f} at most.",
        )
