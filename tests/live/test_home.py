"""Runs that are resumed elsewhere: copies, moved folders, journals from other people."""

from __future__ import annotations

import io
import json
import platform
import shutil
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from live_runs import Runs, check_paid_once, played
from standin import Fault

from qcompile.calibration import Calibration, load_calibration
from qcompile.errors import LiveError
from qcompile.live.journal import Journal
from qcompile.live.perform import complete
from qcompile.live.runs import find_journal

RUNS = Path("runs")
IN_FOLDER = "was last resumed in another folder: another copy of it may exist.\n"
ON_MACHINE = "was last resumed on another machine: another copy of it may exist.\n"
NOBODY = "Error: The question was not answered. Nothing was sent.\n  In a script, add --yes"


@pytest.fixture
def stopped(runs: Runs) -> Runs:
    """A run of three jobs, stopped after the first: somebody cancelled the second."""
    runs.service.faults.once(Fault.JOB_CANCELLED)
    assert runs.run().code == 1
    return runs


@pytest.fixture(autouse=True)
def _nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody is there to answer."""
    monkeypatch.setattr("sys.stdin", io.StringIO(""))


def move_away(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on this is another machine."""
    monkeypatch.setattr(platform, "node", lambda: "another-machine")


def sent(runs: Runs) -> int:
    return len(runs.service.ledger().jobs)


def test_a_copy_in_another_folder_asks_before_it_sends(
    stopped: Runs, undisturbed: dict[str, Any]
) -> None:
    shutil.copytree(RUNS, "copy")
    before = sent(stopped)
    asked = stopped.call("resume", "last", "--runs", "copy")
    assert asked.code == 1
    assert IN_FOLDER in asked.err
    assert "It would run on fake_lima with the default account, instance crn:v1:" in asked.err
    assert "with a limit of 60 QPU seconds, of which up to 0.0 are used.\n" in asked.err
    assert f"{NOBODY}.\n" in asked.err
    assert sent(stopped) == before
    found = stopped.call("resume", "last", "--runs", "copy", "--yes", "--json")
    assert played(found.json()) == undisturbed
    check_paid_once(stopped.service, 3)


