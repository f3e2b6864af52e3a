"""Arrays with headers that do not match their contents, or with entries that are not numbers."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
import pytest

from qcompile.reading import ContentsError, read_npy, read_table


def saved(array: Any, **options: Any) -> bytes:
    file = BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


def headed(header: str, data: bytes = bytes(64), version: bytes = b"\x01\x00") -> bytes:
    size = len(header).to_bytes(2 if version == b"\x01\x00" else 4, "little")
    return b"\x93NUMPY" + version + size + header.encode() + data


def of_shape(shape: str, descr: str = "'<f8'") -> bytes:
    return headed(f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n")


ROWS = np.arange(12.0).reshape(3, 4)


@pytest.mark.parametrize(
    "array",
    [
        ROWS,
        np.asfortranarray(ROWS),
        ROWS.astype(">f4"),
        ROWS.astype(np.uint8),
        ROWS > 5,
        np.float64(3.5),
        np.empty((0, 4)),
        np.zeros(3, np.longdouble),
    ],
)
def test_arrays_of_numpy_are_read(array: Any) -> None:
    found = read_npy(saved(array))
    np.testing.assert_array_equal(found, array)
    assert found.dtype == np.asarray(array).dtype


def test_the_second_version_is_read() -> None:
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 4), }\n"
    assert read_npy(headed(header, version=b"\x02\x00")).shape == (2, 4)


WRONG = {
    "more than there is": (of_shape("(2000000000, 4)"), "promises 8,000,000,000 numbers"),
    "more than any": (of_shape(f"({10**30}, 4)"), "64 bytes follow"),
    "negative": (of_shape("(-8,)"), "promises -8 numbers"),
    "less than there is": (of_shape("(7,)"), "7 numbers of 8 bytes; 64 bytes follow"),
    "none of them": (of_shape(f"(0, {10**30})")[:-64], "an invalid shape"),
    "dimensions": (of_shape(f"({'1,' * 100})")[:-56], "an invalid shape"),
    "objects": (saved(np.array([{}]), allow_pickle=True), "type 'object', not real numbers"),
    "texts": (of_shape("(2,)", "'>U2'"), "type '>U2', not real"),
    "complex": (saved(ROWS + 1j), "type 'complex128', not real"),
    "dates": (saved(np.array(["2020"], "M8[s]")), "not real numbers"),
    "records": (of_shape("(1,)", "[('a', '<f8')]"), "not real numbers"),
    "brackets": (headed("[" * 5000), "not a complete .npy file"),
    "words": (headed("import os"), "not a complete .npy file"),
    "cut": (saved(ROWS)[:-1], "12 numbers of 8 bytes; 95 bytes follow"),
    "cut in its header": (saved(ROWS)[:50], "not a complete .npy file"),
    "empty": (b"", "not a complete .npy file"),
    "an archive": (b"PK\x03\x04" + bytes(100), "not a complete .npy file"),
    "a version to come": (saved(ROWS).replace(b"\x01\x00", b"\x09\x00", 1), "not a complete .npy"),
}


@pytest.mark.parametrize("name", WRONG)
def test_other_arrays_are_refused(name: str) -> None:
    contents, words = WRONG[name]
    with pytest.raises(ContentsError, match=words):
        read_npy(contents)


def test_a_table_is_rows_of_numbers() -> None:
    np.testing.assert_array_equal(read_table(b"\xef\xbb\xbf1, 2\n3,4e1\n"), [[1, 2], [3, 40]])
    np.testing.assert_array_equal(read_table(b"1,2\r3,4\r"), [[1, 2], [3, 4]])
    assert read_table(b"").size == 0


def test_the_first_fault_of_a_table_is_named_with_its_line() -> None:
    for text, words in (
        (b"# mean\n1,2\n\n3,x\n", "Line 4: 'x' is not a number."),
        (b"1,2\n3,4,5\n", "Line 2 has 3 columns, the lines above have 2."),
        (b"1,\n", "Line 1: '' is not a number."),
    ):
        with pytest.raises(ContentsError) as caught:
            read_table(text)
        assert str(caught.value) == words


@pytest.mark.parametrize("text", [b"1,2\n3", b"a,b", b"\xff", b"1\x00,2", b"1" * 5000 + b"z"])
def test_an_invalid_table_is_refused(text: bytes) -> None:
    with pytest.raises(ContentsError) as caught:
        read_table(text)
    assert len(str(caught.value)) <= 200
