"""Play episodes with a policy on a backend: what `qcompile run` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Literal

from qcompile.calibration import Calibration
from qcompile.caller import option
from qcompile.clashes import check_clashes
from qcompile.deploy.depth import Speculate
from qcompile.deploy.filming import Frame
from qcompile.deploy.lockstep import Episode
from qcompile.deploy.network import refuse_options
from qcompile.deploy.play import play, player
from qcompile.deploy.player import Player
from qcompile.deploy.registration import import_modules, module_path
from qcompile.deploy.settings import RunSettings
from qcompile.device import Device, backend_path
from qcompile.errors import OptionError
from qcompile.execution import Backend, Executor, load_backend
from qcompile.mitigation import CALIBRATION_SHOTS
from qcompile.mitigation.misfit import misfit_warnings
from qcompile.notebook import reward_text
from qcompile.page.circuits import Compiled
from qcompile.planning.strategies import forecast, run_task
from qcompile.policy import AnyPolicy, Network, Policy, load_circuits, load_policy
from qcompile.policy.arguments import with_arguments
from qcompile.policy.files import policy_path
from qcompile.report import progress as bars
from qcompile.report.film import Film, check_suffix
from qcompile.report.scene import Scene
from qcompile.sweep.arguments import Name, Planned, Shots, Words, ignore, several, shots_of
from qcompile.verbs.arguments import calibration_settings, checked
from qcompile.verbs.files import path_of
from qcompile.verbs.live import Live, check_live, spend
from qcompile.verbs.proposal import explicit_only, live_settings, offline
from qcompile.verbs.run_result import RunResult

_SHOTS, _SPECULATE, _SPLIT = Planned(8192), Planned(1), Planned(False)
_CALIBRATION_SHOTS = Planned(CALIBRATION_SHOTS)
_SHOWN_EVERY = 20


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

    Policy and backend are names, files or objects; a Qiskit backend is simulated by the noise model
    of its calibration, or run through `sampler`, a SamplerV2. The settings are those of
    `RunSettings`. Shots None or "exact" are exact expectations. Mitigation None is `none` on
    `ideal` and `readout` on a noisy backend, which is calibrated first with `calibration_shots`
    unless `calibration` is given. `split` spreads the shots of a decision over `copies` of the
    circuits. `speculate` is the number of decisions of each episode that one job measures, along
    predicted actions, or "auto". A network plays only on `ideal`, exactly, and takes no settings of
    circuits. The same seed gives the same result; episode i resets its environment with seed + i.
    `imports` are modules or files that register environments; `env` sets arguments of the
    environment and overrides those of the policy. `video` films the first episode, with the
    `<Z>` and the probabilities behind its actions: .mp4, .gif or .webm.

    With `live` the circuits run on the IBM machine of that name, which costs money: see `Live`. If
    `shots` is not set, a plan chooses the cheapest settings within the limit that keep 97 % of the
    reward; settings that are set stay as they are. `speculate` and `calibration_shots` are then
    "auto". `on_note` is called with messages for the user.

    Raises:
        OptionError: options contradict each other.
        QcompileError: a name, a file or a combination cannot be used.
    """
    plannable = {
        "shots": shots,
        "calibration_shots": calibration_shots,
        "copies": copies,
        "split": split,
        "speculate": speculate,
        "max_steps": max_steps,
    }
    values = offline(plannable)
    settings = _settings(
        episodes,
        video,
        live,
        sampler,
        **values | {"shots": shots_of(values["shots"])},
        seed=seed,
        level=level,
        mitigation=mitigation,
        predistort=predistort,
        greedy=greedy,
    )
    reads = {
        "the policy": policy_path(policy),
        option("backend"): backend_path(backend),
        option("calibration"): path_of(calibration),
        option("imports"): [*map(module_path, several(imports))],
    }
    check_clashes(reads, {option("video"): path_of(video)})
    import_modules(several(imports))
    loaded = with_arguments(load_policy(policy), env, for_file=live is not None)
    settings = RunSettings.of(settings, **calibration_settings(calibration, on_note))
    if live is not None:
        circuits, explicit = load_circuits(loaded), explicit_only(plannable)
        return _run_live(circuits, backend, settings, explicit, episodes, live, on_note)
    if isinstance(loaded, Network) and sampler is not None:
        refuse_options(loaded, ["sampler"])
    opened = load_backend(backend, sampler=sampler)
    bar = bars.progress_bar(f"{loaded.name} on {opened.device.name}", episodes, enabled=progress)
    film = None if video is None else Film(Path(video))
    with bar as show, film or nullcontext():
        playing = _player(loaded, opened, settings, show)
        rewards: list[float] = []

        def count(episode: Episode) -> None:
            rewards.append(episode.reward)
            show(len(rewards), f"mean reward {reward_text(sum(rewards) / len(rewards))}")

        result = play(
            playing,
            episodes,
            complete=True,
            on_episode=count,
            on_frame=None if film is None else _filming(film, playing, show),
            on_note=on_note,
        )
        if film is not None:
            if not result.episodes:
                film.keep_earlier()
            show(len(rewards), "writing the film")
    if film is not None:
        on_note(_film_words(film))
    settings = playing.settings
    compiled = Compiled(
        loaded,
        opened.device,
        settings.level,
        settings.copies or 1,
        opened.calibration,
        shots=settings.shots,
    )
    clip = None if film is None else film.clip
    return RunResult(result.summary(), episodes, compiled, clip)


