"""Pictures as PNG files, which a notebook shows by itself."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from qcompile.output import write_file


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
