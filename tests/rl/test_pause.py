"""Algorithm 2 of the paper: when updates are held, and which policy is kept."""

from __future__ import annotations

from dataclasses import replace

from qcompile.rl.pause import Pause
from qcompile.rl.ppo import Trainer
from qcompile.rl.rollout import FinishedEpisode
from qcompile.rl.settings import Settings


class Actor:
    """Stands for an actor: its state remembers when it was saved."""

    episode = 0

    def state_dict(self) -> dict[str, int]:
        return {"episode": self.episode}


def scripted(pause: Pause, rewards: list[float]) -> tuple[list[bool], list[int | None]]:
    """The decisions of Algorithm 2 after each of these episodes, and the episode whose policy it
    keeps."""
    actor, held, kept = Actor(), [], []
    for number, reward in enumerate(rewards, 1):
        actor.episode = number
        finished = [FinishedEpisode(number, number, reward, number)]
        held.append(pause.skips(finished, actor))  # type: ignore[arg-type]
        kept.append(pause.best["episode"] if pause.best else None)  # type: ignore[arg-type]
    return held, kept


def test_algorithm_2_holds_good_episodes_and_keeps_the_longest_row() -> None:
    """Rewards, and the running average after each, against the threshold 200:

    250 (250) holds and is kept; 100 (175) updates and ends the row; 300 (216.7), 210 (215) and
    150 (202) hold, as the average is good, and 210 is a row of two; 220 (205) is a row of three;
    0 (175.7) updates; 200 (178.8) is good but begins a new row.
    """
    held, kept = scripted(Pause(200.0), [250, 100, 300, 210, 150, 220, 0, 200])
    assert held == [True, False, True, True, True, True, False, True]
    assert kept == [1, 1, 1, 4, 4, 6, 6, 6]


def test_algorithm_2_goes_on_holding_while_the_average_is_at_the_threshold() -> None:
    """300 and 100 average exactly 200, which has not fallen below 200: the row lasts, 199 ends it.

    Rewards 300 (300), 100 (200), 199 (199.67).
    """
    held, kept = scripted(Pause(200.0), [300, 100, 199])
    assert held == [True, True, False]
    assert kept == [1, 1, 1]


def test_algorithm_2_without_a_threshold_never_holds() -> None:
    held, kept = scripted(Pause(None), [1e6, -1e6, 1e6])
    assert held == [False] * 3
    assert kept == [None] * 3


def test_algorithm_2_forgets_after_twenty_episodes() -> None:
    """One disaster of -5000, then 210 each time: the row grows once the disaster is forgotten.

    Until then the average is below 200 and every good episode begins a new row of one.
    """
    held, kept = scripted(Pause(200.0), [-5000.0, *[210.0] * 25])
    assert held == [False, *[True] * 25]
    # Episode 21 is the first whose last twenty hold no disaster, its row is 1 like that of
    # episode 2, kept long before; 22 makes a row of two, and so on.
    assert kept == [None, *[2] * 20, 22, 23, 24, 25, 26]


def test_algorithm_2_stops_updates_in_training() -> None:
    """Episodes of the clock pay 36 or more: with a threshold of 30 nothing is ever learned."""
    settings = Settings(episodes=3, pause_at=30.0)
    result = Trainer("Clock-v0", settings, 0).train()
    assert not result.policy.theta.any()
    moved = Trainer("Clock-v0", replace(settings, pause_at=None), 0).train()
    assert moved.policy.theta.any()


def test_algorithm_2_returns_the_policy_it_saved() -> None:
    """Every policy that played is noted; the one returned is that of the longest row's end."""
    settings = Settings(episodes=60, actor_lr=0.05, critic_lr=0.05, pause_at=14.0)
    trainer = Trainer("Match-v0", settings, 0)
    played: list[list[float]] = []
    result = trainer.train(lambda episode, progress: played.append(trainer.actor.theta.tolist()))
    _, kept = scripted(Pause(14.0), [episode.reward for episode in result.episodes])
    saved = kept[-1]
    assert saved is not None
    assert played[saved - 1] != played[0]
    assert result.policy.theta.tolist() == played[saved - 1]
