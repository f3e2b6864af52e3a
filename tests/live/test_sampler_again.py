"""A user's program on a GuardedSampler: stopped, run again, and at its limit."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from live_runs import number_of
from standin import Fault, StandIn

from qcompile.errors import BudgetError, LiveError, OptionError, PaidFailureError, ReplayError
from qcompile.live import GuardedSampler
from qcompile.live.journal import Journal
from qcompile.live.perform import costs

from .sampled import VALUES, bits, by_ibm, flipped, two_registers

SHOTS = 300
PROGRAM = """
import json, sys
sys.path.insert(0, sys.argv[1])
from live.sampled import VALUES, bits, flipped, two_registers
from qcompile.live import GuardedSampler

with GuardedSampler("fake_lima", max_qpu_seconds=100, journal="runs/mine") as sampler:
    found = []
    for qubit in range(3):
        pubs = [(two_registers(), VALUES[qubit % 2]), flipped(qubit)]
        found += bits(sampler.run(pubs, shots=300).result())
    print(json.dumps(found))
"""


def pubs(qubit: int) -> list[Any]:
    return [(two_registers(), VALUES[qubit % 2]), flipped(qubit)]


def program() -> subprocess.Popen[str]:
    """Three calls of two PUBs, in a separate process."""
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(Path(__file__).parent.parent)],
        env=os.environ | {"QCOMPILE_SETTLE_SECONDS": "0.05"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def check_paid_once(service: StandIn, jobs: int) -> None:
    """Each place of the journal has one job, which is completed and charged."""
    ledger = service.ledger().jobs
    own = [job for job in ledger if job.tags]
    assert Counter(number_of(job)[0] for job in own) == dict.fromkeys(range(jobs), 1)
    assert all(job.status == "Completed" and job.charged_seconds > 0 for job in own)


@pytest.mark.parametrize(
    ("request_", "times", "pause_s"),
    [("POST /jobs", 2, 0.0), ("GET /jobs/{id}/results", 2, 0.0)],
)
def test_a_killed_program_is_run_again(
    service: StandIn, request_: str, times: int, pause_s: float
) -> None:
    """Its results equal those of IBM's own sampler, and each job is paid once."""
    service.settings.run_seconds = 0.1
    killed = program()
    while service.ledger().requests.get(request_, 0) < times:
        assert killed.poll() is None, killed.communicate()
        time.sleep(0.002)
    time.sleep(pause_s)
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    again = program()
    out, err = again.communicate()
    assert again.returncode == 0, err
    check_paid_once(service, 3)
    expected = [pub for qubit in range(3) for pub in bits(by_ibm("fake_lima", pubs(qubit), SHOTS))]
    assert json.loads(out) == expected


