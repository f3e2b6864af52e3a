"""The guard: what a run has spent, and whether the next job fits below its limit."""

from __future__ import annotations

import math

from qcompile.errors import BudgetError
from qcompile.execution import qpu_seconds
from qcompile.live.journal import Journal
from qcompile.live.records import Charge


class Budget:
    """QPU seconds of a run against its limit.

    A job counts with what IBM charged. As long as that is not known it counts with the published
    estimate, times the worst ratio of charge to estimate that this run has seen (1 at least).
    """

    def __init__(self, journal: Journal):
        self._journal = journal

    @property
    def limit_s(self) -> float:
        return self._journal.max_qpu_seconds

    def charged_s(self) -> float:
        """What IBM has charged so far."""
        return sum(charge.usage_s or 0.0 for charge in self._journal.charges())

    def spent_s(self) -> float:
        """What is charged, and what is expected of the jobs whose charge is not known."""
        charges = self._journal.charges()
        ratio = _ratio(charges)
        return sum(ratio * _estimate_s(c) if c.usage_s is None else c.usage_s for c in charges)

    def expected_s(self, executions: int) -> float:
        """What a job of so many executions is expected to take."""
        return _ratio(self._journal.charges()) * qpu_seconds(1, executions)

    def check(self, executions: int) -> None:
        """Nothing, if the next job may be sent.

        Raises:
            BudgetError: it is expected to pass the limit.
        """
        needed, spent = self.expected_s(executions), self.spent_s()
        if spent + needed > self.limit_s:
            raise BudgetError(
                f"The limit of {self.limit_s:g} QPU seconds would be passed: {spent:.1f} s are "
                f"spent, the next job takes about {needed:.1f} s.",
                where_it_stands(self._journal),
                f"`qcompile resume {self._journal.id} --max-qpu-seconds S` goes on with more.",
            )

    def allowance_s(self, executions: int) -> int:
        """What a job of so many executions, which is written down, may take at most.

        IBM wants whole seconds: what is left, rounded down, but no less than the job is expected to
        take. It would be cut off there, and be paid for nothing.
        """
        expected_s = self.expected_s(executions)
        left_s = self.limit_s - self.spent_s() + expected_s
        return max(math.floor(left_s), math.ceil(expected_s))


def where_it_stands(journal: Journal) -> str:
    """A line of words: jobs and steps of the run so far."""
    done = sum(charge.state == "done" for charge in journal.charges())
    steps = f", {journal.step_count()} steps are played" if journal.kind == "run" else ""
    return f"{done} jobs are done{steps}; all of it is kept."


def _estimate_s(charge: Charge) -> float:
    return qpu_seconds(1, charge.executions)


def _ratio(charges: list[Charge]) -> float:
    """The worst of charge to estimate among finished jobs, 1 at least."""
    ratios = [
        charge.usage_s / _estimate_s(charge)
        for charge in charges
        if charge.usage_s is not None and charge.state == "done"
    ]
    return max([1.0, *ratios])
