"""Live runs: what is refused before anything is sent, and what a stand-in of IBM's service says."""

from __future__ import annotations

import platform
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from standin import Fault, StandIn

from qcompile.live.records import to_bytes

from .case import Change, Command, Document
from .inputs import calibration, policy, setting, write

ON_LIMA = "run tiny.json --backend fake_lima"
LIVE = f"{ON_LIMA} --shots 256 --episodes 2 --max-steps 3 --mitigation none --live"
YES = f"{LIVE} --yes --max-qpu-seconds"
CALIBRATE = "calibrate --backend fake_lima --shots 200 --qubits 0,1 --live --yes"
VALIDATE = "validate lima.json --policy tiny.json --observations 2 --shots 100 --live --yes"
LIMIT = "--max-qpu-seconds 60"

SOMEBODY = setting("qcompile.cli.live_options.is_interactive", lambda: True)
NO_PAUSE = setting("urllib3.util.retry.Retry.get_backoff_time", lambda retry: 0.0)
NOWHERE = "QISKIT_IBM_URL=http://127.0.0.1:9/experimental IAM_URL=http://127.0.0.1:9"

ACCOUNTS = "qiskit_ibm_runtime.accounts.management._DEFAULT_ACCOUNT_CONFIG_JSON_FILE"
PAUSES_S: dict[str, Any] = {
    "qcompile.live.client_errors.PATIENCE_S": 0.3,
    "qcompile.live.sender.SETTLE_S": 0.02,
    "qcompile.live.jobs._FETCH_PAUSE_S": 0.0,
    "qcompile.live.billing._CHARGE_PAUSES_S": (0.02,),
}
"""How long a run waits for the service."""


def patient(patch: pytest.MonkeyPatch) -> None:
    """A run waits as long as it usually does."""
    patch.setattr("qcompile.live.client_errors.PATIENCE_S", 300.0)
    patch.setattr("qcompile.live.sender.SETTLE_S", 10.0)


USAGE = (
    LIVE,
    "calibrate --backend fake_lima --live",
    "validate lima.json --live",
    *(
        f"{ON_LIMA} {option}"
        for option in (
            *("--max-qpu-seconds 5", "--yes", "--account mine", "--instance mine", "--batch"),
            *("--max-wait-seconds 5", "--live --max-qpu-seconds 0", "--live --max-qpu-seconds nan"),
            *("--live --max-qpu-seconds 1e7", f"--live {LIMIT} --max-wait-seconds 0"),
            *(f"--live {LIMIT} --shots exact", f"--live {LIMIT} --video a.gif"),
            *(f"--live {LIMIT} --runs tiny.json",),
        )
    ),
    f"calibrate --backend fake_lima --live {LIMIT} --shots exact",
    f"calibrate --backend fake_lima --live {LIMIT} --seed 3",
    f"validate lima.json --live {LIMIT} --backend fake_lima",
    f"calibrate --backend '' --live {LIMIT}",
    *(
        Command(f"QCOMPILE_PATIENCE_SECONDS={seconds} {LIVE} {LIMIT}", change=patient)
        for seconds in ("soon", "''", "-1", "inf")
    ),
    Command(f"QCOMPILE_SETTLE_SECONDS=soon {YES} 60", change=patient),
    Command(
        f"{YES} 60",
        "without qiskit-ibm-runtime",
        setting("qcompile.live.connection.find_spec", lambda package: None),
    ),
    f"QCOMPILE_DOUBT_SECONDS=soon {YES} 60",
)


def files() -> None:
    write(
        {
            "tiny.json": policy(),
            "lima.json": calibration(shots=8192),
            "belem.json": calibration(on="fake_belem"),
            "file": "",
            "there.json": "",
        }
    )


def no_account(patch: pytest.MonkeyPatch) -> None:
    for name in ("QISKIT_IBM_TOKEN", "QISKIT_IBM_INSTANCE", "QISKIT_IBM_URL"):
        patch.delenv(name)


