"""docs/howto/environments.md holds: its module, its commands and its Python, as typed."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import pytest

from qcompile.deploy import registration

PAGE = (Path(__file__).parents[1] / "docs" / "howto" / "environments.md").read_text()
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
OWN = "--import corridor.py"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A working folder with the page's module, of which nothing is known yet."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(registration, "_imported", {})
    known = {**gymnasium.registry}
    gymnasium.registry.pop("Corridor-v0", None)
    module = next(text for language, text in BLOCKS if "Corridor-v0" in text and language)
    (tmp_path / "corridor.py").write_text(module)
    yield tmp_path
    sys.modules.pop("corridor", None)
    gymnasium.registry.clear()
    gymnasium.registry.update(known)


def test_the_module_of_the_page_is_trained_played_and_evaluated(
    folder: Path, qcompile: Callable[..., Any]
) -> None:
    """The shortest way has five steps, each of which costs 1; the workers are two processes."""
    lines = [line for _, text in BLOCKS for line in text.splitlines() if OWN in line]
    assert [shlex.split(line)[1] for line in lines] == ["train", "run", "evaluate"]
    for line in lines:
        answer = qcompile(*shlex.split(line)[1:])
        assert answer.code == 0, answer.err
    assert "mean reward  -5.00 ± 0.00 over 20 episodes" in qcompile(*shlex.split(lines[1])[1:]).out
    results = (folder / "evaluation" / "results.json").read_text()
    assert results.count('"mean_reward": -5.0') == 5


def test_the_python_of_the_page_does_the_same(folder: Path) -> None:
    (text,) = (text for language, text in BLOCKS if language == "py")
    names: dict[str, Any] = {}
    exec(compile(text, "environments.md", "exec"), names)
    assert names["result"].mean_reward == -5.0
    assert not names["grid"].failures
    assert {cell["mean_reward"] for cell in names["grid"].cells} == {-5.0}
