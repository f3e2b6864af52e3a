"""Looks up IBM's charges for the jobs of a run, waiting for them where needed."""

from __future__ import annotations

import time
from collections.abc import Callable

from qcompile.errors import BudgetError, LiveError
from qcompile.live.budget import Budget
from qcompile.live.journal import Journal
from qcompile.live.records import Charge
from qcompile.live.remote import RemoteJobs

_CHARGE_PAUSES_S = (0.1, 0.3, 1.0, 3.0)
_MAX_UNCHARGED = 20


class Billing:
    """Records the charges of ended jobs in the journal; `say` gets progress messages."""

    def __init__(
        self, journal: Journal, remote: RemoteJobs, budget: Budget, say: Callable[[str], None]
    ):
        self._charges, self._remote, self._budget, self._say = journal.charges, remote, budget, say

    def cap_s(self, executions: int) -> int:
        """The seconds a job may take; waits for outstanding charges if they decide whether it fits.

        Raises:
            BudgetError: actual and possible charges leave no room for it.
        """
        if len(self._charges.uncharged()) >= _MAX_UNCHARGED:
            self._wait(0.0)
        for pause_s in _CHARGE_PAUSES_S:
            try:
                return self._budget.cap_s(executions)
            except BudgetError:
                if not self._charges.uncharged():
                    raise
            self._wait(pause_s)
        return self._budget.cap_s(executions)

    def settle(self) -> None:
        """Look up every outstanding charge, for a few seconds; the others stay outstanding."""
        for pause_s in _CHARGE_PAUSES_S:
            if not self._charges.uncharged():
                return
            self._wait(pause_s)

    def charge_s(self, job_id: str) -> float | None:
        """The charge of an ended job, after a short wait if needed; None if not reported."""
        for pause_s in (0.0, *_CHARGE_PAUSES_S):
            charge = self._charges.of_job(job_id)
            if charge is None or charge.charged_s is not None:
                break
            time.sleep(pause_s)
            self.ask(charge)
        charge = self._charges.of_job(job_id)
        return None if charge is None else charge.charged_s

    def ask(self, charge: Charge | None) -> bool:
        """Look up a job's charge and record it; False if the service does not answer."""
        if charge is None or charge.job_id is None:
            return True
        try:
            charged_s = self._remote.charged_s(charge.job_id, charge.cap_s)
        except LiveError:
            return False
        if charged_s is not None:
            self._charges.settle(charge, charged_s)
        return True

    def _wait(self, pause_s: float) -> None:
        """Wait, then look up every outstanding charge until the service stops answering."""
        self._say("waiting for IBM's charges")
        time.sleep(pause_s)
        for charge in self._charges.uncharged():
            if not self.ask(charge):
                return
