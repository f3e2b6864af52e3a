"""The guard: what a run has spent, and whether the next job fits below its limit."""

from __future__ import annotations

import math

from qcompile.errors import BudgetError
from qcompile.execution import qpu_seconds
from qcompile.live.journal import Journal
from qcompile.live.records import Charge, Submission

_ROOM, _ROOM_S = 4, 10
"""A job may take so many times what it is expected to, and so many seconds more."""


class Budget:
    """QPU seconds of a run against its limit.

    A job counts with what IBM charged and, as long as that is not known, with the cap at which IBM
    cuts it off: so whatever IBM charges in the end, the limit holds. A job is expected to take
    IBM's published estimate, times the worst ratio of charge to estimate that this run has seen.
    """

    def __init__(self, journal: Journal):
        self._journal = journal

    @property
    def limit_s(self) -> float:
        return self._journal.max_qpu_seconds

    def charged_s(self) -> float:
        """What IBM has charged so far, as far as it has said."""
        return sum(charge.charged_s or 0.0 for charge in self._journal.charges())

    def expected_s(self, executions: int) -> float:
        """What a job of so many executions is expected to take."""
        return _ratio(self._journal.charges()) * qpu_seconds(1, executions)

    def cap_s(self, submission: Submission) -> int:
        """The seconds that a submission may take, in whole ones as IBM wants them.

        Raises:
            BudgetError: less is left than it is expected to take.
        """
        charges = self._journal.charges(but=submission)
        expected_s = _ratio(charges) * qpu_seconds(1, submission.executions)
        committed_s = sum(c.cap_s if c.charged_s is None else c.charged_s for c in charges)
        left_s = math.floor(self.limit_s - committed_s)
        if left_s < expected_s:
            raise BudgetError(
                f"The limit of {self.limit_s:g} QPU seconds would be passed: {committed_s:.1f} s "
                f"are spent or may yet be charged, the next job takes about {expected_s:.1f} s.",
            )
        return min(left_s, math.ceil(_ROOM * expected_s) + _ROOM_S)


def _ratio(charges: list[Charge]) -> float:
    """The worst of charge to estimate so far, 1 at least."""
    ratios = [
        charge.charged_s / qpu_seconds(1, charge.executions)
        for charge in charges
        if charge.charged_s is not None
    ]
    return max([1.0, *ratios])
