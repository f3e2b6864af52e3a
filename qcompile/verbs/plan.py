"""Estimate what episodes cost on a machine, and find the cheapest settings: `qcompile plan`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, Literal

from qcompile.calibration import Calibration
from qcompile.caller import option
from qcompile.clashes import check_clashes
from qcompile.deploy.registration import import_modules, module_path
from qcompile.deploy.settings import RunSettings
from qcompile.device import Device, backend_path
from qcompile.errors import BudgetError, DeviceError, OptionError
from qcompile.execution import Backend, Executor, load_backend
from qcompile.execution.backend import DeviceBackend
from qcompile.limits import FREE_SECONDS, USD_PER_SECOND
from qcompile.live.connection import Connection
from qcompile.page.circuits import Compiled
from qcompile.page.document import Document
from qcompile.page.plan import plan_document
from qcompile.page.words import HIDDEN, PRIVATE, without_folders
from qcompile.planning.command import run_command
from qcompile.planning.point import Point
from qcompile.planning.search import KEEP, Goal, search
from qcompile.planning.strategies import forecast, run_task, strategies
from qcompile.policy import Policy, load_circuits
from qcompile.policy.arguments import with_arguments
from qcompile.policy.files import policy_path
from qcompile.report import progress as bars
from qcompile.report.figure import Figure
from qcompile.report.frontier import draw_frontier
from qcompile.report.seconds import draw_seconds
from qcompile.report.style import AnyStyle
from qcompile.report.table import Cell, Column, Table
from qcompile.sweep.arguments import Name, Words, ignore, several, shots_of
from qcompile.verbs.arguments import calibration_settings, checked
from qcompile.verbs.files import path_of
from qcompile.verbs.reports import Reported
from qcompile.verbs.within import advice, frontier_table, within_values

_SHOTS = 8192
"""The default, and the paper's number of shots."""


class Plan(Reported):
    """The cost of each way to run a policy: `strategies`, with the paper's first.

    With a limit of seconds, `frontier` has the best settings: no others are both cheaper and at
    least as good. `recommended` has the cheapest of them that keep the reward and fit, or None.
    """

    def __init__(
        self,
        values: Mapping[str, Any],
        compiled: Compiled | None = None,
        shared_command: str | None = None,
    ):
        super().__init__(values)
        self._compiled, self._shared_command = compiled, shared_command

    @property
    def strategies(self) -> list[dict[str, Any]]:
        """Name, jobs, executions, QPU seconds and price of each way."""
        strategies: list[dict[str, Any]] = self.to_dict()["strategies"]
        return strategies

    @property
    def frontier(self) -> list[dict[str, Any]]:
        """Settings, jobs, seconds and reward of the best settings; empty without a limit."""
        frontier: list[dict[str, Any]] = self.to_dict().get("frontier", [])
        return frontier

    @property
    def recommended(self) -> dict[str, Any] | None:
        """The cheapest settings that keep the reward and fit, with their `command`."""
        chosen: dict[str, Any] | None = self.to_dict().get("recommended")
        return chosen

    def plot(self, style: AnyStyle = None) -> Figure:
        """The QPU seconds of each way, or reward against seconds, on a logarithmic scale.

        Raises:
            FigureError: the style cannot be read.
        """
        draw = draw_frontier if "frontier" in self.to_dict() else draw_seconds
        return draw(self.to_dict(), style)

    def document(self, command: str) -> Document:
        return plan_document(
            self.to_dict(),
            self.table(),
            self.plot,
            self._compiled,
            remark=self.remark,
            recommended=self._shared_command,
            command=command,
        )

    @property
    def remark(self) -> str:
        values = self.to_dict()
        return advice(values) if "frontier" in values else ""

    def check_fits(self) -> None:
        """Check that some settings fit the limit of seconds, if there is one.

        Raises:
            BudgetError: nothing fits; the message says what would.
        """
        values = self.to_dict()
        if values.get("frontier") and self.recommended is None:
            raise BudgetError(*advice(values).split("\n"))

    def table(self) -> Table:
        """A row for each way, or for each point of the frontier."""
        if "frontier" in self.to_dict():
            return frontier_table(self.to_dict())
        forms = {
            "jobs": ("jobs", "{:,}"),
            "executions": ("executions", "{:,}"),
            "QPU seconds": ("qpu_seconds", "{:,.1f}"),
            "USD": ("price_usd", "{:,.0f}"),
            "of free plan": ("share_of_free_plan", "{:,.0%}"),
        }
        rows = []
        for way in self.strategies:
            cells = [
                Cell(form.format(way[key]).replace("%", " %"), (way[key],))
                for key, form in forms.values()
            ]
            rows.append([way["name"], *cells])
        return Table([Column("way", right=False), *map(Column, forms)], rows)


