"""Intervals that contain the exact motion, and the proven errors of runs."""
