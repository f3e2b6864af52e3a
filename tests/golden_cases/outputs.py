"""What commands answer: tables, words, and the files that they write.

Figures that are drawn at random are masked; the others follow from exact expectations, greedy
actions, or the stored trainings of docs/.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from rings import ring_policy

from . import journals
from .case import Case, Command, Written
from .inputs import calibration, device, network, policy, setting, write

DOCS = Path(__file__).parents[2] / "docs"
PROGRAM = """\
OPENQASM 3.0;
include "stdgates.inc";
qubit[2] q;
bit[2] c;
h q[0];
x q[1];
barrier q;
rz(0.5) q[0];
c = measure q;
"""
MISFIT = calibration(shots=8192)["response"] | {"chi_square": [500.0] * 5}


def files() -> None:
    write(
        {
            "tiny.json": policy(),
            "net.json": network(),
            "named.json": policy(name="[/red] [bold]"),
            "narrow.json": policy(
                circuits=[[["ry", "x0"]]] * 2, weights=[[1.0] * 2, [0.0] * 2], theta=[]
            ),
            "wide.json": policy(
                circuits=[[["ry", "x0"]]] * 8, weights=[[1.0] * 8, [0.0] * 8], theta=[]
            ),
            "ring.json": ring_policy(),
            "mine.json": device(left_out=[2, 3]),
            "in.qasm": PROGRAM,
            "rows.csv": "0,0,0,0\n1,2,3,4\n",
            "lima.json": calibration(),
            "two.json": calibration(of=(0, 1)),
            "counted.json": calibration(shots=8192),
            "misfit.json": calibration(shots=8192, response=MISFIT),
        }
    )


def nothing_runs(cells: Sequence[object], *_: object, **__: object) -> None:
    assert not cells, "the cells of docs/ are not those that are asked for"


ALL_STORED = setting("qcompile.sweep.complete.run_all", nothing_runs)
GREEDY = "run tiny.json --episodes 5 --shots exact --greedy"

RUN = (
    GREEDY,
    "run tiny.json --episodes 1 --shots exact --greedy",
    "run named.json --episodes 1 --shots exact --greedy --max-steps 3",
    f"{GREEDY} --backend fake_lima --mitigation none --level 0 --max-steps 5",
    f"{GREEDY} --backend fake_lima --calibration lima.json",
    f"{GREEDY} --backend fake_lima --calibration lima.json --mitigation response",
    f"{GREEDY} --backend fake_lima --calibration lima.json --predistort",
    f"{GREEDY} --backend lima.json",
    f"{GREEDY} --backend misfit.json --mitigation response",
    "run narrow.json --backend fake_lima --episodes 2 --copies 2 --max-steps 3 --mitigation none",
    "run narrow.json --backend fake_lima --shots 33 --split --calibration-shots auto --max-steps 3",
    "run wide.json --backend ibm_lima --episodes 2 --max-steps 3 --shots 100",
    "run tiny.json --backend qiskit:FakeLimaV2 --episodes 2 --max-steps 2 --shots 16",
    Command("run tiny.json --episodes 45 --backend ibm_lima --shots 64", masked=True),
    Command("run cartpole --episodes 100 --max-steps 5 --shots exact --greedy"),
    "run tiny.json --episodes 2 --max-steps 3 --video a.gif",
    "run net.json --episodes 5 --greedy",
    "run ring.json --backend fake_lima --episodes 2 --shots exact --greedy --max-steps 5",
)
FEW = "--shots 16,exact --episodes 5 --workers 1 --out e"
EVALUATE = (
    Command(
        "evaluate net.json tiny.json --backend fake_lima --shots exact --mitigation none "
        "--greedy --episodes 5 --workers 1 --out n",
    ),
    Command(f"evaluate tiny.json --backend fake_lima,lima.json {FEW}", masked=True),
    Command(f"evaluate tiny.json --backend fake_lima,lima.json {FEW}", masked=True),
    Written("e/results.csv", 1),
    Command(
        "evaluate narrow.json tiny.json --backend fake_lima --shots exact --mitigation none "
        "--level 1,2 --episodes 1 --workers 1 --out f",
        masked=True,
    ),
    Command(
        "evaluate tiny.json --backend misfit.json --shots 16 --mitigation response --episodes 1 "
        "--workers 1 --out g",
        masked=True,
    ),
    Command(
        "evaluate ring.json --backend fake_lima --shots 16 --mitigation none --episodes 1 "
        "--workers 1 --out h",
        masked=True,
    ),
)
PLAN = (
    "plan tiny.json --max-steps 2 --shots 100",
    "plan narrow.json --backend fake_toronto --max-steps 2 --episodes 3 --mitigation none",
    "plan tiny.json --max-steps 2 --shots 100 --level 1 --usd-per-second 0 --copies 1",
    "plan cartpole_1q --episodes 2 --max-steps 2 --shots 16 --within 60",
    "plan cartpole_1q --episodes 2 --max-steps 2 --shots 16 --within 3",
)
SHOW = (
    "show tiny.json",
    "show tiny.json --level 0",
    "show tiny.json --level 1 --backend ibm_lima",
    "show tiny.json --backend fake_lagos",
    "show tiny.json --backend fake_toronto",
    "show tiny.json --backend mine.json",
    "show narrow.json --backend two.json",
    "show wide.json --backend ibm_lima",
    "show cartpole_1q",
    "show in.qasm",
    "show in.qasm --backend fake_lima",
    "show tiny.json --surrogate",
    "show net.json",
    "show ring.json",
    "show ring.json --backend fake_lima --map ring.svg --draw ring.txt --circuit 0",
)
COMPILE = (
    "compile in.qasm",
    "compile in.qasm --level 0",
    "compile in.qasm --level 1 --backend fake_lima",
    "compile in.qasm --format qasm2",
    "compile in.qasm -o new/out.qasm",
)
EXPORT = (
    "export tiny.json --backend fake_lima",
    Written("tiny-job/job.json"),
    Written("tiny-job/round0.qasm"),
    "export narrow.json --out bound --observations rows.csv --format qasm2 --shots 100",
    Written("bound/job.json"),
    Written("bound/observation1-round0.qasm"),
    "export wide.json --backend ibm_lima --level 1 --out rounds",
)
BACKENDS = (
    "backends",
    "backends show ideal",
    "backends show ibmq_lima",
    "backends show fake_lagos",
    "backends add FakeLagosV2 --name mine",
    "backends add FakeLimaV2 --out other.json",
)
CALIBRATE = (
    "calibrate --backend fake_lima --shots exact",
    "calibrate --backend fake_lima --shots exact --parts readout --out r.json",
    "calibrate --backend fake_lima --shots exact --parts response --out s.json --policy tiny.json",
    "calibrate --backend fake_lagos --shots exact --plot a.png",
    "calibrate --backend ideal --shots exact --qubits 0,3",
    "calibrate --from lima.json --qubits 1,4 --out t.json",
    Command("calibrate --backend fake_lima --seed 1 --out u.json", masked=True),
    Command("calibrate --backend fake_lima --seed 2 --check counted.json", masked=True),
    Command("validate counted.json --policy tiny.json", masked=True),
)
RUNS = (
    "runs --runs none",
    "runs",
    "runs show alpha",
    "runs export alpha --out all.json",
    "runs show last --runs checked",
)
TRAIN = (
    Command("train CartPole-v1 --preset paper --episodes 2 --out a.pt --log log.csv", masked=True),
    Written("log.csv", masked=True),
    Command(
        "train CartPole-v1 --preset paper --episodes 21 --out b.pt --evaluate-every 20 "
        "--evaluate-episodes 2",
        masked=True,
    ),
    Command("train CartPole-v1 --preset paper --model fcn --episodes 2 --out c.json", masked=True),
    Command("train CartPole-v1 --preset paper --model mvqc --episodes 2 --out c.pt", masked=True),
    Command("train CartPole-v1 --steps 3 --out d.pt -s horizon=3 -s environments=1", masked=True),
    Command(
        "train CartPole-v1 --preset paper --episodes 2 --seeds 2 --workers 1 --evaluation 2 "
        "--out e.pt",
        masked=True,
    ),
)
EXAMPLE = "study example.toml --row cartpole-svqc-tuned --seeds 2 --episodes 22 --evaluation 2"
STUDY = (
    "study paper --list --seeds 2",
    "study example.toml --list",
    Command(f"{EXAMPLE} --workers 1 --out look", masked=True),
    Written("look/reproduction.md", masked=True),
    Command("study paper --row cartpole-svqc-paper --out study", change=ALL_STORED, masked=True),
    Written("study/reproduction.md", masked=True),
    Written("study/results.csv", 1),
    Written("study/curves.csv", 1),
    Command(
        "evaluate --paper --out devices --page page/devices.md", change=ALL_STORED, masked=True
    ),
    Written("page/devices.md", masked=True),
)

SESSIONS: dict[str, Sequence[str | Case]] = {
    "run": RUN,
    "evaluate": EVALUATE,
    "plan": PLAN,
    "show": SHOW,
    "compile": COMPILE,
    "export": EXPORT,
    "backends": BACKENDS,
    "calibrate": CALIBRATE,
    "runs": RUNS,
    "train": TRAIN,
    "study": STUDY,
}


def stored() -> None:
    """Trainings and device tests of docs/, in folders of their own, and the study of examples/."""
    shutil.copy(DOCS.parent / "examples" / "study.toml", "example.toml")
    for name, pattern in (("study", "cartpole-svqc-paper-*"), ("devices", "*")):
        cells = Path(name) / "cells"
        cells.mkdir(parents=True)
        for path in (DOCS / name / "cells").glob(pattern):
            shutil.copy(path, cells)


MORE_FILES = {"runs": journals.files, "study": stored}
