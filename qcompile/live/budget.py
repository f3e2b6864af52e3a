"""The guard: what a run has spent, and whether the next job fits within its limit."""

from __future__ import annotations

import math

from qcompile.errors import BudgetError
from qcompile.execution import qpu_seconds
from qcompile.live.journal import Journal

_ROOM, _ROOM_S = 4, 10
"""A job may take this multiple of its expected time, plus this many seconds."""


class Budget:
    """The QPU seconds of a run, checked against its limit.

    A job counts with IBM's charge or, until that is known, with the cap at which IBM stops it; so
    does a job that IBM may have accepted without answering. So the limit holds whatever IBM charges
    in the end. A job's expected time is IBM's published estimate times the worst ratio of charge to
    estimate in this run.
    """

    def __init__(self, journal: Journal):
        self._journal = journal

    @property
    def limit_s(self) -> float:
        return self._journal.max_qpu_seconds

    @property
    def spent_s(self) -> float:
        """Actual plus possible charges: never less than IBM has charged."""
        return self._journal.charges.upper_s

    def expected_s(self, executions: int) -> float:
        """The expected seconds of a job with this number of executions."""
        return self._journal.charges.worst_ratio * qpu_seconds(1, executions)

    def room_s(self, executions: int) -> int:
        """The seconds a job with this number of executions may take if nothing else limits it."""
        return math.ceil(_ROOM * self.expected_s(executions)) + _ROOM_S

    def cap_s(self, executions: int) -> int:
        """The whole seconds that the next job may take, as IBM requires.

        Raises:
            BudgetError: less is left than the job is expected to take.
        """
        expected_s, spent_s = self.expected_s(executions), self.spent_s
        left_s = math.floor(self.limit_s - spent_s)
        if left_s < expected_s:
            raise BudgetError(
                f"The limit of {self.limit_s:g} QPU seconds would be exceeded: {spent_s:.1f} s are "
                f"spent or may still be charged, and the next job takes about {expected_s:.1f} s."
            )
        return min(left_s, self.room_s(executions))
