"""`qcompile run`: wrong usage, contradictions, environments that do not fit, what stops a run."""

from __future__ import annotations

from typing import Any

from .case import Command
from .inputs import ENCODER, calibration, ctrl_c_after, ctrl_c_in, policy, without, write

POLICIES: dict[str, Any] = {
    "module": policy(environment="trojan:CartPole-v1"),
    "unknown": policy(environment="CartPool-v1"),
    "unlike": policy(environment="Nothing of the kind"),
    "version": policy(environment="CartPole-v99"),
    "box2d": policy(environment="GymV21Environment-v0"),
    "continuous": policy(environment="Pendulum-v1"),
    "features": policy(encoder=ENCODER | {"feature": [0, 1, 2, 7]}),
    "actions": policy(environment="Acrobot-v1"),
}

SHORT = "run tiny.json --episodes 1 --max-steps 1 --shots exact"


def files() -> None:
    write({f"{name}.json": contents for name, contents in POLICIES.items()})
    write({"tiny.json": policy(), "lima.json": calibration()})


CASES = (
    *(f"run {name}.json" for name in POLICIES),
    "run nosuch",
    "run tiny.json --backend ibm_lime",
    "run tiny.json --backend qiskit:FakeLimma",
    "run tiny.json --backend qiskit:FakeLimaV2 --shots exact",
    *(f"run tiny.json --shots {shots}" for shots in ("0", "-1", "1000000000", "1e3", "nan", "''")),
    *(f"run tiny.json --episodes {episodes}" for episodes in ("0", "10001", "many")),
    "run tiny.json --seed -1",
    "run tiny.json --level 3",
    "run tiny.json --mitigation magic",
    "run tiny.json --copies 0",
    "run tiny.json --copies 4 --episodes 3",
    "run tiny.json --split",
    "run tiny.json --split --copies 1 --backend fake_toronto",
    "run tiny.json --split --copies 9 --shots 8 --backend fake_toronto",
    *(f"run tiny.json --calibration-shots {shots}" for shots in ("0", "some")),
    "run tiny.json --max-steps 0",
    "run tiny.json --video a.avi",
    "run tiny.json --video tiny.json/a.gif",
    "run tiny.json --calibration .",
    "run tiny.json --nosuch",
    "run tiny.json --shot 3",
    "run tiny.json --shots",
    "run one two more",
    "run tiny.json --predistort --mitigation readout",
    "run tiny.json --calibration lima.json",
    "run tiny.json --calibration lima.json --mitigation none --backend fake_lima",
    Command(f"{SHORT} --video a.gif", "without imageio-ffmpeg", without("imageio_ffmpeg")),
    Command(
        "run tiny.json --episodes 3 --shots exact --greedy",
        "Ctrl-C after the first episode",
        ctrl_c_after(1),
        masked=True,
    ),
    Command(
        f"{SHORT} --video a.gif",
        "Ctrl-C before the first step",
        ctrl_c_in("qcompile.deploy.deployment.Deployment.act"),
    ),
    "",
    "nosuch",
    "runn",
    "--nosuch",
    "--version",
)
