"""Faults of a service, on request or at random, and their counts."""

from __future__ import annotations

import threading
from collections import Counter
from enum import StrEnum
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from .answers import RESULTS, Reshape, reshaped


class Fault(StrEnum):
    """The kinds of faults, by the moment at which they strike."""

    RATE_LIMITED = "rate_limited"
    """429 with Retry-After, before the request is handled."""
    SERVER_ERROR = "server_error"
    """500, before the request is handled."""
    BAD_GATEWAY = "bad_gateway"
    """502, before the request is handled."""
    UNAVAILABLE = "unavailable"
    """503 with Retry-After, before the request is handled."""
    GATEWAY_TIMEOUT = "gateway_timeout"
    """504, before the request is handled."""
    NOT_FOUND = "not_found"
    """404, before the request is handled."""
    DROPPED = "dropped"
    """The connection ends without an answer, before the request is handled."""
    ACCEPTED_504 = "accepted_504"
    """504 to POST /jobs, although the job was accepted."""
    ACCEPTED_DROPPED = "accepted_dropped"
    """The connection ends without an answer to POST /jobs, although the job was accepted."""
    ACCEPTED_400 = "accepted_400"
    """400 to POST /jobs, although the job was accepted; the next ones alike."""
    ACCEPTED_401 = "accepted_401"
    ACCEPTED_403 = "accepted_403"
    ACCEPTED_404 = "accepted_404"
    ACCEPTED_409 = "accepted_409"
    ACCEPTED_413 = "accepted_413"
    ACCEPTED_429 = "accepted_429"
    TAGS_IGNORED = "tags_ignored"
    """GET /jobs lists jobs of any tags."""
    TAGS_HIDDEN = "tags_hidden"
    """GET /jobs lists jobs of any tags, and does not say which they have."""
    CUT_ANSWER = "cut_answer"
    """The answer breaks off half way: the request was handled, its body is not complete."""
    JOB_FAILS = "job_fails"
    """The job ends Failed by an error of the system, and is not charged."""
    JOB_FAILS_CHARGED = "job_fails_charged"
    """The job ends Failed by an error of the system, and is charged all the same."""
    JOB_CANCELLED = "job_cancelled"
    """Somebody else cancels the job while it waits."""
    JOB_WAITS = "job_waits"
    """The job is queued for `Faults.wait_seconds` longer."""
    RESULTS_TRUNCATED = "results_truncated"
    """The results are the first half of their JSON."""
    RESULTS_MISSHAPEN = "results_misshapen"
    """The results are valid JSON of another shape."""
    RESULTS_EMPTY = "results_empty"
    """The body of the results is empty."""
    REASON_MISSING = "reason_missing"
    """404 to the results of a job that did not complete."""


STATUS = {
    Fault.RATE_LIMITED: 429,
    Fault.SERVER_ERROR: 500,
    Fault.BAD_GATEWAY: 502,
    Fault.UNAVAILABLE: 503,
    Fault.GATEWAY_TIMEOUT: 504,
    Fault.NOT_FOUND: 404,
}
BEFORE = (*STATUS, Fault.DROPPED)
ACCEPTED_STATUS = {
    kind: int(kind.removeprefix("accepted_"))
    for kind in Fault
    if kind.startswith("accepted_") and kind is not Fault.ACCEPTED_DROPPED
}
AFTER_ACCEPTING = (*ACCEPTED_STATUS, Fault.ACCEPTED_DROPPED)
OF_LISTS = (Fault.TAGS_IGNORED, Fault.TAGS_HIDDEN)
OF_JOBS = (Fault.JOB_FAILS, Fault.JOB_FAILS_CHARGED, Fault.JOB_CANCELLED, Fault.JOB_WAITS)
OF_RESULTS = (Fault.RESULTS_TRUNCATED, Fault.RESULTS_MISSHAPEN, Fault.RESULTS_EMPTY)

_SETTINGS = (
    *("listing_lag_seconds", "wait_seconds", "retry_after_seconds"),
    *("retry_after_is_a_date", "echo_secrets", "suffix"),
)


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Once(_Record):
    """`kind` strikes the next `times` requests that are `on` (None: any but the token's)."""

    kind: Fault
    on: str | None = None
    times: int = Field(default=1, ge=1)


class Chance(_Record):
    """`kind` strikes each request that is `on` with a probability.

    For malformed results the draw is once for a job, and spoils its first `fetches` fetches.
    """

    kind: Fault
    probability: float = Field(ge=0, le=1)
    on: str | None = None
    fetches: int = Field(default=1, ge=1)


class Orders(_Record):
    """The body of POST /standin/faults: every given part is applied, `clear` first."""

    clear: bool = False
    once: tuple[Once, ...] = ()
    chance: tuple[Chance, ...] = ()
    reshape: tuple[Reshape, ...] = ()
    listing_lag_seconds: float | None = Field(default=None, ge=0)
    wait_seconds: float | None = Field(default=None, ge=0)
    retry_after_seconds: int | None = Field(default=None, ge=0)
    retry_after_is_a_date: bool | None = None
    echo_secrets: bool | None = None
    suffix: str | None = None
    expire_tokens: bool = False
    refuse_key: bool | None = None
    retire: tuple[str, ...] = ()
    restore: tuple[str, ...] = ()


