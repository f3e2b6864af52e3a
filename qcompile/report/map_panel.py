"""The panel of a film with a device's qubits: those that the circuits use, and their neighbours."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.passes import Executable
from qcompile.report.lettering import Colour, Picture, width_of, write
from qcompile.report.panels import BODY, DIM, GROUND, INK, MEASURED, SMALL, Box
from qcompile.report.positions import positions_of
from qcompile.report.tables import plural
from qcompile.report.usage import Pair, Usage

_TITLE = 28
_STEP, _LEAST_STEP = 64.0, 32.0
"""Pixels of a coupling: at most, and of a device that is shown whole."""
_AROUND = 1.2
"""What is shown around the qubits in use, in couplings, before the map fills its box."""
_RADIUS, _MARGIN = 0.32, 0.5
_OTHER: Colour = (96, 106, 122)
_FINE = 3
"""Drawn that much larger, and made smaller: its edges are smooth."""


class MapPanel:
    """The map of an executable's device; of a large one what surrounds the qubits in use."""

    def __init__(self, box: Box, executable: Executable):
        self._box, self._executable = box, executable
        self._used = Usage.of(executable)
        self._inside = Box(box.x, box.y + _TITLE, box.width, box.height - _TITLE)
        self._places, self._step = self._fitted(positions_of(executable.device))

    def prepare(self, picture: Picture) -> None:
        """Draw it: it stays the same."""
        device, used = self._executable.device, self._used
        x, y, width, _ = self._box
        couplings = sum(used.gates.values())
        said = f"{plural(len(used.bits), 'qubit')}, {plural(couplings, 'coupling')}"
        write(picture, f"on {device.name}", x, y, BODY, INK)
        write(picture, said, x + width, y, BODY, DIM, align=1)
        self._draw_lattice(picture)
        self._write_numbers(picture)

    def _fitted(self, places: FloatArray) -> tuple[FloatArray, float]:
        """Where the qubits are in the box, (qubits, 2) in pixels, and the length of a coupling."""
        size = np.array([self._inside.width, self._inside.height], dtype=float)
        low, high = places.min(axis=0) - _MARGIN, places.max(axis=0) + _MARGIN
        near = places[[*self._used.bits]]
        least = np.maximum(near.min(axis=0) - _AROUND, low)
        most = np.minimum(near.max(axis=0) + _AROUND, high)
        if (size / (high - low)).min() >= _LEAST_STEP:
            least, most = low, high
        step = min(float((size / (most - least)).min()), _STEP)
        half = size / step / 2
        # What is beyond the device is not shown where there is something to show instead.
        middle = np.clip((least + most) / 2, low + half, np.maximum(high - half, low + half))
        middle = np.where(high - low < 2 * half, (low + high) / 2, middle)
        return (places - middle + half) * step, step

    def _draw_lattice(self, picture: Picture) -> None:
        from PIL import Image, ImageDraw

        box, radius = self._inside, _RADIUS * self._step * _FINE
        image = Image.new("RGB", (box.width * _FINE, box.height * _FINE), GROUND)
        pencil = ImageDraw.Draw(image)
        at = self._places * _FINE
        pairs: set[Pair] = {
            (min(each.qubits), max(each.qubits)) for each in self._executable.device.couplings
        }
        for chosen, colour, share in ((False, _OTHER, 0.25), (True, MEASURED, 0.7)):
            for pair in sorted(self._used.pairs if chosen else pairs):
                ends = [tuple(at[qubit]) for qubit in pair]
                pencil.line(ends, fill=colour, width=round(share * radius))
        for qubit, (x, y) in enumerate(at.tolist()):
            is_used = qubit in self._used.bits
            rim = MEASURED if is_used else _OTHER
            fill = MEASURED if self._used.bits.get(qubit) else GROUND
            corners = (x - radius, y - radius, x + radius, y + radius)
            pencil.ellipse(corners, fill=fill, outline=rim, width=round(0.2 * radius))
        smooth = image.resize((box.width, box.height), Image.Resampling.LANCZOS)
        picture[box.y : box.y + box.height, box.x : box.x + box.width] = np.asarray(smooth)

    def _write_numbers(self, picture: Picture) -> None:
        room = 2 * _RADIUS * self._step
        for qubit, (x, y) in enumerate(self._places.tolist()):
            word, is_used = str(qubit), qubit in self._used.bits
            inside = 0 < x < self._inside.width and 0 < y < self._inside.height
            if not inside or width_of(word, SMALL) > room - 4:
                continue
            colour = GROUND if self._used.bits.get(qubit) else INK if is_used else DIM
            top = round(self._inside.y + y - 0.62 * SMALL)
            write(picture, word, round(self._inside.x + x), top, SMALL, colour, align=0.5)
