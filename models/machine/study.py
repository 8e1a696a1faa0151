"""What cosim asks of this folder: measures and picture of a run.

cosim/system/study.py says what each name means.
"""

import numpy as np

from cosim.system.comparison import Outcome
from cosim.system.study import Measure
from models.machine.experiment import START, STEPS_PER_SECOND, STOP
from models.machine.machine_figure import ARM, PICTURE, figure
from models.system_figure import tracking_error

__all__ = ["EXPERIMENT", "MEASURES", "PICTURE", "figure"]

EXPERIMENT = (START, STOP, 1 / STEPS_PER_SECOND)


def contact_force(outcome: Outcome) -> float:
    """Largest force of the wall, N."""
    return float(np.max(outcome.column("environment.wall_force")))


def stuck(outcome: Outcome) -> float:
    """Share of the time for which joint 1 sticks, %."""
    return 100 * float(np.mean(outcome.column("plant.mode1") == 0))


MEASURES = (
    tracking_error(ARM),
    Measure("contact force", "N", "largest force of the wall", contact_force),
    Measure("stuck", "%", "share of the time for which friction holds joint 1", stuck),
)
