"""`qcompile train`: wrong usage, settings that do not fit, and checkpoints that are refused."""

from __future__ import annotations

import functools
import io
import json
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
import torch

from qcompile.rl.checkpoint import save_checkpoint
from qcompile.rl.ppo import Trainer
from qcompile.rl.presets import settings_for
from qcompile.version import versions

from .case import Command
from .inputs import ctrl_c_after, policy, setting, without, write

SMALL = {"format": "qcompile-ansatz-1", "circuits": [[["ry", "x0"]]]}
"""A file of circuits, as short as it can be."""
PAIR = {"qubits": 2, "gates": [["ry", "x0", 0], ["cz", 0, 1]]}


@functools.cache
def checkpoint() -> bytes:
    """That of a finished training of two episodes."""
    trainer = Trainer("CartPole-v1", settings_for("paper", "CartPole-v1").changed(episodes=2), 0)
    trainer.train()
    with TemporaryDirectory() as folder:
        save_checkpoint(trainer, path := Path(folder) / "state")
        return path.read_bytes()


def saved() -> dict[str, Any]:
    values: dict[str, Any] = torch.load(io.BytesIO(checkpoint()), weights_only=True)
    return values


def packed(values: Any) -> bytes:
    file = io.BytesIO()
    torch.save(values, file)
    return file.getvalue()


def altered(**parts: Any) -> bytes:
    """The checkpoint with other parts; one that is None is missing."""
    return packed({key: part for key, part in (saved() | parts).items() if part is not None})


def changed(part: str, **values: Any) -> bytes:
    """The checkpoint with other values in a part that is JSON."""
    return altered(**{part: json.dumps(json.loads(saved()[part]) | values)})


def collected(change: Callable[[dict[str, Any]], object]) -> bytes:
    collector = json.loads(saved()["plain"])["collector"]
    change(collector)
    return changed("plain", collector=collector)


def with_tensor(model: str, name: str, tensor: torch.Tensor) -> bytes:
    tensors = saved()["tensors"]
    return altered(tensors=tensors | {model: tensors[model] | {name: tensor}})


def walked(actions: list[int]) -> bytes:
    """The checkpoint of a training that took these actions since a reset with seed 7."""
    return collected(lambda collector: collector["walks"].__setitem__(0, [7, actions]))


def checkpoints() -> dict[str, Any]:
    bias = saved()["tensors"]["actor"]["head.bias"]
    return {
        "state": checkpoint(),
        "empty": b"",
        "text": "episode,steps,reward\n",
        "cut": checkpoint()[:3000],
        "tensor": packed(torch.zeros(3)),
        "policy.pt": packed(policy()),
        "format-2": altered(format="qcompile-checkpoint-2"),
        "format-none": altered(format=None),
        "without-seed": altered(seed=None),
        "without-two": altered(seed=None, plain=None),
        "seed-text": altered(seed="x"),
        "plain-text": altered(plain="x"),
        "settings-text": altered(settings="x"),
        "settings-gamma": changed("settings", gamma=7),
        "settings-unknown": changed("settings", unheard_of=1),
        "settings-reuse": changed("settings", reuse=3),
        "settings-environments": changed("settings", environments=10_000, horizon=10),
        "environment-other": altered(environment="Acrobot-v1"),
        "environment-unknown": altered(environment="Nowhere-v0"),
        "environment-module": altered(environment="trojan:Horse-v0"),
        "actor-nan": with_tensor("actor", "head.bias", torch.full_like(bias, torch.nan)),
        "critic-other": with_tensor("critic", "more", torch.zeros(3)),
        "best-other": altered(
            tensors=saved()["tensors"]
            | {"pause": saved()["tensors"]["pause"] | {"best": saved()["tensors"]["critic"]}}
        ),
        "observations-other": collected(
            lambda collector: collector.update(observations=[[9.0] * 4])
        ),
        "steps-text": collected(lambda collector: collector.update(steps="many")),
        "walk-too-long": walked([0] * 1000),
        "walk-impossible": walked([5]),
        "ansatz-text": altered(ansatz="x"),
        "ansatz-more": altered(
            ansatz='{"format": "qcompile-ansatz-1", "circuits": [[["ry", "x0"]]]}'
        ),
    }


