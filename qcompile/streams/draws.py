"""temporary"""

from __future__ import annotations

import numpy as np

from qcompile.streams.stream import Stream


class Bound:
    def __init__(self, draws, episode, decision):
        self.d, self.e, self.k = draws, episode, decision

    def binomial(self, n, p):
        e = np.asarray(self.e)
        rows = p.shape[0]
        copies = e.size // rows if rows else 1
        q = np.asarray(p).reshape(rows * copies, -1)
        return self.d._shots.binomial(n, q, e.ravel(), np.asarray(self.k).ravel()).reshape(p.shape)


class Draws:
    def __init__(self, seed, circuits):
        self._shots = Stream(seed, "shots")
        self._actions = Stream(seed, "actions")

    def actions(self, episode, decision):
        return self._actions.uniforms(episode, decision)

    def rows(self, episode, decision):
        return Bound(self, episode, decision)
