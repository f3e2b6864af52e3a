r"""A small share of \`make fuzz\`: damaged files are refused with a message, or read."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parent.parent / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))

from fuzz import READERS, Tally, inputs, try_one  # noqa: E402

INPUTS = 40


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", READERS)
def test_damaged_files_are_refused_in_words(name: str, tmp_path: Path) -> None:
    path, tally = tmp_path / READERS[name].name, Tally()
    for number, contents in inputs(name, 0, range(INPUTS)):
        words = try_one(READERS[name], contents, path, tally)
        assert words is None, f"input {number} of {name}:\n{words}"
    assert tally.refused + tally.read == INPUTS
    assert tally.refused > INPUTS / 4


def test_the_harness_notices_a_missing_refusal(tmp_path: Path) -> None:
    def careless(path: Path) -> object:
        return path.read_bytes().decode()

    tally = Tally()
    reader = READERS["device"].__class__("text", "x", careless, list, 1)
    assert "UnicodeDecodeError" in str(try_one(reader, b"\xff", tmp_path / "x", tally))
    assert try_one(reader, b"x", tmp_path / "x", tally) is None
    assert (tally.inputs, tally.tracebacks, tally.read) == (2, 1, 1)


def test_an_input_follows_from_its_number_alone() -> None:
    together = dict(inputs("device", 3, range(20)))
    assert together[7] == dict(inputs("device", 3, range(7, 8)))[7]
    assert together[7] != dict(inputs("device", 4, range(7, 8)))[7]
