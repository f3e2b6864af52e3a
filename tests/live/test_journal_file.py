"""Damaged and malicious journals: each is explained, with the file's name."""

from __future__ import annotations

import os
import random
import shutil
import sqlite3
import stat
import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qcompile.errors import LiveError
from qcompile.live.journal import Journal
from qcompile.live.journal_file import FILE, NeverBegunError
from qcompile.live.perform import finished
from qcompile.live.records import Register, to_array, to_bytes
from qcompile.live.runs import find_journal, journals
from qcompile.report.live import exported, overview

RUNS = Path("runs")
BITS = Register(0, "c", (1, 100), 12)


def new() -> Journal:
    """A closed journal with something in every table."""
    with Journal.create(RUNS, "run", "cart", {"backend": "b"}, {"numpy": "2"}, 60.0) as journal:
        for number in range(3):
            sent = journal.note_sending(journal.intend(number, "d" * 64, 100, [BITS]), 17)
            journal.note_sent(sent, f"job-{number}")
            journal.note_done(sent, [replace(BITS, packed=bytes(200))])
            charge = journal.charges.of_job(f"job-{number}")
            assert charge is not None
            journal.charges.settle(charge, 2.25)
            journal.steps.note_actions(number, np.zeros((2, 4)), np.array([1, 0]))
            journal.steps.note_rewards(number, [1.0, 1.0])
        journal.note_sending(sent, 17)  # in doubt
        journal.note_done(sent, [replace(BITS, packed=bytes(200))])
        journal.note_failed(journal.intend(3, "e", 1), "it rained")
    return journal


def change(journal: Journal, statement: str, *values: object) -> None:
    with sqlite3.connect(journal.path) as db:
        db.execute(statement, values)
    db.close()


def read_all(folder: Path) -> None:
    with Journal(folder) as journal:
        overview(journal)
        exported(journal)


@pytest.mark.parametrize("seed", range(4))
def test_bits_that_flip_are_read_or_explained(seed: int) -> None:
    """A hundred journals per seed, each with one to eight flipped bits in used bytes."""
    rng = random.Random(seed)
    journal = new()
    contents = journal.path.read_bytes()
    places = [index for index, byte in enumerate(contents) if byte]
    told = []
    for _ in range(100):
        hit = bytearray(contents)
        for _ in range(rng.choice([1, 2, 8])):
            hit[rng.choice(places)] ^= 1 << rng.randrange(8)
        journal.path.write_bytes(hit)
        try:
            read_all(journal.folder)
        except LiveError as error:
            told.append(str(error))
    assert 10 < len(told) < 100
    assert all(str(journal.path) in words and len(words) < 400 for words in told)


WRONG: list[tuple[str, str, object]] = [
    *[("run", "id", value) for value in (None, "", b"x", "a b", "x\x1b[31m", "x\n", "x" * 200)],
    *[("run", "kind", value) for value in (None, "other", b"run")],
    *[("run", "created", value) for value in (None, "soon", 3, "2026-01-01")],
    *[("run", "settings", value) for value in (None, "[]", "{", "[" * 5000, b"{}")],
    *[("run", "versions", value) for value in (None, "3", "9" * 5000, '{"numpy": [2]}')],
    *[("run", "max_qpu_seconds", value) for value in (None, "x", -1.0, b"1")],
    *[("run", "result", value) for value in ("{", "[1]", "[" * 5000)],
    *[("submission", "state", value) for value in (None, "paid", 3)],
    *[("charge", "charged_s", value) for value in ("x", b"1", 1e300, float("inf"), -1.0)],
    *[("charge", "sent_at", value) for value in (None, "soon", b"x")],
    *[("submission", "executions", value) for value in (None, "x", -1, 0.5)],
    *[("submission", "sent_at", value) for value in ("soon", 3, b"x")],
    *[("submission", "ones", value) for value in ("text", b"", b"\x93NUMPY\x01\x00")],
    *[("measured", "packed", value) for value in ("text", 3, b"", bytes(199))],
    *[("measured", "shape", value) for value in (None, "", "[]", "3", "[-1]", "[0.5]", "[" * 5000)],
    *[("measured", "shape", value) for value in ("[true]", "[99999999999999]", "[1e400]", b"[2]")],
    *[("measured", "width", value) for value in (None, "x", -1, 0.5, 2**62)],
    *[("measured", "pub", value) for value in (None, "x", -1)],
    *[("measured", "name", value) for value in (None, b"c")],
    ("submission", "job_id", b"x"),
    ("submission", "tag", None),
    ("submission", "cap_s", "x"),
    ("charge", "cap_s", None),
    ("charge", "executions", "x"),
    ("step", "observations", None),
    ("step", "actions", 3),
    ("step", "rewards", b"PK\x03\x04"),
]


