"""How much dry friction takes from a swing: the same fall with three frictions, by rparm.

PYTHONPATH=. build/venv/bin/python examples/with_rparm.py [PICTURE]
"""

import sys

import matplotlib.pyplot as plt

import rparm

figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
for friction in (0.0, 0.5, 1.0):  # N.m
    table = rparm.simulate(
        rparm.fmu("RPPlant", fmi=3),
        stop_time=6.0,
        step=0.01,
        start_values={
            "q1": "-60 deg",
            "coulomb_friction1": friction,
            "breakaway_friction1": friction,
            "lower2": 0.0,  # the slide rests on its lower stop
            "breakaway_friction2": 100.0,
            "coulomb_friction2": 100.0,
        },
        outputs=["q1", "total_energy"],
    )
    axis.plot(table["time"], table["q1"], label=f"{friction} N.m")
    print(f"{friction} N.m: loses {table['total_energy'][0] - table['total_energy'][-1]:.4f} J")
axis.set_xlabel("time (s)")
axis.set_ylabel("q1 (rad)")
axis.legend(title="friction")
if len(sys.argv) > 1:
    figure.savefig(sys.argv[1], dpi=80)
