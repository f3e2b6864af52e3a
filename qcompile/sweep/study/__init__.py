"""Training studies: train models in environments with several seeds, and write up the results."""

from qcompile.sweep.study.request import StudyRequest
from qcompile.sweep.study.run import Study, run_study

__all__ = ["Study", "StudyRequest", "run_study"]
