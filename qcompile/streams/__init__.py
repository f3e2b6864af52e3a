"""Random numbers keyed by seed, purpose, episode and decision, so that every episode repeats.

An ordinary generator hands out its numbers in the order of asking: whoever asks first changes what
all others get. A `Stream` has no order. Each of its numbers is a function of what it is for and
where it is used,

    seed, purpose -> key        episode, decision, circuit, attempt -> counter
    number = Philox4x32-10 of counter and key.

So every draw *repeats*: the same seed, purpose, episode, decision and circuit (for a count also the
same shots and probability) give the same number, alone or in any batch, in any row of it, before or
after any other draw, whatever becomes of the other episodes. Draws that differ in one of the five
are independent, as far as Philox is random; it passes all tests of TestU01's BigCrush. Episode,
decision and circuit count modulo 2**32.

Numbers repeat bit for bit with the same numpy on the same kind of processor. Elsewhere logarithms
may round differently, which changes fewer than one count in 10**9.

Sources:
    J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, "Parallel random numbers: as easy as
    1, 2, 3", SC 2011 (Philox). W. Hörmann, "The generation of binomial random variates", J. Stat.
    Comput. Simul. 46 (1993) 101-110 (BTRS, the rejection of binomial.py).
"""

from qcompile.streams.draws import Draws
from qcompile.streams.stream import Purpose, Stream

__all__ = ["Draws", "Purpose", "Stream"]
