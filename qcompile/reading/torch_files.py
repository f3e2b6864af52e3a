"""Reading files of torch.save: tensors and plain values, without running any code in them.

The pickle inside is read with our own functions in place of those it names, so it can only build
lists, dicts and tensors. torch is loaded when the first tensor is read.
"""

from __future__ import annotations

import math
import pickle
import pickletools
import zipfile
from collections import OrderedDict
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple

from qcompile.limits import MAX_FILE_BYTES, MAX_VALUES
from qcompile.reading.files import ContentsError

if TYPE_CHECKING:
    import torch

_MAX_ENTRIES = 10_000
_MAX_DEPTH = 100
_MAX_OPCODES = 3 * MAX_VALUES
_EXPANDED_BYTES = 2**20
"""Tensors may repeat numbers of their storage, up to this many bytes beyond the file size."""
_ENTRY = b"PK\x01\x02"
"""The signature of an entry in the directory of a zip file."""
_DTYPES = {
    "DoubleStorage": "float64",
    "FloatStorage": "float32",
    "HalfStorage": "float16",
    "BFloat16Storage": "bfloat16",
    "ComplexFloatStorage": "complex64",
    "ComplexDoubleStorage": "complex128",
    "LongStorage": "int64",
    "IntStorage": "int32",
    "ShortStorage": "int16",
    "CharStorage": "int8",
    "ByteStorage": "uint8",
    "BoolStorage": "bool",
}
_OPCODES = frozenset(
    (
        *("PROTO", "STOP", "MARK", "NONE", "NEWTRUE", "NEWFALSE", "BINUNICODE", "BINFLOAT"),
        *("BININT", "BININT1", "BININT2", "LONG1", "EMPTY_LIST", "APPEND", "APPENDS"),
        *("EMPTY_DICT", "SETITEM", "SETITEMS", "EMPTY_TUPLE", "TUPLE", "TUPLE1", "TUPLE2"),
        *("TUPLE3", "BINPUT", "LONG_BINPUT", "BINGET", "LONG_BINGET", "GLOBAL", "BINPERSID"),
        *("REDUCE", "BUILD"),
    )
)
"""The opcodes that torch.save writes for tensors and plain values."""


class CodeError(ContentsError):
    """The file tries to call something other than the functions that make a tensor."""


def read_torch(contents: bytes) -> Any:
    """The tensors, lists, dicts, texts and numbers of a file of torch.save.

    Memory is bounded by the size of the file: unpacked bytes, plain values and the bytes of all
    tensors, including expanded ones, are counted before anything is built. Tensors are contiguous
    and on the CPU.

    Raises:
        CodeError: the file contains more than tensors and plain values; nothing in it was run.
        ContentsError: the contents are not those of a torch.save file, or are too large.
    """
    try:
        return _Archive(contents).values()
    except ContentsError:
        raise
    except Exception as error:  # invalid bytes can make zipfile and pickle raise any exception
        raise ContentsError("It is not a complete file of torch.save.") from error


class _Storage(NamedTuple):
    """The numbers of one or more tensors: `key` names their entry in the archive."""

    dtype: str
    key: str


class _Tensor(NamedTuple):
    """A tensor that has not been built yet."""

    storage: _Storage
    offset: int
    size: tuple[int, ...]
    stride: tuple[int, ...]


