"""The loop that steps FMUs, in C, and how Python runs it."""
