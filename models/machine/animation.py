"""What the report animates of the machine: plant, efforts of the drives, payload, wall."""

from rparm.models.rp_manipulator.animation import EFFORTS, JOINTS, acting, drawn, joints
from rparm.models.rp_plant.animation import FORCES, geometry, plant_columns

from rparm.report.motion import Animation, Recorded

WALL = ("position", "angle", "tip_x", "tip_z")


def animation(recorded: Recorded) -> Animation:
    """The plant with its reference motion as a ghost."""
    plant, actuator, wall = map(recorded.component, ("plant", "actuator", "environment"))
    trajectory = recorded.component("trajectory").columns
    columns = joints(plant) | plant_columns(plant)
    columns |= {name: acting(actuator, name) for name in EFFORTS}
    columns |= {name: acting(wall, name) for name in FORCES}
    attached = trajectory.get("payload_attached")  # campaigns record Reals only
    columns["payload_attached"] = None if attached is None else attached.astype(bool)
    arm = geometry(plant.values) | {"wall": {name: wall.values[name] for name in WALL}}
    return drawn(columns, {name: trajectory[f"{name}_ref"] for name in JOINTS}, arm)
