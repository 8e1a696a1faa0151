"""Runs the three models of docs/friction-and-stops.md and draws the picture of that page.

PYTHONPATH=. build/venv/bin/python examples/friction_and_stops.py [PICTURE]
"""

import math
import re
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import rparm

PAGE = Path(__file__).resolve().parents[1] / "docs" / "friction-and-stops.md"
MODEL = re.compile(r'^```toml\n(name = "(\w+)"\n.*?)^```', re.MULTILINE | re.DOTALL)


def built(folder: Path) -> dict[str, Path]:
    """The FMU of each model of the page, by its name."""
    found = {}
    for text, name in MODEL.findall(PAGE.read_text(encoding="utf-8")):
        file = folder / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        found[name], _ = rparm.build(file, output=folder)
    return found


def torque(t: float) -> float:
    return 0.013 * math.sin(math.pi * t)  # N.m


def pressure(t: float) -> float:
    return 1.2e5 * min(t, 40.0 - t) / 20.0  # Pa


with tempfile.TemporaryDirectory() as folder:
    fmus = built(Path(folder))
    belt = rparm.simulate(fmus["Belt"])
    gearbox = rparm.simulate(fmus["Gearbox"], inputs={"torque": torque})
    valve = rparm.simulate(fmus["Valve"], inputs={"p": pressure})

figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13, 3.6), layout="constrained")
for name, label in (("x", "position (m)"), ("v", "velocity (m/s)")):
    left.plot(belt["time"], belt[name], label=label)
left.set(title="a block on a belt", xlabel="time (s)", ylim=(-0.65, 0.45))
left.legend(loc="upper right", ncols=2)
for name, label in (("drive", "motor"), ("load", "load")):
    middle.plot(gearbox["time"], np.degrees(gearbox[name]), label=label)
middle.set(title="a gearbox with backlash", xlabel="time (s)", ylabel="angle at the load (deg)")
middle.set_ylim(-8, 20)
middle.legend(loc="upper right", ncols=2)
signal = [pressure(t) / 1e5 for t in valve["time"]]
right.plot(signal, valve["x"] * 1e3)
right.set(title="a valve with stiction", xlabel="pressure (bar)", ylabel="opening (mm)")
if len(sys.argv) > 1:
    figure.savefig(sys.argv[1], dpi=80)

slips = belt["time"][np.argmax(belt["x"] > 0.2)]
play = np.degrees(np.abs(gearbox["drive"] - gearbox["load"]).max())
opens = signal[int(np.argmax(valve["x"] > 0))]
print(f"slips at {slips:.2f} s; motor and load differ by {play:.3f} deg; opens at {opens:.3f} bar")
