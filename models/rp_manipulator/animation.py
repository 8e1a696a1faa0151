"""What the report animates of an arm, by the names of rparm/report/motion.py and arm.js."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rparm.fmi.model import Value
from rparm.report.motion import Animation, Recorded

JOINTS = ("q1", "q2")
EFFORTS = ("tau1", "f2")
VISIBLE = 1e-3  # rad, m: a ghost that is nearer to the arm would be hidden behind it


def animation(recorded: Recorded) -> Animation:
    """The arm with its efforts, and the reference where it is seen to be another motion."""
    columns = joints(recorded) | {name: acting(recorded, name) for name in EFFORTS}
    return drawn(columns, ghost(recorded), geometry(recorded.values))


def drawn(
    columns: dict[str, np.ndarray | None],
    reference: dict[str, np.ndarray] | None,
    arm: dict[str, Any],
) -> Animation:
    """Add where the links end to what is drawn."""
    q1, q2 = (columns[name] for name in JOINTS)
    along = np.exp(1j * q1)
    across, tip = 1j * arm["a"] * along, (arm["l1"] + q2) * along
    elbow = arm["l1"] * along
    links = np.array([0 * tip, elbow, elbow + across, tip + across])
    return Animation(columns, reference, arm, np.array([links.real, links.imag]))


def joints(recorded: Recorded) -> dict[str, np.ndarray | None]:
    """Joint variables, (rows,) each: rad, m."""
    return {name: recorded.columns[name] for name in JOINTS}


def acting(recorded: Recorded, name: str) -> np.ndarray | None:
    """An effort or a force, (rows,); None if it does not act."""
    values = recorded.columns.get(name)
    return values if values is not None and values.any() else None


def ghost(recorded: Recorded) -> dict[str, np.ndarray] | None:
    """Return joint variables of the reference, unless it covers the arm."""
    if not recorded.references:
        return None
    reference = {name: recorded.references[name] for name in JOINTS}
    apart = max(np.abs(recorded.columns[name] - reference[name]).max() for name in JOINTS)
    return None if apart < VISIBLE else reference


def geometry(values: Mapping[str, Value]) -> dict[str, Any]:
    """Return lengths of the arm in m, and gravity in m/s2."""
    lengths = {name: values[name] for name in ("a", "l1", "lc1", "g")}
    return lengths | {"stops": None, "wall": None, "payload": None}
