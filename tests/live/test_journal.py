"""The journal: everything recorded is there when it is opened again."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from qcompile.errors import LiveError
from qcompile.live.journal import Journal
from qcompile.live.records import Register

RUNS = Path("runs")
SETTINGS = {"backend": "somewhere", "shots": 3, "angles": [0.1, None]}
VERSIONS = {"numpy": "2.0.1", "machine": "x86_64"}


def new(name: str = "cart", limit_s: float = 12.5) -> Journal:
    return Journal.create(RUNS, "run", name, SETTINGS, VERSIONS, limit_s)


def again(journal: Journal) -> Journal:
    """The same file by a connection of its own."""
    return Journal(journal.folder)


def test_a_new_run_has_a_folder_named_by_time_and_name() -> None:
    before = datetime.now(UTC)
    journal = new("lunar lander/ü")
    found = again(journal)
    stamp, words = found.id[:13], found.id[14:]
    assert datetime.strptime(stamp, "%y%m%d-%H%M%S").replace(tzinfo=UTC) >= before.replace(
        microsecond=0
    )
    assert re.fullmatch(r"lunar-lander-[0-9a-f]{4}", words)  # the first twelve signs of the name
    assert found.folder == RUNS / found.id
    assert (found.kind, found.settings, found.max_qpu_seconds) == ("run", SETTINGS, 12.5)
    assert found.versions == VERSIONS
    assert found.created == journal.created >= before
    assert found.result is None
    assert found.submissions() == found.charges.all() == []
    assert len(found.steps) == 0


def test_a_submission_is_there_from_before_it_is_sent_until_its_counts() -> None:
    journal = new()
    asked = [Register(0, "c", (2, 8), 3), Register(1, "more", (1, 1, 8), 9)]
    made = journal.intend(4, "digest", 800, asked)
    seen = again(journal).latest(4)
    assert seen == made
    assert seen is not None
    assert (seen.number, seen.attempt, seen.digest, seen.executions) == (4, 0, "digest", 800)
    assert (seen.state, seen.job_id, seen.charged_s, seen.ones) == ("intended", None, None, None)
    assert again(journal).measured.of(4) == asked
    assert (seen.sent_at, seen.cap_s) == (None, None)

    before = datetime.now(UTC)
    noted = journal.note_sending(made, 17)
    sending = again(journal).latest(4)
    assert sending == noted
    assert sending is not None
    assert sending.sent_at is not None
    assert before <= sending.sent_at <= datetime.now(UTC)
    assert (sending.state, sending.cap_s, sending.job_id) == ("sending", 17, None)

    journal.note_sent(made, "job-a")
    sent = again(journal).latest(4)
    assert sent is not None
    assert (sent.state, sent.job_id, sent.charged_s) == ("sent", "job-a", None)
    assert (sent.sent_at, sent.cap_s) == (noted.sent_at, 17)

    bits = [replace(asked[0], packed=bytes(range(16))), replace(asked[1], packed=b"ab" * 8)]
    journal.note_done(made, bits)
    charge(journal, "job-a", 2.25)
    done = again(journal).latest(4)
    assert done is not None
    assert (done.state, done.job_id, done.charged_s) == ("done", "job-a", 2.25)
    found = again(journal).measured.of(4)
    assert found == bits
    np.testing.assert_array_equal(found[0].bits, np.arange(16).reshape(2, 8, 1))
    np.testing.assert_array_equal(found[1].bits, np.array([[[[97, 98]] * 8]]))
    assert again(journal).measured.of(3) == []


def test_attempts_count_up_and_every_tag_is_its_own() -> None:
    journal, other = new(), new()
    tags = []
    for number, attempt in [(0, 0), (1, 0), (0, 1), (0, 2), (11, 0), (1, 1)]:
        made = journal.intend(number, "d", 1)
        assert (made.number, made.attempt) == (number, attempt)
        journal.note_failed(made, "it rained")
        tags.append(made.tag)
    tags.append(other.intend(0, "d", 1).tag)
    assert len(set(tags)) == len(tags) == 7
    assert all(len(tag) <= 86 for tag in tags)  # the service takes no longer ones
    found = again(journal).submissions()
    order = [(made.number, made.attempt) for made in found]
    assert order == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (11, 0)]
    assert {(s.state, s.words) for s in found} == {("failed", "it rained")}


def test_sent_again_it_has_the_time_and_the_cap_of_the_last_time() -> None:
    journal = new()
    first = journal.note_sending(journal.intend(0, "d", 10), 17)
    second = journal.note_sending(first, 9)
    assert again(journal).submissions() == [second]
    assert second.cap_s == 9
    assert first.sent_at is not None
    assert second.sent_at is not None
    assert second.sent_at > first.sent_at


def charge(journal: Journal, job_id: str, charged_s: float) -> None:
    found = journal.charges.of_job(job_id)
    assert found is not None
    journal.charges.settle(found, charged_s)


def several() -> Journal:
    """A run with submissions of every state, the first of them with a second job."""
    journal = new()
    failed = journal.note_sending(journal.intend(0, "d", 10), 5)
    journal.note_sent(failed, "job-a")
    journal.note_failed(failed, "no")
    charge(journal, "job-a", 1.5)
    done = journal.note_sending(journal.intend(0, "d", 11), 6)
    journal.note_sent(done, "job-b")
    journal.charges.note_unexpected(0, 11, 6, datetime.now(UTC), "job-x")
    journal.note_done(done, [])
    sent = journal.note_sending(journal.intend(1, "e", 20), 7)
    journal.note_sent(sent, "job-c")
    journal.note_sending(journal.intend(2, "f", 30), 8)
    journal.intend(3, "g", 40)
    return journal


def test_every_job_that_ibm_has_or_may_have_is_a_charge() -> None:
    """Except jobs that were never sent; a duplicate job costs too."""
    charges = again(several()).charges
    assert [(c.number, c.executions, c.cap_s, c.job_id, c.charged_s) for c in charges.all()] == [
        (0, 10, 5, "job-a", 1.5),
        (0, 11, 6, "job-b", None),
        (0, 11, 6, "job-x", None),
        (1, 20, 7, "job-c", None),
        (2, 30, 8, None, None),
    ]
    assert (charges.settled_s, charges.upper_s) == (1.5, 1.5 + 6 + 6 + 7 + 8)
    assert again(several()).jobs_done() == 1


def test_charges_that_are_not_known_yet_are_learnt_later() -> None:
    """For jobs that have ended, and duplicates; a job under way has no charge yet."""
    journal = several()
    assert [c.job_id for c in again(journal).charges.uncharged()] == ["job-b", "job-x"]
    charge(journal, "job-b", 2.25)
    assert [c.job_id for c in again(journal).charges.uncharged()] == ["job-x"]
    charge(journal, "job-x", 0.0)
    assert again(journal).charges.uncharged() == []
    assert again(journal).charges.settled_s == 3.75
    latest = again(journal).latest(0)
    assert latest is not None
    assert latest.charged_s == 2.25


def test_a_run_is_settled_once_it_was_looked_over_and_nothing_is_open() -> None:
    journal = new()
    made = journal.intend(0, "d", 10)
    journal.charges.note_reconciled()
    assert again(journal).charges.are_settled
    journal.note_sending(made, 5)
    journal.note_sent(made, "job-a")
    journal.note_done(made, [])
    charge(journal, "job-a", 1.0)
    assert not again(journal).charges.are_settled  # something was sent since
    journal.charges.note_reconciled()
    assert again(journal).charges.are_settled


def test_what_is_written_is_on_the_disk_before_anything_else_happens() -> None:
    """SQLite's FULL, 2: without it a power cut loses committed writes."""
    journal = new()
    for seen in (journal, again(journal)):
        assert seen._db.connection.execute("PRAGMA synchronous").fetchone() == (2,)


