"""Engines: the same results from each, workers that are lost, and clusters that are not there."""

from __future__ import annotations

import asyncio
import builtins
import os
import signal
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from joblib.externals.loky import get_reusable_executor

from qcompile.errors import MissingExtraError, StudyError
from qcompile.sweep.engine import run_all
from qcompile.sweep.study.cell import CellResult, run_cell
from qcompile.sweep.study.rows import Cell, Row, cells

Outcome = Callable[[Cell, int], tuple[str, CellResult]]
NAMES = ("cartpole-svqc-paper", "cartpole-fcn-large-paper")


@pytest.fixture(scope="module", autouse=True)
def no_workers_left() -> Iterator[None]:
    """joblib keeps its processes for the next call: end them after the last test."""
    yield
    get_reusable_executor().shutdown(wait=True, kill_workers=True)


@pytest.fixture
def small(short_row: Callable[..., Row]) -> list[Cell]:
    """Two rows of two seeds."""
    return cells([short_row(name) for name in NAMES], 2)


def train(
    cells: list[Cell], on_result: Callable[[CellResult], Any], *, evaluation: int = 1, **how: Any
) -> None:
    """The cells of a study, run as a study runs them."""
    run = partial(run_cell, evaluation=evaluation)
    run_all(cells, run, lambda cell, result: on_result(result), noun="training", **how)


def numbers(result: CellResult) -> dict[str, Any]:
    return result.model_dump(exclude={"wall_seconds"})


def by_name(results: list[CellResult]) -> dict[tuple[str, int], dict[str, Any]]:
    return {(result.row, result.seed): numbers(result) for result in results}


def check_run(small: list[Cell], **options: Any) -> None:
    """Run it, and compare each result with the same training in this process."""
    results: list[CellResult] = []
    train(small, results.append, evaluation=2, on_loss=pytest.fail, **options)
    assert len(results) == 4
    assert by_name(results) == by_name([run_cell(cell, 2) for cell in small])


@pytest.mark.parametrize("workers", [1, 2])
def test_processes(small: list[Cell], workers: int) -> None:
    check_run(small, workers=workers)


def test_there_are_no_more_workers_than_cells(
    small: list[Cell], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def outcomes(waiting: list[Cell], run: object, engine: str, jobs: int) -> Iterator[Any]:
        asked.append(jobs)
        yield from ((cell.name, cell.name) for cell in waiting)

    monkeypatch.setattr("qcompile.sweep.engine._outcomes", outcomes)
    train(small, lambda result: None, workers=1_000_000)
    train(small[:1], lambda result: None, workers=1_000_000)
    train(small, lambda result: None, workers=1)
    assert asked == [len(small), 2, 1], "a cell alone still has a process that may be lost"


def test_a_local_dask_cluster(small: list[Cell]) -> None:
    """The port that Dask likes best is taken, as by another cluster on this machine."""
    pytest.importorskip("distributed")
    with ExitStack() as stack:
        with suppress(OSError):  # somebody else has it
            stack.enter_context(socket.create_server(("127.0.0.1", 8787)))
        check_run(small, engine="dask", workers=2)


def test_a_running_dask_scheduler(small: list[Cell]) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=2,
        processes=False,
        protocol="tcp",
        dashboard_address="127.0.0.1:0",
    ) as cluster:
        check_run(small, engine="dask", address=cluster.scheduler_address)
        assert len(cluster.workers) == 1, "the cluster is not ours to end"
        assert cluster.status.name == "running"


def test_a_dask_scheduler_without_workers(small: list[Cell]) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=0, processes=False, protocol="tcp", dashboard_address="127.0.0.1:0"
        ) as cluster,
        pytest.raises(StudyError, match=r"has no workers\.\n  Start some: dask worker"),
    ):
        train(small, pytest.fail, engine="dask", address=cluster.scheduler_address)


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_local_ray(small: list[Cell]) -> None:
    ray = pytest.importorskip("ray")
    check_run(small, engine="ray", workers=2)
    assert not ray.is_initialized()


# Workers that are lost.


def hand_made() -> CellResult:
    return CellResult(
        row="",
        seed=0,
        environment="CartPole-v1",
        settings={},
        versions={},
        parameters=1,
        steps=[1],
        rewards=[1.0],
        evaluation=[1.0],
        wall_seconds=1.0,
    )


def killing(template: CellResult, folder: Path, victim: str, times: int) -> Outcome:
    """A training that notes its start in `folder`; that of `victim` kills its process `times`.

    The victim waits until another cell's result has been handed over, as a file named "handed".
    It is defined in a function so that it travels to the workers by value.
    """

    def outcome(cell: Cell, evaluation: int) -> tuple[str, CellResult]:
        begun = len(list(folder.glob(f"{cell.name}.*")))
        (folder / f"{cell.name}.{begun}").touch()
        if cell.name == victim and begun < times:
            end = time.monotonic() + 60
            while not (folder / "handed").exists() and time.monotonic() < end:
                time.sleep(0.01)
            os.kill(os.getpid(), signal.SIGKILL)
        return cell.name, template.model_copy(update={"row": cell.row.name, "seed": cell.seed})

    return outcome


@pytest.mark.parametrize("engine", ["processes", "dask"])
def test_what_a_lost_worker_had_runs_again(
    small: list[Cell], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, engine: Any
) -> None:
    if engine == "dask":
        pytest.importorskip("distributed")
    outcome = killing(hand_made(), tmp_path, small[0].name, times=1)
    monkeypatch.setattr("qcompile.sweep.engine._outcome", outcome)
    done: list[str] = []
    told: list[str] = []

    def keep(result: CellResult) -> None:
        done.append(f"{result.row}-seed{result.seed}")
        if len(done) == 3:
            (tmp_path / "handed").touch()

    train(small, keep, engine=engine, workers=2, on_loss=told.append)
    assert done[-1] == small[0].name
    assert sorted(done) == sorted(cell.name for cell in small)
    for cell in small:
        begun = len(list(tmp_path.glob(f"{cell.name}.*")))
        assert begun == (2 if cell is small[0] else 1), "what is finished is not run again"
    if engine == "processes":  # Dask starts the worker again by itself
        (words,) = told
        assert words.startswith("Workers stopped (TerminatedWorkerError: ")
        assert words.endswith("; running 1 training again.")


