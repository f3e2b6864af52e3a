"""Arrays of numbers: .npy files and tables of text."""

from __future__ import annotations

import math
import warnings
from io import BytesIO
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from qcompile.reading.files import ContentsError
from qcompile.reading.text import decode

_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_npy(contents: bytes) -> NDArray[Any]:
    """The array of a .npy file: real numbers or booleans, as many as its header says.

    Raises:
        ContentsError: the contents are not those of a complete .npy file.
    """
    file = BytesIO(contents)
    try:
        version = npy.read_magic(file)
        shape, in_columns, dtype = _HEADERS[version](file)
    except Exception as error:  # invalid bytes can make numpy raise any exception
        raise ContentsError("It is not a complete .npy file.") from error
    if dtype.kind not in "biuf":
        raise ContentsError(f"Its entries are of type {ascii(str(dtype))[:60]}, not real numbers.")
    count, room = math.prod(shape), len(contents) - file.tell()
    if min(shape, default=0) < 0 or count * dtype.itemsize != room:
        raise ContentsError(
            f"Its header promises {count:,} numbers of {dtype.itemsize} bytes; "
            f"{room:,} bytes follow."
        )
    try:
        flat = np.frombuffer(contents, dtype, count, file.tell()) if count else np.empty(0, dtype)
        return flat.reshape(shape, order="F" if in_columns else "C")
    except ValueError as error:
        raise ContentsError("Its header has an invalid shape.") from error


def read_table(contents: bytes) -> NDArray[np.float64]:
    """The array of a table of comma-separated numbers, (rows, columns).

    Raises:
        ContentsError: the text is not such a table.
    """
    lines = decode(contents).splitlines()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the caller may refuse an empty table
            return np.loadtxt(lines, delimiter=",", ndmin=2)
    except Exception as error:  # invalid text can make numpy raise several errors
        raise ContentsError(_first_fault(lines)) from error


def _first_fault(lines: list[str]) -> str:
    """A message about the first line that does not fit a table."""
    columns = 0
    for number, line in enumerate(lines, 1):
        text = line.partition("#")[0].strip()
        entries = text.split(",") if text else []
        for entry in entries:
            try:
                float(entry)
            except ValueError:
                return f"Line {number}: {ascii(entry.strip())[:60]} is not a number."
        if entries and columns and len(entries) != columns:
            return f"Line {number} has {len(entries):,} columns, the lines above have {columns:,}."
        columns = len(entries) or columns
    return "It is not a table of comma-separated numbers."
