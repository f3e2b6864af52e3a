"""Pictures as PNG files, which a notebook shows by itself."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from qcompile.output import write_file

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Of Okabe and Ito, which colour-blind readers tell apart; black is the last."""


@dataclass(frozen=True, repr=False)
class Figure:
    """A picture, drawn: `png` holds the bytes of its file."""

    png: bytes

    def save(self, path: str | PathLike[str]) -> None:
        """Write the picture to a .png file, which is overwritten.

        Raises:
            OutputError: the file cannot be written.
        """
        write_file(Path(path), self.png)

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return f"Figure({len(self.png):,} bytes; .save('figure.png') writes it)"
