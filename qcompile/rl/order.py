"""Orders episodes of parallel environments by when they began.

Ordered by their end, short episodes come first: of 64 environments that begin together, the first
20 to end are the 20 shortest, and their average is biased. Ordered by their beginning, the episodes
of a policy are independent draws from one distribution.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator

AVERAGED = 20
"""The number of episodes in an average reward, as in the paper's learning curves."""


class StartOrder:
    """Puts finished episodes of `environments` environments in the order they began.

    An episode is released once all that began before it have ended. Episodes that began at the same
    decision are ordered by environment.
    """

    def __init__(self, environments: int):
        self._running = [(0, lane) for lane in range(environments)]
        """When each environment began its current episode, and its number."""
        self._waiting: list[tuple[tuple[int, int], float]] = []

    def add(self, decisions: int, reward: float) -> Iterator[float]:
        """The rewards released when an episode ends after `decisions` decisions in total.

        `decisions` and `reward` are as in `FinishedEpisode`: environment i of n takes decisions i +
        1, i + 1 + n, ...
        """
        time, lane = divmod(decisions - 1, len(self._running))
        heapq.heappush(self._waiting, (self._running[lane], reward))
        self._running[lane] = (time + 1, lane)
        first = min(self._running)
        while self._waiting and self._waiting[0][0] < first:
            yield heapq.heappop(self._waiting)[1]


def in_order_of_start(episodes: Iterable[tuple[int, float]], environments: int) -> Iterator[float]:
    """The rewards of finished episodes, given as (decisions, reward), in the order they began.

    Episodes that began after the first unfinished one are left out.
    """
    order = StartOrder(environments)
    for decisions, reward in episodes:
        yield from order.add(decisions, reward)
