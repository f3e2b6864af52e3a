"""JSON of limited size, in the encodings that editors write."""

from __future__ import annotations

import json
import tracemalloc

import pytest

from qcompile.limits import MAX_KEYS, MAX_VALUES
from qcompile.reading import ContentsError, decode, load_json

WRONG = {
    "": "is not JSON: line 1, column 1",
    "[1,\n 2": "is not JSON: line 2, column 3",
    '{"a": 1, "b": 2, "a": 3}': "key 'a' appears twice",
    '[{"\\u0007": 1, "\\u0007": 1}]': r"key '\\x07' appears twice",
    "[" * 100_000: "nested too deeply",
    '{"a":' * 100_000: "nested too deeply",
    "9" * 5000: "too many digits",
    "[" + "1," * MAX_VALUES + "1]": "more than 1,000,000 values",
    json.dumps(dict.fromkeys(map(str, range(MAX_KEYS + 1)), 0)): "more than 10,000 keys",
}


@pytest.mark.parametrize("text", WRONG, ids=lambda text: text[:12])
def test_invalid_json_is_refused(text: str) -> None:
    with pytest.raises(ContentsError, match=WRONG[text]) as caught:
        load_json(text.encode())
    assert len(str(caught.value)) < 200


def test_json_is_read() -> None:
    assert load_json('{"a": [1, 2.5, "\u03b8", null, true]}') == {"a": [1, 2.5, "θ", None, True]}
    assert load_json("9" * 4000) == 10**4000 - 1


def test_a_byte_order_mark_is_no_text() -> None:
    assert load_json("\ufeff[1]".encode()) == [1]
    assert decode("\ufeffqubit q;".encode()) == "qubit q;"


@pytest.mark.parametrize(
    ("contents", "words"),
    [
        ("[1]".encode("utf-16"), "It is UTF-16 text. Save it as UTF-8"),
        ("\ufeff[1]".encode("utf-16-be"), "It is UTF-16 text"),
        (b"[1,\n\xff]", "Line 2 is not UTF-8"),
        (b"\xed\xa0\x80", "Line 1 is not UTF-8"),
    ],
)
def test_text_in_another_encoding(contents: bytes, words: str) -> None:
    with pytest.raises(ContentsError, match=words):
        load_json(contents)


def test_json_refused_for_its_size_is_not_built() -> None:
    text = "[" + "[]," * 4_000_000 + "[]]"
    tracemalloc.start()
    with pytest.raises(ContentsError, match="more than 1,000,000 values"):
        load_json(text)
    assert tracemalloc.get_traced_memory()[1] < 10**6  # built, it takes 250 MB
    tracemalloc.stop()
