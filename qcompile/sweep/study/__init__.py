"""Training studies: models x environments x seeds, run on one machine or many, and written up."""
