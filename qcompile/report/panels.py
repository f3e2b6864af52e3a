"""The panels of a film: bars of `<Z>`, and of the probabilities of actions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from qcompile.arrays import FloatArray
from qcompile.report.lettering import Colour, Picture, fitted, width_of, write

GROUND: Colour = (19, 23, 31)
INK: Colour = (240, 240, 240)
DIM: Colour = (160, 168, 180)
_LINE: Colour = (58, 66, 80)
MEASURED: Colour = (86, 180, 233)
IDEAL: Colour = (240, 228, 66)
TAKEN: Colour = (230, 159, 0)
_OTHER: Colour = (0, 114, 178)
"""Sky blue, yellow, orange and blue of Okabe and Ito, on a dark ground."""

BODY, SMALL = 18, 16
"""Heights of letters in pixels: half of them are still read on a phone."""
_TITLE = 28
_NUMBERS = 20
_AXIS = 26
_WIDEST_BAR = 48


class Box(NamedTuple):
    """A part of a picture, in pixels; (`x`, `y`) is its upper left corner."""

    x: int
    y: int
    width: int
    height: int

    def fill(self, picture: Picture, colour: Colour) -> None:
        picture[self.y : self.y + self.height, self.x : self.x + self.width] = colour


class Columns:
    """Upright bars side by side in a box, for values from `low` to `high`, and their numbers."""

    def __init__(self, box: Box, count: int, low: float, high: float):
        self.box, self._low, self._high = box, low, high
        self._unit = int((box.height - 1) / (high - low))
        self._zero = box.y + round(high * self._unit)
        slot = box.width / count
        gap = 0 if slot < 2 else max(1, round(slot / 4))
        self._bar = max(1, min(round(slot) - gap, _WIDEST_BAR))
        self._middles = [box.x + (i + 0.5) * slot for i in range(count)]
        self._overhang = gap // 2
        self.slot = slot

    def row(self, value: float) -> int:
        """The row of pixels that shows a value; those off the scale are at its end."""
        inside = min(max(value, self._low), self._high)
        return self._zero - round(inside * self._unit)

    def line(self, picture: Picture, value: float) -> None:
        """A line across the box."""
        Box(self.box.x, self.row(value), self.box.width, 1).fill(picture, _LINE)

    def bar(self, picture: Picture, i: int, value: float, colour: Colour) -> None:
        """A bar from 0 to the value."""
        ends = sorted([self.row(0.0), self.row(value)])
        left = round(self._middles[i] - self._bar / 2)
        Box(left, ends[0], self._bar, ends[1] - ends[0] + 1).fill(picture, colour)

    def marker(self, picture: Picture, i: int, value: float, colour: Colour) -> None:
        """A thin line across the bar, with a rim of the ground's colour, and a little beyond."""
        width = self._bar + 2 * self._overhang
        left, row = round(self._middles[i] - self._bar / 2) - self._overhang, self.row(value)
        Box(left, row - 2, width, 5).fill(picture, GROUND)
        Box(left, row - 1, width, 3).fill(picture, colour)

    def label(self, picture: Picture, i: int, text: str, colour: Colour) -> None:
        """A word below a bar."""
        below = self.box.y + self.box.height + 3
        write(picture, text, round(self._middles[i]), below, SMALL, colour, align=0.5)


