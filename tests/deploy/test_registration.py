"""Modules, classes and functions that make environments; no file can trigger them."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import cloudpickle
import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from qcompile.deploy import registration
from qcompile.deploy.environments import make_environments, reward_threshold
from qcompile.deploy.registration import environment_id, import_modules, with_environments
from qcompile.errors import EnvironmentMismatchError, OptionError

MODULE = """
import gymnasium

print("imported")

class {name}(gymnasium.Env):
    observation_space = gymnasium.spaces.Discrete(2)
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        return 0, {{}}

    def step(self, action):
        return 1, 1.0, True, False, {{}}

gymnasium.register("{name}-v0", {name}, reward_threshold=0.5)
"""


@pytest.fixture(autouse=True)
def as_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The working folder is empty, and modules and environments of a test are forgotten."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(registration, "_imported", {})
    modules, known = {*sys.modules}, {**gymnasium.registry}
    yield
    for name in {*sys.modules} - modules:
        del sys.modules[name]
    gymnasium.registry.clear()
    gymnasium.registry.update(known)
    registration._register_known.cache_clear()


def written(path: str, name: str) -> Path:
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(MODULE.format(name=name))
    return file


@pytest.mark.parametrize(
    ("path", "module"),
    [
        ("worlds_a.py", "worlds_a"),
        ("worlds_b.py", "worlds_b.py"),
        ("elsewhere/worlds_c.py", "elsewhere/worlds_c.py"),
        ("package_d/worlds_d.py", "package_d.worlds_d"),
    ],
)
def test_a_module_is_imported_once_and_its_environment_known(
    path: str, module: str, capsys: pytest.CaptureFixture[str]
) -> None:
    written(path, "Door")
    import_modules([module, module])
    import_modules([module])
    assert capsys.readouterr() == ("", "imported\n"), "standard output is that of the command"
    (environment,) = make_environments("Door-v0", 1)
    assert reward_threshold(environment) == 0.5


def test_a_file_imports_its_neighbours() -> None:
    written("elsewhere/neighbour_e.py", "Gate")
    Path("elsewhere/first_e.py").write_text("import neighbour_e\n")
    import_modules([Path("elsewhere/first_e.py")])
    assert "Gate-v0" in gymnasium.registry


@pytest.mark.parametrize(
    ("module", "text", "words"),
    [
        ("nosuch_f", None, "There is no module 'nosuch_f'.\n  Searched the installed packages"),
        ("torch.nosuch", None, "There is no module 'torch.nosuch'."),
        ("nosuch_f.py", None, "There is no file nosuch_f.py to import."),
        ("", None, "'' is not the name of a module."),
        ("a b", None, "'a b' is not the name of a module."),
        (".a", None, "'.a' is not the name of a module."),
        ("my-worlds.py", "", "'my-worlds.py' is not the name of a module."),
        ("json.py", "", "json.py cannot be imported: another module is called 'json'."),
        ("__main__.py", "", "__main__.py cannot be imported: Python reserves this name."),
        ("bad_f.py", "\n1 / 0\n", "ZeroDivisionError: division by zero (line 2 of "),
        ("bad_g.py", "import nosuch_f\n", "ModuleNotFoundError: No module named 'nosuch_f' (line"),
        ("bad_h.py", "x = 1\nx x\n", "SyntaxError: invalid syntax (line 2 of "),
        ("bad_i.py", "exit(3)\n", "failed.\n  SystemExit (line 1 of "),
        ("bad_j.py", "raise ValueError\n", "failed.\n  ValueError (line 1 of "),
    ],
)
def test_a_module_that_cannot_be_imported_is_told_in_words(
    module: str, text: str | None, words: str
) -> None:
    if text is not None:
        Path(module).write_text(text)
    with pytest.raises(EnvironmentMismatchError) as error:
        import_modules([module])
    assert words in str(error.value)


def cart_pole(**arguments: Any) -> Any:
    return gymnasium.make("CartPole-v1", **arguments)


class Shortened(gymnasium.wrappers.TimeLimit):
    def __init__(self, **arguments: Any):
        super().__init__(gymnasium.make("CartPole-v1", **arguments), 3)


@pytest.mark.parametrize(
    ("environment", "name"),
    [
        ("CartPole-v1", "CartPole-v1"),
        (gymnasium.spec("Acrobot-v1"), "Acrobot-v1"),
        (cart_pole, "cart_pole-v0"),
        (Shortened, "Shortened-v0"),
        (lambda: gymnasium.make("CartPole-v1"), "CartPoleEnv-v0"),
        (partial(cart_pole, max_episode_steps=5), "CartPoleEnv-v0"),
    ],
    ids=["id", "spec", "function", "class", "lambda", "partial"],
)
def test_what_makes_an_environment_gets_an_id(environment: Any, name: str) -> None:
    assert environment_id(environment) == name
    (made,) = make_environments(name, 1)
    assert made.unwrapped.spec is not None
    assert made.unwrapped.spec.id == name
    solved_at = {"CartPole-v1": 475.0, "Acrobot-v1": -100.0}
    assert reward_threshold(made) == solved_at.get(name), "another environment has its own"


def test_arguments_reach_what_is_made() -> None:
    name = environment_id(cart_pole)
    arguments = {"sutton_barto_reward": True}
    (made,) = make_environments(name, 1, arguments=arguments)
    made.reset(seed=0)
    assert made.step(0)[1] == 0.0
    with pytest.raises(EnvironmentMismatchError, match=r"unexpected keyword argument 'nosuch'$"):
        make_environments(name, 1, arguments={"nosuch": 1})


def test_a_definition_replaces_our_own_registration_and_no_other() -> None:
    def first() -> Any:
        return gymnasium.make("CartPole-v1")

    def second() -> Any:
        return gymnasium.make("Acrobot-v1")

    second.__name__ = "first"
    assert environment_id(first) == environment_id(first) == environment_id(second) == "first-v0"
    assert make_environments("first-v0", 1)[0].observation_space.shape == (6,)
    gymnasium.registry["first-v0"] = gymnasium.envs.registration.EnvSpec("first-v0", first)
    with pytest.raises(OptionError, match="'first-v0' is already registered"):
        environment_id(second)


@pytest.mark.parametrize("entry_point", [Shortened, f"{__name__}:Shortened"])
def test_a_class_goes_by_the_id_that_its_module_registered(entry_point: Any) -> None:
    gymnasium.register("Shortened-v0", entry_point, max_episode_steps=2)
    assert environment_id(Shortened) == "Shortened-v0"
    assert gymnasium.spec("Shortened-v0").max_episode_steps == 2, "its limit stays"


def test_a_class_registered_with_arguments_is_another_environment() -> None:
    arguments = {"sutton_barto_reward": True}
    gymnasium.register("Shortened-v0", Shortened, kwargs=arguments)
    with pytest.raises(OptionError) as error:
        environment_id(Shortened)
    made = f"{__name__}:Shortened, with the arguments sutton_barto_reward"
    assert str(error.value).splitlines() == [
        f"'Shortened-v0' is already registered, to make {made}.",
        "  To use that environment, give its id, 'Shortened-v0'.",
        "  To use yours, register it under another id, or make it in a function of another name.",
    ]


def test_arguments_that_cannot_be_compared_are_other_arguments() -> None:
    one, two = (EnvSpec("Door-v0", cart_pole, kwargs={"walls": np.zeros(2)}) for _ in range(2))
    assert environment_id(one) == environment_id(one) == "Door-v0"
    with pytest.raises(OptionError, match="'Door-v0' is already registered"):
        environment_id(two)


class Undeclared(gymnasium.Env[Any, Any]):
    """Declares neither observations nor actions."""


def test_an_environment_without_spaces_is_refused() -> None:
    name = environment_id(Undeclared)
    with pytest.raises(EnvironmentMismatchError, match="has no observation_space"):
        make_environments(name, 1)


@pytest.mark.parametrize(
    ("environment", "words"),
    [
        ("module:Door-v0", r"would import a module\.\n  Use --import module and"),
        (lambda: 1 / 0, "does not make an environment.\n  ZeroDivisionError: division by zero"),
        (lambda: None, "does not make an environment.\n  It returns an object of type NoneType"),
        (3, r"a class or function that makes one, not int\."),
        (gymnasium.make("CartPole-v1"), "not TimeLimit"),
    ],
)
def test_what_makes_none_is_refused(environment: Any, words: str) -> None:
    with pytest.raises((EnvironmentMismatchError, OptionError), match=words):
        environment_id(environment)


def in_another_process(task: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Run the task in a fresh process, to which it is pickled."""
    sent = cloudpickle.dumps(task)
    gymnasium.registry.pop("Door-v0", None)
    gymnasium.registry.pop("Local-v0", None)
    sys.modules.pop("worlds_k", None)
    monkeypatch.setattr(registration, "_imported", {})
    monkeypatch.setattr(registration, "_PROCESS", "another")
    return pickle.loads(sent)


