"""The guard: what a run has spent, and whether the next job fits below its limit."""

from __future__ import annotations

import math

from qcompile.errors import BudgetError
from qcompile.execution import qpu_seconds
from qcompile.live.journal import Journal

_ROOM, _ROOM_S = 4, 10
"""A job may take so many times what it is expected to, and so many seconds more."""


class Budget:
    """QPU seconds of a run against its limit.

    A job counts with what IBM charged and, as long as that is not known, with the cap at which IBM
    cuts it off; so does a job that IBM may have accepted without an answer. So whatever IBM charges
    in the end, the limit holds. A job is expected to take IBM's published estimate, times the worst
    ratio of charge to estimate that this run has seen.
    """

    def __init__(self, journal: Journal):
        self._journal = journal

    @property
    def limit_s(self) -> float:
        return self._journal.max_qpu_seconds

    @property
    def spent_s(self) -> float:
        """What is charged, or may yet be: never less than what IBM has charged."""
        return self._journal.charges.upper_s

    def expected_s(self, executions: int) -> float:
        """What a job of so many executions is expected to take."""
        return self._journal.charges.worst_ratio * qpu_seconds(1, executions)

    def room_s(self, executions: int) -> int:
        """The seconds that a job of so many executions may take where nothing else limits it."""
        return math.ceil(_ROOM * self.expected_s(executions)) + _ROOM_S

    def cap_s(self, executions: int) -> int:
        """The seconds that the next job may take, in whole ones as IBM wants them.

        Raises:
            BudgetError: less is left than it is expected to take.
        """
        expected_s, spent_s = self.expected_s(executions), self.spent_s
        left_s = math.floor(self.limit_s - spent_s)
        if left_s < expected_s:
            raise BudgetError(
                f"The limit of {self.limit_s:g} QPU seconds would be passed: {spent_s:.1f} s are "
                f"spent or may yet be charged, the next job takes about {expected_s:.1f} s."
            )
        return min(left_s, self.room_s(executions))
