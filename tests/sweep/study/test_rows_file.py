"""Rows are a file: what the paper's holds, and what is refused in words."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from version_0_1_0 import of_version_0_1_0

from qcompile.errors import StudyError
from qcompile.rl.presets import settings_for
from qcompile.sweep.study.rows import Claim, Figure, Row
from qcompile.sweep.study.rows_file import read_rows
from qcompile.sweep.study.studies import open_study

OF_VERSION_0_1_0 = "140a9d5419ca029e44ee5983598e9f12c20183b41e4ab2b9494db8fdd0da48df"
"""SHA-256 of the rows that version 0.1.0 had in its code, and of the paper's settings: stored
trainings are theirs."""


def test_the_rows_are_those_of_version_0_1_0() -> None:
    names = ("name", "title", "figure", "environment", "preset", "target")
    rows = open_study("paper").rows
    values = [
        {name: getattr(row, name) for name in names}
        | {
            "settings": of_version_0_1_0(row.settings) if row.preset == "paper" else None,
            "claim": [row.claim.words, row.claim.episodes],
        }
        | {"seeds": len(row.seeds)}
        for row in rows
    ]
    assert all(row.seeds == tuple(range(len(row.seeds))) and row.arguments == {} for row in rows)
    text = json.dumps(values, sort_keys=True)
    assert hashlib.sha256(text.encode()).hexdigest() == OF_VERSION_0_1_0


MINE = """
title = "Mine"
about = "What for."
[figures.pole]
title = "Poles"
environment = "CartPole-v1"
env = {sutton_barto_reward = true}
target = 400
last_episode = 90
[[figures.pole.rows]]
title = "small"
group = "net"
model = "fcn"
variant = "small"
preset = "paper"
seeds = 2
target = 300.0
claim = "about 7"
claim_episodes = 7
claim_seed = "best"
settings = {hidden = [3], critic_hidden = "none"}
[[figures.pole.rows]]
model = "surrogate"
seeds = [7, 3]
steps = 1000
claim_episodes = 1500
[figures.lake]
environment = "FrozenLake-v1"
also = ["pole-surrogate-tuned"]
rows = [{layout = "serial", variant = "a"}]
"""
LEAST = """
[figures.pole]
environment = "CartPole-v1"
rows = [{}, {preset = "paper"}]
"""


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    (tmp_path / "mine.toml").write_text(MINE)
    return tmp_path / "mine.toml"


def test_a_row_is_a_preset_with_changes(mine: Path) -> None:
    study = read_rows(mine, "mine.toml")
    assert (study.name, study.title, study.about) == ("mine.toml", "Mine", "What for.")
    assert study.figures == {
        "pole": Figure("Poles", (), 90),
        "lake": Figure("FrozenLake-v1", ("pole-surrogate-tuned",)),
    }
    surrogate = settings_for("tuned", "CartPole-v1", "surrogate")
    assert surrogate.episodes is not None
    pole = {"environment": "CartPole-v1", "arguments": {"sutton_barto_reward": True}}
    assert study.rows == (
        Row(
            name="pole-fcn-small-paper",
            title="small",
            group="net",
            figure="pole",
            **pole,
            preset="paper",
            settings=settings_for("paper", "CartPole-v1", "fcn").changed(hidden=(3,)),
            changes={"hidden": [3], "critic_hidden": "none"},
            seeds=(0, 1),
            target=300.0,
            claim=Claim("about 7", 7, "best"),
        ),
        Row(
            name="pole-surrogate-tuned",
            title="surrogate",
            group="surrogate",
            figure="pole",
            **pole,
            preset="tuned",
            settings=surrogate.changed(episodes=None, steps=1000),
            changes={"steps": 1000},
            seeds=(7, 3),
            target=400.0,
            claim=Claim("1,500 episodes", 1500),
        ),
        Row(
            name="lake-svqc-a-tuned",
            title="svqc, serial, a",
            group="svqc, serial, a",
            figure="lake",
            environment="FrozenLake-v1",
            preset="tuned",
            settings=settings_for("tuned", "FrozenLake-v1", "svqc", "serial"),
            changes={"layout": "serial"},
            seeds=(0, 1, 2, 3, 4),
        ),
    )


def test_the_least_file_has_three_lines(tmp_path: Path) -> None:
    path = tmp_path / "least.toml"
    path.write_text(LEAST)
    study = read_rows(path, "least.toml")
    assert (study.title, study.figures) == ("least", {"pole": Figure("CartPole-v1")})
    assert [row.name for row in study.rows] == ["pole-svqc-tuned", "pole-svqc-paper"]
    assert {(row.title, row.target, row.claim) for row in study.rows} == {("svqc", None, Claim())}


REFUSED = [
    ("[figures.pole]", "figures.pole]", r"mine\.toml is not a study\.\n  It is not TOML: "),
    (MINE, "", r"mine\.toml is not a study\.\n  figures: this key is required"),
    (MINE, "figures = 3", r"figures: must be a table \(found 3\)"),
    (MINE, "[figures.x]\nenvironment = 'A'\nrows = []", r"figures\.x\.rows: .*at least 1 item"),
    ('environment = "CartPole-v1"', "", r"not a study\.\n  figures\.pole\.environment: this key"),
    (
        "seeds = 2",
        "seeds = 0",
        r"figures\.pole\.rows\.0\.seeds: must be a number from 1 to 1000, or a",
    ),
    ("seeds = 2", "seeds = true", r"rows\.0\.seeds: must be a number from 1 to 1000"),
    ("seeds = 2", "seeds = [1, 1]", r"rows\.0\.seeds: .* seeds from 0 up \(found \[1, 1\]\)"),
    ("seeds = 2", "seeds = [-1]", r"rows\.0\.seeds: must be a number"),
    ("seeds = 2", "seed = 2", r"rows\.0\.seed: there is no such key.*\n  Did you mean seeds\?"),
    (
        "last_episode",
        "last_episodes",
        r"pole\.last_episodes: there .*\n  Did you mean last_ep",
    ),
    ("about", "abuot", r"\n  abuot: there is no such key.*\n  Did you mean about\?"),
    ("target = 400", "target = nan", r"figures\.pole\.target: input should be a finite number"),
    ('"best"', '"worst"', r"rows\.0\.claim_seed: input should be 'mean' or 'best'"),
    ('title = "small"', 'title = "a\\nb"', r"rows\.0\.title: must be one line of text"),
    ('"paper"', '"best"', r"row pole-fcn-small-best are invalid.*\n  Unknown preset 'best'"),
    ("hidden = [3]", "hiden = [3]", r"are invalid\.\n  Unknown setting 'hiden'"),
    (
        "hidden = [3]",
        "reuse = 2",
        r"are invalid\.\n  Model 'fcn' has no setting 'reuse'",
    ),
    ("hidden = [3]", 'model = "cnn"', r"invalid\.\n  settings has 'model', which is a key of the"),
    (
        "steps = 1000",
        "steps = 9\nsettings = {episodes = 9}",
        r"settings has 'episodes', which",
    ),
    ("target = 400", "", r"the row pole-surrogate-tuned has claim_episodes but no target"),
    # What becomes part of a file's name.
    ("figures.pole", 'figures."../up"', r"figures\.\.\./up: used in file names"),
    ("figures.pole", "figures.-x", r"figures\.-x: used in file names"),
    ("figures.pole", f"figures.{'x' * 61}", "used in file names: up to 60 letters"),
    ('"small"\npreset', '"a/b"\npreset', r"rows\.0\.variant: used in file names"),
    # What cannot be told apart.
    (
        "[figures.lake]",
        '[[figures.pole.rows]]\nmodel = "surrogate"\n[figures.lake]',
        "two rows are",
    ),
    ("[figures.lake]", "[figures.POLE]", "two figures are named pole"),
    ('model = "surrogate"', 'model = "fcn"\ntitle = "small"\npreset = "paper"', "has two rows 's"),
    (
        '["pole-surr',
        '["pool-surr',
        r"also names 'pool-surrogate-tuned'.*\n  Did you mean pole-s",
    ),
    # What could load code, or is not a plain value.
    ("{sutton_barto_reward = true}", '{a = "os:system"}', r"pole\.env: a has the string 'os:"),
    (
        "{sutton_barto_reward = true}",
        '{render_mode = "human"}',
        r"pole\.env: 'render_mode' is",
    ),
    (
        "{sutton_barto_reward = true}",
        "{a = 1979-05-27}",
        r"env\.a: input was not a valid JSON",
    ),
]


@pytest.mark.parametrize(("before", "after", "words"), REFUSED)
def test_what_holds_no_rows_is_refused(mine: Path, before: str, after: str, words: str) -> None:
    assert before in MINE
    mine.write_text(MINE.replace(before, after))
    with pytest.raises(StudyError, match=words):
        read_rows(mine, "mine.toml")