def test_what_belongs_together_is_there_wholly_or_not_at_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A doubt and the submission that is being sent; a job's id in both of its places."""
    journal = new()
    made = journal.intend(0, "d", 10)
    journal.note_sending(made, 5)
    before = again(journal).submissions(), again(journal).charges.all()

    def fail(*values: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(journal, "_note", fail)
    for write in (lambda: journal.note_sending(made, 7), lambda: journal.note_sent(made, "job-a")):
        with pytest.raises(KeyboardInterrupt):
            write()
        assert (again(journal).submissions(), again(journal).charges.all()) == before


def test_steps_come_back_as_they_were() -> None:
    journal = new()
    seen = np.array([[1 / 3, np.nan, -np.inf], [0.1, -0.0, 1e-300]])
    assert journal.steps.at(0) is None
    journal.steps.note_actions(0, seen, np.array([2, 0], dtype=np.intp))
    half = again(journal).steps.at(0)
    assert half is not None
    assert half.rewards is None
    np.testing.assert_array_equal(half.observations, seen)
    assert half.observations.dtype == np.float64
    assert np.signbit(half.observations[1, 1])
    assert half.actions.tolist() == [2, 0]
    journal.steps.note_rewards(0, [0.1, float("nan")])
    whole = again(journal).steps.at(0)
    assert whole is not None
    assert whole.rewards is not None
    np.testing.assert_array_equal(whole.rewards, [0.1, np.nan])
    assert len(again(journal).steps) == 1
    assert again(journal).steps.at(1) is None


def test_float32_observations_stay_float32() -> None:
    journal = new()
    journal.steps.note_actions(0, np.array([[0.1]], np.float32), np.array([1]))  # type: ignore[arg-type]
    step = again(journal).steps.at(0)
    assert step is not None
    assert step.observations.dtype == np.float32
    assert step.observations[0, 0] == np.float32(0.1)


def test_another_limit_and_the_result_are_kept() -> None:
    journal = new()
    journal.allow(99.0)
    journal.finish({"mean": 1.5, "none": None})
    assert again(journal).max_qpu_seconds == 99.0
    assert again(journal).result == {"mean": 1.5, "none": None}


def test_a_block_closes_it() -> None:
    with new() as journal:
        assert journal.submissions() == []
    with pytest.raises(LiveError, match="cannot be read: Cannot operate on a closed"):
        journal.submissions()
    with again(journal) as opened:
        assert opened.id == journal.id
