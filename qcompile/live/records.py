"""The records of a journal: submissions, registers, charges and steps."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from datetime import datetime
from io import BytesIO
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import CountArray, FloatArray
from qcompile.errors import LiveError
from qcompile.reading import ContentsError, read_npy

_LONGEST_SHAPE = 1000
State = Literal["intended", "sending", "sent", "done", "failed"]
"""`intended`: never sent; `sending`: IBM may or may not have accepted it."""


@dataclass(frozen=True)
class Submission:
    """One attempt at one job of a run.

    `digest` identifies the PUBs; `cap_s` is the time in seconds after which IBM stops the job;
    `sent_at` is when it was last sent, None before. `words` say why it ended without counts;
    `charged_s` is IBM's charge, None until reported. `ones` (rows, circuits) are counts recorded by
    an earlier version of qcompile; now they are registers.
    """

    number: int
    attempt: int
    tag: str
    digest: str
    executions: int
    state: State
    sent_at: datetime | None
    cap_s: int | None
    job_id: str | None
    ones: CountArray | None
    words: str | None
    charged_s: float | None = None

    COLUMNS = "number, attempt, tag, digest, executions, state, sent_at, cap_s, job_id, ones, words"
    """The columns of its own table; the charge is in another one."""

    @classmethod
    def of_row(cls, row: tuple[Any, ...]) -> Submission:
        """The submission in a row of COLUMNS and its charge."""
        *columns, charged_s = row
        values = dict(zip(cls.COLUMNS.split(", "), columns, strict=True))
        if values["sent_at"] is not None:
            values["sent_at"] = to_time(values["sent_at"])
        if values["ones"] is not None:
            values["ones"] = to_array(values["ones"])
        return cls(**values, charged_s=charged_s)


@dataclass(frozen=True)
class Register:
    """The bits that a job measures in register `name` of its PUB number `pub`.

    `shape` is the shape of the PUB's parameter values, then the shots; `width` the number of bits.
    `packed` holds the bits shot by shot, each shot in whole bytes with bit 0 last, as in BitArray;
    None before the job is done.
    """

    pub: int
    name: str
    shape: tuple[int, ...]
    width: int
    packed: bytes | None = field(default=None, repr=False)

    COLUMNS = "pub, name, shape, width, packed"

    @classmethod
    def of_row(cls, row: tuple[Any, ...]) -> Register:
        """The register in a row of COLUMNS.

        Raises:
            ValueError: the shape is not valid.
        """
        pub, name, shape, width, packed = row
        sizes = json.loads(shape) if len(shape) < _LONGEST_SHAPE else None
        if not isinstance(sizes, list) or not sizes or not all(map(_is_size, sizes)):
            raise ValueError("the shape of a register is not valid")
        return cls(pub, name, tuple(sizes), width, packed)

    @property
    def row(self) -> tuple[Any, ...]:
        """The values of COLUMNS."""
        return self.pub, self.name, json.dumps(self.shape), self.width, self.packed

    @property
    def bytes_a_shot(self) -> int:
        return -(-self.width // 8)

    @property
    def packed_size(self) -> int:
        """The size of its bits in bytes."""
        return math.prod(self.shape) * self.bytes_a_shot

    @property
    def bits(self) -> NDArray[np.uint8]:
        """The packed bits (*shape, bytes), as a writable array.

        Raises:
            ValueError: they are missing or have the wrong size.
        """
        if self.packed is None or len(self.packed) != self.packed_size:
            raise ValueError("bits of the wrong size")
        packed = np.frombuffer(bytearray(self.packed), dtype=np.uint8)
        return packed.reshape(*self.shape, self.bytes_a_shot)


def _is_size(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**31


@dataclass(frozen=True)
class Charge:
    """The cost of a job that IBM has or may have, counted against the limit.

    `number` is the job's number in the run. `job_id` is None if IBM did not return one: then the
    job is in doubt, `sent_at` is when the attempt to send it ended, or else began, and `refused`
    says whether IBM answered with a refusal. `charged_s` is IBM's charge; until that is known, the
    job counts with `cap_s`, after which IBM stops it.
    """

    row: int
    number: int | None
    executions: int
    cap_s: float
    sent_at: datetime
    refused: bool
    job_id: str | None
    charged_s: float | None

    COLUMNS = "row, number, executions, cap_s, sent_at, refused, job_id, charged_s"

    @classmethod
    def of_row(cls, row: tuple[Any, ...]) -> Charge:
        """The charge in a row of COLUMNS."""
        values = dict(zip(cls.COLUMNS.split(", "), row, strict=True))
        values["sent_at"], values["refused"] = to_time(values["sent_at"]), bool(values["refused"])
        return cls(**values)


@dataclass(frozen=True)
class Chains:
    """The rows of a step that measures ahead: episode, decision, predicted action, (B,) each."""

    episode: NDArray[np.int64]
    decision: NDArray[np.int64]
    predicted: NDArray[np.int64]

    @property
    def array(self) -> NDArray[np.int64]:
        """The array (3, B) that the journal stores."""
        return np.stack([self.episode, self.decision, self.predicted])

    @property
    def depth(self) -> int:
        """The largest number of decisions of one episode."""
        return int(np.unique(self.episode, return_counts=True)[1].max())


@dataclass(frozen=True)
class Step:
    """A step: observations (B, features), measured actions (B,), and rewards.

    When steps are measured ahead, `chains` holds its rows, actions are None until measured, and
    rewards belong to the actions that counted.
    """

    observations: FloatArray
    actions: NDArray[np.int64] | None
    rewards: FloatArray | None
    chains: Chains | None = None

    @classmethod
    def of_row(cls, row: tuple[Any, ...]) -> Step:
        """The step in a row of the journal's table.

        The stored actions have shape (B,); or (3, B): episodes, decisions and predicted actions; or
        (4, B): these and the actions.

        Raises:
            LiveError: it is damaged.
        """
        observations, (actions, rewards) = to_array(row[0]), row[1:]
        taken, earned = to_array(actions), None if rewards is None else to_array(rewards)
        if taken.ndim != 2:
            return cls(observations, taken, earned)
        if taken.shape not in [(3, len(observations)), (4, len(observations))] or not taken.size:
            raise LiveError("The rows of a step are damaged.", "Restore a backup.")
        measured = taken[3] if len(taken) == 4 else None
        return cls(observations, measured, earned, Chains(*taken[:3]))


def to_time(text: str) -> datetime:
    """The time that the journal stores as `text`.

    Raises:
        LiveError: it is damaged.
    """
    try:
        return datetime.fromisoformat(text)
    except (TypeError, ValueError) as error:
        raise LiveError("A time in the journal is damaged.", "Restore a backup.") from error


def to_bytes(array: NDArray[Any]) -> bytes:
    """An array as the bytes of a .npy file."""
    file = BytesIO()
    np.save(file, array, allow_pickle=False)
    return file.getvalue()


def to_array(contents: bytes) -> NDArray[Any]:
    """The array that `to_bytes` stored.

    Raises:
        LiveError: it is damaged.
    """
    try:
        return read_npy(contents)
    except (ContentsError, TypeError) as error:  # SQLite keeps a value of any type
        raise LiveError("An array in the journal is damaged.", "Restore a backup.") from error
