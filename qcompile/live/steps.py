"""What a run has played: the steps of its lockstep, in its journal."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import CountArray, FloatArray
from qcompile.live.database import Database
from qcompile.live.opening import reading
from qcompile.live.records import Step, to_bytes


class Steps:
    """The steps of a journal; their number is `len`.

    A step is there with its actions before the environments take them, and gets its rewards
    afterwards.
    """

    def __init__(self, database: Database):
        self._db = database

    def __len__(self) -> int:
        return int(self._db.rows("SELECT COUNT(*) FROM step")[0][0])

    def at(self, number: int) -> Step | None:
        """Step `number`, if it was taken."""
        rows = self._db.rows(
            "SELECT observations, actions, rewards FROM step WHERE number = ?", number
        )
        with reading(self._db.path):
            return Step.of_row(rows[0]) if rows else None

    def note_actions(self, number: int, observations: FloatArray, actions: CountArray) -> None:
        """The actions (B,) of a step for its observations (B, features)."""
        values = (number, to_bytes(observations), to_bytes(actions.astype(np.int64)))
        self._db.do("INSERT INTO step VALUES (?,?,?,NULL)", *values)

    def note_rewards(self, number: int, rewards: list[float]) -> None:
        """What the actions of a step earned."""
        self._db.do(
            "UPDATE step SET rewards = ? WHERE number = ?", to_bytes(np.array(rewards)), number
        )
