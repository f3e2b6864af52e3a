"""The books of a sampler, as reported by `runs` and `resume`: no charge is hidden."""

from __future__ import annotations

import re
from base64 import b64decode
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_runs import Runs
from qiskit.primitives import BitArray
from standin import Fault, StandIn

from qcompile.errors import LiveError
from qcompile.live import GuardedSampler
from qcompile.live.answers import Metrics, read
from qcompile.live.connection import Connection
from qcompile.live.finder import Finder
from qcompile.live.journal import Journal
from qcompile.live.remote import RemoteJobs

from .sampled import VALUES, bits, by_ibm, flipped, two_registers

SUBMIT = "POST /jobs"
SHOTS = 300
PUBS: list[Any] = [(two_registers(), VALUES), flipped()]


def told(runs: Runs) -> dict[str, Any]:
    [row] = runs.call("runs", "--json").json()
    return dict(row)


def test_runs_tell_what_a_sampler_has_and_what_it_costs(runs: Runs) -> None:
    with GuardedSampler("fake_lima", max_qpu_seconds=50, journal="runs/mine") as sampler:
        found = sampler.run(PUBS, shots=SHOTS).result()
    row, charged_s = told(runs), runs.service.ledger().charged_seconds
    assert (row["kind"], row["state"], row["jobs_done"]) == ("sampler", "finished", 1)
    assert row["qpu_seconds"] == row["qpu_seconds_settled"] == pytest.approx(charged_s)
    for name in ("mine", "last", row["run"]):
        shown = runs.call("runs", "show", name)
        assert shown.out == (
            f"{row['run']}, sampler on fake_lima: finished\n"
            "Jobs done: 1; everything is kept.\n"
            f"{charged_s:.1f} QPU seconds charged; the limit is 50\n"
            "To continue, run its program again. `qcompile resume mine` fetches the jobs sent.\n"
        )
    exported = runs.call("runs", "export", "mine").json()
    assert exported["settings"]["backend"] == "fake_lima"
    [job] = exported["jobs"]
    names = [(part["pub"], part["register"]) for part in job["measured"]]
    assert names == [(0, "left"), (0, "right"), (1, "meas")]
    for part in job["measured"]:
        ours = found[part["pub"]].data[part["register"]]
        packed = np.frombuffer(b64decode(part["packed"]), np.uint8)
        array = BitArray(packed.reshape(*part["shape"], -1), part["bits"])
        assert array == ours
        ones = ours.to_bool_array(order="little").sum(axis=-2)
        np.testing.assert_array_equal(part["ones"], ones)


def test_resume_fetches_what_a_program_sent_and_did_not_wait_for(runs: Runs) -> None:
    runs.service.settings.queue_seconds = 2.0
    with GuardedSampler("fake_lima") as sampler:
        sampler.run(PUBS, shots=SHOTS)
    assert (told(runs)["state"], told(runs)["jobs_open"]) == ("unfinished", 1)
    answer = runs.call("resume", "mine", "--max-wait-seconds", 0.01)
    assert answer.code == 1
    assert "Run the same program again: it reads the recorded jobs and resumes.\n" in answer.err
    found = runs.call("resume", "mine", "--json").json()
    assert (found["backend"], found["jobs_done"], found["jobs_open"]) == ("fake_lima", 1, 0)
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)
    expected = bits(by_ibm("fake_lima", PUBS, SHOTS))
    with GuardedSampler("fake_lima") as sampler:
        assert bits(sampler.run(PUBS, shots=SHOTS).result()) == expected


def test_resume_finds_a_job_that_the_program_does_not_know_of(runs: Runs) -> None:
    """Its answer was lost, and the program stopped; nothing is sent, and the bits are kept."""
    runs.service.faults.once(Fault.ACCEPTED_DROPPED, on=SUBMIT)
    sampler = GuardedSampler("fake_lima")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Finder, "find", lambda self, submission: None)
        patch.setattr("qcompile.live.sender._MAX_SENDS", 1)
        with pytest.raises(LiveError):
            sampler.run(PUBS, shots=SHOTS)
    sampler.close()
    assert told(runs)["jobs_in_doubt"] == 1
    answer = runs.call("resume", "mine")
    assert answer.code == 0, answer.err
    assert answer.out.startswith(
        "fake_lima: 1 job done, 0 open\nTo continue, run its program again.\n"
    )
    found = runs.call("resume", "mine", "--json").json()
    assert (found["jobs_done"], found["jobs_open"], found["jobs_in_doubt"]) == (1, 0, 0)
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)
    expected = bits(by_ibm("fake_lima", PUBS, SHOTS))
    with GuardedSampler("fake_lima") as sampler:
        assert bits(sampler.run(PUBS, shots=SHOTS).result()) == expected
    assert len(runs.service.ledger().jobs) == 2  # this one and IBM's own sampler's


