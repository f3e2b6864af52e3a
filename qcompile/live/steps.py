"""The steps that a run has played, in its journal."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from qcompile.arrays import CountArray, FloatArray
from qcompile.live.database import Database
from qcompile.live.journal_file import reading
from qcompile.live.records import Chains, Step, to_bytes

_BEGUN = f"instr(substr(actions, 1, 128), X'{b'(3, '.hex()}')"
"""Matches a step with rows but no actions yet: its array has the shape (3, B)."""


class Steps:
    """The steps of a journal; its `len` is the number of steps played.

    A step is recorded with its actions before the environments take them, and gets its rewards
    afterwards. A step that measures ahead is recorded with its rows before it is measured.
    """

    def __init__(self, database: Database):
        self._db = database

    def __len__(self) -> int:
        return int(self._db.rows(f"SELECT COUNT(*) FROM step WHERE NOT {_BEGUN}")[0][0])

    def __iter__(self) -> Iterator[Step]:
        """All steps in order, including one that was begun."""
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
        """Record the rows of a step for observations (B, features), before it is measured."""
        self._note(number, observations, chains.array)

    def note_actions(
        self,
        number: int,
        observations: FloatArray,
        actions: CountArray,
        chains: Chains | None = None,
    ) -> None:
        """Record the actions (B,) of a step for observations (B, features), with its rows."""
        taken = actions if chains is None else np.concatenate([chains.array, actions[None]])
        self._note(number, observations, taken)

    def _note(self, number: int, observations: FloatArray, actions: CountArray) -> None:
        values = (number, to_bytes(observations), to_bytes(actions.astype(np.int64)))
        self._db.do("INSERT OR REPLACE INTO step VALUES (?,?,?,NULL)", *values)

    def note_rewards(self, number: int, rewards: list[float]) -> None:
        """Record the rewards of a step's actions."""
        self._db.do(
            "UPDATE step SET rewards = ? WHERE number = ?", to_bytes(np.array(rewards)), number
        )
