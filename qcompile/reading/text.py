"""Reading text and JSON of limited size."""

from __future__ import annotations

import codecs
import json
from collections import Counter
from pathlib import Path
from typing import Any

from qcompile.limits import MAX_FILE_BYTES, MAX_KEYS, MAX_VALUES
from qcompile.reading.files import ContentsError, read_file

_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def decode(contents: bytes) -> str:
    """The text of UTF-8 bytes, with or without a byte order mark.

    Raises:
        ContentsError: the bytes are not UTF-8.
    """
    if contents.startswith(_UTF16):
        raise ContentsError("It is UTF-16 text. Save it as UTF-8.")
    try:
        return contents.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = contents.count(b"\n", 0, error.start) + 1
        raise ContentsError(f"Line {line} is not UTF-8 text.") from error


def load_json(contents: bytes | str, most: int = MAX_VALUES) -> Any:
    """The plain values of a JSON document.

    Raises:
        ContentsError: the text is not JSON, nests too deeply, repeats a key in an object, or has
            more than `most` values, lists and objects included, or MAX_KEYS keys in an object.
    """
    text = decode(contents) if isinstance(contents, bytes) else contents
    if sum(map(text.count, ",[{")) > most:
        raise ContentsError(f"It contains more than {most:,} values.")
    try:
        return json.loads(text, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        why = f"line {error.lineno}, column {error.colno}: {error.msg}"
        raise ContentsError(f"It is not JSON: {why}.") from error
    except RecursionError as error:
        raise ContentsError("Its JSON is nested too deeply.") from error
    except ContentsError:
        raise
    except ValueError as error:  # an integer of thousands of digits
        raise ContentsError("It contains an integer with too many digits.") from error


def check_json(contents: bytes) -> str:
    """The text of a JSON document that `load_json` accepts, for a schema to parse.

    Raises:
        ContentsError: as in `load_json`.
    """
    text = decode(contents)
    load_json(text)
    return text


def read_json(path: str | Path, most: int = MAX_FILE_BYTES) -> str:
    """The text of the JSON document at `path`, checked by `check_json`.

    Raises:
        ContentsError, OSError: as in `read_file` and `check_json`.
    """
    return check_json(read_file(path, most))


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) > MAX_KEYS:
        raise ContentsError(f"One of its objects has more than {MAX_KEYS:,} keys.")
    if len(result) < len(pairs):
        (twice, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise ContentsError(f"The key {ascii(twice)[:60]} appears twice in one object.")
    return result
