"""Training studies: models x environments x seeds, run on one machine or many, and written up."""

from qcompile.sweep.study.request import StudyRequest
from qcompile.sweep.study.run import Study, run_study

__all__ = ["Study", "StudyRequest", "run_study"]
