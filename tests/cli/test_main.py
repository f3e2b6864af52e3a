"""What all commands share: help, exit codes, closed pipes and full disks."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import pytest

from qcompile import __version__
from qcompile.cli.group import cli

Call = Callable[..., Any]


def every_command(group: click.Group = cli, words: tuple[str, ...] = ()) -> Iterator[Any]:
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        yield pytest.param((*words, name), command, id=" ".join((*words, name)))
        if isinstance(command, click.Group):
            yield from every_command(command, (*words, name))


@pytest.mark.parametrize(("words", "command"), [*every_command()])
def test_every_command_has_help(
    qcompile: Call, words: tuple[str, ...], command: click.Command
) -> None:
    answer = qcompile(*words, "--help")
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.startswith(f"Usage: qcompile {' '.join(words)} ")
    assert command.help


def test_the_version(qcompile: Call) -> None:
    assert qcompile("--version").out == f"qcompile, version {__version__}\n"


def test_a_traceback_is_shown_when_asked_for(qcompile: Call) -> None:
    from qcompile.errors import PolicyError

    assert "Traceback" not in qcompile("run", "nosuch").err
    with pytest.raises(PolicyError):
        qcompile("--traceback", "run", "nosuch")


def run(*words: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "qcompile", *words],
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
        check=False,
        **options,
    )


@pytest.mark.parametrize("words", [("backends",), ("backends", "--json")])
def test_a_closed_pipe_is_no_error_to_talk_about(words: tuple[str, ...]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        ended = run(*words, stdout=writer)
    finally:
        os.close(writer)
    assert (ended.returncode, ended.stderr) == (1, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_explained() -> None:
    with Path("/dev/full").open("w") as full:
        ended = run("backends", "--json", stdout=full)
    assert ended.returncode == 1
    assert ended.stderr == "Error: Cannot write the output: no space left on device.\n"


def test_a_terminal_without_the_signs_of_tables_gets_others(policy: Call) -> None:
    environment = os.environ | {"PYTHONIOENCODING": "latin-1"}
    ended = run("show", policy(), stdout=subprocess.PIPE, env=environment)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "h ? ry(x0)" in ended.stdout


@pytest.mark.parametrize("columns", ["0", "00", "-1", "wide", ""])
def test_a_terminal_without_a_width_shows_everything(
    qcompile: Call, monkeypatch: pytest.MonkeyPatch, columns: str
) -> None:
    """Some terminals, and those of containers, say that they are 0 wide."""
    monkeypatch.delenv("COLUMNS", raising=False)
    expected = qcompile("backends").out
    monkeypatch.setenv("COLUMNS", columns)
    answer = qcompile("backends")
    assert answer.out == expected
    assert "ibm_lima" in answer.out
