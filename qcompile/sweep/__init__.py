"""Studies and evaluations: cells of a grid run in parallel, each stored in its own file."""
