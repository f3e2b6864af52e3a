"""Ctrl-C while packages are loaded: they are loaded to their end, and nothing else happens."""

from __future__ import annotations

import importlib
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from qcompile.cli.interrupts import after_imports

SLOW = """
import os, signal, time
try:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.2)
except KeyboardInterrupt:
    raise ImportError("broken off")
whole = True
"""


def test_an_import_is_not_broken_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slow_to_load.py").write_text(SLOW)
    monkeypatch.syspath_prepend(tmp_path)

    def load() -> None:
        with after_imports():
            importlib.import_module("slow_to_load")
            time.sleep(5)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        load()
    assert sys.modules.pop("slow_to_load").whole
    assert signal.getsignal(signal.SIGINT) is before


def test_elsewhere_it_interrupts_at_once() -> None:
    def work() -> None:
        with after_imports():
            signal.raise_signal(signal.SIGINT)
            pytest.fail("it went on")

    with pytest.raises(KeyboardInterrupt):
        work()


def test_a_handler_of_somebody_else_s_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: seen.append(number))
    try:
        with after_imports():
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [signal.SIGINT]


def test_another_thread_may_call() -> None:
    entered: list[bool] = []

    def work() -> None:
        with after_imports():
            entered.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert entered == [True]


LOADING = """
import sys
from importlib.abc import MetaPathFinder

class Interrupt(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == {name!r}:
            import os, signal
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
from qcompile.cli import main
main()
"""


@pytest.mark.parametrize("name", ["click", "numpy", "gymnasium"])
def test_a_command_that_is_interrupted_while_it_loads_ends_in_words(name: str) -> None:
    words = [sys.executable, "-c", LOADING.format(name=name), "run", "cartpole"]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 1
    words = ended.stderr.strip()
    assert words in ("Aborted!", "Error: Interrupted.") or "Interrupted: 0 of 20" in words
    assert "Traceback" not in words
