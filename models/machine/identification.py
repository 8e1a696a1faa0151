"""Logs of the machine, to identify the plant's parameters from.

rparm/identification/request.py says what `demo` gives. The machine lies flat, so that the efforts
of a log lead an arm through the same motion again: under gravity it would run away. Its end
effector moves on circles. A log has the efforts of the motors, and what the encoders show: counts
with noise, two ticks late.
"""

from pathlib import Path

import numpy as np
from rparm.models.machine.systems import VARIANT, changed

from rparm import files, project
from rparm.fmi.model import Value
from rparm.identification.request import DELAY, Demo, Request
from rparm.systems import master, ssp

BASE = "noisy_sensor"  # the variant that all else is taken from
STOP, STEP = 8.0, 1e-3  # s
LATE = 3 * STEP  # two ticks, and the step over which the encoders' inputs are held
TRUE = {
    "m2": 1.15, "I1z": 0.13, "damping1": 0.25, "damping2": 4.0, "coulomb_friction1": 0.35,
    "coulomb_friction2": 0.6,
}  # fmt: skip
# what a data sheet would say
START = {"damping1": 0.2, "damping2": 5.0, "coulomb_friction1": 0.3, "coulomb_friction2": 0.5}
FLAT = {"g": 0.0}
CIRCLE = {
    "start_time": 0.2,
    "x_center": 0.4,
    "y_center": 0.1,
    "start_angle": 0.0,
    "ramp_time": 1.5,
    "grasp_time": 0.0,
    "release_time": 0.0,  # never grasped
}
LOGS = {
    "log.csv": {"frequency": 1.3, "turns": 7.5, "radius": 0.1},
    "second.csv": {"frequency": -0.9, "turns": 5.0, "radius": 0.08},
}
# columns of a log
COLUMNS = {
    "tau1": "actuator.tau1",
    "f2": "actuator.f2",
    "q1": "sensor.q1_measured",
    "q2": "sensor.q2_measured",
}


def demo(folder: Path) -> Demo:
    """Make both logs in a folder."""
    machine = project.built(project.systems()["machine"], ".ssp")
    for name, circle in LOGS.items():
        _write(machine, folder / name, circle)
    log, second = (folder / name for name in LOGS)
    request = Request(
        logs=[log],
        parameters=list(TRUE),
        inputs=["tau1", "f2"],
        measured=["q1", "q2"],
        settings=FLAT,
        starts=START,
        with_delay=True,
        validation=second,
    )
    return Demo(project.built(project.model("rp_plant"), ".fmu"), request, TRUE | {DELAY: LATE})


def _write(machine: Path, log: Path, circle: dict[str, float]) -> None:
    with ssp.unpacked(machine) as opened:
        values: dict[str, dict[str, Value]] = {
            name: dict(given) for name, given in opened.system.parameter_sets[BASE].items()
        }
        values["trajectory"] = CIRCLE | circle
        values["controller"] |= FLAT
        values["plant"] |= FLAT | TRUE | {"breakaway_friction1": 0.0, "breakaway_friction2": 0.0}
        other = changed(opened, values, STOP, STEP)
        run = master.run_in_master(other, VARIANT, list(COLUMNS.values()))
    files.write_trajectory(log, np.asarray(run.times), list(COLUMNS), run.values, None, True)