@checked
def plan(
    policy: Name | Policy | Sequence[Name | Policy] = "lunarlander",
    backend: Name | Device | Calibration | Backend | Executor | Any = "ibm_lima",
    *,
    shots: int | None = None,
    episodes: int = 1,
    seed: int = 0,
    level: int = 2,
    mitigation: str | None = None,
    calibration: Name | Calibration | None = None,
    calibration_shots: int | Literal["auto"] | None = None,
    copies: int | None = None,
    split: bool | None = None,
    max_steps: int | None = None,
    within: float | None = None,
    keep: float = KEEP,
    imports: Name | Sequence[Name] = (),
    env: Mapping[str, Any] | None = None,
    usd_per_second: float = USD_PER_SECOND,
    live: bool = False,
    account: str | None = None,
    instance: str | None = None,
    progress: bool = True,
    on_note: Words = ignore,
) -> Plan:
    """Estimate what episodes with a policy cost on a machine, and find the cheapest settings.

    The episodes are played on the backend's noise model, or on a twin of the machine; on the
    machine they may be longer or shorter. Nothing is sent. The cost includes calibrating for
    `mitigation` (None: readout, or what `calibration` has), except for the paper's way; a given
    `calibration`, or that of a twin, costs nothing. If None, `shots` and `calibration_shots` are
    8192 and `copies` is as many as fit on the device.

    With `within`, a number of QPU seconds, the cheapest settings are found that fit and keep the
    reward. Settings fit if the upper end of their 80 % interval is within the limit. They keep the
    reward if it is at least the share `keep` of what the policy (the best of several) earns without
    noise, counted from the reward of random actions. Settings that are not None stay as given.

    `imports` are modules that register environments, `env` are arguments of the policy's
    environment. `usd_per_second` is the price of a QPU second beyond the free plan; the default
    comes from a third party. With `live` the machine's qubits are read from IBM, which spends
    nothing; `account` and `instance` are those of `Live`. `on_note` is called with messages for the
    user.

    Raises:
        OptionError: options contradict each other.
        QcompileError: a name, a file or a combination cannot be used.
    """
    if shots_of(1 if shots is None else shots) is None:
        raise OptionError("A plan needs a number of shots: a machine cannot give exact values.")
    for name, value in (("account", account), ("instance", instance)):
        if value is not None and not live:
            raise OptionError(f"{option(name)} needs {option('live')}.")
    names = several(policy)
    if within is None and (len(names) != 1 or keep != KEEP):
        what = f"{option('keep')} needs" if len(names) == 1 else f"{len(names)} policies need"
        raise OptionError(f"{what} {option('within')}, a limit of QPU seconds.")
    reads = {
        "the policy": [*map(policy_path, names)],
        option("backend"): backend_path(backend),
        option("calibration"): path_of(calibration),
        option("imports"): [*map(module_path, several(imports))],
    }
    check_clashes(reads, {})
    import_modules(several(imports))
    policies = [with_arguments(load_circuits(name), env, for_file=True) for name in names]
    opened = _opened(backend, account, instance, live=live)
    given = {
        "shots": shots,
        "copies": copies,
        "split": split,
        "calibration_shots": calibration_shots,
        "max_steps": max_steps,
    }
    given = {name: value for name, value in given.items() if value is not None}
    values_of = {"seed": seed, "level": level, "mitigation": mitigation}
    settings = _settings(opened, calibration, on_note, **values_of)
    searched = None
    if within is None:
        RunSettings.of(settings, copies=copies, split=bool(split)).check_shared(episodes)
    else:
        goal = Goal(settings, episodes, within, keep, given)
        title = f"planning for {opened.device.name}"
        with bars.progress_bar(title, 1.0, enabled=progress) as show:
            searched = search(policies, opened, goal, show)
    point = None if searched is None else searched.recommended
    chosen = policies[0] if point is None else point.policy
    settings = RunSettings.of(settings, **{"shots": _SHOTS, "copies": copies, **given})
    task = run_task(chosen, opened.device, settings, episodes, backend=opened.device.name)
    forecasted = forecast(task, opened)
    values: dict[str, Any] = {
        "policy": task.policy.name,
        "backend": opened.device.name,
        "shots": task.shots,
        "episodes": episodes,
        "copies": task.copies,
        "hold": chosen.hold,
        **forecasted.player.sizes(),
        "decisions": forecasted.decisions,
        "env_steps": forecasted.env_steps,
        "usd_per_second": usd_per_second,
        "free_seconds": FREE_SECONDS,
        "strategies": [way.values(usd_per_second) for way in strategies(task, forecasted)],
    }
    shared_command = None
    if searched is not None:
        words = dict(zip(map(id, policies), names, strict=True))
        spend = {"max-qpu-seconds": within, "account": account, "instance": instance}

        def command(point: Point, named: Callable[[str], str] = str) -> str | None:
            typed = words[id(point.policy)], backend, calibration or ""
            if not all(isinstance(word, str | PathLike) for word in typed):
                return None  # an object has no name to type
            policy, machine, _ = map(str, typed)
            modules = [*map(str, several(imports))]
            shown = spend if named is str else _without_account(spend)
            return run_command(point, policy, machine, modules, env, shown if live else {}, named)

        way, reward = values["strategies"][0], float(forecasted.rewards.mean())
        values["paper"] = way | {"shots": task.shots, "mean_reward": reward}
        values |= within_values(searched, command)
        shared_command = None if point is None else command(point, without_folders)
    played = task if point is None else point.settings
    compiled = Compiled(
        chosen,
        opened.device,
        task.level,
        played.copies or 1,
        opened.calibration,
        shots=played.shots,
    )
    return Plan(values, compiled, shared_command)


def _without_account(spend: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a live run as a page shows them."""
    return {
        name: HIDDEN if name in PRIVATE and value is not None else value
        for name, value in spend.items()
    }


def _opened(
    backend: Any, account: str | None, instance: str | None, *, live: bool
) -> Backend | Executor:
    """The simulation that stands in for the machine: its noise model, or its twin."""
    if live and not isinstance(backend, str):
        raise OptionError("A live plan needs the name of an IBM machine.")
    source = Connection(backend, account, instance).device() if live else backend
    opened: Backend | Executor = load_backend(source)
    if opened.calibration is None:  # not a twin
        opened = DeviceBackend(opened.device)
    if opened.device.is_ideal:
        raise DeviceError(
            "ideal is not a machine: it costs nothing.",
            "Name a device; `qcompile backends` lists some.",
        )
    return opened


def _settings(
    backend: Backend | Executor, calibration: Any, on_note: Words, **values: Any
) -> RunSettings:
    """The settings for the machine, with the given calibration or the twin's."""
    known = calibration_settings(calibration, on_note)
    known["calibration"] = known["calibration"] or backend.calibration
    return RunSettings.of(**values, **known).resolved(backend.device)
