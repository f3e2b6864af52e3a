"""Training by proximal policy optimisation: collect, learn, report, resume."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from qcompile.errors import TrainingError
from qcompile.notebook import count
from qcompile.policy import Ansatz, AnyPolicy, Policy
from qcompile.policy.files import trained_name
from qcompile.rl.acting_noise import ActingNoise
from qcompile.rl.average import Average
from qcompile.rl.draw import draw_actions
from qcompile.rl.learner import Learner
from qcompile.rl.models import (
    CircuitModel,
    Model,
    make_critic,
    make_model,
)
from qcompile.rl.models.wiring import reads_bits
from qcompile.rl.normalise import Normaliser
from qcompile.rl.pause import Pause
from qcompile.rl.result import TrainingResult
from qcompile.rl.rollout import Collector, FinishedEpisode, Rollout
from qcompile.rl.settings import PACKAGES, Settings, plain
from qcompile.rl.training_log import Update
from qcompile.version import versions


class Trainer:
    """Trains an actor (the policy) and a critic in one environment.

    The same environment, settings and seed give the same policy on the same machine with the same
    versions. `arguments` are the environment's arguments, which the policy keeps. `ansatz` holds
    circuits to train in place of a layout.
    """

    def __init__(
        self,
        environment: str,
        settings: Settings,
        seed: int,
        *,
        arguments: Mapping[str, Any] | None = None,
        ansatz: Ansatz | None = None,
    ):
        self.environment, self.settings, self.seed = environment, settings.check(), seed
        self.arguments = dict(arguments or {})
        seeds = np.random.SeedSequence(seed).spawn(4)
        self.ansatz, bits = ansatz, reads_bits(settings, ansatz)
        self._collector = Collector(
            environment, settings.environments, seeds[0], self.arguments, bits, settings.hold
        )
        self._rng = np.random.default_rng(seeds[1])
        self._generator = torch.Generator().manual_seed(int(seeds[2].generate_state(1)[0]))
        features, actions = self._collector.features, self._collector.actions
        self.actor = make_model(settings, features, actions, self._generator, ansatz)
        self._critic = make_critic(settings, features, self._generator, ansatz)
        self._average: Average | None = None
        if settings.average_share:
            copy = make_model(settings, features, actions, torch.Generator(), ansatz)
            self._average = Average(self.actor, copy, settings.average_share)
        self.normaliser = Normaliser(self.actor, features) if settings.normalise else None
        self._pause = Pause(settings.pause_at)
        self._noise: ActingNoise | None = None
        is_exact = (settings.backend, settings.shots) == ("ideal", None)
        if isinstance(self.actor, CircuitModel) and not is_exact:
            self._noise = ActingNoise(self.actor, settings, seeds[3])
        self._learner = Learner(
            self.actor, self._critic, settings, self._generator, self._model_inputs, self._noise
        )
        self.last_update: Update | None = None

    def __repr__(self) -> str:
        done = f"{count(len(self.history), 'episode')}, {self.progress:.0%} of the training"
        return f"Trainer({self.environment}, {self.settings.model}, seed {self.seed}, {done})"

    @property
    def model(self) -> Model:
        """The final model of the training: the actor, or its average."""
        return self.actor if self._average is None else self._average.model

    @property
    def steps(self) -> int:
        """The number of environment steps taken."""
        return self._collector.steps

    @property
    def decisions(self) -> int:
        """The number of decisions taken, each held for one or more steps."""
        return self._collector.decisions

    @property
    def history(self) -> list[FinishedEpisode]:
        """Every finished episode."""
        return self._collector.history

    @property
    def progress(self) -> float:
        """The completed fraction of the run, in [0, 1]."""
        return self._share(self.settings.steps, self.settings.episodes)

    def _share(self, steps: int | None, episodes: int | None) -> float:
        """The spent fraction of a budget of steps, episodes or both, in [0, 1]."""
        budgets = ((self.steps, steps), (len(self.history), episodes))
        return min(max(done / budget for done, budget in budgets if budget is not None), 1.0)

    def train(
        self,
        on_episode: Callable[[FinishedEpisode, float], None] = lambda episode, progress: None,
        on_update: Callable[[], object] = lambda: None,
    ) -> TrainingResult:
        """Train until the settings' budget is spent, or until Ctrl-C.

        `on_episode` is called with each finished episode and the progress of the run. `on_update`
        is called after each rollout and its update: it may call `state`, and ends the training by
        returning False. After an error, `result` has the actor as of the last complete update.

        Raises:
            EnvironmentStepError: an environment fails or returns unusable values.
            TrainingError: an update leads to infinite or NaN parameters.
        """
        interrupted = False
        threads = torch.get_num_threads()
        torch.set_num_threads(1)  # the tensors are small: threads cost more than they save
        try:
            while self.progress < 1.0:
                rollout = self._collector.collect(self._act, self.settings.horizon)
                for episode in rollout.finished:
                    on_episode(episode, self.progress)
                if self.normaliser is not None:
                    self.normaliser.store_statistics()
                if not self._pause.skips(rollout.finished, self.actor):
                    self._update(rollout)
                elif self._noise is not None:
                    self._noise.take_residuals()
                if on_update() is False:
                    break
        except KeyboardInterrupt:
            interrupted = True
        finally:
            torch.set_num_threads(threads)
            self._collector.close()
            if self._pause.best is not None:
                self.actor.load_state_dict(self._pause.best)
        return self.result(interrupted)

    def result(self, interrupted: bool = False) -> TrainingResult:
        """The result of the training so far."""
        return TrainingResult(self.model, self.policy(), self.history, self.steps, interrupted)

    def policy(self) -> AnyPolicy:
        """The current policy."""
        model = self.model
        metadata: dict[str, Any] = {
            "seed": self.seed,
            "episodes": len(self.history),
            "steps": self.steps,
            "settings": plain(self.settings),
            "versions": versions(*PACKAGES),
        }
        if self.ansatz is not None and isinstance(model, CircuitModel):
            metadata["circuits"] = model.circuits_metadata()
        if self.arguments:
            metadata["environment_kwargs"] = self.arguments
        name = trained_name(self.environment)
        policy: AnyPolicy = model.policy(name, self.environment, metadata)
        policy = replace(policy, environment_kwargs=self.arguments, hold=self.settings.hold)
        if isinstance(policy, Policy):
            temperature = self.settings.temperature
            weights, bias = policy.weights / temperature, policy.bias / temperature
            policy = replace(policy, weights=weights, bias=bias)
        return policy if self.normaliser is None else self.normaliser.deployed(policy)

    def _act(self, observations: NDArray[np.floating]) -> NDArray[np.intp]:
        with torch.no_grad():
            model = self.actor if self._noise is None else self._noise.act
            logits = model(self._model_inputs(observations)).numpy()
        return draw_actions(logits, self._rng)

    def _model_inputs(self, observations: NDArray[np.floating]) -> torch.Tensor:
        """Observations (..., features) as inputs for the models."""
        tensor = torch.from_numpy(observations)
        return tensor if self.normaliser is None else self.normaliser(tensor)

    def _update(self, rollout: Rollout) -> None:
        left, settings = 1.0, self.settings
        if settings.anneal:
            left -= self._share(settings.anneal_steps, settings.anneal_episodes)
        try:
            figures = self._learner.learn(rollout, left)
        except FloatingPointError as error:
            raise TrainingError(
                f"Learning diverged after {len(self.history)} episodes: {error}.",
                "Try smaller step sizes, or smaller rewards.",
            ) from error
        self.last_update = Update(self.steps, len(self.history), *figures)
        if self._average is not None:
            self._average.add(self.actor)
        if self.normaliser is not None:
            self.normaliser.add(rollout.observations)

    def state(self) -> dict[str, Any]:
        """Everything `restore` needs to resume bit for bit, as tensors and plain values."""
        return {
            "actor": deepcopy(self.actor.state_dict()),
            "critic": deepcopy(self._critic.state_dict()),
            "generator": self._generator.get_state(),
            "rng": self._rng.bit_generator.state,
            "collector": self._collector.state(),
            "pause": self._pause.state(),
            "average": None if self._average is None else self._average.state(),
            "noise": None if self._noise is None else self._noise.state(),
            "normaliser": None if self.normaliser is None else self.normaliser.state(),
            **self._learner.state(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Resume from the state of a trainer with the same environment, settings and seed.

        Raises:
            TrainingError: the optimiser's state does not fit the models, or an environment does not
                return to its state.
        """
        self.actor.load_state_dict(state["actor"])
        self._critic.load_state_dict(state["critic"])
        self._generator.set_state(state["generator"])
        self._rng.bit_generator.state = state["rng"]
        self._pause.restore(state["pause"])
        if self._average is not None:
            self._average.restore(state["average"])
        if self._noise is not None:
            self._noise.restore(state["noise"])
        if self.normaliser is not None:
            self.normaliser.restore(state["normaliser"])
        self._collector.restore(state["collector"])
        self._learner.restore(state, self._collector)
