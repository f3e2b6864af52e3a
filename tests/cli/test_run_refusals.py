"""`qcompile run`: what it refuses, and how it says so."""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

Call = Callable[..., Any]


class Code:
    """Pickled, this runs a command when it is opened."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, ("ran",)


def truncated(path: Path) -> None:
    torch.save({"theta": torch.zeros(100)}, path)
    path.write_bytes(path.read_bytes()[:500])


BAD_PT: dict[str, tuple[Callable[[Path], object], str]] = {
    "code": (
        lambda path: torch.save({"theta": Code()}, path),
        """\
Error: bad.pt holds more than tensors and plain values, and was not loaded.
  A pickle can carry code that runs when it is opened.
  Save the policy with qcompile, or as JSON.
""",
    ),
    "bare pickle": (
        lambda path: path.write_bytes(pickle.dumps(Code())),
        """\
Error: bad.pt cannot be read as a .pt file: it is a bare pickle, and was not loaded.
  A pickle can carry code that runs when it is opened.
  Save the policy with qcompile, or as JSON.
""",
    ),
    "truncated": (
        truncated,
        """\
Error: bad.pt cannot be read as a .pt file.
  It is not a whole file of torch.save.
  Copy or train it again.
""",
    ),
}


@pytest.mark.parametrize("what", BAD_PT)
def test_bad_pt_files_are_explained(qcompile: Call, left: Call, what: str) -> None:
    make, text = BAD_PT[what]
    make(Path("bad.pt"))
    answer = qcompile("run", "bad.pt")
    assert (answer.code, answer.out, answer.err) == (1, "", text)
    assert left() == ["bad.pt"]


BAD_POLICIES: dict[str, tuple[dict[str, Any], str]] = {
    "wrong shape": (
        {"weights": [[1.0, 2.0], [3.0, 4.0]]},
        """\
Error: tiny.json is no policy file.
  weights has shape (2, 2).
    It needs (2, 4).
""",
    ),
    "uneven rows": (
        {"weights": [[1.0, 2.0], [3.0]]},
        """\
Error: tiny.json is no policy file.
  weights has rows of different lengths.
""",
    ),
    "unknown gate": (
        {"circuits": [[["h"], ["cx"]]] * 4},
        """\
Error: tiny.json is no policy file.
  circuits.0: Unknown gate 'cx'.
    Known gates: id x y z h s sdg t tdg sx sxdg rx ry rz p.
    Did you mean x?
""",
    ),
    "unknown symbol": (
        {"circuits": [[["ry", "x9"]]] * 4},
        """\
Error: tiny.json is no policy file.
  Unknown symbol 'x9' in circuit 0.
    Declared: theta0 x0 x1 x2 x3.
""",
    ),
    "not a number": (
        {"theta": [float("nan")]},
        """\
Error: tiny.json is no policy file.
  theta.0: input should be a finite number (found nan)
""",
    ),
    "too few features": (
        {"encoder": {"function": "tanh", "feature": [0, 1, 2, 7], "scale": [1.0] * 4}},
        """\
Error: Policy 'tiny' reads feature 7; observations of CartPole-v1 have 4 features.
  Correct `environment` or `encoder.feature` in the policy file.
""",
    ),
    "too few actions": (
        {"environment": "Acrobot-v1"},
        """\
Error: Policy 'tiny' has 2 actions; Acrobot-v1 has 3.
  Correct `environment`, or `weights` and `bias`, in the policy file.
""",
    ),
    "angles out of range": (
        {"encoder": {"function": "identity", "feature": [0, 1, 2, 3], "scale": [1.7e308] * 4}},
        """\
Error: tiny.json is no policy file.
  encoder.scale has an entry of 1.7e+308.
    Scales lie within 1e+09: more turns every angle into noise.
""",
    ),
    "no numbered actions": (
        {"environment": "Pendulum-v1"},
        """\
Error: Pendulum-v1 acts in Box(-2.0, 2.0, (1,), float32).
  A policy chooses among numbered actions (Discrete).
""",
    ),
}


def test_an_environment_that_names_a_module_is_refused(
    qcompile: Call, policy: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("trojan.py").write_text("open('ran', 'w')")
    monkeypatch.syspath_prepend(Path.cwd())
    answer = qcompile("run", policy(environment="trojan:CartPole-v1"))
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: Environment 'trojan:CartPole-v1' names a module to import.
  A policy file may not load code; register the environment and give its plain name.
"""
    )
    assert not Path("ran").exists()
    assert "trojan" not in sys.modules


@pytest.mark.parametrize("what", BAD_POLICIES)
def test_bad_policies_are_explained(qcompile: Call, policy: Call, what: str) -> None:
    changes, text = BAD_POLICIES[what]
    answer = qcompile("run", policy(**changes), "--episodes", 20)
    assert (answer.code, answer.out, answer.err) == (1, "", text)


def test_a_file_that_is_no_json_is_explained(qcompile: Call) -> None:
    Path("bad.json").write_text('{"format": ')
    answer = qcompile("run", "bad.json")
    assert answer.code == 1
    assert answer.err.startswith("Error: bad.json is no policy file.\n  It is not JSON: line 1")


@pytest.mark.parametrize("name", ["nosuch", "folder", "no/such.pt", "x" * 500, "", "ñ💥"])
def test_an_unknown_policy_is_explained(qcompile: Call, name: str) -> None:
    Path("folder").mkdir()
    answer = qcompile("run", name)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(f"Error: Unknown policy {name!r}.\n  ")
    assert answer.err.endswith("  A path to a .pt or .json policy file works too.\n")


def test_an_unknown_backend_is_explained_with_the_nearest(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--backend", "ibm_lime")
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: Unknown backend 'ibm_lime'.
  Did you mean ibm_lima?
  A path to a device file works too; `qcompile backends` lists what is there.
"""
    )


@pytest.mark.parametrize("shots", [0, -1, 10**9])
def test_shots_out_of_range_are_wrong_usage(qcompile: Call, policy: Call, shots: int) -> None:
    answer = qcompile("run", policy(), "--shots", shots)
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.endswith(
        f"Error: Invalid value for '--shots': {shots} shots cannot be run; the number lies in "
        "[1, 10000000] (1024 and 8192 are usual), or say 'exact'.\n"
    )


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--shots", "1e3"), "'1e3' is neither a number nor 'exact'"),
        (("--shots", "nan"), "'nan' is neither a number nor 'exact'"),
        (("--episodes", "0"), "0 is not in the range 1<=x<=10000"),
        (("--episodes", "10001"), "10001 is not in the range 1<=x<=10000"),
        (("--video", "a.avi"), "Invalid value for '--video': a.avi must end with .mp4 or .gif."),
        (("--video", "a"), "Invalid value for '--video': a must end with .mp4 or .gif."),
        (("--seed", "-1"), "-1 is not in the range x>=0"),
        (("--level", "3"), "3 is not in the range 0<=x<=2"),
        (("--mitigation", "magic"), "'magic' is not one of 'none', 'readout'"),
        (("--nosuch",), "No such option '--nosuch'"),
        (("one", "more"), "unexpected extra arguments"),
    ],
)
def test_wrong_usage(qcompile: Call, policy: Call, words: tuple[str, ...], text: str) -> None:
    answer = qcompile("run", policy(), *words)
    assert (answer.code, answer.out) == (2, "")
    assert text in answer.err
