"""Training studies: models x environments x seeds, run on one machine or many, and written up."""

from qcompile.sweep.study.run import Study, study, study_rows

__all__ = ["Study", "study", "study_rows"]
