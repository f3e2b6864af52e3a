"""A SamplerV2 for any program, whose jobs pass the guard."""

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
"""The samplers of this process by folder: a cell of a notebook that is run again makes another."""


class GuardedJob(SamplerJob):
    """The jobs of one call of a GuardedSampler."""

    def __init__(self, sampler: GuardedSampler, job: SamplerJob):
        super().__init__(job._jobs, job._call, job.numbers)
        self._sampler = sampler

    def result(self) -> Any:
        """The PrimitiveResult, waited for: a BitArray for each PUB and register.

        Raises:
            LiveError: a job cannot be fetched now, or gave no counts. Asked for again, here or by
                the same PUBs, it is the same job.
        """
        with self._sampler.asked_by_owner():
            self._sampler.note_pending(self._call, self.numbers)
            result = super().result()
            self._sampler.note_fetched(self._call, self.numbers)
            return result


class GuardedSampler(JobsSampler):
    """IBM's machine `backend` as a SamplerV2, by the guard of `qcompile run --live`.

    `backend` is the name of a machine, or an IBMBackend. No job is sent that might pass
    `max_qpu_seconds` in all; each is sent once, and what it gave is kept in the folder `journal`. A
    program that is run again, with the same journal, gets what is recorded and continues from
    there: it has to ask for the same PUBs in the same order. One process and one thread asks at a
    time.

    `account` and `instance` are names of IBM's own tools, by default theirs; without an instance
    only those of the Open Plan are used. With `batch` jobs go as a batch of IBM's; at most
    `jobs_per_minute` are sent. A job is waited for `max_wait_s`, or as long as it takes. One that
    was charged and gave no counts is sent again only with `pay_again`. `say` gets words on what
    happens.

    Raises:
        BudgetError: the limit is not a number of seconds that may be spent.
        LiveError: the account has no such machine, or the journal is another's, or in use.
        MissingExtraError: qiskit-ibm-runtime is not installed.
        OptionError: `backend` is not a machine of IBM's, or another argument cannot be used.
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
                f"journal is {describe(journal)}.", "It is the name of a folder: 'runs/mine'."
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
        """Nothing more is asked for: the batch and the journal are closed."""
        if not self.is_closed and self._owner == _caller():
            self._jobs.close()
            self._release()
            self._owner = 0, 0

    @property
    def is_closed(self) -> bool:
        return self._owner == (0, 0)

    @property
    def costs(self) -> dict[str, Any]:
        """What it costs up to now, as results of `run --live` tell it."""
        self.check_owner()
        return costs(self.journal)

    def settle(self) -> dict[str, Any]:
        """Look over all that IBM has of the journal, and what it charges for it; the costs."""
        self.check_owner()
        self._jobs.settle()
        return costs(self.journal)

    def run(self, pubs: Iterable[Any], *, shots: int | None = None) -> GuardedJob:
        """The job of PUBs, once IBM or the journal has it; `shots` are those of PUBs without.

        Any PUBs will do: circuits of the machine's instructions, values of their parameters, in
        arrays of any shape, and shots, by default 4096. Where this fails nothing was asked for; the
        same PUBs may be asked for again.

        Raises:
            BudgetError: the limit might be passed. Nothing was sent.
            CountsError, OptionError: what is asked for cannot be run.
            LiveError: a job cannot be sent.
            ReplayError: the journal has other PUBs in this place.
        """
        with self.asked_by_owner():
            call = Call(pubs, shots)
            if pending := self._pending.get(_name(call)):
                return GuardedJob(self, SamplerJob(self._jobs, call, pending.pop(0)))
            return GuardedJob(self, super().run(call.pubs))

    def note_pending(self, call: Call, numbers: list[int]) -> None:
        """Until the result of a call is fetched, the same call means the same jobs."""
        pending = self._pending.setdefault(_name(call), [])
        if numbers not in pending:
            pending.append(numbers)
            pending.sort()

    def note_fetched(self, call: Call, numbers: list[int]) -> None:
        """The result of a call is here: the same call asks for other jobs."""
        self._pending[_name(call)].remove(numbers)

    @contextmanager
    def asked_by_owner(self) -> Iterator[None]:
        """What is asked by the owner, with words for a program on what goes wrong."""
        self.check_owner()
        try:
            yield
        except QcompileError as error:
            raise with_advice(error, self.journal) from error

    def check_owner(self) -> None:
        """Nothing, if the process and the thread that made it ask.

        Raises:
            LiveError: others do, or it is closed.
        """
        if self.is_closed:
            raise LiveError(
                f"The sampler of {self.journal.folder} is closed.",
                "Make another one with the same journal: it continues from there.",
            )
        if self._owner != _caller():
            raise LiveError(
                "A GuardedSampler is asked by the process and the thread that made it.",
                "The journal knows its jobs by their order. Make one with a journal for each.",
            )

    def __repr__(self) -> str:
        return f"GuardedSampler({self.journal.settings['backend']}, {self.journal.folder})"


def _release(stack: ExitStack, process: int) -> None:
    """Close journal and lock, at the latest where the program ends; but not those of a fork."""
    if os.getpid() == process:
        stack.close()


def _caller() -> tuple[int, int]:
    return os.getpid(), threading.get_ident()


def _name(call: Call) -> tuple[str, ...]:
    return tuple(request.digest for request in call.requests)


def _machine(backend: Any) -> tuple[str, Any]:
    """The name of a machine, and its IBMBackend where that is given.

    Raises:
        OptionError: it is neither.
    """
    if isinstance(backend, str):
        return backend, None
    homes = {base.__module__ for base in type(backend).__mro__}
    if "qiskit_ibm_runtime.ibm_backend" in homes:
        return backend.name, backend
    raise OptionError(
        f"GuardedSampler found {describe(backend)}.",
        "It takes the name of a machine, or the IBMBackend of QiskitRuntimeService.backend(name).",
        "Sessions and batches are not taken; batch=True makes one.",
        "A simulator costs nothing and needs no guard: use its own sampler.",
    )


def _begin(folder: Path, connection: Connection, account: str | None, limit_s: float) -> None:
    """Make the journal; nothing is sent.

    Raises:
        LiveError: it cannot be written, or the account has no such machine.
    """
    if folder.is_dir() and any(folder.iterdir()):
        raise LiveError(
            f"{folder} holds other things and no journal.",
            f"Name a folder of its own: journal={str(folder / 'mine')!r}.",
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
        if not (folder / FILE).is_file():  # and no other process was faster
            raise


def _task(journal: Journal, backend: str, account: str | None) -> SamplerTask:
    """What the journal is of, if this sampler may continue it.

    Raises:
        LiveError: it is another run's, another machine's, or not at home here.
    """
    if journal.kind != "sampler":
        raise LiveError(
            f"{journal.folder} is the journal of a {journal.kind}, not of a sampler.",
            f"`{resume_command(journal)}` resumes that. Name another folder.",
        )
    task = SamplerTask.model_validate(journal.settings)
    if (task.backend, task.account) != (backend, account):
        raise LiveError(
            f"{journal.folder} is of {task.backend}, account {task.account or 'the usual one'}.",
            f"This sampler asks {backend}, account {account or 'the usual one'}. "
            "Name another folder.",
        )
    if words := resume_warning(journal):
        raise LiveError(words, f"`{resume_command(journal)}` asks whether to resume it here.")
    return task
