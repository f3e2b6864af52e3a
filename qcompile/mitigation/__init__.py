"""Mitigation: fitted once with cvxpy, applied in closed form."""

from qcompile.mitigation.readout import CALIBRATION_SHOTS, ReadoutMitigation, calibrate_readout

__all__ = ["CALIBRATION_SHOTS", "ReadoutMitigation", "calibrate_readout"]
