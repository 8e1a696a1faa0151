"""What the report animates of the closed loop: the arm, and the motion that it has to follow."""

from rparm.models.rp_manipulator.animation import EFFORTS, JOINTS, acting, drawn, geometry, joints

from rparm.report.motion import Animation, Recorded


def animation(recorded: Recorded) -> Animation:
    """The arm under the controller's efforts, its reference motion as a ghost."""
    arm, controller = recorded.component("arm"), recorded.component("controller")
    wanted = recorded.component("trajectory").columns
    return drawn(
        joints(arm) | {name: acting(controller, name) for name in EFFORTS},
        {name: wanted[f"{name}_ref"] for name in JOINTS},
        geometry(arm.values),
    )
