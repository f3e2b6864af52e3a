"""A guarded SamplerV2 for any program."""

from __future__ import annotations

import os
import threading
import weakref
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from qcompile.errors import LiveError, OptionError, QcompileError
from qcompile.foreign import describe
from qcompile.live.charges import check_limit
from qcompile.live.commands import resume_command
from qcompile.live.connection import Connection
from qcompile.live.jobs import Jobs
from qcompile.live.jobs_sampler import JobsSampler, SamplerJob
from qcompile.live.journal import Journal
from qcompile.live.journal_file import FILE
from qcompile.live.pace import check_pace
from qcompile.live.perform import costs, resume_warning, run_versions, with_advice
from qcompile.live.pubs import Call
from qcompile.live.sampling import SamplerTask

_OPEN: weakref.WeakValueDictionary[Path, GuardedSampler] = weakref.WeakValueDictionary()
"""The samplers of this process by folder: a notebook cell that is run again makes a new one."""


class GuardedJob(SamplerJob):
    """The jobs of one call of a GuardedSampler."""

    def __init__(self, sampler: GuardedSampler, job: SamplerJob):
        super().__init__(job._jobs, job._call, job.numbers)
        self._sampler = sampler

    def result(self) -> Any:
        """The PrimitiveResult, once it is there: a BitArray for each PUB and register.

        Raises:
            LiveError: a job cannot be fetched now, or returned no counts. Another call, here or
                with the same PUBs, refers to the same job.
        """
        with self._sampler.asked_by_owner():
            self._sampler.note_pending(self._call, self.numbers)
            result = super().result()
            self._sampler.note_fetched(self._call, self.numbers)
            return result


class GuardedSampler(JobsSampler):
    """IBM's machine `backend` as a SamplerV2, guarded as in `qcompile run --live`.

    `backend` is the name of a machine, or an IBMBackend. No job is sent that might exceed a total
    of `max_qpu_seconds`; each job is sent once, and its result is kept in the folder `journal`. A
    program that is run again with the same journal gets the recorded results and continues from
    there: it must request the same PUBs in the same order. Only one process and one thread may use
    it.

    `account` and `instance` are names saved by IBM's tools, by default their defaults; without an
    instance only those of the Open Plan are used. With `batch` jobs are sent in an IBM batch; at
    most `jobs_per_minute` are sent. A job is waited for at most `max_wait_s` seconds, without limit
    if None. A job that was charged and returned no counts is sent again only with `pay_again`.
    `say` gets progress messages.

    Raises:
        BudgetError: the limit is not a positive number of seconds, or is too large.
        LiveError: the account has no such machine, or the journal belongs to another run or is in
            use.
        MissingExtraError: qiskit-ibm-runtime is not installed.
        OptionError: `backend` is not an IBM machine, or another argument is not valid.
    """

    def __init__(
        self,
        backend: Any,
        max_qpu_seconds: float = 60,
        journal: str | Path = "runs/mine",
        *,
        account: str | None = None,
        instance: str | None = None,
        batch: bool = False,
        jobs_per_minute: int | None = None,
        max_wait_s: float | None = None,
        pay_again: bool = False,
        say: Callable[[str], None] = lambda words: None,
    ):
        check_limit(max_qpu_seconds)
        check_pace(jobs_per_minute, max_wait_s)
        name, given = _machine(backend)
        if not isinstance(journal, str | Path):
            raise OptionError(
                f"journal is {describe(journal)}.",
                "It must be the name of a folder, such as 'runs/mine'.",
            )
        folder = Path(journal)
        connection = Connection(name, account, instance, given=given)
        if not (folder / FILE).is_file():
            _begin(folder, connection, account, max_qpu_seconds)
        self.journal = Journal(folder)
        self._owner = os.getpid(), threading.get_ident()
        self._pending: dict[tuple[str, ...], list[list[int]]] = {}
        with ExitStack() as stack:
            stack.callback(self.journal.__exit__)
            task = _task(self.journal, name, account)
            if given is None:
                connection = Connection(name, account, task.instance)
            if (before := _OPEN.get(folder.resolve())) is not None:
                before.close()
            stack.enter_context(self.journal.locked())
            self.journal.allow(max_qpu_seconds)
            super().__init__(
                Jobs(
                    self.journal,
                    connection,
                    batch=batch,
                    jobs_per_minute=jobs_per_minute,
                    max_wait_s=max_wait_s,
                    pay_again=pay_again,
                    say=say,
                )
            )
            self._release = weakref.finalize(self, _release, stack.pop_all(), os.getpid())
        _OPEN[folder.resolve()] = self

    def __enter__(self) -> GuardedSampler:
        return self

    def __exit__(self, raised: object, *more: object) -> None:
        if raised is None and not self.is_closed and not self.journal.charges.are_settled:
            self.settle()
        self.close()

    def close(self) -> None:
        """Close the batch and the journal."""
        if not self.is_closed and self._owner == _caller():
            self._jobs.close()
            self._release()
            self._owner = 0, 0

    @property
    def is_closed(self) -> bool:
        return self._owner == (0, 0)

    @property
    def costs(self) -> dict[str, Any]:
        """The costs so far, with the keys of `run --live` results."""
        self.check_owner()
        return costs(self.journal)

    def settle(self) -> dict[str, Any]:
        """Reconcile the journal with IBM's jobs and charges; return the costs."""
        self.check_owner()
        self._jobs.settle()
        return costs(self.journal)

    def run(self, pubs: Iterable[Any], *, shots: int | None = None) -> GuardedJob:
        """The job for these PUBs, once IBM or the journal has it; `shots` is the default for PUBs.

        PUBs may be arbitrary: circuits of the machine's instructions, parameter values in arrays of
        any shape, and shots, by default 4096. If it fails, nothing was requested, and the same PUBs
        may be requested again.

        Raises:
            BudgetError: the limit might be exceeded. Nothing was sent.
            CountsError, OptionError: the PUBs cannot be run.
            LiveError: a job cannot be sent.
            ReplayError: the journal has different PUBs at this position.
        """
        with self.asked_by_owner():
            call = Call(pubs, shots)
            if pending := self._pending.get(_name(call)):
                return GuardedJob(self, SamplerJob(self._jobs, call, pending.pop(0)))
            return GuardedJob(self, super().run(call.pubs))

    def note_pending(self, call: Call, numbers: list[int]) -> None:
        """Remember a call: until its result is fetched, the same call means the same jobs."""
        pending = self._pending.setdefault(_name(call), [])
        if numbers not in pending:
            pending.append(numbers)
            pending.sort()

    def note_fetched(self, call: Call, numbers: list[int]) -> None:
        """Forget a call whose result is fetched: the same call now means new jobs."""
        self._pending[_name(call)].remove(numbers)

    @contextmanager
    def asked_by_owner(self) -> Iterator[None]:
        """A block that only the owner may run; errors get advice for a program."""
        self.check_owner()
        try:
            yield
        except QcompileError as error:
            raise with_advice(error, self.journal) from error

    def check_owner(self) -> None:
        """Check that the process and the thread that made the sampler use it.

        Raises:
            LiveError: another one does, or it is closed.
        """
        if self.is_closed:
            raise LiveError(
                f"The sampler of {self.journal.folder} is closed.",
                "Make a new one with the same journal: it continues from there.",
            )
        if self._owner != _caller():
            raise LiveError(
                "A GuardedSampler can only be used by the process and thread that made it.",
                "The journal identifies jobs by their order. Make a sampler and a journal for "
                "each.",
            )

    def __repr__(self) -> str:
        return f"GuardedSampler({self.journal.settings['backend']}, {self.journal.folder})"


