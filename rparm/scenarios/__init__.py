"""Scenarios: read and checked against the models they are of."""
