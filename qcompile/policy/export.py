"""Jobs: a policy's circuits as OpenQASM files, and the job.json that says what they are."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, Literal
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from qcompile.device import Device
from qcompile.errors import CircuitError, PolicyError
from qcompile.ir import Program
from qcompile.output import new_folder
from qcompile.passes import Executable, compile
from qcompile.policy.policy import Policy
from qcompile.qasm import write

FloatArray = NDArray[np.float64]

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
) -> dict[str, Any]:
    """Write the circuits of `policy` for `device` into the new `folder`; return its job.json.

    Without observations one parametric program for each round (OpenQASM 3 only): its inputs are
    native angles in the order of `Executable.bind_slots`, or at level 0 the encoded features.
    With observations (B, features) their angles are bound, one program for each observation and
    round. On a device with its own qubits OpenQASM 3 names them ($n); bit i of register c belongs
    to circuits[i].

    Raises:
        CircuitError: OpenQASM 2 without observations.
        OutputError: the folder is in use or cannot be written.
    """
    if observations is None and format == "qasm2":
        raise CircuitError(
            "OpenQASM 2 has no inputs, so a parametric job cannot be written in it.",
            "Give --observations FILE to bind the angles, or use --format qasm3.",
        )
    parametric = policy.program.substitute(_named(policy.program.parameters, policy.theta))
    bound = (
        [(None, parametric)] if observations is None else _bound(parametric, policy, observations)
    )
    programs = []
    with new_folder(folder) as target:
        for row, program in bound:
            executable = compile(program, device, level)
            prefix = "" if row is None else f"observation{row}-"
            for round_index in range(executable.round_count):
                circuits = np.flatnonzero(executable.rounds == round_index)
                qubits = [int(q) for q in executable.qubits[circuits]]
                native = _part(executable, circuits.tolist())
                name = f"{prefix}round{round_index}.qasm"
                physical = format == "qasm3" and not device.is_ideal
                text = write(
                    native,
                    version="3" if format == "qasm3" else "2",
                    qubits=qubits if physical else None,
                )
                (target / name).write_text(text)
                programs.append(
                    {
                        "file": name,
                        "circuits": circuits.tolist(),
                        "qubits": qubits,
                        "inputs": list(native.inputs),
                        "observation": row,
                    }
                )
        job = {
            "format": "qcompile-job-1",
            "backend": device.name,
            "level": level,
            "shots": shots,
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
        if path.suffix == ".npy":
            values = np.load(BytesIO(path.read_bytes()), allow_pickle=False)
        elif path.suffix == ".json":
            values = np.array(json.loads(path.read_text()), dtype=float)
        else:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # an empty file is refused below
                values = np.loadtxt(path, delimiter=",", ndmin=2)
        if not isinstance(values, np.ndarray) or np.iscomplexobj(values):
            raise TypeError("It is no single array of real numbers.")
        values = np.atleast_2d(np.asarray(values, dtype=float))
    except (OSError, ValueError, TypeError, EOFError, BadZipFile, RecursionError) as error:
        raise PolicyError(
            f"{path} holds no observations.",
            *str(error).splitlines()[:1],
            "It needs one row of numbers for each observation, as .npy, .csv or .json.",
        ) from error
    if not np.isfinite(values).all() or not values.size:
        raise PolicyError(f"{path} holds no observation, or a number that is not finite.")
    policy.encode(values)
    return values


def _bound(
    program: Program, policy: Policy, observations: FloatArray
) -> Iterator[tuple[int, Program]]:
    for row, x in enumerate(policy.encode(observations)):
        yield row, program.substitute(_named(program.inputs, x))


def _named(names: tuple[str, ...], values: FloatArray) -> dict[str, float]:
    return dict(zip(names, map(float, values), strict=True))


def _part(executable: Executable, circuits: list[int]) -> Program:
    """The native circuits of one round, with the inputs that occur in them."""
    native = executable.native if executable.level == 0 else executable.template()
    chosen = tuple(native.circuits[i] for i in circuits)
    used = {symbol for circuit in chosen for symbol in circuit.symbols}
    return Program(chosen, tuple(name for name in native.inputs if name in used))
