"""Proven errors of runs and references, for models of equations."""
