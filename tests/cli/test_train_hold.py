"""`qcompile train --hold`: the policy decides once in several steps, and says so."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

Call = Callable[..., Any]

TINY = ("train", "CartPole-v1", "--preset", "paper", "--episodes", 6)


def hold_of(name: str) -> int:
    return int(json.loads(Path(name).read_text())["hold"])


def test_what_it_writes_says_hold(qcompile: Call) -> None:
    """Episodes of CartPole pay 1 a step: the rewards are the steps."""
    words = (*TINY, "--hold", 2, "--out", "held.json", "--log", "log.csv", "--json")
    document = qcompile(*words).json()
    assert (document["hold"], hold_of("held.json")) == (2, 2)
    rows = list(csv.DictReader(Path("log.csv").read_text().splitlines()))
    rewards = [float(row["reward"]) for row in rows]
    assert document["steps"] == sum(rewards) == int(rows[-1]["steps"])
    assert document["decisions"] == sum(-(-reward // 2) for reward in rewards)


def test_it_resumes_with_its_own_hold_alone(qcompile: Call, ctrl_c: Call) -> None:
    words = (*TINY, "--hold", 3)
    assert qcompile(*words, "--out", "whole.json").code == 0
    ctrl_c(3)
    assert qcompile(*words, "--out", "p.json", "--checkpoint", "state").code == 1
    again = ("train", "CartPole-v1", "--resume", "state", "--out", "p.json")
    refused = qcompile(*again, "--hold", 2)
    assert (refused.code, refused.err) == (
        1,
        "Error: Checkpoint state has hold 3, not 2.\n  Use 3, or resume another checkpoint.\n",
    )
    assert qcompile(*again, "--hold", 3).code == 0
    whole, resumed = (json.loads(Path(name).read_text()) for name in ("whole.json", "p.json"))
    assert resumed | {"name": "whole"} == whole


def test_a_warm_start_has_the_hold_that_is_named_or_that_of_its_policy(qcompile: Call) -> None:
    assert qcompile(*TINY, "--out", "one.json").code == 0
    assert "hold" not in json.loads(Path("one.json").read_text())
    for name, words, hold in (
        ("two", ("--init", "one.json", "--hold", 2), 2),
        ("kept", ("--init", "two.json"), 2),
        ("five", ("--init", "two.json", "--hold", 5), 5),
        ("circuits", ("--circuits", "two.json", "--hold", 3), 3),
    ):
        assert qcompile(*TINY, *words, "--out", f"{name}.json").code == 0
        assert hold_of(f"{name}.json") == hold


def test_several_seeds_are_scored_as_they_play(qcompile: Call) -> None:
    """A decision held for 600 steps is the only one of an episode: all seeds fall at once."""
    words = (*TINY, "--hold", 600, "--seeds", 2, "--workers", 1, "--evaluation", 20)
    document = qcompile(*words, "--out", "best.json", "--json").json()
    assert hold_of("best.json") == 600
    assert all(8 <= each["mean_reward"] <= 11 for each in document["trainings"])


def test_a_row_of_a_study_is_held(qcompile: Call, tmp_path: Path) -> None:
    row = '{model = "svqc", preset = "paper", hold = 2, seeds = 1}'
    Path("held.toml").write_text(f'[figures.one]\nenvironment = "CartPole-v1"\nrows = [{row}]\n')
    words = ("study", "held.toml", "--episodes", 4, "--evaluation", 2, "--workers", 1)
    assert qcompile(*words, "--out", "there").code == 0
    (cell,) = Path("there/cells").glob("*.json")
    result = json.loads(cell.read_text())
    assert result["settings"]["hold"] == 2
    decided = [-(-reward // 2) for reward in result["rewards"]]
    assert result["decisions"] == [sum(decided[: end + 1]) for end in range(4)]
    assert result["steps"] == [sum(result["rewards"][: end + 1]) for end in range(4)]
    page = Path("held.md") if Path("held.md").exists() else next(Path().rglob("*.md"))
    assert "hold = 2" in page.read_text()


def test_holds_below_one_and_twice_named_ones_are_refused(qcompile: Call) -> None:
    assert qcompile(*TINY, "--hold", 0, "--out", "p.json").code == 2
    answer = qcompile(*TINY, "--hold", 2, "-s", "hold=3", "--out", "p.json")
    assert answer.err == "Error: --hold is given twice, as an option and as a setting.\n"
    answer = qcompile(*TINY, "--hold", 10**9, "--out", "p.json")
    assert "hold: input should be less than or equal to 1000000" in answer.err
