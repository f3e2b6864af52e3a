"""Jobs: a policy's circuits as OpenQASM files, and a job.json that describes them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import FailFast, Field, TypeAdapter, ValidationError

from qcompile.arrays import FloatArray
from qcompile.device import Device
from qcompile.errors import CircuitError, PolicyError
from qcompile.ir import NEGLIGIBLE_RAD, Program
from qcompile.jobs.places import bits_of, round_layout
from qcompile.output import new_folder
from qcompile.passes import Executable, compile
from qcompile.policy import Policy
from qcompile.policy.decision import hold_values
from qcompile.qasm import Version, write
from qcompile.reading import ContentsError, load_json, read_file, read_npy, read_table
from qcompile.validation import explain

_QUARTER_TURN = np.pi / 2
_Row = Annotated[list[Annotated[float, Field(strict=True)]], FailFast()]
_ROWS: TypeAdapter[list[list[float]]] = TypeAdapter(Annotated[list[_Row], FailFast()])

Format = Literal["qasm3", "qasm2"]


def export_job(
    policy: Policy,
    device: Device,
    folder: Path,
    *,
    level: int = 2,
    format: Format = "qasm3",
    shots: int = 8192,
    observations: FloatArray | None = None,
    on_row: Callable[[int], None] = lambda done: None,
) -> dict[str, Any]:
    """Write the circuits of `policy` for `device` into the new `folder`; return its job.json.

    Without observations there is one parametric program for each round (OpenQASM 3 only); its
    inputs are native angles in the order of `Executable.open_slots`, or at level 0 the encoded
    features. With observations (B, features) the angles are bound, with one program for each
    observation and round. On a device OpenQASM 3 names its physical qubits ($n). Bit i of register
    c belongs to circuits[i] or, where circuits have several qubits, to bits[i] of the program; for
    these q[n] of an OpenQASM 2 program is qubit n of the device. `on_row` is called with the number
    of observations written.

    Raises:
        CircuitError: OpenQASM 2 without observations.
        OutputError: the folder is in use or cannot be written.
    """
    if observations is None and format == "qasm2":
        raise CircuitError(
            "OpenQASM 2 has no inputs, so it cannot hold a parametric job.",
            "Give --observations FILE to bind the angles, or use --format qasm3.",
        )
    executable = compile(policy.trained_program, device, level, policy.importance)
    parametric = executable.native if level == 0 else executable.template()
    rows: Iterable[tuple[int | None, Program]] = [(None, parametric)]
    if observations is not None:
        rows = _bound(executable, _encoded(policy, observations))
    version: Version = "3" if format == "qasm3" else "2"
    bit_qubits = executable.bit_qubits
    programs = []
    with new_folder(folder) as target:
        for row, native in rows:
            prefix = "" if row is None else f"observation{row}-"
            for round_index in range(executable.round_count):
                circuits = np.flatnonzero(executable.rounds == round_index).tolist()
                bits = bits_of(executable.source, circuits)
                part = _part(native, circuits)
                name = f"{prefix}round{round_index}.qasm"
                layout = round_layout(executable, circuits, version)
                (target / name).write_text(write(part, version=version, layout=layout))
                programs.append(
                    {
                        "file": name,
                        "circuits": circuits,
                        **({"bits": bits} if executable.source.is_wide else {}),
                        "qubits": bit_qubits[bits].tolist(),
                        "inputs": list(part.inputs),
                        "observation": row,
                    }
                )
            on_row(1 if row is None else row + 1)
        job = {
            "format": "qcompile-job-1",
            "backend": device.name,
            "level": level,
            "shots": shots,
            **hold_values(policy.hold),
            "programs": programs,
        }
        (target / "job.json").write_text(json.dumps(job, indent=1) + "\n")
    return job


def read_observations(path: Path, policy: Policy) -> FloatArray:
    """Observations (B, features) from a .npy, .csv or .json file, one row each.

    Raises:
        PolicyError: the file cannot be read, or its numbers do not fit the policy.
    """
    try:
        contents = read_file(path)
        if path.suffix == ".npy":
            values = read_npy(contents)
        elif path.suffix == ".json":
            values = np.array(_rows(load_json(contents)), dtype=float)
        else:
            values = read_table(contents)
        with np.errstate(over="ignore"):  # infinite values are refused below
            values = np.atleast_2d(np.asarray(values, dtype=float))
    except (OSError, ContentsError, ValidationError) as error:
        raise PolicyError(
            f"{path} holds no observations.",
            *explain(error)[0].splitlines()[:1],
            "It needs one row of numbers for each observation, as .npy, .csv or .json.",
        ) from error
    if not np.isfinite(values).all() or not values.size:
        raise PolicyError(f"{path} holds no observations, or a number that is not finite.")
    _encoded(policy, values)
    return values


def _rows(values: Any) -> list[list[float]]:
    """The rows of a JSON document; a single row needs no enclosing list."""
    if not isinstance(values, list) or not values or not isinstance(values[0], list):
        values = [values if isinstance(values, list) else [values]]
    rows = _ROWS.validate_python(values)
    if len({len(row) for row in rows}) > 1:
        raise ContentsError("Its rows have different lengths.")
    return rows


def _encoded(policy: Policy, observations: FloatArray) -> FloatArray:
    with np.errstate(all="ignore"):
        x = policy.encode(observations)
    if not np.isfinite(x).all():
        raise PolicyError("An observation leads to an angle that is not finite.")
    return x


def _bound(executable: Executable, x: FloatArray) -> Iterator[tuple[int, Program]]:
    """The native circuits for each row of x (B, inputs), angles bound for the whole batch at once.

    A row with an angle at a quarter turn may need fewer gates and is compiled separately, unless
    circuits are routed, which would then be done anew.
    """
    angles = executable.bind(x, np.zeros(0))[:, executable.open_slots]
    quarters = np.abs(angles - np.rint(angles / _QUARTER_TURN) * _QUARTER_TURN)
    special = np.asarray((quarters <= NEGLIGIBLE_RAD).any(axis=1)) & (not executable.source.is_wide)
    angles -= np.rint(angles / (4 * _QUARTER_TURN)) * (4 * _QUARTER_TURN)
    template = executable.template()
    for row, values in enumerate(angles):
        if special[row]:
            substituted = executable.source.substitute(_named(executable.source.inputs, x[row]))
            yield row, compile(substituted, executable.device, executable.level).native
        else:
            yield row, template.substitute(_named(template.inputs, values))


def _named(names: tuple[str, ...], values: FloatArray) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


def _part(native: Program, circuits: list[int]) -> Program:
    """The native circuits of one round, with the inputs they use."""
    chosen = tuple(native.circuits[i] for i in circuits)
    used = {symbol for circuit in chosen for symbol in circuit.symbols}
    return Program(chosen, tuple(name for name in native.inputs if name in used))
