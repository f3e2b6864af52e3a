"""Finds jobs that IBM accepted without answering, by their tags, and counts their cost.

A submission without an answer leaves a doubt: IBM may have accepted its job. Each doubt counts with
its cap until the job is found, or until IBM's list of the run's jobs, read late enough to be
complete, does not have it.
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
"""The tag shared by all jobs of all runs; each job also has its own."""
DOUBT_S = 3600.0
"""A job that IBM has not listed after this time was not accepted."""
REFUSED_S = 60.0
"""The same after a refusal, when no part of the request is still under way."""
_LOOKS = 3
_CLOCKS_APART = timedelta(days=1)


def settles_at(doubt: Charge) -> datetime:
    """When IBM must have listed the job of a doubt, if it has one."""
    longest_s = seconds_setting("QCOMPILE_DOUBT_SECONDS", DOUBT_S)
    seconds = min(longest_s, REFUSED_S) if doubt.refused else longest_s
    return doubt.sent_at + timedelta(seconds=seconds)


def describe_doubts(journal: Journal) -> list[str]:
    """A line on the jobs that IBM may have accepted and when that can be settled; or nothing."""
    doubts = journal.charges.doubts()
    if not doubts:
        return []
    last = max(map(settles_at, doubts))
    cap_s = sum(doubt.cap_s for doubt in doubts)
    jobs = "1 more job" if len(doubts) == 1 else f"{len(doubts)} more jobs"
    when = f"after {last:%H:%M} UTC" if last > datetime.now(UTC) else "now"
    return [
        f"IBM may have accepted {jobs}, at most {cap_s:g} s; "
        f"`{resume_command(journal)}` {when} finds out."
    ]


class Finder:
    """Finds the jobs that IBM has of a run, and records them in the journal.

    A job counts as the run's only by its own tags. Of several jobs for the same position one is
    used and the others are cancelled; all of them are counted. `settle_s` is the time in seconds
    within which IBM should list a job.
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
        """The id of the job that IBM has for a submission, if any; it is recorded as its job.

        Tags of earlier attempts count too, and IBM is first given time to list the last submission.
        Of several jobs one with counts is preferred, then the earliest.

        Raises:
            LiveError: IBM's jobs cannot be listed.
        """
        self._await_listing(submission.number)
        attempts = self._journal.attempts(submission.number)
        jobs = self._jobs_of(attempts)
        unexpected = self._note(jobs)
        failed = {attempt.job_id for attempt in attempts if attempt.state == "failed"}
        same = {attempt.tag for attempt in attempts if is_same(attempt.digest, submission.digest)}
        usable = [  # not one cancelled here as a duplicate, nor one of other PUBs
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
        """Count and cancel duplicates of a submission whose job has ended, if it is in doubt."""
        if not self._journal.charges.doubts(submission.number):
            return
        try:
            jobs = self._jobs_of(self._journal.attempts(submission.number))
            self._note(jobs)
        except LiveError:
            return  # it stays in doubt
        self._cancel(job for job in jobs if job.id != submission.job_id)

    def reconcile(self) -> None:
        """Record every job of the run that IBM lists, and drop the doubts that this settles.

        A doubt is dropped only after IBM must have listed its job, and after a look under the job's
        own tag, so that a wrong clock at the start of the run hides no job. Jobs whose counts are
        no longer needed are cancelled.

        Raises:
            LiveError: IBM's jobs cannot be listed.
        """
        now = datetime.now(UTC)
        since = min(self._journal.created, now) - _CLOCKS_APART
        jobs = [job for job in self._remote.listed(GENERAL_TAG, since) if self._is_of_run(job)]
        self._note(jobs)
        due = [doubt for doubt in self._journal.charges.doubts() if settles_at(doubt) <= now]
        for number in {doubt.number for doubt in due if doubt.number is not None}:
            tagged = self._jobs_of(self._journal.attempts(number))
            self._note(tagged)
            jobs += tagged
        self._cancel(job for job in jobs if self._is_superfluous(job))
        for doubt in self._journal.charges.doubts():
            if doubt.row in {settled.row for settled in due}:
                self._journal.charges.drop(doubt)
        if not self._journal.charges.doubts():
            self._journal.charges.note_reconciled()

    def settle_doubts(self) -> bool:
        """Whether any doubt was settled after a few looks, waiting for one that soon must be.

        Raises:
            LiveError: IBM's jobs cannot be listed.
        """
        doubts = self._journal.charges.doubts()
        for _ in range(_LOOKS if doubts else 0):
            soonest = min(map(settles_at, doubts)) - datetime.now(UTC)
            soonest_s = max(0.0, soonest.total_seconds())
            self._say("checking whether IBM accepted a job")
            time.sleep(soonest_s if soonest_s <= REFUSED_S else self._settle_s)
            self.reconcile()
            if len(self._journal.charges.doubts()) < len(doubts):
                return True
        return False

    def doubt_hints(self) -> list[str]:
        """A line on the jobs in doubt, if there are any."""
        return describe_doubts(self._journal)

    def _await_listing(self, number: int) -> None:
        """Wait until IBM has had time to list the last job sent."""
        doubts = self._journal.charges.doubts(number)
        if doubts:
            since = datetime.now(UTC) - max(doubt.sent_at for doubt in doubts)
            rest_s = self._settle_s - since.total_seconds()
            if rest_s > 0:
                self._say("no answer to a job; checking whether it was accepted")
                time.sleep(min(rest_s, self._settle_s))

    def _jobs_of(self, attempts: list[Submission]) -> list[RemoteJob]:
        return [job for attempt in attempts for job in self._remote.listed(attempt.tag)]

    def _note(self, jobs: list[RemoteJob]) -> set[str]:
        """Record each job in the journal; return the ids of those that were new to it."""
        charges = self._journal.charges
        unexpected = [job for job in jobs if charges.of_job(job.id) is None]
        for job in unexpected:
            number = self._number(job)
            doubts = charges.doubts(number)
            executions = charges.executions_of(number)
            if job.cap_s is None:  # it may belong to any doubt, even the longest
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
        """Cancel duplicate jobs that have not ended."""
        for job in jobs:
            if job.has_ended:
                continue
            self._say(f"job {job.id} duplicates another one; cancelling it")
            try:
                self._remote.cancel(job.id)
            except LiveError:
                self._say(f"job {job.id} could not be cancelled")

    def _is_superfluous(self, job: RemoteJob) -> bool:
        """Whether the counts for the job's position are recorded from another job."""
        latest = self._journal.latest(self._number(job))
        is_here = latest is not None and latest.state == "done"
        is_source = latest is not None and latest.job_id == job.id
        return not is_source and (is_here or self._journal.result is not None)

    def _is_of_run(self, job: RemoteJob) -> bool:
        return any(self._tag.fullmatch(tag) for tag in job.tags or ())

    def _number(self, job: RemoteJob) -> int:
        """The number of the run's job that this job was sent for."""
        return next(int(match[1]) for tag in job.tags or () if (match := self._tag.fullmatch(tag)))


def _may_be_of(job: RemoteJob, digest: str) -> bool:
    """Whether a job may have the PUBs of a digest: a restored journal may request others."""
    tags = [tag for tag in job.tags or () if tag.startswith(TAG)]
    return not tags or not digest.startswith(DIGEST) or tag_of(digest) in tags


def _preference(job: RemoteJob) -> tuple[bool, bool, str]:
    """Sort key: jobs with counts first, failed ones last, then by time."""
    return not job.is_done, job.has_ended, job.created or "~"
