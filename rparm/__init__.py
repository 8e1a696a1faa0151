"""Drives FMUs through fmpy: compares them with references, plots, couples, runs systems."""
