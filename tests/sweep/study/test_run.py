"""A study from Python: chosen rows, trained once and written up; what is refused."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import pytest
from joblib.externals.loky import get_reusable_executor

from qcompile.cli.study import command
from qcompile.errors import EnvironmentMismatchError, StudyError
from qcompile.sweep.complete import Pool
from qcompile.sweep.study import Study, StudyRequest, run_study
from qcompile.sweep.study.studies import open_study

TINY: dict[str, Any] = {
    "rows": "cartpole-fcn-small",
    "episodes": 2,
    "evaluation": 1,
    "seeds": 1,
}
MINE = """
[figures.lake]
environment = "FrozenLake-v1"
env = {is_slippery = false, map_name = "4x4"}
rows = [
    {variant = "a", preset = "paper", seeds = [7, 3], episodes = 2},
    {variant = "b", seeds = 1, steps = 40, settings = {environments = 2, horizon = 4}},
]
"""


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def study(**options: Any) -> Study:
    return run_study(StudyRequest(**options), Pool(workers=1))


def left(**options: Any) -> list[dict[str, Any]]:
    return StudyRequest(**options).left()


def test_a_study_is_trained_once_and_written_up() -> None:
    progress: list[Any] = []
    words = {"row": "cartpole-fcn-small-paper", "environment": "CartPole-v1", "seeds": 1, "left": 1}
    assert left(**TINY) == [words]
    first = run_study(StudyRequest(**TINY), Pool(workers=1), lambda *words: progress.append(words))
    assert (first.trained, first.there) == (1, 0)
    assert [path.name for path in first.files] == [
        "results.csv",
        "curves.csv",
        "cartpole.png",
        "reproduction.md",
    ]
    (summary,) = first.summaries
    assert first.to_dict() == {
        "study": "paper",
        "rows": [summary.values()],
        "trained": 1,
        "files": [str(path) for path in first.files],
    }
    assert progress == [(0, 1, ""), (1, 1, "cartpole-fcn-small-paper, seed 0")]
    assert left(**TINY) == [words | {"left": 0}]
    again = study(**TINY, page="page.md")
    assert (again.trained, again.there, again.files[-1]) == (0, 1, Path("page.md"))
    assert again.to_dict()["rows"] == first.to_dict()["rows"]


def test_a_file_of_ones_own_is_trained_in_its_environment_and_read_back() -> None:
    Path("mine.toml").write_text(MINE)
    done = study(name="mine.toml", evaluation=1)
    assert (done.trained, done.there) == (3, 0)
    assert done.to_dict()["study"] == "mine.toml"
    assert [s.seeds for s in done.summaries] == [[3, 7], [0]]
    assert [len(r.rewards) for r in done.summaries[0].results] == [2, 2]
    assert done.summaries[1].results[0].steps[-1] <= 40
    arguments = {"is_slippery": False, "map_name": "4x4"}
    assert all(r.environment_kwargs == arguments for s in done.summaries for r in s.results)
    assert all(r.parameters > 0 for s in done.summaries for r in s.results)
    assert {path.parent for path in done.files} == {Path("mine")}
    assert [row["left"] for row in left(name="mine.toml", evaluation=1)] == [0, 0]
    Path("mine.toml").write_text(MINE.replace("false", "true"))
    assert [row["left"] for row in left(name="mine.toml", evaluation=1)] == [2, 1]


@pytest.mark.parametrize("row", ["lunarlander-svqc-tuned", "acrobot-svqc-tuned"])
def test_episodes_shorten_what_has_a_budget_of_steps_too(row: str) -> None:
    """LunarLander has 2,000,000 steps and no episodes: one ends with the first rollout.

    Of Acrobot's environments none may have ended the episode that began first: no average.
    """
    pytest.importorskip("Box2D")
    done = study(rows=row, episodes=1, evaluation=1, seeds=1)
    (result,) = done.summaries[0].results
    assert result.settings["episodes"] == 1
    environments, horizon = result.settings["environments"], result.settings["horizon"]
    assert len(result.rewards) >= 1
    assert result.steps[-1] <= environments * max(horizon, 500)


def test_a_first_look_replaces_no_training() -> None:
    study(**TINY)
    with pytest.raises(StudyError, match=r"^study has 1 of these trainings with other settings"):
        study(**TINY | {"episodes": 3})


def test_an_environment_that_is_not_there_is_told_before_any_training() -> None:
    lines = MINE.replace("FrozenLake-v1", "FrozenLak-v1")
    Path("mine.toml").write_text(lines)
    with pytest.raises(EnvironmentMismatchError) as error:
        study(name="mine.toml")
    words = str(error.value)
    assert words.startswith("Unknown environment 'FrozenLak-v1'.")
    assert words.endswith("\n  It is the environment of row lake-svqc-a-paper.")
    assert not Path("mine").exists()


WORLD = """
import gymnasium
import numpy as np


