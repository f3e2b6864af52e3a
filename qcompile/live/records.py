"""What a journal holds: submissions, charges, steps."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from io import BytesIO
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]

State = Literal["intended", "sent", "done", "failed"]


@dataclass(frozen=True)
class Submission:
    """One attempt at one job of a run.

    `digest` is that of all it measures; `created` is when it was last sent; `ones` (rows, circuits)
    are its counts once it is done; `usage_s` is what IBM charged, None as long as it has not said
    so; `words` say why it failed.
    """

    number: int
    attempt: int
    tag: str
    digest: str
    executions: int
    created: datetime
    state: State
    job_id: str | None
    usage_s: float | None
    ones: IntArray | None
    words: str | None

    @classmethod
    def of_row(cls, row: tuple[Any, ...]) -> Submission:
        """That of a row of the journal's table."""
        number, attempt, tag, digest, executions, created, state, job_id, usage_s, ones, words = row
        return cls(
            number,
            attempt,
            tag,
            digest,
            executions,
            datetime.fromisoformat(created),
            state,
            job_id,
            usage_s,
            None if ones is None else to_array(ones),
            words,
        )


@dataclass(frozen=True)
class Charge:
    """What one attempt costs: its executions, and what IBM charged, as far as it is known."""

    executions: int
    usage_s: float | None
    state: State


@dataclass(frozen=True)
class Step:
    """Observations (B, features) of a step, the actions (B,) taken, the rewards (B,) earned."""

    observations: FloatArray
    actions: IntArray
    rewards: FloatArray | None

    @classmethod
    def of_row(cls, row: tuple[Any, ...]) -> Step:
        """That of a row of the journal's table."""
        observations, actions, rewards = row
        earned = None if rewards is None else to_array(rewards)
        return cls(to_array(observations), to_array(actions), earned)


def to_bytes(array: NDArray[Any]) -> bytes:
    """An array as the bytes of a .npy file."""
    file = BytesIO()
    np.save(file, array, allow_pickle=False)
    return file.getvalue()


def to_array(contents: bytes) -> NDArray[Any]:
    """What `to_bytes` was given."""
    return np.asarray(np.load(BytesIO(contents), allow_pickle=False))