def test_a_moved_folder_is_confirmed_once(
    stopped: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    RUNS.rename("moved")
    stopped.service.faults.once(Fault.JOB_CANCELLED)
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    answer = stopped.call("resume", "last", "--runs", "moved")
    assert "Resume it here? [y/N]" in answer.err
    assert answer.code == 1
    assert "was cancelled" in answer.err
    answer = stopped.call("resume", "last", "--runs", "moved", "--json")
    assert played(answer.json()) == undisturbed


def test_where_it_stopped_it_is_resumed_unasked_by_whatever_path(
    stopped: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = RUNS.resolve()
    Path("below").mkdir()
    monkeypatch.chdir("below")
    answer = stopped.call("resume", "last", "--runs", path, "--json")
    assert played(answer.json()) == undisturbed


def test_on_another_machine_a_script_says_the_limit_itself(
    stopped: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    move_away(monkeypatch)
    before = sent(stopped)
    asked = stopped.call("resume", "last")
    assert ON_MACHINE in asked.err
    assert f"{NOBODY} and --max-qpu-seconds S.\n" in asked.err
    short = stopped.call("resume", "last", "--yes")
    assert short.code == 1
    assert (
        "Error: The run's limit of 60 QPU seconds was set on another machine. Nothing was sent.\n"
        in short.err
    )
    assert sent(stopped) == before
    found = stopped.call("resume", "last", "--yes", "--max-qpu-seconds", 30, "--json")
    assert played(found.json()) == undisturbed
    assert found.json()["max_qpu_seconds"] == 30


def test_a_journal_that_does_not_say_where_it_was_is_asked_about(stopped: Runs) -> None:
    """Without a home, as in journals of the first version."""
    with find_journal(RUNS, "last") as journal:
        pass
    with sqlite3.connect(journal.path) as db:
        db.execute("DROP TABLE home")
    db.close()
    before = sent(stopped)
    asked = stopped.call("resume", "last")
    assert asked.code == 1
    assert f"The journal of run {journal.id} does not say where it was last resumed.\n" in asked.err
    assert sent(stopped) == before
    assert stopped.call("resume", "last", "--yes", "--max-qpu-seconds", 60).code == 0


def test_a_copy_of_one_that_is_going_on_says_by_which_process(stopped: Runs) -> None:
    with find_journal(RUNS, "last") as journal, journal.locked():
        shutil.copytree(RUNS, "copy")
    answer = stopped.call("resume", "last", "--runs", "copy")
    last = journal_home("copy")
    assert last.process is not None
    assert (
        "was last resumed in another folder and may still be running there, as process "
        f"{last.process}.\n"
    ) in answer.err
    assert journal_home("runs").process is None


def journal_home(runs: str) -> Any:
    with find_journal(Path(runs), "last") as journal:
        return journal.home("last")


def test_python_is_asked_as_well(stopped: Runs) -> None:
    shutil.copytree(RUNS, "copy")
    with find_journal(Path("copy"), "last") as journal:
        with pytest.raises(LiveError, match="was last resumed in another folder") as caught:
            complete(journal)
        command = f"`qcompile resume {journal.id} --runs copy` asks whether to resume it here."
        assert command in str(caught.value)
        journal.move_here()
        assert complete(journal)["env_steps"] == 6
    assert stopped.service.ledger().charged_seconds > 0


def test_a_journal_names_neither_the_machine_nor_the_folder(stopped: Runs) -> None:
    assert stopped.call("resume", "last").code == 0
    contents = b"".join(path.read_bytes() for path in RUNS.rglob("*") if path.is_file())
    assert b"qcompile-journal-3" in contents
    for name in (platform.node(), str(RUNS.resolve()), str(Path.cwd())):
        assert name.encode() not in contents


def test_two_runs_of_a_folder_have_other_digests(stopped: Runs) -> None:
    """Several journals do not reveal which of them came from one place."""
    first = journal_home("runs")
    stopped.service.faults.once(Fault.JOB_CANCELLED)
    assert stopped.run().code == 1
    second = journal_home("runs")
    assert not {first.machine, first.folder} & {second.machine, second.folder}


# Journals of somebody else


def calibrated(runs: Runs, *words: object) -> Journal:
    """A finished calibration in machine.json."""
    answer = runs.call(
        *("calibrate", "--backend", "fake_lima", "--shots", 200, "--out", "machine.json"),
        *("--live", "--max-qpu-seconds", 100, "--yes", *words),
    )
    assert answer.code == 0, answer.err
    with find_journal(RUNS, "last") as journal:
        return journal


def set_out(journal: Journal, out: str) -> None:
    with sqlite3.connect(journal.path) as db:
        settings = json.dumps(journal.settings | {"out": out, "force": True})
        db.execute("UPDATE run SET settings = ?", (settings,))
    db.close()


def test_a_journal_of_another_machine_writes_no_file_of_its_own_choice(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = calibrated(runs, "--force")
    victim = Path("victim").resolve()
    victim.write_text("mine")
    set_out(journal, str(victim))
    move_away(monkeypatch)
    answer = runs.call("resume", "last", "--json")
    assert answer.code == 0, answer.err
    assert answer.json()["file"] is None
    words = "The calibration is only in the journal. `qcompile resume last --out FILE` writes it"
    assert words in answer.err
    assert victim.read_text() == "mine"
    answer = runs.call("resume", "last", "--out", "victim", "--json")
    assert victim.read_text() == "mine"  # the journal's --force is not this command line's
    other = answer.json()["file"]
    assert other == f"victim-{journal.id}"
    assert isinstance(load_calibration(Path(other)), Calibration)


def test_the_own_file_is_written_again_with_the_force_it_was_begun_with(runs: Runs) -> None:
    calibrated(runs, "--force")
    whole = Path("machine.json").read_bytes()
    Path("machine.json").write_text("something else")
    file = runs.call("resume", "last", "--json").json()["file"]
    assert Path(file) == Path("machine.json").resolve()
    assert Path("machine.json").read_bytes() == whole


def test_what_somebody_else_wrote_is_shown_plain(
    stopped: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    move_away(monkeypatch)
    with find_journal(RUNS, "last") as journal:
        pass
    hostile = "fake_lima\x1b[2J\x1b]0;owned\x07\u202e\n\nspent: 0"
    values = journal.settings | {"backend": hostile, "account": hostile, "instance": hostile}
    with sqlite3.connect(journal.path) as db:
        db.execute("UPDATE run SET settings = ?", (json.dumps(values),))
    db.close()
    for words in (("runs",), ("runs", "show", "last"), ("resume", "last")):
        answer = stopped.call(*words)
        shown = answer.out + answer.err
        assert "fake_lima" in shown
        assert "spent: 0" in shown  # in the same line, or in a cell of the table
        assert not set("\x1b\x07\u202e") & set(shown)
        assert "\nspent" not in shown
    assert stopped.call("runs", "show", "last", "--json").json()["backend"] == hostile
