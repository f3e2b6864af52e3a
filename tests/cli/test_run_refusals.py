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
Error: bad.pt contains more than tensors and plain values, and was not loaded.
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
  It is not a complete file of torch.save.
  Copy it again, or train the policy again.
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
Error: tiny.json is not a policy file.
  weights has shape (2, 2).
    It needs (2, 4).
""",
    ),
    "uneven rows": (
        {"weights": [[1.0, 2.0], [3.0]]},
        """\
Error: tiny.json is not a policy file.
  weights has rows of different lengths.
""",
    ),
    "unknown gate": (
        {"circuits": [[["h"], ["cx"]]] * 4},
        """\
Error: tiny.json is not a policy file.
  circuits.0: Unknown gate 'cx'.
    Known gates: id x y z h s sdg t tdg sx sxdg rx ry rz p.
    Did you mean x?
""",
    ),
    "unknown symbol": (
        {"circuits": [[["ry", "x9"]]] * 4},
        """\
Error: tiny.json is not a policy file.
  Unknown symbol 'x9' in circuit 0.
    Declared: theta0 x0 x1 x2 x3.
""",
    ),
    "not a number": (
        {"theta": [float("nan")]},
        """\
Error: tiny.json is not a policy file.
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
Error: tiny.json is not a policy file.
  encoder.scale has an entry of 1.7e+308.
    Scales must lie within 1e+09: larger ones turn every angle into noise.
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
Error: Environment 'trojan:CartPole-v1' would import a module.
  A file may not load code: register the environment and use its plain name.
"""
    )
    assert not Path("ran").exists()
    assert "trojan" not in sys.modules
