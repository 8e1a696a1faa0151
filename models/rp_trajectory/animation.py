"""What the report animates: the arm on its reference motion."""

from rparm.models.rp_manipulator.animation import JOINTS, drawn

from rparm.report.motion import Animation, Recorded

UNKNOWN = dict.fromkeys(("lc1", "g", "stops", "wall", "payload"))  # to this model


def animation(recorded: Recorded) -> Animation:
    """The arm where the reference motion wants it."""
    columns = {name: recorded.columns[f"{name}_ref"] for name in JOINTS}
    arm = {name: recorded.values[name] for name in ("a", "l1")} | UNKNOWN
    return drawn(columns, None, arm)
