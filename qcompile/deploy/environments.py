"""Gymnasium environments, checked against what a policy needs."""

from __future__ import annotations

import contextlib
import json
import os
import warnings
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete

from qcompile.catalogue import nearest
from qcompile.errors import EnvironmentMismatchError
from qcompile.policy import AnyPolicy, Network
from qcompile.terminal import first_line

Environment = gymnasium.Env[Any, Any]

_USUAL = ("CartPole-v1", "Acrobot-v1", "LunarLander-v3", "MountainCar-v0")


def make_environments(
    name: str, count: int, *, film: bool = False, arguments: Mapping[str, Any] | None = None
) -> list[Environment]:
    """`count` environments called `name`, made with `arguments`; with `film` they render frames.

    Raises:
        EnvironmentMismatchError: no such environment, or it has no vector of features to observe
            and no finite set of actions.
    """
    if ":" in name:  # gymnasium would import the module before the colon
        raise EnvironmentMismatchError(
            f"Environment {name!r} names a module to import.",
            "A policy file may not load code; register the environment and give its plain name.",
        )
    settings = dict(arguments or {})  # no render_mode without a film: not all environments take it
    if film:
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # frames need no screen
        settings["render_mode"] = "rgb_array"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            environments = [
                gymnasium.make(name, disable_env_checker=True, **settings)
                for _ in range(count)  # that checker looks at one step; deploy/stepping.py at all
            ]
    except (ImportError, gymnasium.error.DependencyNotInstalled) as error:
        raise EnvironmentMismatchError(
            f"Environment {name!r} needs a package that is not installed.",
            *_first_line(error),
        ) from error
    except Exception as error:  # an environment is made by code of any kind
        if name in gymnasium.registry:
            raise EnvironmentMismatchError(
                f"Environment {name!r} cannot be made.", *_first_line(error)
            ) from error
        # gymnasium suggests the likest name, however little it is like.
        missing = (gymnasium.error.NameNotFound, gymnasium.error.NamespaceNotFound)
        raise EnvironmentMismatchError(
            f"Unknown environment {name!r}.",
            *(() if isinstance(error, missing) else _first_line(error)),
            nearest(name, [*_USUAL, *gymnasium.registry]),
        ) from error
    for environment in environments[:1]:
        features_and_actions(environment)
    if film:
        _check_frames(name, settings)
    return environments


def close_environments(environments: Iterable[Environment]) -> None:
    """Close them; one that fails at it has done its work, so nothing is said."""
    for environment in environments:
        with contextlib.suppress(Exception):
            environment.close()


def environment_name(environment: Environment) -> str:
    """What an environment is called in messages."""
    return environment.spec.id if environment.spec else str(environment)


def _check_frames(name: str, settings: Mapping[str, Any]) -> None:
    """Raise EnvironmentMismatchError where an environment renders no frames.

    It is another one that is asked: the first frame may draw from the generator of its episode.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            environment = gymnasium.make(name, **settings)
            environment.reset(seed=0)
            frame, rate = environment.render(), frames_per_second(environment)
            close_environments([environment])
    except Exception as error:  # an environment renders by code of any kind
        why = _first_line(error)
    else:
        shape, dtype = np.shape(frame), getattr(frame, "dtype", None)  # type: ignore[arg-type]
        is_picture = len(shape) == 3 and shape[2] == 3 and min(shape) > 1 and dtype == np.uint8
        if is_picture and 0 < rate < np.inf:
            return
        kind = f"of type {dtype}" if dtype is not None else f"a {type(frame).__name__}"
        rendered = "None" if frame is None else f"{kind} and shape {shape}"
        why = [f"A frame is {rendered}, {rate:g} a second."]
    raise EnvironmentMismatchError(
        f"Environment {name!r} cannot be filmed: it renders no pictures.",
        *why,
        "Run without --video.",
    )


def _first_line(error: Exception) -> list[str]:
    return [line] if (line := first_line(str(error))) else []


def features_and_actions(environment: Environment) -> tuple[int, int]:
    """The number of features an observation has, and of actions.

    Raises:
        EnvironmentMismatchError: observations are no vectors, or actions are not numbered.
    """
    observed = getattr(environment, "observation_space", None)
    acted = getattr(environment, "action_space", None)
    name = environment_name(environment)
    if not isinstance(observed, Box) or observed.shape is None or len(observed.shape) != 1:
        raise EnvironmentMismatchError(
            f"{name} observes {observed}.", "A policy needs a vector of features (a 1-D Box)."
        )
    if not isinstance(acted, Discrete):
        raise EnvironmentMismatchError(
            f"{name} acts in {acted}.", "A policy chooses among numbered actions (Discrete)."
        )
    return int(observed.shape[0]), int(acted.n)


def check_fit(policy: AnyPolicy, environment: Environment) -> None:
    """Raise EnvironmentMismatchError where `policy` cannot act in `environment`."""
    features, actions = features_and_actions(environment)
    name = environment_name(environment)
    if isinstance(policy, Network):
        _check_network(policy, name, features, actions)
        return
    if policy.encoder.reads_bits:
        raise EnvironmentMismatchError(
            f"Policy {policy.name!r} reads the bits of a number; {name} observes a vector of "
            f"{features} features.",
            "Correct `environment` or `encoder.function` in the policy file.",
        )
    needed = policy.encoder.features
    if needed > features:
        raise EnvironmentMismatchError(
            f"Policy {policy.name!r} reads feature {needed - 1}; observations of {name} "
            f"have {features} features.",
            "Correct `environment` or `encoder.feature` in the policy file.",
        )
    if policy.actions != actions:
        raise EnvironmentMismatchError(
            f"Policy {policy.name!r} has {policy.actions} actions; {name} has {actions}.",
            "Correct `environment`, or `weights` and `bias`, in the policy file.",
        )


def _check_network(network: Network, name: str, features: int, actions: int) -> None:
    if (network.features, network.actions) != (features, actions):
        raise EnvironmentMismatchError(
            f"Network {network.name!r} maps {network.features} features to {network.actions} "
            f"actions; {name} has {features} and {actions}.",
            "Correct `environment`, or `layers`, in the file of the network.",
        )


def reward_threshold(environment: Environment) -> float | None:
    """The mean reward at which the environment counts as solved, if it has one."""
    return environment.spec.reward_threshold if environment.spec else None


@cache
def threshold_of(name: str, arguments: str = "{}") -> float | None:
    """`reward_threshold` of an environment by its name, made with arguments, JSON as text.

    Raises:
        EnvironmentMismatchError: it is unknown.
    """
    (environment,) = make_environments(name, 1, arguments=json.loads(arguments))
    try:
        return reward_threshold(environment)
    finally:
        close_environments([environment])


def frames_per_second(environment: Environment) -> float:
    """The rate at which the environment's frames show it in real time."""
    return float(environment.metadata.get("render_fps", 30))
