"""Campaigns: thousands of runs of a scenario or a system, over parameters, on Dask.

From what a user writes to the page, a module each; a module imports only from lines above its own
(tests/campaign/test_layers.py):

    campaign_file                  the file, checked by itself
    sampling                       parameters of each run, by scipy and SALib
    measures                       what is kept of a run
    job                            all that workers need, picklable
    points                         parameters of a block, and what follows from them
    bases, quantities, planning    the scenario or system; the file checked against it, its units
    runs, worker                   rows of a block, on a worker
    results                        Parquet files and the manifest
    credentials, cluster           certificates; workers of Dask, here or elsewhere
    engine                         hands blocks to them
    work                           all of these for one file
    analysis, figures, page        what the table says
    replay                         one run again
"""