def test_workers_that_are_always_lost(
    small: list[Cell], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "handed").touch()
    outcome = killing(hand_made(), tmp_path, small[0].name, times=99)
    monkeypatch.setattr("qcompile.sweep.engine._outcome", outcome)
    told: list[str] = []
    with pytest.raises(StudyError, match="Workers stopped 3 times without finishing a training"):
        train(small[:1], pytest.fail, workers=2, on_loss=told.append)
    assert len(told) == 2
    assert len(list(tmp_path.glob(f"{small[0].name}.*"))) == 3


def test_a_loss_after_progress_is_a_first_one(
    small: list[Cell], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two losses, a training that gets done, two losses: never three in a row."""
    losses = iter([True, True, False, True, True, False, False, False])

    def outcomes(waiting: list[Cell], *_: Any) -> Iterator[tuple[str, CellResult]]:
        for cell in waiting:
            if next(losses):
                raise OSError("gone\nand more")
            yield cell.name, hand_made()

    monkeypatch.setattr("qcompile.sweep.engine._outcomes", outcomes)
    done: list[CellResult] = []
    told: list[str] = []
    train(small, done.append, on_loss=told.append)
    assert len(done) == 4
    left = (4, 4, 3, 3)
    assert told == [
        f"Workers stopped (OSError: gone); running {n} training{'s' * (n > 1)} again." for n in left
    ]


# What is wrong for good.


@pytest.mark.parametrize("workers", [1, 2])
def test_a_training_that_fails_is_named(short_row: Callable[..., Row], workers: int) -> None:
    bad = short_row(backend="no-such-device", shots=8)
    with pytest.raises(StudyError, match=r"^cartpole-svqc-paper-seed0 failed: Unknown backend "):
        train(cells([bad], 1), pytest.fail, workers=workers)


def test_an_error_of_the_callers_own_is_no_loss(small: list[Cell]) -> None:
    def keep(result: CellResult) -> None:
        raise RuntimeError("a defect of the caller")

    with pytest.raises(RuntimeError, match="a defect of the caller"):
        train(small[:1], keep, workers=1, evaluation=1, on_loss=pytest.fail)


UNREACHABLE = {
    "dask port": ("dask", "tcp://127.0.0.1:1", "There is no Dask scheduler at 'tcp://127.0.0.1:1'"),
    "dask words": ("dask", "nonsense", "There is no Dask scheduler at 'nonsense'"),
    "dask letters": ("dask", "tcp://127.0.0.1:x", "There is no Dask scheduler at"),
    "dask nothing": ("dask", "", "There is no Dask scheduler at ''"),
    "ray port": ("ray", "127.0.0.1:1", "There is no Ray cluster at '127.0.0.1:1'"),
    "ray client": ("ray", "ray://127.0.0.1:1", "There is no Ray cluster at 'ray://127.0.0.1:1'"),
    "ray words": ("ray", "nonsense", "There is no Ray cluster at 'nonsense'"),
    "processes": ("processes", "tcp://127.0.0.1:1", "The engine 'processes' takes no address"),
    "unknown": ("slurm", None, r"Unknown engine 'slurm'\.\n  Known: processes, dask, ray\."),
}


@pytest.mark.parametrize("what", UNREACHABLE)
def test_an_engine_that_is_not_there(small: list[Cell], what: str) -> None:
    engine, address, words = UNREACHABLE[what]
    if engine in ("dask", "ray"):
        pytest.importorskip({"dask": "distributed"}.get(engine, engine))
    started = time.monotonic()
    with pytest.raises(StudyError, match=words):
        train(small, pytest.fail, engine=engine, address=address)  # type: ignore[arg-type]
    assert time.monotonic() - started < 15


@pytest.mark.parametrize("notebook", [False, True])
def test_a_server_that_is_no_dask_scheduler(small: list[Cell], notebook: bool) -> None:
    """It takes the connection and says nothing; Dask's client would wait for ever.

    In a notebook the thread that asks has a running event loop.
    """
    pytest.importorskip("distributed")

    def too_long(*_: Any) -> None:
        raise AssertionError("waits for a server that says nothing")

    def ask(address: str) -> None:
        train(small, pytest.fail, engine="dask", address=address)

    async def ask_in_a_loop(address: str) -> None:
        ask(address)

    def ask_in_a_notebook(address: str) -> None:
        asyncio.run(ask_in_a_loop(address))

    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(20)
    try:
        with socket.create_server(("127.0.0.1", 0)) as server:
            address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
            with pytest.raises(StudyError, match="There is no Dask scheduler at"):
                (ask_in_a_notebook if notebook else ask)(address)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize(
    ("engine", "package", "line"),
    [("dask", "distributed", "qcompile[dask]"), ("ray", "ray", "qcompile[ray]")],
)
def test_a_missing_package_is_named(
    small: list[Cell], monkeypatch: pytest.MonkeyPatch, engine: Any, package: str, line: str
) -> None:
    real = builtins.__import__

    def missing(name: str, *rest: Any) -> Any:
        if name.split(".")[0] == package:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(MissingExtraError) as raised:
        train(small, pytest.fail, engine=engine)
    assert line in str(raised.value)
