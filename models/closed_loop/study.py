"""What cosim asks of this folder: measures and picture of a run, and the study of the coupling.

cosim/system/study.py says what each name means.
"""

from pathlib import Path

import numpy as np

from cosim.system.comparison import Outcome
from cosim.system.study import Measure
from models.closed_loop.experiment import START, STEPS_PER_SECOND, STOP
from models.closed_loop.motion_figure import PICTURE, distance, figure

__all__ = ["EXPERIMENT", "MEASURES", "PICTURE", "figure", "study_coupling"]

EXPERIMENT = (START, STOP, 1 / STEPS_PER_SECOND)


def tracking_error(outcome: Outcome) -> float:
    """Largest distance of the end effector from its reference, mm."""
    return 1e3 * float(np.max(distance(outcome)))


MEASURES = (
    Measure(
        "tracking error",
        "mm",
        "largest distance of the end effector from its reference",
        tracking_error,
    ),
)


def study_coupling(ssp: Path, report: Path) -> bool:
    """Study what the coupling costs; see coupling.md."""
    from models.closed_loop.coupling.run_study import run  # only `coupling` needs it

    return run(report, ssp)
