"""Train a policy: what `qcompile train` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from qcompile.deploy.registration import environment_id, import_modules
from qcompile.errors import OptionError
from qcompile.report import progress as bars
from qcompile.sweep.arguments import Name, Words, ignore, several
from qcompile.verbs.arguments import checked
from qcompile.verbs.files import path_of
from qcompile.verbs.train_one import WatchRequest, train_one
from qcompile.verbs.train_outputs import TrainingOutputs
from qcompile.verbs.train_seeds import SeedsRequest, train_seeds
from qcompile.verbs.train_settings import PRESET, TrainingRequest
from qcompile.verbs.training import Training

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec
    from qiskit.circuit import QuantumCircuit

    from qcompile.ir import Program
    from qcompile.policy import Ansatz, AnyPolicy, Policy
    from qcompile.rl.training_log import Callback

EVALUATION_EPISODES = 20


@checked
def train(
    environment: str | EnvSpec | Callable[..., Any],
    *,
    model: str | None = None,
    preset: str | None = None,
    layout: str | None = None,
    reuse: int | None = None,
    seed: int | None = None,
    episodes: int | None = None,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    backend: Name | None = None,
    shots: int | Literal["exact"] | None = None,
    mitigation: str | None = None,
    hold: int | None = None,
    circuits: Name | Ansatz | Program | Policy | QuantumCircuit | None = None,
    init: Name | AnyPolicy | None = None,
    imports: Name | Sequence[Name] = (),
    env: Mapping[str, Any] | None = None,
    evaluate_every: int | None = None,
    evaluate_episodes: int | None = None,
    log: Name | None = None,
    tensorboard: Name | None = None,
    checkpoint: Name | None = None,
    resume: Name | None = None,
    out: Name | None = None,
    force: bool = False,
    seeds: int | None = None,
    evaluation: int | None = None,
    workers: int | None = None,
    callback: Callback | None = None,
    progress: bool = True,
    on_note: Words = ignore,
) -> Training:
    """Train a policy in an environment with PPO.

    The environment is a registered id, an EnvSpec or what makes it: a class is registered as
    CLASS-v0, a function as FUNCTION-v0, a lambda as CLASS-v0 of what it makes. `imports` are
    modules, names or files, that register environments; `env` are arguments that the environment is
    made with, which the policy keeps.

    `model` is svqc (the default), mvqc, fcn, cnn or surrogate; `preset` tuned (the default), paper,
    or hardware (svqc; held decisions, learned under noise); `layout` parallel (the default), serial
    or single; `reuse` the copies of each output; `seed` 0. `episodes` and `steps` end the training
    sooner or later than the preset does; `settings` changes others of its settings by name. On a
    `backend` with noise the policy learns under it: with 1024 shots and mitigation readout, unless
    `shots` (a number or "exact") and `mitigation` say otherwise. Each decision is held for `hold`
    steps of the environment (1, or what the preset or the policy of `init` says), and by the policy
    for good.

    `circuits` are trained in place of a layout: those of a policy with its encoder and its numbers
    as a start, of an OpenQASM file, a Program, an Ansatz or a Qiskit circuit; the head is new.
    `init` starts from a policy with its head. Settings of such circuits are `features`, `encoder`,
    `scales`, `trainable_scale` and `trainable_gain`.

    With `seeds` so many trainings run side by side, `workers` at a time, with the seeds from `seed`
    on. Each plays `evaluation` (100) fresh episodes; the best by their mean is the result, whose
    `trainings` are all: see `Trainings`.

    After every `evaluate_every` episodes it plays `evaluate_episodes` (20) test episodes.
    `callback` is called with scalars by their names, and with the steps taken by then, after each
    episode, update and evaluation; it ends the training where it returns False. What it raises is
    raised once the files are written. `log` is a CSV file, `tensorboard` a folder, `checkpoint` a
    file from which `resume` continues; settings then come from the checkpoint. `out` is the file of
    the policy, .pt or .json; without it the policy is in the result alone. `force` overwrites
    `out` and `checkpoint`; without it, files that are there are refused, but those of the training
    that is resumed. Ctrl-C, or an environment that fails, ends the training and keeps what was
    trained: see `Training.check_complete`.

    Raises:
        OptionError: options contradict each other.
        OutputError: a file that is there already, or cannot be written.
        QcompileError: an environment, settings or files that cannot be used; an environment fails
            before anything was learned.
    """
    modules = several(imports)
    import_modules(modules)
    request = TrainingRequest(
        environment=environment_id(environment),
        model=model,
        preset=preset,
        layout=layout,
        reuse=reuse,
        seed=seed,
        episodes=episodes,
        steps=steps,
        settings=settings or {},
        backend=backend,
        shots=shots,
        mitigation=mitigation,
        hold=hold,
        circuits=circuits,
        init=init,
        env=env or {},
    )
    if evaluate_episodes is not None and evaluate_every is None:
        raise OptionError("evaluate-episodes needs evaluate-every: how often they are played.")
    state = path_of(resume)
    outputs = TrainingOutputs(
        out=path_of(out),
        checkpoint=path_of(checkpoint) or state,
        log=path_of(log),
        resume=state,
        tensorboard=path_of(tensorboard),
        force=force,
    )
    watch = WatchRequest(
        evaluate_every=evaluate_every,
        evaluate_episodes=EVALUATION_EPISODES if evaluate_episodes is None else evaluate_episodes,
        preset=None if state else preset or PRESET,
        imports=modules,
        callback=callback,
    )
    if seeds is not None:
        return train_seeds(
            SeedsRequest(request, outputs, watch, seeds, evaluation), workers, progress, on_note
        )
    for name, value in (("evaluation", evaluation), ("workers", workers)):
        if value is not None:
            raise OptionError(f"{name} needs seeds: how many are trained.")
    trainer = request.trainer() if state is None else request.resumed(state, on_note)
    outputs.check(trainer)
    if trainer.progress >= 1.0:
        on_note(f"The training of {resume} was finished; only its outputs are made.")
    with bars.progress_bar(request.environment, 1.0, enabled=progress) as show:
        return train_one(trainer, outputs, watch, show)
