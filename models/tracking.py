"""The measure that systems share: how far the end effector is from its reference."""

import numpy as np

from rparm.systems.comparison import Measure, Outcome


def tracking_error(arm: str) -> Measure:
    """Return the largest distance of the end effector of the component `arm` from its reference."""

    def value(outcome: Outcome) -> float:
        away = [outcome.column(f"{arm}.ee_{x}") - outcome.column(f"trajectory.ee_{x}_ref")
                for x in "xy"]  # fmt: skip
        return 1e3 * float(np.hypot(*away).max())

    meaning = "largest distance of the end effector from its reference"
    return Measure("tracking error", "mm", meaning, value)
