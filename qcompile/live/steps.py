"""What a run has played: the steps of its lockstep, in its journal."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from qcompile.arrays import CountArray, FloatArray
from qcompile.live.database import Database
from qcompile.live.journal_file import reading
from qcompile.live.records import Chains, Step, to_bytes

_BEGUN = f"instr(substr(actions, 1, 128), X'{b'(3, '.hex()}')"
"""A step that has its rows but no actions yet: an array of shape (3, B), as its header says."""


class Steps:
    """The steps of a journal; how many were played is its `len`.

    A step is there with its actions before the environments take them, and gets its rewards
    afterwards. One that measures ahead is there with its rows before it is measured.
    """

    def __init__(self, database: Database):
        self._db = database

    def __len__(self) -> int:
        return int(self._db.rows(f"SELECT COUNT(*) FROM step WHERE NOT {_BEGUN}")[0][0])

    def __iter__(self) -> Iterator[Step]:
        """All steps in order, with one that was begun."""
        yield from self._steps("TRUE")

    def at(self, number: int) -> Step | None:
        """Step `number`, if it was begun."""
        steps = self._steps("number = ?", number)
        return steps[0] if steps else None

    def _steps(self, where: str, *values: object) -> list[Step]:
        rows = self._db.rows(
            f"SELECT observations, actions, rewards FROM step WHERE {where} ORDER BY number",
            *values,
        )
        with reading(self._db.path):
            return [Step.of_row(row) for row in rows]

    def note_chains(self, number: int, observations: FloatArray, chains: Chains) -> None:
        """The rows of a step for its observations (B, features), before it is measured."""
        self._note(number, observations, chains.array)

    def note_actions(
        self,
        number: int,
        observations: FloatArray,
        actions: CountArray,
        chains: Chains | None = None,
    ) -> None:
        """The actions (B,) of a step for its observations (B, features), and its rows again."""
        taken = actions if chains is None else np.concatenate([chains.array, actions[None]])
        self._note(number, observations, taken)

    def _note(self, number: int, observations: FloatArray, actions: CountArray) -> None:
        values = (number, to_bytes(observations), to_bytes(actions.astype(np.int64)))
        self._db.do("INSERT OR REPLACE INTO step VALUES (?,?,?,NULL)", *values)

    def note_rewards(self, number: int, rewards: list[float]) -> None:
        """What the actions of a step earned."""
        self._db.do(
            "UPDATE step SET rewards = ? WHERE number = ?", to_bytes(np.array(rewards)), number
        )