def circuits() -> dict[str, str]:
    """Files of circuits: five inputs, none, a product that cannot be trained, another JSON file."""
    head = "OPENQASM 3.0;\ninput float[64] x;\ninput float[64] a;\nqubit q;\n"
    many = "".join(f"input float[64] x{i};\n" for i in range(5))
    gates = "".join(f"ry(x{i}) q;\n" for i in range(5))
    return {
        "five.qasm": f"OPENQASM 3.0;\n{many}qubit q;\n{gates}",
        "none.qasm": f"{head}ry(a) q;\n",
        "square.qasm": f"{head}ry(a*x*x) q;\n",
        "squared.qasm": f"{head}ry(x*x) q;\n",
        "reads.json": json.dumps(SMALL | {"reads": [3]}),
        "unknown.json": json.dumps(SMALL | {"gain": 1}),
        "other.json": '{"circuits": []}',
        "pair.json": json.dumps(SMALL | {"circuits": [PAIR], "observables": [[0], [0, 2]]}),
        "wide.json": json.dumps(SMALL | {"circuits": [PAIR | {"qubits": 17}]}),
    }


def files() -> None:
    write(checkpoints() | circuits())
    write({"file": ""})
    Path("folder.pt").mkdir()


def two_seeds(error: type[BaseException]) -> Callable[[pytest.MonkeyPatch], None]:
    """The first two seeds are trained, in this process; then this is raised."""

    def run_all(cells: Any, run: Any, on_result: Any, **_: Any) -> None:
        for cell in cells[:2]:
            on_result(cell, run(cell))
        raise error

    return setting("qcompile.verbs.train_seeds.run_all", run_all)


def interrupted(*_: Any, **__: Any) -> None:
    raise KeyboardInterrupt


TRAIN = "train CartPole-v1 --preset paper --episodes 2"
RESUME = "train CartPole-v1 --out p.pt --resume"
NAMES = tuple(checkpoints())
OWN = (
    *(
        f"--circuits {name}"
        for name in (*circuits(), "cartpol", "missing.qasm", "my.py", "lunarlander")
    ),
    *("--init acrobot", "--init lunarlander", "--init cartpol", "--init five.qasm"),
    "--init reads.json",
    *("--circuits cartpole --init cartpole", "--circuits cartpole --layout serial"),
    *("--init cartpole --layout serial", "--init cartpole --reuse 2"),
    *("--circuits cartpole --model mvqc", "--circuits wide.json --model surrogate"),
    *("--circuits cartpole --model fcn", "--circuits five.qasm --set features=0,1"),
    "--circuits five.qasm --set features=0,1,2,3,4",
    "--circuits five.qasm --set features=0,1,2,3,3 --set scales=1,2",
    *("--set features=0,9", "--set features=x", "--set encoder=sin", "--set encoder=tanh,clip"),
    *("--set encoder=bits", "--set encoder=bits,tanh", "--model fcn --set encoder=tanh"),
)

ENVIRONMENTS = (
    "Nope-v1",
    "''",
    "CartPole-v99",
    "Pendulum-v1",
    "CarRacing-v3",
    "a:CartPole-v1",
    "my.py",
)
ASSIGNMENTS = (
    *("clp=1", "nothing=1", "clip", "model=fcn", "layout=serial", "hidden=[1"),
    *("clip=-1", "clip=none", "clip=much", "epochs=1.5", "gamma=2", "scales=1,-2", "scales=[]"),
    "scales=[[1,2]]",
    *("hidden=8,8", "environments=2", "activation=step", "mitigation=magic", "pause_at=nan"),
)
OPTIONS = (
    *("--set clip=1 --set clip=2", "--set reuse=3 --reuse 2", "--set clip=-1 --set gamma=2"),
    *("--evaluate-episodes 3", "--reuse 0", "--steps 0", "--preset magic", "--model gnn"),
    *("--layout ring", "--shots 0", "--mitigation response", "--seed -1", "--evaluate-every 0"),
    *("--backend ibm_lim", "--model fcn --reuse 4", "--model fcn --layout serial"),
    *(
        "--model mvqc --backend ibm_lima",
        "--model mvqc --layout serial",
        "--model surrogate --shots 9",
    ),
    *("--log file/log.csv", "--log ''", "--log p.pt", "--checkpoint p.pt", "--log p.pt/log.csv"),
    *("--checkpoint b --log b", "--tensorboard file/runs", "--tensorboard file", "--log folder.pt"),
)

