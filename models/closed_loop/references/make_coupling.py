"""Makes the reference of the study of the coupling: a motion with a fast and a slow part.

The closed loop in continuous time, by the functions that make the other references; the motion is
that of ../coupling/step_doubling.py. Writes models/closed_loop/coupling/fast_and_slow.csv.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parents[2]
sys.path.insert(0, str(ROOT))

from rparm.models.closed_loop.coupling.loop import STATES  # noqa: E402
from rparm.models.closed_loop.coupling.step_doubling import (  # noqa: E402
    FAST,
    FAST_AND_SLOW,
    FAST_STOP,
)
from rparm.models.closed_loop.references.closed_loop import monolithic  # noqa: E402

from rparm import files  # noqa: E402

ROWS_PER_SECOND = 50
PARAMETERS = {f"{c}.{name}": value for c, values in FAST.items() for name, value in values.items()}


def write(output: Path) -> None:
    times = np.arange(round(FAST_STOP * ROWS_PER_SECOND) + 1) / ROWS_PER_SECOND
    columns = monolithic(PARAMETERS, times)
    values = np.column_stack([columns[name] for name in STATES]).astype(np.float64) + 0.0
    files.write_trajectory(output, times, STATES, values)


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes the reference of the study of coupling.")
    parser.add_argument("--output", type=Path, default=FAST_AND_SLOW, metavar="FILE")
    output = parser.parse_args().output
    output.parent.mkdir(parents=True, exist_ok=True)
    write(output)


if __name__ == "__main__":
    main()
