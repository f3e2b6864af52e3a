"""Encoders map observations to the input angles of circuits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.errors import PolicyError
from qcompile.notebook import count, html_table


def _clip(values: FloatArray) -> FloatArray:
    return np.clip(values, -1.0, 1.0)


ENCODINGS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "arctan": np.arctan,
    "tanh": np.tanh,
    "identity": np.asarray,
    "clip": _clip,
}
"""The functions an encoder can apply to a scaled feature; all are odd. `clip` clips to [-1, 1]."""

BITS = "bits"
"""The function for an observation that is one number: pi times one of its bits."""

MOST_BIT = 52
"""The highest bit of the whole numbers that float64 represents exactly."""

MOST_SCALE = 1e9


@dataclass(frozen=True, eq=False, repr=False)
class Encoder:
    """x_i = gain_i * function_i(scale_i * (observation[f] - mean[f]) / std[f]), f = feature_i.

    x is in radians. `function` is a name in ENCODINGS for all inputs, or one per input. `gain` has
    an entry per input, `mean` and `std` have one per feature of the observation; the defaults are
    1, 0 and 1. The function `bits` is for observations that are one whole number, and must be used
    for all inputs: x_i = gain_i * pi * (bit feature_i of the number), with bit 0 the lowest.
    """

    function: str | tuple[str, ...]
    feature: IntArray
    scale: FloatArray
    gain: FloatArray | None = None
    mean: FloatArray | None = None
    std: FloatArray | None = None

    @cached_property
    def functions(self) -> tuple[str, ...]:
        """The function of each input."""
        if isinstance(self.function, str):
            return (self.function,) * len(self.feature)
        return self.function

    @cached_property
    def reads_bits(self) -> bool:
        """Whether an observation is one whole number, whose bits are the inputs."""
        return self.function == BITS or BITS in self.functions

    @cached_property
    def features(self) -> int:
        """The smallest number of features that an observation may have."""
        if self.reads_bits:
            return 1
        statistics = [len(array) for array in (self.mean, self.std) if array is not None]
        return max(int(self.feature.max(initial=-1)) + 1, *statistics, 0)

    @property
    def gains(self) -> FloatArray:
        """The gain of each input."""
        return np.ones(len(self.feature)) if self.gain is None else self.gain

    def __call__(self, observations: FloatArray) -> FloatArray:
        """The inputs x (B, inputs) of observations (B, features).

        Raises:
            PolicyError: bits are read from a value that is not a whole number from 0 to 2^53.
        """
        if self.reads_bits:
            return self._turned_bits(observations)
        values = observations.take(self.feature, axis=1)
        if self._statistics is not None:
            mean, std = self._statistics
            values = (values - mean) / std
        x = values * self.scale
        if len(self._columns) == 1:
            (name,) = self._columns
            x = ENCODINGS[name](x)
        else:
            for name, columns in self._columns.items():
                x[:, columns] = ENCODINGS[name](x[:, columns])
        return x if self.gain is None else x * self.gain

    def _turned_bits(self, observations: FloatArray) -> FloatArray:
        numbers = observations[:, :1]
        if not ((numbers >= 0) & (numbers < 2.0**53) & (numbers == np.floor(numbers))).all():
            raise PolicyError(
                "The function bits needs observations that are whole numbers of at least 0.",
                "It is for environments with a Discrete observation.",
            )
        bits = (numbers.astype(np.int64) >> self.feature) & 1
        return np.asarray(np.pi * bits * self.gains, dtype=float)

    @cached_property
    def _statistics(self) -> tuple[FloatArray, FloatArray] | None:
        """Mean and standard deviation of the feature of each input."""
        if self.mean is None and self.std is None:
            return None
        count = len(self.feature)
        mean = np.zeros(count) if self.mean is None else self.mean[self.feature]
        return mean, np.ones(count) if self.std is None else self.std[self.feature]

    @cached_property
    def _columns(self) -> dict[str, IntArray]:
        """The input indices of each function."""
        names = np.array(self.functions)
        return {name: np.flatnonzero(names == name) for name in dict.fromkeys(self.functions)}

    def __repr__(self) -> str:
        functions = " ".join(dict.fromkeys(self.functions))
        inputs, features = count(len(self.feature), "input"), count(self.features, "feature")
        return f"Encoder({functions}, {inputs} of {features})"

    def _repr_html_(self) -> str:
        rows = [[f"x{i}", self.formula(i)] for i in range(len(self.feature))]
        return html_table(["input", "of an observation"], rows)

    def reading(self, index: int) -> dict[str, Any]:
        """The plain numbers of input `index`: its feature, function, scale; others where set."""
        feature = int(self.feature[index])
        more = {
            "gain": (self.gain, index),
            "mean": (self.mean, feature),
            "std": (self.std, feature),
        }
        return {
            "feature": feature,
            "function": self.functions[index],
            "scale": float(self.scale[index]),
            **{key: float(array[at]) for key, (array, at) in more.items() if array is not None},
        }

    def formula(self, index: int) -> str:
        """Input `index` as text, such as "0.5*arctan(2 * (observation[3] - 1) / 4)"."""
        name, feature = self.functions[index], int(self.feature[index])
        gain = "" if self.gain is None else f"{self.gain[index]:.6g}*"
        if name == BITS:
            return f"{gain}pi*bit {feature} of the observation"
        read = f"observation[{feature}]"
        if self.mean is not None:
            read = f"({read} - {self.mean[feature]:.6g})"
        if self.std is not None:
            read = f"{read} / {self.std[feature]:.6g}"
        scaled = f"{self.scale[index]:.6g} * {read}"
        return f"{gain}{scaled}" if name == "identity" else f"{gain}{name}({scaled})"

    def check(self, inputs: int) -> None:
        """Raise PolicyError if this is not a valid encoder for `inputs` inputs."""
        names = (self.function,) if isinstance(self.function, str) else self.function
        for name in names:
            if name not in (*ENCODINGS, BITS):
                raise PolicyError(
                    f"Unknown encoder function {name!r}.", f"Known: {', '.join(ENCODINGS)}, {BITS}."
                )
        check_arrays(
            {
                "encoder.scale": (self.scale, (inputs,)),
                "encoder.feature": (self.feature, (inputs,)),
                "encoder.gain": (self.gain, (inputs,)),
            }
        )
        if not isinstance(self.function, str) and len(names) != inputs:
            raise PolicyError(
                f"encoder.function has {len(names)} names.", f"It needs one or {inputs}."
            )
        for key, array in (("scale", self.scale), ("gain", self.gain)):
            if array is not None and np.abs(array).max(initial=0.0) > MOST_SCALE:
                raise PolicyError(
                    f"encoder.{key} has an entry of {np.abs(array).max():.3g}.",
                    f"{key.capitalize()}s must lie within {MOST_SCALE:.0e}: larger ones turn every "
                    "angle into noise.",
                )
        if self.reads_bits:
            self._check_bits()
        else:
            self._check_statistics()

    def _check_statistics(self) -> None:
        needed = int(self.feature.max(initial=-1)) + 1
        lengths = {}
        for key, array in (("mean", self.mean), ("std", self.std)):
            if array is None:
                continue
            check_arrays({f"encoder.{key}": (array, (len(array),))})
            lengths[key] = len(array)
            if len(array) < needed:
                raise PolicyError(
                    f"encoder.{key} has {len(array)} numbers.",
                    f"It needs one per feature of an observation: {needed} or more.",
                )
        if len(set(lengths.values())) > 1:
            raise PolicyError(
                f"encoder.mean has {lengths['mean']} numbers, but encoder.std has "
                f"{lengths['std']}.",
                "Each needs one per feature of an observation.",
            )
        if self.std is None:
            return
        if not (self.std > 0).all():
            raise PolicyError("encoder.std contains a number that is not positive.")
        if (np.abs(self.scale) > MOST_SCALE * self.std[self.feature]).any():
            raise PolicyError(
                "encoder.std contains a number that is too small for its scale.",
                f"Scales divided by std must lie within {MOST_SCALE:.0e}.",
            )

    def _check_bits(self) -> None:
        if set(self.functions) - {BITS}:
            raise PolicyError(
                f"encoder.function has {BITS} and other functions.",
                f"Bits are read from an observation that is one number: use {BITS} for all inputs.",
            )
        if self.feature.max(initial=0) > MOST_BIT:
            raise PolicyError(
                f"encoder.feature has an entry of {self.feature.max()}.",
                f"With the function {BITS} it is the number of a bit, at most {MOST_BIT}.",
            )
        if (self.scale != 1).any() or self.mean is not None or self.std is not None:
            raise PolicyError(
                f"The encoder function {BITS} needs scale 1, and no mean or std.",
                "A gain multiplies the angle.",
            )


def check_arrays(needed: dict[str, tuple[FloatArray | IntArray | None, tuple[int, ...]]]) -> None:
    """Raise PolicyError for the first array with the wrong shape or infinite or NaN entries."""
    for name, (array, shape) in needed.items():
        if array is None:
            continue
        if np.shape(array) != shape:
            raise PolicyError(f"{name} has shape {np.shape(array)}.", f"It needs {shape}.")
        if not np.isfinite(array).all():
            raise PolicyError(f"{name} contains a number that is not finite.")