CASES = (
    "train",
    TRAIN,
    *(f"train {name} --out p.pt" for name in ENVIRONMENTS),
    *(
        f"{TRAIN} --out {out}"
        for out in ("p.txt", "p", "file/p.pt", "folder.pt", f"new/{'x' * 252}.pt")
    ),
    *(f"{TRAIN} --out p.pt --set {assignment}" for assignment in ASSIGNMENTS),
    *(f"{TRAIN} --out p.pt {option}" for option in (*OPTIONS, *OWN)),
    Command(
        "train CartPole-v1 --preset paper --model mvqc --episodes 1 --out p.pt",
        "with 3 qubits at most",
        setting("qcompile.rl.models.wiring._MOST_QUBITS", 3),
    ),
    f"{TRAIN} --out 'bell\a.pt'",
    "train CartPole-v1 --preset paper --set steps=none --set episodes=none --out p.pt",
    Command(
        f"{TRAIN} --out p.pt --tensorboard t",
        "without TensorBoard",
        without("torch.utils.tensorboard"),
    ),
    Command(
        "train CartPole-v1 --preset paper --out q.pt",
        "Ctrl-C after the second episode",
        ctrl_c_after(2),
        masked=True,
    ),
    Command(
        "train CartPole-v1 --preset paper --out r.pt --checkpoint kept",
        "Ctrl-C after the second episode",
        ctrl_c_after(2),
        masked=True,
    ),
    f"{RESUME} none",
    f"{RESUME} folder.pt",
    *(f"{RESUME} {name}" for name in NAMES if name != "state"),
    "train Acrobot-v1 --resume state --out p.pt",
    f"{RESUME} state --model fcn",
    f"{RESUME} state --seed 4",
    *(
        f"{RESUME} state {option}"
        for option in (
            *("--preset tuned", "--layout parallel", "--reuse 2", "--episodes 9", "--steps 9"),
            *("--set clip=0.3", "--backend ideal", "--shots exact --mitigation none"),
            *("--circuits cartpole", "--init cartpole", "--log state", "--checkpoint p.pt"),
        )
    ),
    "train CartPole-v1 --resume state --out state",
    f"{TRAIN} --out q.pt",
    f"{TRAIN} --out s.pt --checkpoint kept",
    f"{RESUME} state --checkpoint kept",
    "train CartPole-v1 --resume state --out r.pt",
    f"{TRAIN} --out p.pt --seeds 0",
    f"{TRAIN} --out p.pt --seeds 2 --resume state",
    f"{TRAIN} --out p.pt --workers 2",
    f"{TRAIN} --out p.pt --evaluation 2",
    f"{TRAIN} --out q.pt --seeds 2",
    f"{TRAIN} --out q.json --seeds 2 --log q.json --checkpoint q.json",
    Command(
        f"{TRAIN} --out s.pt --seeds 3 --evaluation 2",
        "Ctrl-C after the second training",
        two_seeds(KeyboardInterrupt),
        masked=True,
    ),
    Command(
        f"{TRAIN} --out t.pt --seeds 3 --evaluation 2",
        "Ctrl-C at once",
        setting("qcompile.verbs.train_seeds.run_all", interrupted),
    ),
    Command(
        f"{RESUME} state",
        "made with another numpy",
        setting(
            "qcompile.rl.checkpoint.versions", lambda *names: versions(*names) | {"numpy": "0.1"}
        ),
        masked=True,
    ),
)
