"""Derives C from functions in plain C, by the graph of equations: models/README.md says which."""
