"""Damage of every kind: to bytes, tokens, the structure of JSON, and inside archives."""

from __future__ import annotations

import io
import json
import random
import re
import sqlite3
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

Mutate = Callable[[random.Random, bytes], bytes]

_NUMBERS = (
    *("0", "-0.0", "-1", "1e308", "-1e308", "1e309", "5e-324", "1e-300", "NaN", "Infinity"),
    *("2147483648", "9007199254740993", "18446744073709551616", "1e16", "0.1e1", "1_000", "0x1F"),
    *("9" * 400, "9" * 5000, "1" + "0" * 30, "-9223372036854775809", "1e6", "1000001", "3.5"),
)
_PIECES = (
    *("[", "]", "{", "}", '"', ",", ":", "\\", "\\ud800", "null", "true", "\x00", "\x1b[2J", "\n"),
    *("\u202e", "\ufeff", "\u00e9", "θ", "[" * 300, "{" * 100, "((((", ";", "//", "/*", "*/", "π"),
    *("qubit", "gate", "if", "for", "measure", "reset", "pow(2) @", "ctrl @", "const", "x0*x1"),
)
_BYTES = (b"\x00", b"\xff", b"\xff\xfe", b"\xef\xbb\xbf", b"\x80", b"\xed\xa0\x80", b"PK\x05\x06")
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|-?\d[\w.+-]*|\w+|\s+|.', re.DOTALL)
_NUMBER = re.compile(r"-?\d[\d.]*(?:e[+-]?\d+)?")


def of_bytes(rng: random.Random, contents: bytes) -> bytes:
    """Change, drop, double or insert a few bits, bytes or stretches."""
    data = bytearray(contents)
    for _ in range(rng.choice((1, 1, 1, 2, 4, 16))):
        at = rng.randrange(len(data) + 1)
        length = rng.choice((1, 2, 4, 8, rng.randrange(1, 200)))
        match rng.randrange(8):
            case 0 | 1 if at < len(data):
                data[at] ^= 1 << rng.randrange(8)
            case 2 if at < len(data):
                data[at] = rng.randrange(256)
            case 3:
                del data[at:]
            case 4:
                del data[at : at + length]
            case 5:
                data[at:at] = data[at : at + length]
            case 6:
                data[at:at] = rng.choice((rng.randbytes(length), *_BYTES))
            case _:
                other = rng.randrange(len(data) + 1)
                data[at : at + length] = data[other : other + length]
    return bytes(data)


def of_tokens(rng: random.Random, contents: bytes) -> bytes:
    """Swap, drop, double or replace words, numbers and symbols; sometimes recode the text."""
    tokens = _TOKEN.findall(contents.decode("utf-8", "replace")) or [""]
    for _ in range(rng.choice((1, 1, 2, 3, 8))):
        at, other = rng.randrange(len(tokens)), rng.randrange(len(tokens))
        match rng.randrange(7):
            case 0:
                tokens[at], tokens[other] = tokens[other], tokens[at]
            case 1:
                tokens[at] = ""
            case 2:
                tokens[at] *= rng.choice((2, 3, 50))
            case 3:
                tokens[at] = rng.choice(_PIECES)
            case 4:
                numbers = [i for i, token in enumerate(tokens) if _NUMBER.fullmatch(token)]
                tokens[rng.choice(numbers or [at])] = rng.choice(_NUMBERS)
            case 5:
                tokens[at] = tokens[other]
            case _:
                tokens[at] += rng.choice((*_NUMBERS, *_PIECES))
    text = "".join(tokens)
    encoding = rng.choice((*["utf-8"] * 30, "utf-8-sig", "utf-16", "utf-16-be", "latin-1"))
    return text.encode(encoding, "replace")


def of_json(rng: random.Random, contents: bytes) -> bytes:
    """Replace, move, double or drop values of a JSON document, or rename keys."""
    document = json.loads(contents)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        document = _changed(rng, document)
    return json.dumps(document).encode()


def _changed(rng: random.Random, document: Any) -> Any:
    """The document with one value changed."""
    places = list(_places(document))
    if not places:
        return _odd(rng, document)
    holder, key = rng.choice(places)
    match rng.randrange(7):
        case 0 | 1 | 2:
            holder[key] = _odd(rng, holder[key])
        case 3:
            del holder[key]
        case 4:
            source, name = rng.choice(places)
            holder[key] = json.loads(json.dumps(source[name]))
        case 5 if isinstance(holder, list):
            holder.insert(key, json.loads(json.dumps(holder[key])))
        case 6 if isinstance(holder, dict):
            holder[rng.choice((key.upper(), "", "x" * 300, "\x1b[2J", "θ"))] = holder.pop(key)
        case _ if isinstance(holder, list):
            rng.shuffle(holder)
    return document


def _places(value: Any) -> Any:
    """The pairs (container, key) of everything nested in a value."""
    if not isinstance(value, dict | list):
        return
    for key in value if isinstance(value, dict) else range(len(value)):
        yield value, key
        yield from _places(value[key])


def _odd(rng: random.Random, value: Any) -> Any:
    """A replacement for `value`, near it or far from it."""
    deep: Any = 1
    for _ in range(rng.choice((3, 50, 250))):
        deep = [deep] if rng.random() < 0.5 else {"a": deep}
    near: list[Any] = [None]
    if isinstance(value, int | float):
        near = [-value, value + 1, value * 1000, str(value)[:400], 0.5]
    elif isinstance(value, str):
        near = [value + "x", value[:-1], value * 100, value.upper(), "\x1b[31m" + value, ""]
    elif isinstance(value, list | dict):
        near = [[], {}, list(value) * 3, [value]]
    far = [None, True, 0, -1, 1e308, -1e308, 5e-324, 2**63, 10**400, float("nan"), float("inf")]
    far += ["", "a" * 5000, "x0", "\u202e", "../../etc", [], {}, [[]], deep, [1] * 3000]
    return rng.choice(near if rng.random() < 0.5 else far)