class _Archive:
    """A file of torch.save: a zip file with a pickle and the storages of its tensors."""

    def __init__(self, contents: bytes):
        if contents.count(_ENTRY) > _MAX_ENTRIES:
            raise ContentsError(f"It has more than {_MAX_ENTRIES:,} entries.")
        self._zip = zipfile.ZipFile(BytesIO(contents))
        self._entries = {entry.filename: entry for entry in self._zip.infolist()}
        unpacked = sum(entry.file_size for entry in self._zip.infolist())
        # torch does not compress, so the unpacked entries cannot be larger than the file.
        most = max(len(contents), MAX_FILE_BYTES)
        if unpacked > most:
            raise ContentsError(f"Unpacked it has {unpacked:,} bytes; the limit is {most:,}.")
        (pickled,) = (name for name in self._entries if name.endswith("/data.pkl"))
        self._folder = pickled.removesuffix("data.pkl")
        self._values_left = MAX_VALUES
        self._bytes_left = unpacked + _EXPANDED_BYTES
        self._storages: dict[_Storage, torch.Tensor] = {}

    def values(self) -> Any:
        if f"{self._folder}byteorder" in self._entries and self._entry("byteorder") != b"little":
            raise ContentsError("It was written on a machine with a different byte order.")
        pickled = self._entry("data.pkl")
        _check_opcodes(pickled)
        return self._with_tensors(_Unpickler(BytesIO(pickled)).load(), 0)

    def _entry(self, name: str) -> bytes:
        entry = self._entries[self._folder + name]
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ContentsError("It is compressed, which torch.save does not do.")
        with self._zip.open(entry) as file:
            contents = file.read(entry.file_size)  # without a number, more than it says of itself
        if len(contents) < entry.file_size:
            raise ContentsError("An entry is shorter than its header says.")
        return contents

    def _with_tensors(self, value: Any, depth: int) -> Any:
        """`value` with its tensors built; a value that occurs several times counts each time."""
        self._values_left -= 1
        if self._values_left < 0:
            raise ContentsError(f"It contains more than {MAX_VALUES:,} values.")
        if depth > _MAX_DEPTH:
            raise ContentsError("Its values are nested too deeply.")
        if isinstance(value, _Tensor):
            return self._tensor(value)
        if isinstance(value, dict):
            return {key: self._with_tensors(item, depth + 1) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return type(value)([self._with_tensors(item, depth + 1) for item in value])
        return value

    def _tensor(self, tensor: _Tensor) -> torch.Tensor:
        import torch

        storage, offset, size, stride = tensor
        if len(size) != len(stride) or min((*size, *stride, offset)) < 0:
            raise ContentsError("A tensor has an invalid shape.")
        numbers = self._storage(storage)
        count = math.prod(size)
        self._bytes_left -= count * numbers.element_size()
        if self._bytes_left < 0:
            raise ContentsError("Its tensors have more numbers than the file.")
        last = offset + sum((n - 1) * step for n, step in zip(size, stride, strict=True))
        if count and last >= len(numbers):
            raise ContentsError("A tensor extends beyond its storage.")
        view = numbers.as_strided(size, stride, offset) if count else numbers.new_empty(size)
        return view.clone(memory_format=torch.contiguous_format)

    def _storage(self, storage: _Storage) -> torch.Tensor:
        import torch

        if storage not in self._storages:
            entry = bytearray(self._entry(f"data/{storage.key}"))
            dtype = getattr(torch, storage.dtype)
            empty = torch.empty(0, dtype=dtype)
            self._storages[storage] = torch.frombuffer(entry, dtype=dtype) if entry else empty
        return self._storages[storage]


class _Unpickler(pickle.Unpickler):
    """Calls only the functions listed in this file."""

    def find_class(self, module: str, name: str) -> Any:
        if module == "torch" and name in _DTYPES:
            return _DTYPES[name]
        if (module, name) in _CALLED:
            return _CALLED[module, name]
        if module == "torch._utils":
            raise ContentsError("It contains a sparse tensor, or one without numbers.")
        raise CodeError("It contains more than tensors and plain values.")

    def persistent_load(self, reference: Any) -> _Storage:
        kind, dtype, key, _, _ = reference
        if kind != "storage" or dtype not in _DTYPES.values():
            raise ContentsError("It refers to something outside the file.")
        return _Storage(dtype, str(key))


class _StateDict(OrderedDict[Any, Any]):
    """An OrderedDict that ignores the attribute in which torch stores the versions of modules."""

    def __setstate__(self, state: Any) -> None:
        pass


def _tensor(storage: Any, offset: Any, size: Any, stride: Any, *_: Any) -> _Tensor:
    whole = all(type(number) is int for number in (offset, *size, *stride))
    if not whole or not isinstance(storage, _Storage):
        raise ContentsError("A tensor has an invalid shape.")
    return _Tensor(storage, offset, tuple(size), tuple(stride))


_CALLED = {
    ("torch._utils", "_rebuild_tensor_v2"): _tensor,
    ("torch._utils", "_rebuild_parameter"): lambda tensor, *_: tensor,
    ("collections", "OrderedDict"): _StateDict,
}
"""The functions that a pickle may name, and those called in their place."""


def _check_opcodes(pickled: bytes) -> None:
    """Raise ContentsError if the pickle uses opcodes that torch.save never writes."""
    for count, (opcode, argument, _) in enumerate(pickletools.genops(pickled)):
        if opcode.name not in _OPCODES:
            raise CodeError("It contains more than tensors and plain values.")
        if count > _MAX_OPCODES:
            raise ContentsError(f"It contains more than {MAX_VALUES:,} values.")
        if opcode.name == "LONG_BINPUT" and (argument or 0) > count:  # it is a list's length
            raise ContentsError("It is not a complete file of torch.save.")
