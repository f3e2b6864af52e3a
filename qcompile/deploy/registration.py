"""Environments of one's own: modules that register them, classes and functions, worker processes.

Nothing here is asked by a file. A user names a module or hands over a class, and that is his word
that its code may run.
"""

from __future__ import annotations

import importlib
import os
import pickle
import sys
import traceback
from collections.abc import Callable, Iterable
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import lru_cache, partial
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar
from uuid import uuid4

import cloudpickle
import gymnasium
from gymnasium.envs.registration import EnvSpec

from qcompile.errors import EnvironmentMismatchError, OptionError
from qcompile.foreign import describe
from qcompile.terminal import first_line

C = TypeVar("C")
R = TypeVar("R")

_imported: dict[str, None] = {}
"""The modules that were asked for in this process, by their names."""
_registered: dict[str, EnvSpec] = {}
"""The classes and functions that `environment_id` registered, which it may replace."""
_PROCESS = uuid4().hex
"""Unlike that of any other process, on whatever machine."""


def import_modules(modules: Iterable[str | os.PathLike[str]]) -> None:
    """Import modules, each once, so that the environments they register are known.

    A module is a dotted name, found in the working folder too, or a file FILE.py, whose neighbours
    it can import. What it prints goes to standard error.

    Raises:
        EnvironmentMismatchError: there is no such module, or it fails.
    """
    for named in modules:
        module = os.fspath(named)
        name = _module_of_file(module) if module.endswith(".py") else module
        if not all(part.isidentifier() for part in name.split(".")):
            raise EnvironmentMismatchError(
                f"{module!r} is not the name of a module.",
                "A module is package.module, or a file whose name is letters, digits and _: "
                "FILE.py.",
            )
        _append_path(os.getcwd())
        try:
            with redirect_stdout(sys.stderr):
                importlib.import_module(name)
        except (Exception, SystemExit) as error:
            raise _not_imported(module, name, error) from error
        _imported[name] = None


def _module_of_file(file: str) -> str:
    """The name by which the module of a file is imported from now on."""
    path = Path(file).resolve()
    if not path.is_file():
        raise EnvironmentMismatchError(f"There is no file {file} to import.")
    if path.stem.isidentifier():
        if path.stem == "__main__":
            raise EnvironmentMismatchError(
                f"{file} cannot be imported: Python's own program has this name.",
                "Give your file another name, or name its folder as a module.",
            )
        known = find_spec(path.stem)
        # a folder without __init__.py has no origin, and any file comes before it
        if known is not None and known.origin and Path(known.origin).resolve() != path:
            raise EnvironmentMismatchError(
                f"{file} cannot be imported: there is another module {path.stem!r}.",
                f"It is {known.origin}. Give your file another name.",
            )
    _append_path(str(path.parent))
    return path.stem


def _append_path(folder: str) -> None:
    if folder not in sys.path:
        sys.path.append(folder)
        importlib.invalidate_caches()


def _not_imported(module: str, name: str, error: BaseException) -> EnvironmentMismatchError:
    if isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{error.name}."):
        return EnvironmentMismatchError(
            f"There is no module {module!r}.",
            f"It is looked for among the installed packages and in {os.getcwd()}.",
        )
    frames = traceback.extract_tb(error.__traceback__)
    *_, last = (frame for frame in frames if not frame.filename.startswith("<"))
    line, file, said = last.lineno, last.filename, first_line(str(error))
    if isinstance(error, SyntaxError):
        line, file, said = error.lineno, error.filename or module, error.msg
    kind = type(error).__name__
    words = f"{kind}: {said}" if said and not isinstance(error, SystemExit) else kind
    return EnvironmentMismatchError(
        f"Module {module!r} fails when it is imported.", f"{words} (line {line} of {file})"
    )


