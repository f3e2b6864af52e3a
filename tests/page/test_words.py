"""What a report does not tell: folders, accounts and tokens."""

from __future__ import annotations

import subprocess
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from qcompile.page.words import call, command_line, without_folders


@pytest.mark.parametrize(
    ("path", "shown"),
    [
        ("/home/ada/my files/lima.json", "lima.json"),
        ("C:\\Users\\ada\\lima.json", "lima.json"),
        ("~ada/work/lima.json", "lima.json"),
        ("../lima.json", "lima.json"),
        ("clients/acme/lima.json", "lima.json"),
        ("clients/acme/", "acme"),
        ("file:///home/ada/x", "x"),
        ("lima.json", "lima.json"),
        ("/", "/"),
        ("", ""),
    ],
)
def test_a_path_is_cut_to_its_name(path: str, shown: str) -> None:
    assert without_folders(path) == shown


def test_a_command_is_quoted_for_a_shell() -> None:
    parts = [["run", "tiny.json"], ["--env", "map_name=8x8"], ["--import", "my envs.py"]]
    assert command_line(parts) == "qcompile run tiny.json --env map_name=8x8 --import 'my envs.py'"


def test_a_token_is_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QISKIT_IBM_TOKEN", "s3cret-s3cret-s3cret")
    assert "s3cret" not in command_line([["run"], ["--env", "key=s3cret-s3cret-s3cret"]])


def test_a_long_command_has_a_line_for_each_option_and_none_is_broken() -> None:
    parts = [
        ["evaluate", "lunarlander", "my policy.json"],
        ["--backend", "ibm_lima,ibm_toronto"],
        ["--env", "text=hello --world wide\nand 'more'"],
        ["--greedy"],
    ]
    shown = command_line(parts)
    assert shown.startswith(
        "qcompile evaluate lunarlander 'my policy.json' \\\n  --backend ibm_lima,ibm_toronto \\\n"
        "  --env 'text=hello --world wide\n"
    )
    script = shown.replace("qcompile", "printf '%s\\0'", 1)
    read = subprocess.run(["sh", "-c", script], capture_output=True, text=True, check=True).stdout
    assert read.split("\0")[:-1] == [*chain.from_iterable(parts)]


def test_a_call_shows_plain_values_and_the_types_of_objects() -> None:
    arguments: dict[str, Any] = {
        "policy": Path("/home/ada/p.pt"),
        "backend": object(),
        "shots": [None, 8192],
        "env": {"is_slippery": False},
        "account": "ada",
        "on_note": print,
    }
    assert call("run", arguments).replace("\n", " ").replace("    ", "") == (
        "qcompile.run( policy='p.pt', backend=<object>, shots=[None, 8192], "
        "env={'is_slippery': False}, )"
    )


def test_a_call_cuts_paths_and_leaves_texts() -> None:
    arguments: dict[str, Any] = {
        "policies": ["clients/acme/p.pt", "lunarlander"],
        "env": {"see": "https://a.b/c or /d"},
    }
    assert call("evaluate", arguments, ["policies"]).replace("\n", " ").replace("    ", "") == (
        "qcompile.evaluate( policies=['p.pt', 'lunarlander'], env={'see': 'https://a.b/c or /d'}, )"
    )