def test_what_is_recorded_needs_no_service(
    service: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    with GuardedSampler("fake_lima") as sampler:
        first = bits(sampler.run(pubs(0), shots=SHOTS).result())
    for name in ("QISKIT_IBM_TOKEN", "QISKIT_IBM_INSTANCE", "QISKIT_IBM_URL"):
        monkeypatch.delenv(name)
    with GuardedSampler("fake_lima") as sampler:
        assert bits(sampler.run(pubs(0), shots=SHOTS).result()) == first


def test_other_pubs_in_a_place_are_refused_and_not_sent(service: StandIn) -> None:
    with GuardedSampler("fake_lima") as sampler:
        sampler.run(pubs(0), shots=SHOTS).result()
    before = service.ledger()
    for other, shots in ((pubs(1), SHOTS), (pubs(0), SHOTS + 1), (pubs(0)[:1], SHOTS)):
        with GuardedSampler("fake_lima") as sampler:
            with pytest.raises(ReplayError) as caught:
                sampler.run(other, shots=shots)
            assert str(caught.value) == (
                f"Job 0 of run {sampler.journal.id} differs from the one that was sent.\n"
                "  The versions are the same.\n"
                "  A journal belongs to one program, which must request the same PUBs in the "
                "same order.\n"
                "  `qcompile runs export mine` saves the measurements."
            )
            sampler.run(pubs(0), shots=SHOTS).result()  # and the right ones are still there
    assert service.ledger().jobs == before.jobs


def test_other_pubs_after_a_refusal_are_told_what_the_place_waits_for(service: StandIn) -> None:
    """A 404 to a job does not say that it was not accepted: it is in doubt for a minute."""
    service.faults.once(Fault.NOT_FOUND, on="POST /jobs", times=10)
    with GuardedSampler("fake_lima") as sampler:
        with pytest.raises(LiveError):
            sampler.run(pubs(0), shots=SHOTS)
        with pytest.raises(
            ReplayError, match=r"(?s)differs from the one that was sent\..*may have accepted"
        ):
            sampler.run(pubs(1), shots=SHOTS)
    assert not service.ledger().jobs


def test_a_program_that_changed_takes_no_job_of_an_older_one(service: StandIn) -> None:
    """The journal was restored from a copy that does not know what was sent since."""
    with GuardedSampler("fake_lima") as sampler:
        sampler.run(pubs(0), shots=SHOTS).result()
    shutil.copytree("runs/mine", "copy")
    with GuardedSampler("fake_lima") as sampler:
        for qubit in (0, 1):
            sampler.run(pubs(qubit), shots=SHOTS).result()
    shutil.rmtree("runs/mine")
    Path("copy").rename("runs/mine")
    with GuardedSampler("fake_lima") as sampler:
        for qubit in (0, 2):
            found = sampler.run(pubs(qubit), shots=SHOTS).result()
        costs = sampler.settle()
    assert costs["qpu_seconds"] == pytest.approx(service.ledger().charged_seconds)
    assert [number_of(job) for job in service.ledger().jobs] == [(0, 0), (1, 0), (1, 0)]
    assert bits(found) == bits(by_ibm("fake_lima", pubs(2), SHOTS))


def test_the_limit_stops_a_program_before_it_sends(service: StandIn) -> None:
    """7 rows of 300 shots take 2.735 s, of 600 3.47 s: of 9 s 3 whole ones are left after two."""
    with GuardedSampler("fake_lima", max_qpu_seconds=9) as sampler:
        for qubit in range(2):
            sampler.run([(two_registers(), VALUES), flipped(qubit)], shots=SHOTS).result()
        for _ in range(2):
            with pytest.raises(BudgetError) as caught:
                sampler.run([(two_registers(), VALUES), flipped(2)], shots=2 * SHOTS)
        assert "The limit of 9 QPU seconds would be exceeded: 5.5 s are spent" in str(caught.value)
        assert str(caught.value).endswith(
            "Jobs done: 2; everything is kept.\n"
            "  Run the same program again with a higher max_qpu_seconds."
        )
        assert len(service.ledger().jobs) == 2
        sampler.run([flipped(3)], shots=10).result()  # a smaller one fits, in the same place
    ledger = service.ledger()
    assert [number_of(job)[0] for job in ledger.jobs] == [0, 1, 2]
    with Journal(Path("runs/mine")) as journal:
        assert costs(journal)["qpu_seconds"] == pytest.approx(ledger.charged_seconds)
    assert ledger.charged_seconds <= 9


def test_a_limit_that_is_none_is_refused(service: StandIn) -> None:
    wrong: list[Any] = [0, -1, float("nan"), float("inf"), 1e7, "5", None, True]
    for limit_s in wrong:
        with pytest.raises(BudgetError, match="The limit cannot be"):
            GuardedSampler("fake_lima", max_qpu_seconds=limit_s)
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("jobs_per_minute", value) for value in (0, -1, 1.5, "x", True)),
        *(("max_wait_s", value) for value in (0, -1, float("nan"), "x")),
        *(("journal", value) for value in (5, None)),
    ],
)
def test_an_argument_of_no_use_is_refused(service: StandIn, name: str, value: Any) -> None:
    with pytest.raises(OptionError, match=name):
        GuardedSampler("fake_lima", **{name: value})
    assert not Path("runs").exists()


def test_a_job_that_is_not_waited_for_is_the_same_when_it_is_asked_for_again(
    service: StandIn,
) -> None:
    """In the program itself, and in the next one: a loop that tries again pays once."""
    service.settings.queue_seconds = 3600
    with GuardedSampler("fake_lima", max_wait_s=0.01) as sampler:
        for _ in range(3):
            with pytest.raises(LiveError, match=r"Run the same program again: it reads the"):
                sampler.run(pubs(0), shots=SHOTS).result()
        assert sampler.costs["jobs_uncharged"] == 0  # it has not ended
    with GuardedSampler("fake_lima", max_wait_s=0.01) as sampler, pytest.raises(LiveError):
        sampler.run(pubs(0), shots=SHOTS).result()
    service.settings.queue_seconds = 0
    assert len(service.ledger().jobs) == 1


