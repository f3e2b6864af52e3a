"""Reading TOML of limited size."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from qcompile.limits import MAX_FILE_BYTES
from qcompile.reading.files import ContentsError, read_file
from qcompile.reading.text import decode


def read_toml(path: str | Path, most: int = MAX_FILE_BYTES) -> dict[str, Any]:
    """The plain values of the TOML document at `path`.

    Raises:
        ContentsError, OSError: as in `read_file`; the file is not TOML, or nests too deeply.
    """
    try:
        return tomllib.loads(decode(read_file(path, most)))
    except tomllib.TOMLDecodeError as error:
        raise ContentsError(f"It is not TOML: {error}.") from error
    except ValueError as error:  # a number with thousands of digits, or an invalid time
        raise ContentsError("Its TOML contains an invalid number or time.") from error
    except RecursionError as error:
        raise ContentsError("Its TOML is nested too deeply.") from error
