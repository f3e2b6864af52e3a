"""What a journal holds: submissions and what they measured, charges, steps."""

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
"""`intended` was never sent; of `sending` it is not known whether IBM accepted it."""


@dataclass(frozen=True)
class Submission:
    """One attempt at one job of a run.

    `digest` is that of all it measures; `cap_s` the seconds at which IBM cuts it off; `sent_at`
    when it was last sent, None before. Of one that has ended without counts `words` say why;
    `charged_s` is what IBM charged, None until it says. `ones` (rows, circuits) are the counts of
    one that an earlier version of qcompile sent; today's are registers.
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
    """Of its own table; what it was charged is in another one."""

    @classmethod
    def of_row(cls, row: tuple[Any, ...]) -> Submission:
        """That of a row of COLUMNS and its charge."""
        *columns, charged_s = row
        values = dict(zip(cls.COLUMNS.split(", "), columns, strict=True))
        if values["sent_at"] is not None:
            values["sent_at"] = to_time(values["sent_at"])
        if values["ones"] is not None:
            values["ones"] = to_array(values["ones"])
        return cls(**values, charged_s=charged_s)


@dataclass(frozen=True)
class Register:
    """What a job measures of register `name` of one of its PUBs, number `pub`.

    `shape` is that of the PUB's parameter values, then the shots; `width` the number of bits.
    `packed` are they, a shot after the other, each in whole bytes with bit 0 last, as in BitArray;
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
        """That of a row of COLUMNS.

        Raises:
            ValueError: the shape is none.
        """
        pub, name, shape, width, packed = row
        sizes = json.loads(shape) if len(shape) < _LONGEST_SHAPE else None
        if not isinstance(sizes, list) or not sizes or not all(map(_is_size, sizes)):
            raise ValueError("a shape that no register has")
        return cls(pub, name, tuple(sizes), width, packed)

    @property
    def row(self) -> tuple[Any, ...]:
        """Its values for COLUMNS."""
        return self.pub, self.name, json.dumps(self.shape), self.width, self.packed

    @property
    def bytes_a_shot(self) -> int:
        return -(-self.width // 8)

    @property
    def packed_size(self) -> int:
        """The bytes that its bits take."""
        return math.prod(self.shape) * self.bytes_a_shot

    @property
    def bits(self) -> NDArray[np.uint8]:
        """The packed bits (*shape, bytes), which can be written.

        Raises:
            ValueError: they are not here, or of another size.
        """
        if self.packed is None or len(self.packed) != self.packed_size:
            raise ValueError("bits of another size")
        packed = np.frombuffer(bytearray(self.packed), dtype=np.uint8)
        return packed.reshape(*self.shape, self.bytes_a_shot)


def _is_size(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**31


@dataclass(frozen=True)
class Charge:
    """What a job that IBM has, or may have, takes of the limit.

    `number` is its place in the run; `job_id` None where IBM did not answer with one: then the job
    is in doubt, `sent_at` is when the attempt to send it ended, or else began, and `refused` says
    whether the answer was a refusal. `charged_s` is what IBM charged;
    as long as that is not known, it counts with `cap_s`, at which IBM cuts it off.
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
        """That of a row of COLUMNS."""
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
        """As a journal keeps them, (3, B)."""
        return np.stack([self.episode, self.decision, self.predicted])

    @property
    def depth(self) -> int:
        """The most decisions of one episode."""
        return int(np.unique(self.episode, return_counts=True)[1].max())


@dataclass(frozen=True)
class Step:
    """Observations (B, features) of a step, the actions (B,) measured, the rewards earned.

    Where steps are measured ahead, `chains` are its rows; its actions are None until they are
    measured, and rewards are those of the actions that counted.
    """

    observations: FloatArray
    actions: NDArray[np.int64] | None
    rewards: FloatArray | None
    chains: Chains | None = None

    @classmethod
    def of_row(cls, row: tuple[Any, ...]) -> Step:
        """That of a row of the journal's table.

        Its actions are (B,), or (3, B) episodes, decisions and predicted actions, or (4, B), these
        and the actions.

        Raises:
            LiveError: it is damaged.
        """
        observations, (actions, rewards) = to_array(row[0]), row[1:]
        taken, earned = to_array(actions), None if rewards is None else to_array(rewards)
        if taken.ndim != 2:
            return cls(observations, taken, earned)
        if taken.shape not in [(3, len(observations)), (4, len(observations))] or not taken.size:
            raise LiveError("The rows of a step are damaged.", "Restore a copy.")
        measured = taken[3] if len(taken) == 4 else None
        return cls(observations, measured, earned, Chains(*taken[:3]))


def to_time(text: str) -> datetime:
    """A time as the journal writes it.

    Raises:
        LiveError: it is damaged.
    """
    try:
        return datetime.fromisoformat(text)
    except (TypeError, ValueError) as error:
        raise LiveError("A time in the run's journal is damaged.", "Restore a copy.") from error


def to_bytes(array: NDArray[Any]) -> bytes:
    """An array as the bytes of a .npy file."""
    file = BytesIO()
    np.save(file, array, allow_pickle=False)
    return file.getvalue()


def to_array(contents: bytes) -> NDArray[Any]:
    """What `to_bytes` was given.

    Raises:
        LiveError: it is damaged.
    """
    try:
        return read_npy(contents)
    except (ContentsError, TypeError) as error:  # SQLite keeps a value of any type
        raise LiveError("An array in the run's journal is damaged.", "Restore a copy.") from error
