"""Rows are a file: what the paper's holds, and what is refused in words."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from version_0_1_0 import of_version_0_1_0

from qcompile.errors import StudyError
from qcompile.rl.presets import settings_for
from qcompile.sweep.study.paper import rows
from qcompile.sweep.study.rows import Claim, Row
from qcompile.sweep.study.rows_file import Figure, read_rows

OF_VERSION_0_1_0 = "90a285c84b81248a2467c3e582d1d0a53f51ec1316410c9afbc8ad2f59e90b8a"
"""SHA-256 of the rows of the preset paper that version 0.1.0 had: stored trainings are theirs."""


def test_the_papers_rows_are_those_of_version_0_1_0() -> None:
    names = ("name", "title", "figure", "environment", "preset", "seeds", "target")
    values = [
        {name: getattr(row, name) for name in names}
        | {
            "settings": of_version_0_1_0(row.settings),
            "claim": [row.claim.words, row.claim.episodes],
        }
        for row in rows()
        if row.preset == "paper"
    ]
    text = json.dumps(values, sort_keys=True)
    assert hashlib.sha256(text.encode()).hexdigest() == OF_VERSION_0_1_0


MINE = """
[figures.pole]
title = "Poles"
environment = "CartPole-v1"
target = 400.0
also = ["other-svqc-tuned"]
[[figures.pole.rows]]
title = "small"
model = "fcn"
variant = "small"
preset = "paper"
seeds = 2
target = 300.0
claim = "about 7"
claim_episodes = 7
settings = {hidden = [3], critic_hidden = "none"}
"""


def test_a_row_is_a_preset_with_changes(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(MINE)
    file = read_rows(path)
    assert file.figures == {"pole": Figure("Poles", ("other-svqc-tuned",))}
    settings = settings_for("paper", "CartPole-v1", "fcn").changed(hidden=(3,))
    claim = Claim("about 7", 7)
    row = ("pole-fcn-small-paper", "small", "pole", "CartPole-v1", "paper", settings, 2, 300.0)
    assert file.rows == (Row(*row, claim),)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("[figures", "figures", r"mine\.toml is not a file of rows\.\n  It is not TOML: "),
        ('title = "Poles"', "", r"not a file of rows\.\n  figures\.pole\.title: field required"),
        ("seeds = 2", "seeds = 0", r"figures\.pole\.rows\.0\.seeds: input should be greater"),
        ("seeds = 2", "seed = 2", r"figures\.pole\.rows\.0\.seed: extra inputs are not permitted"),
        ('"paper"', '"best"', r"the row pole-fcn-small-best does not.*\n  Unknown preset 'best'"),
        ("hidden = [3]", "hiden = [3]", r"does not hold settings\.\n  Unknown setting 'hiden'"),
        ("hidden = [3]", "reuse = 2", r"does not hold settings\.\n  Model 'fcn' has no 'reuse'"),
    ],
)
def test_what_holds_no_rows_is_refused(tmp_path: Path, before: str, after: str, words: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(MINE.replace(before, after))
    with pytest.raises(StudyError, match=words):
        read_rows(path)
