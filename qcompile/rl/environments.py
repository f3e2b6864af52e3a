"""The environments of a training: as in play, but numbers may be observed as bits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from qcompile.deploy.environments import (
    Environment,
    close_environments,
    features_and_actions,
    make_environments,
)
from qcompile.deploy.flattening import StateNumber
from qcompile.errors import TrainingError

MAX_TRAINED = 100_000
"""The most features of an observation, and the most actions."""


def training_environments(
    name: str, count: int, bits: bool, arguments: Mapping[str, Any] | None
) -> list[Environment]:
    """`count` environments, which with `bits` observe the bits of a number, lowest first.

    Raises:
        EnvironmentMismatchError: as for `make_environments`.
        TrainingError: with `bits` an observation is not one number; or there are too many features
            or actions.
    """
    environments = make_environments(name, count, bits=bits, arguments=arguments)
    features, actions = features_and_actions(environments[0])
    for what, size in (("features", features), ("actions", actions)):
        if size > MAX_TRAINED:
            close_environments(environments)
            raise TrainingError(
                f"{name} has {size:,} {what}; training supports at most {MAX_TRAINED:,}.",
                "Drop what a policy does not need with a wrapper, registered in a module of your "
                "own.",
            )
    if not bits:
        return environments
    if not all(isinstance(environment, StateNumber) for environment in environments):
        close_environments(environments)
        raise TrainingError(
            f"The encoder bits reads the bits of a number; {name} observes a vector of {features} "
            "features.",
            "It is for environments with a Discrete observation.",
        )
    return [StateBits(environment) for environment in environments]


class StateBits(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Observes the bits of a StateNumber's number, as 0 and 1."""

    def __init__(self, environment: Environment):
        super().__init__(environment)
        assert isinstance(environment, StateNumber)
        self._bits = np.arange(environment.bits)
        self.observation_space = gymnasium.spaces.Box(0, 1, self._bits.shape, np.float32)

    def observation(self, observation: NDArray[np.int64]) -> NDArray[np.float32]:
        return (observation >> self._bits & 1).astype(np.float32)
