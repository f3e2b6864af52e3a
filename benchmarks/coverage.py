"""The coverage of 95 % intervals of the mean reward: `python benchmarks/coverage.py`.

Plays many episodes of policies at ease and halfway through their training, takes their rewards for
the whole law, draws samples of 5 to 100 episodes from it and counts the intervals that hold its
mean. The laws made up below are those of rewards that crash. About ten minutes on one core.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator

import click
import numpy as np
from numpy.typing import NDArray
from scipy import stats

from qcompile.deploy.deployment import Deployment
from qcompile.deploy.intervals import bootstrap_ci95
from qcompile.deploy.play import play
from qcompile.execution import load_backend
from qcompile.policy import Policy, load_policy
from qcompile.rl.ppo import Trainer
from qcompile.rl.presets import settings_for

Array = NDArray[np.float64]
Interval = Callable[[Array, int], tuple[Array, Array]]

SIZES = (5, 10, 20, 100)
RESAMPLES = 1000
_AT_A_TIME = 250
HALFWAY = {
    "CartPole-v1": {"episodes": 35},
    "Acrobot-v1": {"episodes": 60},
    "LunarLander-v3": {"steps": 300_000},
}
"""The training lengths: rewards still scatter, as on a noisy machine."""
SHIPPED = {"CartPole-v1": "cartpole_1q", "Acrobot-v1": "acrobot", "LunarLander-v3": "lunarlander"}


def rewards_of(policy: Policy, backend: str, shots: int | None, episodes: int) -> Array:
    """The rewards of `episodes` episodes, with readout mitigation if there is noise."""
    mitigation = "none" if backend == "ideal" else "readout"
    rewards = []
    for first in range(0, episodes, _AT_A_TIME):
        deployment = Deployment(
            policy, load_backend(backend), shots=shots, mitigation=mitigation, seed=10**6 + first
        )
        rewards.append(play(deployment, min(_AT_A_TIME, episodes - first)).rewards)
    return np.concatenate(rewards)


def laws(episodes: int) -> Iterator[tuple[str, Array]]:
    """The name and rewards of each distribution."""
    for environment, budget in HALFWAY.items():
        task = environment.partition("-")[0]
        trained = Trainer(environment, settings_for("tuned", environment).changed(**budget), 7)
        policy = trained.train().policy
        assert policy is not None
        yield f"{task}, halfway", rewards_of(policy, "ideal", None, episodes)
        shipped = load_policy(SHIPPED[environment])
        yield f"{task}, shipped", rewards_of(shipped, "ibm_lima", 1024, episodes)
    rng, many = np.random.default_rng(1), 200_000
    crash, land = rng.normal(-120, 60, many), rng.normal(230, 40, many)
    yield "made up: normal", rng.normal(0, 1, many)
    yield "made up: 3 in 10 crash", np.where(rng.random(many) < 0.3, crash, land)
    yield "made up: 1 in 20 crashes", np.where(rng.random(many) < 0.05, crash, land)


def student(samples: Array, seed: int) -> tuple[Array, Array]:
    mean, error = samples.mean(axis=1), stats.sem(samples, axis=1)
    reach = stats.t.isf(0.025, samples.shape[1] - 1) * error
    return mean - reach, mean + reach


def scipy_s(method: str) -> Interval:
    """scipy.stats.bootstrap for every sample."""

    def interval(samples: Array, seed: int) -> tuple[Array, Array]:
        low, high = np.repeat(samples[:, :1], 2, axis=1).T  # of equal rewards: their value
        differ = np.ptp(samples, axis=1) > 0
        if differ.any():
            bounds = stats.bootstrap(
                (samples[differ],),
                np.mean,
                n_resamples=RESAMPLES,
                batch=20,
                axis=1,
                method=method,
                rng=np.random.default_rng(seed),
            ).confidence_interval
            low[differ], high[differ] = bounds.low, bounds.high
        return low, high

    return interval


def ours(samples: Array, seed: int) -> tuple[Array, Array]:
    ends = np.array([bootstrap_ci95(sample, seed, RESAMPLES) for sample in samples])
    return ends[:, 0], ends[:, 1]


METHODS: dict[str, Interval] = {
    "percentile": scipy_s("percentile"),
    "basic": scipy_s("basic"),
    "BCa": scipy_s("BCa"),
    "Student's t": student,
    "qcompile": ours,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=4000, help="of each policy")
    parser.add_argument("--samples", type=int, default=1000, help="of each size")
    options = parser.parse_args()
    columns = ["rewards", "episodes", "all equal", *METHODS, "width, t", "width, qcompile"]
    click.echo(f"| {' | '.join(columns)} |\n|{' --- |' * len(columns)}")
    for name, rewards in laws(options.episodes):
        for size in SIZES:
            count = options.samples if size < 100 else options.samples // 2
            samples = np.random.default_rng(size).choice(rewards, (count, size))
            intervals = {method: interval(samples, size) for method, interval in METHODS.items()}
            held = [
                f"{100 * np.mean((low <= rewards.mean()) & (rewards.mean() <= high)):.0f}"
                for low, high in intervals.values()
            ]
            widths = [
                f"{np.mean(high - low):.3g}"
                for low, high in (intervals["Student's t"], intervals["qcompile"])
            ]
            equal = f"{100 * np.mean(np.ptp(samples, axis=1) == 0):.0f} %"
            line = [name, str(size), equal, *held, *widths]
            click.echo(f"| {' | '.join(line)} |")


if __name__ == "__main__":
    main()
