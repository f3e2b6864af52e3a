"""Files of torch.save: read without torch's reader, in bounded memory, without running code."""

from __future__ import annotations

import io
import os
import pickle
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from qcompile.limits import MAX_FILE_BYTES
from qcompile.reading import CodeError, ContentsError, read_torch


def saved(value: Any) -> bytes:
    file = io.BytesIO()
    torch.save(value, file)
    return file.getvalue()


def rezipped(contents: bytes, packed: int = zipfile.ZIP_STORED, **entries: bytes) -> bytes:
    """The same archive, some of its entries others, packed in some way."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(contents)) as old, zipfile.ZipFile(made, "w", packed) as new:
        for name in old.namelist():
            new.writestr(name, entries.get(name.partition("/")[2], old.read(name)))
    return made.getvalue()


def pickled(code: bytes) -> bytes:
    """An archive with this pickle."""
    return rezipped(saved(0), **{"data.pkl": b"\x80\x02" + code + b"."})


def same(left: Any, right: Any) -> bool:
    if torch.is_tensor(left):
        return left.dtype == right.dtype and torch.equal(left, right)
    if isinstance(left, dict):
        return list(left) == list(right) and all(same(left[k], right[k]) for k in left)
    if isinstance(left, list | tuple):
        return len(left) == len(right) and all(map(same, left, right))
    return type(left) is type(right) and left == right


VALUES = {
    "plain": {"a": [1, -2, 2**40, 2**70, 0.5, True, None, "θ"], "b": (1, ("x",), ()), "c": {}},
    "types": [torch.arange(3).to(t) for t in (torch.bfloat16, torch.int8, torch.bool)],
    "shapes": [torch.zeros(()), torch.zeros(0), torch.zeros(2, 0), torch.ones(2, 3, 4)],
    "views": [torch.arange(12.0).reshape(3, 4).T, torch.arange(9)[2:8:3], torch.ones(1).expand(5)],
    "model": torch.nn.Linear(3, 2).state_dict(),
    "parameter": torch.nn.Parameter(torch.ones(2)).detach(),
    "complex": torch.tensor([1 + 2j]),
}


@pytest.mark.parametrize("name", VALUES)
def test_files_of_torch_save_are_read(name: str) -> None:
    contents = saved(VALUES[name])
    expected = torch.load(io.BytesIO(contents), weights_only=True)
    assert same(read_torch(contents), expected)
    assert same(read_torch(rezipped(contents, zipfile.ZIP_DEFLATED)), expected)


def test_a_tensor_that_expands_is_not_built() -> None:
    """A file of 1 kB whose tensor has 8 TB."""
    contents = saved(torch.zeros(1, dtype=torch.float64).expand(10**6, 10**6))
    with pytest.raises(ContentsError, match="more numbers than the file"):
        read_torch(contents)


def test_many_small_expansions_are_counted_together() -> None:
    one = torch.zeros(1)
    with pytest.raises(ContentsError, match="more numbers than the file"):
        read_torch(saved([one.expand(1000 + i) for i in range(1000)]))


def test_an_archive_that_unpacks_to_too_much_is_refused() -> None:
    packed = rezipped(saved(torch.zeros(MAX_FILE_BYTES // 4)), zipfile.ZIP_DEFLATED)
    assert len(packed) < 200_000
    with pytest.raises(ContentsError, match="Unpacked it has"):
        read_torch(packed)


def test_an_entry_that_lies_about_its_size() -> None:
    """Its directory says 4 bytes; they unpack to 50 MB."""
    contents = rezipped(
        saved(torch.zeros(1)), zipfile.ZIP_DEFLATED, **{"data/0": bytes(50 * 2**20)}
    )
    true, told = struct.pack("<I", 50 * 2**20), struct.pack("<I", 4)
    with pytest.raises(ContentsError, match="not a complete file"):
        read_torch(contents.replace(true, told))


def test_values_that_refer_to_each_other_are_counted_where_they_stand(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """200 bytes that stand for 10^13 values."""
    value: Any = [0] * 10
    for _ in range(12):
        value = [value] * 10
    monkeypatch.setattr("qcompile.reading.torch_files.MAX_VALUES", 1000)
    with pytest.raises(ContentsError, match="more than 1,000 values"):
        read_torch(saved(value))


def test_more_opcodes_than_values_can_need_are_not_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """A list is a byte in the file and 56 in memory."""
    monkeypatch.setattr("qcompile.reading.torch_files._MAX_OPCODES", 3000)
    with pytest.raises(ContentsError, match="more than 1,000,000 values"):
        read_torch(pickled(b"]" * 3001))


def test_values_that_hold_themselves() -> None:
    value: list[Any] = []
    value.append(value)
    with pytest.raises(ContentsError, match="nested too deeply"):
        read_torch(saved(value))


STORAGE = (
    b"(X\x07\x00\x00\x00storagectorch\nFloatStorage\nX\x01\x00\x00\x000X\x03\x00\x00\x00cpuK\x01tQ"
)

TENSORS = {
    "beyond its storage": STORAGE + b"K\x00(K\x64t(K\x01tt",
    "by its offset": STORAGE + b"K\x64(K\x01t(K\x01tt",
    "by its stride": STORAGE + b"K\x00(K\x02t(K\x64tt",
    "a negative size": STORAGE + b"K\x00(J\xff\xff\xff\xfft(K\x01tt",
    "a negative offset": STORAGE + b"J\xff\xff\xff\xff(K\x01t(K\x01tt",
    "a stride less": STORAGE + b"K\x00(K\x01K\x01t(K\x01tt",
    "a size of text": STORAGE + b"K\x00(X\x01\x00\x00\x001t(K\x01tt",
    "no storage": b"K\x00K\x00(K\x01t(K\x01tt",
}


def tensor(arguments: bytes) -> bytes:
    """An archive with the number 7 and a tensor of it."""
    code = b"\x80\x02ctorch._utils\n_rebuild_tensor_v2\n(" + arguments + b"R."
    return rezipped(saved(torch.full((1,), 7.0)), **{"data.pkl": code})


@pytest.mark.parametrize("name", TENSORS)
def test_a_tensor_of_another_shape_than_its_numbers(name: str) -> None:
    with pytest.raises(ContentsError):
        read_torch(tensor(TENSORS[name]))


def test_a_tensor_of_the_shape_of_its_numbers() -> None:
    found = read_torch(tensor(STORAGE + b"K\x00(K\x01t(K\x01tt"))
    assert torch.equal(found, torch.full((1,), 7.0))


class Touch:
    """Pickled, this is code that makes a folder when it is opened."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
        return os.mkdir, (str(self.path),)


