"""Progress in a notebook: one line, which moves and is empty at the end."""

from __future__ import annotations

from types import SimpleNamespace

import IPython.display
import pytest

from qcompile.report import progress


@pytest.fixture
def lines(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the line says, one after the other; every look at the clock is a second later."""
    said: list[str] = []
    seconds = iter(range(1000))

    def display(data: dict[str, str], *, raw: bool, display_id: bool) -> object:
        assert raw
        assert display_id
        said.append(data["text/plain"])
        return SimpleNamespace(update=lambda data, raw: said.append(data["text/plain"]))

    monkeypatch.setattr(IPython.display, "display", display)
    monkeypatch.setattr(progress, "console", lambda stderr: SimpleNamespace(is_jupyter=True))
    monkeypatch.setattr(progress.time, "monotonic", lambda: float(next(seconds)))
    return said


def test_a_line_moves_and_is_empty_at_the_end(lines: list[str]) -> None:
    with progress.progress_bar("play", 4) as show:
        show(1, "mean reward 8.0")
        show(4, "done\x1b[2J")
    assert lines == [
        "play",
        f"play  {'█' * 8}{'░' * 22}  25%  mean reward 8.0",
        f"play  {'█' * 30}  100%  done[2J",
        "",
    ]


def test_it_is_empty_after_an_error_too(lines: list[str]) -> None:
    with pytest.raises(KeyboardInterrupt), progress.progress_bar("play", 4):
        raise KeyboardInterrupt
    assert lines == ["play", ""]


def test_it_moves_five_times_a_second_at_most(
    lines: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress.time, "monotonic", lambda: 0.0)
    with progress.progress_bar("play", 100) as show:
        for done in range(100):
            show(done, "")
    assert lines == ["play", ""]
