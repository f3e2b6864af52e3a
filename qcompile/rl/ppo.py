"""A training by proximal policy optimisation: collect, learn, follow, resume."""

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
from qcompile.rl.acting_noise import ActingNoise
from qcompile.rl.average import Average
from qcompile.rl.draw import draw_actions
from qcompile.rl.learner import Learner
from qcompile.rl.models import (
    SVQC,
    NetworkModel,
    SurrogateModel,
    make_critic,
    make_model,
    parameter_count,
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
    """Trains an actor, the policy, and a critic, its judge, in one environment.

    The same environment, settings and seed give the same policy on the same machine and versions.
    `arguments` are those that the environment is made with; the policy keeps them. `ansatz` are
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
            twin = make_model(settings, features, actions, torch.Generator(), ansatz)
            self._average = Average(self.actor, twin, settings.average_share)
        self.normaliser = Normaliser(self.actor, features) if settings.normalise else None
        self._pause = Pause(settings.pause_at)
        self._noise: ActingNoise | None = None
        if isinstance(self.actor, SVQC) and (settings.backend, settings.shots) != ("ideal", None):
            self._noise = ActingNoise(self.actor, settings, seeds[3])
        self._learner = Learner(
            self.actor, self._critic, settings, self._generator, self._seen, self._noise
        )
        self.last_update: Update | None = None

    def __repr__(self) -> str:
        done = f"{count(len(self.history), 'episode')}, {self.progress:.0%} of the training"
        return f"Trainer({self.environment}, {self.settings.model}, seed {self.seed}, {done})"

    @property
    def model(self) -> torch.nn.Module:
        """The model that the training hands over: the actor, or its average."""
        return self.actor if self._average is None else self._average.model

    @property
    def steps(self) -> int:
        """Environment steps taken."""
        return self._collector.steps

    @property
    def decisions(self) -> int:
        """Decisions taken, each held for one step or more."""
        return self._collector.decisions

    @property
    def history(self) -> list[FinishedEpisode]:
        """Every finished episode."""
        return self._collector.history

    @property
    def progress(self) -> float:
        """How much of the run is done, in [0, 1]."""
        return self._share(self.settings.steps, self.settings.episodes)

    def _share(self, steps: int | None, episodes: int | None) -> float:
        """How much of a budget of steps, of episodes or of both is spent, in [0, 1]."""
        budgets = ((self.steps, steps), (len(self.history), episodes))
        return min(max(done / budget for done, budget in budgets if budget is not None), 1.0)

    @property
    def observation_dtype(self) -> np.dtype[Any]:
        """In which the models see observations: float32, or float64 where that would round."""
        return self._collector.dtype

    def train(
        self,
        on_episode: Callable[[FinishedEpisode, float], None] = lambda episode, progress: None,
        on_update: Callable[[], object] = lambda: None,
    ) -> TrainingResult:
        """Train until the budget of the settings is spent, or until Ctrl-C.

        `on_episode` is called with each finished episode and the progress of the run, `on_update`
        after each rollout and what was learned from it: there `state` can be taken, and False ends
        the training. After an error the actor is as it was after the last whole update, and
        `result` has it.

        Raises:
            EnvironmentStepError: an environment fails, or gives what no policy can use.
            TrainingError: an update leads to numbers that are not finite.
        """
        interrupted = False
        threads = torch.get_num_threads()
        torch.set_num_threads(1)  # the tensors are small: threads cost more than they bring
        try:
            while self.progress < 1.0:
                rollout = self._collector.collect(self._act, self.settings.horizon)
                for episode in rollout.finished:
                    on_episode(episode, self.progress)
                if self.normaliser is not None:
                    self.normaliser.keep()
                if not self._pause.holds(rollout.finished, self.actor):
                    self._update(rollout)
                elif self._noise is not None:
                    self._noise.taken()
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
        """What the training has come to."""
        return TrainingResult(self.model, self.policy(), self.history, self.steps, interrupted)

    def policy(self) -> AnyPolicy | None:
        """The policy as it is, if it can be played."""
        model = self.model
        if not isinstance(model, SVQC | SurrogateModel | NetworkModel):
            return None
        metadata: dict[str, Any] = {
            "seed": self.seed,
            "episodes": len(self.history),
            "steps": self.steps,
            "settings": plain(self.settings),
            "versions": versions(*PACKAGES),
        }
        if self.ansatz is not None and isinstance(model, SVQC):
            metadata["circuits"] = model.circuits_metadata()
        if self.arguments:
            metadata["environment_kwargs"] = self.arguments
        name = self.environment.rsplit("-v", 1)[0].lower()
        policy = model.policy(name, self.environment, metadata)
        policy = replace(policy, environment_kwargs=self.arguments, hold=self.settings.hold)
        if isinstance(policy, Policy):
            temperature = self.settings.temperature
            weights, bias = policy.weights / temperature, policy.bias / temperature
            policy = replace(policy, weights=weights, bias=bias)
        return policy if self.normaliser is None else self.normaliser.deployed(policy)

    @property
    def parameter_count(self) -> int:
        """The numbers of the actor that are trained, copies of output reuse folded."""
        return parameter_count(self.actor)

    def _act(self, observations: NDArray[np.floating]) -> NDArray[np.intp]:
        with torch.no_grad():
            model = self.actor if self._noise is None else self._noise.act
            logits = model(self._seen(observations)).numpy()
        return draw_actions(logits, self._rng)

    def _seen(self, observations: NDArray[np.floating]) -> torch.Tensor:
        """Observations (..., features) as the models see them."""
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
        """All that `restore` needs to resume bit for bit, tensors and plain values."""
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
            TrainingError: the optimiser's state is that of other models, or an environment does
                not come to where it was.
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
