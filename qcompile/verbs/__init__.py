"""Shared by the command line and Python: a function for each command, and its result."""
