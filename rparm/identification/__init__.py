"""Finds parameters of an FMU that fit logs of a machine, and says how well they are known."""
