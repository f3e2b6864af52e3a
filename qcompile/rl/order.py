"""Episodes of environments that step together, in the order in which they began.

In the order in which they end, short episodes come first: of 64 environments that begin together
the first 20 to end are the 20 shortest, and their average is no estimate of anything. In the order
in which they begin, the episodes of a policy are independent draws from one law.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator

AVERAGED = 20
"""Episodes of an average reward, as in the paper's learning curves."""


class StartOrder:
    """Puts finished episodes of `environments` in the order in which they began.

    An episode is handed on once all that began before it have ended. Environments that began an
    episode at the same decision are ordered by their number.
    """

    def __init__(self, environments: int):
        self._running = [(0, lane) for lane in range(environments)]
        """When each environment began the episode that it is in, and its number."""
        self._waiting: list[tuple[tuple[int, int], float]] = []

    def add(self, decisions: int, reward: float) -> Iterator[float]:
        """The rewards that are next, now that an episode has ended after `decisions` of all.

        `decisions` and `reward` are those of `FinishedEpisode`: environment i of n takes the
        decisions i + 1, i + 1 + n, ...
        """
        time, lane = divmod(decisions - 1, len(self._running))
        heapq.heappush(self._waiting, (self._running[lane], reward))
        self._running[lane] = (time + 1, lane)
        first = min(self._running)
        while self._waiting and self._waiting[0][0] < first:
            yield heapq.heappop(self._waiting)[1]


def in_order_of_start(episodes: Iterable[tuple[int, float]], environments: int) -> Iterator[float]:
    """The rewards of finished episodes, (decisions, reward) each, in the order in which they began.

    Those that began after the first that has not ended are left out.
    """
    order = StartOrder(environments)
    for decisions, reward in episodes:
        yield from order.add(decisions, reward)
