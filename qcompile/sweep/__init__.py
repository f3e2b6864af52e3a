"""Cells of a grid run side by side, each kept in a file of its own: studies and evaluations."""
