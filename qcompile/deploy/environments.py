"""Gymnasium environments, checked against the needs of a policy."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any, TypeGuard

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete
from numpy.typing import NDArray

from qcompile.caller import option
from qcompile.catalogue import close_names
from qcompile.deploy.flattening import StateNumber, vector_observations
from qcompile.errors import EnvironmentMismatchError
from qcompile.policy import AnyPolicy, Network
from qcompile.terminal import first_line

Environment = gymnasium.Env[Any, Any]

_USUAL = ("CartPole-v1", "Acrobot-v1", "LunarLander-v3", "MountainCar-v0")


def make_environments(
    name: str,
    count: int,
    *,
    film: bool = False,
    bits: bool = False,
    arguments: Mapping[str, Any] | None = None,
) -> list[Environment]:
    """Make `count` environments `name` with `arguments`; with `film` they render frames.

    Observations that are not vectors are flattened: Discrete ones to one-hot vectors, or with
    `bits`, for policies that read the bits of a number, to the number itself.

    Raises:
        EnvironmentMismatchError: the environment is unknown, does not observe numbers, or has no
            finite set of actions.
    """
    if ":" in name:  # gymnasium would import the module before the colon
        raise EnvironmentMismatchError(
            f"Environment {name!r} would import a module.",
            "A file may not load code: register the environment and use its plain name.",
        )
    settings = dict(arguments or {})  # some environments accept no render_mode
    if film:
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # frames need no screen
        settings["render_mode"] = "rgb_array"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            environments: list[Environment] = [
                gymnasium.make(name, disable_env_checker=True, **settings)
                for _ in range(count)  # that checker sees one step; deploy/stepping.py sees all
            ]
    except (ImportError, gymnasium.error.DependencyNotInstalled) as error:
        raise EnvironmentMismatchError(
            f"Environment {name!r} needs a package that is not installed.",
            *_first_line(error),
        ) from error
    except Exception as error:  # environments run arbitrary code
        raise _not_made(name, error, film=film) from error
    if environments:
        environments = [
            vector_observations(environment, name, bits=bits) for environment in environments
        ]
        features_and_actions(environments[0])
    if film:
        _check_frames(name, settings)
    return environments


def _not_made(name: str, error: Exception, *, film: bool) -> EnvironmentMismatchError:
    """Why an environment cannot be made."""
    if film and "render_mode" in str(error):
        return _not_filmed(name, _first_line(error))
    if name in gymnasium.registry:
        return EnvironmentMismatchError(
            f"Environment {name!r} cannot be made.", *_first_line(error)
        )
    # gymnasium suggests the closest name, however distant.
    missing = (gymnasium.error.NameNotFound, gymnasium.error.NamespaceNotFound)
    if not isinstance(error, missing):  # such as a missing version
        return EnvironmentMismatchError(f"Unknown environment {name!r}.", *_first_line(error))
    close = close_names(name, gymnasium.registry)
    known = f"Did you mean {' or '.join(close)}?" if close else f"Known: {', '.join(_USUAL)}, ..."
    return EnvironmentMismatchError(
        f"Unknown environment {name!r}.",
        known,
        "If one of your modules or a package registers it, add --import MODULE.",
    )


def close_environments(environments: Iterable[Environment]) -> None:
    """Close the environments, ignoring errors: they have done their work."""
    for environment in environments:
        with contextlib.suppress(Exception):
            environment.close()


def environment_name(environment: Environment) -> str:
    """The name of an environment in messages."""
    spec = environment.unwrapped.spec  # a wrapper may hold a wrapped environment's spec
    return spec.id if spec else str(environment)


def _check_frames(name: str, settings: Mapping[str, Any]) -> None:
    """Raise EnvironmentMismatchError if an environment renders no frames.

    It checks a separate
    environment: the first frame may draw from the generator of its episode.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            environment = gymnasium.make(name, **settings)
            environment.reset(seed=0)
            frame, rate = environment.render(), frames_per_second(environment)
            close_environments([environment])
    except Exception as error:  # environments run arbitrary code
        why = _first_line(error)
    else:
        if is_picture(frame) and 0 < rate < np.inf:
            return
        shape, dtype = np.shape(frame), getattr(frame, "dtype", None)  # type: ignore[arg-type]
        kind = f"of type {dtype}" if dtype is not None else f"a {type(frame).__name__}"
        rendered = "None" if frame is None else f"{kind} and shape {shape}"
        why = [f"A frame is {rendered}, {rate:g} a second."]
    raise _not_filmed(name, why)


