"""Test a calibration against fresh counts: what `qcompile validate` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.calibration import Calibration, load_calibration
from qcompile.caller import option
from qcompile.deploy.registration import import_modules
from qcompile.deploy.twin_check import check_twin, wide_observations
from qcompile.deploy.twin_power import EFFECT, POWER, choose_check
from qcompile.device import Device
from qcompile.errors import CalibrationError, OptionError
from qcompile.execution import Backend, Executor, check_shots, open_executor
from qcompile.live.validate import ValidateTask
from qcompile.mitigation.misfit import misfit_warnings
from qcompile.policy import Policy, load_circuits
from qcompile.policy.arguments import with_arguments
from qcompile.policy.files import policy_values
from qcompile.report.calibration_values import limit_words
from qcompile.report.table import Cell, Column, Table
from qcompile.sweep.arguments import Name, Words, ignore, several
from qcompile.verbs.arguments import checked
from qcompile.verbs.live import Live, check_live, spend
from qcompile.verbs.results import Result

_ADVICE = (
    "Calibrate again with `qcompile calibrate`. If the new calibration fails too, the qubits "
    "disturb each other: use other qubits, with an unused one between neighbours."
)


class Validation(Result):
    """Whether the counts agree with a twin: `failed` are the qubits that contradict their curve."""

    @property
    def passed(self) -> bool:
        """Whether no qubit contradicts its curve."""
        return bool(self.to_dict()["passed"])

    @property
    def failed(self) -> list[int]:
        """The qubits that contradict their curves."""
        return list(self.to_dict()["failed"])

    def table(self) -> Table:
        """A row for each qubit."""
        values = self.to_dict()
        keys = ["qubits", "chi_square", "degrees", "p_value"]
        rows = [
            [
                *(Cell.of(value, ".4g") for value in row),
                "fails" if row[0] in self.failed else "holds",
            ]
            for row in zip(*(values[key] for key in keys), strict=True)
        ]
        names = ["qubit", "chi-square", "expected", "p-value"]
        columns = [*map(Column, names), Column("twin", right=False)]
        return Table(columns, rows, notes=[limit_words(len(rows))])

    def check_passed(self) -> None:
        """Check that the twin passed.

        Raises:
            CalibrationError: a qubit contradicts its curve.
        """
        values = self.to_dict()
        if not self.passed:
            raise CalibrationError(
                f"The twin of {values['file']} no longer matches the machine on qubit "
                f"{', '.join(map(str, self.failed))}.",
                *(misfit_warnings(values["calibration_misfits"]) or [_ADVICE]),
            )


@checked
def validate(
    calibration: Name | Calibration,
    *,
    policy: Name | Policy = "lunarlander",
    observations: int | None = None,
    shots: int | None = None,
    power: float | None = None,
    effect: float = EFFECT,
    seed: int = 0,
    imports: Name | Sequence[Name] = (),
    env: Mapping[str, Any] | None = None,
    backend: Name | Device | Backend | Executor | Any = None,
    live: Live | None = None,
    on_note: Words = ignore,
) -> Validation:
    """Run a policy's circuits and compare their counts with the twin of a calibration.

    A qubit fails if its chi-square is so large that chance gives it once in a thousand times.
    `observations` is the number of observations, taken from episodes on the twin, and `shots` is
    that of each circuit. By default they are the fewest that detect an increase of any one qubit's
    p01 by `effect` with the probability `power` (0.9). The circuits run on `backend`, by default
    the noise model of the calibration's device; with `live` they run on the machine that was
    calibrated, for a few seconds, which costs money. `imports` are modules that register
    environments, `env` are arguments of the policy's environment.

    Raises:
        CircuitError: a circuit of the policy has several qubits.
        OptionError: options contradict each other.
        QcompileError: a file or a combination cannot be compared.
    """
    check_live(live)
    is_free = observations is None or shots is None
    if power is not None and not is_free:
        raise OptionError(
            f"{option('power')} chooses {option('observations')} or {option('shots')}: give at "
            "most two of the three."
        )
    if live is not None and backend is not None:
        raise OptionError(
            f"{option('backend')} cannot be combined with {option('live')}: the calibration names "
            "the machine."
        )
    if isinstance(calibration, Calibration):
        known, file = calibration, f"the calibration of {calibration.backend}"
    else:
        known = load_calibration(calibration)
        file = str(Path(calibration))
    if shots is not None:
        check_shots(shots)
    import_modules(several(imports))
    loaded = with_arguments(load_circuits(policy), env, for_file=live is not None)
    hint = f"A twin has the curves of single qubits; name another {option('policy')}."
    loaded.program.require_narrow("validate", hint)
    least_power = POWER if power is None else power
    rows, shots, reached = choose_check(
        known,
        loaded,
        wide_observations(loaded, known, seed),
        rows=observations,
        shots=shots,
        power=least_power,
        effect=effect,
    )
    if is_free and reached < least_power:
        on_note(
            f"An increase of p01 by {effect:g} is detected with a probability of only "
            f"{100 * reached:.0f} %: {file} has too few shots. Calibrate with more."
        )
    if live is not None:
        return Validation(_live(known, file, loaded, rows, shots, effect, live, on_note))
    # A separate stream: `calibrate` with the same seed draws from the seed itself.
    (fresh,) = np.random.SeedSequence(seed).spawn(1)
    executor = open_executor(known.device if backend is None else backend, fresh)
    check = check_twin(known, loaded, rows, executor, shots, effect)
    return Validation({"file": file, "shots": shots, **check.values()})


def _live(
    calibration: Calibration,
    file: str,
    policy: Policy,
    observations: FloatArray,
    shots: int,
    effect: float,
    live: Live,
    on_note: Words,
) -> dict[str, Any]:
    """Compare with counts of the machine itself."""
    connection = live.connection(calibration.backend)
    machine = connection.device()
    if len(machine.qubits) != len(calibration.device.qubits):
        raise CalibrationError(
            f"{file} has {len(calibration.device.qubits)} qubits, {machine.name} has "
            f"{len(machine.qubits)}.",
            "Calibrate the machine again.",
        )
    task = ValidateTask.model_validate(
        {
            **live.where,
            "backend": calibration.backend,
            "device": calibration.device,
            "calibration": calibration,
            "calibration_file": file,
            "policy": policy_values(policy),
            "observations": observations.tolist(),
            "shots": shots,
            "effect": effect,
        }
    )
    return spend(task, task.load, live, connection, on_note)
