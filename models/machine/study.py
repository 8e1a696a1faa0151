"""Measures and diagrams of the machine, by the names of rparm/systems/comparison.py."""

import numpy as np
from rparm.models.machine.experiment import START, STEPS_PER_SECOND, STOP
from rparm.models.tracking import tracking_error

from rparm.systems.comparison import Diagram, Measure, Outcome, Rest

ARM = "plant"  # the component
EXPERIMENT = (START, STOP, 1 / STEPS_PER_SECOND)


def contact_force(outcome: Outcome) -> float:
    """Return the largest force of the wall, N."""
    return float(np.max(outcome.column("environment.wall_force")))


def stuck(outcome: Outcome) -> float:
    """Share of the time for which joint 1 sticks, %."""
    return 100 * float(np.mean(outcome.column("plant.mode1") == 0))


MEASURES = (
    tracking_error(ARM),
    Measure("contact force", "N", "largest force of the wall", contact_force),
    Measure("stuck", "%", "share of the time for which friction holds joint 1", stuck),
)

# in the order in which signals flow
DIAGRAMS = (
    Diagram("joint 1", ["plant.q1"], {"plant.q1": "trajectory.q1_ref"}),
    Diagram("joint 2", ["plant.q2"], {"plant.q2": "trajectory.q2_ref"}),
    Diagram("measured velocity of joint 1", ["sensor.dq1_measured", "plant.dq1"]),
    Diagram("measured velocity of joint 2", ["sensor.dq2_measured", "plant.dq2"]),
    Diagram("tracking error of joint 1", ["controller.q1_error"]),
    Diagram("tracking error of joint 2", ["controller.q2_error"]),
    Diagram("torque: wanted, of the motor", ["controller.tau1", "actuator.tau1"]),
    Diagram("force: wanted, of the motor", ["controller.f2", "actuator.f2"]),
    Diagram("currents of the motors", ["actuator.current1", "actuator.current2"]),
    Diagram("voltages of the motors", ["actuator.voltage1", "actuator.voltage2"]),
    Diagram("modes of friction", ["plant.mode1", "plant.mode2"]),
    Diagram("force of the wall", ["environment.wall_force"]),
    Diagram("wrench at the end effector", ["environment.ee_fx", "environment.ee_fy"]),
    Diagram("payload attached", ["trajectory.payload_attached"]),
)

# friction would hold it
REST = Rest(
    "wall_contact",
    ["plant.q1", "plant.q2"],
    ["plant.q1", "plant.q2", "plant.dq1", "plant.dq2"],
    {"trajectory.start_time": 1e4}
    | {f"plant.{k}_friction{i}": 0.0 for k in ("coulomb", "breakaway") for i in (1, 2)},
    without=["sensor"],
)
