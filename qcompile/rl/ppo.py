"""Proximal policy optimisation, in the order of its mathematics: collect, judge, update."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from copy import deepcopy
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from qcompile.policy import Policy
from qcompile.rl.advantage import ReturnScale, generalised_advantage
from qcompile.rl.models import SVQC
from qcompile.rl.presets import Settings
from qcompile.rl.rollout import Collector, FinishedEpisode, Rollout

_RUNNING_EPISODES = 20
_LEAST_RATE = 0.02


@dataclass(frozen=True, eq=False)
class TrainingResult:
    """The trained policy and every finished episode; `interrupted` says if Ctrl-C ended it."""

    policy: Policy
    episodes: list[FinishedEpisode]
    steps: int
    interrupted: bool


class Trainer:
    """Trains an actor and a critic, both circuits of the same layout, on one environment.

    The same environment, settings and seed give the same policy on the same machine and versions.
    """

    def __init__(self, environment: str, settings: Settings, seed: int):
        self._environment, self._settings, self._seed = environment, settings, seed
        env_seeds, action_seeds, torch_seeds = np.random.SeedSequence(seed).spawn(3)
        self._collector = Collector(environment, settings.environments, env_seeds)
        self._rng = np.random.default_rng(action_seeds)
        self._generator = torch.Generator().manual_seed(int(torch_seeds.generate_state(1)[0]))
        features, actions = self._collector.features, self._collector.actions
        self._actor = SVQC(features, actions, settings, self._generator)
        self._critic = SVQC(features, 1, settings, self._generator)
        self._optimisers = [
            torch.optim.Adam(self._actor.parameters(), lr=settings.actor_lr, eps=1e-5),
            torch.optim.Adam(self._critic.parameters(), lr=settings.critic_lr, eps=1e-5),
        ]
        self._scale = ReturnScale(settings.environments, settings.gamma)
        self._pause = _Pause(settings.pause_at)

    @property
    def progress(self) -> float:
        """How much of the run is done, in [0, 1]."""
        settings, collector = self._settings, self._collector
        parts = [
            done / budget
            for done, budget in (
                (collector.steps, settings.steps),
                (len(collector.history), settings.episodes),
            )
            if budget is not None
        ]
        return min(max(parts), 1.0)

    def train(
        self, on_episode: Callable[[FinishedEpisode, float], None] = lambda episode, progress: None
    ) -> TrainingResult:
        """Train until the budget of the settings is spent, or until Ctrl-C.

        `on_episode` is called with each finished episode and the progress of the run.
        """
        interrupted = False
        threads = torch.get_num_threads()
        torch.set_num_threads(1)  # the tensors are small: threads cost more than they bring
        try:
            while self.progress < 1.0:
                rollout = self._collector.collect(self._act, self._settings.horizon)
                for episode in rollout.finished:
                    on_episode(episode, self.progress)
                if not self._pause.holds(rollout.finished, self._actor):
                    self._update(rollout)
        except KeyboardInterrupt:
            interrupted = True
        finally:
            torch.set_num_threads(threads)
            self._collector.close()
        return TrainingResult(
            self._policy(), self._collector.history, self._collector.steps, interrupted
        )

    def _act(self, observations: NDArray[np.float32]) -> NDArray[np.intp]:
        with torch.no_grad():
            logits = self._actor(torch.from_numpy(observations)).numpy()
        return np.asarray((logits + self._rng.gumbel(size=logits.shape)).argmax(axis=1))

    def _update(self, rollout: Rollout) -> None:
        settings = self._settings
        left = 1.0 - self.progress if settings.anneal else 1.0
        rates = (settings.actor_lr, settings.critic_lr)
        for optimiser, rate in zip(self._optimisers, rates, strict=True):
            optimiser.param_groups[0]["lr"] = rate * max(left, _LEAST_RATE)
        observations = torch.from_numpy(rollout.observations).flatten(0, 1)
        actions = torch.from_numpy(rollout.actions).flatten()[:, None]
        advantages, targets = self._judge(rollout)
        with torch.no_grad():
            before = _log_probabilities(self._actor, observations).gather(1, actions)[:, 0]
        for _ in range(settings.epochs):
            for batch in self._minibatches(len(actions)):
                log_all = _log_probabilities(self._actor, observations[batch])
                ratio = (log_all.gather(1, actions[batch])[:, 0] - before[batch]).exp()
                clipped = ratio.clamp(1 - settings.clip, 1 + settings.clip)
                gain = torch.minimum(ratio * advantages[batch], clipped * advantages[batch]).mean()
                entropy = -(log_all.exp() * log_all).sum(dim=1).mean()
                self._descend(0, -gain - settings.entropy * left * entropy)
                value = self._critic(observations[batch])[:, 0]
                self._descend(1, ((value - targets[batch]) ** 2).mean())

    def _judge(self, rollout: Rollout) -> tuple[torch.Tensor, torch.Tensor]:
        """Normalised advantages and value targets, both (steps * environments,)."""
        settings, rewards = self._settings, rollout.rewards
        if settings.scale_rewards:
            rewards = rewards / self._scale.update(rewards, rollout.done)
        with torch.no_grad():
            values, next_values = (
                self._critic(torch.from_numpy(o).flatten(0, 1))
                .double()
                .numpy()
                .reshape(rewards.shape)
                for o in (rollout.observations, rollout.next_observations)
            )
        ended = rollout.terminated if settings.bootstrap_truncated else rollout.done
        advantages = generalised_advantage(
            rewards, values, next_values, ended, rollout.done, settings.gamma, settings.gae_lambda
        )
        targets = torch.from_numpy(advantages + values).float().flatten()
        flat = torch.from_numpy(advantages).float().flatten()
        return (flat - flat.mean()) / (flat.std(correction=0) + 1e-8), targets

    def _minibatches(self, size: int) -> tuple[torch.Tensor | slice, ...]:
        if self._settings.minibatch is None:
            return (slice(None),)
        order = torch.randperm(size, generator=self._generator)
        parts: tuple[torch.Tensor, ...] = order.split(self._settings.minibatch)  # type: ignore[no-untyped-call]
        return parts

    def _descend(self, which: int, loss: torch.Tensor) -> None:
        optimiser = self._optimisers[which]
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        if self._settings.gradient_norm is not None:
            parameters = optimiser.param_groups[0]["params"]
            torch.nn.utils.clip_grad_norm_(parameters, self._settings.gradient_norm)
        optimiser.step()

    def _policy(self) -> Policy:
        import gymnasium

        from qcompile import __version__

        metadata: dict[str, Any] = {
            "seed": self._seed,
            "episodes": len(self._collector.history),
            "steps": self._collector.steps,
            "settings": {
                k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self._settings).items()
            },
            "versions": {
                "qcompile": __version__,
                "torch": str(torch.__version__),
                "numpy": np.__version__,
                "gymnasium": gymnasium.__version__,
            },
        }
        name = self._environment.rsplit("-v", 1)[0].lower()
        if self._pause.best is not None:
            self._actor.load_state_dict(self._pause.best)
        return self._actor.policy(name, self._environment, metadata)


def _log_probabilities(actor: SVQC, observations: torch.Tensor) -> torch.Tensor:
    return torch.log_softmax(actor(observations), dim=1)


class _Pause:
    """Algorithm 2 of the paper: stop learning while episodes are good, keep the best policy."""

    def __init__(self, reward: float | None):
        self._reward = reward
        self._running: deque[float] = deque(maxlen=_RUNNING_EPISODES)
        self._row = self._longest = 0
        self.best: dict[str, torch.Tensor] | None = None

    def holds(self, finished: list[FinishedEpisode], actor: SVQC) -> bool:
        """Whether the update after these episodes is skipped."""
        if self._reward is None:
            return False
        good = False
        for episode in finished:
            self._running.append(episode.reward)
            good = episode.reward >= self._reward
            if good:
                self._row += 1
                if self._row > self._longest:
                    self._longest, self.best = self._row, deepcopy(actor.state_dict())
        if sum(self._running) < self._reward * len(self._running):
            self._row = 0
        return good or self._row > 0
