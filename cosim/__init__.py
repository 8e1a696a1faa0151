"""Runs co-simulation units through fmpy and checks them against reference trajectories."""
