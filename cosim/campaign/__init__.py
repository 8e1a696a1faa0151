"""Campaigns: thousands of runs of a scenario or a system, over parameters, on Dask.

An arrow means "uses":

    pages -> results <- engine -> runs -> loop -> fmi_calls
                          |         |
                          v         v
    campaign_file -> job, sampling  measures

`campaign_file` reads what a user writes, `job` makes of it what workers need, `sampling` gives the
parameters of each run, `loop` steps the FMUs in compiled code, `runs` makes the rows of a block on
a worker, `engine` hands blocks to workers, `results` keeps them.
"""
