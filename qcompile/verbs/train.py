"""Train a policy: what `qcompile train` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from qcompile.caller import option
from qcompile.deploy.registration import environment_id, import_modules, module_path
from qcompile.device import backend_path
from qcompile.errors import OptionError
from qcompile.policy.files import policy_path
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

    The environment is a registered id, an EnvSpec, or a class or function that makes it. A class is
    registered as CLASS-v0, a function as FUNCTION-v0, and a lambda as CLASS-v0 after the class that
    it makes. `imports` are modules or files that register environments; `env` are arguments of the
    environment, which are saved with the policy.

    `model` is svqc (the default), mvqc, fcn, cnn or surrogate. `preset` is tuned (the default),
    paper, or hardware, which trains svqc under noise and holds each action for several steps.
    `layout` is parallel (the default), serial or single; `reuse` is the number of copies of each
    output; `seed` is 0 by default. `episodes` and `steps` end the training earlier or later than
    the preset does; `settings` changes its other settings by name. On a noisy `backend` the policy
    is trained under noise, with 1024 shots and mitigation readout unless `shots` (a number or
    "exact") and `mitigation` are set. Each action is repeated for `hold` environment steps, also
    when the policy is played later; the default is that of the policy in `init`, or the preset's.

    `circuits` are trained instead of a layout, with a new head: those of a policy, with its encoder
    and its parameters to start from, of an OpenQASM file, a Program, an Ansatz or a Qiskit circuit.
    The model is then svqc, or mvqc if a circuit has several qubits.
    `init` starts from a policy and keeps its head. Settings of such circuits are `features`,
    `encoder`, `scales`, `trainable_scale` and `trainable_gain`.

    With `seeds`, that many trainings run, `workers` at a time, with seeds starting at `seed`. Each
    trained model plays `evaluation` (100) episodes. The result is the best by their mean; its
    `trainings` are all of them: see `Trainings`.

    After every `evaluate_every` episodes, `evaluate_episodes` (20) test episodes are played.
    `callback` is called after each episode, update and evaluation, with a dict of scalars and the
    number of steps so far; the training ends if it returns False. An error in it is raised after
    the files are written. `log` is a CSV file, `tensorboard` a folder, and `checkpoint` a file to
    `resume` from, with the settings in the checkpoint. `out` is the policy file, .pt or .json;
    without it the policy is only in the result. `force` overwrites `out` and `checkpoint`; existing
    files are refused otherwise, except those of the training that is resumed. After Ctrl-C or an
    error in the environment, what was trained so far is kept: see `Training.check_complete`.

    Raises:
        OptionError: options contradict each other.
        OutputError: a file already exists, or cannot be written.
        QcompileError: an environment, settings or files cannot be used; an environment fails before
            anything was learned.
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
        raise OptionError(f"{option('evaluate_episodes')} needs {option('evaluate_every')}.")
    state = path_of(resume)
    outputs = TrainingOutputs(
        out=path_of(out),
        checkpoint=path_of(checkpoint) or state,
        log=path_of(log),
        resume=state,
        tensorboard=path_of(tensorboard),
        force=force,
        reads={
            option("init"): policy_path(init),
            option("circuits"): policy_path(circuits),
            option("backend"): backend_path(backend),
            option("imports"): [*map(module_path, modules)],
        },
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
            raise OptionError(f"{option(name)} needs {option('seeds')}, the number of trainings.")
    trainer = request.trainer() if state is None else request.resumed(state, on_note)
    outputs.check(trainer)
    if trainer.progress >= 1.0:
        on_note(f"The training in {resume} is finished; only its output files are written.")
    with bars.progress_bar(request.environment, 1.0, enabled=progress) as show:
        return train_one(trainer, outputs, watch, show)
