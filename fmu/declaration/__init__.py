"""The declaration of a model, its variables.toml: read and checked once for all that is written.

load.py reads it. What depends on a version of FMI is in that version's folder.
"""
