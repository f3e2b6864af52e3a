"""The protocol of what plays episodes: circuits on a backend, or a network."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from qcompile.arrays import FloatArray, IntArray
from qcompile.deploy.rows import Rows
from qcompile.deploy.settings import RunSettings
from qcompile.execution import Kind, Workload
from qcompile.mitigation import Misfit
from qcompile.passes import Executable
from qcompile.policy import AnyPolicy

GATES = ("sx", "rz", "x", "rx")
"""The native gates that results count."""


class Player(Protocol):
    """A policy with everything its actions depend on; its settings are resolved."""

    settings: RunSettings

    @property
    def policy(self) -> AnyPolicy:
        """The policy that decides."""
        ...

    @property
    def backend(self) -> str:
        """The name of the backend it plays on."""
        ...

    @property
    def kind(self) -> Kind:
        """The kind of its results."""
        ...

    @property
    def executable(self) -> Executable | None:
        """Its circuits as compiled; a network has none."""
        ...

    @property
    def misfits(self) -> Sequence[Misfit]:
        """The fits of its calibration that contradict their own counts."""
        ...

    @property
    def calibration_load(self) -> Workload:
        """Jobs and executions of the calibration before the first episode."""
        ...

    @property
    def calibration_shots(self) -> int | None:
        """Shots of the calibration before the first episode, if one was measured."""
        ...

    def act(
        self,
        observations: FloatArray,
        rows: Rows | None = None,
        note: Callable[[FloatArray], None] | None = None,
    ) -> IntArray:
        """An action for each of the observations (B, features).

        `rows` says which decision of which episode each is; without them row i is episode i, and
        every call the next decision. `note` gets the values (B, ...) that the policy decides by:
        `<Z>` of circuits as measured and mitigated, or what a network observes.
        """
        ...

    def predict(self, observations: FloatArray, rows: Rows) -> IntArray:
        """The actions (B,) that `act` would most likely return for these rows, unmeasured."""
        ...

    def executions(self, rows: Rows) -> int:
        """The executions of its program that a step with these rows takes."""
        ...

    def load(self, executions: int) -> Workload:
        """Jobs and executions of a step that takes this many executions of its program."""
        ...

    def sizes(self) -> dict[str, Any]:
        """Gates, circuits and rounds, as in `qcompile run --json`."""
        ...
