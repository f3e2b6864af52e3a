"""Evaluation grids: policies x backends x shots x mitigations x levels, compared with the ideal."""

from qcompile.sweep.evaluation.run import Evaluation, evaluate, evaluate_paper

__all__ = ["Evaluation", "evaluate", "evaluate_paper"]
