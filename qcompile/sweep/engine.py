"""Run cells in parallel: on this machine's cores, or on a Dask or Ray cluster.

Every cell draws only from its own seed, so results do not depend on the engine, the number of
workers or the order. Each result is handed over at once; if a worker stops, its cells run again.
"""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import Any, Literal, Protocol, TypeVar
from urllib.parse import urlsplit

import joblib

from qcompile.caller import option
from qcompile.errors import MissingExtraError, QcompileError, StudyError
from qcompile.sweep.workers import deaf_children, end_with
from qcompile.terminal import first_line

Engine = Literal["processes", "dask", "ray"]
ENGINES: tuple[Engine, ...] = ("processes", "dask", "ray")

_BACKENDS = {"processes": "loky", "dask": "dask", "ray": "ray"}
_MOST_LOSSES = 3
_CONNECT_SECONDS = 5


class Named(Protocol):
    """A cell to run, with a unique name."""

    @property
    def name(self) -> str: ...


C = TypeVar("C", bound=Named)
R = TypeVar("R")


class _Failure(str):
    """The error message of a cell."""


def run_all(
    cells: Sequence[C],
    run: Callable[[C], R],
    on_result: Callable[[C, R], None],
    *,
    engine: Engine = "processes",
    address: str | None = None,
    workers: int | None = None,
    on_loss: Callable[[str], None] = lambda words: None,
    noun: str = "cell",
) -> None:
    """Call `run` with every cell, and `on_result` with each cell and its result as they finish.

    `address` is that of a running cluster; without it a local one is started. `workers` is their
    number, by default one per core or all that the cluster has. `on_loss` is called with a message
    if workers stopped and unfinished cells run again; `noun` is what messages call a cell.

    Raises:
        StudyError: there is no such engine, there is no cluster at the address, `run` failed, or
            workers stopped several times without finishing a cell.
        MissingExtraError: the engine's package is not installed.
    """
    waiting = {cell.name: cell for cell in cells}
    if not waiting:
        return
    losses = 0
    if workers is not None:  # a single worker would be this process, which a crash would end
        workers = min(workers, max(len(waiting), 2))
    with _engine(engine, address, workers) as jobs:
        outcomes = _outcomes(list(waiting.values()), run, engine, jobs)
        while waiting:
            try:
                name, outcome = next(outcomes)
            except QcompileError:
                raise
            except Exception as error:  # engines raise different errors if a worker stopped
                losses += 1
                words = first_line(f"{type(error).__name__}: {error}")
                if losses == _MOST_LOSSES:
                    raise StudyError(
                        f"Workers stopped {losses} times without finishing a {noun} ({words}).",
                        f"Each needs about 500 MB of memory; try fewer {option('workers')}.",
                        f"Finished {noun}s are kept; the same command resumes with the others.",
                    ) from error
                again = f"{len(waiting)} {noun}{'s' * (len(waiting) != 1)}"
                on_loss(f"Workers stopped ({words}); running {again} again.")
                outcomes = _outcomes(list(waiting.values()), run, engine, jobs)
                continue
            if isinstance(outcome, _Failure):
                raise StudyError(f"{name} failed: {outcome}")
            losses = 0
            on_result(waiting.pop(name), outcome)
        next(outcomes, None)  # lets joblib clean up


def _outcomes(
    cells: list[C], run: Callable[[C], R], engine: Engine, jobs: int
) -> Iterator[tuple[str, R | _Failure]]:
    if engine == "processes":  # the other engines end their workers themselves
        run = partial(_watched, run, os.getpid())
    tasks = [joblib.delayed(_outcome)(cell, run) for cell in cells]
    # One cell per task: the next one goes to a free worker.
    options: dict[str, Any] = {"n_jobs": jobs, "batch_size": 1, "pre_dispatch": "2*n_jobs"}
    with joblib.parallel_config(backend=_BACKENDS[engine]):
        if engine != "ray":
            parallel = joblib.Parallel(return_as="generator_unordered", **options)
            with deaf_children():
                outcomes = parallel(tasks)
            yield from outcomes
            return
        # Ray's backend only returns whole lists: results are stored after each list.
        size = 2 * joblib.effective_n_jobs(jobs)
        for start in range(0, len(tasks), size):
            yield from joblib.Parallel(**options)(tasks[start : start + size])


