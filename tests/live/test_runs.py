"""The runs of a folder: found by part of their names, listed by age, damaged ones reported."""

from __future__ import annotations

from pathlib import Path

import pytest

from qcompile.errors import LiveError
from qcompile.live.journal import Journal
from qcompile.live.journal_file import FILE
from qcompile.live.runs import find_journal, journals

RUNS = Path("runs")


def new(name: str = "cart") -> Journal:
    return Journal.create(RUNS, "run", name, {}, {}, 12.5)


def three() -> list[str]:
    """The ids of three runs, the oldest first."""
    ids = ["260101-000000-cart-aaaa", "260102-000000-cart-bbbb", "260103-000000-x-cccc"]
    for wanted in ids:
        with new() as made:
            made.folder.rename(RUNS / wanted)
    return ids


def test_runs_are_listed_by_age() -> None:
    ids = three()
    (RUNS / "notes").mkdir()
    assert [journal.folder.name for journal in journals(RUNS)] == ids
    assert list(journals(Path("nowhere"))) == []


def test_the_newest_of_runs_of_one_second_is_the_last() -> None:
    """Whatever their names and their chance letters."""
    made = [new(name).id for name in ("x", "cart", "z", "a", "m")]
    assert find_journal(RUNS, "last").id == made[-1]
    assert [journal.id for journal in journals(RUNS)] == made


@pytest.mark.parametrize(
    ("said", "meant"), [("aaaa", 0), ("0102", 1), ("last", 2), ("-x-", 2), ("260102", 1)]
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
        f"'cart' matches 2 runs: {ids[0]}, {ids[1]}.\n  Give more of the ID."
    )


@pytest.mark.parametrize("said", ["dddd", "", "../runs"])
def test_an_unknown_run_is_answered_with_the_known_ones(said: str) -> None:
    ids = three()
    with pytest.raises(LiveError) as caught:
        find_journal(RUNS, said)
    assert str(caught.value) == (
        f"There is no run {said!r} in runs.\n  It holds 3: {', '.join(ids)}.\n"
        "  `qcompile runs` lists them; --runs names another folder."
    )


@pytest.mark.parametrize("said", ["last", "aaaa"])
def test_a_folder_without_runs_says_so(said: str) -> None:
    with pytest.raises(LiveError, match=r"There is no run .* in runs\.\n  It holds no runs\."):
        find_journal(RUNS, said)


def test_a_run_is_open_until_the_next_is_asked_for() -> None:
    three()
    first, *others = journals(RUNS)
    assert len(others) == 2
    with pytest.raises(LiveError):
        first.submissions()
    for journal in journals(RUNS):
        assert journal.submissions() == []


def test_a_damaged_run_is_told_and_hides_no_other() -> None:
    ids = three()
    (RUNS / ids[2] / FILE).write_bytes(b"not a database, but long enough to be one" * 100)
    told: list[str] = []
    assert [journal.folder.name for journal in journals(RUNS, told.append)] == ids[:2]
    [words] = told
    assert words.startswith(f"runs/{ids[2]}/journal.sqlite cannot be read: ")
    with pytest.raises(LiveError, match="The last run is not known"):
        find_journal(RUNS, "last")
    assert find_journal(RUNS, ids[0]).folder.name == ids[0]
    with pytest.raises(LiveError, match="cannot be read"):
        find_journal(RUNS, ids[2])
