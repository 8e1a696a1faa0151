"""Finds parameters of an FMU that fit logs of a machine, and says how well they are known.

logs.py           segments of the logs: rows, inputs and measured outputs
parameters.py     what is estimated: limits, scales, and the numbers that the fit works with
simulator.py      runs segments with the compiled loop, on all cores
residuals.py      residuals and their derivatives, a segment each
start_states.py   a first guess of the state at the start of each segment
fit.py            the fit: multiple shooting, Levenberg-Marquardt
intervals.py      intervals by the scatter between segments, and the classical ones
combinations.py   combinations of parameters without effect
whiteness.py      whether what is left is noise
identify.py       all of it in one call, from checked names to results
validation.py     another log, run from its start to its end
result_files.py   scenario and parameter files
figures.py        pictures of the page
page.py           the page
demo.py           the log that a system of the project makes
"""
