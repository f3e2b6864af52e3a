"""A stand-in for IBM's service, and the runs against it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from live_runs import LIMIT_S, Runs, played
from standin import StandIn

from qcompile.execution import PrimitiveExecutor
from qcompile.live.connection import Connection
from qcompile.live.jobs import Jobs
from qcompile.live.jobs_sampler import JobsSampler
from qcompile.live.journal import Journal
from qcompile.live.perform import begin, complete
from qcompile.live.play import RunTask
from qcompile.policy import load_policy
from qcompile.policy.files import policy_values


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Every test works in an empty folder, knows no saved account, and waits for little."""
    for name in ("home", "work"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(
        "qiskit_ibm_runtime.accounts.management._DEFAULT_ACCOUNT_CONFIG_JSON_FILE",
        str(tmp_path / "home" / "qiskit-ibm.json"),
    )
    # With each request the client looks for its caller in the whole stack: deep in tests.
    monkeypatch.setenv("USAGE_DATA_OPT_OUT", "True")
    monkeypatch.setattr("qcompile.live.sender.SETTLE_S", 0.05)
    monkeypatch.setattr("qcompile.live.client_errors.PATIENCE_S", 2.0)
    return tmp_path / "work"


@pytest.fixture
def service(monkeypatch: pytest.MonkeyPatch) -> Iterator[StandIn]:
    """A stand-in that this process's client uses; when busy, it asks to be called again at once."""
    with StandIn() as standin:
        for name, value in standin.environment().items():
            monkeypatch.setenv(name, value)
        standin.faults.retry_after_seconds = 0
        yield standin


@pytest.fixture
def runs(qcompile: Callable[..., Any], service: StandIn) -> Runs:
    return Runs(qcompile, service)


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    """The result of the small run when nothing goes wrong."""
    with pytest.MonkeyPatch.context() as patch, StandIn() as standin:
        for name, value in standin.environment().items():
            patch.setenv(name, value)
        patch.setenv("HOME", str(tmp_path_factory.mktemp("home")))
        task = RunTask.model_validate(
            {
                "backend": "fake_lima",
                "device": Connection("fake_lima").device(),
                "policy": policy_values(load_policy("cartpole")),
                "shots": 256,
                "episodes": 2,
                "seed": 0,
                "level": 2,
                "mitigation": "none",
                "max_steps": 3,
            }
        )
        yield played(complete(begin(tmp_path_factory.mktemp("runs"), task, LIMIT_S)))


@pytest.fixture
def executor_on(service: StandIn) -> Callable[..., PrimitiveExecutor]:
    """An executor of a backend, with its own journal."""

    def make(backend: str, limit_s: float = 600.0, **settings: Any) -> PrimitiveExecutor:
        connection = Connection(backend)
        journal = Journal.create(Path("runs"), "run", backend, {}, {}, limit_s)
        sampler = JobsSampler(Jobs(journal, connection, **settings))
        return PrimitiveExecutor(connection.device(), sampler=sampler, kind="hardware")

    return make