def _film_words(film: Film) -> str:
    """Where the film is, or why there is none."""
    if film.clip is not None:
        return f"film of the first episode in {film.path}"
    if film.frames:
        return f"no film: no episode was finished, and {film.path} is kept"
    return "no film: no step was played"


def _filming(film: Film, player: Player, show: bars.Show) -> Callable[[Frame], None]:
    """A callback that adds each frame to the film, and shows progress now and then."""
    scene = Scene(player)

    def shoot(frame: Frame) -> None:
        film.add(scene.draw(frame), frame.rate)
        if film.frames % _SHOWN_EVERY == 0:
            show(0, f"filmed {film.frames} steps")

    return shoot


def _settings(
    episodes: int, video: Name | None, live: Live | None, sampler: Any, **values: Any
) -> RunSettings:
    """The settings, checked against the other arguments."""
    settings = RunSettings.of(**values)
    if video is not None:
        check_suffix(Path(video))
    settings.check_shared(episodes)
    check_live(live)
    if live is not None:
        if video is not None:
            raise OptionError(
                f"{option('video')} cannot be combined with {option('live')}: a live run is not "
                "filmed.",
                f"Film the same settings without {option('live')}, on the noise model or the "
                "machine's twin.",
            )
        exact = f"{option('shots')} exact"
        wrong = {exact: settings.shots is None, "sampler": sampler is not None}
        for name in (name for name, given in wrong.items() if given):
            raise OptionError(f"{name} cannot be combined with {option('live')}.")
    return settings


def _player(
    policy: AnyPolicy,
    backend: Backend | Executor,
    settings: RunSettings,
    show: Callable[[float, str], None],
) -> Player:
    """Open what plays the policy; `show` is told what happens before the first episode."""
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
    explicit: Mapping[str, Any],
    episodes: int,
    live: Live,
    on_note: Words,
) -> RunResult:
    """Plan the run on the noise model of the machine today, ask for confirmation, and play it."""
    if not isinstance(backend, str):
        raise OptionError("A live run needs the name of an IBM machine.")
    connection = live.connection(backend)
    device = connection.device()
    limit_s = live.max_qpu_seconds
    settings = live_settings(policy, device, settings, explicit, episodes, limit_s, on_note)
    task = run_task(policy, device, settings, episodes, backend=backend, **live.where)
    forecasted = forecast(task)
    if (counted := forecasted.player.calibration_shots) is not None:
        task = task.model_copy(update={"calibration_shots": counted})  # resuming needs the number
    if task.calibration is not None:
        for words in misfit_warnings(forecasted.player.misfits):
            on_note(f"{task.calibration_file or 'the calibration'}: {words}")
    values = spend(task, forecasted.total_load, live, connection, on_note)
    compiled = Compiled(policy, device, task.level, task.copies or 1, shots=task.shots)
    return RunResult(values, episodes, compiled)
