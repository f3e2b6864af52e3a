"""The report of a calibration: what its numbers are."""

from __future__ import annotations

import pytest

import qcompile
from qcompile.page.calibration import calibration_document
from qcompile.page.document import Facts, Picture, Table
from qcompile.report.calibration_values import calibration_table, calibration_values, limit_words


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Picture, "of", lambda label, draw, text="": Picture(label, "", "", text))


@pytest.mark.parametrize(
    ("shots", "each"), [(8192, "8 circuits, 8,192 shots each"), (None, "8 circuits, exact")]
)
def test_numbers_are_explained(shots: int | None, each: str) -> None:
    """Of three bits, 2 + 2 ceil(log2(3)) patterns are 6; there are eight response circuits."""
    calibration = qcompile.calibrate("fake_lima", [0, 1, 2], shots=shots, seed=1, progress=False)
    values = calibration_values(calibration)
    document = calibration_document(calibration, values, calibration.plot)
    found = {section.title: section.blocks for section in document.sections}
    (settings,) = found["Settings"]
    assert isinstance(settings, Facts)
    pairs = dict(settings.pairs)
    assert pairs["response circuits"] == each
    assert pairs["readout circuits"] == each.replace("8 circuits", "6 circuits")
    assert "shots per circuit" in dict(document.facts)
    table = found["Qubits"][-1]
    assert isinstance(table, Table)
    assert "p10: a 0 that is read as 1." in table.note
    assert "offset + contrast cos(w - tilt)" in table.note
    has_fits = "Readout fit, response fit: chi-square, then its expected value." in table.note
    assert has_fits == (shots is not None)
    notes = ["readout fit, response fit: chi-square, then its expected value"]
    assert list(calibration_table(values).notes) == notes * has_fits


def test_the_limit_of_a_p_value_is_shared_by_the_qubits() -> None:
    """A thousandth over four qubits is 0.00025."""
    assert limit_words(4) == (
        "The p-value must be at least 0.00025: by chance, one of 4 qubits is below it with a "
        "probability of 0.001."
    )
    assert limit_words(1).startswith("The p-value must be at least 0.001: by chance, 1 qubit is")


def test_a_validation_says_where_a_qubit_fails() -> None:
    calibration = qcompile.calibrate("fake_lima", shots=8192, seed=1, progress=False)
    table = qcompile.validate(
        calibration, policy="cartpole", observations=2, shots=500, backend="fake_lima", seed=1
    ).table()
    assert list(table.notes) == [limit_words(len(table.rows))]
