"""The journal: what is written down is there for whoever opens it next."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from qcompile.errors import LiveError
from qcompile.live.journal import Charge, Journal, find_journal, journals

RUNS = Path("runs")
SETTINGS = {"backend": "somewhere", "shots": 3, "angles": [0.1, None]}


def new(name: str = "cart", limit_s: float = 12.5) -> Journal:
    return Journal.create(RUNS, "run", name, SETTINGS, limit_s)


def again(journal: Journal) -> Journal:
    """The same file by a connection of its own."""
    return Journal(journal.folder)


def test_a_new_run_has_a_folder_named_by_time_and_name() -> None:
    before = datetime.now(UTC)
    journal = new("lunar lander/ü")
    found = again(journal)
    stamp, words = found.id[:15], found.id[16:]
    assert datetime.strptime(stamp, "%Y%m%d-%H%M%S").replace(tzinfo=UTC) >= before.replace(
        microsecond=0
    )
    assert re.fullmatch(r"lunar-lander---[0-9a-f]{6}", words)
    assert found.folder == RUNS / found.id
    assert (found.kind, found.settings, found.max_qpu_seconds) == ("run", SETTINGS, 12.5)
    assert found.created == journal.created >= before
    assert found.result is None
    assert found.submissions() == found.charges() == []
    assert found.step_count() == 0


def test_a_submission_is_there_from_before_it_is_sent_until_its_counts() -> None:
    journal, ones = new(), np.array([[3, 5], [0, 8]])
    made = journal.intend(4, "digest", 800)
    seen = again(journal).latest(4)
    assert seen == made
    assert seen is not None
    assert (seen.number, seen.attempt, seen.digest, seen.executions) == (4, 0, "digest", 800)
    assert (seen.state, seen.job_id, seen.usage_s, seen.ones) == ("intended", None, None, None)

    journal.note_sending(made)
    sending = again(journal).latest(4)
    assert sending is not None
    assert sending.created > made.created
    assert sending.state == "intended"

    journal.note_sent(made, "job-a")
    sent = again(journal).latest(4)
    assert sent is not None
    assert (sent.state, sent.job_id) == ("sent", "job-a")

    journal.note_done(made, ones, 2.25)
    done = again(journal).latest(4)
    assert done is not None
    assert (done.state, done.job_id, done.usage_s) == ("done", "job-a", 2.25)
    np.testing.assert_array_equal(done.ones, ones)
    assert done.ones is not None
    assert done.ones.dtype == np.int64


def test_attempts_count_up_and_every_tag_is_its_own() -> None:
    journal, other = new(), new()
    tags = []
    for number, attempt in [(0, 0), (1, 0), (0, 1), (0, 2), (11, 0), (1, 1)]:
        made = journal.intend(number, "d", 1)
        assert (made.number, made.attempt) == (number, attempt)
        journal.note_failed(made, "it rained", 0.5)
        tags.append(made.tag)
    tags.append(other.intend(0, "d", 1).tag)
    assert len(set(tags)) == len(tags) == 7
    assert all(len(tag) <= 86 for tag in tags)  # the service takes no longer ones
    found = again(journal).submissions()
    order = [(made.number, made.attempt) for made in found]
    assert order == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (11, 0)]
    assert {(s.state, s.words, s.usage_s) for s in found} == {("failed", "it rained", 0.5)}


def test_what_every_attempt_costs() -> None:
    journal = new()
    journal.note_failed(journal.intend(0, "d", 10), "no", 1.5)
    journal.note_done(journal.intend(0, "d", 10), np.zeros((1, 1), np.int64), None)
    journal.note_sent(journal.intend(1, "e", 20), "job-b")
    journal.intend(2, "f", 30)
    assert again(journal).charges() == [
        Charge(10, 1.5, "failed"),
        Charge(10, None, "done"),
        Charge(20, None, "sent"),
        Charge(30, None, "intended"),
    ]


def test_steps_come_back_as_they_were() -> None:
    journal = new()
    seen = np.array([[1 / 3, np.nan, -np.inf], [0.1, -0.0, 1e-300]])
    assert journal.step(0) is None
    journal.note_actions(0, seen, np.array([2, 0], dtype=np.intp))
    half = again(journal).step(0)
    assert half is not None
    assert half.rewards is None
    np.testing.assert_array_equal(half.observations, seen)
    assert half.observations.dtype == np.float64
    assert np.signbit(half.observations[1, 1])
    assert half.actions.tolist() == [2, 0]
    journal.note_rewards(0, [0.1, float("nan")])
    whole = again(journal).step(0)
    assert whole is not None
    assert whole.rewards is not None
    np.testing.assert_array_equal(whole.rewards, [0.1, np.nan])
    assert again(journal).step_count() == 1
    assert again(journal).step(1) is None


def test_float32_observations_stay_float32() -> None:
    journal = new()
    journal.note_actions(0, np.array([[0.1]], np.float32), np.array([1]))  # type: ignore[arg-type]
    step = again(journal).step(0)
    assert step is not None
    assert step.observations.dtype == np.float32
    assert step.observations[0, 0] == np.float32(0.1)


def test_another_limit_and_the_result_are_kept() -> None:
    journal = new()
    journal.allow(99.0)
    journal.finish({"mean": 1.5, "none": None})
    assert again(journal).max_qpu_seconds == 99.0
    assert again(journal).result == {"mean": 1.5, "none": None}


def three() -> list[str]:
    """The ids of three runs, the oldest first."""
    ids = ["20260101-000000-cart-aaaaaa", "20260102-000000-cart-bbbbbb", "20260103-000000-x-cccccc"]
    for wanted in ids:
        made = new()
        made.close()
        made.folder.rename(RUNS / wanted)
    return ids


def test_runs_are_listed_by_age() -> None:
    ids = three()
    (RUNS / "notes").mkdir()
    assert [journal.folder.name for journal in journals(RUNS)] == ids
    assert journals(Path("nowhere")) == []


def test_the_newest_of_runs_of_one_second_is_the_last() -> None:
    """Whatever their names and their chance letters."""
    made = [new(name).id for name in ("x", "cart", "z", "a", "m")]
    assert find_journal(RUNS, "last").id == made[-1]
    assert [journal.id for journal in journals(RUNS)] == made


@pytest.mark.parametrize(
    ("said", "meant"), [("aaaaaa", 0), ("0102", 1), ("last", 2), ("-x-", 2), ("20260102", 1)]
)
def test_a_part_of_its_name_finds_a_run(said: str, meant: int) -> None:
    ids = three()
    assert find_journal(RUNS, said).folder.name == ids[meant]
    assert find_journal(RUNS, ids[meant]).folder.name == ids[meant]


def test_a_part_of_several_names_is_not_enough() -> None:
    ids = three()
    with pytest.raises(LiveError) as caught:
        find_journal(RUNS, "cart")
    assert str(caught.value) == (
        f"2 runs are meant by 'cart': {ids[0]}, {ids[1]}.\n  Say more of it."
    )


@pytest.mark.parametrize("said", ["dddddd", "", "../runs"])
def test_an_unknown_run_is_answered_with_the_known_ones(said: str) -> None:
    ids = three()
    with pytest.raises(LiveError) as caught:
        find_journal(RUNS, said)
    assert str(caught.value) == (
        f"There is no run {said!r} in runs.\n  It holds 3: {', '.join(ids)}.\n"
        "  `qcompile runs` lists them; --runs names another folder."
    )


@pytest.mark.parametrize("said", ["last", "aaaaaa"])
def test_a_folder_without_runs_says_so(said: str) -> None:
    with pytest.raises(LiveError, match=r"There is no run .* in runs\.\n  It holds none\."):
        find_journal(RUNS, said)
