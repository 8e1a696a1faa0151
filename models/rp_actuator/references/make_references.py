"""Makes the reference trajectories of the drives, without the code that they check.

Between two communication points the inputs rest, and with them the current that the loop follows:
each current approaches it by exp(-t/T), in closed form with 40 digits. What the limits allow is
solved from the voltages, one case after the other, and not by clipping currents as the C code does.
"""

import numpy as np
from mpmath import mp, mpf

from rparm.models import reference_files
from rparm.runs.scenario import Scenario

INPUTS = ("tau1_cmd", "f2_cmd", "dq1", "dq2")
OUTPUTS = ("tau1", "f2", "current1", "current2", "voltage1", "voltage2")

mp.dps = 40


class Drive:
    """The drive of one joint, with the inputs of one step."""

    def __init__(self, value: dict[str, mpf], joint: int) -> None:
        """Take what concerns the joint (1, 2) from all values of the model."""
        self.constant = value[f"torque_constant{joint}"] * value[f"gear_ratio{joint}"]
        self.resistance = value[f"resistance{joint}"]
        self.current_max = value[f"current_max{joint}"]
        self.voltage_max = value[f"voltage_max{joint}"]
        self.time_constant = value[f"time_constant{joint}"]
        self.back_emf = self.constant * value[f"dq{joint}"]
        self.commanded = value["tau1_cmd" if joint == 1 else "f2_cmd"] / self.constant

    def voltage(self, current: mpf) -> mpf:
        """Voltage in V at a current in A."""
        return self.resistance * current + self.back_emf

    @property
    def limited(self) -> mpf:
        """Current in A that the loop follows."""
        # the voltages that the currents within the limit need
        lowest, highest = self.voltage(-self.current_max), self.voltage(self.current_max)
        if lowest >= self.voltage_max:
            return -self.current_max
        if highest <= -self.voltage_max:
            return self.current_max
        needed = self.voltage(self.commanded)
        given = max(lowest, -self.voltage_max, min(highest, self.voltage_max, needed))
        return (given - self.back_emf) / self.resistance

    def after(self, current: mpf, h: mpf) -> mpf:
        """Current in A a time h (s) after `current`."""
        limited = self.limited
        return limited + (current - limited) * mp.exp(-h / self.time_constant)


def outputs(scenario: Scenario) -> dict[str, np.ndarray]:
    """Return the columns of OUTPUTS, (n + 1,) each."""
    start = {name: mpf(float(value)) for name, value in scenario.start_values.items()}
    times = [mpf(float(t)) for t in scenario.times]
    currents = [start["current1"], start["current2"]]
    rows = []
    for i, held in enumerate(reference_files.held_rows(scenario, INPUTS)):
        value = start | {n: mpf(float(x)) for n, x in zip(INPUTS, held, strict=True)}
        drives = [Drive(value, joint) for joint in (1, 2)]
        if i > 0:
            h = times[i] - times[i - 1]
            currents = [drive.after(c, h) for drive, c in zip(drives, currents, strict=True)]
        pairs = list(zip(drives, currents, strict=True))
        efforts = [drive.constant * current for drive, current in pairs]
        voltages = [drive.voltage(current) for drive, current in pairs]
        rows.append([float(x) for x in (*efforts, *currents, *voltages)])
    return dict(zip(OUTPUTS, np.array(rows).T, strict=True))
