"""The loop that steps FMUs, in C, and its structures in Python."""
