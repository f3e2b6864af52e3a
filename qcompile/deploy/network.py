"""Plays a network: without circuits, nothing is compiled or measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from qcompile.arrays import FloatArray, IntArray
from qcompile.caller import option
from qcompile.deploy.player import GATES
from qcompile.deploy.rows import Rows
from qcompile.deploy.settings import RunSettings
from qcompile.device import IDEAL, IDEAL_NAME
from qcompile.errors import OptionError
from qcompile.execution import Kind, Workload
from qcompile.mitigation import CALIBRATION_SHOTS, Misfit
from qcompile.passes import Executable
from qcompile.policy import Network
from qcompile.streams import Draws

_SETTINGS: Mapping[str, Any] = {
    "shots": None,
    "level": 2,
    "mitigation": "none",
    "calibration": None,
    "predistort": False,
    "copies": 1,
    "split": False,
    "calibration_shots": CALIBRATION_SHOTS,
    "speculate": 1,
}
"""The values of circuit settings for a network."""


class NetworkPlayer:
    """A network with the settings it plays with.

    Plays with `settings`, or the defaults, with `changes`. Settings for circuits must have their
    defaults or a network's values: exact, without mitigation. Actions are drawn as for circuits.

    Raises:
        CountsError: steps are out of range.
        OptionError: a setting for circuits has another value.
    """

    backend: str = IDEAL_NAME
    kind: Kind = "ideal"
    executable: Executable | None = None
    misfits: Sequence[Misfit] = ()
    calibration_load = Workload()
    calibration_shots: int | None = None

    def __init__(self, network: Network, settings: RunSettings | None = None, **changes: Any):
        chosen, default = RunSettings.of(settings, **changes), RunSettings()
        refuse_options(
            network,
            [
                option(name)
                for name, value in _SETTINGS.items()
                if getattr(chosen, name) not in (value, getattr(default, name))
            ],
        )
        self.policy = network
        self.settings = RunSettings.of(chosen, **_SETTINGS).resolved(IDEAL)
        self._draws = Draws(chosen.seed, 0)
        self._decisions = 0

    def __repr__(self) -> str:
        return f"NetworkPlayer({self.policy.name})"

    def act(
        self,
        observations: FloatArray,
        rows: Rows | None = None,
        note: Callable[[FloatArray], None] | None = None,
    ) -> IntArray:
        """An action for each of the observations (B, features), as `Player.act`."""
        if rows is None:
            rows = Rows.of(len(observations), self._decisions)
            self._decisions += 1
        if note is not None:
            note(observations)
        if self.settings.greedy:
            return self.policy.greedy(observations)
        return self.policy.decide(observations, self._draws.actions(rows.episode, rows.decision))

    def predict(self, observations: FloatArray, rows: Rows) -> IntArray:
        """The actions themselves, which need no measurement."""
        return self.act(observations, rows)

    def executions(self, rows: Rows) -> int:
        """Always 0: it has no program."""
        return 0

    def load(self, executions: int) -> Workload:
        """No jobs and no executions."""
        return Workload()

    def sizes(self) -> dict[str, Any]:
        """All 0: it has no circuits."""
        counted = ("circuits_per_step", "observables_per_step", "rounds_per_step")
        none = dict.fromkeys(("couplings_per_circuit", *counted), 0)
        return {"gates_per_circuit": dict.fromkeys(GATES, 0), **none}


def refuse_options(network: Network, names: Sequence[str]) -> None:
    """Check that no option for circuits is named; `names` are as the caller writes them.

    Raises:
        OptionError: one is.
    """
    if names:
        *most, last = names
        listed = f"{', '.join(most)} or {last}" if most else last
        raise OptionError(
            f"{network.name} is a network, not circuits: it does not accept {listed}.",
            "A network plays exactly, on `ideal`: nothing is compiled or measured.",
        )