class Expectations:
    """`<Z>` of every circuit: a bar as measured, and a thin line where it would be without noise.

    Bars reach from -1.1 to 1.1: mitigation can lead beyond what circuits can show. Of more circuits
    than the box has pixels for, the first are shown. Observables that are not each circuit's have
    `names`.
    """

    def __init__(self, box: Box, circuits: int, measured: str, names: Sequence[str] = ()):
        inside = Box(
            box.x + _AXIS, box.y + _TITLE, box.width - _AXIS, box.height - _TITLE - _NUMBERS
        )
        self._box, self._measured = box, measured
        self._circuits, self.shown = circuits, min(circuits, inside.width)
        self.columns = Columns(inside, self.shown, -1.1, 1.1)
        self._symbol = "⟨O⟩" if names else "⟨Z⟩"
        fits = all(width_of(name, SMALL) + 6 <= self.columns.slot for name in names)
        self._labels = [*names] if names and fits else [str(i) for i in range(self.shown)]

    def prepare(self, picture: Picture) -> None:
        """Draw what stays the same."""
        x, y, width, _ = self._box
        title = self._symbol + f" of {self.shown:,}" * (self.shown != self._circuits)
        write(picture, title, x, y, BODY, INK)
        right = x + width
        for word, colour, height in (("ideal", IDEAL, 3), (self._measured, MEASURED, 12)):
            write(picture, word, right, y, BODY, DIM, align=1)
            right -= width_of(word, BODY) + 24
            Box(right, y + 12 - height // 2, 18, height).fill(picture, colour)
            right -= 16
        for value, word in ((1.0, "1"), (0.0, "0"), (-1.0, "-1")):
            self.columns.line(picture, value)
            row = self.columns.row(value) - SMALL // 2 - 2
            write(picture, word, x + _AXIS - 8, row, SMALL, DIM, align=1)
        widest = max(width_of(str(self.shown), SMALL), *(width_of(w, SMALL) for w in self._labels))
        every = _every(self.columns.slot, widest + 4)
        for i in range(0, self.shown, every):
            self.columns.label(picture, i, self._labels[i], DIM)

    def draw(self, picture: Picture, z: FloatArray, ideal: FloatArray) -> None:
        """Draw the bars and the lines: `z` and `ideal` (circuits,)."""
        for i in range(self.shown):
            self.columns.bar(picture, i, float(z[i]), MEASURED)
            self.columns.marker(picture, i, float(ideal[i]), IDEAL)


class Actions(Protocol):
    """The probabilities of the actions, and which was taken."""

    def draw(self, picture: Picture, probabilities: FloatArray, taken: int) -> None:
        """Draw them, `probabilities` (actions,)."""
        ...


class ActionRows(Actions):
    """An action in each row: its name, its probability, and a bar of it."""

    def __init__(self, box: Box, names: Sequence[str]):
        self._box = box
        self._pitch = min(box.height // len(names), 60)
        self._bar = min(max(self._pitch - BODY - 11, 4), 18)
        self._share = width_of("100 %", BODY)
        self._names = [fitted(name, box.width - self._share - 8, BODY) for name in names]

    def draw(self, picture: Picture, probabilities: FloatArray, taken: int) -> None:
        x, y, width, _ = self._box
        for i, name in enumerate(self._names):
            ink, colour = (TAKEN, TAKEN) if i == taken else (DIM, _OTHER)
            write(picture, name, x, y, BODY, ink)
            share = f"{100 * probabilities[i]:.0f} %"
            write(picture, share, x + width, y, BODY, ink, align=1)
            bar = Box(x, y + BODY + 5, width, self._bar)
            bar.fill(picture, _LINE)
            bar._replace(width=round(width * float(probabilities[i]))).fill(picture, colour)
            y += self._pitch


class ActionColumns(Actions):
    """An upright bar for each action; the name of the one that was taken is in the title."""

    def __init__(self, box: Box, names: Sequence[str]):
        inside = Box(
            box.x + _AXIS, box.y + _TITLE, box.width - _AXIS, box.height - _TITLE - _NUMBERS
        )
        self._box, self._names = box, names
        self._columns = Columns(inside, len(names), 0.0, 1.0)
        slot = self._columns.slot
        fits = all(name.isdigit() or width_of(name, SMALL) + 6 <= slot for name in names)
        words = [*names] if fits else [str(i) for i in range(len(names))]
        every = _every(slot, max(width_of(word, SMALL) for word in words) + 4)
        self._labels = [word if i % every == 0 else "" for i, word in enumerate(words)]

    def draw(self, picture: Picture, probabilities: FloatArray, taken: int) -> None:
        x, y, width, _ = self._box
        write(picture, "actions", x, y, BODY, INK)
        words = f"{fitted(self._names[taken], 300, BODY)}  {100 * probabilities[taken]:.0f} %"
        write(picture, words, x + width, y, BODY, TAKEN, align=1)
        for value, word in ((1.0, "1"), (0.0, "0")):
            self._columns.line(picture, value)
            row = self._columns.row(value) - SMALL // 2 - 2
            write(picture, word, x + _AXIS - 8, row, SMALL, DIM, align=1)
        for i, label in enumerate(self._labels):
            ink, colour = (TAKEN, TAKEN) if i == taken else (DIM, _OTHER)
            self._columns.bar(picture, i, float(probabilities[i]), colour)
            if label:
                self._columns.label(picture, i, label, ink)


def _every(slot: float, width: int) -> int:
    """Every how many bars have a label of this width, so that none touches the next."""
    return next((step for step in (1, 2, 5, 10, 20, 50) if step * slot >= width), 100)
