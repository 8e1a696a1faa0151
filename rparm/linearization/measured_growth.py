"""By how much small deviations of a system grow in a step under a master: measured in a run."""

from collections.abc import Sequence

import numpy as np

from rparm.coupling.master import Master

STEPS = 500
EARLY = 100  # first steps, before the motion is that of the slowest eigenvalues
SEEN = 1e-7  # of the largest: combinations of signals that are above rounding


def growth(master: Master, step: float, signals: Sequence[str]) -> float:
    """Largest eigenvalue of what leads from two points of a run to the next, by least squares.

    Parameters
    ----------
    master : Master
        Initialized, a little out of an equilibrium.
    step : float
        s.
    signals : sequence of str
        Values that the motion shows in.
    """
    rows = master.run(master.time + np.arange(STEPS + 1) * step)[EARLY:]
    moved = np.diff(rows[:, [master.names.index(name) for name in signals]], axis=0)
    scaled = moved / np.abs(moved).max(axis=0)
    before, after = (
        np.hstack([scaled[i : len(scaled) - 2 + i], scaled[i + 1 : len(scaled) - 1 + i]])
        for i in (0, 1)
    )
    left, sizes, right = np.linalg.svd(before, full_matrices=False)
    seen = sizes > SEEN * sizes[0]
    leads = (right[seen].T / sizes[seen]) @ (left[:, seen].T @ after)
    return float(np.abs(np.linalg.eigvals(leads)).max())