def _watched(run: Callable[[C], R], parent: int, cell: C) -> R:
    """Call `run` in a process that ends with its parent."""
    end_with(parent)
    return run(cell)


def _outcome(cell: C, run: Callable[[C], R]) -> tuple[str, R | _Failure]:
    """The cell's name with its result, or with the message of its error."""
    try:
        return cell.name, run(cell)
    except QcompileError as error:
        return cell.name, _Failure(str(error))
    except Exception as error:
        return cell.name, _Failure(f"{type(error).__name__}: {error}")


@contextmanager
def _engine(engine: Engine, address: str | None, workers: int | None) -> Iterator[int]:
    """Start the engine; yields joblib's number of jobs."""
    if engine == "processes":
        if address is not None:
            raise StudyError(
                f"The engine 'processes' takes no address, found {address!r}.",
                f"Use {option('engine')} dask or {option('engine')} ray.",
            )
        yield workers or joblib.cpu_count()
    elif engine == "dask":
        with _dask(address, workers):
            yield workers or -1
    elif engine == "ray":
        with _ray(address, workers):
            yield workers or -1
    else:
        raise StudyError(f"Unknown engine {engine!r}.", f"Known: {', '.join(ENGINES)}.")


@contextmanager
def _dask(address: str | None, workers: int | None) -> Iterator[None]:
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise MissingExtraError(f"{option('engine')} dask", "dask") from error
    if address is None:
        with (
            LocalCluster(
                n_workers=workers or joblib.cpu_count(),
                threads_per_worker=1,
                dashboard_address="127.0.0.1:0",  # the default, port 8787, may be taken
                scheduler_kwargs={"dashboard": False},
            ) as cluster,
            Client(cluster),
        ):
            yield
        return
    _check_reachable("Dask scheduler", address, "tcp://HOST:8786")
    try:
        with ThreadPoolExecutor(1) as thread:  # this one may have an event loop, as in a notebook
            thread.submit(lambda: asyncio.run(_greet(address))).result()
    except (OSError, ValueError, TimeoutError) as error:
        raise StudyError(
            f"There is no Dask scheduler at {address!r}: another kind of server answers there."
        ) from error
    with Client(address, timeout=_CONNECT_SECONDS) as client:
        if not client.scheduler_info()["workers"]:
            raise StudyError(
                f"The Dask scheduler at {address} has no workers.", "Start some: dask worker."
            )
        yield


async def _greet(address: str) -> None:
    """Connect and disconnect: Dask's client would wait forever for another kind of server."""
    from distributed import Security
    from distributed.comm import connect

    options = Security().get_connection_args("client")
    greeting = connect(address, timeout=_CONNECT_SECONDS, **options)
    await (await asyncio.wait_for(greeting, _CONNECT_SECONDS)).close()


@contextmanager
def _ray(address: str | None, workers: int | None) -> Iterator[None]:
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
        from ray.util.joblib import register_ray
    except ImportError as error:
        raise MissingExtraError(f"{option('engine')} ray", "ray") from error
    options: dict[str, Any] = {"log_to_driver": False, "logging_level": "error"}
    if address is None:
        ray.init(num_cpus=workers or joblib.cpu_count(), include_dashboard=False, **options)
    else:
        _check_reachable("Ray cluster", address, "HOST:6379")
        ray.init(address=address, **options)
    register_ray()
    try:
        yield
    finally:
        ray.shutdown()


def _check_reachable(what: str, address: str, form: str) -> None:
    """Raise StudyError if nothing listens at the address: the clients would try for minutes."""
    try:
        place = urlsplit(address if "://" in address else f"//{address}")
        with socket.create_connection((place.hostname, place.port or 0), _CONNECT_SECONDS):
            return
    except (OSError, ValueError) as error:
        raise StudyError(
            f"There is no {what} at {address!r} ({error}).",
            f"An address looks like {form}. Without {option('address')}, one is started here.",
        ) from error
