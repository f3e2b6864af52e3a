"""Files of torch.save that are damaged, or made to do harm."""

from __future__ import annotations

import io
import zipfile
from typing import Any

import torch

from .case import Command
from .inputs import policy, setting, write

STORAGE = (
    b"(X\x07\x00\x00\x00storagectorch\nFloatStorage\nX\x01\x00\x00\x000X\x03\x00\x00\x00cpuK\x01tQ"
)


def packed(value: Any) -> bytes:
    """What torch.save writes."""
    file = io.BytesIO()
    torch.save(value, file)
    return file.getvalue()


def zipped(kind: int = zipfile.ZIP_STORED, **entries: bytes) -> bytes:
    """The archive of a tensor, some of its entries others, compressed in this way."""
    file = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(packed(torch.ones(1)))) as before,
        zipfile.ZipFile(file, "w", kind) as after,
    ):
        for name in before.namelist():
            after.writestr(name, entries.get(name.partition("/")[2], before.read(name)))
    return file.getvalue()


def pickled(code: bytes) -> bytes:
    return zipped(**{"data.pkl": b"\x80\x02" + code + b"."})


def tensor(arguments: bytes) -> bytes:
    """The archive of a tensor that is rebuilt from these arguments."""
    return pickled(b"ctorch._utils\n_rebuild_tensor_v2\n(" + arguments + b"R")


def endless() -> list[Any]:
    """A list that holds itself."""
    values: list[Any] = []
    values.append(values)
    return values


FILES = {
    "empty.pt": b"",
    "entries.pt": b"PK\x01\x02" * 10_001,
    "byte-order.pt": zipped(byteorder=b"big"),
    "bzip2.pt": zipped(zipfile.ZIP_BZIP2),
    "no-pickle.pt": zipped(**{"data.pkl": b""}),
    "call.pt": pickled(b"cos\nsystem\n(X\x04\x00\x00\x00truetR"),
    "extension.pt": pickled(b"\x82\x01"),
    "memo.pt": pickled(b"Nr\xff\xff\xff\x7f"),
    "outside.pt": pickled(b"(X\x05\x00\x00\x00otherNNNNtQ"),
    "endless.pt": packed(endless()),
    "beyond.pt": tensor(STORAGE + b"K\x00(K\x64t(K\x01tt"),
    "negative.pt": tensor(STORAGE + b"K\x00(J\xff\xff\xff\xfft(K\x01tt"),
    "size-text.pt": tensor(STORAGE + b"K\x00(X\x01\x00\x00\x001t(K\x01tt"),
}


def files() -> None:
    write(FILES)
    large = zipped(zipfile.ZIP_DEFLATED, **{"data/0": bytes(65 * 2**20)})
    write({"many.pt": packed(policy()), "large.pt": large})


CASES = (
    *(f"show {name}" for name in FILES),
    Command("show large.pt", masked=True),
    Command(
        "show many.pt",
        "with 20 values at most",
        setting("qcompile.reading.torch_files.MAX_VALUES", 20),
    ),
    Command(
        "show many.pt",
        "with 20 opcodes at most",
        setting("qcompile.reading.torch_files._MAX_OPCODES", 20),
    ),
)
