"""Small live runs of the command line, what they must find, and what a ledger must show."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import binom
from standin import Entry, StandIn

from qcompile.live.records import Register

LIMIT_S = 60.0


@dataclass
class Runs:
    """Small live runs, and resuming them until they are finished."""

    call: Callable[..., Any]
    service: StandIn
    errors: list[str] = field(default_factory=list)
    """The words of each call that did not finish."""

    def run(self, *words: object, backend: str = "fake_lima", **settings: object) -> Any:
        """A run of two CartPole episodes, cut after three steps: three jobs."""
        given = {
            "shots": 256,
            "episodes": 2,
            "max_steps": 3,
            "mitigation": "none",
            "speculate": 1,
            "max_qpu_seconds": LIMIT_S,
        } | settings
        options = [
            word for name, value in given.items() for word in (f"--{name.replace('_', '-')}", value)
        ]
        return self.call(
            *("run", "cartpole", "--backend", backend, "--live", "--yes", "--json"),
            *options,
            *words,
        )

    def until_finished(self, answer: Any, *words: object) -> dict[str, Any]:
        """What the run finds, however often it must be resumed."""
        for _ in range(12):
            if answer.code == 0:
                return dict(answer.json())
            assert answer.code == 1, answer.err
            self.errors.append(answer.err)
            answer = self.call("resume", "last", "--json", "--yes", *words)
        raise AssertionError("\n".join(self.errors))


def started(words: Sequence[str]) -> subprocess.Popen[bytes]:
    """The command line with these words in a process of its own, which may be killed."""
    environment = os.environ | {"QCOMPILE_SETTLE_SECONDS": "0.05"}
    return subprocess.Popen(
        [sys.executable, "-m", "qcompile", *words],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def killed(
    service: StandIn, words: Sequence[str], request: str, times: int, pause_s: float
) -> None:
    """The command line with these words, killed soon after the service has seen the request."""
    process = started(words)
    try:
        while service.ledger().requests.get(request, 0) < times:
            assert process.poll() is None
            time.sleep(0.002)
        time.sleep(pause_s)
    finally:
        process.kill()
        process.wait()


def played(result: dict[str, Any]) -> dict[str, Any]:
    """What the machine has decided of a result: all but times, names and what was charged."""
    own = (
        *("wall_seconds", "run", "qpu_seconds", "qpu_seconds_settled", "jobs_uncharged"),
        *("jobs_in_doubt", "max_qpu_seconds"),
    )
    return {name: value for name, value in result.items() if name not in own}


def number_of(entry: Entry) -> tuple[int, int]:
    """Number and attempt of a job, by its tag."""
    general, pubs, tag = sorted(entry.tags, key=len)
    assert (general, pubs[:5]) == ("qcompile", "pubs-")
    number, attempt = tag.split("-")[-2:]
    return int(number), int(attempt)


def check_paid_once(service: StandIn, jobs: int, limit_s: float = LIMIT_S) -> None:
    """Every job of a run was completed and charged exactly once, within the limit."""
    ledger = service.ledger()
    completed = [entry for entry in ledger.jobs if entry.status == "Completed"]
    assert Counter(number_of(entry)[0] for entry in completed) == dict.fromkeys(range(jobs), 1)
    assert all(entry.charged_seconds > 0 for entry in completed)
    charged = [entry for entry in ledger.jobs if entry.charged_seconds]
    assert {entry.id for entry in charged} == {entry.id for entry in completed}
    assert ledger.charged_seconds <= limit_s


def measured_ones(ones: Any, shots: int) -> Register:
    """Register c of one PUB, whose bits are one in the first so many shots, (rows, bits)."""
    from qiskit.primitives import BitArray

    bits = np.arange(shots)[:, None] < np.array(ones)[:, None, :]
    array = BitArray.from_bool_array(bits, order="little")
    return Register(0, "c", bits.shape[:2], bits.shape[2], array.array.tobytes())


def surprises(ones: Any, shots: int, p_one: Any, false_alarms: float = 1e-7) -> Any:
    """Where ones lie in a tail of their binomial law: all within bounds but for false alarms."""
    least = false_alarms / np.size(ones) / 2
    return (binom.cdf(ones, shots, p_one) < least) | (binom.sf(ones - 1, shots, p_one) < least)
