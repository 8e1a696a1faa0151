"""Campaigns: thousands of runs of a scenario or a system, over parameters, on Dask."""
