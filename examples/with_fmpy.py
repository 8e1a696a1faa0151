"""The plant in fmpy: while a torque swings the arm, the slide sticks and slips by dry friction.

build/venv/bin/python examples/with_fmpy.py [FMU] [PICTURE]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

path = sys.argv[1] if len(sys.argv) > 1 else "build/RPPlant.fmu"
times = np.arange(0.0, 2.001, 0.001)  # s
efforts = np.empty(len(times), dtype=[("time", float), ("tau1", float), ("f2", float)])
efforts["time"] = times
efforts["tau1"] = 4.0 * np.sin(2.0 * np.pi * times)  # N.m
efforts["f2"] = -9.81 + 7.0 * np.sin(2.0 * np.pi * times)  # N

result = simulate_fmu(
    path,
    stop_time=2.0,
    step_size=0.001,
    input=efforts,
    start_values={"q1": -1.5, "coulomb_friction2": 5.0, "breakaway_friction2": 5.0},
    output=["q1", "q2", "total_energy"],
)

figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7, 4), layout="constrained")
for axis, name, unit in zip(axes, ("q1", "q2"), ("rad", "m"), strict=True):
    axis.plot(result["time"], result[name])
    axis.set_ylabel(f"{name} ({unit})")
axes[1].set_xlabel("time (s)")
if len(sys.argv) > 2:
    figure.savefig(sys.argv[2], dpi=80)
print(f"q1 = {result['q1'][-1]:.6f} rad, q2 = {result['q2'][-1]:.6f} m")
