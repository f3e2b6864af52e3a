"""User environments: modules that register them, classes and functions, worker processes.

No file can trigger this. A user names a module or passes a class, and so permits its code to run.
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
"""The names of the modules imported in this process."""
_registered: dict[str, EnvSpec] = {}
"""The environments that `environment_id` registered and may replace."""
_PROCESS = uuid4().hex
"""A unique ID of this process, across machines."""


def module_path(module: str | os.PathLike[str]) -> Path:
    """The file of a module, where it is one of the working folder."""
    name = os.fspath(module)
    return Path(name if name.endswith(".py") else f"{name.replace('.', os.sep)}.py")


def import_modules(modules: Iterable[str | os.PathLike[str]]) -> None:
    """Import modules, each once, to register their environments.

    A module is a dotted name, also searched for in the working folder, or a file FILE.py, which can
    import its neighbours. Its output goes to standard error.

    Raises:
        EnvironmentMismatchError: the module does not exist, or fails.
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
    """The name to import a file's module by; its folder is added to the path."""
    path = Path(file).resolve()
    if not path.is_file():
        raise EnvironmentMismatchError(f"There is no file {file} to import.")
    if path.stem.isidentifier():
        if path.stem == "__main__":
            raise EnvironmentMismatchError(
                f"{file} cannot be imported: Python reserves this name.",
                "Rename the file, or import its folder as a module.",
            )
        known = find_spec(path.stem)
        # a folder without __init__.py has no origin, and any file takes precedence
        if known is not None and known.origin and Path(known.origin).resolve() != path:
            raise EnvironmentMismatchError(
                f"{file} cannot be imported: another module is called {path.stem!r}.",
                f"It is {known.origin}. Rename your file.",
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
            f"Searched the installed packages and {os.getcwd()}.",
        )
    frames = traceback.extract_tb(error.__traceback__)
    *_, last = (frame for frame in frames if not frame.filename.startswith("<"))
    line, file, message = last.lineno, last.filename, first_line(str(error))
    if isinstance(error, SyntaxError):
        line, file, message = error.lineno, error.filename or module, error.msg
    kind = type(error).__name__
    cause = f"{kind}: {message}" if message and not isinstance(error, SystemExit) else kind
    return EnvironmentMismatchError(
        f"Importing module {module!r} failed.", f"{cause} (line {line} of {file})"
    )


def environment_id(environment: str | EnvSpec | Callable[..., Any]) -> str:
    """The id of an environment, which is registered if it is not yet.

    A class is registered as CLASS-v0, a function that makes an environment as FUNCTION-v0, a lambda
    or any other callable as CLASS-v0 of the environment it makes. An environment registered here
    before is replaced, as a notebook redefines it. Other registrations stay: a class or function
    that has one without arguments goes by that.

    Raises:
        EnvironmentMismatchError: the id would import a module, or the callable fails.
        OptionError: it has another type, or another environment has its id.
    """
    if isinstance(environment, str):
        if environment.endswith(".py"):
            raise EnvironmentMismatchError(
                f"{environment} is a file; the id of an environment is needed.",
                f"Use --import {environment} and the id that it registers.",
            )
        module, colon, name = environment.rpartition(":")
        if colon:
            raise EnvironmentMismatchError(
                f"Environment {environment!r} would import a module.",
                f"Use --import {module} and the plain id {name}.",
            )
        return environment
    if isinstance(environment, EnvSpec):
        spec, replaced = environment, None
    elif callable(environment):
        spec = EnvSpec(f"{_name_of(environment)}-v0", environment, disable_env_checker=True)
        replaced = _registered.get(spec.id)
    else:
        raise OptionError(
            "An environment is an id, an EnvSpec, or a class or function that makes one, not "
            f"{type(environment).__name__}.",
            "Give your environment an id with gymnasium.register.",
        )
    known = gymnasium.registry.get(spec.id)
    if known is not None and (_are_equal(known, spec) or _makes_only(known, environment)):
        return spec.id
    if known is not None and known is not replaced:
        raise OptionError(
            f"{spec.id!r} is already registered, to make {_made_by(known)}.",
            f"To use that environment, give its id, {spec.id!r}.",
            "To use yours, register it under another id, or make it in a function of another name.",
        )
    gymnasium.registry[spec.id] = spec
    if callable(environment):
        _registered[spec.id] = spec
    return spec.id


def _are_equal(spec: EnvSpec, other: EnvSpec) -> bool:
    """Whether two specs are equal; False if their arguments cannot be compared, such as arrays."""
    try:
        return spec == other
    except Exception:  # whatever an argument's == raises
        return False


def _makes_only(spec: EnvSpec, make: object) -> bool:
    """Whether a registered spec calls this class or function, and without arguments."""
    made = spec.entry_point
    return not spec.kwargs and (made == _path(make) if isinstance(made, str) else made is make)


def _made_by(spec: EnvSpec) -> str:
    """What a registered spec calls: corridor:Corridor, with the arguments cells."""
    made = spec.entry_point
    words = made if isinstance(made, str) else _path(made)
    return f"{words}, with the arguments {', '.join(spec.kwargs)}" if spec.kwargs else words


def _path(make: object) -> str:
    """MODULE:NAME of a class or a function, as an entry point names it."""
    named: Any = make if hasattr(make, "__qualname__") else type(make)
    return f"{named.__module__}:{named.__qualname__}"


def _name_of(make: Callable[..., Any]) -> str:
    if isinstance(make, type) or (isinstance(make, FunctionType) and make.__name__ != "<lambda>"):
        return make.__name__
    what = f"The {type(make).__name__} does not make an environment."
    try:
        environment = make()
    except Exception as error:  # whatever a user's code raises
        cause = first_line(f"{type(error).__name__}: {error}")
        raise EnvironmentMismatchError(what, cause) from error
    if not isinstance(environment, gymnasium.Env):
        raise EnvironmentMismatchError(what, f"It returns {describe(environment)}.")
    environment.close()
    return type(environment.unwrapped).__name__


@dataclass(frozen=True)
class _KnownEnvironments:
    """The environments known in one process that are not gymnasium's own.

    `specs` are pairs of an id and a pickled EnvSpec; a worker needs those in `names`.
    """

    process: str
    names: tuple[str, ...]
    modules: tuple[str, ...]
    path: tuple[str, ...]
    specs: tuple[tuple[str, bytes], ...]


def with_environments(run: Callable[[C], R], names: Iterable[str]) -> Callable[[C], R]:
    """`run`, wrapped to register this process's environments when it runs in a worker.

    The worker imports the same modules as `import_modules` and registers the same environments;
    classes and functions of a notebook are sent along. `names` are the environments that cells
    need.

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
                    "Register it in a module that they import: --import MODULE.",
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
    """Register the environments; raise EnvironmentMismatchError if a needed one is unavailable."""
    for folder in known.path:
        _append_path(folder)
    failure = None
    for module in known.modules:
        try:
            import_modules([module])
        except EnvironmentMismatchError as error:  # these cells may not need it
            failure = error
    for name, pickled in known.specs:
        try:
            gymnasium.registry[name] = pickle.loads(pickled)
        except Exception as error:  # whatever importing its code raises
            if name in known.names:
                raise failure or EnvironmentMismatchError(
                    f"A worker process does not know environment {name!r}.",
                    first_line(f"{type(error).__name__}: {error}"),
                    "Register it in a module that workers import: --import MODULE.",
                ) from error
    if failure is not None and not {*known.names} <= {*gymnasium.registry}:
        raise failure
