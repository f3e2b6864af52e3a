"""The exceptions a user can cause. Any other type of exception is a bug in qcompile.

QcompileError                 exit code 1 on the command line
├── CircuitError              a gate, an angle or a program that is not legal IR
├── ProgramFileError          an OpenQASM file that cannot be read or compiled
├── DeviceError               an unknown device, or an invalid device file
├── PolicyError               a policy file or an array that does not fit the policy
├── CountsError               shots or counts outside their range
├── EnvironmentMismatchError  an environment that is unknown or does not fit the policy
├── EnvironmentStepError      an environment that fails, or returns values no policy can use
├── CalibrationError          counts that cannot be fitted, or a calibration that does not apply
├── TrainingError             training settings that contradict each other
├── StudyError                a study or a grid that cannot be run or written up
├── FigureError               a figure or a table that cannot be drawn as asked
├── LiveError                 a run on real hardware that cannot start or resume
│   ├── BudgetError           it would pass its limit of QPU seconds
│   ├── PaidFailureError      it would pay again for a job that was charged but returned nothing
│   └── ReplayError           it does not reproduce the jobs in its journal
├── OutputError               a file or folder that cannot be written
└── MissingExtraError         an optional package that is not installed
"""

from __future__ import annotations

from typing import Self


class QcompileError(Exception):
    """What failed, then what was found against what was needed, then what to try.

    `what` is the first line; each of `hints` becomes an indented line below it.
    """

    def __init__(self, what: str, *hints: str):
        super().__init__("\n  ".join((what, *hints)))

    def with_hints(self, *hints: str) -> Self:
        """The same error with more hints."""
        error = type(self).__new__(type(self))
        error.args = ("\n  ".join((str(self), *hints)),)
        return error


class CircuitError(QcompileError, ValueError):
    """A gate, an angle or a program is not legal IR."""


class ProgramFileError(QcompileError, ValueError):
    """An OpenQASM file cannot be read, or contains something that cannot be compiled."""


class DeviceError(QcompileError, ValueError):
    """A device is unknown, or its file is invalid."""


class PolicyError(QcompileError, ValueError):
    """A policy file cannot be read, or an array does not fit the policy."""


class OptionError(QcompileError, ValueError):
    """Options or settings contradict each other, or have the wrong type."""


class CountsError(QcompileError, ValueError):
    """Shots or counts lie outside their range."""


class EnvironmentMismatchError(QcompileError, ValueError):
    """The environment is unknown or does not fit the policy."""


class EnvironmentStepError(QcompileError, RuntimeError):
    """An environment fails in an episode, or returns values no policy can use."""


class CalibrationError(QcompileError, ValueError):
    """Counts cannot be fitted, or a calibration does not apply to what it is used for."""


class TrainingError(QcompileError, ValueError):
    """Training settings contradict each other or the environment."""


class StudyError(QcompileError, ValueError):
    """A study, or a grid of evaluations, cannot be run or written up as asked."""


class FigureError(QcompileError, ValueError):
    """A figure, a table or a drawing cannot be made as asked, or its style cannot be read."""


class LiveError(QcompileError, RuntimeError):
    """A run on real hardware cannot start or resume; every job paid for is in its journal."""


class BudgetError(LiveError):
    """The next job would pass the limit of QPU seconds."""


class PaidFailureError(LiveError):
    """A job was charged but returned no counts; the user must allow it to be sent again."""


class ReplayError(LiveError):
    """A run does not reproduce the jobs in its journal, so it cannot be resumed here."""


class OutputError(QcompileError, OSError):
    """A file or folder cannot be written."""


class MissingExtraError(QcompileError, ImportError):
    """An optional package is needed; the message holds the line that installs it."""

    def __init__(self, purpose: str, extra: str):
        super().__init__(
            f"{purpose} needs packages that are not installed.",
            f"Install them with: pip install 'qcompile[{extra}]'",
        )
