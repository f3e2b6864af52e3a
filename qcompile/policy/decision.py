"""Decisions: actions drawn from the softmax of logits."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import FloatArray, IntArray, real_array
from qcompile.characters import is_line
from qcompile.errors import PolicyError
from qcompile.foreign import describe
from qcompile.notebook import count
from qcompile.validation import LINE

MOST_HELD = 1_000_000
"""The most environment steps that a decision can be held for."""


def softmax(logits: FloatArray) -> FloatArray:
    """The probabilities (B, actions) of logits (B, actions)."""
    odds = _odds(logits)
    return np.asarray(odds / odds.sum(axis=1, keepdims=True))


def _odds(logits: FloatArray) -> FloatArray:
    """Probabilities (B, actions), scaled so that the largest in each row is 1."""
    odds = logits - np.maximum.reduce(logits, axis=1, keepdims=True)
    return np.asarray(np.exp(odds, odds))


class Softmax:
    """Draws actions from the softmax of its `logits`.

    Its input values, (B, ...), are the `<Z>` of a policy's circuits or the observations of a
    network.
    """

    reads_bits = False
    """Whether an observation is one whole number whose bits are the inputs."""

    def logits(self, values: FloatArray, /) -> FloatArray:
        """The logarithms of the action probabilities, up to a constant: (B, actions)."""
        raise NotImplementedError

    def probabilities(self, values: FloatArray, /) -> FloatArray:
        """The action probabilities (B, actions)."""
        return softmax(self.logits(values))

    def decide(self, values: FloatArray, /, u: FloatArray) -> IntArray:
        """The actions (B,) for values and uniform numbers u (B,) in [0, 1).

        The action is the first whose cumulative probability exceeds u, so that uniform u draw from
        the exact probabilities; if rounding leaves the sum of a row at or below u, it is the last
        action.

        Raises:
            PolicyError: there is not one u for each row.
        """
        if np.shape(u) != (len(values),):
            raise PolicyError(f"u has shape {np.shape(u)}.", f"It needs {(len(values),)}.")
        sums = np.add.accumulate(_odds(self.logits(values)), axis=1)
        passed = sums[:, :-1] <= (sums[:, -1] * u)[:, np.newaxis]
        return np.asarray(np.add.reduce(passed, axis=1))

    def sample(self, values: FloatArray, /, rng: np.random.Generator) -> IntArray:
        """One action for each row of values, drawn from its exact probabilities."""
        return self.decide(values, rng.random(len(values)))

    def greedy(self, values: FloatArray, /) -> IntArray:
        """The most probable action for each row of values."""
        return np.asarray(self.logits(values).argmax(axis=1))


def checked_observations(
    observations: FloatArray, features: int, reader: str, *, wider: bool
) -> FloatArray:
    """`observations` as a float64 array (B, features), or with more features if `wider`.

    Raises:
        PolicyError: they have another shape or type; the message names `reader`.
    """
    needed = f"{reader} needs (B, {features}){' or wider' * wider}."
    array = real_array(observations)
    if array is None:
        what = describe(observations)
        raise PolicyError(f"Observations are not an array of real numbers: {what}.", needed)
    fits = array.ndim == 2 and array.shape[1] >= features
    if not fits or (array.shape[1] > features and not wider):
        raise PolicyError(f"Observations have shape {array.shape}.", needed)
    return array


def check_hold(hold: int) -> None:
    """Check that a decision can be held for `hold` environment steps.

    Raises:
        PolicyError: it is not a whole number from 1 to MOST_HELD.
    """
    if isinstance(hold, bool) or not isinstance(hold, int) or not 1 <= hold <= MOST_HELD:
        raise PolicyError(
            f"hold is {hold!r}.",
            f"It must be a whole number of environment steps from 1 to {MOST_HELD:,}.",
        )


def check_names(**names: str) -> None:
    """Check that a policy can be called so, and that its environment can.

    Raises:
        PolicyError: one is not a line of text.
    """
    for key, text in names.items():
        if not isinstance(text, str) or not is_line(text):
            raise PolicyError(f"{key} is {text!a}.", f"It must be {LINE}.")


def hold_text(hold: int) -> str:
    """The hold of each decision, in words."""
    return f"held for {count(hold, 'environment step')}"


def hold_values(hold: int) -> dict[str, int]:
    """The key `hold` of a file, omitted if it is 1."""
    return {"hold": hold} if hold > 1 else {}
