"""Measures `<Z>` of a program on a device: compiled once, run and mitigated."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.calibration import Calibration
from qcompile.caller import option
from qcompile.deploy.rows import Rows, packed
from qcompile.deploy.settings import RunSettings
from qcompile.errors import CalibrationError
from qcompile.execution import ExactPrepared, Executor, Workload, require_exact
from qcompile.ir import Program
from qcompile.mitigation import (
    Misfit,
    Mitigation,
    calibrate,
    calibration_workload,
    enough_product_shots,
    enough_shots,
    misfits,
    predistorted,
    readout_mitigation,
    response_mitigation,
)
from qcompile.mitigation.measure import Part
from qcompile.mitigation.products import ProductMitigation, product_mitigation, with_sub_products
from qcompile.passes import Executable, compile, copies_that_fit
from qcompile.streams import Draws


class Measurement:
    """A program compiled for an executor's device, with its mitigation.

    `settings` are resolved, and fitted to the device here. The calibration is measured first if one
    is needed and not given. `importance` (circuits,) guides the placement. With n copies, n rows of
    a batch run side by side in one execution; a split row uses all copies, with a part of its shots
    in each. `misfits` are the fits in use that contradict their own counts; `calibration_load` and
    `calibration_shots` are the jobs, executions and shots of the calibration that was measured.

    Raises:
        CalibrationError: the calibration belongs to another device, or a qubit cannot be
            calibrated.
        CircuitError: importance or copies are out of range, or the settings need circuits of one
            qubit.
        OptionError: two copies to split a row over do not fit on the device.
    """

    def __init__(
        self,
        program: Program,
        executor: Executor,
        settings: RunSettings,
        importance: FloatArray | None = None,
    ):
        _check_wide(program, settings)
        if settings.split:
            settings = settings.fitted(copies_that_fit(program, executor.device))
        self.settings, self.executor = settings, executor
        has_products = program.has_products
        count = len(program.measured)
        self._importance = importance = np.ones(count) if importance is None else importance
        if has_products and settings.mitigation == "readout":
            program = with_sub_products(program)
            importance = np.pad(importance, (0, len(program.measured) - count))
        self.executable: Executable = compile(
            program, executor.device, settings.level, importance, copies=settings.copies or 1
        )
        self._shots = self._observed_shots = settings.circuit_shots(len(program))
        if has_products and isinstance(self._shots, np.ndarray):
            self._observed_shots = self._shots[[*self.executable.source.owners]]
        self.calibration_load = Workload()
        self.calibration_shots: int | None = None
        self.misfits: list[Misfit] = []
        self._mitigation: Mitigation | None = None
        self._products: ProductMitigation | None = None
        if settings.mitigation == "readout":
            calibration = self._calibration_of("readout")
            if has_products:
                copies = settings.copies or 1
                self._products = product_mitigation(calibration, self.executable, count, copies)
            else:
                self._mitigation = readout_mitigation(calibration, self.executable)
        elif settings.mitigation == "response":
            calibration = self._calibration_of("response")
            self._mitigation = response_mitigation(calibration, self.executable)
        elif settings.predistort:
            calibration = self._calibration_of("response")
            self.executable = predistorted(self.executable, calibration)
        if executor.calibration is not None:
            self._note_misfits(executor.calibration, "response")
        self._prepared = executor.prepare(self.executable)
        if settings.split:
            self._weights = settings.place_weights
            mitigation = self._mitigation
            self._of_mean = mitigation and mitigation.of_mean(self._weights)

    @property
    def has_expectations(self) -> bool:
        """Whether its executor provides expectations without shot noise."""
        return isinstance(self._prepared, ExactPrepared)

    def _note_misfits(self, calibration: Calibration, part: Part) -> None:
        """Record the misfits of a part on the executable's qubits, each once."""
        fits = misfits(calibration, [part], self.executable.bit_qubits.tolist())
        self.misfits += [fit for fit in fits if fit not in self.misfits]

    def _calibration_of(self, part: Part) -> Calibration:
        """The given calibration, the backend's, or one that is measured now."""
        calibration = self.settings.calibration or self.executor.calibration
        if calibration is None:
            calibration = self._measure_calibration(part)
        name = self.executor.device.name
        if calibration.backend != name:
            raise CalibrationError(
                f"The calibration belongs to {calibration.backend}; the backend is {name}.",
                f"Measure one with `qcompile calibrate --backend {name}`.",
            )
        self._note_misfits(calibration, part)
        return calibration

    def _measure_calibration(self, part: Part) -> Calibration:
        shots = None if self.settings.shots is None else self._shots_of_calibration(part)
        calibration = calibrate(self.executor, self.executable.bit_qubits, shots, parts=[part])
        if calibration.unfitted:
            raise CalibrationError(
                f"The {part} of {self.executor.device.name} cannot be calibrated.",
                *calibration.unfitted,
            )
        if shots is not None:
            self.calibration_shots = shots
            self.calibration_load = calibration_workload(len(calibration.qubits), shots, [part])
        return calibration

    def _shots_of_calibration(self, part: Part) -> int:
        if self.settings.calibration_shots != "auto":
            return self.settings.calibration_shots
        copies = self.settings.copies or 1
        # The variance of a mean over places has the squares of their weights.
        weights = self.settings.place_weights**2 if self.settings.split else np.ones(copies)
        importance = np.outer(weights, self._importance).ravel()
        if self.executable.source.has_products:
            places = self.settings.place_shots if self.settings.split else [self.settings.shots]
            of_copy = np.broadcast_to(np.array(places), copies)
            return enough_product_shots(self.executable, len(self._importance), of_copy, importance)
        return enough_shots(self.executable, part, self._shots, importance)

    def __call__(
        self,
        x: FloatArray,
        theta: FloatArray,
        rows: Rows | None = None,
        draws: Draws | None = None,
    ) -> FloatArray:
        """Inputs (B, inputs) and theta (parameters,) to `<O>` as measured, (B, observables).

        `rows` gives the episode and decision of each row, which determine its copy; random numbers
        come from `draws`, if given. For split rows these cover all circuits of all copies.
        """
        copies = self.settings.copies or 1
        if self.settings.split:
            return self._measure_split(np.tile(x, (1, copies)), theta, rows, draws)
        if copies == 1:
            return self._mitigated(self._measure(x, theta, rows, draws))
        rows = Rows.of(len(x)) if rows is None else rows
        places = packed(rows, copies)
        side_by_side = np.zeros((*places.shape, x.shape[1]))
        taken = places >= 0
        side_by_side[taken] = x[places[taken]]
        together = side_by_side.reshape(len(places), copies * x.shape[1])
        z = self._mitigated(self._measure(together, theta, rows.at(places), draws))
        z = z.reshape(*places.shape, z.shape[1] // copies)
        result = np.empty((len(x), z.shape[2]))
        result[places[taken]] = z[taken]
        return result

    def _measure(
        self, x: FloatArray, theta: FloatArray, rows: Rows | None, draws: Draws | None
    ) -> FloatArray:
        """The unmitigated `<O>`, (executions, copies * observables), for inputs of all copies."""
        if self.settings.shots is None:
            return require_exact(self._prepared).expectation(x, theta)
        rng = None if draws is None or rows is None else draws.rows(rows.episode, rows.decision)
        ones = self._prepared.ones(x, theta, self._shots, rng)
        return np.asarray(np.subtract(1.0, ones * (2.0 / self._observed_shots)))

    def _mitigated(self, z: FloatArray) -> FloatArray:
        if self._products is not None:
            return self._products.apply(z)
        return z if self._mitigation is None else self._mitigation.apply(z)

    def _measure_split(
        self, x: FloatArray, theta: FloatArray, rows: Rows | None, draws: Draws | None
    ) -> FloatArray:
        """Mean `<O>` (B, observables) over copies, weighted by shots, for inputs of all copies."""
        z = self._measure(x, theta, rows, draws)
        if self._products is not None:
            z = self._products.unclipped(z)
        elif self._mitigation is not None:
            z = self._mitigation.tilted_cosine(z)
        weighted = z.reshape(len(z), len(self._weights), -1) * self._weights[:, None]
        mean = np.asarray(weighted.sum(axis=1))
        if self._products is not None:
            return np.asarray(np.clip(mean, -1.0, 1.0))
        return mean if self._of_mean is None else self._of_mean.apply(mean)


def _check_wide(program: Program, settings: RunSettings) -> None:
    """Check the settings of circuits of several qubits before anything is measured.

    Raises:
        CircuitError: they describe the response of circuits of one qubit.
    """
    if settings.predistort:
        hint = f"Remove {option('predistort')}; {option('mitigation')} readout undoes the readout."
        program.require_narrow("Predistortion", hint)
    elif settings.mitigation == "response":
        program.require_narrow("Response mitigation", f"Use {option('mitigation')} readout.")
