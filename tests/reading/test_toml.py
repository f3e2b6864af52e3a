"""Invalid TOML is refused with a message."""

from __future__ import annotations

from pathlib import Path

import pytest

from qcompile.reading import ContentsError, read_toml


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = ", "It is not TOML"),
        (f"a = {'9' * 5000}", "invalid number or time"),
        ("a = 25:61:00", "It is not TOML|invalid number or time"),
        (f"a = {'[' * 5000}", "nested too deeply"),
    ],
    ids=["cut", "digits", "time", "deep"],
)
def test_it_is_refused_in_words(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "a.toml"
    file.write_text(text)
    with pytest.raises(ContentsError, match=words):
        read_toml(file)


def test_its_values_are_plain(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("a = [1, 2.5]\n[b]\nc = 'd'\n")
    assert read_toml(tmp_path / "a.toml") == {"a": [1, 2.5], "b": {"c": "d"}}
