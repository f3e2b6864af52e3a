"""The pictures of a film: the environment, `<Z>` of its circuits, the actions and the reward."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from qcompile.deploy.filming import Frame
from qcompile.deploy.player import Player
from qcompile.notebook import reward_text
from qcompile.passes import Executable
from qcompile.policy import AnyPolicy, Policy
from qcompile.report.circuit_words import product_words
from qcompile.report.lettering import Picture, fitted, write
from qcompile.report.map_panel import MapPanel
from qcompile.report.panels import (
    BODY,
    DIM,
    GROUND,
    INK,
    ActionColumns,
    ActionRows,
    Actions,
    Box,
    Expectations,
)
from qcompile.report.summary import kind_words

WIDTH = 640
"""Pixels: letters stay legible where a phone or a page shows half of them."""

_MARGIN, _GAP = 20, 14
_INNER = WIDTH - 2 * _MARGIN
_HEADER, _TITLE, _FIGURES = 76, 20, 190
_PANEL = 176
_WIDE = 1.25
"""Pictures that are less wide, by their height, have the actions beside them."""
_TALLEST, _BESIDE = 400, 340
_MOST_BELOW, _MOST_BESIDE = 5, 8
"""Actions that have a row each, to the right of `<Z>` or of the picture."""
_MOST_SHARING = 60
"""Circuits that share a panel with the actions."""
_SHARE = 384


class Scene:
    """Draws the frames of a film of what a player plays, 640 pixels wide and all of one height.

    Circuits have bars of `<Z>`, and those of several qubits the map of their device, if it has
    couplings; a network has the probabilities of its actions alone.
    """

    def __init__(self, player: Player):
        shots = player.settings.shots
        self._title = f"{player.policy.name} on {player.backend}"
        self._circuits = int(player.sizes()["circuits_per_step"])
        self._holds = player.policy.hold > 1
        exact = "exact" if shots is None else f"{shots:,} shots"
        self._below = f"{kind_words(player.kind)}, {exact}" if self._circuits else "network"
        mitigated = player.settings.mitigation not in (None, "none")
        self._measured = "mitigated" if mitigated else "exact" if shots is None else "measured"
        self._observables = _names(player.policy)
        self._executable = player.executable
        self._layout: _Layout | None = None

    def draw(self, frame: Frame) -> Picture:
        """The frame as a picture, (height, 640, 3); its height is even."""
        if self._layout is None:
            bars = len(frame.decision.z) if self._circuits else 0
            said = self._measured, self._observables
            self._layout = _Layout(frame, bars, *said, self._executable)
            self._write_titles(self._layout.ground)
        layout, decision = self._layout, frame.decision
        picture = layout.ground.copy()
        _place(picture, layout.picture, frame.picture)
        right = WIDTH - _MARGIN
        write(picture, f"reward {reward_text(frame.reward)}", right, 14, _TITLE, INK, align=1)
        step = f"step {frame.step}" + f", decision {decision.number + 1}" * self._holds
        write(picture, step, right, 44, BODY, DIM, align=1)
        if layout.expectations is not None:
            layout.expectations.draw(picture, decision.z, decision.ideal)
        layout.actions.draw(picture, decision.probabilities, frame.action)
        return picture

    def _write_titles(self, ground: Picture) -> None:
        width = _INNER - _FIGURES
        title = fitted(self._title, width, _TITLE, bold=True)
        write(ground, title, _MARGIN, 14, _TITLE, INK, bold=True)
        width -= 40 * self._holds
        write(ground, fitted(self._below, width, BODY), _MARGIN, 44, BODY, DIM)


class _Layout:
    """Where everything is, from the first frame: beside each other where there is room for it."""

    def __init__(
        self,
        frame: Frame,
        circuits: int,
        measured: str,
        observables: Sequence[str],
        executable: Executable | None,
    ):
        height, width = frame.picture.shape[:2]
        names, count = frame.names, len(frame.names)
        is_beside = width < _WIDE * height and count <= _MOST_BESIDE
        most = _BESIDE if is_beside else _INNER
        size = _fitting(width, height, most, _BESIDE if is_beside else _TALLEST)
        tall = _BESIDE if is_beside else size[1]
        self.picture = Box(_MARGIN, _HEADER, most, tall)
        y = _HEADER + tall + _GAP
        self.expectations: Expectations | None = None
        self.actions: Actions
        is_shared = not is_beside and count <= _MOST_BELOW and 0 < circuits <= _MOST_SHARING
        if circuits:
            width = _SHARE if is_shared else _INNER
            panel = Box(_MARGIN, y, width, _PANEL)
            self.expectations = Expectations(panel, circuits, measured, observables)
            x = _MARGIN + width + 2 * _GAP
            if is_shared:
                self.actions = ActionRows(Box(x, y, WIDTH - _MARGIN - x, _PANEL), names)
            y += _PANEL + _GAP
        device_map = None
        if executable is not None and executable.source.is_wide and executable.device.couplings:
            device_map = MapPanel(Box(_MARGIN, y, _INNER, _PANEL), executable)
            y += _PANEL + _GAP
        if is_beside:
            x = _MARGIN + _BESIDE + _MARGIN
            self.actions = ActionRows(Box(x, _HEADER, WIDTH - _MARGIN - x, _BESIDE), names)
        elif not is_shared:
            self.actions = ActionColumns(Box(_MARGIN, y, _INNER, _PANEL), names)
            y += _PANEL + _GAP
        self.ground = np.full((y + y % 2, WIDTH, 3), GROUND, dtype=np.uint8)
        for part in (self.expectations, device_map):
            if part is not None:
                part.prepare(self.ground)


def _names(policy: AnyPolicy) -> list[str]:
    """What the bars show, where they are not the `<Z>` of each circuit."""
    if not isinstance(policy, Policy) or not policy.program.has_products:
        return []
    return [product_words(bits)[1:-1] for bits in policy.program.measured]


def _fitting(width: int, height: int, most_wide: int, most_high: int) -> tuple[int, int]:
    """The size of a picture (width, height) that fits, sharp where it can be.

    Pictures nearly as large as that keep their size, and so their thin lines; small ones grow by
    whole numbers.
    """
    scale = min(most_wide / width, most_high / height)
    if scale >= 2:
        scale = int(scale)
    elif 1 < scale < 1.25:
        scale = 1
    return max(1, round(width * scale)), max(1, round(height * scale))


def _place(picture: Picture, box: Box, rendered: Picture) -> None:
    """Put what an environment rendered into the middle of the box."""
    from PIL import Image

    width, height = _fitting(rendered.shape[1], rendered.shape[0], box.width, box.height)
    if (height, width) != rendered.shape[:2]:
        is_whole = width % rendered.shape[1] == 0 and height % rendered.shape[0] == 0
        how = Image.Resampling.NEAREST if is_whole else Image.Resampling.LANCZOS
        rendered = np.asarray(Image.fromarray(rendered).resize((width, height), how))
    x, y = box.x + (box.width - width) // 2, box.y + (box.height - height) // 2
    picture[y : y + height, x : x + width] = rendered
