"""A log of the arm with a torque that goes with its angle, as a motor's cogging: not in the FMU."""

from pathlib import Path

import numpy as np

from rparm.fmi.fmu_file import Fmu
from tests.identification.synthetic import ARM, MEASURED, STEP, efforts, save

HEIGHT, PERIODS = 0.05, 12  # N.m, 1 a turn


def write(path: Path, seed: int) -> Path:
    """Write the log of a random motion, with white noise."""
    random = np.random.default_rng(seed)
    times = STEP * np.arange(round(ARM.duration / STEP) + 1)
    told = efforts(times, random)
    seen = np.empty((len(times), 2))
    with Fmu(ARM.fmu) as fmu, fmu.instance("arm") as instance:
        instance.set_up(0.0, None, 1e-8)
        for name, value in {**ARM.true, "q1": -1.2, "q2": 0.1}.items():
            instance.set(name, value)
        instance.enter_initialization()
        instance.exit_initialization()
        inputs, outputs = instance.reals(["tau1", "f2"]), instance.reals(MEASURED)
        for row, (start, given) in enumerate(zip(times, told, strict=True)):
            outputs.get()
            seen[row] = outputs.view
            inputs.view[:] = given + [HEIGHT * np.sin(PERIODS * outputs.view[0]), 0.0]
            inputs.set()
            instance.do_step(start, STEP)
    save(path, times, told, seen + random.normal(size=seen.shape) * ARM.noise)
    return path
