"""Evaluation grids: policies x backends x shots x mitigations x levels, compared with the ideal."""
