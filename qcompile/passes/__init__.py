"""Passes that rewrite programs, and the levels that chain them."""

from qcompile.passes.base import Pass, Promise
from qcompile.passes.executable import Executable
from qcompile.passes.pipeline import LEVELS, PASSES, compile, lower, pipeline
from qcompile.passes.place import copies_that_fit

__all__ = [
    "LEVELS",
    "PASSES",
    "Executable",
    "Pass",
    "Promise",
    "compile",
    "copies_that_fit",
    "lower",
    "pipeline",
]