class Lever(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(-1, 1, (1,), np.float32)
    action_space = gymnasium.spaces.Discrete(2, start=1)

    def __init__(self, steps=20):
        self.steps = steps

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = self.steps
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.left -= 1
        return np.zeros(1, np.float32), float(action), self.left == 0, False, {}


gymnasium.register("StudiedLever-v0", Lever)
"""


def test_workers_import_what_the_study_imports() -> None:
    """Each step pays its action, 1 or 2, and an episode has three."""
    Path("studied_lever.py").write_text(WORLD)
    text = MINE.replace("FrozenLake-v1", "StudiedLever-v0")
    Path("mine.toml").write_text(text.replace('is_slippery = false, map_name = "4x4"', "steps = 3"))
    options: dict[str, Any] = {"name": "mine.toml", "rows": "lake-svqc-a", "evaluation": 1}
    with pytest.raises(EnvironmentMismatchError, match="Unknown environment 'StudiedLever-v0'"):
        study(**options)
    request = StudyRequest(**options, imports="studied_lever.py")
    done = run_study(request, Pool(workers=2))
    get_reusable_executor().shutdown(wait=True, kill_workers=True)
    assert [result.steps for result in done.summaries[0].results] == [[3, 6]] * 2
    assert all(3 <= r <= 6 for result in done.summaries[0].results for r in result.rewards)
    command = "qcompile study mine.toml --row lake-svqc-a --evaluation 1 --import studied_lever.py"
    assert f"\n{command}\n" in done.files[-1].read_text()


def test_a_training_in_which_no_episode_ends_fails_in_words() -> None:
    Path("mine.toml").write_text(MINE.replace("steps = 40", "steps = 2"))
    with pytest.raises(StudyError, match="lake-svqc-b-tuned-seed0 failed: No episode ended within"):
        study(name="mine.toml", rows="lake-svqc-b", evaluation=1)


def test_a_file_names_no_module_to_import() -> None:
    Path("evil.py").write_text("from pathlib import Path\nPath('ran').touch()")
    Path("mine.toml").write_text(MINE.replace("FrozenLake-v1", "evil:FrozenLake-v1"))
    with pytest.raises(EnvironmentMismatchError, match="would import a module"):
        study(name="mine.toml")
    assert not Path("ran").exists()


def test_rows_are_chosen_by_figure_and_name() -> None:
    names = [values["row"] for values in left()]
    assert names == [row.name for row in open_study("paper").rows]
    chosen = [values["row"] for values in left(figures="reuse", rows=["cartpole", "reuse"])]
    assert chosen == ["cartpole-svqc-paper", *(f"reuse-svqc-{n}-paper" for n in (4, 8, 32))]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, ""),
        ({"figures": ("acrobot", "reuse"), "page": "docs/p.md"}, "--figure acrobot --figure reuse"),
        ({"rows": ["a b"], "seeds": 2, "episodes": 100, "evaluation": 7, "out": "it's"}, "--row"),
        ({"imports": ["my.worlds", "a b.py"]}, "--import my.worlds --import 'a b.py'"),
        ({"name": "my studies/x.toml", "rows": "cartpole"}, "'my studies/x.toml' --row cartpole"),
    ],
)
def test_the_command_of_the_page_asks_for_the_same(options: dict[str, Any], words: str) -> None:
    request = StudyRequest(**options)
    assert words in request.command
    program, verb, *typed = shlex.split(request.command)
    assert (program, verb) == ("qcompile", "study")
    given = command.make_context("study", typed).params
    same = StudyRequest(**{name: given[name] for name in vars(request)})
    assert same.command == request.command
    assert (same.folder, same.page_path) == (request.folder, request.page_path)
    assert tuple(same.figures) == tuple(options.get("figures", ()))
    assert tuple(same.imports) == tuple(options.get("imports", ()))
    assert (same.seeds, same.episodes, same.evaluation) == (
        options.get("seeds"),
        options.get("episodes"),
        options.get("evaluation", 100),
    )


# What is no study.


def test_another_study_is_refused() -> None:
    with pytest.raises(StudyError, match=r"^There is no study 'rainbow'\.\n  A study is paper, or"):
        left(name="rainbow")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("papr", "Did you mean paper?"),
        ("mine", "Did you mean mine.toml?"),
        ("mein.toml", "Did you mean mine.toml?"),
        ("below/mien.toml", "Did you mean below/mine.toml?"),
        ("notes.txt", "The file notes.txt does not end with .toml."),
        ("nothing", "A study is paper, or a .toml file of rows."),
    ],
)
def test_the_nearest_study_is_named(name: str, words: str) -> None:
    Path("below").mkdir()
    for path in ("mine.toml", "below/mine.toml", "notes.txt"):
        Path(path).write_text(MINE)
    with pytest.raises(StudyError) as error:
        left(name=name)
    assert f"  {words}" in str(error.value).splitlines()


def test_a_folder_is_not_a_study() -> None:
    Path("x.toml").mkdir()
    with pytest.raises(StudyError, match=r"^x\.toml is not a study\."):
        left(name="x.toml")