def is_picture(frame: object) -> TypeGuard[NDArray[np.uint8]]:
    """Whether it is an array (height, width, 3) of bytes, as environments render them."""
    return (
        isinstance(frame, np.ndarray)
        and frame.dtype == np.uint8
        and frame.ndim == 3
        and frame.shape[2] == 3
        and min(frame.shape) > 1
    )


def _not_filmed(name: str, why: list[str]) -> EnvironmentMismatchError:
    return EnvironmentMismatchError(
        f"Environment {name!r} cannot be filmed: it renders no pictures.",
        *why,
        f"Run without {option('video')}.",
    )


def _first_line(error: Exception) -> list[str]:
    message, _, _ = str(error).partition(" was raised from the environment creator for ")
    return [line] if (line := first_line(message)) else []


def features_and_actions(environment: Environment) -> tuple[int, int]:
    """The number of features an observation has, and of actions.

    Raises:
        EnvironmentMismatchError: observations are not vectors, or actions are not numbered.
    """
    observed = getattr(environment, "observation_space", None)
    acted = getattr(environment, "action_space", None)
    name = environment_name(environment)
    if not isinstance(observed, Box) or observed.shape is None or len(observed.shape) != 1:
        raise EnvironmentMismatchError(
            f"{name} observes {observed}.", "A policy needs a feature vector (a 1-D Box)."
        )
    if isinstance(acted, Box):
        raise EnvironmentMismatchError(
            f"{name} acts in {acted}.",
            "Continuous actions are not supported yet: a policy chooses among numbered actions "
            "(Discrete).",
        )
    if not isinstance(acted, Discrete):
        raise EnvironmentMismatchError(
            f"{name} acts in {acted}.", "A policy chooses among numbered actions (Discrete)."
        )
    if not observed.shape[0]:
        raise EnvironmentMismatchError(
            f"{name} observes {observed}.", "A policy needs at least one feature."
        )
    return int(observed.shape[0]), int(acted.n)


def policy_environments(policy: AnyPolicy, count: int, *, film: bool = False) -> list[Environment]:
    """Make `count` environments for a policy; with `film` the first renders frames.

    Raises:
        EnvironmentMismatchError: as for `make_environments`, or the policy does not fit.
    """
    make = partial(
        make_environments,
        policy.environment,
        bits=policy.reads_bits,
        arguments=policy.environment_kwargs,
    )
    environments = make(1, film=film)
    try:
        check_fit(policy, environments[0])
        environments += make(count - 1)
    except BaseException:
        close_environments(environments)
        raise
    return environments


def check_fit(policy: AnyPolicy, environment: Environment) -> None:
    """Raise EnvironmentMismatchError if `policy` cannot act in `environment`.

    The environment must be made with `bits` if the policy reads bits.
    """
    features, actions = features_and_actions(environment)
    name = environment_name(environment)
    if isinstance(policy, Network):
        _check_network(policy, name, features, actions)
        return
    if policy.encoder.reads_bits:
        if not isinstance(environment, StateNumber):
            raise EnvironmentMismatchError(
                f"Policy {policy.name!r} reads the bits of a number; {name} observes a vector of "
                f"{features} features.",
                "Correct `environment` or `encoder.function` in the policy file.",
            )
        bits, last = environment.bits, int(policy.encoder.feature.max())
        if last >= bits:
            raise EnvironmentMismatchError(
                f"Policy {policy.name!r} reads bit {last}; observations of {name} have {bits} "
                "bits.",
                "Correct `environment` or `encoder.feature` in the policy file.",
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
            "Correct `environment`, or `layers`, in the network file.",
        )


def reward_threshold(environment: Environment) -> float | None:
    """The mean reward at which the environment counts as solved, if it defines one."""
    spec = environment.unwrapped.spec
    return spec.reward_threshold if spec else None


def threshold_of(name: str, arguments: Mapping[str, Any]) -> float | None:
    """The `reward_threshold` of an environment, by name.

    Raises:
        EnvironmentMismatchError: the environment is unknown.
    """
    if name in gymnasium.registry:
        return gymnasium.registry[name].reward_threshold
    (environment,) = make_environments(name, 1, arguments=arguments)
    try:
        return reward_threshold(environment)
    finally:
        close_environments([environment])


def frames_per_second(environment: Environment) -> float:
    """The frame rate that shows the environment in real time."""
    return float(environment.metadata.get("render_fps", 30))
