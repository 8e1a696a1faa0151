"""A master that steps connected FMUs, and its step-size control."""