@pytest.mark.parametrize(("table", "column", "value"), WRONG)
def test_a_wrong_value_is_explained(table: str, column: str, value: object) -> None:
    journal = new()
    change(journal, f"UPDATE {table} SET {column} = ?", value)
    with pytest.raises(LiveError) as caught:
        read_all(journal.folder)
    assert str(journal.path) in str(caught.value)
    assert len(str(caught.value)) < 400


def test_text_that_is_no_utf_8_is_read_all_the_same() -> None:
    """One letter of a reason is not worth a paid run."""
    journal = new()
    change(journal, "UPDATE submission SET words = CAST(x'6974ff' AS TEXT) WHERE number = 3")
    with Journal(journal.folder) as opened:
        assert exported(opened)["jobs"][3]["words"] == "it\ufffd"


def test_an_infinite_limit_of_the_first_version_is_the_largest_there_is() -> None:
    journal = new()
    change(journal, "UPDATE run SET max_qpu_seconds = ?", float("inf"))
    with Journal(journal.folder) as opened:
        assert opened.max_qpu_seconds == 1e6


@pytest.mark.parametrize(
    "statement",
    [
        "CREATE TRIGGER more AFTER UPDATE ON submission BEGIN "
        "UPDATE run SET max_qpu_seconds = 1e5; END",
        "CREATE VIEW v AS SELECT 1",
        "CREATE VIRTUAL TABLE v USING fts5(x)",
        "ALTER TABLE submission ADD COLUMN more AS (executions + 1)",
    ],
)
def test_a_journal_that_would_do_something_by_itself_is_refused(statement: str) -> None:
    """A trigger might raise the limit once it is confirmed."""
    journal = new()
    change(journal, statement)
    with pytest.raises(LiveError, match=f"{journal.path} is not a journal of qcompile"):
        Journal(journal.folder)


def test_a_row_that_damage_hides_is_missed_before_anything_is_sent() -> None:
    """Its index has the row. Without it the job would be sent and paid for again."""
    journal = new()
    with sqlite3.connect(journal.path) as db:
        [[root]] = db.execute("SELECT rootpage FROM sqlite_master WHERE name = 'submission'")
        [[size]] = db.execute("PRAGMA page_size")
    db.close()
    contents = bytearray(journal.path.read_bytes())
    page = (root - 1) * size
    assert contents[page] == 13  # a leaf: its rows are counted in bytes 3 and 4
    assert int.from_bytes(contents[page + 3 : page + 5], "big") == 4
    contents[page + 4] = 3
    journal.path.write_bytes(contents)
    with Journal(journal.folder) as opened:
        assert len(opened.steps) == 3
        with pytest.raises(LiveError, match=f"{journal.path} is damaged: "), opened.locked():
            pass


@pytest.mark.parametrize("shape", ["(1099511627776,)", "(250000000,)", "(-1,)", "(2, 3)", "()"])
@pytest.mark.parametrize("dtype", ["<f8", "|O", "<U8", "<c16"])
def test_an_array_is_as_large_as_its_bytes(shape: str, dtype: str) -> None:
    """Whatever its header says, two gigabytes are never allocated."""
    header = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}"
    contents = b"\x93NUMPY\x01\x00v\x00" + header.encode().ljust(117) + b"\n" + b"x" * 12
    with pytest.raises(LiveError):
        to_array(b"")  # what is loaded for messages is there from now on
    tracemalloc.start()
    with pytest.raises(LiveError, match="An array in the journal is damaged"):
        to_array(contents)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1_000_000


