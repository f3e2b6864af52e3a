"""Random numbers keyed by seed, purpose, episode and decision, so that every episode repeats.

An ordinary generator returns numbers in the order of the calls, so each call changes the results of
all later ones. A `Stream` has no order. Each of its numbers is a function of its purpose and its
place,

    seed, purpose -> key        episode, decision, circuit -> counter
    number = Philox4x32-10 of counter and key.

There is one uniform number u for each (seed, episode, decision, circuit), and a count is its
quantile: the smallest k for which the binomial distribution function is at least u. So every draw
*repeats*: the same seed, purpose, episode, decision and circuit (for a count also the same shots
and probability) give the same number, alone or in any row of any batch, before or after any other
draw, whatever happens in other episodes. Draws that differ in one of the five are independent, as
far as Philox is random; it passes all tests of TestU01's BigCrush. Episode, decision and circuit
count modulo 2**32.

Counts increase with the probability. So circuits, devices or settings compared at the same places
share their noise, and nearly equal probabilities give nearly equal counts.

Numbers repeat bit for bit with the same numpy and scipy on the same kind of processor. Elsewhere
rounding may differ, which changes fewer than one count in 10**9.

Sources:
    J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, "Parallel random numbers: as easy as
    1, 2, 3", SC 2011 (Philox). E. A. Cornish, R. A. Fisher, "Moments and cumulants in the
    specification of distributions", Rev. Inst. Int. Stat. 5 (1938) 307-320 (the expansion of
    quantile.py).
"""

from qcompile.streams.draws import Draws
from qcompile.streams.stream import Purpose, Stream

__all__ = ["Draws", "Purpose", "Stream"]