def test_the_example_of_the_documentation_works(
    service: StandIn, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (Path(__file__).parents[2] / "docs" / "howto" / "guarded-sampler.md").read_text()
    [block] = [part for part in re.findall(r"```python\n(.*?)```", page, re.S) if "Guarded" in part]
    exec(block.replace("ibm_fez", "fake_lima"), {})
    counts, costs = capsys.readouterr().out.split("} {")
    assert counts.startswith("{'0")
    assert "'qpu_seconds': 3.05" in costs
    [job] = service.ledger().jobs
    assert (job.circuits, job.shots) == (3, 1000)


def test_a_sampler_has_no_file(runs: Runs) -> None:
    GuardedSampler("fake_lima").close()
    answer = runs.call("resume", "mine", "--out", "a.json")
    assert (answer.code, answer.err.split("Error: ")[1]) == (
        1,
        "A sampler writes no file.\n  Remove --out.\n",
    )


# Another journal, another place


def test_a_journal_of_another_kind_or_machine_is_refused(runs: Runs) -> None:
    runs.run(max_steps=1)
    [folder] = Path("runs").iterdir()
    with pytest.raises(LiveError, match="is the journal of a run, not of a sampler"):
        GuardedSampler("fake_lima", journal=folder)
    with pytest.raises(LiveError, match=r"runs has other files but no journal\.\n.*'runs/mine'"):
        GuardedSampler("fake_lima", journal="runs")
    GuardedSampler("fake_lima", journal="runs/mine").close()
    for backend, account, words in (
        ("fake_belem", None, "fake_belem, the default account"),
        ("fake_lima", "other", "fake_lima, account other"),
    ):
        belongs = r"runs/mine belongs to fake_lima, the default account\."
        with pytest.raises(LiveError, match=rf"{belongs}\n  This sampler uses {words}\."):
            GuardedSampler(backend, journal="runs/mine", account=account)
    Path("runs/mine").rename("runs/moved")
    with pytest.raises(LiveError, match=r"(?s)in another folder.*`qcompile resume moved` asks"):
        GuardedSampler("fake_lima", journal="runs/moved")
    assert runs.call("resume", "moved", "--yes").code == 0
    GuardedSampler("fake_lima", journal="runs/moved").close()


def test_an_unknown_machine_makes_no_journal(service: StandIn) -> None:
    with pytest.raises(LiveError, match="The account has no backend 'nosuch'"):
        GuardedSampler("nosuch")
    assert not Path("runs").exists()


# Corners in which a charge might pass unseen


def unreachable() -> LiveError:
    """The error of a request without a connection: it never left this machine."""
    try:
        Connection("fake_lima", patience_s=0.0).device()
    except LiveError as error:
        return error
    raise AssertionError("it was answered")


def test_an_error_that_the_program_handles_says_nothing_of_what_it_sends(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python chains it to every error in the handler: the request did have a connection."""
    with monkeypatch.context() as patch:
        for name in ("QISKIT_IBM_URL", "IAM_URL"):
            patch.setenv(name, "http://127.0.0.1:9/experimental")
        patch.setattr("urllib3.util.retry.Retry.get_backoff_time", lambda retry: 0.0)
        earlier = unreachable()
    sampler = GuardedSampler("fake_lima")
    runs.service.faults.listing_lag_seconds = 3600
    runs.service.faults.once(Fault.ACCEPTED_DROPPED, on=SUBMIT, times=3)
    try:
        raise earlier
    except LiveError:
        with pytest.raises(LiveError, match="IBM's service does not answer"):
            sampler.run(PUBS, shots=SHOTS)
    charged_s = runs.service.ledger().charged_seconds
    assert len(runs.service.ledger().jobs) == 3
    assert sampler.costs["jobs_in_doubt"] == 3
    assert sampler.costs["qpu_seconds"] >= charged_s > 0
    sampler.close()


@pytest.mark.parametrize("status", ["pending", "estimated", "", "PENDING"])
def test_a_charge_counts_once_it_is_complete(status: str) -> None:
    """A usage that IBM does not call complete may be zero, and a charge later."""
    usage = {"qpu_charge_time_seconds": 0, "status": status}
    assert read(Metrics, {"usage": usage}, "a job").charged_s(10) is None
    usage = {"qpu_charge_time_seconds": 3, "status": "complete"}
    assert read(Metrics, {"usage": usage}, "a job").charged_s(10) == 3.0


def test_a_clock_that_was_days_ahead_hides_no_job(service: StandIn) -> None:
    """The run began in a week, by its own clock; its doubt is due, and IBM lists the job."""
    service.faults.once(Fault.ACCEPTED_DROPPED, on=SUBMIT)
    sampler = GuardedSampler("fake_lima")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Finder, "find", lambda self, submission: None)
        patch.setattr("qcompile.live.sender._MAX_SENDS", 1)
        with pytest.raises(LiveError):
            sampler.run(PUBS, shots=SHOTS)
    database = sampler.journal._db
    ahead, long_ago = datetime.now(UTC) + timedelta(days=7), datetime(2020, 1, 1, tzinfo=UTC)
    database.do("UPDATE run SET created = ?", ahead.isoformat())
    database.do("UPDATE charge SET sent_at = ?", long_ago.isoformat())
    sampler.close()
    with Journal(Path("runs/mine")) as journal, journal.locked():
        finder = Finder(journal, RemoteJobs(Connection("fake_lima")), 0.0, lambda words: None)
        finder.reconcile()
        [charge] = journal.charges.all()
        assert charge.job_id == service.ledger().jobs[0].id
