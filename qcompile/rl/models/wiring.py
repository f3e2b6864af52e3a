"""The parts of a model of circuits: circuits, and the encoder of their inputs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch

from qcompile.arrays import FloatArray, IntArray
from qcompile.errors import TrainingError
from qcompile.policy import Ansatz, Encoder
from qcompile.policy.encoder import BITS
from qcompile.policy.layouts import LAYOUTS, ring
from qcompile.rl.models.head import log_scales
from qcompile.rl.settings import Settings

_DEFAULT = "arctan"
_MOST_QUBITS = 12
"""The most qubits of an mvqc: a training with more takes days."""


@dataclass(frozen=True, eq=False)
class Wiring:
    """Circuits with the encoder of their inputs, whose scales are multiplied by exp(`log_scale`).

    The encoder has a function, feature, scale and gain for each of `ansatz.inputs`; `log_scale` is
    (inputs,).
    """

    ansatz: Ansatz
    encoder: Encoder
    log_scale: torch.Tensor


def reads_bits(settings: Settings, ansatz: Ansatz | None) -> bool:
    """Whether observations are numbers read by their bits."""
    if settings.encoder is not None or ansatz is None or ansatz.encoder is None:
        return settings.encoder == BITS
    return ansatz.encoder.reads_bits


def wiring(settings: Settings, features: int, ansatz: Ansatz | None) -> Wiring:
    """The wiring of the layout in the settings, or of own circuits.

    Raises:
        PolicyError, TrainingError: settings, circuits and features do not fit each other.
    """
    _check_features(settings, features)
    if (ansatz is None) == (settings.layout == "own"):
        raise TrainingError(
            f"Layout {settings.layout!r} {'without' if ansatz is None else 'with'} own circuits.",
            "Use the layout 'own' if and only if circuits are given.",
        )
    wires = _of_layout(settings, features) if ansatz is None else _of(ansatz, settings, features)
    if settings.normalise and (wires.encoder.reads_bits or _statistics(wires.encoder)):
        raise TrainingError(
            "normalise needs unprocessed numeric observations.",
            "These circuits read bits."
            if wires.encoder.reads_bits
            else f"{wires.ansatz.origin} already has its own mean or std.",
        )
    return wires


def _of_layout(settings: Settings, features: int) -> Wiring:
    read = range(features) if settings.features is None else settings.features
    copies = len(settings.scales)
    if settings.model == "mvqc" and len(read) > _MOST_QUBITS:
        raise TrainingError(
            f"Model 'mvqc' needs one qubit per feature; there are {len(read)} features.",
            f"It can train at most {_MOST_QUBITS} qubits.",
        )
    layout = ring if settings.model == "mvqc" else LAYOUTS[settings.layout]
    program, index = layout(len(read), copies)
    columns = len(index) // copies
    functions = _functions(settings, _DEFAULT, columns)
    encoder = Encoder(
        functions if isinstance(functions, str) else functions * copies,
        np.array([read[i] for i in index], dtype=np.intp),
        np.ones(len(index)),
    )
    return Wiring(Ansatz.of_program(program), encoder, log_scales(settings, columns))


def _of(ansatz: Ansatz, settings: Settings, features: int) -> Wiring:
    inputs, read = len(ansatz.inputs), settings.features
    if read is not None and len(read) != inputs:
        raise TrainingError(
            f"features has {len(read)} numbers for {inputs} inputs.",
            "It must name the feature that each input of the circuits reads.",
        )
    encoder = ansatz.encoder
    if read is not None:
        feature = np.array(read, dtype=np.intp)
    else:
        feature = _default_features(inputs, features) if encoder is None else encoder.feature
    if encoder is None:
        encoder = Encoder(_DEFAULT, feature, np.ones(inputs))
    function = _functions(settings, encoder.function, inputs)
    encoder = replace(encoder, function=function, feature=feature)
    if function == BITS:
        encoder = replace(encoder, scale=np.ones(inputs), mean=None, std=None)
    needed = max([int(feature.max()) + 1, *map(len, _statistics(encoder))])
    if needed > features:
        raise TrainingError(
            f"The circuits of {ansatz.origin} read feature {needed - 1}; observations have "
            f"{features} features.",
            "Set the feature that each input reads: -s features=0,1",
        )
    encoder.check(inputs)
    return Wiring(ansatz, encoder, _log_scales(settings, inputs))


def _statistics(encoder: Encoder) -> list[FloatArray]:
    return [array for array in (encoder.mean, encoder.std) if array is not None]


def _check_features(settings: Settings, features: int) -> None:
    read = settings.features or ()
    if max(read, default=0) >= features:
        raise TrainingError(
            f"features names feature {max(read)}.",
            f"Observations have features 0 to {features - 1}.",
        )


def _default_features(inputs: int, features: int) -> IntArray:
    """The default feature of each input: input i reads feature i modulo their number."""
    if inputs > features and inputs % features:
        raise TrainingError(
            f"The circuits have {inputs} inputs; observations have {features} features.",
            "By default input i reads feature i, and the number of inputs must be at most the "
            "number of features, or a multiple of it.",
            "Set the feature that each input reads: -s features=0,1,1",
        )
    return np.arange(inputs, dtype=np.intp) % features


def _functions(
    settings: Settings, default: str | tuple[str, ...], inputs: int
) -> str | tuple[str, ...]:
    if settings.encoder is None:
        return default
    if not isinstance(settings.encoder, str) and len(settings.encoder) != inputs:
        raise TrainingError(
            f"encoder has {len(settings.encoder)} functions for {inputs} inputs.",
            "Give one for all inputs, or one per input.",
        )
    return settings.encoder


def _log_scales(settings: Settings, inputs: int) -> torch.Tensor:
    scales = settings.scales
    if len(scales) not in (1, inputs) or any(isinstance(scale, tuple) for scale in scales):
        raise TrainingError(
            f"scales is {scales} for {inputs} inputs.",
            "Own circuits need one number for all inputs, or one per input.",
        )
    return torch.tensor(scales, dtype=torch.float32).expand(inputs).log()
