"""Builds the examples of this folder and draws a run of each.

PYTHONPATH=. build/venv/bin/python examples/models/draw.py [PICTURE]
"""

import math
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import rparm

FOLDER = Path(__file__).resolve().parent
# stop and step in s, start values, variables to draw: over time, or over the one in brackets
RUNS = {
    "dahlquist": (4.0, 0.02, {}, ["x"]),
    "van_der_pol": (40.0, 0.01, {"mu": 5.0}, ["x"]),
    "lorenz": (40.0, 0.01, {}, ["(x)", "z"]),
    "cart_and_pole": (10.0, 0.01, {"phi": 2.5, "m_pole": 1.0}, ["phi"]),
    "twin_drive": (0.3, 0.001, {}, ["left.speed", "right.speed"]),
    "rectifier": (0.06, 0.0002, {}, ["u"]),
    "dc_motor": (0.2, 0.0005, {}, ["i"]),
    "two_body_orbit": (40000.0, 50.0, {}, ["(x)", "y"]),
    "bouncing_ball": (3.0, 0.002, {}, ["h"]),
    "thermostat": (7200.0, 10.0, {}, ["room"]),
    "drive": (0.5, 0.002, {}, ["phi", "seen"]),
    "masses": (20.0, 0.05, {}, ["x[1]", "x[10]"]),
    "pwm": (0.02, 0.00002, {}, ["i"]),
    "axis": (1.0, 0.002, {}, ["x", "y"]),
    "gearbox": (4.0, 0.002, {}, ["drive", "load"]),
}
INPUTS = {"gearbox": {"torque": lambda t: 0.013 * math.sin(math.pi * t)}}  # N.m; others rest


def built(name: str, folder: Path) -> Path:
    """The FMU of an example."""
    file = FOLDER / f"{name}.toml"
    command = [sys.executable, "-P", "-m", "rparm", "build", file, "--output", folder / name]
    subprocess.run(command, check=True, capture_output=True)
    (fmu,) = (folder / name).glob("*.fmu")
    return fmu


figure, axes = plt.subplots(3, 5, figsize=(16, 8), layout="constrained")
with tempfile.TemporaryDirectory() as folder:
    for axis, (name, (stop, step, start, drawn)) in zip(axes.flat, RUNS.items(), strict=True):
        fmu = built(name, Path(folder))
        given = {"start_values": start, "inputs": INPUTS.get(name, {})}
        table = rparm.simulate(fmu, stop_time=stop, step=step, **given)
        x, *curves = drawn if drawn[0].startswith("(") else ["time", *drawn]
        x = x.strip("()")
        for curve in curves:
            axis.plot(table[x], table[curve], linewidth=1)
        axis.set_title(name, fontsize=10)
        axis.set_xlabel(f"{x} ({table.units[x]})")
        axis.set_ylabel(f"{', '.join(curves)} ({table.units[curves[0]]})")
        if x != "time":
            axis.set_aspect("equal", "datalim")
        print(f"{name}: {', '.join(curves)} over {x}, {len(table['time'])} points")
if len(sys.argv) > 1:
    figure.savefig(sys.argv[1], dpi=80)