def steps(name: str) -> float:
    (made,) = make_environments(name, 1)
    made.reset(seed=0)
    return float(made.step(0)[1])


def test_a_worker_imports_and_registers_what_is_known_here(monkeypatch: pytest.MonkeyPatch) -> None:
    written("elsewhere/worlds_k.py", "Door")
    import_modules(["elsewhere/worlds_k.py"])

    class Local(gymnasium.Env[Any, Any]):
        observation_space = gymnasium.spaces.Discrete(1)
        action_space = gymnasium.spaces.Discrete(2)

        def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
            return 0, {}

        def step(self, action: Any) -> Any:
            return 0, 7.0, True, False, {}

    Local.__module__ = "__main__"  # as in a notebook: it travels by value
    assert environment_id(Local) == "Local-v0"
    task = in_another_process(with_environments(steps, ["Local-v0", "Door-v0"]), monkeypatch)
    assert "Door-v0" not in gymnasium.registry
    assert (task("Local-v0"), task("Door-v0")) == (7.0, 1.0)


def test_this_process_stays_as_it_is() -> None:
    spec = gymnasium.spec("CartPole-v1")
    assert with_environments(steps, ["CartPole-v1"])("CartPole-v1") == 1.0
    assert gymnasium.spec("CartPole-v1") is spec


def test_what_cannot_be_sent_is_told_only_where_it_is_needed() -> None:
    lock = sys._getframe()  # no frame can be pickled

    def held() -> Any:
        return gymnasium.make("CartPole-v1") if lock else None

    name = environment_id(held)
    assert with_environments(steps, ["CartPole-v1"])("CartPole-v1") == 1.0
    with pytest.raises(EnvironmentMismatchError, match=r"'held-v0' cannot be sent to worker proc"):
        with_environments(steps, [name])


def test_a_worker_that_lacks_the_module_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    file = written("worlds_k.py", "Door")
    import_modules(["worlds_k"])
    task = in_another_process(with_environments(steps, ["Door-v0"]), monkeypatch)
    file.unlink()
    with pytest.raises(EnvironmentMismatchError, match="There is no module 'worlds_k'"):
        task("Door-v0")


def test_a_worker_does_without_a_module_that_its_cells_do_not_need(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    file = written("worlds_k.py", "Door")
    import_modules(["worlds_k"])
    task = in_another_process(with_environments(steps, ["CartPole-v1"]), monkeypatch)
    file.unlink()
    assert task("CartPole-v1") == 1.0