@pytest.mark.parametrize(
    "array",
    [
        np.arange(6).reshape(2, 3),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.zeros((0, 4), np.float32),
        np.array(3.5),
        np.array([True, False]),
    ],
)
def test_an_array_comes_back_as_it_was(array: np.ndarray[Any, Any]) -> None:
    found = to_array(to_bytes(array))
    np.testing.assert_array_equal(found, array)
    assert (found.dtype, found.shape) == (array.dtype, array.shape)


@pytest.mark.parametrize(
    "result", [{}, {"passed": True}, {"calibration": {}}, {"qubits": [1], "degrees": []}]
)
@pytest.mark.parametrize("kind", ["run", "calibrate", "validate", "sampler"])
def test_a_result_of_another_shape_is_explained(kind: Any, result: dict[str, Any]) -> None:
    with Journal.create(RUNS, kind, "cart", {}, {}, 60.0) as journal:
        journal.finish(result)
        with pytest.raises(LiveError) as caught:
            finished(journal)
    assert str(caught.value).startswith(f"{journal.path} is damaged: its result is not valid.\n")
    assert f"`qcompile runs export {journal.id}` saves the measurements." in str(caught.value)


# Made whole, and one at a time


def test_a_journal_whose_making_is_stopped_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    kept = new()
    with monkeypatch.context() as patch:
        patch.setattr("qcompile.live.home.note", stop)
        with pytest.raises(KeyboardInterrupt):
            new()
    assert list(RUNS.iterdir()) == [kept.folder]


def test_the_name_of_a_new_run_is_on_the_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise a power cut may lose the folder with everything committed in it."""
    real, synced = os.fsync, []

    def fsync(handle: int) -> None:
        folder = RUNS.stat()
        synced.append(os.path.samestat(os.fstat(handle), folder) and list(RUNS.iterdir()))
        real(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    assert [new().folder] in synced


def test_what_was_never_begun_is_passed_over() -> None:
    """Left by a kill: by this version under another name, by the first one without tables."""
    kept = new()
    for name in (".260101-000000-cart-aaaa.x1", "260102-000000-cart-bbbb"):
        (RUNS / name).mkdir()
        sqlite3.connect(RUNS / name / FILE).execute("PRAGMA journal_mode = WAL").close()
    (RUNS / "260103-000000-cart-cccc").mkdir()
    (RUNS / "260103-000000-cart-cccc" / FILE).touch()
    told: list[str] = []
    assert [journal.id for journal in journals(RUNS, told.append)] == [kept.id]
    assert told == []
    with find_journal(RUNS, "last") as found:
        assert found.id == kept.id
    for name in ("bbbb", "cccc"):
        with pytest.raises(NeverBegunError, match=f"{name}/{FILE} is empty: the run was stopped"):
            find_journal(RUNS, name)


def test_no_more_than_one_journal_is_open_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each takes up to three of the files that a process may have open."""
    resource = pytest.importorskip("resource")
    for _ in range(30):
        new()
    before, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    now = len(list(Path("/proc/self/fd").iterdir()))
    resource.setrlimit(resource.RLIMIT_NOFILE, (now + 12, hard))
    try:
        assert len([overview(journal) for journal in journals(RUNS)]) == 30
        find_journal(RUNS, "last").__exit__()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (before, hard))


def test_nobody_else_can_read_a_run() -> None:
    journal = new()
    for path in (RUNS, journal.folder):
        assert stat.S_IMODE(path.stat().st_mode) == 0o700
    shutil.rmtree(RUNS)
    RUNS.mkdir(mode=0o755)  # the user's own choice stays
    assert stat.S_IMODE(new().folder.stat().st_mode) == 0o700
    assert stat.S_IMODE(RUNS.stat().st_mode) == 0o755


def test_the_list_reads_no_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor steps: a run of a hundred thousand jobs has hundreds of megabytes of them."""

    def read(*contents: Any) -> Any:
        raise AssertionError("an array was read")

    new()
    monkeypatch.setattr("qcompile.live.records.to_array", read)
    monkeypatch.setattr("qcompile.live.records.Register.of_row", read)
    [row] = [overview(journal) for journal in journals(RUNS)]
    assert (row["jobs_done"], row["jobs_open"], row["steps"]) == (3, 0, 3)
    with find_journal(RUNS, "last") as run, pytest.raises(AssertionError, match="was read"):
        exported(run)