def _release(stack: ExitStack, process: int) -> None:
    """Close journal and lock, at the latest when the program ends; but not in a fork."""
    if os.getpid() == process:
        stack.close()


def _caller() -> tuple[int, int]:
    return os.getpid(), threading.get_ident()


def _name(call: Call) -> tuple[str, ...]:
    return tuple(request.digest for request in call.requests)


def _machine(backend: Any) -> tuple[str, Any]:
    """The name of a machine, and its IBMBackend if given.

    Raises:
        OptionError: it is neither.
    """
    if isinstance(backend, str):
        return backend, None
    homes = {base.__module__ for base in type(backend).__mro__}
    if "qiskit_ibm_runtime.ibm_backend" in homes:
        return backend.name, backend
    raise OptionError(
        f"GuardedSampler got {describe(backend)}.",
        "It takes the name of a machine, or an IBMBackend from QiskitRuntimeService.backend(name).",
        "Sessions and batches are not accepted; batch=True makes a batch.",
        "A simulator costs nothing and needs no guard: use its own sampler.",
    )


def _begin(folder: Path, connection: Connection, account: str | None, limit_s: float) -> None:
    """Create the journal; nothing is sent.

    Raises:
        LiveError: it cannot be written, or the account has no such machine.
    """
    if folder.is_dir() and any(folder.iterdir()):
        raise LiveError(
            f"{folder} has other files but no journal.",
            f"Name a new folder: journal={str(folder / 'mine')!r}.",
        )
    task = SamplerTask(backend=connection.name, account=account, instance=connection.crn)
    settings = task.model_dump(mode="json")
    versions = run_versions()
    try:
        with Journal.create(
            folder.parent, task.kind, task.name, settings, versions, limit_s, folder=folder
        ):
            pass
    except LiveError:
        if not (folder / FILE).is_file():  # unless another process was faster
            raise


def _account_text(name: str | None) -> str:
    return f"account {name}" if name else "the default account"


def _task(journal: Journal, backend: str, account: str | None) -> SamplerTask:
    """The task of the journal, if this sampler may continue it.

    Raises:
        LiveError: it belongs to another run or machine, or was last resumed elsewhere.
    """
    if journal.kind != "sampler":
        raise LiveError(
            f"{journal.folder} is the journal of a {journal.kind}, not of a sampler.",
            f"`{resume_command(journal)}` resumes it. Name another folder.",
        )
    task = SamplerTask.model_validate(journal.settings)
    if (task.backend, task.account) != (backend, account):
        raise LiveError(
            f"{journal.folder} belongs to {task.backend}, {_account_text(task.account)}.",
            f"This sampler uses {backend}, {_account_text(account)}. Name another folder.",
        )
    if words := resume_warning(journal):
        raise LiveError(words, f"`{resume_command(journal)}` asks whether to resume it here.")
    return task
