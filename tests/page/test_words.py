"""What a report does not tell: folders, accounts and tokens."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from qcompile.page.words import call, command_line, without_folders


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("/home/ada/my files/lima.json", "lima.json"),
        ("C:\\Users\\ada\\lima.json", "lima.json"),
        ("~/lima.json", "lima.json"),
        ("~ada/work/lima.json", "lima.json"),
        ("../../ada/lima.json", "lima.json"),
        ("../lima.json", "lima.json"),
        ("--calibration=/home/ada/lima.json", "--calibration=lima.json"),
        ("lima.json,/home/ada/toronto.json", "lima.json,toronto.json"),
        ("There is no file /home/ada/lima.json.", "There is no file lima.json."),
        ("'/home/ada/lima.json' is old", "'lima.json' is old"),
        ("calibrations/lima.json", "calibrations/lima.json"),
        ("ALE/Pong-v5", "ALE/Pong-v5"),
        ("residual / standard error / qubit", "residual / standard error / qubit"),
        ("1/2 and 3/4/5", "1/2 and 3/4/5"),
    ],
)
def test_a_path_is_cut_to_its_name(text: str, shown: str) -> None:
    assert without_folders(text) == shown


def test_a_command_is_what_was_typed() -> None:
    words = ["run", "tiny.json", "--env", "map_name=8x8", "--import", "my envs.py"]
    assert command_line(words) == "qcompile run tiny.json --env map_name=8x8 --import 'my envs.py'"


def test_a_command_hides_accounts_and_folders() -> None:
    words = ["run", "/home/ada/p.pt", "--live", "--account", "ada", "--instance=crn:v1:a/42"]
    shown = command_line([*words, "--address", "tcp://10.0.0.1"])
    assert shown.replace(" \\\n  ", " ") == (
        "qcompile run p.pt --live --account ... --instance=... --address ..."
    )


def test_a_token_is_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QISKIT_IBM_TOKEN", "s3cret-s3cret-s3cret")
    assert "s3cret" not in command_line(["run", "--env", "key=s3cret-s3cret-s3cret"])


def test_a_long_command_has_a_line_for_each_option() -> None:
    words = ["evaluate", "lunarlander", "--backend", "ibm_lima,ibm_toronto", "--episodes", "1000"]
    assert command_line([*words, "--shots", "1024,8192"]) == (
        "qcompile evaluate lunarlander \\\n  --backend ibm_lima,ibm_toronto \\\n  --episodes 1000 "
        "\\\n  --shots 1024,8192"
    )


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
