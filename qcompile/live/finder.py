"""Jobs that IBM accepted although it did not say so: looked for by their tags, and counted.

A submission without an answer leaves a doubt: IBM may have a job of it. Each doubt counts with its
cap until the job is found, or until a look over all jobs of the run, made when IBM must list it.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable
from datetime import UTC, datetime, timedelta

from qcompile.errors import LiveError
from qcompile.live.answers import RemoteJob
from qcompile.live.budget import Budget
from qcompile.live.client_errors import seconds_setting
from qcompile.live.commands import resume_command
from qcompile.live.journal import Journal
from qcompile.live.records import Charge, Submission
from qcompile.live.remote import RemoteJobs
from qcompile.live.request import DIGEST, TAG, is_same, tag_of

GENERAL_TAG = "qcompile"
"""All jobs of all runs have it, beside one of their own."""
DOUBT_S = 3600.0
"""A job that IBM does not list so long after it was sent was not accepted."""
REFUSED_S = 60.0
"""The same where IBM answered with a refusal: nothing of the request is still under way."""
_LOOKS = 3
_CLOCKS_APART = timedelta(days=1)


def settles_at(doubt: Charge) -> datetime:
    """When IBM must list the job of a doubt, if it has one."""
    longest_s = seconds_setting("QCOMPILE_DOUBT_SECONDS", DOUBT_S)
    seconds = min(longest_s, REFUSED_S) if doubt.refused else longest_s
    return doubt.sent_at + timedelta(seconds=seconds)


def describe_doubts(journal: Journal) -> list[str]:
    """A line on the jobs that IBM may have accepted, and from when on that can be told; or none."""
    doubts = journal.charges.doubts()
    if not doubts:
        return []
    last = max(map(settles_at, doubts))
    cap_s = sum(doubt.cap_s for doubt in doubts)
    jobs = "1 job that is" if len(doubts) == 1 else f"{len(doubts)} jobs that are"
    when = f"after {last:%H:%M} UTC" if last > datetime.now(UTC) else "now"
    return [
        f"IBM may have accepted {jobs} not known, of {cap_s:g} s at most; "
        f"`{resume_command(journal)}` {when} settles it."
    ]


class Finder:
    """Finds what IBM has of a run, and writes it into the journal.

    A job is believed to be the run's by its own tags alone. Of several for the same place one is
    taken, and the others are cancelled; all of them are counted. `settle_s` is the time in which
    IBM should list what was sent.
    """

    def __init__(
        self,
        journal: Journal,
        remote: RemoteJobs,
        settle_s: float,
        say: Callable[[str], None],
    ):
        self._journal, self._remote, self._say = journal, remote, say
        self._settle_s = settle_s
        self._budget = Budget(journal)
        self._tag = re.compile(rf"{re.escape(journal.tag_prefix)}(\d{{1,9}})-\d{{1,9}}", re.ASCII)
        seconds_setting("QCOMPILE_DOUBT_SECONDS", DOUBT_S)

    def find(self, submission: Submission) -> str | None:
        """The id of the job that IBM has for a submission, if any; it is written down as its job.

        It is looked for under the tags of earlier attempts too, and once IBM has had time to list
        what was sent last. Where there are several, one with counts is preferred, then the first.

        Raises:
            LiveError: what IBM has cannot be told.
        """
        self._await_listing(submission.number)
        attempts = self._journal.attempts(submission.number)
        jobs = self._jobs_of(attempts)
        unexpected = self._note(jobs)
        failed = {attempt.job_id for attempt in attempts if attempt.state == "failed"}
        same = {made.tag for made in attempts if is_same(made.digest, submission.digest)}
        usable = [  # and none that was cancelled here, as a second one, nor one of other PUBs
            job
            for job in jobs
            if job.id not in failed
            and (job.id in unexpected or not job.is_cancelled)
            and same.intersection(job.tags or ())
            and _may_be_of(job, submission.digest)
        ]
        best = min(usable, key=_preference, default=None)
        self._cancel(job for job in jobs if job is not best)
        if best is None:
            return None
        self._journal.note_adopted(submission, best.id)
        return best.id

    def cancel_duplicates(self, submission: Submission) -> None:
        """Count and cancel any other job of a submission whose own has ended, if one is feared."""
        if not self._journal.charges.doubts(submission.number):
            return
        try:
            jobs = self._jobs_of(self._journal.attempts(submission.number))
            self._note(jobs)
        except LiveError:
            return  # the doubt stands
        self._cancel(job for job in jobs if job.id != submission.job_id)

    def reconcile(self) -> None:
        """Have the journal know of every job of the run that IBM lists; other doubts are dropped.

        But not before IBM must list their jobs, and not where it lists one under its own tag: a
        clock that was wrong when the run began hides no job. Those jobs are cancelled that are not
        needed, as the counts of their place are here.

        Raises:
            LiveError: what IBM has cannot be told.
        """
        now = datetime.now(UTC)
        since = min(self._journal.created, now) - _CLOCKS_APART
        jobs = [job for job in self._remote.listed(GENERAL_TAG, since) if self._is_of_run(job)]
        self._note(jobs)
        due = [doubt for doubt in self._journal.charges.doubts() if settles_at(doubt) <= now]
        for number in {doubt.number for doubt in due if doubt.number is not None}:
            own = self._jobs_of(self._journal.attempts(number))
            self._note(own)
            jobs += own
        self._cancel(job for job in jobs if self._is_superfluous(job))
        for doubt in self._journal.charges.doubts():
            if doubt.row in {known.row for known in due}:
                self._journal.charges.drop(doubt)
        if not self._journal.charges.doubts():
            self._journal.charges.note_reconciled()

    def settle_doubts(self) -> bool:
        """Whether any doubt turned out, after some looks; one that soon must is waited for.

        Raises:
            LiveError: what IBM has cannot be told.
        """
        doubts = self._journal.charges.doubts()
        for _ in range(_LOOKS if doubts else 0):
            soonest = min(map(settles_at, doubts)) - datetime.now(UTC)
            soonest_s = max(0.0, soonest.total_seconds())
            self._say("waiting for a job that IBM may have accepted")
            time.sleep(soonest_s if soonest_s <= REFUSED_S else self._settle_s)
            self.reconcile()
            if len(self._journal.charges.doubts()) < len(doubts):
                return True
        return False

    def doubt_hints(self) -> list[str]:
        """A line on the jobs in doubt, if there are any."""
        return describe_doubts(self._journal)

    def _await_listing(self, number: int) -> None:
        """Wait until IBM has had time to list the job that was sent last."""
        doubts = self._journal.charges.doubts(number)
        if doubts:
            since = datetime.now(UTC) - max(doubt.sent_at for doubt in doubts)
            rest_s = self._settle_s - since.total_seconds()
            if rest_s > 0:
                self._say("no answer to a job; looking whether it was accepted")
                time.sleep(min(rest_s, self._settle_s))

    def _jobs_of(self, attempts: list[Submission]) -> list[RemoteJob]:
        return [job for attempt in attempts for job in self._remote.listed(attempt.tag)]

    def _note(self, jobs: list[RemoteJob]) -> set[str]:
        """Have the journal know of each; the ids of those of which it did not."""
        charges = self._journal.charges
        unexpected = [job for job in jobs if charges.of_job(job.id) is None]
        for job in unexpected:
            number = self._number(job)
            doubts = charges.doubts(number)
            executions = charges.executions_of(number)
            if job.cap_s is None:  # it may be that of any doubt, and the longest
                caps_s = [doubt.cap_s for doubt in doubts] or [self._budget.room_s(executions)]
                cap_s, matching = max(caps_s), sorted(doubts, key=lambda doubt: doubt.cap_s)
            else:
                cap_s = job.cap_s
                matching = [doubt for doubt in doubts if doubt.cap_s == job.cap_s]
            if matching:
                charges.note_job(matching[0], job.id, cap_s)
            else:
                charges.note_unexpected(number, executions, cap_s, datetime.now(UTC), job.id)
        return {job.id for job in unexpected}

    def _cancel(self, jobs: Iterable[RemoteJob]) -> None:
        """Cancel further jobs of a place, as far as they have not ended."""
        for job in jobs:
            if job.has_ended:
                continue
            self._say(f"job {job.id} is a second one of the same step; cancelling it")
            try:
                self._remote.cancel(job.id)
            except LiveError:
                self._say(f"job {job.id} could not be cancelled")

    def _is_superfluous(self, job: RemoteJob) -> bool:
        """Whether the counts of the job's place are here, and are not its own."""
        latest = self._journal.latest(self._number(job))
        is_here = latest is not None and latest.state == "done"
        is_own = latest is not None and latest.job_id == job.id
        return not is_own and (is_here or self._journal.result is not None)

    def _is_of_run(self, job: RemoteJob) -> bool:
        return any(self._tag.fullmatch(tag) for tag in job.tags or ())

    def _number(self, job: RemoteJob) -> int:
        """The place in the run of one of its jobs."""
        return next(int(match[1]) for tag in job.tags or () if (match := self._tag.fullmatch(tag)))


def _may_be_of(job: RemoteJob, digest: str) -> bool:
    """Whether a job may have the PUBs of a digest: a restored journal may ask for others."""
    tags = [tag for tag in job.tags or () if tag.startswith(TAG)]
    return not tags or not digest.startswith(DIGEST) or tag_of(digest) in tags


def _preference(job: RemoteJob) -> tuple[bool, bool, str]:
    """Sorts jobs with counts first, those that will have none last, and then by time."""
    return not job.is_done, job.has_ended, job.created or "~"