def test_code_is_not_run(tmp_path: Path) -> None:
    contents = saved({"a": Touch(tmp_path / "marker")})
    with pytest.raises(CodeError, match="more than tensors and plain values"):
        read_torch(contents)
    assert not (tmp_path / "marker").exists()
    torch.load(io.BytesIO(contents), weights_only=False)
    assert (tmp_path / "marker").exists(), "the pickle carries no code: the test shows nothing"


CODES = {
    "a call": b"cos\nsystem\n(X\x04\x00\x00\x00truetR",
    "by stack": b"\x8c\x02os\x8c\x06system\x93",
    "an instance": b"(X\x04\x00\x00\x00trueios\nsystem\n",
    "an extension": b"\x82\x01",
    "bytes of bytes": b"cbuiltins\nbytearray\nJ\xff\xff\xff\x7f\x85R",
}


@pytest.mark.parametrize("name", CODES)
def test_other_ways_to_call_something(name: str) -> None:
    with pytest.raises(CodeError):
        read_torch(pickled(CODES[name]))


WRONG = {
    "empty": b"",
    "text": b"format: torch",
    "a bare pickle": pickle.dumps({"a": 1}),
    "an older form": b"",
    "no pickle": rezipped(saved(0), **{"data.pkl": b""}),
    "a memo of gigabytes": pickled(b"Nr\xff\xff\xff\x7f"),
    "bytes in another order": rezipped(saved(0), byteorder=b"big"),
    "sparse": saved(torch.eye(2).to_sparse()),
    "packed by bzip2": rezipped(saved(0), zipfile.ZIP_BZIP2),
    "cut": saved(torch.zeros(1000))[:2000],
    "changed": saved(torch.arange(1000)).replace(struct.pack("<q", 500), struct.pack("<q", 501)),
}


@pytest.mark.parametrize("name", WRONG)
def test_other_files_are_refused(name: str) -> None:
    with pytest.raises(ContentsError) as caught:
        read_torch(WRONG[name])
    assert len(str(caught.value)) < 200


def test_a_directory_of_a_million_entries_is_not_listed() -> None:
    with pytest.raises(ContentsError, match="more than 10,000 entries"):
        read_torch(b"PK\x01\x02" * 1_000_000)