def of_npy(rng: random.Random, contents: bytes) -> bytes:
    """Change the header of a .npy file, and correct its stated length."""
    header, data = contents[10:128].decode("latin-1"), contents[128:]
    if rng.random() < 0.5:
        shape = ", ".join(rng.choice(("2", "4", "0", "-1", *_NUMBERS)) for _ in range(3))
        header = re.sub(r"\(.*?\)", f"({shape[: rng.randrange(1, 40)]})", header)
    else:
        kinds = ("'|O'", "'<U2'", "'>f2'", "'<c16'", "'<M8[s]'", "'<f16'", "'|b1'", "'|V99'", "[]")
        header = header.replace("'<f8'", rng.choice(kinds))
    if rng.random() < 0.5:
        header = of_tokens(rng, header.encode()).decode("latin-1")
    coded = header.encode("latin-1")[:65535]
    return contents[:8] + len(coded).to_bytes(2, "little") + coded + data


def of_archive(rng: random.Random, contents: bytes) -> bytes:
    """Change entries of a torch.save file, and rebuild the archive."""
    buffer = io.BytesIO()
    packed = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with zipfile.ZipFile(io.BytesIO(contents)) as old, zipfile.ZipFile(buffer, "w", packed) as new:
        names = old.namelist()
        chosen = rng.choice((*[n for n in names if n.endswith(".pkl")] * len(names), *names))
        for name in names:
            data = old.read(name)
            if name == chosen:
                inside = name.endswith(".pkl") and rng.random() < 0.7
                data = (_of_pickle if inside else of_bytes)(rng, data)
            elif rng.random() < 0.02:
                continue
            new.writestr(name, data)
    return buffer.getvalue()


def _of_pickle(rng: random.Random, data: bytes) -> bytes:
    """Change numbers and texts of a pickle in place, and JSON in it as JSON."""
    text = re.compile(rb"X(....)", re.DOTALL)
    places = [m for m in text.finditer(data) if int.from_bytes(m[1], "little") < len(data)]
    place = rng.choice(places)
    end = place.end() + int.from_bytes(place[1], "little")
    text = data[place.end() : end]
    with suppress(ValueError, UnicodeDecodeError):
        text = rng.choice((of_tokens, of_json if text[:1] in b"[{" else of_tokens))(rng, text)
    if rng.random() < 0.4:
        number = rng.choice(list(re.finditer(rb"K.|J....|M..", data, re.DOTALL)))
        odd = rng.choice((b"K\x00", b"Kd", b"J\xff\xff\xff\xff", b"J\xff\xff\xff\x7f", b"N", b"]"))
        return data[: number.start()] + odd + data[number.end() :]
    return data[: place.start()] + b"X" + len(text).to_bytes(4, "little") + text + data[end:]


def of_sqlite(rng: random.Random, contents: bytes) -> bytes:
    """Change a value in a table of an SQLite file, or drop it or its table."""
    with sqlite3.connect(":memory:") as database:
        database.deserialize(contents)
        tables = [row[0] for row in database.execute("SELECT name FROM sqlite_master")]
        table = rng.choice([name for name in tables if not name.startswith("sqlite_")])
        columns = [row[1] for row in database.execute(f"PRAGMA table_info({table})")]
        column = rng.choice(columns)
        row = database.execute(f"SELECT {column} FROM {table} LIMIT 1").fetchone()
        value = row[0] if row else None
        if isinstance(value, bytes):
            value = rng.choice((of_bytes, of_npy))(rng, value)
        elif isinstance(value, str) and value[:1] == "{":
            value = of_json(rng, value.encode()).decode()
        else:
            value = rng.choice(
                (None, -1, 2**62, 1e300, float("inf"), "", "x" * 999, b"\x00", "\x1b[2J", value)
            )
        if rng.random() < 0.05:
            database.execute(f"DROP TABLE {table}")
        elif rng.random() < 0.05:
            database.execute(f"DELETE FROM {table}")
        else:
            with suppress(sqlite3.Error, OverflowError):
                database.execute(f"UPDATE {table} SET {column} = ?", (value,))
        database.commit()
        return database.serialize()


KINDS: dict[str, tuple[Mutate, ...]] = {
    "json": (of_bytes, of_tokens, of_json, of_json),
    "text": (of_bytes, of_tokens, of_tokens),
    "npy": (of_bytes, of_npy, of_npy),
    "pt": (of_bytes, of_archive, of_archive, of_archive),
    "sqlite": (of_bytes, of_bytes, of_sqlite),
}
"""The mutations for each kind of file."""


def mutated(kind: str, key: str, seeds: list[bytes]) -> bytes:
    """The input that `key` stands for: one of `seeds` damaged, or two of them spliced."""
    rng = random.Random(key)
    contents = rng.choice(seeds)
    if rng.random() < 0.05:
        other = rng.choice(seeds)
        return contents[: rng.randrange(len(contents))] + other[rng.randrange(len(other)) :]
    kinds = list(KINDS[kind])
    rng.shuffle(kinds)
    for mutate in kinds:
        with suppress(ValueError, IndexError, OverflowError, RecursionError):
            return mutate(rng, contents)
    return of_bytes(rng, contents)


def read_all(folder: Path, *patterns: str) -> list[bytes]:
    """The contents of the files that match."""
    return [path.read_bytes() for pattern in patterns for path in sorted(folder.glob(pattern))]