def environment_id(environment: str | EnvSpec | Callable[..., Any]) -> str:
    """The id of an environment; one that is not registered is, and stays so.

    A class is registered as CLASS-v0, a function that makes an environment as FUNCTION-v0, a lambda
    or any other callable as CLASS-v0 of what it makes. What was registered so before is replaced: a
    notebook defines it again. Anything else that is registered stays.

    Raises:
        EnvironmentMismatchError: the id names a module, or the callable fails.
        OptionError: it is none of these, or another environment has its id.
    """
    if isinstance(environment, str):
        if environment.endswith(".py"):
            raise EnvironmentMismatchError(
                f"{environment} is a file, found where the id of an environment is needed.",
                f"Say --import {environment}, and the id that it registers.",
            )
        module, colon, name = environment.rpartition(":")
        if colon:
            raise EnvironmentMismatchError(
                f"Environment {environment!r} names a module to import.",
                f"Say it apart: --import {module}, and the plain id {name}.",
            )
        return environment
    if isinstance(environment, EnvSpec):
        spec, replaced = environment, None
    elif callable(environment):
        spec = EnvSpec(f"{_name_of(environment)}-v0", environment, disable_env_checker=True)
        replaced = _registered.get(spec.id)
    else:
        raise OptionError(
            "An environment is an id, an EnvSpec or what makes one (a class, a function), found "
            f"{type(environment).__name__}.",
            "gymnasium.register gives an environment of yours an id.",
        )
    known = gymnasium.registry.get(spec.id)
    if known is not None and _are_equal(known, spec):
        return spec.id
    if known is not None and known is not replaced:
        raise OptionError(
            f"Another environment is registered as {spec.id!r}, or the same with other arguments.",
            "Register yours under an id of its own, and give that.",
        )
    gymnasium.registry[spec.id] = spec
    if callable(environment):
        _registered[spec.id] = spec
    return spec.id


def _are_equal(spec: EnvSpec, other: EnvSpec) -> bool:
    """Whether two say the same; not of arguments that cannot be compared, such as arrays."""
    try:
        return spec == other
    except Exception:  # whatever an argument's == raises
        return False


def _name_of(make: Callable[..., Any]) -> str:
    if isinstance(make, type) or (isinstance(make, FunctionType) and make.__name__ != "<lambda>"):
        return make.__name__
    what = f"A {type(make).__name__} was given that does not make an environment."
    try:
        environment = make()
    except Exception as error:  # whatever a user's code raises
        said = first_line(f"{type(error).__name__}: {error}")
        raise EnvironmentMismatchError(what, said) from error
    if not isinstance(environment, gymnasium.Env):
        raise EnvironmentMismatchError(what, f"It makes {describe(environment)}.")
    environment.close()
    return type(environment.unwrapped).__name__


@dataclass(frozen=True)
class _KnownEnvironments:
    """What is known in one process of environments that are not gymnasium's own.

    `specs` are pairs of an id and its pickled EnvSpec; a worker needs those of `names`.
    """

    process: str
    names: tuple[str, ...]
    modules: tuple[str, ...]
    path: tuple[str, ...]
    specs: tuple[tuple[str, bytes], ...]


def with_environments(run: Callable[[C], R], names: Iterable[str]) -> Callable[[C], R]:
    """`run`, which in a worker process knows the environments that are known here.

    The worker imports what `import_modules` did, and registers what is registered here; classes
    and functions of a notebook travel with it. `names` are the environments that cells need.

    Raises:
        EnvironmentMismatchError: one of them cannot be sent to another process.
    """
    needed = tuple(dict.fromkeys(names))
    specs = []
    for spec in gymnasium.registry.values():
        is_needed = spec.id in needed
        if not is_needed and str(spec.entry_point).startswith("gymnasium."):
            continue
        try:
            specs.append((spec.id, cloudpickle.dumps(spec)))
        except Exception as error:  # whatever an object in it raises
            if is_needed:
                raise EnvironmentMismatchError(
                    f"Environment {spec.id!r} cannot be sent to worker processes.",
                    first_line(str(error)),
                    "Register it in a module, which they import: --import MODULE.",
                ) from error
    path = tuple(folder or os.getcwd() for folder in sys.path)
    known = _KnownEnvironments(_PROCESS, needed, tuple(_imported), path, tuple(specs))
    return partial(_run_with_environments, known, run)


def _run_with_environments(known: _KnownEnvironments, run: Callable[[C], R], cell: C) -> R:
    if known.process != _PROCESS:
        _register_known(known)
    return run(cell)


@lru_cache(maxsize=1)  # a worker has many cells, and may outlive a definition
def _register_known(known: _KnownEnvironments) -> None:
    """Raise EnvironmentMismatchError where an environment cannot be had here."""
    for folder in known.path:
        _append_path(folder)
    failure = None
    for module in known.modules:
        try:
            import_modules([module])
        except EnvironmentMismatchError as error:  # it may be one that these cells do not need
            failure = error
    for name, pickled in known.specs:
        try:
            gymnasium.registry[name] = pickle.loads(pickled)
        except Exception as error:  # whatever importing its code raises
            if name in known.names:
                raise failure or EnvironmentMismatchError(
                    f"Environment {name!r} is not known to a worker process.",
                    first_line(f"{type(error).__name__}: {error}"),
                    "Register it in a module, which workers import: --import MODULE.",
                ) from error
    if failure is not None and not {*known.names} <= {*gymnasium.registry}:
        raise failure
