"""The policy on the page about entangling gates is a policy, and plays."""

from __future__ import annotations

from pathlib import Path

import pytest
from sessions import blocks

import qcompile


def test_the_policy_plays_on_a_noise_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (text,) = [block for language, block in blocks("howto/entangling.md") if language == "json"]
    Path("pair.json").write_text(text)
    result = qcompile.run("pair.json", "fake_lima", shots=256, progress=False)
    assert result.to_dict()["gates_per_circuit"]["cx"] == 1
    assert result.mean_reward is not None
    assert 400 < result.mean_reward <= 500
