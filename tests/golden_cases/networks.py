"""Files of networks that are refused, and networks where only circuits will do."""

from __future__ import annotations

from typing import Any

from .inputs import calibration, network, policy, write

FIRST, LAST = network()["layers"]
CONVOLUTION = {"type": "convolution", "weights": [[[1.0, 2.0, 1.0]]], "bias": [0.0]}

NETWORKS: dict[str, Any] = {
    "layers-none": network(layers=[]),
    "layers-left-out": network(layers=None),
    "layer-unknown": network(layers=[FIRST | {"type": "lstm"}, LAST]),
    "layer-without-type": network(layers=[{"weights": [[1.0]], "bias": [0.0]}]),
    "key-unknown": network(reuse=4),
    "key-of-layer-unknown": network(layers=[FIRST | {"wieghts": []}, LAST]),
    "activation-unknown": network(layers=[FIRST | {"activation": "gelu"}, LAST]),
    "weights-jagged": network(layers=[FIRST | {"weights": [[1.0, 2.0], [3.0]]}, LAST]),
    "bias-short": network(layers=[FIRST | {"bias": [0.0]}, LAST]),
    "kernel-of-two": network(layers=[CONVOLUTION | {"weights": [[[1.0, 2.0]]]}, LAST]),
    "inputs-other": network(layers=[FIRST, LAST | {"weights": [[1.0] * 3] * 2}]),
    "convolution-last": network(layers=[CONVOLUTION]),
    "convolution-late": network(layers=[FIRST, CONVOLUTION, LAST]),
    "mean-short": network(mean=[0.0]),
    "std-zero": network(std=[1.0, 1.0, 1.0, 0.0]),
    "environment-other": network(environment="Acrobot-v1"),
    "too-large": network(
        layers=[
            FIRST | {"weights": [[1e300] * 4] * 2, "activation": "relu"},
            LAST | {"weights": [[1e300] * 2] * 2},
        ]
    ),
}


def files() -> None:
    write({f"{name}.json": contents for name, contents in NETWORKS.items()})
    write({"net.json": network(), "tiny.json": policy(), "lima.json": calibration()})


CASES = (
    *(f"run {name}.json --episodes 1 --max-steps 1" for name in NETWORKS),
    *(
        f"run net.json {options}"
        for options in (
            *("--shots 100", "--level 0", "--mitigation readout", "--copies 2", "--predistort"),
            *("--split", "--calibration-shots auto"),
            *("--backend ibm_lima", "--backend lima.json", "--calibration lima.json"),
            *("--shots 100 --level 1 --copies 4", "--backend nosuch"),
            "--backend ibm_lima --live --max-qpu-seconds 5 --yes",
        )
    ),
    "show net.json --backend ibm_lima",
    "show net.json --surrogate",
    "plan net.json",
    "export net.json",
    "calibrate --backend ibm_lima --policy net.json --out c.json",
    "validate lima.json --policy net.json",
    "train CartPole-v1 --resume net.json --out p.pt",
    "evaluate net.json --calibration lima.json --episodes 1",
)
