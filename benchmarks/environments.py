"""Train and play environments of all kinds with the generic preset: docs/howto/environments.md.

    python benchmarks/environments.py [--seeds 1] [NAME ...]

Seconds are CPU time of one core. EmptyRoom-v0 needs `pip install minigrid`.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import click
import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box, Discrete

import qcompile

ROWS: dict[str, tuple[int, dict[str, Any]]] = {
    "FrozenLake-v1": (100_000, {"is_slippery": False}),
    "Blackjack-v1": (200_000, {}),
    "MountainCar-v0": (300_000, {}),
    "EmptyRoom-v0": (100_000, {}),
    "Catch-v0": (100_000, {}),
    "CliffWalking-v1": (200_000, {"max_episode_steps": 200}),
    "Taxi-v4": (200_000, {}),
}
"""The training steps and arguments of each environment."""


class Catch(gymnasium.Env[Any, Any]):
    """A ball falls through an image of 8 x 8 bytes; the paddle below goes left, stays or right.

    1 for a ball that is caught, -1 for one that is not.
    """

    observation_space = Box(0, 255, (8, 8, 1), np.uint8)
    action_space = Discrete(3)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.row, self.paddle, self.column = 0, 4, int(self.np_random.integers(8))
        return self._image(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.row += 1
        self.paddle = min(max(self.paddle + int(action) - 1, 0), 7)
        reward = (1.0 if self.paddle == self.column else -1.0) if self.row == 7 else 0.0
        return self._image(), reward, self.row == 7, False, {}

    def _image(self) -> Any:
        image = np.zeros((8, 8, 1), np.uint8)
        image[self.row, self.column] = image[7, self.paddle] = 255
        return image


def empty_room(**arguments: Any) -> Any:
    """MiniGrid's smallest room without its mission text."""
    from minigrid.wrappers import ImgObsWrapper

    return ImgObsWrapper(gymnasium.make("MiniGrid-Empty-5x5-v0", **arguments))


def row(name: str, seed: int) -> str:
    """A line of the table."""
    steps, arguments = ROWS[name]
    started = time.process_time()
    training = qcompile.train(name, steps=steps, env=arguments, seed=seed, progress=False)
    seconds = time.process_time() - started
    assert training.policy is not None
    played = qcompile.run(
        training.policy, shots="exact", episodes=100, seed=10_000, max_steps=500, progress=False
    ).to_dict()
    score = f"{played['mean_reward']:.2f} ± {played['std_reward']:.2f}"
    return f"| {name} | {steps:,} | {seed} | {score} | {seconds:.0f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", default=[*ROWS])
    parser.add_argument("--seeds", type=int, default=1)
    options = parser.parse_args()
    torch.set_num_threads(1)
    gymnasium.register("Catch-v0", Catch)
    gymnasium.register("EmptyRoom-v0", empty_room)
    for name in options.names:
        for seed in range(options.seeds):
            click.echo(row(name, seed))


if __name__ == "__main__":
    main()
