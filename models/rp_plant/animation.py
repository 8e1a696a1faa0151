"""What the report animates: the arm with stops, payload, modes of friction and the force on it."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from rparm.models.rp_manipulator.animation import EFFORTS, acting, drawn, ghost, joints
from rparm.models.rp_manipulator.animation import geometry as arm_geometry

from rparm.fmi.model import Value
from rparm.report.motion import Animation, Recorded

FORCES = ("ee_fx", "ee_fy")
WITHOUT_STOPS = 1  # item of stops1 and stops2
GRASP_AT_REST = 2  # item of grasp


def animation(recorded: Recorded) -> Animation:
    """The plant, driven by its inputs."""
    columns = joints(recorded) | plant_columns(recorded)
    columns |= {name: acting(recorded, name) for name in (*EFFORTS, *FORCES)}
    return drawn(columns, ghost(recorded), geometry(recorded.values))


def plant_columns(recorded: Recorded) -> dict[str, np.ndarray | None]:
    """Modes of friction and the payload, (rows,) each; None: not recorded, or never attached."""
    modes = {name: recorded.columns.get(name) for name in ("mode1", "mode2")}
    attached = recorded.columns.get("payload_attached")
    return {
        **{name: mode if mode is None else mode.astype(int) for name, mode in modes.items()},
        "payload_attached": None if attached is None else attached.astype(bool),
    }


def geometry(values: Mapping[str, Value]) -> dict[str, Any]:
    """The arm's geometry with stops (rad, m), and the payload's center of mass in frame 2 (m)."""
    stops = {
        f"q{joint}": None
        if values[f"stops{joint}"] == WITHOUT_STOPS
        else [values[f"lower{joint}"], values[f"upper{joint}"]]
        for joint in (1, 2)
    }
    payload = {
        "x": values["payload_x"],
        "z": values["payload_z"],
        "at_rest": values["grasp"] == GRASP_AT_REST,
    }
    return arm_geometry(values) | {"stops": stops, "payload": payload}
