"""The update of proximal policy optimisation, in the order of its mathematics."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn.functional import cross_entropy, mse_loss

from qcompile.errors import TrainingError
from qcompile.rl.acting_noise import ActingNoise
from qcompile.rl.advantage import ReturnScale, generalised_advantage
from qcompile.rl.draw import mean_entropy
from qcompile.rl.flat import FlatParameters
from qcompile.rl.memory import Memory
from qcompile.rl.rollout import Collector, Rollout
from qcompile.rl.settings import Settings

_MIN_RATE = 0.02


class Learner:
    """Updates an actor and a critic from rollouts, with one Adam optimiser for both.

    `generator` shuffles minibatches, `model_inputs` maps observations (..., features) to the
    models' inputs, and `noise` is the device noise that the actor acts under.
    """

    def __init__(
        self,
        actor: torch.nn.Module,
        critic: torch.nn.Module,
        settings: Settings,
        generator: torch.Generator,
        model_inputs: Callable[[NDArray[np.floating]], torch.Tensor],
        noise: ActingNoise | None,
    ):
        self._actor, self._critic, self._settings = actor, critic, settings
        self._generator, self._model_inputs, self._noise = generator, model_inputs, noise
        self._learned = [FlatParameters(actor), FlatParameters(critic)]
        groups = [{"params": [flat.parameter]} for flat in self._learned]
        self._optimiser = torch.optim.Adam(groups, eps=1e-5, fused=True)
        self._scale = ReturnScale(settings.environments, settings.gamma**settings.hold)
        self._memory = Memory(settings.rollouts)

    def learn(self, rollout: Rollout, left: float) -> tuple[float, ...]:
        """Learn from a rollout and the stored ones, with `left` times the initial step sizes.

        Returns both losses, entropy, divergence and clipped share of an `Update`.

        Raises:
            FloatingPointError: parameters became infinite or NaN; they are restored.
        """
        settings = self._settings
        numbers = [flat.parameter.detach().clone() for flat in self._learned]
        actor, critic = self._optimiser.param_groups
        actor["lr"] = settings.actor_lr * max(left, _MIN_RATE)
        critic["lr"] = settings.critic_lr * max(left, _MIN_RATE)
        if settings.decision_cost:
            rollout = replace(rollout, rewards=rollout.rewards - settings.decision_cost)
        scale = self._scale.update(rollout.rewards, rollout.done) if settings.scale_rewards else 1.0
        residual = [] if self._noise is None else [self._noise.take_residuals()]
        joined, residual = self._memory.joined(rollout, residual)
        observations = self._model_inputs(joined.observations).flatten(0, 1)
        actions = torch.from_numpy(joined.actions).flatten()
        with torch.no_grad():
            outputs = self._outputs(observations, *residual)
            before = cross_entropy(outputs, actions, reduction="none")
        estimates = self._advantages_and_targets(joined, scale)
        columns = [observations, before, actions, *estimates, *residual]
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
                raise FloatingPointError("its numbers are not finite")
            divergence = (ratio - 1 - ratio.log()).mean()
            share = (ratio != clipped).float().mean()
            figures = (-gain, critic_loss, mean_entropy(outputs), divergence, share)
            return tuple(figure.item() for figure in figures)

    def _outputs(self, observations: torch.Tensor, *residual: torch.Tensor) -> torch.Tensor:
        model = self._actor if self._noise is None else self._noise.outputs
        outputs: torch.Tensor = model(observations, *residual)
        return outputs

    def _advantages_and_targets(
        self, rollout: Rollout, scale: float
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Normalised advantages and value targets, both (steps * environments,)."""
        settings, rewards = self._settings, rollout.rewards / scale
        with torch.no_grad():
            both = (rollout.observations, rollout.next_observations)
            outputs = (self._critic(self._model_inputs(o).flatten(0, 1)).double() for o in both)
            values, next_values = (value.numpy().reshape(rewards.shape) for value in outputs)
        ended = rollout.terminated if settings.bootstrap_truncated else rollout.done
        gamma = settings.gamma**settings.hold
        advantages = generalised_advantage(
            rewards, values, next_values, ended, rollout.done, gamma, settings.gae_lambda
        )
        targets = torch.from_numpy(advantages + values).float().flatten()
        flat = torch.from_numpy(advantages).float().flatten()
        return (flat - flat.mean()) / (flat.std(correction=0) + 1e-8), targets

    def _minibatches(self, columns: list[torch.Tensor]) -> list[tuple[torch.Tensor, ...]]:
        """The columns in one piece, or shuffled and split."""
        size = self._settings.minibatch
        if size is None:
            return [tuple(columns)]
        order = torch.randperm(len(columns[0]), generator=self._generator)
        cut = [column.index_select(0, order).split(size) for column in columns]  # type: ignore[no-untyped-call]
        return list(zip(*cut, strict=True))

    def _descend(self, actor_loss: torch.Tensor, critic_loss: torch.Tensor) -> None:
        """One gradient step on both losses, which share no parameter."""
        for flat in self._learned:
            flat.zero_gradient()
        (actor_loss + critic_loss).backward()  # type: ignore[no-untyped-call]
        if self._settings.gradient_norm is not None:
            for flat in self._learned:
                flat.clip_gradient(self._settings.gradient_norm)
        self._optimiser.step()

    def state(self) -> dict[str, Any]:
        """The state for `restore`, without the models."""
        return {
            "optimiser": deepcopy(self._optimiser.state_dict()),
            "return_scale": self._scale.state(),
            "memory": self._memory.state(),
        }

    def restore(self, state: dict[str, Any], collector: Collector) -> None:
        """Resume from `state`, with rollouts from this collector.

        Raises:
            TrainingError: the state belongs to other models or another training.
        """
        adam = self._optimiser.state_dict()  # not with the file's settings of its groups
        self._optimiser.load_state_dict(adam | {"state": state["optimiser"]["state"]})
        for flat in self._learned:
            moments = self._optimiser.state[flat.parameter]
            for name in ("exp_avg", "exp_avg_sq") if moments else ():
                if moments[name].shape != flat.parameter.shape:
                    raise TrainingError("The state of the optimiser does not fit its models.")
        self._scale.restore(state["return_scale"])
        observables = None if self._noise is None else self._noise.observables
        self._memory.restore(state["memory"], collector, observables)
