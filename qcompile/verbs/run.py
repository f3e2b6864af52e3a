"""Play episodes with a policy on a backend: what `qcompile run` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Literal

from qcompile.calibration import Calibration
from qcompile.deploy.depth import Speculate
from qcompile.deploy.lockstep import Episode
from qcompile.deploy.network import refuse_options
from qcompile.deploy.play import play, player
from qcompile.deploy.player import Player
from qcompile.deploy.registration import import_modules
from qcompile.deploy.settings import RunSettings
from qcompile.device import Device
from qcompile.errors import OptionError, QcompileError
from qcompile.execution import Backend, Executor, load_backend
from qcompile.mitigation import CALIBRATION_SHOTS
from qcompile.mitigation.misfit import misfit_warnings
from qcompile.notebook import reward_text
from qcompile.page.circuits import Compiled
from qcompile.page.document import Document
from qcompile.page.film import film_block
from qcompile.page.run import run_document
from qcompile.planning.strategies import forecast, run_task
from qcompile.policy import AnyPolicy, Network, Policy, load_circuits, load_policy
from qcompile.policy.arguments import with_arguments
from qcompile.report import progress as bars
from qcompile.report.figure import Figure
from qcompile.report.film import SUFFIXES, Film
from qcompile.report.rewards import draw_rewards
from qcompile.report.style import AnyStyle
from qcompile.report.tables import interval_words
from qcompile.sweep.arguments import Name, Planned, Shots, Words, ignore, several, shots_of
from qcompile.verbs.arguments import calibration_settings, checked
from qcompile.verbs.live import Live, check_live, spend
from qcompile.verbs.proposal import given, live_settings, offline
from qcompile.verbs.reports import Reported

_SHOTS, _SPECULATE, _SPLIT = Planned(8192), Planned(1), Planned(False)
_CALIBRATION_SHOTS = Planned(CALIBRATION_SHOTS)


class RunResult(Reported):
    """What a run found. Of an interrupted one the shortest episodes alone are there."""

    def __init__(
        self,
        values: Mapping[str, Any],
        episodes: int,
        compiled: Compiled | None = None,
        video: Path | None = None,
    ):
        super().__init__(values)
        self._asked, self._compiled, self._video = episodes, compiled, video

    @property
    def episodes(self) -> list[dict[str, Any]]:
        """Seed, reward and length of each episode."""
        episodes: list[dict[str, Any]] = self.to_dict()["episodes"]
        return episodes

    @property
    def rewards(self) -> list[float]:
        return [episode["reward"] for episode in self.episodes]

    @property
    def mean_reward(self) -> float | None:
        """None where no episode was finished, or not all that were measured ahead."""
        mean: float | None = self.to_dict()["mean_reward"]
        return mean

    @property
    def mean_reward_completed(self) -> float | None:
        """The mean with cut episodes completed on the noise model; None where none was cut."""
        mean: float | None = self.to_dict()["mean_reward_completed"]
        return mean

    @property
    def ci95(self) -> list[float] | None:
        """The 95 % interval of the mean; None where there is none to be had."""
        interval: list[float] | None = self.to_dict()["ci95"]
        return interval

    def plot(self, style: AnyStyle = None) -> Figure:
        """The reward of each episode, their mean and its interval.

        Raises:
            FigureError: the style cannot be read.
        """
        return draw_rewards(self.to_dict(), style)

    @property
    def table(self) -> tuple[list[str], list[list[str]]]:
        values = self.to_dict()
        mean = "-" if self.mean_reward is None else reward_text(self.mean_reward)
        mitigation = "predistort" if values["predistort"] else values["mitigation"]
        hold = values["hold"]
        row = [values["policy"], values["backend"], values["kind"], str(values["shots"])]
        row += [mitigation, *[str(hold)] * (hold > 1), str(len(self.episodes)), mean]
        columns = ["policy", "backend", "kind", "shots", "mitigation", *["hold"] * (hold > 1)]
        return (
            [*columns, "episodes", "mean reward", "95 % interval"],
            [[*row, interval_words(values) or "-"]],
        )

    def document(self, command: str) -> Document:
        values = self.to_dict()
        film = None
        if self._video is not None:
            film = film_block(self._video, "The first episode", "")
        warnings = [*filter(None, [self.remark]), *misfit_warnings(values["calibration_misfits"])]
        return run_document(
            values, self.plot, self._compiled, film, warnings=warnings, command=command
        )

    @property
    def remark(self) -> str:
        interrupted = f"interrupted: {len(self.episodes)} of {self._asked} episodes were finished"
        return interrupted if self.to_dict()["interrupted"] else ""

    def check_complete(self) -> None:
        """Nothing, if all episodes were played.

        Raises:
            QcompileError: Ctrl-C came before.
        """
        if self.to_dict()["interrupted"]:
            bias = "These are the shortest ones: their mean does not estimate the policy's score."
            if self.to_dict()["speculate"] != 1:
                bias = "These ended first, as their measurements were predicted: they give no mean."
            raise QcompileError(
                f"Interrupted: {len(self.episodes)} of {self._asked} episodes were finished.",
                *([bias] if self.episodes else []),
                "Fewer --episodes end sooner.",
            )


@checked
def run(
    policy: Name | AnyPolicy = "lunarlander",
    backend: Name | Device | Backend | Executor | Any = "ideal",
    *,
    episodes: int = 20,
    shots: Shots | Planned = _SHOTS,
    seed: int = 0,
    level: int = 2,
    mitigation: str | None = None,
    calibration: Name | Calibration | None = None,
    predistort: bool = False,
    calibration_shots: int | Literal["auto"] | Planned = _CALIBRATION_SHOTS,
    copies: int | None = None,
    split: bool | Planned = _SPLIT,
    speculate: Speculate | Planned = _SPECULATE,
    max_steps: int | None = None,
    greedy: bool = False,
    imports: Name | Sequence[Name] = (),
    env: Mapping[str, Any] | None = None,
    sampler: Any = None,
    video: Name | None = None,
    live: Live | None = None,
    progress: bool = True,
    on_note: Words = ignore,
) -> RunResult:
    """Play `episodes` with a policy on a backend, all in lockstep.

    Policy and backend are names, files or objects; a Qiskit backend is played on the noise model of
    its calibration, or through `sampler`, a SamplerV2. The settings are those of `RunSettings`:
    shots None or "exact" are exact expectations; mitigation None is `readout` on a noisy backend,
    calibrated first with `calibration_shots` unless `calibration` is given, and `none` on `ideal`.
    `split` spreads the shots of a row over `copies` of the circuits; `speculate` is the number of
    decisions of each episode that a job measures, along predicted steps, or "auto". A network plays
    on `ideal` alone, exactly, and takes none of the settings of circuits. The same seed gives the
    same result; episode i resets its environment with seed + i. `imports` are modules, names or
    files, that register environments; `env` are arguments of the environment, over those of the
    policy.
    `video` films the first episode, .mp4 or .gif.

    With `live` it is played on IBM's machine of that name, which costs money: see `Live`. Without
    shots its settings then are the plan's, the cheapest within the limit that keep 97 % of the
    reward; what is given is kept, and `speculate` and `calibration_shots` are "auto". `on_note` is
    told what a person should read.

    Raises:
        OptionError: options contradict each other.
        QcompileError: a name, a file or a combination that cannot be played.
    """
    planned = {
        "shots": shots,
        "calibration_shots": calibration_shots,
        "copies": copies,
        "split": split,
        "speculate": speculate,
        "max_steps": max_steps,
    }
    taken = offline(planned)
    settings = _settings(
        episodes,
        video,
        live,
        sampler,
        **taken | {"shots": shots_of(taken["shots"])},
        seed=seed,
        level=level,
        mitigation=mitigation,
        predistort=predistort,
        greedy=greedy,
    )
    import_modules(several(imports))
    loaded = with_arguments(load_policy(policy), env, for_file=live is not None)
    settings = RunSettings.of(settings, **calibration_settings(calibration, on_note))
    if live is not None:
        said = given(planned)
        policy = load_circuits(loaded)
        return _run_live(policy, backend, settings, said, episodes, live, on_note)
    if isinstance(loaded, Network) and sampler is not None:
        refuse_options(loaded, ["sampler"])
    opened = load_backend(backend, sampler=sampler)
    bar = bars.progress_bar(f"{loaded.name} on {opened.device.name}", episodes, enabled=progress)
    with nullcontext() if video is None else Film(Path(video)) as film, bar as show:
        playing = _player(loaded, opened, settings, show)
        rewards: list[float] = []

        def count(episode: Episode) -> None:
            rewards.append(episode.reward)
            show(len(rewards), f"mean reward {reward_text(sum(rewards) / len(rewards))}")

        on_frame = None if film is None else film.add
        result = play(
            playing,
            episodes,
            complete=True,
            on_episode=count,
            on_frame=on_frame,
            on_note=on_note,
        )
    if film is not None:
        words = f"film of the first episode in {video}"
        on_note(words if film.frames else "no step was played: there is no film")
    there = None if film is None or not film.frames else Path(str(video))
    compiled = Compiled(loaded, opened.device, playing.settings.level, playing.settings.copies or 1)
    return RunResult(result.summary(), episodes, compiled, there)


def _settings(
    episodes: int, video: Name | None, live: Live | None, sampler: Any, **values: Any
) -> RunSettings:
    """The settings, if they fit what else is asked for."""
    settings = RunSettings.of(**values)
    if video is not None and Path(video).suffix not in SUFFIXES:
        raise OptionError(f"{video} must end with .mp4 or .gif.")
    settings.check_shared(episodes)
    check_live(live)
    if live is not None:
        wrong = {"video": video is not None, "shots exact": settings.shots is None}
        wrong["sampler"] = sampler is not None
        for name in (name for name, given in wrong.items() if given):
            raise OptionError(f"{name} and live exclude each other.")
    return settings


def _player(
    policy: AnyPolicy,
    backend: Backend | Executor,
    settings: RunSettings,
    show: Callable[[float, str], None],
) -> Player:
    """What plays the policy; `show` is told what is done before the first episode."""
    if isinstance(policy, Policy):
        known = settings.resolved(backend.device, backend.calibration)
        is_measured = known.calibrates and settings.calibration is None
        show(0, "calibrating" if is_measured else "compiling")
    opened = player(policy, backend, settings)
    show(0, "")
    return opened


def _run_live(
    policy: Policy,
    backend: Any,
    settings: RunSettings,
    said: Mapping[str, Any],
    episodes: int,
    live: Live,
    on_note: Words,
) -> RunResult:
    """Plan the run on the noise model of the backend of now, have it confirmed, and play it."""
    if not isinstance(backend, str):
        raise OptionError("A live run needs the name of a machine of IBM's.")
    connection = live.connection(backend)
    device = connection.device()
    limit_s = live.max_qpu_seconds
    settings = live_settings(policy, device, settings, said, episodes, limit_s, on_note)
    task = run_task(policy, device, settings, episodes, backend=backend, **live.where)
    forecasted = forecast(task)
    if (counted := forecasted.player.calibration_shots) is not None:
        task = task.model_copy(update={"calibration_shots": counted})  # as told, and as resumed
    if task.calibration is not None:
        for words in misfit_warnings(forecasted.player.misfits):
            on_note(f"{task.calibration_file or 'the calibration'}: {words}")
    values = spend(task, forecasted.total_load, live, connection, on_note)
    return RunResult(values, episodes, Compiled(policy, device, task.level, task.copies or 1))
