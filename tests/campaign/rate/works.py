"""Campaigns whose rate is measured, 2000 steps a run; {runs} is to be filled in."""

from tests.campaign.files import HEAD

WORKS = {
    "arm": HEAD
    + """scenario = "sine_efforts"
sampling = "random"
runs = {runs}
block = 100
time = {{ stop = 2.0 }}
[set]
q2 = 0.0
dq1 = 0.0
dq2 = 0.0
[parameters.m2]
uniform = [0.8, 1.2]
[parameters.q1]
uniform = [-1.6, -1.4]
[keep]
final = ["q1", "dq1", "dq2"]
maximum = ["q2"]
""",
    "closed_loop": HEAD
    + """system = "closed_loop"
variant = "nominal"
sampling = "random"
runs = {runs}
block = 100
time = {{ stop = 2.0 }}
[set]
"arm.relative_tolerance" = 1e-8
[parameters."arm.m2"]
uniform = [0.9, 1.1]
[keep]
final = ["arm.ee_x", "arm.ee_y"]
[keep.tracking.tip]
of = [["arm.ee_x", "trajectory.ee_x_ref"], ["arm.ee_y", "trajectory.ee_y_ref"]]
""",
}
