"""When the next job may be sent: a number of jobs per minute, and IBM's Retry-After."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta

from qcompile.caller import option
from qcompile.errors import LiveError, OptionError
from qcompile.live.charges import Charges
from qcompile.live.client_errors import duration, retry_after_s

MINUTE_S = 60.0
_LATE_S = 5.0
"""A job of an earlier process may have reached IBM this much after it was sent."""
_LONGEST_S = 3600.0
_LOOK_S = 1.0


def check_seconds(name: str, value: float, most: float = math.inf) -> None:
    """Check that `value` is a number of seconds, above 0 and at most `most`.

    Raises:
        OptionError: it is not; the message names it `name`.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= most:
        raise OptionError(
            f"{option(name)} cannot be {value!r}.",
            "It is a number of seconds above 0"
            + (f" and at most {most:g}." if most < math.inf else "."),
        )


def check_pace(jobs_per_minute: int | None, max_wait_s: float | None) -> None:
    """Check a pace and a waiting time; None means no limit.

    Raises:
        OptionError: one of them is not a valid number.
    """
    if max_wait_s is not None:
        check_seconds("max_wait_s", max_wait_s)
    jobs = jobs_per_minute
    if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1):
        raise OptionError(
            f"{option('jobs_per_minute')} cannot be {jobs!r}.",
            "It is a whole number of jobs, at least 1; None sends them as fast as possible.",
        )


class Pace:
    """Limits submissions to `jobs_per_minute` in any minute; None means no limit.

    Earlier submissions are read from the journal, so a resumed run keeps its pace. No job is sent
    before the time in IBM's Retry-After. `say` gets a message while waiting. A wait longer than
    `max_wait_s`, or than an hour, stops the run, which can be resumed later.
    """

    def __init__(
        self,
        charges: Charges,
        jobs_per_minute: int | None = None,
        *,
        max_wait_s: float | None = None,
        say: Callable[[str], None] = lambda words: None,
    ):
        self._charges, self._most, self._say = charges, jobs_per_minute, say
        self._longest_s = _LONGEST_S if max_wait_s is None else min(max_wait_s, _LONGEST_S)
        self._began = datetime.now(UTC)
        self._answered: list[datetime] = []
        """When the submissions of this process in the last minute were answered."""
        self._asked_for = 0.0
        """The value of time.monotonic before which IBM wants no job."""

    @property
    def job_s(self) -> float:
        """The shortest average time between two jobs, in seconds."""
        return MINUTE_S / self._most if self._most else 0.0

    @contextmanager
    def turn(self) -> Iterator[None]:
        """The block in which a job is sent; it starts when the next job may be sent.

        Raises:
            LiveError: the wait would be too long.
        """
        while (asked_s := self._asked_for - time.monotonic()) > 0:
            self._wait(asked_s, "IBM accepts the next job in")
        while (pace_s := self._pace_s()) > 0:
            self._wait(pace_s, f"limit of {self._most} jobs a minute; next one in")
        try:
            yield
        except Exception as error:
            if (seconds := retry_after_s(error)) is not None:
                self._asked_for = time.monotonic() + seconds
            raise
        finally:
            self._answered.append(datetime.now(UTC))

    def _wait(self, seconds: float, words: str) -> None:
        if seconds > self._longest_s:
            raise LiveError(
                f"The next job can be sent in {duration(seconds)}.", "Nothing is lost: resume then."
            )
        self._say(f"{words} {duration(seconds)}")
        time.sleep(min(seconds, _LOOK_S))

    def _pace_s(self) -> float:
        """The seconds until another job may be sent."""
        if self._most is None:
            return 0.0
        now, minute = datetime.now(UTC), timedelta(seconds=MINUTE_S)
        late = timedelta(seconds=_LATE_S)
        since = (now - minute - late).replace(microsecond=0).isoformat()
        earlier = [
            charge.sent_at + late
            for charge in self._charges.all("sent_at >= ?", since)
            if charge.sent_at < self._began
        ]
        self._answered = [at for at in self._answered if at > now - minute]
        sent = sorted(earlier + self._answered)
        if len(sent) < self._most:
            return 0.0
        return (sent[-self._most] + minute - now).total_seconds()
