"""Proximal policy optimisation, in the order of its mathematics: collect, estimate, update."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn.functional import cross_entropy, mse_loss

from qcompile.errors import TrainingError
from qcompile.notebook import count
from qcompile.policy import Policy
from qcompile.rl.acting_noise import ActingNoise
from qcompile.rl.advantage import ReturnScale, generalised_advantage
from qcompile.rl.draw import draw_actions, mean_entropy
from qcompile.rl.flat import FlatParameters
from qcompile.rl.models import SVQC, SurrogateModel, make_critic, make_model, parameter_count
from qcompile.rl.normalise import Normaliser
from qcompile.rl.pause import Pause
from qcompile.rl.result import TrainingResult
from qcompile.rl.rollout import Collector, FinishedEpisode, Rollout
from qcompile.rl.settings import PACKAGES, Settings, plain
from qcompile.rl.training_log import Update
from qcompile.version import versions

_LEAST_RATE = 0.02


class Trainer:
    """Trains an actor, the policy, and a critic, its judge, in one environment.

    The same environment, settings and seed give the same policy on the same machine and versions.
    `arguments` are those that the environment is made with; the policy keeps them.
    """

    def __init__(
        self,
        environment: str,
        settings: Settings,
        seed: int,
        *,
        arguments: Mapping[str, Any] | None = None,
    ):
        self.environment, self.settings, self.seed = environment, settings.check(), seed
        self.arguments = dict(arguments or {})
        seeds = np.random.SeedSequence(seed).spawn(4)
        self._collector = Collector(environment, settings.environments, seeds[0], self.arguments)
        self._rng = np.random.default_rng(seeds[1])
        self._generator = torch.Generator().manual_seed(int(seeds[2].generate_state(1)[0]))
        features, actions = self._collector.features, self._collector.actions
        self.actor = make_model(settings, features, actions, self._generator)
        self._critic = make_critic(settings, features, self._generator)
        self.normaliser = Normaliser(self.actor, features) if settings.normalise else None
        self._learned = [FlatParameters(self.actor), FlatParameters(self._critic)]
        groups = [{"params": [flat.parameter]} for flat in self._learned]
        self._optimiser = torch.optim.Adam(groups, eps=1e-5, fused=True)
        self._scale = ReturnScale(settings.environments, settings.gamma)
        self._pause = Pause(settings.pause_at)
        self._noise: ActingNoise | None = None
        if isinstance(self.actor, SVQC) and (settings.backend, settings.shots) != ("ideal", None):
            self._noise = ActingNoise(self.actor, settings, seeds[3])
        self.last_update: Update | None = None

    def __repr__(self) -> str:
        done = f"{count(len(self.history), 'episode')}, {self.progress:.0%} of the training"
        return f"Trainer({self.environment}, {self.settings.model}, seed {self.seed}, {done})"

    @property
    def steps(self) -> int:
        """Environment steps taken."""
        return self._collector.steps

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
        return TrainingResult(self.actor, self.policy(), self.history, self.steps, interrupted)

    def policy(self) -> Policy | None:
        """The policy as it is, if it can be deployed."""
        if not isinstance(self.actor, SVQC | SurrogateModel):
            return None
        metadata: dict[str, Any] = {
            "seed": self.seed,
            "episodes": len(self.history),
            "steps": self.steps,
            "settings": plain(self.settings),
            "versions": versions(*PACKAGES),
        }
        if self.arguments:
            metadata["environment_kwargs"] = self.arguments
        name = self.environment.rsplit("-v", 1)[0].lower()
        policy = self.actor.policy(name, self.environment, metadata)
        policy = replace(policy, environment_kwargs=self.arguments)
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
        settings, left = self.settings, 1.0
        if settings.anneal:
            left -= self._share(settings.anneal_steps, settings.anneal_episodes)
        numbers = [flat.parameter.detach().clone() for flat in self._learned]
        rates = (settings.actor_lr, settings.critic_lr)
        for group, rate in zip(self._optimiser.param_groups, rates, strict=True):
            group["lr"] = rate * max(left, _LEAST_RATE)
        observations = self._seen(rollout.observations).flatten(0, 1)
        actions = torch.from_numpy(rollout.actions).flatten()
        residual = [] if self._noise is None else [self._noise.taken()]
        with torch.no_grad():
            outputs = self._outputs(observations, *residual)
            before = cross_entropy(outputs, actions, reduction="none")
        columns = [observations, before, actions, *self._advantages_and_targets(rollout), *residual]
        for _ in range(settings.epochs):
            for batch in self._minibatches(columns):
                observations, before, actions, advantage, target, *residual = batch
                outputs = self._outputs(observations, *residual)
                # The cross entropy with the action taken is minus its log-probability.
                ratio = (before - cross_entropy(outputs, actions, reduction="none")).exp()
                clipped = ratio.clamp(1 - settings.clip, 1 + settings.clip)
                gain = torch.minimum(ratio * advantage, clipped * advantage).mean()
                loss = -gain
                if settings.entropy:
                    loss = loss - settings.entropy * left * mean_entropy(outputs)
                critic_loss = mse_loss(self._critic(observations)[:, 0], target)
                self._descend(loss, critic_loss)
        with torch.no_grad():
            if not all(flat.parameter.isfinite().all() for flat in self._learned):
                for flat, whole in zip(self._learned, numbers, strict=True):
                    flat.parameter.copy_(whole)
                raise TrainingError(
                    f"Learning diverged after {len(self.history)} episodes: its numbers are not "
                    "finite.",
                    "Try smaller step sizes, or smaller rewards.",
                )
            losses = -gain.item(), critic_loss.item(), mean_entropy(outputs).item()
            divergence = (ratio - 1 - ratio.log()).mean().item()
            share = (ratio != clipped).float().mean().item()
            self.last_update = Update(self.steps, len(self.history), *losses, divergence, share)
        if self.normaliser is not None:
            self.normaliser.add(rollout.observations)

    def _outputs(self, observations: torch.Tensor, *residual: torch.Tensor) -> torch.Tensor:
        model = self.actor if self._noise is None else self._noise.outputs
        outputs: torch.Tensor = model(observations, *residual)
        return outputs

    def _advantages_and_targets(self, rollout: Rollout) -> tuple[torch.Tensor, torch.Tensor]:
        """Normalised advantages and value targets, both (steps * environments,)."""
        settings, rewards = self.settings, rollout.rewards
        if settings.scale_rewards:
            rewards = rewards / self._scale.update(rewards, rollout.done)
        with torch.no_grad():
            both = (rollout.observations, rollout.next_observations)
            outputs = (self._critic(self._seen(o).flatten(0, 1)).double() for o in both)
            values, next_values = (value.numpy().reshape(rewards.shape) for value in outputs)
        ended = rollout.terminated if settings.bootstrap_truncated else rollout.done
        advantages = generalised_advantage(
            rewards, values, next_values, ended, rollout.done, settings.gamma, settings.gae_lambda
        )
        targets = torch.from_numpy(advantages + values).float().flatten()
        flat = torch.from_numpy(advantages).float().flatten()
        return (flat - flat.mean()) / (flat.std(correction=0) + 1e-8), targets

    def _minibatches(self, columns: list[torch.Tensor]) -> list[tuple[torch.Tensor, ...]]:
        """The columns in one piece, or shuffled and cut."""
        size = self.settings.minibatch
        if size is None:
            return [tuple(columns)]
        order = torch.randperm(len(columns[0]), generator=self._generator)
        cut = [column.index_select(0, order).split(size) for column in columns]  # type: ignore[no-untyped-call]
        return list(zip(*cut, strict=True))

    def _descend(self, actor_loss: torch.Tensor, critic_loss: torch.Tensor) -> None:
        """One step down both losses, which share no parameter."""
        for flat in self._learned:
            flat.zero_gradient()
        (actor_loss + critic_loss).backward()  # type: ignore[no-untyped-call]
        if self.settings.gradient_norm is not None:
            for flat in self._learned:
                flat.clip_gradient(self.settings.gradient_norm)
        self._optimiser.step()

    def state(self) -> dict[str, Any]:
        """All that `restore` needs to resume bit for bit, tensors and plain values."""
        return {
            "actor": deepcopy(self.actor.state_dict()),
            "critic": deepcopy(self._critic.state_dict()),
            "optimiser": deepcopy(self._optimiser.state_dict()),
            "generator": self._generator.get_state(),
            "rng": self._rng.bit_generator.state,
            "collector": self._collector.state(),
            "return_scale": self._scale.state(),
            "pause": self._pause.state(),
            "noise": None if self._noise is None else self._noise.state(),
            "normaliser": None if self.normaliser is None else self.normaliser.state(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Resume from the state of a trainer with the same environment, settings and seed.

        Raises:
            TrainingError: the optimiser's state is that of other models, or an environment does
                not come to where it was.
        """
        self.actor.load_state_dict(state["actor"])
        self._critic.load_state_dict(state["critic"])
        adam = self._optimiser.state_dict()  # the settings of its groups are not the file's
        self._optimiser.load_state_dict(adam | {"state": state["optimiser"]["state"]})
        for flat in self._learned:
            moments = self._optimiser.state[flat.parameter]
            for name in ("exp_avg", "exp_avg_sq") if moments else ():
                if moments[name].shape != flat.parameter.shape:
                    raise TrainingError("The state of the optimiser does not fit its models.")
        self._generator.set_state(state["generator"])
        self._rng.bit_generator.state = state["rng"]
        self._scale.restore(state["return_scale"])
        self._pause.restore(state["pause"])
        if self._noise is not None:
            self._noise.restore(state["noise"])
        if self.normaliser is not None:
            self.normaliser.restore(state["normaliser"])
        self._collector.restore(state["collector"])
