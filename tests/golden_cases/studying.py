"""`qcompile study`: wrong usage, and studies that cannot be run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from .case import Command
from .inputs import without, write

STORED = Path(__file__).parents[2] / "docs/study/cells"
ROW = "study paper --row cartpole-svqc-paper --episodes 3 --evaluation 2 --seeds 1 --workers 1"


POLE = '[figures.pole]\nenvironment = "CartPole-v1"\n'
FILES = {
    "mine": f"{POLE}rows = [{{}}]",
    "key": f"{POLE}rows = [{{seed = 3, settings = {{}}}}]",
    "figure": "[figures.pole]\nenv = 3",
    "seeds": f"{POLE}rows = [{{seeds = [1, 1]}}]",
    "setting": f"{POLE}rows = [{{settings = {{actor_rl = 1}}}}]",
    "layout": f"{POLE}rows = [{{settings = {{layout = 'serial'}}}}]",
    "path": f"{POLE}rows = [{{variant = '../up'}}]",
    "twice": f"{POLE}rows = [{{}}, {{settings = {{clip = 0.2}}}}]",
    "labels": f"{POLE}rows = [{{title = 'a'}}, {{title = 'a', variant = 'b'}}]",
    "claim": f"{POLE}rows = [{{claim_episodes = 9}}]",
    "also": f"{POLE}also = ['pol-svqc-tuned']\nrows = [{{}}]",
    "module": POLE.replace("CartPole-v1", "evil:CartPole-v1") + "rows = [{}]",
    "environment": POLE.replace("CartPole", "CartPol") + "rows = [{}]",
    "text": "figures",
}


def interrupted(patch: pytest.MonkeyPatch) -> None:
    def run_all(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    patch.setattr("qcompile.sweep.complete.run_all", run_all)


def failing(patch: pytest.MonkeyPatch) -> None:
    """The first training fails."""
    from qcompile.sweep.engine import _Failure

    def outcomes(cells: Any, *_: Any) -> Any:
        yield cells[0].name, _Failure("ZeroDivisionError: no wheels")

    patch.setattr("qcompile.sweep.engine._outcomes", outcomes)


def loses_its_workers(patch: pytest.MonkeyPatch) -> None:
    def outcomes(*_: Any) -> Any:
        raise RuntimeError("a worker was killed")
        yield

    patch.setattr("qcompile.sweep.engine._outcomes", outcomes)


def files() -> None:
    write({"file": "", "taken/cells": ""})
    name = "cartpole-svqc-paper-seed0.json"
    write({f"stored/cells/{name}": (STORED / name).read_bytes()})
    write({f"{name}.toml": contents for name, contents in FILES.items()})


CASES = (
    "study rainbow",
    "study papr",
    "study mine",
    "study mien.toml",
    "study file",
    *(f"study {name}.toml" for name in FILES if name != "mine"),
    "study mine.toml --figure pool",
    "study mine.toml --row pool",
    "study paper --figure pong",
    "study paper --row pong",
    "study paper --row pong --row ping",
    "study paper --figure acrobot --row cartpole",
    "study paper --engine slurm",
    "study paper --seeds 0",
    "study paper --episodes 0",
    "study paper --evaluation 0",
    "study paper --workers 0",
    "study paper --out file",
    "study paper --out file/s",
    "study paper --out taken",
    "study paper --page file/p.md",
    "study paper --page p.txt",
    f"{ROW} --out stored",
    f"{ROW} --out s --address tcp://127.0.0.1:1",
    Command(f"{ROW} --out s --engine dask", "without dask", without("distributed")),
    Command(f"{ROW} --out s --engine ray", "without ray", without("ray")),
    Command(f"{ROW} --out s", "Ctrl-C", interrupted),
    Command(f"{ROW} --out s", "a training fails", failing),
    Command(f"{ROW} --out s", "workers are killed", loses_its_workers),
)