def test_the_same_job_asked_for_again_once_it_was_had_is_another(
    service: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    service.faults.chance(Fault.RESULTS_TRUNCATED, 1.0, fetches=4)
    monkeypatch.setattr("qcompile.live.jobs._FETCH_PAUSE_S", 0.0)
    with GuardedSampler("fake_lima") as sampler:
        job = sampler.run([flipped()], shots=SHOTS)
        with pytest.raises(LiveError, match="could not be read in 4 attempts"):
            job.result()
        service.recover()
        assert sampler.run([flipped()], shots=SHOTS).result()
        assert len(service.ledger().jobs) == 1
        sampler.run([flipped()], shots=SHOTS).result()
        assert len(service.ledger().jobs) == 2


def test_a_failure_that_was_paid_is_sent_again_if_the_program_says_so(
    service: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.02, 0.02))
    service.faults.once(Fault.JOB_FAILS_CHARGED)
    with GuardedSampler("fake_lima") as sampler, pytest.raises(LiveError, match="was charged"):
        sampler.run([flipped()], shots=SHOTS).result()
    with (
        GuardedSampler("fake_lima") as sampler,
        pytest.raises(PaidFailureError, match="again with pay_again=True to send it again"),
    ):
        sampler.run([flipped()], shots=SHOTS)
    with GuardedSampler("fake_lima", pay_again=True) as sampler:
        sampler.run([flipped()], shots=SHOTS).result()
        costs = sampler.settle()
    assert costs["qpu_seconds"] == pytest.approx(service.ledger().charged_seconds)
    assert len(service.ledger().jobs) == 2


# One program at a time


def test_two_processes_at_once_are_refused(service: StandIn) -> None:
    service.settings.queue_seconds = 3600
    other = program()
    while not service.ledger().jobs:
        assert other.poll() is None, other.communicate()
        time.sleep(0.01)
    try:
        with pytest.raises(LiveError, match=r"is running in another process\.\n  Wait for it"):
            GuardedSampler("fake_lima")
    finally:
        other.kill()
        other.communicate()
    GuardedSampler("fake_lima").close()  # who is dead holds nothing


def test_a_sampler_made_anew_takes_the_place_of_the_old_one(service: StandIn) -> None:
    """A notebook runs its cells again."""
    old = GuardedSampler("fake_lima")
    job = old.run([flipped()], shots=SHOTS)
    new = GuardedSampler("fake_lima")
    new.run([flipped()], shots=SHOTS).result()
    for ask in (job.result, lambda: old.run([flipped()]), lambda: old.costs, old.settle):
        with pytest.raises(LiveError, match=r"The sampler of runs/mine is closed\."):
            ask()
    new.close()
    new.close()
    assert len(service.ledger().jobs) == 1


def in_thread(work: Callable[[], object]) -> None:
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()


def in_fork(work: Callable[[], object]) -> None:
    child = os.fork()
    if child == 0:
        try:
            work()
        finally:
            os._exit(0)
    os.waitpid(child, 0)


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
@pytest.mark.parametrize("elsewhere", [in_thread, in_fork])
def test_nobody_else_asks(service: StandIn, elsewhere: Callable[..., None]) -> None:
    """A thread has another order; a fork has the lock of its parent without knowing."""
    sampler = GuardedSampler("fake_lima")
    said = Path("said")

    def ask() -> None:
        try:
            sampler.run([flipped()], shots=SHOTS)
        except LiveError as error:
            said.write_text(str(error))
        finally:
            sampler.close()

    elsewhere(ask)
    assert said.read_text().startswith("A GuardedSampler can only be used by")
    with (
        pytest.raises(LiveError, match="is running in another process"),
        Journal(sampler.journal.folder).locked(),
    ):
        pass
    sampler.run([flipped()], shots=SHOTS).result()
    sampler.close()
    assert len(service.ledger().jobs) == 1
