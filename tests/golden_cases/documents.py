"""The JSON documents of the commands: their keys, with the types of the values."""

from __future__ import annotations

from collections.abc import Sequence

from .case import Case, Document
from .outputs import ALL_STORED, GREEDY

SESSIONS: dict[str, Sequence[str | Case]] = {
    "run": (
        Document(f"{GREEDY} --json"),
        Document("run tiny.json --episodes 1 --backend fake_lima --max-steps 2 --json"),
        Document(f"{GREEDY} --backend misfit.json --mitigation response --json"),
        Document("run net.json --episodes 2 --max-steps 2 --json"),
    ),
    "evaluate": (
        Document(
            "evaluate tiny.json --backend fake_lima --shots 16 --episodes 2 --workers 1 "
            "--out e --json"
        ),
    ),
    "plan": (
        Document("plan tiny.json --max-steps 2 --shots 100 --json"),
        Document("plan cartpole_1q --episodes 2 --max-steps 2 --shots 16 --within 60 --json"),
    ),
    "show": (
        Document("show tiny.json --backend fake_lagos --json"),
        Document("show ring.json --backend fake_lima --json"),
        Document("show in.qasm --json"),
        Document("show tiny.json --surrogate --json"),
        Document("show net.json --json"),
    ),
    "compile": (
        Document("compile in.qasm --json"),
        Document("compile in.qasm --json -o out.qasm"),
    ),
    "export": (
        Document("export tiny.json --backend fake_lima --json"),
        Document("export tiny.json --out bound --observations rows.csv --json"),
    ),
    "backends": (
        Document("backends --json"),
        Document("backends show fake_lima --json"),
    ),
    "calibrate": (
        Document("calibrate --backend fake_lima --shots exact --json"),
        Document("calibrate --backend fake_lima --seed 2 --check counted.json --json"),
        Document("calibrate --from misfit.json --qubits 0,1 --out f.json --json"),
        Document("validate counted.json --policy tiny.json --json"),
    ),
    "runs": (
        Document("runs --json"),
        Document("runs show alpha --json"),
        Document("runs show last --runs checked --json"),
        Document("runs export alpha"),
    ),
    "train": (
        Document(
            "train CartPole-v1 --preset paper --episodes 2 --out a.json --checkpoint state "
            "--evaluate-every 1 --evaluate-episodes 2 --json"
        ),
        Document(
            "train CartPole-v1 --preset paper --episodes 2 --seeds 2 --workers 1 --evaluation 2 "
            "--out b.json --json"
        ),
    ),
    "study": (
        Document("study paper --list --json"),
        Document("study paper --row cartpole-svqc-paper --out study --json", change=ALL_STORED),
    ),
}
