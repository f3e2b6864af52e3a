"""Say what episodes cost on a machine: what `qcompile plan` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from qcompile.deploy.registration import import_modules
from qcompile.device import Device
from qcompile.errors import DeviceError, OptionError
from qcompile.execution import Backend, Executor, load_backend
from qcompile.limits import FREE_SECONDS, USD_PER_SECOND
from qcompile.live.connection import Connection
from qcompile.live.plan import copies_that_fit, forecast, strategies
from qcompile.live.play import RunTask
from qcompile.policy import Policy, load_circuits
from qcompile.policy.arguments import with_arguments
from qcompile.policy.files import policy_values
from qcompile.report.figure import Figure
from qcompile.report.seconds import draw_seconds
from qcompile.sweep.arguments import Name, several, shots_of
from qcompile.verbs.arguments import checked
from qcompile.verbs.results import Result


class Plan(Result):
    """What each way to run a policy takes: `strategies`, the paper's first."""

    @property
    def strategies(self) -> list[dict[str, Any]]:
        """Name, jobs, executions, QPU seconds and price of each way."""
        strategies: list[dict[str, Any]] = self.to_dict()["strategies"]
        return strategies

    def plot(self) -> Figure:
        """The QPU seconds of each way, on a logarithmic scale."""
        return draw_seconds(self.to_dict())

    @property
    def table(self) -> tuple[list[str], list[list[str]]]:
        rows = [
            [
                row["name"],
                f"{row['jobs']:,}",
                f"{row['executions']:,}",
                f"{row['qpu_seconds']:,.1f}",
                f"{row['price_usd']:,.0f}",
                f"{100 * row['share_of_free_plan']:,.0f} %",
            ]
            for row in self.strategies
        ]
        return ["way", "jobs", "executions", "QPU seconds", "USD", "of free plan"], rows


@checked
def plan(
    policy: Name | Policy = "lunarlander",
    backend: Name | Device | Backend | Executor | Any = "ibm_lima",
    *,
    shots: int = 8192,
    episodes: int = 1,
    seed: int = 0,
    level: int = 2,
    mitigation: str = "readout",
    copies: int | None = None,
    max_steps: int | None = None,
    imports: Name | Sequence[Name] = (),
    env: Mapping[str, Any] | None = None,
    usd_per_second: float = USD_PER_SECOND,
    live: bool = False,
    account: str | None = None,
    instance: str | None = None,
) -> Plan:
    """Say what episodes with a policy cost on a machine, in each way to run them.

    They are played on the backend's noise model first: they may last longer or shorter on the
    machine. Nothing is sent. The calibration of `mitigation` is counted, but for the paper's way;
    `copies` None are as many episodes side by side as fit. `imports` are modules that register
    environments, `env` arguments of the policy's. `usd_per_second` is the price of a QPU
    second beyond the free plan, a third party's figure. With `live` IBM is asked for the machine's
    qubits, which spends nothing; `account` and `instance` are names of IBM's own tools.

    Raises:
        OptionError: options contradict each other.
        QcompileError: a name, a file or a combination that cannot be played.
    """
    if shots_of(shots) is None:
        raise OptionError("A plan needs a number of shots: a machine gives nothing exact.")
    for option, value in (("account", account), ("instance", instance)):
        if value is not None and not live:
            raise OptionError(f"{option} is for live: nothing else asks IBM.")
    device = _asked(backend, account, instance) if live else load_backend(backend).device
    if device.is_ideal:
        raise DeviceError(
            "ideal is not a machine: it costs nothing.",
            "Name a device; `qcompile backends` lists some.",
        )
    import_modules(several(imports))
    loaded = with_arguments(load_circuits(policy), env, kept=True)
    task = RunTask.model_validate(
        {
            "backend": device.name,
            "device": device,
            "policy": policy_values(loaded),
            "shots": shots,
            "episodes": episodes,
            "seed": seed,
            "level": level,
            "mitigation": mitigation,
            "max_steps": max_steps,
            "copy_of": "episode",
        }
    )
    task = task.model_copy(update={"copies": copies or copies_that_fit(task)})
    forecasted = forecast(task)
    return Plan(
        {
            "policy": task.policy.name,
            "backend": device.name,
            "shots": shots,
            "episodes": episodes,
            "copies": task.copies,
            "hold": loaded.hold,
            "decisions": forecasted.decisions,
            "env_steps": forecasted.env_steps,
            "usd_per_second": usd_per_second,
            "free_seconds": FREE_SECONDS,
            "strategies": [way.values(usd_per_second) for way in strategies(task, forecasted)],
        }
    )


def _asked(backend: Any, account: str | None, instance: str | None) -> Device:
    if not isinstance(backend, str):
        raise OptionError("A live plan needs the name of a machine of IBM's.")
    return Connection(backend, account, instance).device()
