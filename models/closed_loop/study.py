"""What cosim asks of this folder: measures and picture of a run, and the study of the coupling.

cosim/system/study.py says what each name means.
"""

from pathlib import Path

from models.closed_loop.experiment import START, STEPS_PER_SECOND, STOP
from models.closed_loop.motion_figure import ARM, PICTURE, figure
from models.system_figure import tracking_error

__all__ = ["EXPERIMENT", "MEASURES", "PICTURE", "figure", "study_coupling"]

EXPERIMENT = (START, STOP, 1 / STEPS_PER_SECOND)


MEASURES = (tracking_error(ARM),)


def study_coupling(ssp: Path, report: Path) -> bool:
    """Study what the coupling costs; see coupling.md."""
    from models.closed_loop.coupling.run_study import run  # only `coupling` needs it

    return run(report, ssp)
