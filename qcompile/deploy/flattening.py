"""Flattens numeric observations to the vectors that policies read, with gymnasium's wrappers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.spaces.utils import flatdim
from gymnasium.wrappers import FlattenObservation
from numpy.typing import NDArray

from qcompile.errors import EnvironmentMismatchError
from qcompile.limits import MAX_FEATURES

_COUNTED = (spaces.Discrete, spaces.MultiDiscrete, spaces.MultiBinary)
_NUMBERS = (spaces.Box, *_COUNTED)

_Keys = tuple[Any, ...]
"""The path to a part of an observation: keys of a Dict, indices of a Tuple."""


def vector_observations(
    environment: gymnasium.Env[Any, Any], name: str, *, bits: bool = False
) -> gymnasium.Env[Any, Any]:
    """The environment with vector observations; returned unchanged if it already has them.

    Discrete parts become one-hot; with `bits` a Discrete observation becomes its number.

    Raises:
        EnvironmentMismatchError: a part is not numeric, or the vector would be too long.
    """
    space = getattr(environment, "observation_space", None)
    if isinstance(space, spaces.Box) and len(space.shape) == 1:
        return environment
    if not isinstance(space, spaces.Space):
        raise EnvironmentMismatchError(
            f"{name} has no observation_space.", "An environment must declare it."
        )
    if bits and isinstance(space, spaces.Discrete):
        return StateNumber(environment)
    for keys, part in _parts(space):
        if not isinstance(part, _NUMBERS):
            where = f" in its part {_path(keys)}" if keys else ""
            raise EnvironmentMismatchError(
                f"{name} observes a {type(part).__name__}{where}.",
                "A policy reads numbers (Box, Discrete, MultiDiscrete, MultiBinary; Dict and Tuple "
                "of these).",
                "Drop the rest with a wrapper (such as minigrid's ImgObsWrapper), registered "
                "in a module of your own: --import MODULE.",
            )
    features = flatdim(space)
    if not 1 <= features <= MAX_FEATURES:
        raise EnvironmentMismatchError(
            f"{name} observes {features:,} numbers in total.",
            f"A policy reads at most {MAX_FEATURES:,}: crop, shrink or summarise them with a "
            "wrapper, registered in a module of your own.",
        )
    return _Flattened(environment)


class StateNumber(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Observes a Discrete observation as a vector with its number, counted from 0.

    `states` is the number of states, `bits` the number of bits that distinguish them.
    """

    def __init__(self, environment: gymnasium.Env[Any, Any]):
        super().__init__(environment)
        assert isinstance(environment.observation_space, spaces.Discrete)
        self._space = environment.observation_space
        self.states = int(self._space.n)
        self.bits = max((self.states - 1).bit_length(), 1)
        self.observation_space = spaces.Box(0, self.states - 1, (1,), np.int64)

    def observation(self, observation: Any) -> NDArray[np.int64]:
        _check_part(observation, self._space, ())
        return np.array([observation - self._space.start], dtype=np.int64)


class _Flattened(FlattenObservation[Any, Any, Any]):
    """gymnasium's wrapper, with observations checked against the declared space."""

    def __init__(self, env: gymnasium.Env[Any, Any]):
        super().__init__(env)
        self._parts = [*_parts(env.observation_space)]

    def observation(self, observation: Any) -> Any:
        for keys, space in self._parts:
            part = observation
            try:
                for key in keys:
                    part = part[key]
            except (KeyError, IndexError, TypeError) as error:
                raise ValueError(f"the observation has no part {_path(keys)}") from error
            _check_part(part, space, keys)
        return super().observation(observation)


def _check_part(part: Any, space: spaces.Space[Any], keys: _Keys) -> None:
    """Raise ValueError if a part of an observation does not match its space."""
    name = f"the observation's part {_path(keys)}" if keys else "the observation"
    if isinstance(space, _COUNTED):
        if not space.contains(part):
            raise ValueError(f"{name} is {str(part)[:60]}, which is not in {space}")
        return
    array, dtype = np.asarray(part), np.dtype(space.dtype)
    if array.shape != space.shape:
        raise ValueError(f"{name} has shape {array.shape}, its space declares {space.shape}")
    kinds = "biuf" if dtype.kind == "f" else "biu"
    if array.dtype.kind not in kinds:
        raise ValueError(f"{name} has numbers of type {array.dtype}, its space declares {dtype}")
    if dtype.kind != "f" and not np.array_equal(array.astype(dtype), array):  # 300 would be 44
        raise ValueError(f"{name} has a number that its space's type {dtype} cannot hold")


def _parts(space: spaces.Space[Any], keys: _Keys = ()) -> Iterator[tuple[_Keys, spaces.Space[Any]]]:
    """The elementary parts of a space, with their paths."""
    if isinstance(space, spaces.Dict):
        for key, part in space.spaces.items():
            yield from _parts(part, (*keys, key))
    elif isinstance(space, spaces.Tuple):
        for index, part in enumerate(space.spaces):
            yield from _parts(part, (*keys, index))
    else:
        yield keys, space


def _path(keys: _Keys) -> str:
    return ".".join(map(str, keys))