def elsewhere(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(platform, "node", lambda: "another-machine")


def other_account(patch: pytest.MonkeyPatch) -> None:
    """One is saved, by another name."""
    account = {"channel": "ibm_quantum_platform", "token": "secret", "url": "https://nowhere"}
    write({"others.json": {"mine": account}})
    patch.setattr(ACCOUNTS, "others.json")
    no_account(patch)


def change_journal(column: str, value: Callable[[object], object]) -> Change:
    """The newest run is not finished, and a value in its journal is another."""
    table, name = column.split(".")

    def change(patch: pytest.MonkeyPatch) -> None:
        path = max(Path("runs").glob("*/journal.sqlite"), key=lambda path: path.stat().st_mtime_ns)
        with sqlite3.connect(path) as db:
            [[before], *_] = db.execute(f"SELECT {name} FROM {table}").fetchall()
            db.execute(f"UPDATE {table} SET {name} = ?", (value(before),))
            db.execute("UPDATE run SET result = NULL")
        db.close()

    return change


DOCUMENTS = (
    Document(f"{YES} 60 --json"),
    Document("resume last --json"),
    Document(f"{CALIBRATE} --out d.json {LIMIT} --json"),
    Document("resume last --json"),
    Document(f"{VALIDATE} {LIMIT} --json"),
    Document("runs show last --json"),
    Document("plan tiny.json --backend fake_lima --live --shots 100 --max-steps 1 --json"),
)
"""The service is to have recovered before."""


def cases(service: StandIn) -> list[Command]:
    """Those that need the service, which has recovered before each of them."""
    faults, settings = service.faults, service.settings

    def said(
        line: str, note: str = "", trouble: Change = lambda patch: None, **more: Any
    ) -> Command:
        def change(patch: pytest.MonkeyPatch) -> None:
            service.recover()
            faults.retry_after_seconds = 0
            trouble(patch)

        return Command(line, note, change, **more)

    def set_to(name: str, value: float) -> Change:
        return lambda patch: setattr(settings, name, value)

    def always(fault: Fault, **more: int) -> Change:
        return lambda patch: faults.chance(fault, 1.0, **more)

    def counts(_: object) -> bytes:
        return bytes(511)

    def actions(_: object) -> bytes:
        return to_bytes(np.array([5, 5]))

    def rewards(_: object) -> bytes:
        return to_bytes(np.array([3.0, 3.0]))

    def theta(before: object) -> str:
        return str(before).replace('"theta": [0.1]', '"theta": [0.2]')

    return [
        said(f"{YES} 60", "no account is saved", no_account),
        said(f"{YES} 60 --account nosuch", "an account is saved, by another name", other_account),
        said(f"{NOWHERE} {YES} 60", trouble=NO_PAUSE),
        said(f"{YES} 60 --backend nosuch"),
        said("plan tiny.json --backend nosuch --live"),
        said(f"{YES} 60 --instance nosuch"),
        said(f"{YES} 60", "the key is refused", lambda patch: faults.refuse_key()),
        said(f"{YES} 7", "a second less than is needed"),
        said(f"{LIVE} {LIMIT}", "nobody is there"),
        said(f"{LIVE} {LIMIT}", "declined", SOMEBODY, typed="n\n"),
        said(f"{YES} 60", "the plan has 6 s left", set_to("usage_limit_seconds", 6.0)),
        said(f"{YES} 60 --runs file/runs"),
        said(f"validate belem.json --policy tiny.json --observations 1 --live --yes {LIMIT}"),
        said(
            f"{YES} 60",
            "the first job is cancelled",
            lambda patch: faults.once(Fault.JOB_CANCELLED),
        ),
        said("runs show last"),
        said("resume last --max-qpu-seconds 2"),
        said(
            "resume last",
            "other counts are in the journal",
            change_journal("measured.packed", counts),
        ),
        said(f"{YES} 60"),
        said("resume last --out a.json"),
        said(
            "resume last",
            "other actions are in the journal",
            change_journal("step.actions", actions),
        ),
        said(f"{YES} 60"),
        said(
            "resume last",
            "other rewards are in the journal",
            change_journal("step.rewards", rewards),
        ),
        said(
            "resume last", "another policy is in the journal", change_journal("run.settings", theta)
        ),
        said(f"{YES} 60", "jobs fail", always(Fault.JOB_FAILS)),
        said(f"{YES} 60", "jobs fail and are charged", always(Fault.JOB_FAILS_CHARGED)),
        said("resume last"),
        said(f"{YES} 9", "jobs take 1.5 times as long", set_to("usage_factor", 1.5)),
        said(f"{YES} 8", "jobs take 4 times as long", set_to("usage_factor", 4.0)),
        said(f"{YES} 60 --max-wait-seconds 0.01", "jobs wait", set_to("queue_seconds", 3600.0)),
        said(f"{YES} 60", "results are cut", always(Fault.RESULTS_TRUNCATED, fetches=100)),
        said(f"{YES} 60", "no answer to what is sent", always(Fault.ACCEPTED_DROPPED)),
        said(f"{CALIBRATE} --out there.json {LIMIT}"),
        said(f"{CALIBRATE} --out c.json {LIMIT}", masked=True),
        said("resume last", "on another machine", elsewhere, masked=True),
        said(f"{VALIDATE} {LIMIT}", masked=True),
    ]
