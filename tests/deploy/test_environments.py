"""Environments that cannot be made or filmed are refused before anything is played."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

from qcompile.deploy.environments import close_environments, make_environments
from qcompile.errors import EnvironmentMismatchError


class Blind(gymnasium.Env[Any, Any]):
    """Renders `frame` at `rate` per second, or raises it if it is an exception."""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"]}

    def __init__(self, frame: Any = None, rate: float = 30, render_mode: str | None = None):
        self.observation_space = Box(-1, 1, (4,), np.float32)
        self.action_space = Discrete(2)
        self.frame, self.render_mode = frame, render_mode
        self.metadata = self.metadata | {"render_fps": rate}

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        return np.zeros(4, np.float32), {}

    def render(self) -> Any:
        if isinstance(self.frame, Exception):
            raise self.frame
        return self.frame


class Plain(Blind):
    """Takes no arguments, and numbers its actions from 1."""

    def __init__(self) -> None:
        super().__init__()
        self.action_space = Discrete(2, start=1)


def broken(**_: Any) -> gymnasium.Env[Any, Any]:
    raise ZeroDivisionError("no wheels\nat all")


def unfinished(**_: Any) -> gymnasium.Env[Any, Any]:
    raise ImportError("it needs wheels: pip install wheels")


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    entries = {
        "Blind-v0": Blind,
        "Plain-v0": Plain,
        "Broken-v0": broken,
        "Unfinished-v0": unfinished,
    }
    for name, entry in entries.items():
        gymnasium.register(name, entry, disable_env_checker=True)
    yield
    for name in entries:
        del gymnasium.registry[name]


def refused(name: str, **options: Any) -> str:
    with pytest.raises(EnvironmentMismatchError) as caught:
        make_environments(name, 1, **options)
    message = str(caught.value)
    assert len(message) < 400
    return message


def test_a_package_that_is_missing_is_the_environments_own() -> None:
    """gymnasium's compatibility with gym needs shimmy: no package of ours."""
    assert "needs a package that is not installed.\n  To use the gym" in refused(
        "GymV21Environment-v0"
    )
    assert refused("Unfinished-v0").endswith("installed.\n  it needs wheels: pip install wheels")


def test_an_environment_that_takes_no_arguments_is_made() -> None:
    made = make_environments("Plain-v0", 2)
    assert [type(environment.unwrapped) for environment in made] == [Plain, Plain]


def test_an_environment_whose_own_code_fails_is_named() -> None:
    assert refused("Broken-v0") == "Environment 'Broken-v0' cannot be made.\n  no wheels"


@pytest.mark.parametrize("name", ["Nope-v0", "Hoper-v0", "CartPole-v7", "", "a b", "x/y/z-v1"])
def test_an_unknown_environment_is_called_so(name: str) -> None:
    message = refused(name)
    assert message.startswith(f"Unknown environment {name!r}.\n")
    assert "doesn't exist. Did you mean" not in message, "gymnasium's own guess, like it or not"


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"frame": None}, "A frame is None, 30 a second."),
        ({"frame": "text"}, "A frame is a str and shape (), 30 a second."),
        ({"frame": np.zeros((4, 5))}, "A frame is of type float64 and shape (4, 5), 30 a second."),
        (
            {"frame": np.zeros((4, 5, 3))},
            "is of type float64 and shape (4, 5, 3), 30 a",
        ),
        ({"frame": np.zeros((4, 5, 3), np.uint8), "rate": 0}, "(4, 5, 3), 0 a second."),
        ({"frame": NotImplementedError()}, "it renders no pictures."),
        ({"frame": ImportError("no pygame")}, "no pygame"),
    ],
)
def test_what_renders_no_frames_is_not_filmed(settings: dict[str, Any], words: str) -> None:
    gymnasium.registry["Blind-v0"].kwargs = settings
    assert len(make_environments("Blind-v0", 1)) == 1
    message = refused("Blind-v0", film=True)
    assert message.startswith("Environment 'Blind-v0' cannot be filmed: it renders no pictures.")
    assert words in message
    assert message.endswith("Run without video.")


def test_what_takes_no_render_mode_is_not_filmed() -> None:
    assert refused("Plain-v0", film=True) == (
        "Environment 'Plain-v0' cannot be filmed: it renders no pictures.\n"
        "  Plain.__init__() got an unexpected keyword argument 'render_mode'\n"
        "  Run without video."
    )


def test_what_renders_frames_is_filmed() -> None:
    gymnasium.registry["Blind-v0"].kwargs = {"frame": np.zeros((4, 5, 3), np.uint8)}
    assert len(make_environments("Blind-v0", 1, film=True)) == 1


def test_an_environment_that_fails_to_close_loses_nothing() -> None:
    class Closed:
        def close(self) -> None:
            closed.append(self)
            raise RuntimeError("the window is gone")

    closed: list[Closed] = []
    close_environments([Closed(), Closed()])  # type: ignore[list-item]
    assert len(closed) == 2
