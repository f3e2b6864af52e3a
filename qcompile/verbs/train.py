"""Train a policy: what `qcompile train` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Literal

from qcompile.deploy.registration import environment_id, import_modules
from qcompile.errors import EnvironmentStepError, OptionError, QcompileError, TrainingError
from qcompile.report import progress as bars
from qcompile.sweep.arguments import Name, Words, ignore, several
from qcompile.verbs.arguments import checked
from qcompile.verbs.files import path_of
from qcompile.verbs.train_outputs import TrainingOutputs
from qcompile.verbs.train_settings import PRESET, TrainingRequest
from qcompile.verbs.training import Training

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec
    from qiskit.circuit import QuantumCircuit

    from qcompile.ir import Program
    from qcompile.policy import Ansatz, Policy

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
    circuits: Name | Ansatz | Program | Policy | QuantumCircuit | None = None,
    init: Name | Policy | None = None,
    imports: Name | Sequence[Name] = (),
    env: Mapping[str, Any] | None = None,
    evaluate_every: int | None = None,
    evaluate_episodes: int | None = None,
    log: Name | None = None,
    tensorboard: Name | None = None,
    checkpoint: Name | None = None,
    resume: Name | None = None,
    out: Name | None = None,
    progress: bool = True,
    on_note: Words = ignore,
) -> Training:
    """Train a policy in an environment with PPO.

    The environment is a registered id, an EnvSpec or what makes it: a class is registered as
    CLASS-v0, a function as FUNCTION-v0, a lambda as CLASS-v0 of what it makes. `imports` are
    modules, names or files, that register environments; `env` are arguments that the environment is
    made with, which the policy keeps.

    `model` is svqc (the default), mvqc, fcn, cnn or surrogate; `preset` tuned (the default) or
    paper; `layout` parallel (the default), serial or single; `reuse` the copies of each output;
    `seed` 0. `episodes` and `steps` end the training sooner or later than the preset does;
    `settings` changes others of its settings by name. On a `backend` with noise the policy learns
    under it: with 1024 shots and mitigation readout, unless `shots` (a number or "exact") and
    `mitigation` say otherwise.

    `circuits` are trained in place of a layout: those of a policy with its encoder and its numbers
    as a start, of an OpenQASM file, a Program, an Ansatz or a Qiskit circuit; the head is new.
    `init` starts from a policy with its head. Settings of such circuits are `features`, `encoder`,
    `scales`, `trainable_scale` and `trainable_gain`.

    After every `evaluate_every` episodes it plays `evaluate_episodes` (20) test episodes. `log` is
    a CSV file, `tensorboard` a folder, `checkpoint` a file from which `resume` continues; settings
    then come from the checkpoint. `out` is the file of the policy, .pt or .json, overwritten;
    without it the policy is in the result alone. Ctrl-C, or an environment that fails, ends the
    training and keeps what was trained: see `Training.check_complete`.

    Raises:
        OptionError: options contradict each other.
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
        circuits=circuits,
        init=init,
        env=env or {},
    )
    if evaluate_episodes is not None and evaluate_every is None:
        raise OptionError("evaluate-episodes needs evaluate-every: how often they are played.")
    state = path_of(resume)
    trainer = request.trainer() if state is None else request.resumed(state, on_note)
    outputs = TrainingOutputs(
        path_of(out), path_of(checkpoint) or state, path_of(log), state, path_of(tensorboard)
    )
    outputs.check(trainer)
    from qcompile.rl.training_log import EpisodeLog, Scalars
    from qcompile.rl.watch import Watch

    if trainer.progress >= 1.0:
        on_note(f"The training of {resume} was finished; only its outputs are made.")
    failure: QcompileError | None = None
    with ExitStack() as stack:
        show = stack.enter_context(bars.progress_bar(request.environment, 1.0, enabled=progress))
        count = EVALUATION_EPISODES if evaluate_episodes is None else evaluate_episodes
        watch = Watch(trainer, show, outputs.checkpoint, evaluate_every, count)
        if outputs.tensorboard is not None:
            watch.scalars = stack.enter_context(Scalars(outputs.tensorboard, trainer.steps))
        if outputs.log is not None:
            watch.log = stack.enter_context(EpisodeLog(outputs.log, trainer.history))
        try:
            result = watch.train()
        except (EnvironmentStepError, TrainingError) as error:
            if not watch.has_learned:
                hint = "Nothing was learned by then"
                raise error.with_hints(
                    f"{hint}." if out is None else f"{hint}: {out} is not written."
                ) from error
            failure, result = error, trainer.result(interrupted=True)
    policy = outputs.write(result.policy, watch)
    return Training(
        trainer=trainer,
        policy=policy,
        watch=watch,
        outputs=outputs,
        imports=modules,
        preset=None if state else preset or PRESET,
        interrupted=result.interrupted,
        failure=failure,
    )
