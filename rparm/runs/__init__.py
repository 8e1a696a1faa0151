"""Runs of scenarios, compared with references and measurements, over tolerances and steps."""
