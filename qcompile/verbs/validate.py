"""Test whether a calibration's twin shows what its machine does: `qcompile validate`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.calibration import Calibration, load_calibration
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
from qcompile.sweep.arguments import Name, Words, ignore, several
from qcompile.verbs.arguments import checked
from qcompile.verbs.live import Live, check_live, spend
from qcompile.verbs.results import Result

_ADVICE = (
    "Calibrate anew: `qcompile calibrate`. If a new one fails too, the qubits depend on their "
    "neighbours: use other qubits, with an unused one between them."
)


class Validation(Result):
    """Whether a twin passed, qubit by qubit: `failed` are those that contradict their curves."""

    @property
    def passed(self) -> bool:
        """Whether no qubit contradicts its curve."""
        return bool(self.to_dict()["passed"])

    @property
    def failed(self) -> list[int]:
        """The qubits that contradict their curves."""
        return list(self.to_dict()["failed"])

    @property
    def table(self) -> tuple[list[str], list[list[str]]]:
        values = self.to_dict()
        columns = ["qubits", "chi_square", "degrees", "p_value"]
        rows = [
            [*(f"{value:.4g}" for value in row), "fails" if row[0] in self.failed else "holds"]
            for row in zip(*(values[column] for column in columns), strict=True)
        ]
        return ["qubit", "chi-square", "expected", "p-value", "twin"], rows

    def check_passed(self) -> None:
        """Nothing, if the twin passed.

        Raises:
            CalibrationError: a qubit contradicts its curve.
        """
        values = self.to_dict()
        if not self.passed:
            raise CalibrationError(
                f"The twin of {values['file']} is not its machine any more: qubit "
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

    A qubit fails where its chi-square is what chance gives once in a thousand times. `observations`
    of episodes on the twin (their number) and `shots` of each circuit are by default the fewest
    executions that find a p01 of any one qubit raised by `effect` with `power` (0.9). The circuits
    run on `backend`, by default the noise model of the calibration's device, or with `live` on the
    machine that was calibrated, for a few seconds; that costs money. `imports` are modules that
    register environments, `env` arguments of the policy's.

    Raises:
        OptionError: options contradict each other.
        QcompileError: a file or a combination that cannot be compared.
    """
    check_live(live)
    is_free = observations is None or shots is None
    if power is not None and not is_free:
        raise OptionError("power chooses observations and shots: leave one of the three out.")
    if live is not None and backend is not None:
        raise OptionError("backend and live exclude each other: the calibration names the machine.")
    if isinstance(calibration, Calibration):
        known, file = calibration, f"the calibration of {calibration.backend}"
    else:
        known = load_calibration(calibration)
        file = str(Path(calibration))
    if shots is not None:
        check_shots(shots)
    import_modules(several(imports))
    loaded = with_arguments(load_circuits(policy), env, for_file=live is not None)
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
            f"A p01 raised by {effect:g} is found {100 * reached:.0f} % of the time at least: "
            f"{file} has too few shots for more. Calibrate with more of them."
        )
    if live is not None:
        return Validation(_live(known, file, loaded, rows, shots, effect, live, on_note))
    # A stream of its own: `calibrate` with a seed draws from that of the number itself.
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
    """What the machine's own counts say."""
    connection = live.connection(calibration.backend)
    machine = connection.device()
    if len(machine.qubits) != len(calibration.device.qubits):
        raise CalibrationError(
            f"{file} has {len(calibration.device.qubits)} qubits, {machine.name} has "
            f"{len(machine.qubits)}.",
            "Calibrate the machine anew.",
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
