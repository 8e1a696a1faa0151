"""What rparm asks of this folder: measures and diagrams of a run, and the study of the coupling.

rparm/systems/comparison.py says what each name means.
"""

from pathlib import Path

from rparm.models.closed_loop.experiment import START, STEPS_PER_SECOND, STOP
from rparm.models.tracking import tracking_error

from rparm.systems.comparison import Diagram, Rest

ARM = "arm"  # the component
EXPERIMENT = (START, STOP, 1 / STEPS_PER_SECOND)
COUPLING_PICTURE = "coupling.png"

MEASURES = (tracking_error(ARM),)

DIAGRAMS = (
    Diagram("joint 1", ["arm.q1"], {"arm.q1": "trajectory.q1_ref"}),
    Diagram("joint 2", ["arm.q2"], {"arm.q2": "trajectory.q2_ref"}),
    Diagram("tracking error of joint 1", ["controller.q1_error"]),
    Diagram("tracking error of joint 2", ["controller.q2_error"]),
    Diagram("torque", ["controller.tau1"]),
    Diagram("force", ["controller.f2"]),
    Diagram(
        "end effector",
        ["arm.ee_x", "arm.ee_y"],
        {"arm.ee_x": "trajectory.ee_x_ref", "arm.ee_y": "trajectory.ee_y_ref"},
    ),
    Diagram("energy of the arm", ["arm.kinetic_energy", "arm.potential_energy"]),
)


# the arm waits at the start of its motion; the controller steps first, as coupling.md advises
REST = Rest(
    "nominal",
    ["arm.q1", "arm.q2"],
    ["arm.q1", "arm.q2", "arm.dq1", "arm.dq2"],
    {"trajectory.start_time": 1e4},
    sequence=["controller", "arm", "trajectory"],
)


def study_coupling(ssp: Path, report: Path) -> dict[str, dict[str, object]]:
    """Study what the coupling costs; see coupling.md."""
    from rparm.models.closed_loop.coupling.report import run  # only `coupling` needs it

    return run(report / COUPLING_PICTURE, ssp)