class Faults:
    """The rules by which requests go wrong; safe to change from any thread while they come in."""

    def __init__(self, seed: int = 0):
        self.listing_lag_seconds = 0.0
        """How long a new job is missing from GET /jobs."""
        self.wait_seconds = 3600.0
        """How much longer JOB_WAITS keeps a job in the queue."""
        self.retry_after_seconds = 1
        """What 429 and 503 say in Retry-After."""
        self.retry_after_is_a_date = False
        self.echo_secrets = False
        """Whether what is said of an error repeats the headers that came with the request."""
        self.suffix = ""
        """What all that is said of an error, or of why a job ended, ends with."""
        self.key_refused = False
        """Whether the API key is refused for good: no token is given, and none is taken."""
        self.retired: set[str] = set()
        """The backends that are gone; their old jobs can still be read."""
        self.counts: Counter[str] = Counter()
        """How often each kind of fault struck."""
        self._expired = 0
        self._once: list[tuple[Once, int]] = []
        self._chance: list[Chance] = []
        self._reshape: list[tuple[Reshape, int | None]] = []
        self._rng = np.random.default_rng(seed)
        self._lock = threading.RLock()

    def seed(self, seed: int) -> None:
        """Reseed the random faults."""
        with self._lock:
            self._rng = np.random.default_rng(seed)

    def once(self, kind: Fault | str, *, on: str | None = None, times: int = 1) -> None:
        """Make `kind` strike the next `times` requests that are `on`, such as "POST /jobs"."""
        with self._lock:
            rule = Once(kind=Fault(kind), on=on, times=times)
            self._once.append((rule, times))

    def chance(
        self, kind: Fault | str, probability: float, *, on: str | None = None, fetches: int = 1
    ) -> None:
        """Make `kind` strike at random; a probability of 0 ends it."""
        rule = Chance(kind=Fault(kind), probability=probability, on=on, fetches=fetches)
        with self._lock:
            self._chance = [r for r in self._chance if (r.kind, r.on) != (rule.kind, rule.on)]
            if probability:
                self._chance.append(rule)

    def reshape(self, rule: Reshape) -> None:
        """Change the shape of answers by `rule`, in addition to existing rules."""
        with self._lock:
            self._reshape.append((rule, rule.times))

    def expire_tokens(self) -> None:
        """Refuse every token issued so far; a new one is accepted."""
        with self._lock:
            self._expired += 1

    @property
    def expired(self) -> int:
        """How often the tokens were expired: one of an earlier generation is refused."""
        return self._expired

    def refuse_key(self, refused: bool = True) -> None:
        self.key_refused = refused

    def retire(self, backend: str) -> None:
        with self._lock:
            self.retired.add(backend)

    def restore(self, backend: str) -> None:
        with self._lock:
            self.retired.discard(backend)

    def clear(self) -> None:
        """End all faults; the counts stay."""
        with self._lock:
            self._once, self._chance, self._reshape = [], [], []
            self.listing_lag_seconds, self.key_refused = 0.0, False
            self.echo_secrets, self.suffix = False, ""
            self.retry_after_is_a_date = False
            self.retired.clear()

    def order(self, orders: Orders) -> None:
        """Apply a request to POST /standin/faults."""
        with self._lock:
            if orders.clear:
                self.clear()
            for rule in orders.once:
                self.once(rule.kind, on=rule.on, times=rule.times)
            for chance in orders.chance:
                self.chance(chance.kind, chance.probability, on=chance.on, fetches=chance.fetches)
            for shape in orders.reshape:
                self.reshape(shape)
            for name in _SETTINGS:
                if (value := getattr(orders, name)) is not None:
                    setattr(self, name, value)
            if orders.expire_tokens:
                self.expire_tokens()
            if orders.refuse_key is not None:
                self.refuse_key(orders.refuse_key)
            self.retired |= set(orders.retire)
            self.retired -= set(orders.restore)

    def strike(self, kinds: tuple[Fault, ...], request: str) -> Fault | None:
        """The kind that strikes this request, if any; it is used up but not yet counted."""
        with self._lock:
            if kind := self._spend(kinds, request):
                return kind
            for chance in self._chance:
                if chance.kind in kinds and _meets(chance.on, request) and self._hits(chance):
                    return chance.kind
        return None

    def strike_results(self, first: bool) -> tuple[Fault | None, int]:
        """The fault of a fetch of results, and the number of the job's fetches it affects."""
        with self._lock:
            if kind := self._spend(OF_RESULTS, RESULTS):
                return kind, 1
            for chance in self._chance:
                if first and chance.kind in OF_RESULTS and self._hits(chance):
                    return chance.kind, chance.fetches
        return None, 0

    def reshapes(self, request: str) -> bool:
        """Whether a rule may change the answers to these requests."""
        with self._lock:
            return any(rule.on == request and left != 0 for rule, left in self._reshape)

    def reshaped(self, request: str, answer: Any) -> tuple[Any, bool]:
        """The answer to a request after all rules, and whether any of them changed it."""
        struck = False
        with self._lock:
            for index, (rule, left) in enumerate(self._reshape):
                if rule.on == request and left != 0:
                    answer, changed = reshaped(answer, rule)
                    struck = struck or changed
                    if changed and left is not None:
                        self._reshape[index] = (rule, left - 1)
        return answer, struck

    def _spend(self, kinds: tuple[Fault, ...], request: str) -> Fault | None:
        for index, (rule, left) in enumerate(self._once):
            if rule.kind in kinds and _meets(rule.on, request):
                self._once[index : index + 1] = [(rule, left - 1)] if left > 1 else []
                return rule.kind
        return None

    def record(self, kind: Fault | str) -> None:
        """Count a fault that happened."""
        with self._lock:
            self.counts[str(kind)] += 1

    def _hits(self, chance: Chance) -> bool:
        return bool(self._rng.random() < chance.probability)


def _meets(on: str | None, request: str) -> bool:
    return request != "POST /identity/token" if on is None else on == request
